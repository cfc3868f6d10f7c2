"""Output of commands while they run: messages, warnings and a progress bar, all on standard error."""

import atexit
import functools
import os
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import NoReturn, TypeVar

from tendonff.compensator.files.notices import Remark, by_urgency
from tendonff.compensator.files.progress import Progress, silent
from tendonff.compensator.files.typeset import typeset

T = TypeVar("T")

_left: list[threading.Thread] = []
"""Work that Ctrl-C has left behind; Python 3.11 calls a thread stopped whose `join` was interrupted."""


_AS_TYPED = "error:"  # an error quotes values as the user wrote them


def say(*messages: str) -> None:
    """Messages on standard error, one a line."""
    for message in messages:
        print(message if message.startswith(_AS_TYPED) else typeset(message), file=sys.stderr)  # noqa: T201 - the one place that prints


_warned: set[str] = set()
"""Warnings of this command so far: what was said before the work is not said again with its result."""


def warn(*messages: str) -> None:
    """Warnings on standard error, one a line, each once a command, the most urgent first."""
    new = (message for message in by_urgency(messages) if message not in _warned)
    say(*(f"{'note' if isinstance(message, Remark) else 'warning'}: {message}" for message in new))
    _warned.update(messages)


def forget_warnings() -> None:
    """Begin a command."""
    _warned.clear()


@functools.cache
def _note_engine() -> None:
    """Say once where work will be slow for want of a compiler."""
    from tendonff.ocp.codegen.compiler import why_no_compiler
    from tendonff.ocp.codegen.engine import Engine, resolve_engine

    if not os.environ.get("TENDONFF_ENGINE") and resolve_engine(Engine.AUTO) is Engine.CASADI:
        say(f"{why_no_compiler()}. Results are the same, several times slower")


@contextmanager
def progress(description: str) -> Iterator[Progress]:
    """Bar that shows how much of a long work is done; silent when standard error is not a terminal."""
    with _bar(description) as advance:
        yield advance
    _note_engine()  # only after work that was done: a refusal is one message


def interruptible(work: Callable[[], T]) -> T:
    """Result of `work`, which writes nothing, left at once by Ctrl-C also while it is in compiled code.

    Python's own handler waits until such code returns; here it runs beside a thread that the process does not wait for.
    """
    results: list[T] = []
    failures: list[BaseException] = []

    def run() -> None:
        try:
            results.append(work())
        except BaseException as error:  # noqa: BLE001 - raised again below
            failures.append(error)

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    try:
        while thread.is_alive():
            thread.join(0.1)
    except KeyboardInterrupt:
        _left.append(thread)
        raise
    if failures:
        raise failures[0]
    return results[0]


def leave(code: int) -> NoReturn:
    """End the process; at once where Ctrl-C has left work behind, which would go on while Python takes itself down."""
    if _left:
        atexit._run_exitfuncs()  # temporary files
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)
    sys.exit(code)


@contextmanager
def _bar(description: str) -> Iterator[Progress]:
    if not sys.stderr.isatty():
        yield silent
        return
    from rich.console import Console
    from rich.progress import BarColumn, TaskProgressColumn, TextColumn, TimeRemainingColumn
    from rich.progress import Progress as Bar

    columns = (TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TimeRemainingColumn())
    with Bar(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(description, total=None)
        yield lambda done, total: bar.update(task, completed=done, total=total)
