"""Expected error of a profile on a rig: its errors over all admitted transmissions.

One set of plants and one rule for every command: the plants have `FINE_SEGMENTS` masses, the number that is shown is
the worst RMS error over them, and the best profile is the one with the smallest such number.
"""

import math
from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, TypeVar

import numpy as np

from tendonff.compensator.compensators.plant import FINE_SEGMENTS, SHAKEN_REFINEMENT, Plant
from tendonff.compensator.compensators.profile import FloatArray, Profile
from tendonff.compensator.compensators.score import Score, score
from tendonff.compensator.compensators.superposition import Superposition
from tendonff.compensator.compensators.uncertain import UNSTATED, Doubt, Sample
from tendonff.compensator.files.notices import Danger
from tendonff.compensator.scenario.sampled.sampling import Reference
from tendonff.compensator.scenario.unit import NEWTON, Unit
from tendonff.models.fidelity import Level
from tendonff.models.parameters import Transmission
from tendonff.models.parameters.numbers import FACTORS
from tendonff.models.servo import DriveClass

K = TypeVar("K", bound=Hashable)
P = TypeVar("P")
S = TypeVar("S")

FRICTIONLESS = "frictionless"
"""Name of the compensator that stands for "without friction compensation"."""

WITHOUT_WAVES = (
    "steps, samples or play of the drive start waves in the tendon; the simulation in the finer steps that follow them "
    "failed, so the errors are without them and may be too small; make the reference slower or [run] step_s smaller"
)
"""Warning on errors without waves of the tendon."""

LIKELY_SHARES = (0.1, 0.9)
"""A tenth of all draws have a smaller error than the first, a tenth a larger one than the second."""

LARGE_PERCENT = 10.0
"""An RMS error above this is large: a tenth of what is wanted [% of range]."""

_PURPOSES = {"N": "force control", "N_m": "torque control"}  # by key of the unit; of the others: positioning
_NOTICED = 1e-6  # of the error, that a number must add to contribute [-]
_OVERCOMPENSATION = 0.02  # swing beyond that of the reference that is worth a warning [-]


@dataclass(frozen=True, slots=True, kw_only=True)
class ErrorBand:
    """Errors of one profile over the samples of the system, in the unit of the reference.

    Attributes
    ----------
    scores : tuple of Score
        Errors on every sample, in their order; infinite where the simulation failed.
    worst : Score
        The score with the largest RMS error, over the samples and the corner of all intervals that is worst for this
        profile.
    worst_sample : Sample
        Where that is.
    expected_rmse : float
        RMS error that half of what is admitted stays below, in the unit of the reference.
    expected_percent : float
        The same [% of range].
    likely_rmse, likely_percent : tuple of float
        RMS errors between which `LIKELY_SHARES` of what is admitted lie, in the unit of the reference and in % of
        range; the second is that of another law where the measurements do not exclude it and its error is larger.
    other : Score or None
        Error by that law.
    worst_peak : float
        Largest error at any time on any plant.
    amplification : float
        Largest swing of the output over the swing of the reference, less 1 [-]. Positive is over-compensation: the
        output moves more than requested. That is the dangerous side: in a loop it adds energy that friction,
        overestimated, does not take away.
    amplified_sample : Sample
        The one with that swing.
    slack_samples : int
        On so many samples some link goes slack.
    low, high : ndarray, shape (n,)
        Least and largest output over all of them.
    errors : Superposition
        Errors over time, by what is uncertain.
    is_without_waves : bool
        Waves that the drive starts in the tendon are not in the errors: the simulation that follows them failed.
    """

    scores: tuple[Score, ...]
    worst: Score
    worst_sample: Sample[Any]
    expected_rmse: float
    expected_percent: float
    likely_rmse: tuple[float, float]
    likely_percent: tuple[float, float]
    worst_peak: float
    amplification: float
    amplified_sample: Sample[Any]
    slack_samples: int
    low: FloatArray
    high: FloatArray
    errors: Superposition = field(repr=False)
    other: Score | None = None
    is_without_waves: bool = False

    @property
    def nominal(self) -> Score:
        """Errors with the scenario's own numbers."""
        return self.scores[0]

    @property
    def hangs_on_the_law(self) -> bool:
        """Whether another law that the measurements do not exclude has a larger error than noise explains."""
        return self.other is not None and self.other.rmse >= self.likely_rmse[1]

    @property
    def likely(self) -> str:
        """Ends of `likely_percent` in words: "0.04 to 0.09"."""
        return " to ".join(dict.fromkeys(map(two_digits, self.likely_percent)))

    def rms(self) -> FloatArray:
        """RMS errors on the samples, shape (samples,)."""
        return np.array([each.rmse for each in self.scores])


@dataclass(frozen=True, slots=True, kw_only=True)
class Contribution:
    """Effect of a single uncertain number.

    Attributes
    ----------
    key : str
        Its key in the scenario; several that vary together are separated by commas.
    rmse : float
        RMS error at the worse end of its interval, with all else nominal but what is correlated with it, in the unit of
        the reference.
    """

    key: str
    rmse: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Behind:
    """Worst error where a drive of which neither lag nor delay is stated has the longest ones of a class.

    Attributes
    ----------
    kind : DriveClass
    worst : Score
        At the worst corner of all other intervals.
    """

    kind: DriveClass
    worst: Score


@dataclass(frozen=True, slots=True, kw_only=True)
class Expectation:
    """Errors over the systems that may be the real one, and the profile that does best there.

    Attributes
    ----------
    doubt : Doubt
        What may be the real system.
    level : Level
        Of the plants.
    bands : mapping of str to ErrorBand
        By name of the compensator.
    recommended : str
        Name of the compensator whose worst error is least in two digits, of equal ones the best with the nominal
        parameters.
    share_of : str
        Scale of percentages in words: "range", and of what where that is not the reference as written.
    unit : Unit
        Of the errors.
    change : str
        What to change where the reference is out of the actuator's reach: the next step whatever is uncertain.
    behind : tuple of Behind
        Errors of the recommended profile behind drives of each class, where lag and delay of a drive are not stated.
    """

    doubt: Doubt[Any]
    level: Level
    bands: Mapping[str, ErrorBand]
    recommended: str
    share_of: str = "range"
    unit: Unit = NEWTON
    change: str = ""
    behind: tuple[Behind, ...] = ()

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: up to {self.error}, with {self.recommended!r}, for {self.doubt}>"

    @property
    def best(self) -> ErrorBand:
        """Errors of the recommended profile."""
        return self.bands[self.recommended]

    @property
    def worst_percent(self) -> dict[str, float]:
        """Worst RMS error, by name of the compensator [% of range]."""
        return {name: band.worst.rmse_percent_of_range for name, band in self.bands.items()}

    @property
    def contributions(self) -> tuple[Contribution, ...]:
        """Effect of each uncertain number on the recommended profile, largest first."""
        rms = self.best.rms()
        found = [
            Contribution(key=spread.name, rmse=float(np.max(rms[list(self.doubt.ends(k))])))
            for k, spread in enumerate(self.doubt.spreads)
        ]
        return tuple(sorted(found, key=lambda each: -each.rmse))

    @property
    def error(self) -> str:
        """Worst RMS error, its share of the range, and the peak."""
        worst = self.best.worst
        rmse, peak = (two_digits(self.unit.factor * value) for value in (worst.rmse, self.best.worst_peak))
        percent = two_digits(worst.rmse_percent_of_range)
        return f"{rmse} {self.unit.shown} RMS ({percent} % of {self.share_of}), peak {peak} {self.unit.shown}"

    def headline(self, label: str, next_command: str) -> str:
        """Expected error of the profile of that label, and the next command."""
        worst = self.best.worst
        if not math.isfinite(worst.rmse):
            return f"No profile can be simulated on every plant of {self.doubt}. Next: {next_command}"
        without = self.worst_percent.get(FRICTIONLESS)
        compared = ""
        if self.recommended == FRICTIONLESS:
            compared = "; friction compensation does not reduce it"
        elif without is not None:
            compared = f"; {two_digits(without)} % without friction compensation"
        unfit = unfit_for(self.unit, worst.rmse_percent_of_range)
        begin = f"{unfit}: tracking" if unfit else "Tracking"
        return (
            f"{begin} error up to {self.error}, with the {label} ({self.best.likely} % expected), "
            f"for {self.doubt} on the {self.level} level{compared}. "
            f"{self.unstated}{self._largest} Next: {next_command}"
        )

    @property
    def _largest(self) -> str:
        """Sentence on the uncertain number that matters most."""
        first = self.contributions[0]
        if first.rmse <= (1 + _NOTICED) * self.best.nominal.rmse:
            return "What is uncertain adds nothing to the error."
        return f"Largest contribution: {first.key}."

    @property
    def unstated(self) -> str:
        """Sentence on a drive whose lag and delay are not stated; empty where they are."""
        if not self.behind:
            return ""
        percent = ", ".join(f"{two_digits(each.worst.rmse_percent_of_range)} % ({each.kind})" for each in self.behind)
        return f"Lag and delay of the drive, not stated, make it up to {percent}: set drive_class, or measure them. "

    @property
    def warnings(self) -> list[str]:
        """Warnings of what the errors lack, and of over-compensation, the dangerous side."""
        found = [WITHOUT_WAVES] if self.best.is_without_waves else []
        if self.best.other is not None and self.best.hangs_on_the_law:
            found.append(
                "the measurements do not exclude the friction of [robust.other_law], with which the error is "
                f"{two_digits(self.best.other.rmse_percent_of_range)} % of {self.share_of}: identify with a log that "
                "reaches the lowest and the highest tension of the reference (--suggest)"
            )
        over = {
            name: band
            for name, band in self.bands.items()
            if name not in ("none", FRICTIONLESS) and _OVERCOMPENSATION < band.amplification < math.inf
        }
        if not over or self.doubt.is_assumed:
            return found
        swings = ", ".join(f"{name} {two_digits(100 * band.amplification)}" for name, band in over.items())
        largest = max(over.values(), key=lambda band: band.amplification).amplified_sample
        where = sample_words(largest.numbers) or "the nominal values"
        text = Danger(
            f"over-compensation, in % of the swing, largest over the samples ({where}): {swings}; inside a feedback "
            "loop over-compensation injects energy: choose mu too low rather than too high"
        )
        return [*found, text]


def sample_words(numbers: Mapping[str, float]) -> str:
    """Numbers of a sample: "0.75 mu" of a factor, "friction.adhesion_N = 3" of a value."""
    return ", ".join(
        f"{value:.3g} {key}" if key in FACTORS else f"{key} = {value:.3g}" for key, value in numbers.items()
    )


def unfit_for(unit: Unit, percent: float) -> str:
    """Verdict on a large error [% of range] of a quantity of that unit, in plain words; empty on a smaller one."""
    return f"Not good enough for {_PURPOSES.get(unit.key, 'positioning')}" if percent > LARGE_PERCENT else ""


def two_digits(value: float) -> str:
    """A number as headlines and tables of errors show it: two significant digits, never an exponent."""
    if not math.isfinite(value):
        return "–"
    if value < 0.001:
        return "< 0.001"
    rounded = float(f"{value:.1e}")
    return f"{rounded:.{max(0, 1 - math.floor(math.log10(rounded)))}f}"


def expectation_of(
    doubt: Doubt[Any],
    level: Level,
    bands: Mapping[str, ErrorBand],
    share_of: str = "range",
    unit: Unit = NEWTON,
    recommended: str | None = None,
    *,
    change: str = "",
) -> Expectation:
    """The expectation of known error bands; by default the compensator with the smallest worst error is recommended."""
    shown = {name: float(f"{band.worst.rmse_percent_of_range:.2g}") for name, band in bands.items()}
    least = min(shown.values())
    equal = [name for name in bands if shown[name] <= least]
    best = recommended or min(equal, key=lambda name: bands[name].nominal.rmse)
    return Expectation(
        doubt=doubt, level=level, bands=bands, recommended=best, share_of=share_of, unit=unit, change=change
    )


def behind_drives(
    doubt: Doubt[Any], wanted: FloatArray, band: ErrorBand, step_s: float, goals: int = 1, *, periodic: bool = False
) -> tuple[Behind, ...]:
    """Worst errors of a profile, whose band is known, behind drives of each class where lag and delay are not stated.

    The output comes later by both, at the corner of the other intervals that is worst then; nothing is simulated. Of
    several goals `wanted` has one after the other. What comes late of a cycle is the end of the one before.
    """
    found, nominal = [], (wanted + band.errors.nominal).reshape(goals, -1)
    rows = np.arange(nominal.shape[1])
    for kind in UNSTATED if doubt.drives_not_stated and math.isfinite(band.expected_rmse) else ():
        instants = rows - doubt.latest_s(kind) / step_s
        before = np.mod(instants, rows[-1]) if periodic else instants
        late = (np.array([np.interp(before, rows, output) for output in nominal]) - nominal).ravel()
        error = band.errors.at(band.errors.worst_corner(late)) + late
        found.append(Behind(kind=kind, worst=score(wanted, wanted + error)))
    return tuple(found)


def error_bands(
    doubt: Doubt[Transmission],
    level: Level,
    profiles: Mapping[K, Profile],
    reference: Reference,
    known: dict[bytes, ErrorBand],
) -> dict[K, ErrorBand]:
    """Errors of each profile over the samples; `known` as of `bands_of`."""

    def respond(transmission: Transmission, profile: Profile) -> tuple[FloatArray, bool]:
        response = Plant(transmission, level, FINE_SEGMENTS).respond(profile, reference)
        return response.delivered(reference), response.slack is not None

    def shaken(transmission: Transmission, profile: Profile) -> FloatArray:
        plant = Plant(transmission, level, refinement=SHAKEN_REFINEMENT)
        return plant.respond(profile, reference).delivered(reference)

    def given(profile: Profile) -> bytes:
        return profile.given.tobytes()

    rough = doubt.system.actuator.servo.is_rough(reference.step_s)
    return bands_of(doubt, reference.wanted, profiles, respond, given, known, shaken if rough else None)


def bands_of(
    doubt: Doubt[S],
    wanted: FloatArray,
    profiles: Mapping[K, P],
    respond: Callable[[S, P], tuple[FloatArray, bool]],
    given: Callable[[P], bytes],
    known: dict[bytes, ErrorBand],
    shaken: Callable[[S, P], FloatArray] | None = None,
) -> dict[K, ErrorBand]:
    """Errors of profiles over the samples of a doubt; profiles that give the actuator the same are tried once.

    `respond` simulates a system under a profile: the output, shape (n,), and whether a tendon went slack. `known` keeps
    the errors by what is given, for calls to come with the same samples. `shaken` simulates the nominal system in steps
    that follow the waves which a rough drive starts in a tendon; what that changes is added to every sample.
    """
    bands = {}
    for name, profile in profiles.items():
        key = given(profile)
        if key not in known:
            change: FloatArray | float = 0.0
            failed = False
            if shaken is not None:
                coarse, fine = respond(doubt.system, profile)[0], shaken(doubt.system, profile)
                failed = bool(np.isfinite(coarse).all() and not np.isfinite(fine).all())
                change = fine - coarse if np.isfinite(fine - coarse).all() else 0.0
            band = _band(doubt, wanted, lambda system, profile=profile: respond(system, profile), change)  # type: ignore[misc]
            known[key] = replace(band, is_without_waves=failed)
        bands[name] = known[key]
    return bands


def _band(
    doubt: Doubt[S],
    wanted: FloatArray,
    respond: Callable[[S], tuple[FloatArray, bool]],
    change: FloatArray | float = 0.0,
) -> ErrorBand:
    def changed(system: S) -> tuple[FloatArray, bool]:
        output, slack = respond(system)
        return output + change, slack

    samples = list(doubt.samples)
    found = [changed(sample.system) for sample in samples]
    own = len(samples)
    errors = Superposition.of(doubt, np.array([output for output, _ in found]) - wanted)
    if len(doubt.spreads) > 1:
        samples.append(doubt.at(errors.worst_corner()))
        found.append(changed(samples[-1].system))
    if (other := doubt.other) is not None:
        samples.append(other)
        found.append(changed(other.system))
    outputs, slack = zip(*found, strict=True)
    scores = [score(wanted, output) for output in outputs]
    worst = max(range(len(scores)), key=lambda k: scores[k].rmse)
    span = max(float(np.ptp(wanted)), 1e-300)
    swings = [float(np.ptp(np.nan_to_num(output, nan=np.inf))) / span for output in outputs]
    widest = int(np.argmax(np.nan_to_num(swings, nan=np.inf)))
    ends = 1 + 2 * len(doubt.spreads)
    are_known = all(math.isfinite(each.rmse) for each in scores[:ends])
    least, most = LIKELY_SHARES
    low, expected, high = errors.rmse_quantiles((least, 0.5, most)) if are_known else [math.inf] * 3
    by_other = None if other is None else scores[-1]
    high = high if by_other is None else max(high, by_other.rmse)
    return ErrorBand(
        scores=tuple(scores[:own]),
        worst=scores[worst],
        worst_sample=samples[worst],
        expected_rmse=expected,
        expected_percent=100 * expected / span,
        likely_rmse=(low, high),
        likely_percent=(100 * low / span, 100 * high / span),
        worst_peak=max(each.peak_error for each in scores),
        amplification=float(np.nan_to_num(swings[widest], nan=np.inf)) - 1,
        amplified_sample=samples[widest],
        slack_samples=sum(slack),
        low=np.fmin.reduce(outputs),
        high=np.fmax.reduce(outputs),
        errors=errors,
        other=by_other,
    )
