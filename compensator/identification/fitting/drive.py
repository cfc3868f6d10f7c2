"""Dry friction of the drive from measured files that hold its force beside the tension and the position at its end."""

import itertools
from collections.abc import Sequence

import numpy as np

from tendonff.compensator.identification.answer.estimate import Estimate, is_known
from tendonff.compensator.identification.constants import TUNED
from tendonff.compensator.identification.measured.reading import RawMeasurement
from tendonff.compensator.identification.measured.smoothing import find_cutoff_Hz, low_pass_piece, noise_of
from tendonff.compensator.scenario.scenario import Scenario
from tendonff.models.fidelity import Level
from tendonff.models.gear import DriveLaw
from tendonff.models.parameters import Actuator
from tendonff.ocp.errors import SolveError
from tendonff.ocp.fits.drive import COULOMB, DAMPING, LOST, OFFSET, DriveRun, bristle_force, fit_drive
from tendonff.ocp.fits.least_squares import Solution

EFFICIENCY = "gear_efficiency"


def drive_estimates(scenario: Scenario, raw: Sequence[RawMeasurement]) -> tuple[Estimate, ...]:
    """The drive's coulomb_N, and gear_efficiency where the scenario states one or the data want another.

    Empty where no file holds the force of the actuator.
    """
    actuator = scenario.transmission.actuator
    own = actuator.coulomb_N or 0.0
    given = [one for one in raw if one.actuator_N is not None]
    if not given:
        return ()
    if any(one.input_m is None for one in given):
        return _kept(actuator, "the position of the near end was not read; name it with --input-position-column")
    runs, noise_N = _smoothed(given)
    if not runs:
        return _kept(actuator, f"fewer than {TUNED.least_drive_rows} samples without a gap; log longer")
    bristle = scenario.transmission.friction.bristle_stiffness_N_per_m
    if scenario.run.level is Level.PRESLIDING:
        bristle = scenario.transmission.friction.soft_bristle_stiffness_N_per_m
    differences = np.concatenate([run.force_N - run.tension_N for run in runs])
    share = actuator.law.lost_share
    start = DriveLaw(
        coulomb_N=max(0.5 * float(np.subtract(*np.percentile(differences, [90, 10]))), 1e-3), lost_share=share
    )
    try:
        found = fit_drive(runs, actuator.mass_kg, bristle, start, noise_N)
        geared = fit_drive(runs, actuator.mass_kg, bristle, start, noise_N, with_gear=True)
    except SolveError as error:
        return _kept(actuator, f"no fit: {error}")
    least, most = geared.interval(LOST)
    another = bool(np.isfinite(least) and not least <= share <= most and geared.cost < TUNED.gear_below * found.cost)
    found = geared if another else found
    law = DriveLaw(coulomb_N=found.values[COULOMB], lost_share=found.values.get(LOST, share))
    value, error_N = law.coulomb_N, found.standard_error(COULOMB)
    low, high = found.interval(COULOMB)
    left = noise_N * float(np.sqrt(np.mean(found.residuals.values**2)))
    usual = [max(float(np.median(law.slip_N(run.tension_N))), 1e-12) for run in runs]
    reach = [np.ptp(bristle_force(run, law, bristle)[0]) for run in runs]
    if not np.isfinite(error_N) or max(np.divide(reach, usual)) < 1.8:
        return _kept(actuator, "the drive never slides in both directions; add full strokes with reversals")
    size = max(usual)  # of the whole friction: beside a gear its constant part may be small
    identifiable = is_known(error_N, size) and left < TUNED.identifiable_share * size
    why = (
        f"force of the drive less the tension at its end, with a damping of {found.values[DAMPING]:.3g} N s/m and an "
        f"offset of {found.values[OFFSET]:.3g} N; residual {left:.2g} N RMS"
    )
    if not identifiable:
        why = f"{why}, too much to tell {value:.3g} N: check the force's scale and the actuator's mass_kg"
    dry = Estimate(
        name=COULOMB,
        value=value if identifiable else own,
        standard_error=error_N,
        interval=(max(low, 0.0), high),
        identifiable=identifiable,
        why=why,
        scenario=own,
        fitted=identifiable,
    )
    return (dry, *_efficiency(actuator, geared, fitted=another))


def _efficiency(actuator: Actuator, geared: Solution, *, fitted: bool) -> tuple[Estimate, ...]:
    """The gear's efficiency, where the data want another than the scenario's or it is stated."""
    stated = actuator.gear_efficiency
    if not fitted and stated is None:
        return ()
    low, high = geared.interval(LOST)
    known = is_known(geared.standard_error(LOST), 1.0)
    return (
        Estimate(
            name=EFFICIENCY,
            value=1 - geared.values[LOST] if fitted else stated or 1.0,
            standard_error=geared.standard_error(LOST),
            interval=(max(1 - high, 0.0), min(1 - low, 1.0)),
            identifiable=known,
            why="friction of the drive grows with the tension"
            if known
            else "the tension hardly changes while the drive slides; add strokes at two loads",
            scenario=1.0 if stated is None else stated,
            fitted=fitted,
        ),
    )


def _kept(actuator: Actuator, why: str) -> tuple[Estimate, ...]:
    """The scenario's own values."""
    own = actuator.coulomb_N or 0.0
    found = [Estimate(name=COULOMB, value=own, why=why, scenario=own)]
    if actuator.gear_efficiency is not None:
        found.append(
            Estimate(name=EFFICIENCY, value=actuator.gear_efficiency, why=why, scenario=actuator.gear_efficiency)
        )
    return tuple(found)


def _smoothed(raw: Sequence[RawMeasurement]) -> tuple[list[DriveRun], float]:
    """Pieces without gaps, evenly sampled, all channels through one low-pass; and the noise of the forces [N]."""
    runs, noise = [], [1e-3]
    for one in raw:
        step = float(np.median(np.diff(one.time_s)))
        cuts = {
            0,
            len(one.time_s),
            *one.breaks,
            *(np.flatnonzero(np.diff(one.time_s) > TUNED.drive_gap * step) + 1).tolist(),
        }
        borders = sorted(cuts)
        for first, last in itertools.pairwise(borders):
            if last - first < TUNED.least_drive_rows or one.actuator_N is None or one.input_m is None:
                continue
            time = one.time_s[first:last]
            even = np.arange(time[0], time[-1], step)
            read = [np.interp(even, time, x[first:last]) for x in (one.actuator_N, one.input_N, one.input_m)]
            noise.append(noise_of(read[0] - read[1]))
            cutoff = find_cutoff_Hz(read, step)
            force, tension, position = (low_pass_piece(x, step, cutoff) for x in read)
            runs.append(DriveRun(step_s=step, force_N=force, tension_N=tension, position_m=position))
    return runs, max(noise)
