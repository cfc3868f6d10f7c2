"""The report of the self-tuning study."""

from matplotlib.figure import Figure

from tendonff.compensator.reporting.page import (
    Cell,
    FileNote,
    Picture,
    Report,
    Section,
    Table,
    Text,
    pictures_of,
    provenance_of,
)
from tendonff.compensator.studies.adapt.result import SETTLED_S, Case, Scheme, TensionStudy
from tendonff.ocp.adaptation.bounds import CertifiedInterval

_CAPTIONS = {
    "overview": "Each row is a plant that differs from the scenario as its name says; sensor noise as in the scenario.",
    "friction": "Above: error. Below: the estimate that the controller uses.",
    "drift": "Friction that drifts: the estimate follows, the plain inverse does not.",
    "information": "Standard deviation of each parameter along the reference, by the information matrix.",
    "bounds": "The output tension lies in the band, if mu theta of each direction is within what is stated.",
}


def adaptation_report(result: TensionStudy, figures: dict[str, Figure]) -> Report:
    """The page of the study, with the figures of `adaptation_figures`."""
    pictures = pictures_of(figures, _CAPTIONS)
    interval, known = result.interval, result.information
    feedback = (
        result.certificate.sentence()
        if result.certificate is not None
        else "Integral action needs a measured output tension; with the actuator's position there is none."
    )
    return Report(
        title=f"Self-tuning: {result.scenario.name}",
        summary=result.headline,
        warnings=result.warnings,
        sections=(
            Section(
                title="Plants that differ",
                blocks=(
                    Text(
                        "The compensator has the scenario's parameters; the plant differs from them, has 40 masses "
                        "and sensor noise. Feedforward alone is the exact inverse. Self-tuning runs the same model "
                        "beside the rig with the applied force and corrects the parameters from the measurement."
                    ),
                    pictures["overview"],
                    _errors(result),
                ),
            ),
            Section(title="Error and estimate over time", blocks=(pictures["friction"], pictures["drift"])),
            Section(
                title="What the reference can identify",
                blocks=(pictures["information"], *(Text(_sentence(text)) for text in known.sentences())),
            ),
            Section(title="Integral action", blocks=(Text(_sentence(feedback)),)),
            *([] if interval is None else [_interval(interval, pictures["bounds"])]),
        ),
        provenance=provenance_of(result.scenario, "adapt"),
        files=(
            FileNote(name="estimate.csv", content="reference, tensions and estimates of every plant over time"),
            FileNote(name="summary.json", content="everything on this page for other programs"),
        ),
    )


def _interval(interval: CertifiedInterval, picture: Picture) -> Section:
    return Section(
        title="Certified interval",
        blocks=(
            picture,
            Text(
                "Two plays bound the output tension with mu theta of each direction within "
                f"{100 * interval.spread:.0f} % either way. Stretch, presliding and inertia, which the capstan law "
                f"leaves out, take a margin of {100 * interval.margin:.2g} % of T + p: the largest that plants of 40 "
                "masses need on this reference, at every corner of that range, with tendon, load and bristles as the "
                "scenario, softer and stiffer."
            ),
        ),
    )


def _sentence(text: str) -> str:
    return f"{text[:1].upper()}{text[1:].removesuffix('.')}."


def _errors(result: TensionStudy) -> Table:
    schemes = [scheme for scheme in Scheme if scheme in result.cases[0].traces]
    return Table(
        caption=f"RMS error after {SETTLED_S:g} s, % of reference range. Time to 1 %: a dash where it is never reached",
        columns=("plant", *(scheme.replace("_", " ") for scheme in schemes), "time to 1 % [s]", "status"),
        rows=[_row(case, schemes) for case in result.cases],
    )


def _row(case: Case, schemes: list[Scheme]) -> tuple[Cell, ...]:
    tuned = case.traces[Scheme.SELF_TUNING]
    after = tuned.time_to_one_percent_s
    frozen = "" if tuned.frozen_after_s is None else f"frozen after {tuned.frozen_after_s:.2f} s"
    status = "; ".join(text for text in ("not here" if case.is_limit else "", frozen) if text) or "good"
    errors = (case.traces[scheme].settled_percent for scheme in schemes)
    return (case.variation.name, *errors, after, status)
