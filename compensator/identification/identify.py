"""`identify`: parameters of any mechanism, with confidence intervals, from measured files."""

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Generic

from threadpoolctl import threadpool_limits

from tendonff.compensator.identification.answer.result import Identification, S
from tendonff.compensator.scenario.measurement import Measurement
from tendonff.compensator.works import function_of
from tendonff.models.turns import in_turn


@dataclass(frozen=True, slots=True, kw_only=True)
class Request(Generic[S]):
    """Request for an identification: a scenario, and the files that were measured.

    Parameters
    ----------
    scenario : Scenario, JointScenario or FingerScenario
        What is known, and every value that the files do not identify.
    how : Measurement
        How the files are to be read.
    files, judging : tuple of Path
        Measured files to fit, and those that judge the laws.
    static_only : bool
        Of one tendon: stop after the static stage.
    say, confirm : callable
        Callback for messages; asked where a fit takes very many steps, or a value looks like another unit.
    """

    scenario: S
    how: Measurement
    files: tuple[Path, ...]
    judging: tuple[Path, ...]
    static_only: bool
    say: Callable[[str], None]
    confirm: Callable[[str], bool]

    @property
    def every(self) -> tuple[Path, ...]:
        """All files."""
        return (*self.files, *self.judging)


@in_turn
def identify(
    scenario: S,
    data: Sequence[str | os.PathLike[str]],
    validate: Sequence[str | os.PathLike[str]] = (),
    *,
    how: Measurement | None = None,
    static_only: bool = False,
    say: Callable[[str], None] = lambda _: None,
    confirm: Callable[[str], bool] = lambda _: False,
) -> Identification[S]:
    """Fit a scenario to measured files; arguments and errors as of `door.identify`."""
    request = Request(
        scenario=scenario,
        how=how or scenario.measurement,
        files=tuple(map(Path, data)),
        judging=tuple(map(Path, validate)),
        static_only=static_only,
        say=say,
        confirm=confirm,
    )
    with threadpool_limits(limits=1, user_api="blas"):  # matrices are small: a second thread doubles the work
        found: Identification[S] = function_of("fit", scenario)(request)
    return found
