"""Import of a MuJoCo model: scenario, path tables, joint torques and survey, all beside one another."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline

from tendonff.compensator.files.reading import FloatArray, InputError, read_text
from tendonff.compensator.files.writing import write_csv, write_text
from tendonff.compensator.mjcf.dynamics import Dynamics
from tendonff.compensator.mjcf.model import Hand, read_hand, sweep_poses
from tendonff.compensator.mjcf.survey import Survey, holdable, survey, survey_figure
from tendonff.compensator.mjcf.tabulate import Part, tabulate
from tendonff.compensator.mjcf.text import LEAST_TENSION_N, scenario_text, torque_file
from tendonff.compensator.reporting.plots import save_figure
from tendonff.compensator.scenario.driven.finger import FingerScenario, parse_finger_scenario, sample_finger
from tendonff.compensator.scenario.driven.paths import write_paths
from tendonff.models.joint.parameters.finger import Finger
from tendonff.models.mechanism.static import local_arms_m
from tendonff.models.turns import in_turn

_STARTS = 60  # poses among which the reference is looked for
_ALONG = 7
_MODERATE = 8.0  # largest tension of that reference over the least one


@dataclass(frozen=True, slots=True, kw_only=True)
class Import:
    """Result of an import.

    Attributes
    ----------
    scenario : FingerScenario
    survey : Survey
    notes : tuple of str
        What the user should know.
    kept : bool
        The scenario was there already; its tables and torques are new.
    """

    scenario: FingerScenario
    survey: Survey
    notes: tuple[str, ...]
    kept: bool


@in_turn
def import_mjcf(
    path: str | os.PathLike[str],
    *,
    tendons: Sequence[str] = (),
    joints: Sequence[str] = (),
    near: Sequence[str] = (),
    out: str | os.PathLike[str] | None = None,
) -> FingerScenario:
    """Make a scenario of a MuJoCo model's tendons; `run_import` gives the survey as well.

    Parameters
    ----------
    path : path-like
        MJCF, or a compiled model (.mjb).
    tendons, joints : sequence of str, optional
        Those to import; default: tendons that an actuator pulls, or all where none is pulled, and hinges that they
        cross. A joint may be given a range: NAME=LOW:HIGH [rad].
    near : sequence of str, optional
        Sites at which tendons come from their motors, where the model does not decide it.
    out : path-like, optional
        Scenario file to write, its tables and torques beside it; default: named like the model, in the working
        directory. One that exists is kept: its reference decides the torques that are written anew.

    Returns
    -------
    FingerScenario
        `scenario.mechanism.length_m(angles)`, `.wrap_angle_rad(angles)`, `.moment_arm_m(angles)` are the tendons'.

    Raises
    ------
    InputError
        If the model has no such tendons, or one that has no meaning here, with the way round.

    Examples
    --------
    >>> import tempfile
    >>> import numpy as np
    >>> import tendonff as tf
    >>> out = tempfile.mkdtemp() + "/finger.toml"
    >>> chosen = {"tendons": ["deep", "flat", "back"], "joints": ["pip", "dip"]}
    >>> scenario = tf.import_mjcf("examples/tendon_finger.xml", **chosen, out=out)
    >>> scenario.mechanism.names
    ('pip', 'dip')
    >>> scenario.mechanism.moment_arm_m(np.array([[0.6, 0.3]]))[0].round(4).tolist()
    [[0.01, 0.0068], [0.0104, 0.0], [-0.0075, -0.0042]]
    """
    return run_import(path, tendons=tendons, joints=joints, near=near, out=out).scenario


def run_import(
    path: str | os.PathLike[str],
    *,
    tendons: Sequence[str] = (),
    joints: Sequence[str] = (),
    near: Sequence[str] = (),
    out: str | os.PathLike[str] | None = None,
) -> Import:
    """`import_mjcf` with its survey."""
    hand = read_hand(Path(path), tendons, joints, near)
    target = Path(f"{Path(path).stem}.toml") if out is None else Path(out)
    dynamics = Dynamics(hand)
    parts = {route.name: tabulate(hand, route) for route in hand.routes if route.intervals}
    for name, own in parts.items():
        write_paths(target.with_name(f"{target.stem}_{name}.csv"), {part.name: part.measures for part in own})
    kept = target.exists()
    if kept:
        text = read_text(target)
    else:
        text = scenario_text(hand, parts, dynamics.numbers(), target, _angles(hand, dynamics, parts, target))
    scenario = parse_finger_scenario(text, target)
    _check_kept(scenario, hand, target)
    _write_torques(scenario, hand, dynamics)
    if not kept:
        write_text(target, text)
    found = survey(hand, _in_order(scenario.mechanism, hand).geometry(), scenario.mechanism.sharing.least_tension_N)
    save_figure(survey_figure(found), target.with_name(f"{target.stem}_survey"), ("svg",))
    return Import(scenario=scenario, survey=found, notes=(*hand.notes, *found.messages()), kept=kept)


def _in_order(finger: Finger, hand: Hand) -> Finger:
    """The finger with its joints in the order of the hand."""
    by_name = {joint.name: joint for joint in finger.joints}
    return replace(finger, joints=tuple(by_name[name] for name in hand.names))


def _check_kept(scenario: FingerScenario, hand: Hand, target: Path) -> None:
    missing = sorted(set(hand.names) ^ {joint.name for joint in scenario.mechanism.joints})
    routes = {tendon.name for tendon in scenario.mechanism.tendons} ^ {route.name for route in hand.routes}
    if missing or routes:
        raise InputError(
            f"{target.name} exists and has other joints or tendons ({', '.join([*missing, *sorted(routes)])}); name "
            "those that it has by --joint and --tendon, or choose another --out"
        )


def _write_torques(scenario: FingerScenario, hand: Hand, dynamics: Dynamics) -> None:
    """Torques along the reference besides what the joints' own keys say."""
    sampled = sample_finger(replace(scenario, torques={}))
    by_name = dict(zip(scenario.mechanism.names, sampled.angle_rad.T, strict=True))
    angle = np.column_stack([by_name[name] for name in hand.names])
    course = CubicSpline(sampled.time_s, angle)
    speed, acceleration = course(sampled.time_s, 1), course(sampled.time_s, 2)
    inertia = {joint.name: joint.inertia_kg_m2 for joint in scenario.mechanism.joints}
    torque = dynamics.torque_N_m(angle, speed, acceleration)
    torque -= acceleration * np.array([inertia[name] for name in hand.names])
    columns = {f"{name}_N_m": torque[:, k] for k, name in enumerate(hand.names)}
    write_csv(torque_file(scenario.source), {"time_s": sampled.time_s, **columns})


def _angles(hand: Hand, dynamics: Dynamics, parts: Mapping[str, Sequence[Part]], target: Path) -> FloatArray | None:
    """Two poses of a first reference, shape (2, joints), between which tensions hold the joints; None: not found."""
    poses = sweep_poses(hand, _STARTS, seed=11)
    low, high = (np.array([getattr(joint, end) for joint in hand.joints]) for end in ("low_rad", "high_rad"))
    poses = low + 0.1 * (high - low) + 0.8 * (poses - low)
    text = scenario_text(hand, parts, dynamics.numbers(), target, None)
    finger = _in_order(parse_finger_scenario(text, target).mechanism, hand)

    tendons = finger.geometry().tendons

    def holds(rows: FloatArray, way: FloatArray) -> bool:
        """Whether moderate tensions hold the joints with friction against either way."""
        held = dynamics.holding_N_m(rows)
        for pose, torque in zip(rows, held, strict=True):
            places = dict(zip(hand.names, pose.tolist(), strict=True))
            for speed in (way, -way):
                moving = dict(zip(hand.names, speed.tolist(), strict=True))
                local = [local_arms_m(tendon, places, moving) for tendon in tendons]
                arms = np.array([[own.get(name, 0.0) for name in hand.names] for own in local])
                if not holdable(arms, torque, LEAST_TENSION_N, _MODERATE * LEAST_TENSION_N):
                    return False
        return True

    good = [pose for pose in poses if holds(pose[None, :], high - low)]
    if not good:
        return None
    start = good[int(np.argmin([np.abs((pose - low) / (high - low) - 0.4).max() for pose in good]))]
    share = np.linspace(0.0, 1.0, _ALONG)[:, None]
    for end in sorted(good, key=lambda pose: -float(np.abs((pose - start) / (high - low)).min())):
        if not np.array_equal(start, end) and holds(start + share * (end - start), end - start):
            return np.vstack([start, end])
    return None
