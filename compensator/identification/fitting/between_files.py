"""What several files say about each other: estimates by file, their scatter, a drift over time, and conditions."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from tendonff.compensator.identification.fitting.dynamic import DynamicFit
from tendonff.compensator.identification.fitting.per_file import LEAST_FILES, scatter_of
from tendonff.compensator.identification.measured.cleaning import Record
from tendonff.ocp.fits.chain import DynamicParameter

D = DynamicParameter

WORTH_TELLING = 0.02
"""Scatter between files from which on it is told, as a share of the value."""

SURE_OF_DRIFT = 3.0
OFTEN_ASKED = (D.MU_PULL, D.MU_RELEASE, D.ADHESION, D.BRISTLE, D.STIFFNESS)


@dataclass(frozen=True, slots=True, kw_only=True)
class ByFile:
    """What one file alone says."""

    # file, condition: name, and the label it was given; empty without one
    file: str
    condition: str
    started_s: float | None  # start of the file by its own clock, where that tells dates [s]
    # values, errors: estimates and standard errors by name
    values: dict[str, float]
    errors: dict[str, float]


def by_file(
    chain: DynamicFit | None, records: Sequence[Record], conditions: Mapping[str, str]
) -> tuple[tuple[ByFile, ...], list[str]]:
    """Estimates by file, and what is to be said about their differences.

    Parameters
    ----------
    conditions : mapping of str to str
        Labels by file name.
    """
    if chain is None or not chain.files:
        return (), []
    started = {r.name: r.started_s for r in records}
    rows = tuple(
        ByFile(
            file=e.file,
            condition=conditions.get(e.file, ""),
            started_s=started.get(e.file),
            values={_name(k): v for k, v in e.values.items() if np.isfinite(e.errors[k])},
            errors={_name(k): v for k, v in e.errors.items() if np.isfinite(v)},
        )
        for e in chain.files
    )
    said = []
    for name in OFTEN_ASKED:
        scatter, value = scatter_of(chain.files, name), abs(chain.values[name])
        if value > 0 and scatter > WORTH_TELLING * value:
            said.append(
                f"{_name(name)} differs between files beyond its errors: scatter {100 * scatter / value:.2g} % "
                "(estimates by file are in fit.json); the intervals take it into account"
            )
        said += _drift(rows, _name(name))
        said += _conditions(rows, _name(name))
    return rows, said


def _name(parameter: DynamicParameter) -> str:
    return "soft_bristle_stiffness_N_per_m" if parameter is D.BRISTLE else str(parameter)


def _drift(rows: Sequence[ByFile], name: str) -> list[str]:
    """A trend over the files' own time stamps."""
    points = [
        (r.started_s / 3600, r.values[name], r.errors[name])
        for r in rows
        if r.started_s is not None and name in r.values and r.errors[name] > 0
    ]
    if len(points) < LEAST_FILES:
        return []
    hours, values, errors = (np.array(x) for x in zip(*points, strict=True))
    hours = hours - hours.mean()
    if float(np.ptp(hours)) == 0:
        return []
    weight = 1 / errors**2
    centre = float((weight * hours).sum() / weight.sum())
    spread = float((weight * (hours - centre) ** 2).sum())
    slope = float((weight * (hours - centre) * values).sum()) / spread
    left = values - values.mean() - slope * (hours - centre)
    error = np.sqrt(max(1.0, float((weight * left**2).sum()) / (len(values) - 2)) / spread)
    if abs(slope) <= SURE_OF_DRIFT * error:
        return []
    scale = 100 / abs(float(values.mean()))
    return [f"{name} drifts by {scale * slope:+.2g} % an hour over these files (standard error {scale * error:.2g} %)"]


def _conditions(rows: Sequence[ByFile], name: str) -> list[str]:
    """Means by condition, where there are several."""
    labels = list(dict.fromkeys(r.condition for r in rows if r.condition and name in r.values))
    if len(labels) < 2:
        return []
    means = []
    for label in labels:
        some = [(r.values[name], r.errors[name]) for r in rows if r.condition == label and name in r.values]
        values, errors = (np.array(x) for x in zip(*some, strict=True))
        weight = 1 / np.maximum(errors, 1e-300) ** 2
        means.append(f"{label} {float((weight * values).sum() / weight.sum()):.4g} +- {1 / np.sqrt(weight.sum()):.2g}")
    return [f"{name} by condition: {', '.join(means)}"]
