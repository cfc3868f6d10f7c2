"""What uncertain parameters do to every profile of a design."""

from dataclasses import asdict, dataclass

from tendonff.compensator.compensators.base import Compensator, FloatArray
from tendonff.compensator.scenario.sampling import Reference
from tendonff.compensator.scenario.scenario import Scenario
from tendonff.ocp.tracking.robust import ErrorBand, Objective, Sample, Uncertainty, error_band, sample_transmissions

_OVERCOMPENSATION = 0.02
"""Swing beyond the wanted one that is worth a warning [-]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Robustness:
    """Error bands of the compensators over parameter samples.

    Parameters
    ----------
    samples : tuple of Sample
        The first is the nominal one.
    objective : Objective
        What the optimal profile was made for.
    bands : dict of Compensator to ErrorBand
    """

    samples: tuple[Sample, ...]
    objective: Objective
    bands: dict[Compensator, ErrorBand]


def samples_of(scenario: Scenario) -> tuple[Sample, ...]:
    """The transmissions that the scenario's uncertainty admits; the nominal one alone where all is certain.

    Parameters
    ----------
    scenario : Scenario
    """
    robust = scenario.robust
    uncertainty = Uncertainty(
        mu=robust.mu,
        stiffness=robust.stiffness,
        bristle_stiffness=robust.bristle_stiffness,
        samples=robust.samples,
        seed=robust.seed,
    )
    return sample_transmissions(scenario.transmission, uncertainty)


def robustness(
    scenario: Scenario, samples: tuple[Sample, ...], forces_N: dict[Compensator, FloatArray], reference: Reference
) -> Robustness:
    """Play every profile on every sample, on the design level.

    Parameters
    ----------
    scenario : Scenario
    samples : tuple of Sample
    forces_N : dict of Compensator to ndarray, shape (n,)
    reference : Reference
    """
    bands = {
        compensator: error_band(
            samples,
            scenario.run.level,
            force,
            reference.tension_N,
            reference.step_s,
            initial_tension_N=reference.initial_tension_N,
        )
        for compensator, force in forces_N.items()
    }
    return Robustness(samples=samples, objective=Objective(scenario.robust.objective.value), bands=bands)


def robustness_warnings(found: Robustness) -> list[str]:
    """Over-compensation is the dangerous side: name it.

    Parameters
    ----------
    found : Robustness
    """
    return [
        f"{compensator}: over-compensates by up to {100 * band.amplification:.2g} % of the swing where mu is "
        f"{100 * (band.amplified_sample.mu - 1):+.3g} %; in a loop that adds energy: stay on the low side of mu"
        for compensator, band in found.bands.items()
        if compensator is not Compensator.NONE and band.amplification > _OVERCOMPENSATION
    ]


def robustness_summary(found: Robustness) -> dict[str, object]:
    """The key `robust` of `summary.json`.

    Parameters
    ----------
    found : Robustness
    """

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
        "compensators": {compensator.value: band_of(band) for compensator, band in found.bands.items()},
    }
