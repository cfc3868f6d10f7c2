"""`tendonff path`: sections with lengths and wrap angles from the measured points of a centreline."""

import os
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np

from tendonff.compensator.files.quantities import LENGTH_UNITS, Quantity, read_quantities
from tendonff.compensator.files.reading import FloatArray, InputError
from tendonff.compensator.identification.measured.centreline.result import Centreline, Stretch
from tendonff.compensator.identification.measured.centreline.smoothing import smooth_curve

AXES = tuple(
    Quantity(name=f"{axis}_m", words=(axis,), units=LENGTH_UNITS, option=f'the name "{axis}_m" in place of "{{}}"')
    for axis in "xyz"
)
JUMP_SHARE = 0.25
"""Steps to and fro of so much of the points' extent are no noise: the order of the points is not that of the path."""

TOLERANCE_RAD = 0.05
_FEWEST = 8  # points: the spline has seven coefficients at least
_DRAWS = 40  # of new noise: their mean and spread are known to a tenth


def read_centreline(file: str | os.PathLike[str], *, tolerance_rad: float = TOLERANCE_RAD) -> Centreline:
    """Sections of the path whose points a file holds.

    Parameters
    ----------
    file : str or path
        Columns x_m, y_m and, unless the path is plane, z_m, or in other units, as x_mm; rows in their order from the
        actuator to the load.
    tolerance_rad : float, optional
        By how much the angle turned up to any place may differ between the curve and its sections.

    Raises
    ------
    InputError

    Examples
    --------
    A quarter of a circle of 50 mm radius:

    >>> import numpy as np, tempfile, pathlib
    >>> import tendonff as tf
    >>> place = np.linspace(0, np.pi / 2, 200)
    >>> points = 0.05 * np.column_stack([np.sin(place), 1 - np.cos(place)])
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = pathlib.Path(folder) / "points.csv"
    ...     np.savetxt(file, points, delimiter=",", header="x_m,y_m", comments="")
    ...     print(f"{tf.read_centreline(file).angle_rad:.2f} rad")
    1.57 rad
    """
    path = Path(file)
    if not tolerance_rad > 0:
        raise InputError(f"tolerance_rad must be > 0, got {tolerance_rad:g}; {TOLERANCE_RAD:g} is a good start")
    read = read_quantities(path, AXES[:2], optional=AXES[2:], rises=False)
    x, y = (read.values[axis.name] for axis in AXES[:2])
    points = np.column_stack([x, y, read.values.get("z_m", np.zeros(len(x)))])
    if len(points) < _FEWEST:
        raise InputError(f"{path.name}: a centreline needs at least {_FEWEST} points, got {len(points)}; add points")
    step = np.linalg.norm(np.diff(points, axis=0), axis=1)
    if not step.all():
        row = int(np.argmin(step)) + 3
        raise InputError(f"{path.name} row {row}: the point is that of the row before; remove one of them")
    if step.max() > 0.5 * step.sum():
        row = int(np.argmax(step)) + 3
        raise InputError(
            f"{path.name} row {row}: half of the path lies between this point and the one before; sort the rows along "
            "the tendon, or add points between them"
        )
    along = np.diff(points, axis=0) / step[:, None]
    extent = float(np.linalg.norm(np.ptp(points, axis=0)))
    if (along[1:] * along[:-1]).sum(axis=1).mean() < 0 and step.mean() > JUMP_SHARE * extent:
        raise InputError(
            f"{path.name}: the points jump to and fro, from one to the next by {100 * step.mean() / extent:.2g} % of "
            "the path's extent in the mean; sort the rows along the tendon, from the actuator to the load"
        )
    found = centreline_of(points, file=path.name, tolerance_rad=tolerance_rad)
    return replace(found, notes=read.notes)


def centreline_of(points_m: FloatArray, *, file: str = "points", tolerance_rad: float = TOLERANCE_RAD) -> Centreline:
    """Sections of the path through points, shape (n, 3), in their order from the actuator to the load.

    Noise turns a curve to and fro and so adds to its angle. How much is seen on curves with known angle: the smooth one
    with new noise of the measured size. Their spread is the random part of the uncertainty; what half of the resolution
    changes is the other part, for what the curve does between the points.
    """
    curve = smooth_curve(points_m)
    length, turned = curve.turning()
    smooth, noise, random = curve.spline()(curve.parameter_m), curve.noise_m, np.random.default_rng(0)
    draws = np.array(
        [curve.through(smooth + random.normal(0, noise, smooth.shape)).turning()[1] for _ in range(_DRAWS)]
    )
    inflation = draws.mean(axis=0) - turned
    coarse = curve.wider().turning()[1] - turned
    total = max(float(turned[-1] - inflation[-1]), 0.0)
    corrected = np.maximum.accumulate(np.maximum(turned - inflation, 0.0))  # what is turned stays turned
    corrected *= total / max(float(corrected[-1]), 1e-300)
    spread = np.array([_half_width(draws[:, k], inflation[k], coarse[k]) for k in range(len(length))])
    # a corner that changes less than the angle is known to is none
    corners = _corners(length, corrected, max(tolerance_rad, 0.5 * spread[-1]))
    sections = list(pairwise(corners))
    unsure = [
        _half_width(draws[:, b] - draws[:, a], inflation[b] - inflation[a], coarse[b] - coarse[a]) for a, b in sections
    ]
    angles = _hand_over(
        [float(corrected[b] - corrected[a]) for a, b in sections], [max(tolerance_rad, u) for u in unsure]
    )
    return Centreline(
        file=file,
        points_m=points_m,
        curve_m=curve.spline()(np.linspace(curve.parameter_m[0], curve.parameter_m[-1], len(length))),
        length_m=length,
        turned_rad=corrected,
        spread_rad=spread,
        noise_m=noise,
        inflation_rad=float(inflation[-1]),
        stretches=tuple(
            Stretch(
                name=f"s{k + 1}",
                start_m=float(length[a]),
                length_m=float(length[b] - length[a]),
                angle_rad=angles[k],
                uncertainty_rad=unsure[k],
            )
            for k, (a, b) in enumerate(sections)
        ),
    )


def _half_width(draws: FloatArray, inflation: float, coarse: float) -> float:
    """Half the width of the 95 % interval: noise and resolution, and what is left of the inflation.

    The smooth curve has turned with the noise already, so new noise adds less to it than the first did: of a straight's
    angle sqrt(2) - 1 is taken off, and sqrt(2) times that is left.
    """
    return float(2 * np.sqrt(draws.var() + coarse**2) + np.sqrt(2) * abs(inflation))


def _corners(length_m: FloatArray, turned_rad: FloatArray, tolerance_rad: float) -> list[int]:
    """Places between which the angle turned grows evenly, within the tolerance (Ramer, Douglas and Peucker)."""
    corners, todo = {0, len(length_m) - 1}, [(0, len(length_m) - 1)]
    while todo:
        a, b = todo.pop()
        share = (length_m[a : b + 1] - length_m[a]) / (length_m[b] - length_m[a])
        off = np.abs(turned_rad[a : b + 1] - turned_rad[a] - share * (turned_rad[b] - turned_rad[a]))
        worst = a + int(np.argmax(off))
        if off.max() > tolerance_rad:
            corners.add(worst)
            todo += [(a, worst), (worst, b)]
    return sorted(corners)


def _hand_over(angles: list[float], least: list[float]) -> list[float]:
    """Stretches whose angle is insignificant become straights; their angle goes to the nearest arcs."""
    arcs = [k for k, angle in enumerate(angles) if angle >= least[k]] or [int(np.argmax(angles))]
    given = [angle if k in arcs else 0.0 for k, angle in enumerate(angles)]
    for k in set(range(len(angles))) - set(arcs):
        near = min(abs(j - k) for j in arcs)
        takers = [j for j in arcs if abs(j - k) == near]
        for j in takers:
            given[j] += angles[k] / len(takers)
    return given
