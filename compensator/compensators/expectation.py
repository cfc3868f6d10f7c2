"""Expected error of a profile on a rig: its errors over all admitted transmissions.

One set of plants and one rule for every command: the plants have `FINE_SEGMENTS` masses, the number that is shown is
the worst RMS error over them, and the best profile is the one with the smallest such number.
"""

import math
from collections.abc import Hashable, Mapping
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from tendonff.compensator.compensators.plant import FINE_SEGMENTS, Plant
from tendonff.compensator.compensators.profile import FloatArray, Profile
from tendonff.compensator.compensators.score import Score, score
from tendonff.compensator.compensators.uncertain import Doubt, Sample
from tendonff.compensator.scenario.sampled.sampling import Reference
from tendonff.models.fidelity import Level

K = TypeVar("K", bound=Hashable)

FRICTIONLESS = "frictionless"
"""Name of the compensator that stands for "without friction compensation"."""

_OVERCOMPENSATION = 0.02  # swing beyond that of the reference that is worth a warning [-]


@dataclass(frozen=True, slots=True, kw_only=True)
class ErrorBand:
    """Errors of one profile over the samples of the transmission.

    Attributes
    ----------
    scores : tuple of Score
        Errors on every sample, in their order; infinite where the simulation failed.
    worst : Score
        The score with the largest RMS error, over the samples and the corner of all intervals that is worst for this
        profile.
    worst_sample : Sample
        Where that is.
    worst_peak_N : float
        Largest error at any time on any plant [N].
    amplification : float
        Largest swing of the output over the swing of the reference, less 1 [-]. Positive is over-compensation: the
        output moves more than requested. That is the dangerous side: in a loop it adds energy that friction,
        overestimated, does not take away.
    amplified_sample : Sample
        The one with that swing.
    slack_samples : int
        On so many samples some link goes slack.
    low_N, high_N : ndarray, shape (n,)
        Least and largest output tension over all of them [N].
    """

    scores: tuple[Score, ...]
    worst: Score
    worst_sample: Sample
    worst_peak_N: float
    amplification: float
    amplified_sample: Sample
    slack_samples: int
    low_N: FloatArray
    high_N: FloatArray

    @property
    def nominal(self) -> Score:
        """Errors with the scenario's own numbers."""
        return self.scores[0]

    def rms_N(self) -> FloatArray:
        """RMS errors on the samples, shape (samples,) [N]."""
        return np.array([each.rmse_N for each in self.scores])


@dataclass(frozen=True, slots=True, kw_only=True)
class Contribution:
    """Effect of a single uncertain number.

    Attributes
    ----------
    key : str
        Its key in the scenario; several that vary together are separated by commas.
    rmse_N : float
        RMS error at the worse end of its interval, with all else nominal [N].
    """

    key: str
    rmse_N: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Expectation:
    """Errors over the transmissions that may be the real one, and the profile that does best there.

    Attributes
    ----------
    doubt : Doubt
        What may be the real transmission.
    level : Level
        Of the plants.
    bands : mapping of str to ErrorBand
        By name of the compensator.
    recommended : str
        Name of the compensator whose worst error is least in two digits, of equal ones the best with the nominal
        parameters.
    reference : Reference
        What the errors refer to.
    """

    doubt: Doubt
    level: Level
    bands: Mapping[str, ErrorBand]
    recommended: str
    reference: Reference

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
        rms = self.best.rms_N()
        found = [
            Contribution(key=spread.name, rmse_N=float(np.max(rms[list(self.doubt.ends(k))])))
            for k, spread in enumerate(self.doubt.spreads)
        ]
        return tuple(sorted(found, key=lambda each: -each.rmse_N))

    def headline(self, label: str, next_command: str) -> str:
        """Expected error of the profile of that label, and the next command."""
        worst = self.best.worst
        if not math.isfinite(worst.rmse_N):
            return f"No profile can be simulated on every plant of {self.doubt}. Next: {next_command}"
        without = self.worst_percent.get(FRICTIONLESS)
        compared = ""
        if self.recommended == FRICTIONLESS:
            compared = "; friction compensation does not reduce it"
        elif without is not None:
            compared = f"; {two_digits(without)} % without friction compensation"
        percent = two_digits(worst.rmse_percent_of_range)
        return (
            f"Tracking error up to {two_digits(worst.rmse_N)} N RMS ({percent} % of {self.reference.share_of}), "
            f"peak {two_digits(self.best.worst_peak_N)} N, with the {label}, for {self.doubt} on the {self.level} "
            f"level{compared}. Largest contribution: {self.contributions[0].key}. Next: {next_command}"
        )

    @property
    def warnings(self) -> list[str]:
        """Over-compensation is the dangerous side: name it."""
        over = {
            name: band
            for name, band in self.bands.items()
            if name not in ("none", FRICTIONLESS) and _OVERCOMPENSATION < band.amplification < math.inf
        }
        if not over or self.doubt.is_assumed:
            return []
        swings = ", ".join(f"{name} {100 * band.amplification:.2g}" for name, band in over.items())
        largest = max(over.values(), key=lambda band: band.amplification).amplified_sample
        where = ", ".join(f"{key} = {value:.3g}" for key, value in largest.numbers.items()) or "the nominal values"
        text = (
            f"over-compensation, in % of the swing, largest over the samples ({where}): {swings}; inside a feedback "
            "loop over-compensation injects energy: choose mu too low rather than too high"
        )
        return [text]


def two_digits(value: float) -> str:
    """A number as headlines and tables of errors show it: two significant digits, never an exponent."""
    if not math.isfinite(value):
        return "–"
    if value < 0.001:
        return "< 0.001"
    rounded = float(f"{value:.1e}")
    return f"{rounded:.{max(0, 1 - math.floor(math.log10(rounded)))}f}"


def expect(doubt: Doubt, level: Level, profiles: Mapping[str, Profile], reference: Reference) -> Expectation:
    """Try profiles, by name of the compensator, on all transmissions that may be the real one, at a fidelity level."""
    return expectation_of(doubt, level, error_bands(doubt, level, profiles, reference), reference)


def expectation_of(
    doubt: Doubt,
    level: Level,
    bands: Mapping[str, ErrorBand],
    reference: Reference,
    recommended: str | None = None,
) -> Expectation:
    """The expectation of known error bands; by default the compensator with the smallest worst error is recommended."""
    if recommended is None:
        shown = {name: float(f"{band.worst.rmse_percent_of_range:.2g}") for name, band in bands.items()}
        least = min(shown.values())
        equal = [name for name in bands if shown[name] <= least]
        recommended = min(equal, key=lambda name: bands[name].nominal.rmse_N)
    return Expectation(doubt=doubt, level=level, bands=bands, recommended=recommended, reference=reference)


def error_bands(doubt: Doubt, level: Level, profiles: Mapping[K, Profile], reference: Reference) -> dict[K, ErrorBand]:
    """Errors of each profile over the samples; equal profiles are tried once."""
    seen: dict[bytes, ErrorBand] = {}
    bands = {}
    for name, profile in profiles.items():
        key = (profile.force_N if profile.command_m is None else profile.command_m).tobytes()
        if key not in seen:
            seen[key] = _band(doubt, level, profile, reference)
        bands[name] = seen[key]
    return bands


def worst_corner(doubt: Doubt, error_N: FloatArray) -> list[float]:
    """The corner of all intervals where the error is largest, a place in each: −1 (low) or 1 (high).

    Errors, shape (samples, n), are those on the samples of the doubt. Between both ends of an interval the error is
    taken as linear and those of several intervals as additive; from three starts ends are exchanged while the mean
    square grows.
    """
    nominal = np.nan_to_num(error_N[0])
    low, high = (np.nan_to_num(error_N[[doubt.ends(k)[side] for k in range(len(doubt.spreads))]]) for side in (0, 1))
    slope, middle = 0.5 * (high - low), nominal + (0.5 * (high + low) - nominal).sum(axis=0)
    gram, linear = slope @ slope.T, slope @ middle

    def size(places: FloatArray) -> float:
        return float(places @ gram @ places + 2 * linear @ places)

    worse = np.where((high**2).sum(axis=1) >= (low**2).sum(axis=1), 1.0, -1.0)
    found = []
    for start in (worse, np.ones(len(worse)), -np.ones(len(worse))):
        places, largest = start.copy(), size(start)
        grew = True
        while grew:
            grew = False
            for k in range(len(places)):
                places[k] *= -1
                if (changed := size(places)) > largest * (1 + 1e-12) + 1e-300:
                    largest, grew = changed, True
                else:
                    places[k] *= -1
        found.append((largest, places.tolist()))
    corner: list[float] = max(found)[1]
    return corner


def _band(doubt: Doubt, level: Level, profile: Profile, reference: Reference) -> ErrorBand:
    def respond(sample: Sample) -> FloatArray:
        response = Plant(sample.transmission, level, FINE_SEGMENTS).respond(profile, reference)
        slack.append(response.slack is not None)
        return response.output_N

    slack: list[bool] = []
    samples = list(doubt.samples)
    outputs = [respond(sample) for sample in samples]
    scores = [score(reference.tension_N, output) for output in outputs]
    own = len(samples)
    if len(doubt.spreads) > 1:
        corner = doubt.at(worst_corner(doubt, np.array(outputs) - reference.tension_N))
        samples.append(corner)
        outputs.append(respond(corner))
        scores.append(score(reference.tension_N, outputs[-1]))
    worst = max(range(len(scores)), key=lambda k: scores[k].rmse_N)
    span = max(float(np.ptp(reference.tension_N)), 1e-300)
    swings = [float(np.ptp(np.nan_to_num(output, nan=np.inf))) / span for output in outputs]
    widest = int(np.argmax(np.nan_to_num(swings, nan=np.inf)))
    return ErrorBand(
        scores=tuple(scores[:own]),
        worst=scores[worst],
        worst_sample=samples[worst],
        worst_peak_N=max(each.peak_error_N for each in scores),
        amplification=float(np.nan_to_num(swings[widest], nan=np.inf)) - 1,
        amplified_sample=samples[widest],
        slack_samples=sum(slack),
        low_N=np.fmin.reduce(outputs),
        high_N=np.fmax.reduce(outputs),
    )
