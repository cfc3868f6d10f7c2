"""Dry friction of the drive from measured files that hold its force beside the tension and the position at its end."""

import itertools
from collections.abc import Sequence

import numpy as np

from tendonff.compensator.identification.answer.result import Estimate, is_known
from tendonff.compensator.identification.constants import TUNED
from tendonff.compensator.identification.measured.reading import RawMeasurement
from tendonff.compensator.identification.measured.smoothing import find_cutoff_Hz, low_pass_piece, noise_of
from tendonff.compensator.scenario.scenario import Scenario
from tendonff.models.fidelity import Level
from tendonff.ocp.errors import SolveError
from tendonff.ocp.fits.drive import COULOMB, DAMPING, OFFSET, DriveRun, bristle_force, fit_drive

_LEAST_ROWS = 100
_GAP = 5.0  # usual steps without a sample


def drive_estimate(scenario: Scenario, raw: Sequence[RawMeasurement]) -> Estimate | None:
    """The drive's coulomb_N; None where no file holds the force of the actuator."""
    own = scenario.transmission.actuator.coulomb_N or 0.0
    given = [one for one in raw if one.actuator_N is not None]
    if not given:
        return None
    if any(one.input_m is None for one in given):
        return _kept(own, "the position of the input end was not read; name it with --input-position-column")
    runs, noise_N = _smoothed(given)
    if not runs:
        return _kept(own, f"fewer than {_LEAST_ROWS} samples without a gap; log longer")
    bristle = scenario.transmission.friction.bristle_stiffness_N_per_m
    if scenario.run.level is Level.PRESLIDING:
        bristle = scenario.transmission.friction.soft_bristle_stiffness_N_per_m
    differences = np.concatenate([run.force_N - run.tension_N for run in runs])
    start = max(0.5 * float(np.subtract(*np.percentile(differences, [90, 10]))), 1e-3)
    try:
        found = fit_drive(runs, scenario.transmission.actuator.mass_kg, bristle, start, noise_N)
    except SolveError as error:
        return _kept(own, f"no fit: {error}")
    value, error_N = found.values[COULOMB], found.standard_error(COULOMB)
    low, high = found.interval(COULOMB)
    left = noise_N * float(np.sqrt(np.mean(found.residuals.values**2)))
    reach = [np.ptp(bristle_force(run.position_m, value, bristle)[0]) for run in runs]
    if not np.isfinite(error_N) or max(reach) < 1.8 * value:
        return _kept(own, "the drive never slides in both directions; add full strokes with reversals")
    identifiable = is_known(error_N, value) and left < TUNED.identifiable_share * value
    why = (
        f"force of the drive less the tension at its end, with a damping of {found.values[DAMPING]:.3g} N s/m and an "
        f"offset of {found.values[OFFSET]:.3g} N; residual {left:.2g} N RMS"
    )
    if not identifiable:
        why = f"{why}, too much to tell {value:.3g} N: check the force's scale and the actuator's mass_kg"
    return Estimate(
        name=COULOMB,
        value=value if identifiable else own,
        standard_error=error_N,
        interval=(max(low, 0.0), high),
        identifiable=identifiable,
        why=why,
        scenario=own,
        fitted=identifiable,
    )


def _kept(own_N: float, why: str) -> Estimate:
    return Estimate(name=COULOMB, value=own_N, why=why, scenario=own_N)


def _smoothed(raw: Sequence[RawMeasurement]) -> tuple[list[DriveRun], float]:
    """Pieces without gaps, evenly sampled, all channels through one low-pass; and the noise of the forces [N]."""
    runs, noise = [], [1e-3]
    for one in raw:
        step = float(np.median(np.diff(one.time_s)))
        cuts = {0, len(one.time_s), *one.breaks, *(np.flatnonzero(np.diff(one.time_s) > _GAP * step) + 1).tolist()}
        borders = sorted(cuts)
        for first, last in itertools.pairwise(borders):
            if last - first < _LEAST_ROWS or one.actuator_N is None or one.input_m is None:
                continue
            time = one.time_s[first:last]
            even = np.arange(time[0], time[-1], step)
            read = [np.interp(even, time, x[first:last]) for x in (one.actuator_N, one.input_N, one.input_m)]
            noise.append(noise_of(read[0] - read[1]))
            cutoff = find_cutoff_Hz(read, step)
            force, tension, position = (low_pass_piece(x, step, cutoff) for x in read)
            runs.append(DriveRun(step_s=step, force_N=force, tension_N=tension, position_m=position))
    return runs, max(noise)
