"""`watch`: drift of friction, pre-tension and gear friction of a loop over what its motor felt."""

import os
from collections.abc import Callable, Sequence
from pathlib import Path

from threadpoolctl import threadpool_limits

from tendonff.compensator.files.reading import InputError
from tendonff.compensator.identification.motors.log import answered_logs, read_logs
from tendonff.compensator.identification.motors.numbers import require_loop
from tendonff.compensator.scenario.driven.joint import JointScenario
from tendonff.compensator.scenario.measurement import Measurement
from tendonff.compensator.studies.watch.chart import courses_of
from tendonff.compensator.studies.watch.output import Watch
from tendonff.compensator.studies.watch.windows import Window, fit_window, windows_of
from tendonff.compensator.works import function_of
from tendonff.models.errors import ParameterError
from tendonff.models.joint.closed_form import GrossSliding, data_sheet
from tendonff.models.turns import in_turn


@in_turn
def watch(
    scenario: JointScenario,
    data: Sequence[str | os.PathLike[str]],
    *,
    how: Measurement | None = None,
    confirm: Callable[[str], bool] = lambda _: False,
    progress: Callable[[int, int], None] = lambda _done, _all: None,
) -> Watch:
    """Follow friction, pre-tension and gear friction of a loop over days of use.

    Parameters
    ----------
    scenario : JointScenario
        As identified: `fitted.toml`.
    data : sequence of str or path
        Logs of the motor in the order of use, with the columns that `identify_joint` reads.
    how : Measurement, optional
        Other names and scales of the columns.
    confirm : callable, optional
        Asked where a value looks like another unit; default: no.
    progress : callable, optional
        Callback(completed, total).

    Raises
    ------
    InputError
        If a file cannot be used, or the joint has no loop.

    Examples
    --------
    >>> import tendonff as tf
    >>> scenario = tf.load_scenario("fit/fitted.toml")  # doctest: +SKIP
    >>> found = tf.watch(scenario, ["monday.csv", "tuesday.csv"])  # doctest: +SKIP
    >>> print(found.headline)  # doctest: +SKIP
    """
    function_of("watch", scenario)  # which refuses the others
    try:
        require_loop(scenario.mechanism, scenario.source.name)
    except ParameterError as error:
        raise InputError(str(error)) from None
    files, mechanism = tuple(map(Path, data)), scenario.mechanism
    start_rad = scenario.reference_start_rad()
    law = GrossSliding.of(mechanism, start_rad)
    lost = data_sheet(law, 0.0).lost_motion_rad * mechanism.drive.gear_ratio * abs(law.tendons[0].arm_m)
    lost /= law.tendons[0].drum_m
    found: list[Window] = []
    used = 0.0
    with threadpool_limits(limits=1, user_api="blas"):
        logs = read_logs(scenario, files, how or Measurement())
        accepted = answered_logs(scenario, logs, confirm)
        for done, log in enumerate(logs):
            parts = list(windows_of(log, mechanism))
            for k, part in enumerate(parts):
                used += len(part.torque_N_m) * part.run.step_s
                found.append(fit_window(part, mechanism, used, lost))
                progress(done * 100 + 100 * (k + 1) // len(parts), 100 * len(files))
    return Watch(scenario=scenario, windows=tuple(found), courses=courses_of(found), inputs=files, accepted=accepted)
