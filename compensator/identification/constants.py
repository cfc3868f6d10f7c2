"""The tuned constants of identification, all in one record, with where each comes from.

Sources: *rigs* are the simulated ones of `benchmarks/identify.py` and `benchmarks/identify_short.py`, *recordings* the
measured friction loops that the tests read; *method* follows from the numerical method, *rule* is a convention.

Named where they are used instead, with their reasons: what is doubted or mended before a fit (`measured`), plans of
excitations (`suggest`, `motors.routine`, `motors.loop_routine`), and searches of the mechanism of a joint (`motors`).
Without a name are sizes of figures, conversions, starts and tolerances of one search, and guards against round-off.
"""

import math
from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class Tuned:
    """Constants of the fits and of what is said about them.

    Parameters
    ----------
    coarse_masses, fine_masses : int
        Masses of the chain while laws are compared, and at the end (method: discretisation error below 0.1 %).
    coarse_step_s, fine_step_s : float
        Longest steps of the same; the samples are thinned to the first (method).
    robust_share, static_robust_share : float
        Residuals of the chain, and of the static laws, beyond this share of the range count linearly (recordings:
        outliers; the static laws leave presliding out).
    blocks, longest_block_s : float
        Rows are taken as independent by so many blocks, none longer than that (rigs: coverage; friction carries an
        error on until the next sweep).
    static_blocks : int
        The same for the static laws, whose errors end at the next reversal (rigs).
    folds : int
        Held-out parts of the record, in turn (rule).
    bristle_starts, mu_starts : tuple of float
        Starts of the first fit, as factors of the scenario's values (rigs).
    exponent_starts, release_starts : tuple of float
        Starts of the static laws' mu theta, and releasing as shares of pulling (rigs).
    poor_percent : float
        A law with a larger RMS error, in % of range, does not describe the device (recordings: a band brake leaves 15,
        the worst tendon 6).
    small_share : float
        A file whose error is below this share of the common range is described, however little it moves (rule).
    simpler_within : float
        The simplest law whose validation error is within this factor of the least is chosen (rule).
    nearly_as_good : float
        What laws within this factor of the least validation error state is doubt of the chosen one's answer; an answer
        whose error grows by more while the noise of the input is taken out is not taken; a speed term lowers the
        validation error by more, or `slightly` where the fit error falls by more (rigs without a Stribeck effect).
    decisive : float
        One of two laws with as many values is the better one where its misfit, with the input estimated, is less by so
        much (rigs: where both are nearly alike the misfits differ by up to 60, where they are not by 250 at least).
    other_channel_below : float
        The other channel is explained instead, or columns count as exchanged or proportional, where the error falls
        below this share (recordings).
    alike : float
        Correlation of the two ends of a tendon (recordings: 0.8 and more).
    gain_off, proportional_percent : float
        An output that is the input times a gain so far from 1, to this error in % of its range, has no friction before
        it (rule).
    slightly : float
        A law whose validation error is lower by this factor is a little better (rigs).
    worth_a_constant : float
        Gain of Bayes' criterion, or logarithm of the evidence, from which on a constant is taken up or an uneven path
        is reported (rigs without adhesion stay below).
    sure, very_sure : float
        Standard errors from nothing: of a speed term, adhesion or a difference of directions, and of an offset or a
        delay of tensions, which systematic errors imitate (rigs).
    sure_of_positions : float
        The same of a delay of tension and position; the errors that are stated of it are five times the scatter (rigs).
    symmetric_share : float
        One coefficient holds for both directions where their difference is known to this share (rigs).
    identifiable_share : float
        Standard error over value from which on a value counts as not identifiable (rule).
    insensitive_share : float
        A standard error of so many times the value is none: the data are insensitive to the value (rule).
    twins : float
        Correlation from which on two values are not separately identifiable (rule).
    large_errors_percentile : float
        This percentile of its errors is what a law without presliding leaves in a constant (rigs).
    forget_share, forget_most, forget_bridge : float
        Samples before the input has swept this share of its range are not fitted, at most the second share of a piece;
        the third is the share after a bridge (method: friction remembers extremes).
    small_piece : float
        Least range that counts, as a share of the widest file's (method: small moves may stay in presliding).
    other_laws : float
        Share of the variance between laws with one more effect that is doubt of the chosen one (rigs: coverage).
    granted : float
        What is taken for granted, a gain or a kept value, counts with so many times its half-width: the answer bends
        (rigs that are off by just that half-width).
    adhesion_floor : float
        Standard error of the method for adhesion and offsets, as a share of the mean output tension (rigs).
    tried_concentration : float
        Excess of wrap angle on the near half of the path that is tried (method: a difference quotient).
    least_files : int
        Files, or strokes, that show a scatter between them (rule).
    kept_uncertainty : float
        Half-width of the 95 % interval of the tendon's stiffness and relaxation where they are kept and nothing is said
        of them (rule: rated values of fibres).
    scatter_share : float
        Scatter between files from which on it is reported (rule).
    hold_share : float
        A hold: the tension stays within this share of its range (rule).
    least_delay_steps, most_delay_s, most_delay_share : float
        A delay between the channels is at least so many samples, and at most this long and this share of the record
        (rule: a logger).
    knot_s, least_knot_rows, window_knots : float
        Distance of the input's knots, and of samples on which starts are compared, the knots' least number of samples,
        knots of a window; half of them again before it (method).
    widest_correction : float
        A correction of the input where nothing was read, as behind a gap: usually so many times the noise (method).
    misfit_share : float
        A sample is worth the noise of its cell and this share of what the fit has left (rigs: no model is exact).
    large_residual : float
        Residuals of more than so many times their usual size count linearly there (method).
    least_step_share : float
        A step leaves at least this share of a value that must stay positive (method).
    rounds : int
        Most Gauss-Newton steps of one kind: for a delay, and with the input estimated (rigs: the first is nearly all).
    visited_percentiles : tuple of float
        Slow and fast end of the speeds that were visited, of those while the near end moves (rule).
    on_bound, most_ratio : float
        A value this near to its bound, in usual steps, is on it; Gauss-Newton steps that shrink by less are given up
        (method).
    slipped_share, nearly_all : float
        By section: the path slips once the far tension has moved by the first share of its range since its last
        reversal, until it has moved by the second share of the stroke (rigs).
    least_good : float
        Share of a stroke that a cell must have measured: the ratio is the same all along it (rule).
    section_floor : float
        Standard error of the method as a share of a section's coefficient: bristles fill up without end (rigs).
    least_drive_rows, drive_gap, gear_below : float
        Rows that a motor needs; usual steps without a sample that part them; share of the cost below which a gear
        explains the friction better (rule).
    fast_share, travel_share, least_sliding_rows, most_refused : float
        Gross sliding: faster than a share of the usual top speed, further from the reversal than a share of the stroke,
        in so many samples, of which so many may be at or below zero (recordings).
    """

    coarse_masses: int = 8
    fine_masses: int = 30
    coarse_step_s: float = 5e-3
    fine_step_s: float = 1e-3
    robust_share: float = 0.02
    static_robust_share: float = 0.03
    blocks: int = 20
    longest_block_s: float = 10.0
    static_blocks: int = 60
    folds: int = 5
    bristle_starts: tuple[float, ...] = (0.1, 1.0, 10.0)
    mu_starts: tuple[float, ...] = (0.4, 1.0, 2.0)
    exponent_starts: tuple[float, ...] = (0.02, 0.1, 0.3, 0.6, 0.9, 1.2, 1.8, 2.5, 4.0)
    release_starts: tuple[float, ...] = (1.0, 0.85, 0.7, 0.5)
    poor_percent: float = 10.0
    small_share: float = 0.03
    simpler_within: float = 1.02
    nearly_as_good: float = 1.4
    decisive: float = 100.0
    other_channel_below: float = 0.5
    alike: float = 0.5
    gain_off: float = 0.02
    proportional_percent: float = 3.0
    slightly: float = 1.1
    worth_a_constant: float = 4.0
    sure: float = 2.0
    very_sure: float = 4.0
    sure_of_positions: float = 1.0
    symmetric_share: float = 0.01
    identifiable_share: float = 0.35
    insensitive_share: float = 1e3
    twins: float = 0.985
    large_errors_percentile: float = 95.0
    forget_share: float = 0.6
    forget_most: float = 0.3
    forget_bridge: float = 0.85
    small_piece: float = 0.5
    adhesion_floor: float = 0.0003
    other_laws: float = 0.25
    granted: float = 1.2
    tried_concentration: float = 0.3
    least_files: int = 3
    kept_uncertainty: float = 0.5
    scatter_share: float = 0.02
    hold_share: float = 0.02
    least_delay_steps: float = 0.1
    most_delay_s: float = 0.1
    most_delay_share: float = 0.1
    knot_s: float = 0.05
    least_knot_rows: int = 4
    window_knots: int = 200
    widest_correction: float = 30.0
    misfit_share: float = 0.25
    large_residual: float = 3.0
    least_step_share: float = 0.5
    rounds: int = 3
    visited_percentiles: tuple[float, float] = (2.0, 98.0)
    on_bound: float = 1e-3
    most_ratio: float = 0.5
    slipped_share: float = 0.3
    nearly_all: float = 0.95
    least_good: float = 0.5
    section_floor: float = 0.01
    least_drive_rows: int = 100
    drive_gap: float = 5.0
    gear_below: float = 0.8
    fast_share: float = 0.5
    travel_share: float = 0.4
    least_sliding_rows: int = 50
    most_refused: float = 0.05


TUNED = Tuned()

TORQUE_CONSTANT_SHARE = 0.1
"""Half of the 95 % interval of a motor's torque constant, a share (rule: of data sheets; warm magnets are weaker)."""

_TWO_SIDED = 1.96  # 95 % of a normal distribution, in standard deviations


def with_torque_constant(value: float, error: float, reach: float) -> tuple[float, float]:
    """Standard error and half of the 95 % interval of a force by a motor, its torque constant counted.

    `error` is that of the fit, `reach` the half of its interval in standard errors.
    """
    constant = TORQUE_CONSTANT_SHARE * value
    return math.hypot(error, constant / _TWO_SIDED), math.hypot(reach * error, constant)
