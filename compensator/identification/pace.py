"""Time that a fit takes, against the time announced."""

import time
from collections.abc import Callable

SLOW, MOST = 5.0, 10.0
"""Times what was announced: a fit that takes longer says what it does, and is stopped."""


class SlowFitError(RuntimeError):
    """Fit that takes far longer than announced: the law does not fit the files."""


class Pace:
    """Watch over the computing time of an identification.

    Parameters
    ----------
    say : callable
        Callback for messages on the work in progress.
    announced_s : float
        Time that was announced [s]; infinite for a fit without a bound.
    clock : callable, optional
        Computing time [s].
    """

    def __init__(
        self,
        say: Callable[[str], None] = lambda _: None,
        announced_s: float = float("inf"),
        clock: Callable[[], float] = time.thread_time,
    ) -> None:
        self._say, self._announced_s, self._clock = say, announced_s, clock
        self._began_s, self._doing, self._is_slow = clock(), "fit", False

    def begin(self, work: str) -> None:
        """Begin a part of the work, and name it to the user."""
        self._doing = work
        self._say(work)

    def end(self) -> None:
        """No bound for the rest of the fit."""
        self._announced_s = float("inf")

    def keep(self) -> None:
        """Go on; SlowFitError if the bound is passed."""
        taken = self._clock() - self._began_s
        bound = MOST * self._announced_s
        if taken > bound:
            raise SlowFitError(
                f"stopped after {bound:.3g} s of computing, {MOST:g} times what was announced: check signs and units "
                "of the columns, or fit shorter files"
            )
        if taken > SLOW * self._announced_s and not self._is_slow:
            self._is_slow = True
            self._say(
                f"the fit takes longer than announced, {taken:.3g} s so far: {self._doing}; the chain hardly fits "
                f"these files. It stops at {bound:.3g} s; check signs and units of the columns"
            )


UNHURRIED = Pace()
"""No bound."""
