"""The files of a design: profile, summary, figures and report; and its scores on the terminal."""

import math
import os
from dataclasses import asdict
from pathlib import Path

import numpy as np

from tendonff.compensator.compensators.expectation import two_digits
from tendonff.compensator.compensators.expected import expectation_summary
from tendonff.compensator.compensators.plant import FINE_REFINEMENT, FINE_SEGMENTS
from tendonff.compensator.compensators.profile import FloatArray
from tendonff.compensator.compensators.score import Verified
from tendonff.compensator.feedback.result import feedback_summary
from tendonff.compensator.files.writing import atomic_directory, write_csv
from tendonff.compensator.reporting.page import summary_head, write_pages
from tendonff.compensator.reporting.results import Views
from tendonff.compensator.reporting.terminal import print_scores
from tendonff.compensator.scenario.sampled.joint_motion import sample_joints
from tendonff.compensator.studies.design.drive_use import drive_columns, drive_summary
from tendonff.compensator.studies.design.figures import design_figures
from tendonff.compensator.studies.design.report import design_report, interactive_panels, ways
from tendonff.compensator.studies.design.result import Design
from tendonff.models.fidelity import Level
from tendonff.ocp.tracking.result import Tracking


def write_files(
    result: Design, folder: str | os.PathLike[str], *, interactive: bool = False, pdf: bool = False
) -> None:
    """Write the files of `Design.write`."""
    figures = design_figures(result)
    view = interactive_panels(result) if interactive else None
    with atomic_directory(folder) as partial:
        write_csv(partial / "profile.csv", profile_columns(result))
        if result.online is not None:
            write_csv(partial / "online.csv", result.online.columns)
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
        "live": {
            f"rmse_{unit.key}": _finite(result.live.best.worst.rmse),
            "rmse_percent_of_range": _finite(result.live.best.worst.rmse_percent_of_range),
            f"peak_{unit.key}": _finite(result.live.best.worst_peak),
        },
        "foresight": {
            "unstable_share": result.stick_slip.unstable_share,
            # Beside poles of 1e5/s, what is below a millionth is rounding.
            "largest_growth_per_s": round(result.stick_slip.largest_growth_per_s, 6),
            "expected_error_N": error if math.isfinite(error) else None,
            "stretches": [asdict(stretch) for stretch in result.stick_slip.stretches],
        },
        **({} if result.feedback is None else {"feedback": feedback_summary(result.feedback)}),
        **({} if result.ignored is None else {"ignored_motion": result.ignored.named(unit)}),
        "warnings": list(result.warnings),
    }


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


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


def show(result: Design, folder: Path) -> None:
    """Print the error of each compensator on each level, what to expect on a rig, and where the files are."""
    unit, finest = result.reference.unit, f"{FINE_SEGMENTS} masses"
    span = f"range {unit.factor * np.ptp(result.reference.wanted):.4g} {unit.shown}"
    worst = result.expectation.worst_percent
    print_scores(
        f"{result.scenario.name}: RMS error, % of range of the {result.reference.name}",
        (
            *("compensator", "worst case"),
            *(f"{level}*" if level is result.level else level.value for level in Level),
            f"{finest}, step/{FINE_REFINEMENT}",
        ),
        [
            (c.name, two_digits(worst.get(c.name, math.inf)), *(score.percent for score in result.scores(c.name)))
            for c in result.compensators
        ],
        (
            f"worst case: over {result.expectation.doubt}, on {finest}; {span}",
            "* design level, used for the worst case and the last column too",
            result.headline,
            ways(result),
            *(() if result.feedback is None else (result.feedback.sentence,)),
            *(() if result.online is None else (result.online.sentence,)),
            *(() if result.tracking is None else (f"optimal control: {result.tracking.message}",)),
            f"written to {folder}",
        ),
    )


VIEWS = Views(write=write_files, columns=profile_columns, figures=design_figures, show=show)
