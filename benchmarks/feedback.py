"""Feedback beside the feedforward on drawn joints, on the independent plant: python -m benchmarks.feedback [N] [SEED].

Loops and pairs with drawn inertia, damping, friction, tension, stiffness, servo lag and delay; gains are designed for
+-20 % of friction and stiffness, the plant differs by 20 % in friction, stiffness and tension, each either way. Per
joint: RMS error of feedforward, feedback and both, peaks, and swing at rest (without drift) with friction +-50 % and
twice the delay.
"""

import math
import sys
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.signal import detrend

from tendonff.compensator.compensators.motors.joint import JointTask
from tendonff.compensator.feedback.joint import JointFeedbackTask
from tendonff.compensator.feedback.run import tune_feedback
from tendonff.compensator.scenario.driven.joint import JointScenario, parse_joint_scenario
from tendonff.models.joint.parameters import DriveKind, Mechanism
from tendonff.models.parameters.numbers import with_numbers
from tendonff.ocp.feedback.law import FeedbackController, FeedbackLaw
from tendonff.ocp.joint.start import start_tensions
from tests.joint_plant import Plant

Array = NDArray[np.float64]
HOLD_S = 0.6

SCENARIO = """schema = 1
[joints.q]
kind = "driven"
inertia_kg_m2 = {inertia}
damping_N_m_s_per_rad = {damping}
gravity_N_m = 0.02
[path]
total_angle_rad = {angle}
segments = 6
[tendon]
mass_kg = 0.001
stiffness_N_per_m = {stiffness}
relaxing_stiffness_N_per_m = 0.0
damping_N_s_per_m = 0.05
[friction]
mu_dynamic = {mu}
viscous_N_s_per_m = 0.0
bristle_stiffness_N_per_m = 1.0e6
soft_bristle_stiffness_N_per_m = 1.0e5
[[tendons]]
name = "flexor"
moment_arm_m = {arm}
[[tendons]]
name = "extensor"
moment_arm_m = -{arm}
[drive]
{drive}
drum_radius_m = {drum}
servo_time_s = {lag}
[reference]
kind = "sine"
amplitudes_rad = [{first}, {second}]
frequencies_Hz = [0.5, 1.1]
duration_s = 2.0
fade_in_s = 0.6
[feedback]
sensor = "joint_angle"
delay_s = {delay}
sample_s = 0.005
[robust]
mu = 0.2
stiffness = 0.2
samples = 7
[run]
step_s = 0.001
level = "presliding"
"""


def drawn(rng: np.random.Generator, number: int) -> JointScenario:
    """A joint: a loop or a pair in turn."""
    loop = number % 2 == 0
    arm, stiffness = rng.uniform(0.006, 0.012), 10 ** rng.uniform(4.2, 4.6)
    inertia = 10 ** rng.uniform(-4.6, -4.0)
    critical = 2 * math.sqrt(2 * stiffness * arm**2 * inertia)
    tension = rng.uniform(8.0, 16.0)
    text = SCENARIO.format(
        inertia=inertia,
        damping=rng.uniform(0.06, 0.15) * critical,
        angle=rng.uniform(2.0, 3.5),
        stiffness=stiffness,
        mu=rng.uniform(0.12, 0.22),
        arm=arm,
        drum=rng.uniform(0.7, 1.3) * arm,
        drive=f'kind = "loop"\npretension_N = {tension}' if loop else f'kind = "pair"\nleast_tension_N = {tension / 3}',
        lag=rng.uniform(0.01, 0.03),
        first=rng.uniform(0.3, 0.5),
        second=rng.uniform(0.1, 0.25),
        delay=rng.uniform(0.005, 0.02),
    )
    return parse_joint_scenario(text, f"joint_{number}.toml")


def off(mechanism: Mechanism, ways: NDArray[np.int64]) -> Mechanism:
    """The plant: friction, stiffness and tension a fifth off, each its way."""
    tension = "pretension_N" if mechanism.drive.kind is DriveKind.LOOP else "least_tension_N"
    changed = with_numbers(mechanism, {"mu": 1 + 0.2 * ways[0], "stiffness": 1 + 0.2 * ways[1]})
    value = getattr(mechanism.drive, tension) * (1 + 0.2 * ways[2])
    return replace(changed, drive=replace(changed.drive, **{tension: value}))


def closed(
    task: JointFeedbackTask,
    plant: Mechanism,
    command: Array,
    law: FeedbackLaw | None,
    delay_s: float,
    hold_s: float = 0.0,
) -> Array:
    """Error of the joint on the independent plant, shape (rows,) [rad]."""
    course, step = task.feedforward, task.feedforward.step_s
    wait = round(hold_s / step)
    reference = np.concatenate([course.reference[:, 0], np.full(wait, course.reference[-1, 0])])
    command = np.vstack([command, np.repeat(command[-1:], wait, axis=0)])
    system = task.system(plant)
    tensions, _ = start_tensions(plant, float(reference[0]))
    joint = Plant(plant, step, float(reference[0]), tensions_N=tensions)
    controller = None if law is None else FeedbackController(law, float(reference[0]))
    every, follow = round(task.sample_s / step), 1 - math.exp(-step / system.lag_s)
    time, angle = np.arange(len(reference)) * step, [float(reference[0])]
    corrected, last = 0.0, command[0]
    for row in range(0, len(reference) - every, every):
        seen = float(np.interp(time[row] - delay_s, time[: row + 1], angle))
        wanted = 0.0 if controller is None else controller.step(float(reference[row]), seen)
        chunk = [last]
        for ahead in command[row + 1 : row + every + 1]:
            corrected += follow * (wanted - corrected)
            chunk.append(ahead + system.direction[:, 0] * corrected)
        last = chunk[-1]
        angle += joint.turn(np.array(chunk))[:, 0].tolist()
    found: Array = np.array(angle) - reference[: len(angle)]
    return found


def rms(error: Array) -> float:
    """Root mean square [deg]."""
    return math.degrees(float(np.sqrt(np.mean(error**2))))


def main(count: int, seed: int) -> None:
    """Print a row a joint and the worst of all."""
    rng = np.random.default_rng(seed)
    rows = []
    for number in range(count):
        scenario = drawn(rng, number)
        ways = rng.choice([-1, 1], 3)
        task = JointFeedbackTask.of(JointTask.of(scenario), scenario.feedback)  # type: ignore[arg-type]
        law = tune_feedback(task).design.laws[0]
        plain = replace(law.plain(), clamp=math.inf)  # alone it has more to correct than the clamp is for
        plant, command, ratio = off(scenario.mechanism, ways), task.feedforward.command, task.alone.command
        delay = law.delay_s
        errors = [closed(task, plant, *each, delay) for each in ((command, None), (ratio, plain), (command, law))]
        forward, back, both = (rms(error) for error in errors)
        peaks = [math.degrees(float(np.abs(error).max())) for error in errors]
        swings = []
        for factor in (0.5, 1.5):
            other = with_numbers(scenario.mechanism, {"mu": factor})
            error = closed(task, other, command, law, 2 * delay, HOLD_S)
            swings.append(math.degrees(float(np.ptp(detrend(error[-round(HOLD_S / 3 / task.feedforward.step_s) :])))))
        rows.append((both / forward, both / back, peaks[2] / peaks[0], max(swings)))
        kind = scenario.mechanism.drive.kind
        print(
            f"{number:2d} {kind:4s} delay {1e3 * delay:4.1f} ms Kp {law.proportional:.2f}, Ki {law.integral_per_s:4.1f}"
            f": feedforward {forward:.3f}, feedback {back:.3f}, both {both:.3f} deg; "
            f"peak {peaks[0]:.3f} -> {peaks[2]:.3f}, "
            f"swing at rest {max(swings):.3f} deg; ratios {rows[-1][0]:.2f}, {rows[-1][1]:.2f}, {rows[-1][2]:.2f}",
            flush=True,
        )
    worst = np.max(np.array(rows), axis=0)
    print(
        f"worst: both/feedforward {worst[0]:.2f}, both/feedback {worst[1]:.2f}, peak {worst[2]:.2f}, "
        f"swing {worst[3]:.3f} deg"
    )


if __name__ == "__main__":
    given = [int(value) for value in sys.argv[1:]]
    main(*given, *(20, 50)[len(given) :])
