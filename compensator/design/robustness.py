"""What uncertain parameters do to every profile of a design."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass

from tendonff.compensator.compensators.base import FloatArray, Problem
from tendonff.models.parameters.uncertainty import Objective
from tendonff.ocp.tracking.robust import ErrorBand, Sample, error_band

_OVERCOMPENSATION = 0.02
"""Swing beyond the wanted one that is worth a warning [-]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Robustness:
    """Error bands of the compensators over parameter samples."""

    samples: tuple[Sample, ...]  # the first is the nominal one
    objective: Objective  # what the optimal profile was made for
    bands: dict[str, ErrorBand]  # by name of the compensator


def robustness(problem: Problem, forces_N: Mapping[str, FloatArray]) -> Robustness:
    """Simulate every sample of a problem under every profile, on the design level.

    Parameters
    ----------
    forces_N : mapping of str to ndarray, shape (n,)
        By name of the compensator.
    """
    reference = problem.reference
    bands = {
        name: error_band(
            problem.samples,
            problem.level,
            force,
            reference.tension_N,
            reference.step_s,
            initial_tension_N=reference.initial_tension_N,
            periodic=reference.periodic,
        )
        for name, force in forces_N.items()
    }
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
