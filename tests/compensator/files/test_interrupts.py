import signal
import weakref
from collections.abc import Iterator
from pathlib import Path

import pytest

from tendonff.compensator import cli
from tendonff.compensator.files import interrupts
from tendonff.compensator.files.writing import atomic_directory


@pytest.fixture(autouse=True)
def _handlers(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    interrupts.install()
    yield
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
