"""The matrix of a comparison: every design on every plant, whatever is the reference."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from tendonff.compensator.compensators.expectation import (
    FRICTIONLESS,
    ErrorBand,
    two_digits,
    unfit_for,
)
from tendonff.compensator.compensators.score import scale_of, score
from tendonff.compensator.files.notices import Remark
from tendonff.compensator.files.reading import FloatArray, InputError
from tendonff.compensator.reporting.colours import Style
from tendonff.compensator.scenario.unit import NEWTON, Unit
from tendonff.models.fidelity import Level

ENOUGH_PERCENT = 0.5
"""A simpler level is enough if its design costs no more than this on the most detailed plant [% of range]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Entry:
    """Compensator, designed on a level and simulated on a plant.

    Attributes
    ----------
    compensator : str
        Its name.
    design_level : Level
        Repeats for a compensator that does not depend on it.
    plant_level : str
        A `Level`, or of a tension "capstan" for the capstan law.
    rmse_percent_of_range, peak_error : float
        Of a simulation with a quarter of the step; the second in the unit of the reference.
    lag_s : float
        Delay of the output against the reference [s]; negative when it leads.
    spread_percent_of_range : float
        Largest RMS difference to simulations with half the step, the whole step, and a force that differs in the ninth
        digit, which represents a solver's tolerance [% of range]. Errors that differ by less are equal.
    """

    compensator: str
    design_level: Level
    plant_level: str
    rmse_percent_of_range: float
    peak_error: float
    lag_s: float
    spread_percent_of_range: float

    def named(self, unit: Unit) -> dict[str, str | float]:
        """Its values by name, as files have them."""
        return {f"{name}_{unit.key}" if name == "peak_error" else name: value for name, value in asdict(self).items()}


class Designed(Protocol):
    """Compensator as a comparison sees it."""

    @property
    def name(self) -> str:
        """Key in files."""

    @property
    def label(self) -> str:
        """Name for people."""

    @property
    def style(self) -> Style:
        """Drawing style."""

    @property
    def knows_the_level(self) -> bool:
        """Its profile depends on the fidelity level of the design model."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Simple:
    """Compensator that may be enough.

    Attributes
    ----------
    name : str
    words : str
        What a sentence begins with.
    """

    name: str
    words: str


REFINEMENTS = (4, 2, 1)
"""Steps to a row of the profile; the first gives the figures, the others the spread."""

SMOOTHED = "smoothed"
_NO_MODEL = (SMOOTHED, FRICTIONLESS)  # depend on the level, but hold no model of its friction
_LAG_ROWS = 4000
_LAG_SHARE = 0.25  # of the duration: a lag is sought within this, either way


def require_levels(tried: Sequence[Designed]) -> None:
    """Refuse compensators whose models depend on no level; InputError."""
    if not any(each.knows_the_level and each.name not in _NO_MODEL for each in tried):
        raise InputError(
            f"compensators must include one whose model depends on the level, got {', '.join(c.name for c in tried)}; "
            "add inverse"
        )


def entry_of(
    outputs: Iterable[FloatArray], wanted: FloatArray, step_s: float, *, name: str, level: Level, plant: str
) -> tuple[Entry, FloatArray]:
    """Cell of a design and a plant, and what is delivered there.

    The outputs, shape (n,) each, come from ever larger steps and from a profile that is a little different; the first
    one counts.
    """
    first, *others = outputs
    result = score(wanted, first)
    spread = max((float(np.sqrt(np.mean((other - first) ** 2))) for other in others), default=0.0)
    entry = Entry(
        compensator=name,
        design_level=level,
        plant_level=plant,
        rmse_percent_of_range=result.rmse_percent_of_range,
        peak_error=result.peak_error,
        lag_s=lag(wanted, first, step_s),
        spread_percent_of_range=100 * spread / scale_of(wanted),
    )
    return entry, first


def recommend(
    entries: Sequence[Entry],
    compensators: Sequence[Designed],
    bands: Mapping[tuple[str, Level], ErrorBand],
    doubt: str,
    simple: Sequence[Simple],
    unit: Unit = NEWTON,
) -> tuple[str, Level]:
    """Recommended design level, in one sentence; the most detailed level represents the real transmission.

    What counts is the error to expect on a rig: the worst over what may be the real transmission, by name of the
    compensator and design level; `doubt` names it in words. What is simple is recommended where it is good enough.
    The expectation follows in every text, and says what an error is not good enough for.
    """
    fixed = {c.name for c in compensators if not c.knows_the_level}
    plant = Level.PRESLIDING.value
    on_plant = [e for e in entries if e.plant_level == plant]

    def error(entry: Entry) -> float:
        band = bands.get((entry.compensator, entry.design_level))
        return math.inf if band is None else band.worst.rmse_percent_of_range

    def designed(level: Level) -> Entry:
        models = [e for e in on_plant if e.design_level is level and e.compensator not in {*fixed, *_NO_MODEL}]
        return min(models, key=error)

    candidates = [
        *(
            (each.words, entry)
            for each in simple
            for entry in on_plant
            if entry.compensator == each.name and entry.design_level is Level.PRESLIDING
        ),
        *((f"The {level} level", designed(level)) for level in Level),
    ]
    ideal = min((entry for _, entry in candidates), key=error)
    best = f"{two_digits(error(ideal))} %"
    over = f" of range on the {plant} plant, for {doubt}"
    for name, entry in candidates:
        margin = max(ENOUGH_PERCENT, entry.spread_percent_of_range, ideal.spread_percent_of_range)
        if error(entry) <= error(ideal) + margin:
            if entry.plant_level == entry.design_level and entry.compensator not in {*fixed, *_NO_MODEL}:
                break
            enough = "as good as any" if unfit_for(unit, error(entry)) else "enough"
            text = f"{name} is {enough} here: RMS error {two_digits(error(entry))} %{over}; the best design {best}."
            return text, entry.design_level
    others = ", ".join(f"{name[0].lower()}{name[1:]} {two_digits(error(entry))} %" for name, entry in candidates[1:-1])
    return f"Design on the {plant} level: RMS error {best}{over}, against {others}.", Level.PRESLIDING


def lag(reference: FloatArray, output: FloatArray, step_s: float) -> float:
    """Shift at which the output resembles the reference most [s], positive when it comes late; 0 for constants."""
    stride = max(1, len(reference) // _LAG_ROWS)
    wanted, got = reference[::stride], output[::stride]
    most = int(_LAG_SHARE * len(wanted))
    if most < 1 or np.ptp(wanted) == 0 or np.ptp(got) == 0:
        return 0.0
    likeness = _likeness(wanted, got, most)
    best = int(np.argmax(likeness))
    offset = 0.0
    if 0 < best < len(likeness) - 1:  # the top of the parabola through three points
        before, top, after = likeness[best - 1 : best + 2]
        bend = before - 2 * top + after
        offset = 0.5 * float(before - after) / float(bend) if bend < 0 else 0.0
    return (best - most + offset) * stride * step_s


def _likeness(wanted: FloatArray, got: FloatArray, most: int) -> FloatArray:
    """Correlation of the output, moved forward by -most .. most rows, with the reference, over the rows both have."""
    n, shift = len(wanted), np.arange(-most, most + 1)
    a, b = wanted - wanted.mean(), got - got.mean()
    size = 2 * n
    products = np.fft.irfft(np.conj(np.fft.rfft(a, size)) * np.fft.rfft(b, size), size)[
        shift
    ]  # sums of a[k] b[k + shift]
    count = n - np.abs(shift)

    def over_common(values: FloatArray, first: NDArray[np.int_]) -> FloatArray:
        sums = np.concatenate([[0.0], np.cumsum(values)])
        total: FloatArray = sums[first + count] - sums[first]
        return total

    of_a, of_b = np.maximum(-shift, 0), np.maximum(shift, 0)
    mean_a, mean_b = over_common(a, of_a) / count, over_common(b, of_b) / count
    spread_a = np.maximum(over_common(a**2, of_a) - count * mean_a**2, 0)
    spread_b = np.maximum(over_common(b**2, of_b) - count * mean_b**2, 0)
    scale = np.sqrt(spread_a * spread_b)
    likeness: FloatArray = np.divide(
        products - count * mean_a * mean_b, scale, out=np.zeros(len(shift)), where=scale > 0
    )
    return likeness


def noise_warnings(entries: Sequence[Entry]) -> list[str]:
    """Warning where the spread hides differences."""
    worst = max(entries, key=lambda e: e.spread_percent_of_range)
    if worst.spread_percent_of_range < ENOUGH_PERCENT:
        return []
    note = Remark(
        f"the response on the {worst.plant_level} level depends on the time step by up to "
        f"{worst.spread_percent_of_range:.2g} % of range ({worst.compensator} designed on {worst.design_level}): "
        "errors that differ by less are equal. Jumps of the force do that, and stick-slip (mu_static > mu_dynamic)"
    )
    return [note]
