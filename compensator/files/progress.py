"""Progress of long work."""

from collections.abc import Callable

Progress = Callable[[int, int], None]  # called with parts done and parts in all

DOUBT = "doubt: "
"""Beginning of a line that asks about the data, among those that report progress."""


def silent(_done: int, _total: int) -> None:
    """No-op progress callback."""


class Parts:
    """Progress of work that consists of `total` parts, some of which report progress of their own."""

    _FINE = 100  # steps that a part is reported in

    def __init__(self, progress: Progress, total: int) -> None:
        self._progress, self._total, self._done = progress, total, 0

    def done(self, parts: int = 1) -> None:
        """So many more parts are done."""
        self._done += parts
        self._progress(self._FINE * self._done, self._FINE * self._total)

    def inside(self, parts: int = 1) -> Progress:
        """Progress of the next so many parts, which counts as that of the whole; `done` follows when they are."""

        def report(done: int, total: int) -> None:
            share = min(done / max(total, 1), 1.0)
            self._progress(round(self._FINE * (self._done + parts * share)), self._FINE * self._total)

        return report
