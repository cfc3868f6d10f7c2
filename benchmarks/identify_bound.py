"""Cramer-Rao bound of a rig's values from its logs.

All values are free, the output cell, both positions and the input cell have the rig's noise, and the true input is free
at knots 0.04 s apart: it is known through its cell, and through what output and elongation say of it. Gaps and spikes
are left out, which makes the bound a little low.
"""

from collections.abc import Sequence

import numpy as np
from independent_plant import Array

from tendonff.compensator.identification.fitting.parametric_chain import ParametricChain
from tendonff.compensator.identification.parameters import CORE, TENDON, Parameter
from tendonff.models.fidelity import Level
from tendonff.models.parameters import Transmission
from tendonff.ocp.fits.chain import Drive, input_windows

NAMES = (*CORE, *TENDON, Parameter.ADHESION)
MASSES, STEP_S, KNOT_S, WINDOW_S, BEFORE_S = 8, 5e-3, 0.04, 20.0, 5.0


def bounds(truth: Transmission, noise: float, logs: Sequence[Array], sample_s: float) -> dict[str, float]:
    """Least standard errors by name, from logs without noise of the plant's four channels."""
    information = sum(_information(truth, noise, log, sample_s) for log in logs)
    scale = np.sqrt(np.diag(information))
    return dict(
        zip(map(str, NAMES), np.sqrt(np.diag(np.linalg.inv(information / np.outer(scale, scale)))) / scale, strict=True)
    )


def _information(truth: Transmission, noise: float, log: Array, sample_s: float) -> Array:
    """Fisher's information over the values, the input eliminated."""
    thin = round(STEP_S / sample_s)
    input_noise, output_noise, near, far = noise * np.ptp(log, axis=0) / np.sqrt(thin)
    model = ParametricChain(transmission=truth, level=Level.PRESLIDING, count=MASSES, longest_step_s=STEP_S)
    values = model.values()
    drive = Drive(input_N=log[::thin, 0], step_s=STEP_S, first_output_N=float(log[0, 1]))
    response = model.predict(values, drive, NAMES)
    moved = response.elongation_slopes - response.elongation_slopes.mean(axis=0)
    information = np.zeros((len(NAMES), len(NAMES)))
    for window in input_windows(
        model, model.numbers_of(values), drive, knot_s=KNOT_S, window_s=WINDOW_S, before_s=BEFORE_S
    ):
        first = int(np.searchsorted(window.time_s, max(window.first_s, 0.0)))
        rows = np.rint(window.time_s[first:] / STEP_S).astype(int).clip(max=len(drive.input_N) - 1)
        own = np.vstack([response.output_slopes[rows] / output_noise, moved[rows] / np.hypot(near, far)])
        elongation = window.elongation_slopes[first:]
        hats = np.array(
            [np.interp(window.time_s[first:], window.knots_s, unit) for unit in np.eye(len(window.knots_s))]
        )
        knots = np.vstack(
            [window.output_slopes[first:] / output_noise, elongation / np.hypot(near, far), hats.T / input_noise]
        )
        own = np.vstack([own, np.zeros((len(rows), len(NAMES)))])
        inner = knots.T @ knots
        inner[np.diag_indices(len(inner))] += 1e-9 * inner.diagonal().max()
        cross = knots.T @ own
        information += own.T @ own - cross.T @ np.linalg.solve(inner, cross)
    return information
