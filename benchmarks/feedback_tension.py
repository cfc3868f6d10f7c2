"""Feedback of a tension beside the feedforward, on the independent rig: python -m benchmarks.feedback_tension [SEED].

Finger, Bowden cable and surgical instrument, sensor 4 ms old, samples of 4 ms. Gains are designed for +-20 % of
friction; the rig has 40 masses of another scheme and differs in friction and more. Per row: RMS error of the
feedforward, and with feedback RMS and peak over it, with the true age of the measurement half, once and 1.5 times the
stated one; then swing at rest with friction +-50 % and twice the delay.
"""

import sys
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

import tendonff as tf
from tendonff.compensator.compensators.base import Problem
from tendonff.compensator.feedback.run import tune_feedback
from tendonff.compensator.feedback.tension import TensionFeedbackTask
from tendonff.compensator.scenario.settings import Feedback
from tendonff.models.fidelity import Level
from tendonff.models.parameters.uncertainty import Uncertainty
from tendonff.ocp.feedback.law import FeedbackController, FeedbackLaw
from tests.independent_rig import Rig

Array = NDArray[np.float64]
EXAMPLES = ("finger", "bowden", "surgical")
DELAY_S, HOLD_S = 0.004, 1.0
NOISE_N = 0.1
RIGS: dict[str, dict[str, float]] = {
    "mu -20 %": {"mu": 0.8},
    "mu +20 %": {"mu": 1.2},
    "mu +20 %, tendon -20 %": {"mu": 1.2, "stiffness": 0.8},
    "mu -20 %, tendon +20 %, load -20 %": {"mu": 0.8, "stiffness": 1.2, "load": 0.8},
    "mu +20 %, bristles half as stiff": {"mu": 1.2, "bristle": 0.5},
    "mu +20 % when releasing": {"release": 1.2},
    "mu -20 %, dry friction of the drive 1 N": {"mu": 0.8, "gear_N": 1.0},
    "mu +20 %, falling with T^-0.1": {"mu": 1.2, "load_exponent": 0.1},
    "mu -50 %": {"mu": 0.5},
    "mu +50 %": {"mu": 1.5},
}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Bench:
    """An example with its feedback."""

    task: TensionFeedbackTask

    @classmethod
    def of(cls, name: str) -> "Bench":
        """An example with friction known to 20 %."""
        scenario = replace(tf.load_scenario(f"examples/{name}.toml"), robust=Uncertainty(mu=0.2, samples=3))
        problem = Problem.of(scenario)
        profiles = {c.name: c.profile(problem) for c in tf.COMPENSATORS if c.name in ("none", "inverse")}
        settings = Feedback(sensor="output_tension", delay_s=DELAY_S, sample_s=DELAY_S)
        return cls(task=TensionFeedbackTask.of(problem, settings, profiles, f"{name}.toml"))

    def law(self) -> FeedbackLaw:
        """The designed law."""
        return tune_feedback(self.task).design.laws[0]

    def rig(self, factors: dict[str, float]) -> Rig:
        """The rig, whose bristle is that of the example's level."""
        problem = self.task.problem
        friction = problem.transmission.friction
        stiff = problem.level is not Level.PRESLIDING
        own = friction.bristle_stiffness_N_per_m / friction.soft_bristle_stiffness_N_per_m if stiff else 1.0
        given = {**factors, "bristle": own * factors.get("bristle", 1.0)}
        return Rig(problem.transmission, problem.reference.initial_tension_N, **given)  # type: ignore[arg-type]

    def error_N(
        self,
        factors: dict[str, float],
        law: FeedbackLaw | None,
        *,
        delay_s: float = DELAY_S,
        hold_s: float = 0.0,
        noise_N: float = 0.0,
        seed: int = 0,
    ) -> Array:
        """Error of the tension, shape (rows,) [N]."""
        task = self.task
        course = task.feedforward.held(hold_s)
        system, step = task.system(task.problem.transmission), course.step_s
        every, reference, rng = round(task.sample_s / step), course.reference[:, 0], np.random.default_rng(seed)
        seen, rig = system.seen(reference), self.rig(factors)
        controller = None if law is None else FeedbackController(law, float(seen[0]))
        time, tension, last, correction = np.arange(len(reference)) * step, [reference[0]], course.command[0, 0], 0.0
        for row in range(0, len(reference) - every, every):
            if controller is not None:
                measured = np.interp(time[row] - delay_s, time[: row + 1], tension) + noise_N * rng.standard_normal()
                given = (seen[row], system.seen(np.array(measured)), course.shapes[row, 0])
                correction = controller.step(*map(float, given))
            for k in range(row + 1, row + every + 1):
                force = float((course.command[k] + system.moved(np.array([correction]), course.forces_N[k]))[0])
                rig.advance(last, force, step)
                last = force
                tension.append(rig.tension_N)
        found: Array = np.array(tension) - reference[: len(tension)]
        return found


def rms(error: Array) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(error**2)))


def main(seed: int = 0) -> None:
    """Print a row a rig."""
    for name in EXAMPLES:
        bench = Bench.of(name)
        law = bench.law()
        print(f"{name}: Kp {law.proportional:.2f}, Ki {law.integral_per_s:.1f}/s, clamp {law.clamp:.2f}", flush=True)
        for label, factors in RIGS.items():
            alone = bench.error_N(factors, None)
            both = [bench.error_N(factors, law, delay_s=share * DELAY_S) for share in (0.5, 1.0, 1.5)]
            noisy = bench.error_N(factors, law, noise_N=NOISE_N, seed=seed)
            told = ", ".join(f"{rms(e) / rms(alone):.3f} ({abs(e).max() / abs(alone).max():.2f})" for e in both)
            print(f"  {label:40s} {rms(alone):7.3f} N: {told}; noise of {NOISE_N} N {rms(noisy) / rms(alone):.3f}")
        for factor in (0.5, 1.5):
            error = bench.error_N({"mu": factor}, law, delay_s=2 * DELAY_S, hold_s=HOLD_S)
            print(f"  swing at rest, mu times {factor}, twice the delay: {np.ptp(error[-400:]):.4f} N", flush=True)


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
