"""Worst cases that `design` states for drives with several imperfections at once, beside independent plants.

    python -m benchmarks.crossings [COUNT [FIRST_SEED]]

Each seed draws a rig (a tension behind a force drive or a position servo, the load's position, a loop, a pair, a finger
of three joints), in a third of the cases in a cycle, lag, delay, interval and hold of the commands, resolution and
backlash, and what is uncertain. The
exact inverse is designed for it; its commands go through a drive written here to the plants of the tests, at the
scenario's numbers and where the worst case is stated to be. The last column is the stated worst case over the plant's.
"""

import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tendonff.compensator.compensators.base import Problem, with_motion
from tendonff.compensator.compensators.every import compensator_of
from tendonff.compensator.compensators.motors.finger import FingerTask
from tendonff.compensator.compensators.motors.joint import JointTask
from tendonff.compensator.compensators.registry import compensator
from tendonff.compensator.scenario.reference import Quantity, Shape, SineReference, WaypointReference
from tendonff.compensator.scenarios import load_scenario
from tendonff.models.joint.parameters import JointDrive
from tendonff.models.joint.parameters.drive import DriveKind
from tendonff.models.parameters.drive import Drive
from tendonff.models.parameters.uncertainty import Spread, Uncertainty
from tendonff.models.servo import CommandHold, Servo
from tendonff.ocp.errors import SolveError
from tests import finger_plant, independent_plant, joint_plant

Array = NDArray[np.float64]
EXAMPLES = Path(__file__).resolve().parents[1] / "examples"
PARTS = 5
"""Rows of the plants' drives to a row of the command."""
CYCLES = 4
"""Periods after which plants are in their steady cycle."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Crossing:
    """A rig behind its drive, and its errors in percent of range."""

    rig: str
    cycle: bool
    drive: str
    nominal_said: float
    nominal_true: float
    worst_said: float
    worst_true: float


def drawn(rng: np.random.Generator, *, resolution: float, backlash: float) -> dict[str, Any]:
    """Imperfections of a drive: each is there as often as not."""
    found: dict[str, Any] = {}
    if rng.random() < 0.7:
        found["servo_time_s"] = round(float(rng.uniform(0.003, 0.03)), 4)
    if rng.random() < 0.6:
        found["delay_s"] = round(float(rng.uniform(0.001, 0.012)), 4)
    if rng.random() < 0.6:
        found["command_interval_s"] = float(rng.choice([0.005, 0.01, 0.02]))
        found["command_hold"] = CommandHold(rng.choice([str(hold) for hold in CommandHold]))
    if rng.random() < 0.5:
        found["resolution"] = resolution
    if backlash and rng.random() < 0.4:
        found["backlash"] = backlash
    return found


def cycles(command: Array, cycle: bool) -> Array:
    """Rows of a command, of a cycle over its periods; into the first it goes from zero."""
    if not cycle:
        return command
    rows = len(command) - 1
    rise = np.minimum(np.arange(CYCLES * rows + 1) / (0.1 * rows), 1.0)
    found = np.concatenate([*[command[:-1]] * CYCLES, command[-1:]])
    risen: Array = found * (rise if command.ndim == 1 else rise[:, None])
    return risen


def behind(servo: Servo, command: Array, step_s: float) -> Array:
    """Answer of a drive, `PARTS` rows to one of its command: samples, hold, delay, lag (trapezoidal rule) and play."""
    if command.ndim == 2:
        return np.column_stack([behind(servo, column, step_s) for column in command.T])
    fine = np.arange((len(command) - 1) * PARTS + 1) * (step_s / PARTS)
    interval = max(servo.command_interval_s or 0.0, step_s)
    at = np.arange(0.0, fine[-1] + interval, interval)
    samples = np.interp(at, np.arange(len(command)) * step_s, command)
    if servo.resolution:
        samples = np.round(samples / servo.resolution) * servo.resolution
    when = fine - servo.delay_s
    if servo.command_hold is CommandHold.HOLD:
        given = samples[np.clip(np.floor(when / interval + 1e-9).astype(int), 0, len(at) - 1)]
    else:
        given = np.interp(when - interval * (servo.command_hold is CommandHold.LATE), at, samples)
    found = given.copy()
    if servo.servo_time_s:
        half = 0.5 * step_s / PARTS / servo.servo_time_s
        found[0] = command[0]
        for row in range(1, len(given)):
            found[row] = ((1 - half) * found[row - 1] + half * (given[row] + given[row - 1])) / (1 + half)
    if servo.play:
        for row in range(1, len(found)):
            found[row] = min(max(found[row - 1], found[row] - servo.play / 2), found[row] + servo.play / 2)
    return found


def uncertain(rng: np.random.Generator, drive: dict[str, Any], key: str) -> Uncertainty:
    """Friction, and a lag that is stated as well as the data sheet has it."""
    lag = () if "servo_time_s" not in drive or rng.random() < 0.5 else (Spread(keys=(key,), half_width=0.3),)
    return Uncertainty(mu=0.1, spread=lag, samples=3)


def tension(
    rng: np.random.Generator, kind: str, cycle: bool
) -> tuple[dict[str, Any], Any, Callable[[Any, Array], Array], Array]:
    """Drive, expectation, plant by system and command, and what is wanted."""
    scenario = load_scenario(EXAMPLES / "finger.toml")
    actuator = scenario.transmission.actuator
    position = kind == "position servo"
    drive = drawn(rng, resolution=5e-6 if position else 0.05, backlash=2e-5 if position else 0.0)
    named = {{"backlash": "backlash_m"}.get(key, key): value for key, value in drive.items()}
    if position:
        named |= {"drive": Drive.POSITION, "servo_stiffness_N_per_m": 2e5}
    amplitudes = tuple(np.round(rng.uniform((8.0, 2.0), (14.0, 6.0)), 1).tolist())
    course: dict[str, Any] = {"frequencies_Hz": (0.7, 1.6), "duration_s": 1.5, "fade_in_s": 0.3}
    if cycle:
        course = {"frequencies_Hz": (0.8, 1.6), "duration_s": 1.25, "fade_in_s": 0.0, "periodic": True}
    reference: Any = SineReference(initial_tension_N=30.0, amplitudes_N=amplitudes, **course)
    if kind == "load's position":
        reference = WaypointReference(
            times_s=(0.0, 0.4, 0.8, 1.2),
            positions_m=(0.0, *np.round(rng.uniform((4e-3, 1e-3), (8e-3, 3e-3)), 4).tolist(), 0.0),
            shape=Shape.SMOOTH,
            quantity=Quantity.POSITION,
            initial_tension_N=30.0,
            periodic=cycle,
        )
    scenario = replace(
        scenario,
        reference=reference,
        transmission=replace(scenario.transmission, actuator=replace(actuator, **named)),
        robust=uncertain(rng, drive, "actuator.servo_time_s"),
    )
    problem = Problem.of(scenario)
    profile = with_motion(problem, "inverse", compensator("inverse").profile(problem))
    sampled = problem.reference
    given = profile.command_m if position else profile.command_N

    def plant(system: Any, _command: Array) -> Array:
        assert given is not None
        rest = 0.0 if position else 30.0
        answered = behind(system.actuator.servo, rest + cycles(given - rest, cycle), sampled.step_s)
        time = np.arange(len(answered)) * (sampled.step_s / PARTS)
        seen = independent_plant.respond(system, time, answered, 30.0, masses=16, position=position)
        found: Array = (seen.load_m if sampled.position_m is not None else seen.output_N)[::PARTS]
        return found[-len(given) :]

    expectation = problem.expect({"inverse": profile})
    return drive, (expectation, problem.transmission), plant, sampled.wanted


def joint(
    rng: np.random.Generator, kind: str, cycle: bool
) -> tuple[dict[str, Any], Any, Callable[[Any, Array], Array], Array]:
    """The same of a joint: a loop or a pair."""
    loop = kind == "loop"
    scenario = load_scenario(EXAMPLES / "hand_joint.toml")
    drive = drawn(rng, resolution=0.001, backlash=0.004 if loop else 0.0)
    names = {"backlash": "backlash_rad", "resolution": "resolution_rad"}
    named = {names.get(key, key): value for key, value in drive.items()}
    ideal: dict[str, Any] = {"command_interval_s": None, "resolution_rad": 0.0, "servo_time_s": 0.0, "homing_rad": 0.0}
    if not loop:
        ideal |= {"kind": DriveKind.PAIR, "pretension_N": None, "least_tension_N": 5.0}
    mechanism = scenario.mechanism
    mechanism = replace(mechanism, drive=replace(mechanism.drive, **(ideal | named)))
    scenario = replace(scenario, mechanism=mechanism, robust=uncertain(rng, drive, "drive.servo_time_s"))
    pulls = JointTask.of(scenario).inversion.tension_N[0]  # at rest, where a cycle too is started from
    if cycle:
        scenario = replace(scenario, reference=replace(scenario.reference, periodic=True))
    task = JointTask.of(scenario)
    command = task.answer(compensator_of(task, "inverse"))
    start = float(task.target[0, 0])

    def plant(system: Any, _command: Array) -> Array:
        answered = behind(system.drive.servo, cycles(command, cycle), task.step_s)
        row_s, steps = task.step_s / PARTS, task.step_s / PARTS / 2e-6
        inner = row_s / max(round(steps), 1)
        seen = joint_plant.respond(system, answered, row_s, start, tensions_N=pulls, step_s=inner)
        return np.asarray(seen.angle_rad[::PARTS][-len(command) :])

    expectation = task.expect({"inverse": command})
    return drive, (expectation, mechanism), plant, task.target[:, 0]


def finger(
    rng: np.random.Generator, _kind: str, cycle: bool
) -> tuple[dict[str, Any], Any, Callable[[Any, Array], Array], Array]:
    """The same of three joints on four tendons, one motor each."""
    scenario = load_scenario(EXAMPLES / "three_joint_finger.toml")
    drive = drawn(rng, resolution=0.001, backlash=0.0)
    named = {{"resolution": "resolution_rad"}.get(key, key): value for key, value in drive.items()}
    ideal = {"command_interval_s": None, "resolution_rad": 0.0, "servo_time_s": 0.0, "homing_rad": 0.0}
    system = scenario.system
    motors = tuple(replace(m, drive=replace(m.drive, **(ideal | named))) for m in system.motors)
    # Explicit steps of 2 us stand little damping of short links.
    bare = {"relaxing_stiffness_N_per_m": 0.0, "damping_N_s_per_m": 0.02}
    tendons = tuple(replace(t, tendon=replace(t.tendon, **bare)) for t in system.tendons)
    system = replace(system, motors=motors, tendons=tendons)
    scenario = replace(scenario, mechanism=system, robust=Uncertainty(mu=0.1, samples=3))
    pulls = FingerTask.of(scenario).inversion.tension_N[0]
    if cycle:
        whole = {
            name: replace(each, frequencies_Hz=(round(3 * each.frequencies_Hz[0]) / 3,), fade_in_s=0.0)
            for name, each in scenario.references.items()
        }
        scenario = replace(scenario, periodic=True, references=whole)
    task = FingerTask.of(scenario)
    command = task.answer(compensator_of(task, "inverse"))
    start = task.target[0]

    def plant(system: Any, _command: Array) -> Array:
        servo: JointDrive = system.motors[0].drive
        answered = behind(servo.servo, cycles(command, cycle), task.step_s)
        by_tendon = [tendon.name for tendon in system.tendons]
        radius = np.zeros((len(system.motors), len(by_tendon)))
        for row, motor in enumerate(system.motors):
            for name, winding in zip(motor.winds, motor.winding_m, strict=True):
                radius[row, by_tendon.index(name)] = winding
        row_s = task.step_s / PARTS
        seen = finger_plant.respond(system.joints, system.tendons, radius, answered, row_s, start, pulls, masses=30)
        angles = np.vstack([start, seen.angle_rad[PARTS - 1 :: PARTS]])[-len(command) :]
        return np.asarray(angles.T.ravel())

    expectation = task.expect({"inverse": command})
    return drive, (expectation, system), plant, task.target.T.ravel()


RIGS: dict[str, Callable[..., Any]] = {
    "force drive": tension,
    "position servo": tension,
    "load's position": tension,
    "loop": joint,
    "pair": joint,
    "finger": finger,
}


def crossing(seed: int) -> Crossing:
    """Errors of the rig of a seed; the kinds of rigs come in turn."""
    rng = np.random.default_rng(seed)
    kind = list(RIGS)[seed % len(RIGS)]
    cycle = bool(np.random.default_rng([seed, 1]).random() < 1 / 3)
    drive, (expectation, nominal), plant, wanted = RIGS[kind](rng, kind, cycle)
    band = expectation.best
    span = band.worst.rmse / (band.worst.rmse_percent_of_range / 100)

    def percent(system: Any) -> float:
        off = plant(system, np.zeros(0)) - wanted
        return 100 * float(np.sqrt(np.mean(off**2))) / span

    words = ", ".join(f"{key.removesuffix('_s')} {value}" for key, value in drive.items()) or "ideal"
    return Crossing(
        rig=kind,
        cycle=cycle,
        drive=words,
        nominal_said=band.nominal.rmse_percent_of_range,
        nominal_true=percent(nominal),
        worst_said=band.worst.rmse_percent_of_range,
        worst_true=percent(band.worst_sample.system),
    )


def main() -> None:
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 20
    first = int(sys.argv[2]) if len(sys.argv) > 2 else 0
    print("| rig | drive | nominal, stated | plant | worst case, stated | plant | ratio |")
    print("|---|---|---:|---:|---:|---:|---:|")
    for seed in range(first, first + count):
        try:
            c = crossing(seed)
        except (SolveError, ValueError) as error:  # one that cannot be designed is a row too
            print(f"| {list(RIGS)[seed % len(RIGS)]} | seed {seed}: {error} | | | | | |", flush=True)
            continue
        numbers = (c.nominal_said, c.nominal_true, c.worst_said, c.worst_true, c.worst_said / c.worst_true)
        print(f"| {c.rig}{', cycle' * c.cycle} | {c.drive} | {' | '.join(f'{x:.3g}' for x in numbers)} |", flush=True)


if __name__ == "__main__":
    main()
