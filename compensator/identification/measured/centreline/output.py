"""The files of a centreline: the sections to paste, a figure and the numbers."""

import os
from dataclasses import asdict, dataclass

from tendonff._version import __version__
from tendonff.compensator.files.writing import atomic_directory, write_json, write_text
from tendonff.compensator.identification.measured.centreline.figures import centreline_figure
from tendonff.compensator.identification.measured.centreline.result import CentrelineData
from tendonff.compensator.reporting.plots import save_figure

_MASSES_A_RADIAN = 3


@dataclass(frozen=True, slots=True, kw_only=True)
class Centreline(CentrelineData):
    """A centreline that can be written."""

    def write(self, folder: str | os.PathLike[str]) -> None:
        """Write `sections.toml`, `summary.json` and a figure, all or nothing."""
        with atomic_directory(folder) as partial:
            write_text(partial / "sections.toml", self.toml())
            write_json(partial / "summary.json", self.summary())
            save_figure(centreline_figure(self), partial / "centreline")

    def toml(self) -> str:
        """The table [path] of a scenario."""
        arcs = sum(each.angle_rad > 0 for each in self.stretches)
        segments = max(6, arcs, round(_MASSES_A_RADIAN * self.angle_rad))
        lines = [
            f"# wrap angle {self.angle_rad:.4g} +- {self.uncertainty_rad:.2g} rad (95 %), from {self.file}",
            "[path]",
            f"segments = {segments}",
        ]
        for each in self.stretches:
            lines += ["", "[[path.sections]]", f'name = "{each.name}"']
            if each.angle_rad > 0:
                lines.append(f"angle_rad = {each.angle_rad:.5g} # +- {each.uncertainty_rad:.2g}")
            else:
                lines.append(f"angle_rad = 0.0 # straight, +- {each.uncertainty_rad:.2g}")
            lines.append(f"length_m = {each.length_m:.5g}")
        return "\n".join([*lines, ""])

    def summary(self) -> dict[str, object]:
        """The contents of `summary.json`."""
        return {
            "schema": 1,
            "tool": f"tendonff {__version__}",
            "file": self.file,
            "points": len(self.points_m),
            "length_m": float(self.length_m[-1]),
            "angle_rad": self.angle_rad,
            "uncertainty_rad": self.uncertainty_rad,
            "noise_m": self.noise_m,
            "inflation_rad": self.inflation_rad,
            "sections": [asdict(each) for each in self.stretches],
            "warnings": self.warnings,
        }
