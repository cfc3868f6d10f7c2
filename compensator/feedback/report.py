"""Section of a report about the feedback."""

from collections.abc import Mapping

from tendonff.compensator.feedback.result import FeedbackResult
from tendonff.compensator.reporting.page import Picture, Section, Table, Text

CAPTIONS = {
    "feedback_loop": "Gain and phase of the open loop. The band holds all linearisations, sliding and sticking, over "
    "the uncertainty; margins are those of the worst.",
    "feedback_error": "Errors, each on the mechanism where it is worst. Feedback alone has the same gains, a plain "
    "integral, and no friction model.",
}
_LABELS = {"feedforward": "feedforward alone", "feedback": "feedback alone", "both": "both"}


def feedback_section(result: FeedbackResult, pictures: Mapping[str, Picture]) -> Section:
    """The section: sentence, figures, tables."""
    unit, factor = result.unit.shown, result.unit.factor
    errors = Table(
        caption=f"Errors over the uncertainty ({result.doubt}) [{unit}]",
        columns=("", "RMS, nominal", "RMS, worst", "peak, worst"),
        rows=[
            (_LABELS[name], factor * float(case.rms[0].max()), factor * case.worst_rms, factor * case.worst_peak)
            for name, case in result.cases.items()
        ],
        one_quantity=True,
    )
    laws, margins = result.design.laws, result.design.margins
    gains = Table(
        caption=f"Gains [{result.command_unit} per {result.seen_unit}], clamp [{result.command_unit}], and the least "
        "margins over all linearisations",
        columns=("", "Kp", "Ki [1/s]", "clamp", "filter [ms]", "gain margin", "phase margin [deg]"),
        rows=[
            (name, law.proportional, law.integral_per_s, law.clamp, 1e3 * law.filter_s, margin.gain, margin.phase_deg)
            for name, law, margin in zip(result.names, laws, margins, strict=True)
        ],
    )
    cycles = Table(
        caption="Limit cycles: reference at a stop, friction and delay off by these factors",
        columns=("friction", "delay", f"peak to peak [{unit}]", "hunts"),
        rows=[(c.friction, c.delay, factor * c.swing, c.hunts) for c in result.cycles],
    )
    note = "The measurement is compared with the reference as old as itself."
    if any(law.streamed for law in laws):
        note += " The loop works on logarithms: a correction of 0.1 is 11 % more force at every tension."
    if any(law.error_scale for law in laws):
        note += " What friction, loads and stiffness leave is learned along strokes, and turns with the reference."
    if laws[0].learns_age:
        note += " The age of the measurement is learned on the way, up to twice the stated delay."
    return Section(
        title="Feedback beside the feedforward",
        blocks=(
            Text(result.sentence),
            pictures["feedback_error"],
            errors,
            pictures["feedback_loop"],
            gains,
            Text(note),
            cycles,
        ),
    )
