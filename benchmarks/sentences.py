"""Statements of the optimal profile, checked on random rigs against independent simulations.

    TENDONFF_RIGS=60 python benchmarks/sentences.py
    TENDONFF_RIGS=40:60 python benchmarks/sentences.py      the last twenty of them

Each sentence of a result is checked: the error that it states against a simulation by the other engine, "exact" and
"out of reach" against the error and the static law, the limits row by row, and the promise on 40 masses at a tenth of
the step and with stiffer bristles. What these deny by more than a factor of 2, and by more than under the clipped
inverse, is misleading. One line for a rig with a misleading sentence; the count at the end.
"""

import os
import sys

import numpy as np
from random_rigs import Array, random_problem

from tendonff.models.tendon.chain import Chain
from tendonff.ocp.codegen.engine import Engine
from tendonff.ocp.optimal.track import track
from tendonff.ocp.tendon.inverse import invert
from tendonff.ocp.tendon.simulate import simulate
from tendonff.ocp.tendon.stability import predict_stick_slip
from tendonff.ocp.tracking.diagnosis import law_of
from tendonff.ocp.tracking.limits import ForceLimits
from tendonff.ocp.tracking.result import TrackStatus

FIRST, LAST = (int(text) for text in f"0:{os.environ.get('TENDONFF_RIGS', '60')}".split(":")[-2:])
FACTOR = 2.0  # between promise and delivery
STIFFER = 30.0  # times the bristle stiffness
SMALL = 0.005  # of the reference's range: errors below this are not worth a word


def rms(error: Array) -> float:
    return float(np.sqrt(np.mean(error**2)))


def misleading(seed: int) -> list[str]:
    """Statements of a result that do not hold."""
    rig, level, reference, step = random_problem(seed)
    chain, limits, start = Chain.of(rig, level), ForceLimits.of(rig.actuator), float(reference[0])
    found, law, span = track(chain, reference, step, limits), law_of(Chain.of(rig, level)), float(np.ptp(reference))
    if found.status in {TrackStatus.INFEASIBLE, TrackStatus.FAILED}:
        return [] if found.reasons or "smaller step" in found.message else ["no profile and no reason"]
    wrong = []
    if not limits.admits(found.force_N, step, 1e-6):
        wrong.append("breaks the actuator's limits")
    other = simulate(chain, found.force_N, step, initial_tension_N=start, engine=Engine.CASADI).output_tension_N
    unstable = predict_stick_slip(chain, reference, step, force_N=found.force_N).warnings
    if len(other) < len(reference) or (abs(rms(other - reference) - found.rms_error_N) > 0.01 * span and not unstable):
        wrong.append(f"states {found.rms_error_N:.3g} N, the other engine finds {rms(other - reference):.3g} N")
    if found.status is TrackStatus.EXACT and found.rms_error_N > 1e-3 * span:
        wrong.append(f"calls {100 * found.rms_error_N / span:.2g} % of range exact")
    reached = reference.max() <= law.largest_output_N(limits.maximum_N - chain.coulomb_N)
    if found.status is not TrackStatus.EXACT and reached == (found.status is TrackStatus.BEST_ACHIEVABLE):
        wrong.append(f"status {found.status}, by the static law the reference is {'in' if reached else 'out of'} reach")
    clipped = limits.apply(
        found.force_N if found.status is TrackStatus.EXACT else invert(chain, reference, step).force_N, step
    )
    rows, fine = np.arange(len(reference)), np.arange(10 * (len(reference) - 1) + 1) / 10
    finer = Chain.of(rig, level, 40)

    def errors(force: Array) -> dict[str, float]:
        on_fine = simulate(finer, np.interp(fine, rows, force), step / 10, initial_tension_N=start).output_tension_N
        stiff = simulate(chain.stiffened(STIFFER), force, step, initial_tension_N=start).output_tension_N
        return {
            "40 masses": rms(on_fine - np.interp(fine, rows, reference)) if len(on_fine) == len(fine) else np.inf,
            "stiff bristles": rms(stiff - reference) if len(stiff) == len(reference) else np.inf,
        }

    ours, theirs = errors(found.force_N), errors(clipped)
    promise, name = max(found.rms_error_N, SMALL * span), "stiff bristles"
    if ours[name] > FACTOR * max(promise, theirs[name]):
        wrong.append(f"promises {promise:.3g} N, {name} give {ours[name]:.3g} N (clipped inverse {theirs[name]:.3g})")
    if ours["40 masses"] > FACTOR * max(found.rms_error_N, SMALL * span):
        print(f"rig {seed:3d}: {ours['40 masses'] / span:.1%} on 40 masses, which `design` warns of", flush=True)
    return wrong


def main() -> None:
    bad = 0
    for seed in range(FIRST, LAST):
        wrong = misleading(seed)
        bad += bool(wrong)
        for sentence in wrong:
            print(f"rig {seed:3d}: {sentence}", flush=True)
        print(f"rig {seed:3d} done", file=sys.stderr, flush=True)
    print(f"{bad} of {LAST - FIRST} rigs with a misleading sentence")


if __name__ == "__main__":
    main()
