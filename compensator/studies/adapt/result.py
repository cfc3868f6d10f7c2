"""Result of a study of the self-tuning compensator, and its plants, which differ from the scenario."""

from dataclasses import dataclass, replace
from enum import StrEnum
from typing import ClassVar

import numpy as np

from tendonff.compensator.compensators.certificate import FeedbackCertificate
from tendonff.compensator.compensators.profile import FloatArray
from tendonff.compensator.scenario.sampled.sampling import Reference
from tendonff.compensator.studies.adapt.study import AdaptationStudy
from tendonff.ocp.adaptation.bounds import CertifiedInterval
from tendonff.ocp.adaptation.information import Information
from tendonff.ocp.adaptation.tuning import Sensor, Tuning

SHORT_S = 6.0
"""Least duration of a run [s]: shorter references go forwards and backwards until then."""

DRIFT_S = 60.0
"""Duration of the drift [s]."""

SETTLED_S = 2.0
"""Errors after this time count as settled [s]."""

WINDOW_S = 0.25
"""Over which errors are averaged where they are shown over time [s]."""

WORSE = 1.05
"""A plant on which self-tuning has more than this times the plain error, and more than 1 %, is named as a limit."""

WORSE_SECOND = 1.3
"""Likewise for its worst second: more than this times the plain error there."""

SECOND_PERCENT = 0.5
"""Seconds with less than this error [% of range] count as good, whatever the plain one."""


def moving_rms(error: FloatArray, step_s: float) -> FloatArray:
    """RMS error over the last `WINDOW_S` at every sample."""
    window = max(round(WINDOW_S / step_s), 1)
    return np.sqrt(np.convolve(error**2, np.ones(window) / window)[: len(error)])


def worst_second(tuned: FloatArray, plain: FloatArray, step_s: float, scale: float) -> tuple[float, float]:
    """Largest ratio of two errors over any second, and the first one there [% of `scale`]; see `Case`."""
    window = min(max(round(1 / step_s), 1), len(tuned))
    sums = (np.concatenate([[0.0], np.cumsum(error**2)]) for error in (tuned, plain))
    left, before = (100 / scale * np.sqrt((s[window:] - s[:-window]) / window) for s in sums)
    counts = left > SECOND_PERCENT
    if not counts.any():
        return 0.0, 0.0
    # where the plain inverse is exact by chance the ratio says nothing beyond this
    ratio = np.where(counts, left / np.maximum(before, 1e-3 * SECOND_PERCENT), 0.0)
    worst = int(np.argmax(ratio))
    return float(ratio[worst]), float(left[worst])


class Change(StrEnum):
    """Property of a plant that changes during the run; all others differ from the start."""

    NOTHING = "nothing"
    MU_STEP = "mu_step"  # in the middle of the run, at once
    MU_DRIFT = "mu_drift"  # linearly over the whole run
    LOAD_STEP = "load_step"
    POSTURE = "posture"  # the load swings about the scenario's, once in four seconds


@dataclass(frozen=True, slots=True, kw_only=True)
class Variation:
    """Plant: factors on the scenario's values, and errors of the start and the sensor.

    Attributes
    ----------
    name : str
        Description, as shown.
    mu, bristle, stiffness, load : float
        Factors on friction coefficients, bristle stiffness, k1 and k2, and k_l.
    release : float
        Factor on friction when releasing, beside `mu`.
    gear : float
        Dry friction of the drive as a share of the range of the reference.
    load_exponent : float or None
        n of friction that falls with the tension, mu (T/T_0)^-n, as stated at the tension of the start; None: as the
        scenario.
    gain : float
        Factor on what the sensor measures.
    crosstalk : float
        Share of the actuator's force in what the sensor shows.
    delay_s : float or None
        True age of a measurement when it arrives [s]; None: as stated.
    joints_late_s : float
        Age of the joint angles when they arrive [s].
    stretch_m : float
        Elongation of the tendon in mid-run, within half a second [m].
    change : Change
        What changes during the run.
    start : float
        True tension at the start over the one that the controller assumes.
    offset : float
        Sensor offset as a share of the range that the measurement covers.
    duration_s : float
        Least duration [s].
    """

    name: str
    mu: float = 1.0
    bristle: float = 1.0
    stiffness: float = 1.0
    load: float = 1.0
    release: float = 1.0
    gear: float = 0.0
    load_exponent: float | None = None
    gain: float = 1.0
    crosstalk: float = 0.0
    delay_s: float | None = None
    joints_late_s: float = 0.0
    stretch_m: float = 0.0
    change: Change = Change.NOTHING
    start: float = 1.0
    offset: float = 0.0
    duration_s: float = SHORT_S


def friction_off(mu: float) -> Variation:
    """The plant with nothing but the factor `mu` on its friction coefficients."""
    return Variation(name=f"friction {100 * (mu - 1):+.0f} %".replace("-", "\N{MINUS SIGN}"), mu=mu)


def _other_loads(stated: float) -> tuple[Variation, ...]:
    """Friction that falls with the tension where none is stated, or otherwise than stated."""
    if stated == 0:
        return (Variation(name="friction falls with the tension as T^-0.2", load_exponent=0.2),)
    return tuple(
        Variation(name=f"friction falls with the tension as T^-{n:.2g}", load_exponent=n)
        for n in (0.5 * stated, 1.5 * stated)
    )


def variations(sensor: Sensor, *, moving: bool = False, load_exponent: float = 0.0) -> tuple[Variation, ...]:
    """The plants of the study, the scenario's own first; `moving`: joints move the path.

    An offset means nothing for a position that is relative to the start, but drift of its zero does.
    """
    others = tuple(
        replace(one, name=f"{prefix}{one.name} {sign}20 %", mu=mu)
        for mu, prefix in ((1.0, ""), (1.2, "friction +20 %, "))
        for sign, factor in (("\N{MINUS SIGN}", 0.8), ("+", 1.2))
        for one in (
            Variation(name="bristles", bristle=factor),
            Variation(name="tendon", stiffness=factor),
            Variation(name="load", load=factor),
        )
    )
    return (
        Variation(name="as the scenario"),
        *map(friction_off, (0.6, 0.8, 0.9, 1.1, 1.2, 1.4)),
        *others,
        Variation(name="friction releasing \N{MINUS SIGN}30 %", release=0.7),
        Variation(name="friction +20 %, releasing \N{MINUS SIGN}30 %", mu=1.2, release=0.7 / 1.2),
        Variation(name="tendon stretches by 1 mm, friction +10 %", mu=1.1, stretch_m=1e-3),
        Variation(name="a lubricated spot in mid-run takes 10 % of friction", mu=0.9, change=Change.MU_STEP),
        Variation(name="load changes with posture by 30 %", load=1.3, change=Change.POSTURE),
        Variation(name="dry friction of the drive 3 % of range", gear=0.03),
        *(() if moving else _other_loads(load_exponent)),
        Variation(name="sensor gain +3 %", gain=1.03),
        *(
            (Variation(name="1 % of crosstalk from the actuator's tension cell", crosstalk=0.01),)
            if sensor is Sensor.OUTPUT_TENSION
            else ()
        ),
        Variation(name="measurement 3 ms later than stated", delay_s=3e-3),
        *((Variation(name="joint angles 10 ms late", joints_late_s=0.01),) if moving else ()),
        Variation(name="friction steps by +20 %", mu=1.2, change=Change.MU_STEP),
        Variation(name="friction drifts by +30 % in a minute", mu=1.3, change=Change.MU_DRIFT, duration_s=DRIFT_S),
        Variation(name="load steps by \N{MINUS SIGN}33 %", mu=1.2, load=2 / 3, change=Change.LOAD_STEP),
        Variation(name="load steps by +33 %", mu=1.2, load=4 / 3, change=Change.LOAD_STEP),
        Variation(name="start tension 5 % higher", mu=1.2, start=1.05),
        Variation(
            name="sensor offset 1 % of range" if sensor is Sensor.OUTPUT_TENSION else "zero off by 1 % of travel",
            mu=1.2,
            offset=0.01,
        ),
    )


class Scheme(StrEnum):
    """Compared scheme."""

    FEEDFORWARD = "feedforward"  # the exact inverse at the scenario's values
    FEEDBACK = "feedback"  # the same with integral action on the measured output tension
    SELF_TUNING = "self_tuning"  # the inverse that tunes itself, with the scenario's integral action


@dataclass(frozen=True, slots=True, kw_only=True)
class Trace:
    """Scheme on a plant.

    Attributes
    ----------
    tension_N : ndarray
        Shape (n,); output tension at the samples of the case [N].
    factors, deviation : ndarray
        Shape (n, parameters); estimates and their standard deviations.
    rmse_percent, settled_percent : float
        RMS error of the whole run, and after `SETTLED_S`, % of reference range.
    time_to_one_percent_s : float or None
        From when on the error stays within 1 % (RMS over a quarter of a second); None if it never does.
    frozen_after_s : float or None
        When the watch on the residual stopped the tuning.
    """

    tension_N: FloatArray
    factors: FloatArray
    deviation: FloatArray
    rmse_percent: float
    settled_percent: float
    time_to_one_percent_s: float | None
    frozen_after_s: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """Plant with every scheme.

    Attributes
    ----------
    variation : Variation
        The plant.
    time_s, reference_N, mu_factor : ndarray
        Shape (n,); the reference of this case, and the plant's true factor on mu.
    traces : dict[Scheme, Trace]
        Each scheme on it.
    worst_second : tuple[float, float]
        Largest ratio of the RMS error with self-tuning to that of plain feedforward over any second in which more
        than `SECOND_PERCENT` is left, and what is left there [% of range]; zeros where there is none.
    """

    variation: Variation
    time_s: FloatArray
    reference_N: FloatArray
    mu_factor: FloatArray
    traces: dict[Scheme, Trace]
    worst_second: tuple[float, float] = (0.0, 0.0)

    @property
    def is_limit(self) -> bool:
        """Self-tuning makes it worse than plain feedforward, and leaves more than 1 %."""
        plain, tuned = self.traces[Scheme.FEEDFORWARD], self.traces[Scheme.SELF_TUNING]
        return tuned.settled_percent > 1.0 and tuned.settled_percent > WORSE * plain.settled_percent


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class TensionStudy(AdaptationStudy):
    """Self-tuning of a tension on every plant; see `AdaptationStudy`.

    Attributes
    ----------
    reference : Reference
        Desired tension, sampled.
    tuning : Tuning
        Numbers of the recursion.
    information : Information
        Along the reference, on the scenario's own plant.
    certificate : FeedbackCertificate or None
        Of the integral action; None without a measured output tension.
    interval : CertifiedInterval or None
        Along the reference; None where the path moves.
    bounds_N : tuple[ndarray, ndarray] or None
        That interval for the design's force, shape (n,) each.
    """

    shown_by: ClassVar[str] = "studies.adapt.output"

    reference: Reference
    tuning: Tuning
    information: Information
    certificate: FeedbackCertificate | None
    interval: CertifiedInterval | None
    bounds_N: tuple[FloatArray, FloatArray] | None

    @property
    def lines(self) -> tuple[str, ...]:
        """The finding in words."""
        certificate = () if self.certificate is None else (self.certificate.sentence(),)
        return (*certificate, self.headline)
