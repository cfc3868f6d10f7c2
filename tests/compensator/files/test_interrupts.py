import importlib
import signal
import time
import weakref
from collections.abc import Iterator
from pathlib import Path

import pytest
from scipy.stats import _qmc as sobol

from tendonff.compensator import cli
from tendonff.compensator.files import interrupts
from tendonff.compensator.files.writing import atomic_directory


@pytest.fixture(autouse=True)
def _handlers(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    interrupts.install()
    yield
    interrupts.ended()
    interrupts._STOPPED.clear()
    for number, handler in before.items():
        signal.signal(number, handler)


class _Dropped:
    pass


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_an_interrupt_lost_in_a_callback_still_writes_nothing(tmp_path: Path) -> None:
    thing = _Dropped()
    reference = weakref.ref(thing, lambda _: signal.raise_signal(signal.SIGINT))
    with pytest.raises(KeyboardInterrupt), atomic_directory(tmp_path / "out") as folder:
        (folder / "profile.csv").write_text("whole", encoding="utf-8")
        del thing  # Python prints and drops what the callback raises
        assert reference() is None
    assert not list(tmp_path.iterdir())


def test_whatever_an_interrupt_breaks_is_called_interrupted(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def broken(_: object) -> int:
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
        raise ImportError("half a module")

    monkeypatch.setattr(cli, "run", broken)
    with pytest.raises(SystemExit) as ended:
        cli.main()
    assert ended.value.code == 130
    assert capsys.readouterr().err.strip() == "interrupted; nothing was written"


@pytest.mark.skipif(not hasattr(signal, "SIGALRM"), reason="this system has no SIGALRM")
def test_an_interrupt_waits_for_the_end_of_an_import(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A compiled module that is interrupted while it is loaded may end the process by `abort`."""
    text = "import signal\nsignal.raise_signal(signal.SIGINT)\nwhole = True\n"
    (tmp_path / "interrupted_import.py").write_text(text, encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    module = importlib.import_module("interrupted_import")
    assert module.whole
    with pytest.raises(KeyboardInterrupt):
        time.sleep(10)


@pytest.mark.skipif(not hasattr(signal, "SIGALRM"), reason="this system has no SIGALRM")
def test_an_interrupt_waits_for_the_end_of_a_deletion() -> None:
    """Python prints a traceback of what `__del__` raises, and drops it: here a warning, which is an error."""

    class Deleted:
        def __del__(self) -> None:
            signal.raise_signal(signal.SIGINT)

    thing = Deleted()
    del thing
    with pytest.raises(KeyboardInterrupt):
        time.sleep(10)


@pytest.mark.skipif(not hasattr(signal, "SIGALRM"), reason="this system has no SIGALRM")
def test_an_interrupt_waits_until_a_sequence_of_sobol_has_begun() -> None:
    """SciPy's compiled part prints a traceback of what is raised below it, drops it, and goes on."""
    begun: list[bool] = []
    text = "signal.raise_signal(signal.SIGINT)\nbegun.append(True)"
    exec(compile(text, sobol.__file__, "exec"), {"signal": signal, "begun": begun})  # noqa: S102 - a frame of that file
    assert begun
    with pytest.raises(KeyboardInterrupt):
        time.sleep(10)


@pytest.mark.skipif(not hasattr(signal, "SIGALRM"), reason="this system has no SIGALRM")
def test_a_second_interrupt_does_not_wait(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    text = "import signal\nsignal.raise_signal(signal.SIGINT)\nsignal.raise_signal(signal.SIGINT)\n"
    (tmp_path / "interrupted_twice.py").write_text(text, encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(KeyboardInterrupt):
        importlib.import_module("interrupted_twice")


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
@pytest.mark.skipif(not hasattr(signal, "SIGALRM"), reason="this system has no SIGALRM")
def test_an_interrupt_that_is_lost_while_it_computes_comes_again(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(interrupts, "_LOST_S", 0.05)
    thing = _Dropped()
    reference = weakref.ref(thing, lambda _: signal.raise_signal(signal.SIGINT))
    del thing
    assert reference() is None
    with pytest.raises(KeyboardInterrupt):
        time.sleep(10)


@pytest.mark.skipif(not hasattr(signal, "SIGALRM"), reason="this system has no SIGALRM")
def test_what_an_interrupt_leaves_to_clean_up_is_not_interrupted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(interrupts, "_LOST_S", 0.02)
    cleaned = False
    with pytest.raises(KeyboardInterrupt):
        try:
            signal.raise_signal(signal.SIGINT)
        finally:
            time.sleep(0.2)
            cleaned = True
            interrupts.ended()
    assert cleaned
