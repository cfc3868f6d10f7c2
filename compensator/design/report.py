"""The report of a design: what each profile delivers, in one page."""

import numpy as np
from matplotlib.figure import Figure

from tendonff.compensator.design.drive_use import drive_use
from tendonff.compensator.design.result import FINE_REFINEMENT, FINE_SEGMENTS, DesignData
from tendonff.compensator.reporting.page import (
    Block,
    Cell,
    FileNote,
    Report,
    Section,
    Table,
    Text,
    pictures_of,
    provenance_of,
)
from tendonff.compensator.scenario.reference import Hold
from tendonff.models.fidelity import Level
from tendonff.ocp.hold import find_holds

_MOVES_IN_A_HOLD = 0.05  # of the force's range: what is worth a word

_CAPTIONS = {
    "tension": "Wanted tension and what each profile delivers, on the design level.",
    "force": "The force that the actuator applies for it.",
    "drive": "What the profiles ask of the drive, on the design level; thin lines are its limits.",
    "loop": "Left: the tendon's hysteresis, output over force. Right: output over wanted tension; a perfect "
    "compensation is the diagonal.",
    "error": "Error on each fidelity level: how much the answer depends on the model it was designed with.",
}


def headline(result: DesignData) -> str:
    """The answer in two sentences.

    Parameters
    ----------
    result : DesignData
    """
    level = result.level
    best = min((c for c in result.compensators if c.name != "none"), key=lambda c: result.on_proof(c.name).score.rmse_N)
    return (
        f"Without compensation {result.on_level('none', level).score.percent} % of the range of "
        f"{result.reference.range_N:.4g} N is lost (rms, {level} level). The best profile here, {best.label}, leaves "
        f"{result.on_proof(best.name).score.percent} % on a finer chain of {FINE_SEGMENTS} masses at a "
        f"{FINE_REFINEMENT}th of the step."
    )


def design_report(result: DesignData, figures: dict[str, Figure]) -> Report:
    """The page of a design.

    Parameters
    ----------
    result : DesignData
    figures : dict of str to Figure
        From `design_figures`.
    """
    pictures = pictures_of(figures, _CAPTIONS)
    scores = Table(
        caption="Error, % of range rms; * design level, also of the last column",
        columns=(
            "profile",
            *(f"{level}*" if level is result.level else level.value for level in Level),
            f"{FINE_SEGMENTS} masses, step/{FINE_REFINEMENT}",
        ),
        rows=tuple(
            (
                c.label,
                *(result.on_level(c.name, level).score.percent for level in Level),
                result.on_proof(c.name).score.percent,
            )
            for c in result.compensators
        ),
    )
    peaks = Table(
        caption="Largest error [N]",
        columns=("profile", *(level.value for level in Level)),
        rows=tuple(
            (c.label, *(result.on_level(c.name, level).score.peak_error_N for level in Level))
            for c in result.compensators
        ),
    )
    return Report(
        title=f"Design: {result.scenario.name}",
        summary=headline(result),
        warnings=result.warnings,
        sections=(
            Section(title="What arrives", blocks=(pictures["tension"], scores, peaks, *_positions(result))),
            Section(title="What the actuator does", blocks=(pictures["force"], *_holds(result), *_solver(result))),
            Section(title="Sizing the drive", blocks=(pictures["drive"], *_drive(result))),
            Section(title="Hysteresis", blocks=(pictures["loop"],)),
            Section(title="How much the model matters", blocks=(pictures["error"],)),
            *_robust_section(result),
        ),
        provenance=provenance_of(result.scenario, "design"),
        files=(
            FileNote(
                name="profile.csv",
                content="reference and the force of every compensator over time, travel, command and motor",
            ),
            FileNote(name="summary.json", content="errors, solver status and warnings for other programs"),
        ),
    )


def _holds(result: DesignData) -> tuple[Block, ...]:
    """Why the force of the exact inverse changes while the reference rests."""
    reference, profile = result.reference, result.profiles.get("inverse")
    if profile is None or reference.hold is Hold.KEEP:
        return ()
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
        "and the force crosses the dead zone although the output hardly moves. Inside the dead zone nothing need "
        'move: hold = "keep" in [reference] keeps the force, and says what that costs.'
    )
    return (Text(note),)


def _positions(result: DesignData) -> tuple[Block, ...]:
    """Errors of the load's position, where that is wanted."""
    if result.reference.position_m is None:
        return ()
    span = float(np.ptp(result.reference.position_m))
    rows = []
    for c in result.compensators:
        own, fine = (v.position_error_m for v in (result.on_level(c.name, result.level), result.on_proof(c.name)))
        if own is not None and fine is not None:
            share = f"{100 * fine[0] / span:.3g}" if span > 0 else ""
            rows.append((c.label, own[0], own[1], fine[0], fine[1], share))
    table = Table(
        caption="Error of the load's position: design level, and finer chain",
        columns=("profile", "rms [m]", "largest [m]", "rms, finer [m]", "largest, finer [m]", "% of range, finer"),
        rows=tuple(rows),
    )
    return (table,)


def _drive(result: DesignData) -> tuple[Block, ...]:
    """Stroke, speed, force, power and the motor's torque beside their limits."""
    actuator = result.scenario.transmission.actuator
    motor, used = actuator.motor, drive_use(result)
    labels = {c.name: c.label for c in result.compensators}
    rows: list[tuple[Cell, ...]] = []

    def row(what: str, values: list[float], limit: float | None) -> None:
        share = "" if not limit or not values else f"{100 * max(values) / limit:.3g} %"
        rows.append((what, *values, "" if limit is None else limit, share))

    speeds = [float(np.max(np.abs(use.speed_m_per_s))) for use in used]
    lower, upper = actuator.travel_min_m, actuator.travel_max_m
    row("stroke [m]", [use.stroke_m for use in used], None if lower is None or upper is None else upper - lower)
    row("peak speed [m/s]", speeds, actuator.speed_max_m_per_s)
    row("peak force [N]", [float(np.max(use.force_N)) for use in used], actuator.force_max_N)
    row("rms force [N]", [use.force_rms_N for use in used], None)
    row("peak power [W]", [float(np.max(use.power_W)) for use in used], None)
    if motor is not None:
        per_rad = motor.travel_per_rad_m
        row("motor: peak torque [N m]", [float(np.max(use.force_N)) * per_rad for use in used], motor.torque_max_N_m)
        row("motor: rms torque [N m]", [use.force_rms_N * per_rad for use in used], motor.torque_rated_N_m)
        row("motor: peak speed [rad/s]", [speed / per_rad for speed in speeds], motor.speed_max_rad_per_s)
        row("motor: way [turns]", [use.stroke_m / per_rad / (2 * np.pi) for use in used], None)
        if motor.stall_torque_N_m is not None:
            row("motor: share of the torque-speed line", [use.load_of_the_line(motor) for use in used], 1.0)
    columns = ("quantity", *(labels[use.name] for use in used), "limit", "used")
    return (Table(caption="What the drive must do", columns=columns, rows=tuple(rows)),)


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
            f"{100 * band.amplification:+.2g}",
            f"{100 * (band.worst_sample.mu - 1):+.3g}",
        )
        for name, band in found.bands.items()
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
