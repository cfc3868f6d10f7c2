"""Common part of all designs, whatever their scenarios describe."""

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tendonff.compensator.reporting.results import Result

if TYPE_CHECKING:
    from collections.abc import Sequence

    from tendonff.compensator.compensators.expectation import Expectation
    from tendonff.compensator.compensators.method_check import MethodCheck
    from tendonff.ocp.integrate.method import Method


class ShownDesign(Result):
    """Design with what to expect of each compensator; see `Design` and `MotorDesign`."""

    __slots__ = ()

    if TYPE_CHECKING:

        @property
        def compensators(self) -> Sequence[Any]:
            """In the order in which they are shown."""

        @property
        def expectation(self) -> Expectation:
            """Expected errors on a rig."""

    @property
    def recommended(self) -> Any:
        """The compensator whose worst error over the uncertainty is least."""
        return next(c for c in self.compensators if c.name == self.expectation.recommended)

    def check(self, method: "Method") -> "MethodCheck":
        """Simulate the recommended command on the design model by another method too; SolveError if that fails."""
        raise NotImplementedError

    def show(self, folder: Path) -> None:
        """Print the scores, what to expect on a rig, and where the files are."""
        self._views.show(self, folder)

    def write(self, folder: str | os.PathLike[str], *, interactive: bool = False, pdf: bool = False) -> None:
        """Write `profile.csv`, `summary.json`, figures and `report.html`, all or nothing; makes the folder.

        An interactive report has a view with zoom, hover and a legend that hides curves, and needs Bokeh.
        """
        self._views.write(self, folder, interactive=interactive, pdf=pdf)
