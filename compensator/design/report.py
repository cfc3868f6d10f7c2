"""The report of a design: what each profile delivers, in one page."""

from matplotlib.figure import Figure

from tendonff.compensator.compensators.base import Compensator, Played
from tendonff.compensator.design.figures import LABELS, percent
from tendonff.compensator.design.run import FINE_REFINEMENT, FINE_SEGMENTS, Design
from tendonff.compensator.reporting.page import Cell, FileNote, Picture, Provenance, Report, Section, Table, Text
from tendonff.models.fidelity import Level

_CAPTIONS = {
    "tension": "Wanted tension and what each profile delivers, on the design level.",
    "force": "The force that the actuator applies for it.",
    "loop": "Left: the tendon's hysteresis, output over force. Right: output over wanted tension; a perfect "
    "compensation is the diagonal.",
    "error": "Error on each fidelity level: how much the answer depends on the model it was designed with.",
}


def headline(result: Design) -> str:
    """The answer in two sentences.

    Parameters
    ----------
    result : Design
    """
    level = result.level
    none = result.on_level(Compensator.NONE, level).score
    best = min(
        (c for c in Compensator if c is not Compensator.NONE),
        key=lambda c: _proof(result, c).score.rmse_N,
    )
    return (
        f"Without compensation {percent(none)} % of the range of {result.reference.range_N:.4g} N is lost (rms, "
        f"{level} level). The best profile here, {LABELS[best]}, leaves {percent(_proof(result, best).score)} % on a "
        f"finer chain of {FINE_SEGMENTS} masses at a {FINE_REFINEMENT}th of the step."
    )


def _proof(result: Design, compensator: Compensator) -> Played:
    return next(p for p in result.proof if p.compensator == compensator)


def design_report(result: Design, figures: dict[str, Figure]) -> Report:
    """The page of a design.

    Parameters
    ----------
    result : Design
    figures : dict of str to Figure
        From `design_figures.design_figures`.
    """
    pictures = {name: Picture(figure=figure, caption=_CAPTIONS[name]) for name, figure in figures.items()}
    scores = Table(
        caption="Error, % of range rms; * design level, also of the last column",
        columns=(
            "profile",
            *(f"{level}*" if level is result.level else level.value for level in Level),
            f"{FINE_SEGMENTS} masses, step/{FINE_REFINEMENT}",
        ),
        rows=tuple(
            (
                LABELS[c],
                *(percent(result.on_level(c, level).score) for level in Level),
                percent(_proof(result, c).score),
            )
            for c in Compensator
        ),
    )
    peaks = Table(
        caption="Largest error [N]",
        columns=("profile", *(level.value for level in Level)),
        rows=tuple(
            (LABELS[c], *(result.on_level(c, level).score.peak_error_N for level in Level)) for c in Compensator
        ),
    )
    tracking = result.tracking
    solver = Table(
        caption="Optimal control",
        columns=("status", "iterations", "build [s]", "solve [s]"),
        rows=((tracking.status.value, tracking.iterations, tracking.build_s, tracking.solve_s),),
    )
    return Report(
        title=f"Design: {result.scenario.name}",
        summary=headline(result),
        warnings=result.warnings,
        sections=(
            Section(title="What arrives", blocks=(pictures["tension"], scores, peaks)),
            Section(title="What the actuator does", blocks=(pictures["force"], Text(tracking.message), solver)),
            Section(title="Hysteresis", blocks=(pictures["loop"],)),
            Section(title="How much the model matters", blocks=(pictures["error"],)),
            *_robust_section(result),
        ),
        provenance=Provenance(
            scenario=result.scenario, command=f"tendonff design {result.scenario.source.name} --out DIR"
        ),
        files=(
            FileNote(name="profile.csv", content="reference and the four forces over time"),
            FileNote(name="summary.json", content="errors, solver status and warnings for other programs"),
        ),
    )


def _robust_section(result: Design) -> tuple[Section, ...]:
    """What the scenario's uncertainty does to each profile; nothing where all is certain."""
    found = result.robustness
    if found is None:
        return ()
    span = result.reference.range_N
    rows: tuple[tuple[Cell, ...], ...] = tuple(
        (
            LABELS[compensator],
            *(
                100 * value / span
                for value in (band.nominal_rms_N, band.least_rms_N, band.median_rms_N, band.worst_rms_N)
            ),
            f"{100 * band.amplification:+.2g}",
            f"{100 * (band.worst_sample.mu - 1):+.3g}",
        )
        for compensator, band in found.bands.items()
    )
    table = Table(
        caption=f"Error over {len(found.samples)} samples of the parameters, % of range rms; over-compensation: "
        "largest swing of the output beyond the wanted one, %",
        columns=("profile", "nominal", "least", "median", "worst", "over-compensation", "mu at the worst [%]"),
        rows=rows,
    )
    note = Text(
        f"The optimal profile is made for the {found.objective.value} case. A profile that moves the output more than "
        "was asked for is on the dangerous side: in a loop it adds energy that the friction, overestimated, does not "
        "take away."
    )
    return (Section(title="When the parameters are not exact", blocks=(table, note)),)
