"""The files of a design: profile, summary, figures and report; and its scores on the terminal."""

import math
import os
from dataclasses import asdict
from pathlib import Path

import numpy as np
from rich.box import HEAVY_HEAD, SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

from tendonff.compensator.compensators.expectation import two_digits
from tendonff.compensator.compensators.plant import FINE_REFINEMENT, FINE_SEGMENTS
from tendonff.compensator.compensators.profile import FloatArray
from tendonff.compensator.compensators.score import Verified
from tendonff.compensator.files.typeset import typeset
from tendonff.compensator.files.writing import atomic_directory, write_csv
from tendonff.compensator.reporting.expected import expectation_summary
from tendonff.compensator.reporting.page import summary_head, write_pages
from tendonff.compensator.scenario.sampled.joint_motion import sample_joints
from tendonff.compensator.studies.design.drive_use import drive_columns, drive_summary
from tendonff.compensator.studies.design.figures import design_figures
from tendonff.compensator.studies.design.report import design_report, interactive_panels
from tendonff.compensator.studies.design.result import Design
from tendonff.models.fidelity import Level
from tendonff.ocp.tracking.result import Tracking

_ROOM = 90  # columns of a terminal that hold the table of scores with its frame


def write_files(
    result: Design, folder: str | os.PathLike[str], *, interactive: bool = False, pdf: bool = False
) -> None:
    """Write the files of `Design.write`."""
    figures = design_figures(result)
    view = interactive_panels(result) if interactive else None
    with atomic_directory(folder) as partial:
        write_csv(partial / "profile.csv", profile_columns(result))
        write_pages(partial, summary(result), figures, design_report(result, figures, view), pdf=pdf)


def profile_columns(result: Design) -> dict[str, FloatArray]:
    """The columns of `profile.csv`."""
    forces = {f"force_{name}_N": force for name, force in result.forces_N.items()}
    time = result.reference.time_s
    motion = sample_joints(result.scenario, float(time[-1]))
    joints = {}
    if motion is not None:
        joints = {f"joint_{name}_rad": q for name, q in zip(motion.names, motion.at(time).T, strict=True)}
    return {
        "time_s": result.reference.time_s,
        "reference_N": result.reference.tension_N,
        **({} if result.reference.position_m is None else {"reference_m": result.reference.position_m}),
        **forces,
        **drive_columns(result),
        **joints,
    }


def summary(result: Design) -> dict[str, object]:
    """The contents of `summary.json`."""
    unit = result.reference.unit

    def scores(verified: tuple[Verified, ...]) -> dict[str, dict[str, dict[str, float]]]:
        found: dict[str, dict[str, dict[str, float]]] = {}
        for one in verified:
            found.setdefault(one.compensator, {})[one.plant.level.value] = one.score.named(unit)
        return found

    error = result.stick_slip.expected_error_N
    return {
        **summary_head(result.scenario),
        "design_level": result.level.value,
        f"reference_range_{unit.key}": float(np.ptp(result.reference.wanted)),
        "compensators": scores(result.verified),
        "proof": {
            "segments": FINE_SEGMENTS,
            "step_s": result.reference.step_s / FINE_REFINEMENT,
            "compensators": scores(result.proof),
        },
        "drive": drive_summary(result),
        "ocp": None if result.tracking is None else _tracking_summary(result.tracking),
        "expectation": expectation_summary(result.expectation, FINE_SEGMENTS),
        "foresight": {
            "unstable_share": result.stick_slip.unstable_share,
            # Beside poles of 1e5/s, what is below a millionth is rounding.
            "largest_growth_per_s": round(result.stick_slip.largest_growth_per_s, 6),
            "expected_error_N": error if math.isfinite(error) else None,
            "stretches": [asdict(stretch) for stretch in result.stick_slip.stretches],
        },
        **({} if result.ignored is None else {"ignored_motion": result.ignored.named(unit)}),
        "warnings": list(result.warnings),
    }


def _tracking_summary(tracking: Tracking) -> dict[str, object]:
    return {
        "status": tracking.status.value,
        "message": tracking.message,
        "reasons": list(tracking.reasons),
        "departures": [asdict(departure) for departure in tracking.departures],
        "iterations": tracking.iterations,
        "build_s": tracking.build_s,
        "solve_s": tracking.solve_s,
    }


def print_scores(result: Design, folder: Path) -> None:
    """Print the error of each compensator on each level, what to expect on a rig, and where the files are."""
    console = Console()
    table = Table(
        box=HEAVY_HEAD if console.width >= _ROOM else SIMPLE_HEAD,
        pad_edge=console.width >= _ROOM,
        collapse_padding=console.width < _ROOM,
        title=f"{result.scenario.name}: RMS error, % of range of the {result.reference.name}",
        title_justify="left",
    )
    table.add_column("compensator")
    table.add_column("worst case", justify="right")
    for level in Level:
        table.add_column(f"{level}*" if level is result.level else level.value, justify="right")
    table.add_column(f"{FINE_SEGMENTS} masses, step/{FINE_REFINEMENT}", justify="right")
    for compensator in result.compensators:
        name = compensator.name
        worst = result.expectation.worst_percent.get(name, math.inf)
        table.add_row(name, two_digits(worst), *[score.percent for score in result.scores(name)])
    console.print(table)
    unit = result.reference.unit
    span = f"range {unit.factor * np.ptp(result.reference.wanted):.4g} {unit.shown}"
    over = f"worst case: over {result.expectation.doubt}, on {FINE_SEGMENTS} masses; {span}"
    console.print(over, soft_wrap=True, markup=False, highlight=False)
    console.print("* design level, used for the worst case and the last column too")
    console.print(typeset(result.headline), soft_wrap=True, markup=False, highlight=False)
    if result.tracking is not None:
        console.print(typeset(f"optimal control: {result.tracking.message}"), soft_wrap=True)
    console.print(f"written to {folder}", soft_wrap=True)
