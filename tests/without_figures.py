"""Commands whose figures are not painted, for tests of numbers and words: painting is half of a command's time.

Every kind of report is painted in `golden`, `test_reports_in_browser.py` and the tests of the pages.
"""

from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from tendonff.compensator.reporting import plots


@contextmanager
def without_figures() -> Iterator[None]:
    """Figures are made, and empty files written in their place."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(plots, "_drawn", lambda _figure, kind: f"<{kind}/>".encode())
        yield
