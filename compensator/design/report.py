"""The report of a design: what to expect of each profile, in one page."""

from matplotlib.figure import Figure

from tendonff.compensator.compensators.score import scale_N
from tendonff.compensator.design.result import FINE_REFINEMENT, FINE_SEGMENTS, DesignData
from tendonff.compensator.reporting.cells import Cell
from tendonff.compensator.reporting.page import (
    Block,
    FileNote,
    Report,
    Section,
    Table,
    Text,
    pictures_of,
    provenance_of,
)
from tendonff.models.fidelity import Level

_CAPTIONS = {
    "expectation": "Output tension of the recommended profile over all sampled parameters (band), and of the reference "
    "applied directly.",
    "tension": "Reference and output tension of each profile with the design's own parameters. Below: the "
    "compensated errors, enlarged; a curve that leaves the panel is larger.",
    "force": "Actuator force, its rate of change, and the travel of the actuator's end. Dashed: limits of the "
    "actuator.",
    "loop": "Left: the tendon's hysteresis, output over force. Right: output over reference; perfect compensation is "
    "the diagonal. Equal scales on both axes.",
    "error": "Error on each fidelity level with the design's own parameters, on one scale; right: enlarged.",
}


def headline(result: DesignData) -> str:
    """What to expect on a rig, in two sentences.

    Parameters
    ----------
    result : DesignData
    """
    found, best = result.expectation, result.recommended
    over = f"the {scale_N(result.reference.tension_N):.4g} N range of the reference, for {found.doubt}"
    if best.name == "none":
        return f"The reference applied directly does best: expect an RMS error of up to {_worst(result)} of {over}."
    without = f" Without compensation: up to {_worst(result, 'none')}." if "none" in found.worst_percent else ""
    return f"Expect an RMS error of up to {_worst(result)} of {over}, with the best profile: {best.label}.{without}"


def fine_print(result: DesignData) -> str:
    """What the model says of itself.

    Parameters
    ----------
    result : DesignData
    """
    best = result.recommended
    return (
        f"With exactly the design's parameters the RMS error is {result.on_proof(best.name).score.percent} % "
        f"({best.label}, {FINE_SEGMENTS} masses, step/{FINE_REFINEMENT}). That is the accuracy of the computation, not "
        "of a rig, where the uncertainty of the parameters decides."
    )


def _worst(result: DesignData, name: str | None = None) -> str:
    return f"{result.expectation.worst_percent[name or result.expectation.recommended]:.3g} %"


def design_report(result: DesignData, figures: dict[str, Figure]) -> Report:
    """The page of a design.

    Parameters
    ----------
    result : DesignData
    figures : dict of str to Figure
        From `design_figures`.
    """
    pictures = pictures_of(figures, _CAPTIONS)
    worst = result.expectation.worst_percent
    scores = Table(
        caption="RMS error, % of reference range. First column: worst case over the uncertainty; the others: the "
        "design's own parameters; * design level, used in the last column too",
        columns=(
            "profile",
            f"worst, {result.expectation.doubt.widths}",
            *(f"{level}*" if level is result.level else level.value for level in Level),
            f"{FINE_SEGMENTS} masses, step/{FINE_REFINEMENT}",
        ),
        rows=tuple(
            (
                c.label,
                worst.get(c.name),
                *(result.on_level(c.name, level).score.rmse_percent_of_range for level in Level),
                result.on_proof(c.name).score.rmse_percent_of_range,
            )
            for c in result.compensators
        ),
        least=1e-3,
    )
    peaks = Table(
        caption="Largest error [N], the design's own parameters",
        columns=("profile", *(level.value for level in Level)),
        rows=tuple(
            (c.label, *(result.on_level(c.name, level).score.peak_error_N for level in Level))
            for c in result.compensators
        ),
        least=1e-3,
    )
    return Report(
        title=f"Design: {result.scenario.name}",
        summary=headline(result),
        fine_print=fine_print(result),
        warnings=result.warnings,
        sections=(
            Section(title="What to expect", blocks=(pictures["expectation"], scores)),
            Section(title="Output tension", blocks=(pictures["tension"], peaks)),
            Section(title="Actuator force", blocks=(pictures["force"], *_solver(result))),
            Section(title="Hysteresis", blocks=(pictures["loop"],)),
            Section(title="Sensitivity to model fidelity", blocks=(pictures["error"],)),
            *_robust_section(result),
        ),
        provenance=provenance_of(result.scenario, "design"),
        files=(
            FileNote(name="profile.csv", content="reference and the force of every compensator over time"),
            FileNote(name="summary.json", content="errors, solver status and warnings for other programs"),
        ),
    )


def _solver(result: DesignData) -> tuple[Block, ...]:
    """How the optimal-control problem ended; nothing where none was solved."""
    tracking = result.tracking
    if tracking is None:
        return ()
    table = Table(
        caption="Optimal control",
        columns=("status", "iterations", "build [s]", "solve [s]"),
        rows=((tracking.status.value, tracking.iterations, tracking.build_s, tracking.solve_s),),
    )
    return Text(tracking.message), table


def _robust_section(result: DesignData) -> tuple[Section, ...]:
    """What the scenario's uncertainty does to each profile; nothing where all is certain."""
    found = result.robustness
    if found is None:
        return ()
    span, labels = result.reference.range_N, {c.name: c.label for c in result.compensators}
    rows: tuple[tuple[Cell, ...], ...] = tuple(
        (
            labels[name],
            *(
                100 * value / span
                for value in (band.nominal_rms_N, band.least_rms_N, band.median_rms_N, band.worst_rms_N)
            ),
            100 * band.amplification,
            100 * (band.worst_sample.mu - 1),
        )
        for name, band in found.bands.items()
    )
    table = Table(
        caption=f"RMS error over {len(found.samples)} samples of the parameters, % of reference range; "
        "over-compensation: largest swing of the output beyond the reference's, %; mu of the worst sample beside the "
        "nominal one, %",
        columns=("profile", "nominal", "least", "median", "worst", "over-compensation", "mu at worst"),
        rows=rows,
    )
    note = Text(
        f"The optimal profile minimises the {found.objective.value} error over the samples. Inside a feedback loop "
        "over-compensation injects energy: choose mu too low rather than too high."
    )
    return (Section(title="Robustness to parameter uncertainty", blocks=(table, note)),)
