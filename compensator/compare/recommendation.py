"""Which level to design on, in one sentence."""

from collections.abc import Sequence

from tendonff.compensator.compare.result import ENOUGH_PERCENT, Entry
from tendonff.compensator.compensators.base import Compensator
from tendonff.compensator.compensators.registry import COMPENSATORS
from tendonff.models.fidelity import Level


def recommend(entries: Sequence[Entry], compensators: Sequence[Compensator] = COMPENSATORS) -> str:
    """Which level to design on, in one sentence; the most detailed level stands for the real transmission.

    Parameters
    ----------
    entries : sequence of Entry
    compensators : sequence of Compensator, optional
        That the entries are of, "none" and "capstan" among them.
    """
    fixed = {c.name for c in compensators if not c.knows_the_level}
    plant = Level.PRESLIDING.value
    on_plant = [e for e in entries if e.plant_level == plant]

    def best(candidates: list[Entry]) -> Entry:
        return min(candidates, key=lambda e: e.rmse_percent_of_range)

    def designed(level: Level) -> Entry:
        return best([e for e in on_plant if e.design_level is level and e.compensator not in fixed])

    candidates = [
        ("No compensation", "the wanted tension itself as force", _first(on_plant, "none")),
        ("The static capstan law", "it", _first(on_plant, "capstan")),
        *((f"The {level} level", "its design", designed(level)) for level in Level),
    ]
    ideal = best([entry for _, _, entry in candidates])
    loss = f"{ideal.rmse_percent_of_range:.2g} %"
    for name, what, entry in candidates:
        margin = max(ENOUGH_PERCENT, entry.spread_percent_of_range, ideal.spread_percent_of_range)
        if entry.rmse_percent_of_range <= ideal.rmse_percent_of_range + margin:
            if entry.plant_level == entry.design_level and entry.compensator not in fixed:
                break
            verb = "is needed" if name == "No compensation" else "is enough here"
            return (
                f"{name} {verb}: {what} leaves {entry.rmse_percent_of_range:.2g} % of range on the {plant} plant, "
                f"the best design {loss}."
            )
    others = ", ".join(
        f"{name[0].lower()}{name[1:]} {entry.rmse_percent_of_range:.2g} %" for name, _, entry in candidates[1:-1]
    )
    return f"Design on the {plant} level: on the {plant} plant its design leaves {loss} of range, against {others}."


def _first(entries: list[Entry], name: str) -> Entry:
    return next(e for e in entries if e.compensator == name)
