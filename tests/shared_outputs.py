"""Outputs of commands on the examples, made once in a test session and shared by its workers."""

import contextlib
import io
import os
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest
from without_figures import without_figures

from tendonff.compensator.cli import run

WAIT_S = 1800.0
PAINTED = "finger"  # whose reports the browser looks at


@dataclass(frozen=True)
class Output:
    """Files and messages of a command; the files are shared: read them only."""

    folder: Path
    messages: str  # standard output, then standard error


@contextlib.contextmanager
def _alone(lock: Path) -> Iterator[None]:
    """Only one process at a time; others wait, for what it makes is what they need."""
    deadline = time.monotonic() + WAIT_S
    while True:
        try:
            os.close(os.open(lock, os.O_CREAT | os.O_EXCL))
            break
        except FileExistsError:
            if time.monotonic() > deadline:
                raise TimeoutError(f"{lock} is still held after {WAIT_S:g} s") from None
            time.sleep(0.2)
    try:
        yield
    finally:
        lock.unlink()


def output_of(shared: Path, examples: Path, command: str, example: str, *arguments: str) -> Output:
    """Run a command on an example, or take what another test made."""
    name = "_".join((command, example, *(a.lstrip("-") for a in arguments)))
    place, messages = shared / name, shared / f"{name}.txt"
    with _alone(shared / f"{name}.lock"):
        if not messages.exists():
            place.mkdir(exist_ok=True)
            out, err = io.StringIO(), io.StringIO()
            with pytest.MonkeyPatch.context() as patch:
                patch.chdir(place)  # messages shall name no path of this machine
                patch.setenv("COLUMNS", "120")
                patch.delenv("TENDONFF_ENGINE", raising=False)
                painted = contextlib.nullcontext() if example == PAINTED else without_figures()
                with painted, contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
                    code = run([command, str(examples / f"{example}.toml"), *arguments, "--out", "out"])
            assert code == 0, err.getvalue()
            messages.write_text(out.getvalue() + err.getvalue(), encoding="utf-8")
    return Output(folder=place / "out", messages=messages.read_text(encoding="utf-8"))
