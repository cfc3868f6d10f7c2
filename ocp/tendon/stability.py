"""Stick-slip, seen coming: where sliding is unstable under any feedforward.

The chain is linearised along the motion that the reference asks for. While the tendon slides, static friction above
dynamic friction acts like a negative damper, strongest near the Stribeck velocity; and on long, lightly damped paths
friction that follows the tension can feed an oscillation even without. Where that outweighs the damping, a mode grows.
A force that was computed beforehand cannot stop it. How far a mode gets depends on how long it lasts, so what counts
is the growth summed over a stretch, e^(integral of Re lambda).
"""

import math
from dataclasses import dataclass

import numpy as np

from tendonff.models.layout import ChainState
from tendonff.models.mechanism.linearise import LinearChain, Lineariser
from tendonff.models.tendon.chain import Chain
from tendonff.ocp.step.protocol import Array
from tendonff.ocp.tendon.inverse import Inversion, invert
from tendonff.ocp.tendon.simulate import Outcome, simulate

GROWTH_THAT_MATTERS = math.log(10.0)
"""Growth exponent of a stretch that is worth a warning: a disturbance grows tenfold."""

_SAMPLES = 160  # places along the reference that are linearised
_REPLAY_STEPS = 4  # the replay's step is this much finer


@dataclass(frozen=True, slots=True, kw_only=True)
class UnstableStretch:
    """A stretch of time in which some mode grows.

    Attributes
    ----------
    start_s, end_s : float
        When [s].
    growth_per_s : float
        Largest real part of a pole there [1/s].
    frequency_Hz : float
        Frequency of that mode [Hz]; 0 where it grows without oscillating.
    growth_exponent : float
        Integral of the largest real part over the stretch [-].
    """

    start_s: float
    end_s: float
    growth_per_s: float
    frequency_Hz: float
    growth_exponent: float


@dataclass(frozen=True, slots=True, kw_only=True)
class StickSlipPrediction:
    """Prediction for any feedforward along a reference.

    Attributes
    ----------
    stretches : tuple of UnstableStretch
        Those whose growth matters, in order of time.
    unstable_share : float
        Share of the time they cover [-].
    largest_growth_per_s : float
        Largest real part of any pole along the reference, also where it does not matter [1/s]; may be negative.
    expected_error_N : float
        Root mean square error of the given force on the same chain with a quarter of the step [N]: what becomes of it
        when nothing but the grid changes. NaN where no force was given or it fails.
    warnings : tuple of str
        For the user; empty where nothing is to be feared.
    """

    stretches: tuple[UnstableStretch, ...]
    unstable_share: float
    largest_growth_per_s: float
    expected_error_N: float
    warnings: tuple[str, ...]


def predict_stick_slip(
    chain: Chain,
    reference_N: Array,
    step_s: float,
    *,
    force_N: Array | None = None,
    inversion: Inversion | None = None,
) -> StickSlipPrediction:
    """Linearise the chain along a reference and say where feedforward will not hold it.

    The reference is that of the output tension, shape (n,) [N], > 0. Without a force whose error is to be expected,
    shape (n,) [N], it is that of the exact inverse, which may be known already, with its states.
    """
    reference = np.asarray(reference_N, dtype=np.float64)
    if inversion is None or inversion.states is None:
        inversion = invert(chain, reference, step_s, record=True)
    force = inversion.force_N if force_N is None else force_N
    states = inversion.recorded
    begin = ChainState.from_vector(states[0], chain.layout)  # of a cycle it is no rest
    expected = expected_error_N(chain, force, reference, step_s, begin)
    last = len(reference) - 1
    rows = np.unique(np.linspace(min(1, last), last, min(_SAMPLES, max(last, 1))).astype(int))
    linear, layout = Lineariser(chain), chain.layout
    along = [linear.at(ChainState.from_vector(states[row], layout, row * step_s)) for row in rows]
    poles = np.array([_fastest(each) for each in along])
    time_s = rows * step_s
    found = _stretches(time_s, poles)
    duration = float(time_s[-1])
    share = min(sum(s.end_s - s.start_s for s in found) / duration, 1.0) if found else 0.0
    return StickSlipPrediction(
        stretches=found,
        unstable_share=share,
        largest_growth_per_s=float(poles.real.max()),
        expected_error_N=expected,
        warnings=_warnings(found, share, expected, float(np.ptp(reference)), chain),
    )


def _fastest(linear: LinearChain) -> complex:
    """The fastest growing pole [1/s]; 0, neither growing nor not, where numbers beyond all measure leave no matrix."""
    if not np.isfinite(linear.a).all():
        return 0j
    poles = linear.poles
    return complex(poles[np.argmax(poles.real)])


def expected_error_N(chain: Chain, force_N: Array, reference_N: Array, step_s: float, state: ChainState) -> float:
    """Error of a force, shape (n,), from a state of the chain with a quarter of the step [N]; NaN if that fails."""
    coarse = np.arange(len(force_N)) * step_s
    fine = np.arange((len(force_N) - 1) * _REPLAY_STEPS + 1) * (step_s / _REPLAY_STEPS)
    run = simulate(chain, np.interp(fine, coarse, force_N), step_s / _REPLAY_STEPS, state=state)
    if run.outcome is Outcome.FAILED:
        return math.nan
    return float(np.sqrt(np.mean((run.output_tension_N[::_REPLAY_STEPS] - reference_N) ** 2)))


def _stretches(time_s: Array, poles: Array) -> tuple[UnstableStretch, ...]:
    """Runs of samples with a growing mode whose growth matters."""
    growing = np.flatnonzero(poles.real > 0)
    if growing.size == 0:
        return ()
    width = np.gradient(time_s) if len(time_s) > 1 else time_s  # one sample stands for all the time there is
    found = []
    for run in np.split(growing, np.flatnonzero(np.diff(growing) > 1) + 1):
        exponent = float(np.sum(poles.real[run] * width[run]))
        if exponent >= GROWTH_THAT_MATTERS:
            top = poles[run][int(np.argmax(poles.real[run]))]
            found.append(
                UnstableStretch(
                    start_s=max(float(time_s[run[0]] - width[run[0]] / 2), 0.0),
                    end_s=min(float(time_s[run[-1]] + width[run[-1]] / 2), float(time_s[-1])),
                    growth_per_s=float(top.real),
                    frequency_Hz=abs(float(top.imag)) / (2 * math.pi),
                    growth_exponent=exponent,
                )
            )
    return tuple(found)


def _warnings(
    found: tuple[UnstableStretch, ...], share: float, expected_N: float, range_N: float, chain: Chain
) -> tuple[str, ...]:
    if not found:
        return ()
    worst = max(found, key=lambda s: s.growth_exponent)
    error = (
        f"expect an RMS error of about {expected_N:.2g} N ({100 * expected_N / max(range_N, 1e-300):.2g} % of range)"
        if math.isfinite(expected_N)
        else "expect a large error (the finer replay did not even converge)"
    )
    when = (
        f"in {100 * share:.3g} % of the time, most from t = {worst.start_s:.3g} to {worst.end_s:.3g} s "
        f"(a mode grows at {worst.growth_per_s:.3g} 1/s)"
    )
    if (weakening := chain.friction.weakening_speed_m_per_s) is not None:
        speed = f"{weakening:.3g} m/s"
        text = (
            f"stick-slip: friction weakens with speed and the tendon slides slowly {when}; feedforward cannot "
            f"stabilise it; {error}; slide well above or below {speed}, add damping at the load, "
            "lubricate (mu_static closer to mu_dynamic), or close a feedback loop"
        )
    else:
        motion = (
            f"an oscillation of {worst.frequency_Hz:.3g} Hz"
            if worst.frequency_Hz
            else "a motion that does not oscillate"
        )
        text = (
            f"unstable sliding: friction, proportional to tension, feeds {motion} "
            f"{when}; feedforward cannot stabilise it; {error}; add damping in the tendon or at the load, "
            "or let the reference change more gently"
        )
    return (text,)
