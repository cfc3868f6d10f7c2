"""One profile for a tendon that is not known exactly, and what uncertainty does to any profile."""

import inspect
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from tendonff.models.chain import Chain
from tendonff.models.fidelity import Level
from tendonff.models.parameters import Transmission
from tendonff.models.parameters.uncertainty import Objective, Uncertainty
from tendonff.ocp.batch import Progress
from tendonff.ocp.errors import SolveError
from tendonff.ocp.inverse import Inversion, invert
from tendonff.ocp.periodic import steady_response
from tendonff.ocp.simulate import Outcome, Simulation, simulate
from tendonff.ocp.step.protocol import Array
from tendonff.ocp.tracking.limits import ForceLimits
from tendonff.ocp.tracking.problem import WORST_POWER, TrackingProblem, TrackOptions
from tendonff.ocp.tracking.result import Tracking
from tendonff.ocp.tracking.track import solve_tracking

POWER = {Objective.WORST: WORST_POWER, Objective.MEAN: 1.0}
"""Order of the mean over the samples that is made small."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Sample:
    """One transmission that the uncertainty admits."""

    # mu, stiffness, bristle_stiffness: factors on the nominal parameters [-]
    mu: float
    stiffness: float
    bristle_stiffness: float
    transmission: Transmission


@dataclass(frozen=True, slots=True, kw_only=True)
class ErrorBand:
    """What a profile achieves over the samples.

    Parameters
    ----------
    nominal_rms_N, least_rms_N, median_rms_N, worst_rms_N : float
        Tracking errors [N]; infinite where a simulation fails.
    worst_peak_N : float
        Largest error at any time on any sample [N].
    worst_sample : Sample
        The one with the largest rms error.
    amplification : float
        Largest swing of the output over the swing of the reference, less 1 [-]. Positive is over-compensation: the
        output moves more than was asked for. That is the dangerous side: in a loop it adds energy that friction,
        overestimated, does not take away.
    amplified_sample : Sample
        The one with that swing.
    slack_samples : int
        On so many samples some link goes slack.
    """

    nominal_rms_N: float
    least_rms_N: float
    median_rms_N: float
    worst_rms_N: float
    worst_peak_N: float
    worst_sample: Sample
    amplification: float
    amplified_sample: Sample
    slack_samples: int


def sample_transmissions(transmission: Transmission, uncertainty: Uncertainty) -> tuple[Sample, ...]:
    """The nominal transmission, then the two ends of the friction's range, then a Latin hypercube."""
    nominal = transmission_at(transmission, (1.0, 1.0, 1.0))
    if uncertainty.is_certain:
        return (nominal,)
    ends = tuple(transmission_at(transmission, (1 + side * uncertainty.mu, 1.0, 1.0)) for side in (-1, 1))
    rest = draw_transmissions(transmission, uncertainty, max(uncertainty.samples - 3, 0))
    return (nominal, *ends, *rest)[: uncertainty.samples]


def draw_transmissions(transmission: Transmission, uncertainty: Uncertainty, count: int) -> tuple[Sample, ...]:
    """A Latin hypercube of transmissions that the uncertainty admits."""
    if count == 0:
        return ()
    width = np.array([uncertainty.mu, uncertainty.stiffness, uncertainty.bristle_stiffness])
    from scipy.stats import qmc  # two thirds of a second to import, for samples alone

    is_new = "rng" in inspect.signature(qmc.LatinHypercube).parameters
    cube = qmc.LatinHypercube(3, **{"rng" if is_new else "seed": uncertainty.seed})
    return tuple(transmission_at(transmission, tuple(1 + width * (2 * place - 1))) for place in cube.random(count))


def transmission_at(transmission: Transmission, factors: tuple[float, ...]) -> Sample:
    """The transmission with its friction coefficients, stiffnesses and bristle stiffnesses times three factors."""
    mu, stiffness, bristle = (float(f) for f in factors)
    friction = transmission.friction
    release, release_static = friction.mu_dynamic_release, friction.mu_static_release
    return Sample(
        mu=mu,
        stiffness=stiffness,
        bristle_stiffness=bristle,
        transmission=replace(
            transmission,
            friction=replace(
                friction,
                mu_dynamic=friction.mu_dynamic * mu,
                mu_static=friction.mu_static * mu,
                mu_dynamic_release=None if release is None else release * mu,
                mu_static_release=None if release_static is None else release_static * mu,
                bristle_stiffness_N_per_m=friction.bristle_stiffness_N_per_m * bristle,
                soft_bristle_stiffness_N_per_m=friction.soft_bristle_stiffness_N_per_m * bristle,
            ),
            tendon=transmission.tendon.scaled(stiffness),
        ),
    )


def error_band(
    samples: tuple[Sample, ...],
    level: Level,
    force_N: Array,
    reference_N: Array,
    step_s: float,
    *,
    segments: int | None = None,
    initial_tension_N: float | None = None,
    periodic: bool = False,
) -> ErrorBand:
    """Play one profile on every sample.

    Parameters
    ----------
    samples : tuple of Sample
        The first is the nominal one.
    level : Level
    force_N, reference_N : ndarray, shape (n,)
    step_s : float
    segments : int, optional
        Number of masses; default: the path's own.
    initial_tension_N : float, optional
        Default: the first reference.
    periodic : bool, optional
        In the steady state of a cycle, not from rest.
    """
    reference = np.asarray(reference_N, dtype=np.float64)
    start = float(reference[0]) if initial_tension_N is None else initial_tension_N
    rms, peak, swing, slack = [], [], [], 0
    for sample in samples:
        chain = Chain.of(sample.transmission, level, segments)
        run = _response(chain, force_N, step_s, start, periodic=periodic)
        slack += run.outcome is Outcome.SLACK
        if run.outcome is Outcome.FAILED:
            rms.append(np.inf)
            peak.append(np.inf)
            swing.append(np.inf)
            continue
        error = run.output_tension_N - reference
        rms.append(float(np.sqrt(np.mean(error**2))))
        peak.append(float(np.max(np.abs(error))))
        swing.append(float(np.ptp(run.output_tension_N)) / max(float(np.ptp(reference)), 1e-300))
    worst, widest = int(np.argmax(rms)), int(np.argmax(swing))
    return ErrorBand(
        nominal_rms_N=rms[0],
        least_rms_N=min(rms),
        median_rms_N=float(np.median(rms)),
        worst_rms_N=rms[worst],
        worst_peak_N=max(peak),
        worst_sample=samples[worst],
        amplification=swing[widest] - 1,
        amplified_sample=samples[widest],
        slack_samples=slack,
    )


def _response(chain: Chain, force_N: Array, step_s: float, start_N: float, *, periodic: bool) -> Simulation:
    """From rest, or in the steady cycle where it can be simulated."""
    if periodic:
        with suppress(SolveError):
            return steady_response(chain, force_N, step_s, initial_tension_N=start_N)[0]
    return simulate(chain, force_N, step_s, initial_tension_N=start_N)


def track_robust(
    samples: tuple[Sample, ...],
    level: Level,
    reference_N: Array,
    step_s: float,
    limits: ForceLimits,
    objective: Objective = Objective.WORST,
    options: TrackOptions = TrackOptions(),  # noqa: B008 - frozen
    *,
    segments: int | None = None,
    initial_tension_N: float | None = None,
    inversion: Inversion | None = None,
    progress: Progress | None = None,
) -> Tracking:
    """One profile that is best in the worst case or on average over the samples; see `track`.

    Parameters
    ----------
    samples : tuple of Sample
        The first is the nominal one: its inverse is the starting point, and its output is predicted.
    level : Level
    reference_N : ndarray, shape (n,)
    step_s : float
    limits : ForceLimits
    objective : Objective, optional
    options : TrackOptions, optional
    segments : int, optional
    initial_tension_N : float, optional
    inversion : Inversion, optional
        Of the nominal transmission, where the caller has it already.
    progress : callable, optional

    Returns
    -------
    Tracking
        Its rms error is that of the nominal plant; `error_band` gives the others.
    """
    chains = tuple(Chain.of(sample.transmission, level, segments) for sample in samples)
    reference = np.asarray(reference_N, dtype=np.float64)
    start = float(reference[0]) if initial_tension_N is None else initial_tension_N
    inverse = invert(chains[0], reference, step_s, initial_tension_N=start) if inversion is None else inversion
    problem = TrackingProblem.of(
        chains,
        reference,
        step_s,
        limits,
        options,
        initial_tension_N=start,
        inverse_N=inverse.force_N,
        power=POWER[objective],
    )
    return solve_tracking(problem, inverse, options, progress)
