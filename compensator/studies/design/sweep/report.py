"""The page of a sweep."""

from collections.abc import Mapping

from matplotlib.figure import Figure

from tendonff.compensator.reporting.page import FileNote, Report, Section, Table, pictures_of, provenance_of
from tendonff.compensator.studies.design.sweep.result import QUANTILES, YIELD_PERCENT, Sweep, key_label


def sweep_report(result: Sweep, figures: Mapping[str, Figure]) -> Report:
    """The page of a sweep."""
    unit = "units" if result.is_random else "points"
    labels = {name: each.label for name, each in result.known.items()}
    yields = Table(
        caption=f"Share of the {unit} whose error stays below a bound [%]",
        columns=("compensator", *(f"< {bound:g} % of range" for bound in YIELD_PERCENT)),
        rows=[
            (labels[name], *(round(100 * result.yield_of(name, at)) for at in YIELD_PERCENT))
            for name in result.compensators
        ],
    )
    quantiles = Table(
        caption=f"RMS error that a share of the {unit} stays within [% of reference range]",
        columns=("compensator", *(f"{100 * q:g} %" for q in QUANTILES)),
        rows=[(labels[name], *result.quantiles(name)) for name in result.compensators],
        one_quantity=True,
    )
    budget = Table(
        caption="First-order budget: error with one parameter at the ends of its range, all else nominal [% of range]",
        columns=(
            "compensator",
            *(f"{key_label(key)}: {at:g}" for key, low, high, _, _ in result.budget for at in (low, high)),
        ),
        rows=[
            (labels[name], *(error[k] for _, _, _, at_low, at_high in result.budget for error in (at_low, at_high)))
            for k, name in enumerate(result.compensators)
        ],
    )
    captions = {"yield": f"Share of the {unit} over the error.", "errors": "Error over each quantity that varies."}
    pictures = pictures_of(figures, captions)
    return Report(
        title=f"Sweep: {result.scenario.name}",
        summary=result.headline,
        warnings=(),
        sections=(
            Section(title="Yield", blocks=(pictures["yield"], yields, quantiles)),
            Section(title="What varies", blocks=(pictures["errors"], *([budget] if result.budget else []))),
        ),
        provenance=provenance_of(result.scenario, "sweep", result.options),
        files=(
            FileNote(name="samples.csv", content=f"one row for each of the {unit}"),
            FileNote(name="summary.json", content="yields, quantiles and budget for other programs"),
        ),
    )
