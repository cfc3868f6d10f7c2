"""The report of a design: what each profile delivers, in one page."""

from matplotlib.figure import Figure

from tendonff.compensator.compensators import Compensator, Played, Score
from tendonff.compensator.design import FINE_REFINEMENT, FINE_SEGMENTS, Design
from tendonff.compensator.design_figures import LABELS
from tendonff.compensator.report import FileNote, Picture, Provenance, Report, Section, Table, Text
from tendonff.models.fidelity import Level

_CAPTIONS = {
    "tension": "Wanted tension and what each profile delivers, on the design level.",
    "force": "The force that the actuator applies for it.",
    "loop": "Left: the tendon's hysteresis, output over force. Right: output over wanted tension; a perfect "
    "compensation is the diagonal.",
    "error": "Error on each fidelity level: how much the answer depends on the model it was designed with.",
}


def percent(score: Score) -> str:
    """Error in % of range with three digits; what is below 0.001 % is rounding and said to be so."""
    value = score.rmse_percent_of_range
    return f"{value:.3g}" if value >= 1e-3 else "< 0.001"


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
        ),
        provenance=Provenance(
            scenario=result.scenario, command=f"tendonff design {result.scenario.source.name} --out DIR"
        ),
        files=(
            FileNote(name="profile.csv", content="reference and the four forces over time"),
            FileNote(name="summary.json", content="errors, solver status and warnings for other programs"),
        ),
    )
