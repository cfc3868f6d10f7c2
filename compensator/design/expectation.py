"""What uncertain parameters do to every profile of a design, and what to expect of it on a rig."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass

import numpy as np

from tendonff.compensator.compensators.base import FloatArray, Problem
from tendonff.compensator.compensators.score import Doubt, doubt, error_bands, scale_N
from tendonff.models.chain import Chain
from tendonff.models.parameters.uncertainty import Objective, Uncertainty
from tendonff.ocp.simulate import simulate
from tendonff.ocp.tracking.robust import ErrorBand, Sample

_OVERCOMPENSATION = 0.02  # swing beyond the wanted one that is worth a warning [-]


@dataclass(frozen=True, slots=True, kw_only=True)
class Robustness:
    """Error bands of the compensators over parameter samples."""

    samples: tuple[Sample, ...]  # the first is the nominal one
    objective: Objective  # what the optimal profile was made for
    bands: dict[str, ErrorBand]  # by name of the compensator


def robustness(problem: Problem, forces_N: Mapping[str, FloatArray]) -> Robustness:
    """Simulate every sample of a problem under every profile, by name of the compensator, on the design level."""
    bands = error_bands(problem.samples, problem.level, forces_N, problem.reference)
    return Robustness(samples=problem.samples, objective=problem.objective, bands=bands)


def robustness_warnings(found: Robustness) -> list[str]:
    """Over-compensation is the dangerous side: name it."""
    over = {name: b for name, b in found.bands.items() if name != "none" and b.amplification > _OVERCOMPENSATION}
    if not over:
        return []
    swings = ", ".join(f"{name} {100 * band.amplification:.2g}" for name, band in over.items())
    lowest = 100 * (min(band.amplified_sample.mu for band in over.values()) - 1)
    text = (
        f"over-compensation, in % of the swing, largest over the samples (mu {lowest:+.3g} %): {swings}; inside a "
        "feedback loop over-compensation injects energy: choose mu too low rather than too high"
    )
    return [text]


def robustness_summary(found: Robustness) -> dict[str, object]:
    """The key `robust` of `summary.json`."""

    def factors(sample: Sample) -> dict[str, float]:
        return {"mu": sample.mu, "stiffness": sample.stiffness, "bristle_stiffness": sample.bristle_stiffness}

    def band_of(band: ErrorBand) -> dict[str, object]:
        numbers = {k: v for k, v in asdict(band).items() if not k.endswith("_sample")}
        return {
            **numbers,
            "worst_factors": factors(band.worst_sample),
            "amplified_factors": factors(band.amplified_sample),
        }

    return {
        "samples": len(found.samples),
        "objective": found.objective.value,
        "compensators": {name: band_of(band) for name, band in found.bands.items()},
    }


_TIE = 1.02  # worst errors that differ by less are equal: then the error with the nominal parameters decides


@dataclass(frozen=True, slots=True, kw_only=True)
class Expectation:
    """Errors over the samples of the parameters, and the profile that does best there."""

    doubt: Doubt  # what may be the real transmission
    # largest RMS error over the samples, by name of the compensator [% of the reference's range]
    worst_percent: dict[str, float]
    # name of the compensator whose worst error is least, and of equal ones the best with the nominal parameters
    recommended: str
    # low_N, high_N: shape (n,); least and largest output tension over the samples under the recommended profile [N]
    low_N: FloatArray
    high_N: FloatArray


def expect(
    problem: Problem, uncertainty: Uncertainty, forces_N: Mapping[str, FloatArray], found: Robustness | None
) -> Expectation:
    """Try every profile on the samples that the scenario's uncertainty admits, or on those that are assumed.

    Of the forces, by name of the compensator, those that may be used; of the scenario's own samples, where it has any,
    the bands are known.
    """
    reference, level = problem.reference, problem.level
    span = scale_N(reference.tension_N)
    real = doubt(problem.transmission, uncertainty)
    bands = error_bands(real.samples, level, forces_N, reference) if found is None else found.bands
    least = min(bands[name].worst_rms_N for name in forces_N)
    equal = [name for name in forces_N if bands[name].worst_rms_N <= _TIE * least]
    recommended = min(equal or forces_N, key=lambda name: bands[name].nominal_rms_N)
    outputs = _outputs(problem, real.samples, forces_N[recommended])
    return Expectation(
        doubt=real,
        worst_percent={name: 100 * bands[name].worst_rms_N / span for name in forces_N},
        recommended=recommended,
        low_N=np.min(outputs, axis=0),
        high_N=np.max(outputs, axis=0),
    )


def _outputs(problem: Problem, samples: tuple[Sample, ...], force_N: FloatArray) -> FloatArray:
    """Output tension of every sample under a force, shape (samples, n) [N]; what failed stays at its last value."""
    reference, rows = problem.reference, []
    for sample in samples:
        chain = Chain.of(sample.transmission, problem.level)
        run = simulate(chain, force_N, reference.step_s, initial_tension_N=reference.initial_tension_N)
        output = run.output_tension_N
        rows.append(np.pad(output, (0, len(force_N) - len(output)), mode="edge"))
    return np.array(rows)
