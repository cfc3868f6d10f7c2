"""The report of a design: what to expect of each profile, in one page."""

import math

import numpy as np
from matplotlib.figure import Figure

from tendonff.compensator.compensators.expectation import two_digits
from tendonff.compensator.compensators.expected import CONTRIBUTIONS, robustness_table
from tendonff.compensator.compensators.plant import FINE_REFINEMENT, FINE_SEGMENTS
from tendonff.compensator.feedback.report import CAPTIONS as FEEDBACK_CAPTIONS
from tendonff.compensator.reporting.colours import INK, Style
from tendonff.compensator.reporting.interactive import zoomed
from tendonff.compensator.reporting.page import (
    Block,
    Cell,
    Interactive,
    Picture,
    Report,
    Section,
    Table,
    Text,
    format_cell,
    pictures_of,
)
from tendonff.compensator.scenario.reference import Hold
from tendonff.compensator.studies.design.drive_use import drive_use
from tendonff.compensator.studies.design.online import Online
from tendonff.compensator.studies.design.page import design_page
from tendonff.compensator.studies.design.result import Design
from tendonff.models.fidelity import Level
from tendonff.models.parameters.drive import Motor
from tendonff.ocp.reference.hold import find_holds

_MOVES_IN_A_HOLD = 0.05  # of the force's range: what is worth a word

_CAPTIONS = {
    "expectation": "Output of the recommended profile over all sampled parameters (band), and of the reference "
    "applied directly with nominal ones. Below: the error; a curve that leaves the panel is larger.",
    "contributions": CONTRIBUTIONS,
    "tension": "Reference and output of each profile with the design's own parameters. Below: the "
    "compensated errors, enlarged; a curve that leaves the panel is larger.",
    "force": "Actuator force, its rate of change, and the travel of the actuator's end. Dashed: limits of the "
    "actuator; those off the scale are written.",
    "loop": "Left: the tendon's hysteresis, output over force. Right: output over reference; perfect compensation is "
    "the diagonal. Equal scales on both axes.",
    "error": "Error on each model level with the design's own parameters, on one scale; right: enlarged.",
    "online": "Filters of a reference that arrives live: error over noise in the force, a point for each length. "
    "Below, where the rate limit binds: error over the preview.",
    "drive": "Demands on the drive, on the design level. Dashed: its limits; those off the scale are written.",
}


def ways(result: Design) -> str:
    """Ways to the controller, and the error of each."""
    name = result.recommended.name
    profile, unit = result.profiles[name], "m" if result.is_position_drive else "N"
    column = "force" if profile.command_m is None and profile.command_N is None else "command"
    return (
        f"Reference known in advance: run {column}_{name}_{unit} of profile.csv, error up to "
        f"{result.expectation.error}. "
        f"Known only at run time: tendonff export-c, the exact inverse, error up to {result.live.error}."
    )


def fine_print(result: Design) -> str:
    """Numerical and model-internal results."""
    best = result.recommended
    own = (
        f"With exactly the design's parameters the RMS error is {result.on_proof(best.name).score.percent} % "
        f"({best.label}, {FINE_SEGMENTS} masses, step/{FINE_REFINEMENT})"
    )
    if not result.expectation.doubt.is_assumed and best.name == "optimal" and "inverse" in result.profiles:
        return (
            f"{own}, against {result.on_proof('inverse').score.percent} % of the exact inverse: what the robust "
            "profile gives up there for a smaller worst case."
        )
    return f"{own}. That is the accuracy of the computation; on a rig the uncertainty of the parameters decides."


def interactive_panels(result: Design) -> Interactive:
    """Output, force and error of all profiles, to be zoomed."""
    reference = result.reference
    factor, shown = reference.unit.factor, reference.unit.shown
    output, force, error = {"reference": (factor * reference.wanted, Style(color=INK, linestyle="-"))}, {}, {}
    for c in result.compensators:
        delivered = result.on_proof(c.name).delivered
        output[c.label] = (factor * delivered, c.style)
        force[c.label] = (result.profiles[c.name].force_N, c.style)
        error[c.label] = (factor * (delivered - reference.wanted), c.style)
    panels = {f"{reference.output} [{shown}]": output, "actuator force [N]": force, f"error [{shown}]": error}
    return zoomed(reference.time_s, panels, f"{FINE_SEGMENTS} masses, the design's own parameters.")


def design_report(result: Design, figures: dict[str, Figure], view: Interactive | None = None) -> Report:
    """The page of a design."""
    joints = "" if result.ignored is None else " Bottom: the joint angles."
    ignored = () if result.ignored is None else (Text(result.ignored.text),)
    pictures = pictures_of(figures, {**_CAPTIONS, **FEEDBACK_CAPTIONS, "tension": _CAPTIONS["tension"] + joints})
    worst, unit = result.expectation.worst_percent, result.reference.unit
    scores = Table(
        caption=f"RMS error, % of reference range. Worst case: over {result.expectation.doubt}, on {FINE_SEGMENTS} "
        "masses; the other columns: the design's own parameters; * design level, used for the first and last column",
        columns=(
            "profile",
            "worst case",
            *(f"{level}*" if level is result.level else level.value for level in Level),
            f"{FINE_SEGMENTS} masses, step/{FINE_REFINEMENT}",
        ),
        rows=[
            (
                c.label,
                two_digits(worst.get(c.name, math.inf)),
                *(score.rmse_percent_of_range for score in result.scores(c.name)),
            )
            for c in result.compensators
        ],
        least=1e-3,
        one_quantity=True,
    )
    peaks = Table(
        caption=f"Largest error [{unit.shown}], the design's own parameters",
        columns=("profile", *(level.value for level in Level)),
        rows=[
            (c.label, *(unit.factor * score.peak_error for score in result.scores(c.name)[:-1]))
            for c in result.compensators
        ],
        least=1e-3,
        one_quantity=True,
    )
    return design_page(
        result,
        pictures,
        view,
        first=Section(
            title="What to expect", blocks=(pictures["expectation"], scores, pictures["contributions"], *ignored)
        ),
        robustness=_robustness(result),
        own=(
            Section(title=result.reference.output.capitalize(), blocks=(pictures["tension"], peaks)),
            Section(title="Actuator force", blocks=(pictures["force"], *_holds(result), *_solver(result))),
            Section(title="Sizing the drive", blocks=(pictures["drive"], *_drive(result))),
            Section(title="Hysteresis", blocks=(pictures["loop"],)),
            Section(title="Sensitivity to the model level", blocks=(pictures["error"],)),
            *([] if result.online is None else [_live(result.online, pictures["online"])]),
        ),
        fine_print=f"{ways(result)} {fine_print(result)}",
        files=(
            "reference and the force of every compensator over time, travel, command and motor",
            "errors, solver status and warnings for other programs",
        ),
    )


def _live(found: Online, picture: Picture) -> Section:
    """Filters of a live reference; the one that is picked is what `export-c` builds in."""
    sentence = found.sentence[:1].upper() + found.sentence[1:]
    return Section(title="Live reference", blocks=(Text(f"{sentence}."), picture))


def _holds(result: Design) -> tuple[Block, ...]:
    """Why the force of the exact inverse changes while the reference rests."""
    reference, profile = result.reference, result.profiles.get("inverse")
    if profile is None or reference.hold is Hold.KEEP or reference.periodic or result.ignored is not None:
        return ()  # in a cycle and on a path that moves the force has a reason to move
    force, found = profile.force_N, []
    for first, last in find_holds(reference.tension_N, reference.step_s):
        change = float(np.ptp(force[first : last + 1]))
        if change > _MOVES_IN_A_HOLD * float(np.ptp(force)):
            found.append(f"from {reference.time_s[first]:.4g} to {reference.time_s[last]:.4g} s by {change:.3g} N")
    if not found:
        return ()
    note = (
        f"While the reference rests, the force of the exact inverse still moves: {'; '.join(found)}. At the end of a "
        "move the load's inertia and the damping turn the sliding round for some milliseconds, friction changes sign, "
        "and the force crosses the deadband although the output hardly moves. Inside the deadband nothing need "
        'move: hold = "keep" in [reference] keeps the force, and the report states what that costs.'
    )
    return (Text(note),)


def _drive(result: Design) -> tuple[Block, ...]:
    """Stroke, speed, force, power and the motor's torque beside their limits."""
    actuator = result.scenario.transmission.actuator
    motor, used = actuator.motor, drive_use(result)
    labels = {c.name: c.label for c in result.compensators}
    if not used:
        return (Text("Travel, speed and power are those of the exact inverse, which is not among the compensators."),)
    rows: list[tuple[Cell, ...]] = []
    asked: dict[str, float] = {}

    def row(what: str, values: list[float], limit: float | None) -> None:
        if limit and values:
            asked[what.partition(" [")[0]] = max(values) / limit
        share = None if not limit or not values else f"{100 * max(values) / limit:.3g} %"
        # Each row has its own unit, so its own decimals.
        rows.append((what, *(format_cell(value) for value in values), None if limit is None else f"{limit:.5g}", share))

    speeds = [float(np.max(np.abs(use.speed_m_per_s))) for use in used]
    lower, upper = actuator.travel_min_m, actuator.travel_max_m
    row("stroke [m]", [use.stroke_m for use in used], None if lower is None or upper is None else upper - lower)
    row("peak speed [m/s]", speeds, actuator.speed_max_m_per_s)
    row("peak force [N]", [float(np.max(use.force_N)) for use in used], actuator.force_max_N)
    row("RMS force [N]", [use.force_rms_N for use in used], None)
    row("peak power [W]", [float(np.max(use.power_W)) for use in used], None)
    if motor is not None:
        per_rad = motor.travel_per_rad_m
        row("motor: peak torque [N m]", [float(np.max(use.force_N)) * per_rad for use in used], motor.torque_max_N_m)
        row("motor: RMS torque [N m]", [use.force_rms_N * per_rad for use in used], motor.torque_rated_N_m)
        row("motor: peak speed [rad/s]", [speed / per_rad for speed in speeds], motor.speed_max_rad_per_s)
        row("motor: revolutions", [use.stroke_m / per_rad / (2 * np.pi) for use in used], None)
        if motor.stall_torque_N_m is not None:
            row("motor: share of the torque-speed line", [use.load_of_the_line(motor) for use in used], 1.0)
    columns = ("quantity", *(labels[use.name] for use in used), "limit", "used")
    table = Table(caption="Demands on the drive", columns=columns, rows=tuple(rows))
    return Text(_verdict(asked, motor)), table


def _verdict(asked: dict[str, float], motor: Motor | None) -> str:
    """Whether the drive suffices, by the shares of its limits that the profiles ask for."""
    beyond = [f"{what} at {100 * share:.3g} % of its limit" for what, share in asked.items() if share > _BEYOND]
    if beyond:
        text = f"The drive is too small for these profiles: {'; '.join(beyond)}."
    else:
        what, share = max(asked.items(), key=lambda pair: pair[1])
        text = f"The drive suffices for these profiles; smallest margin: {what}, {100 * share:.3g} % of its limit."
    if motor is None:
        return text + " [actuator.motor] with drum, gear and the motor's data sheet sizes the motor too."
    missing = [] if motor.torque_rated_N_m is not None else ["torque_rated_N_m (continuous torque)"]
    missing += [] if motor.stall_torque_N_m is not None else ["the torque-speed line (stall_torque_N_m)"]
    return text if not missing else f"{text} Not judged, since not given: {' and '.join(missing)}."


_BEYOND = 1.005  # of a limit: rounding


def _solver(result: Design) -> tuple[Block, ...]:
    """Outcome of the optimal-control problem; nothing where none was solved."""
    tracking = result.tracking
    if tracking is None:
        return ()
    table = Table(
        caption="Optimal control",
        columns=("status", "iterations", "solve [s]"),
        rows=((tracking.status.value, tracking.iterations, tracking.solve_s),),
    )
    return Text(f"{tracking.message[:1].upper()}{tracking.message[1:]}."), table


def _robustness(result: Design) -> tuple[Block, ...]:
    """Effect of uncertainty on each profile, and its largest contribution."""
    found, labels = result.expectation, {c.name: c.label for c in result.compensators}
    note = Text(
        "Inside a feedback loop over-compensation injects energy: choose mu too low rather than too high."
        if found.doubt.is_assumed
        else f"The optimal profile minimises the {result.scenario.robust.objective.value} error. Inside a feedback "
        "loop over-compensation injects energy: choose mu too low rather than too high."
    )
    return robustness_table(found, labels, FINE_SEGMENTS), note
