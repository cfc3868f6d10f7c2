"""The scenario that an import writes: what the model states, and questions with usual values for the rest."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from tendonff.compensator.files.reading import FloatArray
from tendonff.compensator.mjcf.dynamics import JointNumbers
from tendonff.compensator.mjcf.model import Hand, Route
from tendonff.compensator.mjcf.tabulate import Part
from tendonff.models.path_table import PathTable

LEAST_TENSION_N = 5.0
_FEWEST_MASSES = 12
_LOST_INERTIA = 1e-7

_HEAD = """# Tendons of {model}, imported by tendonff. Lengths, bends and moment arms are the model's, tables in
# {stem}_TENDON.csv. Lines with QUESTION are what a MuJoCo model does not know; the values are usual ones (estimates for
# planning) until you measure them. After a change of [reference] run the same command again: it keeps this file, and
# writes the torques of inertia and gravity anew.

schema = 1
name = "{name}"
"""

_TENDON = """
# QUESTION: the tendon. Stiffness is EA/L of the whole length from drum to insertion.
[tendon]
mass_kg = 2.0e-3                      # weigh it
stiffness_N_per_m = 2.0e4             # 5e3 to 1e5 for hands; polyethylene 60 to 100 GPa, steel rope 60 to 120 GPa
relaxing_stiffness_N_per_m = 3.0e3    # 10 to 40 % of the lasting one for polymers; steel: 0
relaxation_time_s = 0.2               # 0.1 to 10
damping_N_s_per_m = 0.5

# QUESTION: friction, of all sites and geoms that state no coefficient of their own. `tendonff identify` measures it.
[friction]
mu_dynamic = 0.15                     # polyethylene in PTFE 0.05 to 0.2, on aluminium or printed parts 0.1 to 0.3
viscous_N_s_per_m = 1.0
bristle_stiffness_N_per_m = 1.0e6     # 20 to 100 times the tendon's stiffness
soft_bristle_stiffness_N_per_m = 3.0e5
"""

_CHANNEL = """# QUESTION: the way from the drum to the model's first site: sum of all bends, and length:
# [[tendons.path.sections]]
# name = "channel"
# angle_rad = 2.0                     # a tube through a palm or an arm: 1 to 4
# length_m = 0.25
"""

_DRUMS = """
# QUESTION: drum radius up to the middle of the tendon; positive: it takes the tendon in as it turns to positive angles.
# Two tendons on one motor are a loop: drums_m = { flexor = 0.008, extensor = -0.008 }, pretension_N = 10.0.
"""

_DRIVE = """
[drive]                               # QUESTION: of every motor that states no other value; from its data sheet
gear_ratio = 1.0                      # turns of the commanded shaft for one of the drum
speed_max_rad_per_s = 8.0             # a small serial servo without load: 5 to 10
torque_max_N_m = 1.0                  # at the commanded shaft; 0.4 to 3

[sharing]                             # how tendons share torques that several could give
least_tension_N = {least:.1f}                 # QUESTION: the pre-tension that you allow: no tendon goes below it
smooth_N = 2.0
change_weight = 10.0
"""


def torque_file(target: Path) -> Path:
    """File of the torques along the reference."""
    return target.with_name(f"{target.stem}_torques.csv")


def scenario_text(
    hand: Hand,
    parts: Mapping[str, Sequence[Part]],
    numbers: Sequence[JointNumbers],
    target: Path,
    poses_rad: FloatArray | None,
) -> str:
    """Text of the scenario; `poses_rad`, shape (2, joints), is where its first reference goes from and to."""
    title = f"{hand.path.stem}: {len(hand.routes)} tendons, {len(hand.joints)} joints".replace('"', "'")
    text = _HEAD.format(model=hand.path.name, stem=target.stem, name=title.replace("\\", "/"))
    for joint, own in zip(hand.joints, numbers, strict=True):
        text += _joint(joint.name, own, torque_file(target).name, joint.low_rad, joint.high_rad)
    text += _TENDON
    for route in hand.routes:
        text += _tendon(route, parts.get(route.name, ()), target)
    text += _DRUMS
    for route in hand.routes:
        text += f'[[motors]]\nname = "{route.motor}"\ndrums_m = {{ {route.name} = 0.008 }}\n'
    return text + _DRIVE.format(least=LEAST_TENSION_N) + _reference(hand, poses_rad)


def _joint(name: str, own: JointNumbers, torques: str, low: float, high: float) -> str:
    text = f'\n[joints.{name}]                        # {low:.3g} to {high:.3g} rad in the tables\nkind = "driven"\n'
    text += f"inertia_kg_m2 = {max(own.inertia_kg_m2, _LOST_INERTIA):.6g}\n"
    if own.damping_N_m_s_per_rad > 0:
        text += f"damping_N_m_s_per_rad = {own.damping_N_m_s_per_rad:.6g}\n"
    else:
        text += "damping_N_m_s_per_rad = 1.0e-3        # QUESTION: the model has none; 1e-4 to 1e-2\n"
    if own.stiffness_N_m_per_rad > 0:
        text += f"stiffness_N_m_per_rad = {own.stiffness_N_m_per_rad:.6g}\nrest_rad = {own.rest_rad:.6g}\n"
    if own.coulomb_N_m > 0:
        text += f"coulomb_N_m = {own.coulomb_N_m:.6g}\n"
    return text + f'torques = "{torques}"   # inertia of the other joints and gravity along the reference\n'


def _tendon(route: Route, parts: Sequence[Part], target: Path) -> str:
    text = f'\n[[tendons]]\nname = "{route.name}"\n'
    if not route.intervals:
        arms = ", ".join(f"{joint} = {arm:.9g}" for joint, arm in route.arms_m.items())
        text += f"moment_arms_m = {{ {arms} }}   # a fixed tendon of the model\n"
        text += f"[tendons.path]\nsegments = {_FEWEST_MASSES}\n"
        return (
            text + "total_angle_rad = 2.0                 # QUESTION: sum of all bends from drum to insertion; 1 to 6\n"
        )
    text += f'paths = "{target.stem}_{route.name}.csv"\n[tendons.path]\n'
    touching = sum(isinstance(bend := part.measures.angle_rad, PathTable) or bend > 0 for part in parts)
    text += f"segments = {max(_FEWEST_MASSES, touching + 4)}                         # lumped masses\n{_CHANNEL}"
    for part in parts:
        text += f'[[tendons.path.sections]]\nname = "{part.name}"\n'
        if part.guide:
            text += f"# mu_dynamic = 0.15                   # QUESTION: of {part.guide} alone\n"
    return text


def _reference(hand: Hand, poses_rad: FloatArray | None) -> str:
    if poses_rad is None:
        middle = np.array([0.5 * (joint.low_rad + joint.high_rad) for joint in hand.joints])
        reach = np.array([0.1 * (joint.high_rad - joint.low_rad) for joint in hand.joints])
        poses_rad = np.vstack([middle - reach, middle + reach])
    text = """
[reference]
kind = "waypoints"                    # or "sine", or "csv" with the columns time_s,JOINT_rad
times_s = [0.0, 0.8, 1.2, 2.4, 3.0]
shape = "smooth"
"""
    for joint, (start, end) in zip(hand.joints, poses_rad.T, strict=True):
        angles = ", ".join(f"{angle:.4g}" for angle in (start, end, end, start, start))
        text += f"[reference.joints.{joint.name}]\nangles_rad = [{angles}]\n"
    return (
        text
        + """
[run]
step_s = 0.001
level = "presliding"

[robust]                              # how well the values are known: relative half-widths; a measurement narrows them
mu = 0.2
stiffness = 0.2
"""
    )
