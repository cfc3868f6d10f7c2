"""The golden set's fixture: compares what commands write with what is stored, or stores it."""

import shutil
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

import golden_set
import pytest

import tendonff

STORED = Path(__file__).resolve().parent / "stored"


class Golden:
    """The stored files of one example and command.

    Parameters
    ----------
    root : Path
        Folder of the set.
    place : str
        `example/command` in it.
    update : bool
        Write them anew instead of comparing.
    exact : bool
        Store in full, and compare to 1e-12 and to the byte.
    """

    def __init__(self, root: Path, place: str, update: bool, exact: bool) -> None:
        self._folder, self._place, self._update, self._exact = root / place, place, update, exact
        self._form = golden_set.Form(exact)
        self._fresh: dict[str, tuple[str, golden_set.Tolerance, bool]] = {}

    def table(self, file: Path, share: float = golden_set.TOLERANCE) -> None:
        """Add a CSV table, with a tolerance as a share of each column's scale."""
        self._add(file.name, self._form.table(file.read_text(encoding="utf-8")), share)

    def data(
        self,
        file: Path,
        share: float = golden_set.TOLERANCE,
        *,
        left_out: frozenset[str] = frozenset(),
        alone: bool = False,
        amplified: Mapping[str, float] | None = None,
    ) -> None:
        """Add a JSON or TOML file.

        Parameters
        ----------
        file : Path
        share : float, optional
            Tolerance as a share of the scale under the same key.
        left_out : frozenset of str, optional
            Keys that are not stored.
        alone : bool, optional
            Judge every number by its own magnitude, where one key holds several quantities.
        amplified : mapping of str to float, optional
            Share of numbers under a key that amplify rounding.
        """
        self._add(f"{file.stem}.json", self._form.file(file, left_out), share, alone, amplified or {})

    def text(self, name: str, text: str, share: float = golden_set.TOLERANCE) -> None:
        """Add an exported text without its arrays; prose as it is."""
        self._add(name, self._form.messages(text) if name.endswith((".md", ".txt")) else self._form.code(text), share)

    def messages(self, text: str, share: float = golden_set.TOLERANCE) -> None:
        """Add what the command printed."""
        self._add("messages.txt", self._form.messages(text), share)

    def arrays(self, folder: Path, share: float = golden_set.TOLERANCE) -> None:
        """Add every array of numbers in the exported code of a folder."""
        self._add("arrays.json", self._form.arrays(folder), share)

    def _add(
        self, name: str, text: str, share: float, alone: bool = False, amplified: Mapping[str, float] | None = None
    ) -> None:
        assert name not in self._fresh, f"{name} was added twice"

        def tolerance(place: str) -> float:
            if self._exact:
                return golden_set.EXACT
            wider = [most for key, most in (amplified or {}).items() if key in place]
            return max([share, *wider])

        self._fresh[name] = text, tolerance, alone

    def settle(self) -> list[str]:
        """Compare with what is stored, or store; returns what differs."""
        if self._update:
            shutil.rmtree(self._folder, ignore_errors=True)
            self._folder.mkdir(parents=True)
            for name, (text, *_) in self._fresh.items():
                (self._folder / name).write_text(text, encoding="utf-8", newline="\n")
            return []
        stored = {f.name: f.read_text(encoding="utf-8") for f in self._folder.glob("*")}
        lines = [f"{self._place}/{name}: stored, but no longer written" for name in stored if name not in self._fresh]
        for name, (text, share, alone) in self._fresh.items():
            if name not in stored:
                lines.append(f"{self._place}/{name}: not stored yet")
                continue
            found = golden_set.compared(name, stored[name], text, share, alone=alone, exact=self._exact)
            lines += [f"{self._place}/{name}: {line}" for line in found[:20]]
            if len(found) > 20:
                lines.append(f"{self._place}/{name}: and {len(found) - 20} more")
        return lines


@pytest.fixture
def golden(request: pytest.FixtureRequest) -> Iterator[Callable[[str], Golden]]:
    """The stored files `example/command`, compared (or written, with `--golden-update`) as the test ends."""
    update, folder, full = (request.config.getoption(f"golden_{name}") for name in ("update", "folder", "full"))
    if full:  # the packages of this commit, not those of the environment
        assert Path(tendonff.__file__).resolve().is_relative_to(request.config.rootpath.resolve())
    opened: list[Golden] = []

    def of(place: str) -> Golden:
        opened.append(Golden(Path(folder or STORED), place, update, full))
        return opened[-1]

    yield of
    lines = [line for each in opened for line in each.settle()]
    if lines:
        remedy = "a difference from the commit of --golden-exact" if full else "--golden-update stores what is new"
        pytest.fail(f"differs from the golden set ({remedy}):\n" + "\n".join(lines), pytrace=False)
