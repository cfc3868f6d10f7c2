"""A measured centreline: its sections, its figure and its files."""

import os
from dataclasses import asdict, dataclass

import numpy as np
from matplotlib.figure import Figure

from tendonff._version import __version__
from tendonff.compensator.files.reading import FloatArray
from tendonff.compensator.files.writing import atomic_directory, write_json, write_text
from tendonff.compensator.reporting.colours import BLUE, GREY, ORANGE, VERMILION
from tendonff.compensator.reporting.plots import figure_style, legend_below, new_figure, save_figure

_MASSES_A_RADIAN, _LEAST_MASSES = 3, 6
_LONGEST_M = 50.0  # a longer path is in millimetres
_UNSURE = 0.1  # of the angle: an uncertainty above that is worth a word


@dataclass(frozen=True, slots=True, kw_only=True)
class Stretch:
    """A section of the path.

    Attributes
    ----------
    name : str
        Name of the section.
    start_m : float
        Where it begins along the curve [m].
    length_m : float
        Its length [m].
    angle_rad : float
        Wrap angle; 0 for a straight.
    uncertainty_rad : float
        Half the width of the angle's 95 % interval.
    """

    name: str
    start_m: float
    length_m: float
    angle_rad: float
    uncertainty_rad: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Centreline:
    """A measured centreline.

    Attributes
    ----------
    file : str
        Name of the file.
    points_m : numpy.ndarray
        Shape (n, 3).
    curve_m : numpy.ndarray
        Shape (places, 3); the smooth curve.
    length_m, turned_rad, spread_rad : numpy.ndarray
        Shape (places,); along the curve: length, angle turned, and half the width of its 95 % interval.
    noise_m : float
        Standard deviation of the points across the curve.
    inflation_rad : float
        By how much noise had inflated the whole angle; taken off.
    stretches : tuple of Stretch
        Its sections, from the first point on.
    notes : tuple of str
        What was taken for granted when the file was read.
    """

    file: str
    points_m: FloatArray
    curve_m: FloatArray
    length_m: FloatArray
    turned_rad: FloatArray
    spread_rad: FloatArray
    noise_m: float
    inflation_rad: float
    stretches: tuple[Stretch, ...]
    notes: tuple[str, ...] = ()

    @property
    def angle_rad(self) -> float:
        """Wrap angle of the whole."""
        return float(self.turned_rad[-1])

    @property
    def uncertainty_rad(self) -> float:
        """Half the width of its 95 % interval."""
        return float(self.spread_rad[-1])

    @property
    def warnings(self) -> tuple[str, ...]:
        """Warnings to read before the sections are used."""
        notes = []
        if self.length_m[-1] > _LONGEST_M:
            notes.append(f"the path is {self.length_m[-1]:.4g} m long; are the coordinates in millimetres? Give metres")
        if self.uncertainty_rad > max(_UNSURE * self.angle_rad, _UNSURE):
            notes.append(
                f"the wrap angle is known to within {self.uncertainty_rad:.2g} rad of {self.angle_rad:.3g} only: "
                "measure more points, or more exact ones"
            )
        return tuple(notes)

    def write(self, folder: str | os.PathLike[str], *, pdf: bool = False) -> None:
        """Write `sections.toml`, `summary.json` and a figure, all or nothing."""
        with atomic_directory(folder) as partial:
            write_text(partial / "sections.toml", self.toml())
            write_json(partial / "summary.json", self.summary())
            save_figure(centreline_figure(self), partial / "centreline", pdf=pdf)

    def toml(self) -> str:
        """The table [path] of a scenario."""
        arcs = sum(each.angle_rad > 0 for each in self.stretches)
        segments = max(_LEAST_MASSES, arcs, round(_MASSES_A_RADIAN * self.angle_rad))
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


def centreline_figure(result: Centreline) -> Figure:
    """Points and sections in the plane that shows most of them; angle turned over length, with its interval."""
    middle = result.points_m.mean(axis=0)
    plane = np.linalg.svd(result.points_m - middle, full_matrices=False)[2][:2].T
    points, curve = ((each - middle) @ plane for each in (result.points_m, result.curve_m))
    with figure_style():
        figure, axes = new_figure(1, 2, height_in=3.4)
        shape, turned = axes[0]
        shape.plot(*points.T, ".", color=GREY, markersize=3, label="points")
        for k, each in enumerate(result.stretches):
            rows = (result.length_m >= each.start_m) & (result.length_m <= each.start_m + each.length_m)
            straight = each.angle_rad == 0
            color = BLUE if straight else (VERMILION, ORANGE)[k % 2]
            label = each.name if straight else f"{each.name}: {each.angle_rad:.2f} rad"
            shape.plot(*curve[rows].T, color=color)
            place = curve[rows][int(rows.sum()) // 2]
            away = place - curve.mean(axis=0)
            away = 12 * away / max(float(np.hypot(*away)), 1e-12)
            shape.annotate(
                label,
                place,
                textcoords="offset points",
                xytext=(away[0], away[1]),
                fontsize=8,
                ha="center",
                va="center",
            )
            turned.axvline(each.start_m, color=GREY, linewidth=0.5)
        shape.plot(*curve[:1].T, "o", color=BLUE, markersize=4, label="actuator end")
        legend_below(figure, shape)
        shape.set_aspect("equal", adjustable="datalim")
        shape.set(xlabel="along the widest direction [m]", ylabel="across [m]")
        shape.margins(0.2)  # room for the names
        low, high = result.turned_rad - result.spread_rad, result.turned_rad + result.spread_rad
        turned.fill_between(result.length_m, low, high, color=BLUE, alpha=0.2, linewidth=0, label="95 % interval")
        turned.plot(result.length_m, result.turned_rad, color=BLUE, label="angle turned")
        turned.set(xlabel="length from the actuator [m]", ylabel="wrap angle [rad]")
        turned.legend()
    return figure
