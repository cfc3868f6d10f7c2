"""What a study of the self-tuning compensator holds."""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from tendonff.compensator.adapt.feedback import FeedbackCertificate
from tendonff.compensator.adapt.plants import Variation
from tendonff.compensator.compensators.base import FloatArray
from tendonff.compensator.scenario.sampled.sampling import Reference
from tendonff.compensator.scenario.scenario import Scenario
from tendonff.ocp.adaptation.bounds import CertifiedInterval
from tendonff.ocp.adaptation.information import Information
from tendonff.ocp.adaptation.tuning import Tuning

SETTLED_S = 2.0
"""Errors after this time count as settled [s]."""

WINDOW_S = 0.25
"""Over which errors are averaged where they are shown over time [s]."""

WORSE = 1.3
"""A plant on which self-tuning has more than this times the plain error, and more than 1 %, is named as a limit."""


def moving_rms(error: FloatArray, step_s: float) -> FloatArray:
    """RMS error over the last `WINDOW_S` at every sample."""
    window = max(round(WINDOW_S / step_s), 1)
    return np.sqrt(np.convolve(error**2, np.ones(window) / window)[: len(error)])


class Scheme(StrEnum):
    """What is compared."""

    FEEDFORWARD = "feedforward"  # the exact inverse at the scenario's values
    FEEDBACK = "feedback"  # the same with integral action on the measured output tension
    SELF_TUNING = "self_tuning"  # the inverse that tunes itself, with the scenario's integral action


@dataclass(frozen=True, slots=True, kw_only=True)
class Trace:
    """One scheme on one plant."""

    tension_N: FloatArray  # shape (n,); output tension at the samples of the case [N]
    # factors, deviation: shape (n, parameters); estimates and their standard deviations
    factors: FloatArray
    deviation: FloatArray
    # rmse_percent, settled_percent: RMS error of the whole run, and after `SETTLED_S`, % of reference range
    rmse_percent: float
    settled_percent: float
    # from when on the error stays within 1 % (RMS over a quarter of a second); None if it never does
    time_to_one_percent_s: float | None
    frozen_after_s: float | None  # when the watch on the residual stopped the tuning


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """One plant with every scheme."""

    variation: Variation
    # time_s, reference_N, mu_factor: shape (n,); the reference of this case, and the plant's true factor on mu
    time_s: FloatArray
    reference_N: FloatArray
    mu_factor: FloatArray
    traces: dict[Scheme, Trace]

    @property
    def is_limit(self) -> bool:
        """Self-tuning makes it worse than plain feedforward, or never gets below 1 %."""
        plain, tuned = self.traces[Scheme.FEEDFORWARD], self.traces[Scheme.SELF_TUNING]
        return tuned.settled_percent > 1.0 and tuned.settled_percent > WORSE * plain.settled_percent


@dataclass(frozen=True, slots=True, kw_only=True)
class AdaptationData:
    """The whole study."""

    scenario: Scenario
    reference: Reference
    tuning: Tuning
    information: Information  # along the reference, on the scenario's own plant
    certificate: FeedbackCertificate | None  # of the integral action; None without a measured output tension
    interval: CertifiedInterval | None  # along the reference; None where the path moves
    bounds_N: tuple[FloatArray, FloatArray] | None  # that interval for the design's force, shape (n,) each
    cases: tuple[Case, ...]
    headline: str
    warnings: tuple[str, ...]
