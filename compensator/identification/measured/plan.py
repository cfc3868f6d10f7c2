"""What a fit will have to do, said before any of it is done."""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from tendonff.compensator.files.reading import InputError
from tendonff.compensator.identification.measured.reading import RawMeasurement
from tendonff.compensator.scenario.measurement import Measurement
from tendonff.compensator.scenario.scenario import Scenario

LONGEST_STEP_S = 1e-3
"""The chain takes no longer steps."""

MANY_STEPS = 1_000_000
"""So many steps for one simulation of all files take minutes a fit; a fit simulates them some hundred times."""

SLOW_S = 0.05
"""A clock with longer intervals may count milliseconds."""


def check_plan(
    files: Sequence[RawMeasurement],
    how: Measurement,
    *,
    static_only: bool,
    say: Callable[[str], None],
    confirm: Callable[[str], bool],
) -> None:
    """Say what was read, in which units, and how many steps a simulation of it takes; ask where these are very many.

    Parameters
    ----------
    static_only : bool
        The static law steps from sample to sample.

    Raises
    ------
    InputError
        If `confirm` declines.
    """
    steps = 0
    slow = False
    for file in files:
        interval = float(np.median(np.diff(file.time_s)))
        length = float(np.ptp(file.time_s))
        own = len(file.time_s) if static_only else int(length / min(interval, LONGEST_STEP_S))
        steps += own
        slow |= interval > SLOW_S
        scales = {"time": how.time_scale, "input": how.input_scale, "output": how.output_scale}
        factors = "".join(f", {key} x {scale:g}" for key, scale in scales.items() if scale != 1)
        say(
            f"{file.name}: {len(file.time_s)} samples over {length:.4g} s ({1 / interval:.4g} Hz), input "
            f"{file.input_N.min():.4g} to {file.input_N.max():.4g} N{factors}; {own} steps a simulation"
        )
    if steps <= MANY_STEPS:
        return
    guess = "; is the time in milliseconds? --scale time=0.001" if slow else ""
    question = f"{steps:.3g} steps a simulation, and a fit takes some hundred simulations{guess}"
    if not confirm(question):
        raise InputError(
            f"{question}. Not started: give --yes to fit all of it, --static for the static law alone, or shorter files"
        )


def check_question(scenario: Scenario, fit_files: Sequence[Path], judging: Sequence[Path]) -> None:
    """Refuse what cannot be answered: no file, a straight path, two relaxation times, cells beyond the path.

    Raises
    ------
    InputError
    """
    if not fit_files:
        raise InputError("no measured file given; name at least one with --data")
    if scenario.transmission.path.total_angle_rad == 0:
        raise InputError(
            "total_angle_rad is 0: without a wrap angle friction has no coefficient; give the path's angle"
        )
    if scenario.transmission.tendon.second_relaxation_time_s is not None:
        raise InputError(
            "second_relaxation_time_s is given, but one relaxation time is fitted; "
            "leave it and second_relaxing_stiffness_N_per_m out"
        )
    if twice := sorted({p.name for p in fit_files if p.resolve() in {v.resolve() for v in judging}}):
        raise InputError(f"{', '.join(twice)}: given with --data and with --validate; a file cannot judge its own fit")
    theta = scenario.transmission.path.total_angle_rad
    for angle in scenario.measurement.tension_angles_rad or ():
        if angle >= theta:
            raise InputError(
                f"tension_angles_rad: a cell at {angle:g} rad; its angle from the actuator must be less than that of "
                f"the whole path, {theta:g} rad"
            )
