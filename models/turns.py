"""CasADi in one thread at a time.

CasADi's expressions, its matrices and their sparsity patterns share nodes across the whole process: making or dropping
them in two threads at once may end in a segmentation fault. Every public function that needs them takes its turn, so
it may be called from any thread; compiled steps run beside each other. Who handles expressions in threads of their own
holds `TURN` meanwhile::

    with TURN:
        equations = chain_equations(chain)
        ...
        del equations  # dropped in turn, too

No other lock may be held where a turn ends or begins.
"""

import functools
import threading
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import ParamSpec, TypeVar

P = ParamSpec("P")
R = TypeVar("R")

TURN = threading.RLock()
"""Held by the thread whose turn it is; it may be taken again by the same thread."""


def in_turn(function: Callable[P, R]) -> Callable[P, R]:
    """The function, waiting until no other thread uses CasADi."""

    @functools.wraps(function)
    def waiting(*args: P.args, **kwargs: P.kwargs) -> R:
        with TURN:
            try:
                return function(*args, **kwargs)
            except Exception as error:
                if threading.current_thread() is not threading.main_thread():
                    _drop_expressions(error)  # an executor hands the error to a thread that does not wait
                raise

    return waiting


def _drop_expressions(error: BaseException | None) -> None:
    """Clear the ended frames of an error and of those behind it."""
    seen: set[int] = set()
    while error is not None and id(error) not in seen:
        seen.add(id(error))
        traceback.clear_frames(error.__traceback__)
        error = error.__cause__ or error.__context__


@contextmanager
def out_of_turn() -> Iterator[None]:
    """Let other threads take theirs: for compiled code, and while waiting for other threads."""
    depth = 0
    while _released():
        depth += 1
    try:
        yield
    finally:
        for _ in range(depth):
            TURN.acquire()


def _released() -> bool:
    try:
        TURN.release()
    except RuntimeError:  # it was not ours
        return False
    return True
