"""Ctrl-C and an ended job: they leave nothing half written, and nothing written afterwards."""

import signal
import sys
import threading
from types import FrameType

_STOPPED = threading.Event()
_DEFERRED = getattr(signal, "SIGALRM", None)  # asks again; Windows has none
_AGAIN_S, _LOST_S = 0.02, 2.0  # after an import or a deletion; after an interrupt that may be lost


class Interrupted(Exception):  # noqa: N818 - an interrupt, like KeyboardInterrupt, and no error
    """The user stopped a command that keeps what it has; the message says what that is."""


def _stop(number: int, frame: FrameType | None) -> None:
    again = _STOPPED.is_set() and number != _DEFERRED
    _STOPPED.set()
    if _DEFERRED is not None and not again:
        waits = _is_lost_in(frame)
        signal.signal(_DEFERRED, _stop)
        signal.setitimer(signal.ITIMER_REAL, _AGAIN_S if waits else _LOST_S)
        if waits or (number == _DEFERRED and sys.exc_info()[0] is not None):  # what was raised is on its way
            return
    raise KeyboardInterrupt


def _is_lost_in(frame: FrameType | None) -> bool:
    """Whether a module is being imported, an object deleted, or a sequence of Sobol begun.

    What is raised in an import is lost, or ends a compiled module by `abort`; in `__del__`, and in SciPy's compiled
    tables of Sobol, it is printed and dropped.
    """
    while frame is not None:
        code = frame.f_code
        if code.co_filename == "<frozen importlib._bootstrap>" or code.co_name == "__del__":
            return True
        if code.co_filename.endswith("_qmc.py"):
            return True
        frame = frame.f_back
    return False


def install() -> None:
    """Handle SIGINT and SIGTERM alike, so that an ended job removes its temporary files too."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, _stop)


def ended() -> None:
    """Ask no more: the command has ended."""
    if _DEFERRED is not None and stopped():
        signal.setitimer(signal.ITIMER_REAL, 0)


def stopped() -> bool:
    """Whether the user asked to stop."""
    return _STOPPED.is_set()


def raise_if_stopped() -> None:
    """Raise KeyboardInterrupt if an interrupt was lost.

    Python discards what is raised inside a callback of a weak reference.
    """
    if stopped():
        raise KeyboardInterrupt
