"""Which level to design on, in one sentence."""

from collections.abc import Mapping, Sequence

from tendonff.compensator.compare.result import ENOUGH_PERCENT, Entry
from tendonff.compensator.compensators.base import Compensator
from tendonff.compensator.compensators.registry import COMPENSATORS
from tendonff.models.fidelity import Level

_SMOOTHED = "smoothed"  # tuned on the level, but no model of it


def recommend(
    entries: Sequence[Entry],
    compensators: Sequence[Compensator] = COMPENSATORS,
    worst_percent: Mapping[tuple[str, Level], float] | None = None,
    doubt: str = "",
) -> str:
    """Which level to design on, in one sentence; the most detailed level stands for the real transmission.

    What counts is the error to expect on a rig: the worst over what may be the real transmission, where it is given.

    Parameters
    ----------
    compensators : sequence of Compensator, optional
        That the entries are of, "none" and "capstan" among them.
    worst_percent : mapping of (str, Level) to float, optional
        Worst error of a design, by name of the compensator and design level [% of range].
    doubt : str, optional
        What it is the worst over, in words.
    """
    fixed = {c.name for c in compensators if not c.knows_the_level}
    plant = Level.PRESLIDING.value
    on_plant = [e for e in entries if e.plant_level == plant]
    worst = worst_percent or {}

    def error(entry: Entry) -> float:
        return worst.get((entry.compensator, entry.design_level), entry.rmse_percent_of_range)

    def designed(level: Level) -> Entry:
        models = [e for e in on_plant if e.design_level is level and e.compensator not in {*fixed, _SMOOTHED}]
        return min(models, key=error)

    smoothed = [e for e in on_plant if e.compensator == _SMOOTHED and e.design_level is Level.PRESLIDING]
    candidates = [
        ("No compensation", _first(on_plant, "none")),
        ("The static capstan law", _first(on_plant, "capstan")),
        *(("The capstan law with a smoothed sign change", entry) for entry in smoothed),
        *((f"The {level} level", designed(level)) for level in Level),
    ]
    ideal = min((entry for _, entry in candidates), key=error)
    best = f"{error(ideal):.2g} %"
    over = f" of range on the {plant} plant{f', for {doubt}' if doubt else ''}"
    for name, entry in candidates:
        margin = max(ENOUGH_PERCENT, entry.spread_percent_of_range, ideal.spread_percent_of_range)
        if error(entry) <= error(ideal) + margin:
            if entry.plant_level == entry.design_level and entry.compensator not in {*fixed, _SMOOTHED}:
                break
            verb = "is needed" if name == "No compensation" else "is enough here"
            return f"{name} {verb}: RMS error {error(entry):.2g} %{over}; the best design {best}."
    others = ", ".join(f"{name[0].lower()}{name[1:]} {error(entry):.2g} %" for name, entry in candidates[1:-1])
    return f"Design on the {plant} level: RMS error {best}{over}, against {others}."


def _first(entries: list[Entry], name: str) -> Entry:
    return next(e for e in entries if e.compensator == name)
