"""What is not known of a transmission: samples that the scenario's uncertainty admits, or those that are assumed."""

from collections.abc import Hashable, Mapping
from dataclasses import dataclass
from typing import TypeVar

from tendonff.compensator.compensators.base import FloatArray
from tendonff.compensator.scenario.sampled.sampling import Reference
from tendonff.models.fidelity import Level
from tendonff.models.parameters import Transmission
from tendonff.models.parameters.uncertainty import Uncertainty
from tendonff.ocp.tracking.robust import ErrorBand, Sample, error_band, sample_transmissions

K = TypeVar("K", bound=Hashable)

ASSUMED = Uncertainty(mu=0.1, samples=3)
"""What is assumed where the scenario states no uncertainty: friction known to 10 % either way."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Doubt:
    """Transmissions that may be the real one."""

    samples: tuple[Sample, ...]  # the first is the nominal one
    is_assumed: bool  # the scenario states no uncertainty
    widths: str  # in words: "mu ±10 %"

    def __str__(self) -> str:
        source = "an assumption: [robust] states nothing" if self.is_assumed else "as [robust] states"
        return f"{self.widths} ({source})"


def doubt(transmission: Transmission, uncertainty: Uncertainty) -> Doubt:
    """What may be the real transmission, by the scenario's uncertainty.

    Where that says that all is certain, or takes a single sample, it is `ASSUMED` instead.
    """
    is_assumed = uncertainty.is_certain or uncertainty.samples == 1
    stated = ASSUMED if is_assumed else uncertainty
    widths = (("mu", stated.mu), ("stiffness", stated.stiffness), ("bristle stiffness", stated.bristle_stiffness))
    return Doubt(
        samples=sample_transmissions(transmission, stated),
        is_assumed=is_assumed,
        widths=", ".join(f"{name} ±{100 * width:.3g} %" for name, width in widths if width > 0),
    )


def error_bands(
    samples: tuple[Sample, ...], level: Level, forces_N: Mapping[K, FloatArray], reference: Reference
) -> dict[K, ErrorBand]:
    """Errors of each force, shape (n,), over samples of the transmission; equal forces are tried once."""
    tension, step, start = reference.tension_N, reference.step_s, reference.initial_tension_N
    unique = {force.tobytes(): force for force in forces_N.values()}
    seen = {
        key: error_band(samples, level, force, tension, step, initial_tension_N=start, periodic=reference.periodic)
        for key, force in unique.items()
    }
    return {name: seen[force.tobytes()] for name, force in forces_N.items()}
