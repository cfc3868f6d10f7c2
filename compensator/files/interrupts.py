"""Ctrl-C and an ended job: they leave nothing half written, and nothing written afterwards."""

import signal
import threading
from types import FrameType
from typing import NoReturn

_STOPPED = threading.Event()


class Interrupted(Exception):  # noqa: N818 - an interrupt, like KeyboardInterrupt, and no error
    """The user stopped a command that keeps what it has; the message says what that is."""


def _stop(_number: int, _frame: FrameType | None) -> NoReturn:
    _STOPPED.set()
    raise KeyboardInterrupt


def install() -> None:
    """Handle SIGINT and SIGTERM alike, so that an ended job removes its temporary files too."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, _stop)


def stopped() -> bool:
    """Whether the user asked to stop."""
    return _STOPPED.is_set()


def raise_if_stopped() -> None:
    """Raise KeyboardInterrupt if an interrupt was lost.

    Python discards what is raised inside a callback of a weak reference.
    """
    if stopped():
        raise KeyboardInterrupt
