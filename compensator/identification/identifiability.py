"""Why a value is not identifiable from the data, and which experiment would make it so."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tendonff.compensator.identification.fitting.tendon import longest_hold_s
from tendonff.compensator.identification.measured.cleaning import Record
from tendonff.models.parameters import Transmission
from tendonff.ocp.fits.chain import DynamicParameter

D = DynamicParameter

ADVICE = {
    D.RELAXING: "the holds show no relaxation beyond the noise; use larger steps before longer holds",
    D.RELAXATION_TIME: "the holds show no relaxation beyond the noise; use larger steps before longer holds",
    D.STIFFNESS: "the elongation does not follow the tension; check the positions' units, sign and zero drift",
    D.VISCOUS: "add faster strokes (10 times)",
    D.ADHESION: "add strokes at low tension",
    D.DAMPING: "it acts on fast changes only; add excitation above 20 Hz",
    D.BRISTLE: "add small reversals that do not reach gross sliding",
}
"""What would tell a value; friction coefficients want full strokes."""

EFFECTS = {D.VISCOUS: "adding viscous friction", D.ADHESION: "load-independent friction"}
"""Values that a law may do without, and what is then said of them."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ExcitationSummary:
    """What was measured."""

    positions: bool  # both ends' positions
    hold_s: float  # longest hold of the input tension
    speed_m_per_s: float  # usual top speed of the input end; 0 if not measured
    load_swing: float  # range of the output tension over its mean; of the input's where the output was not measured
    proximal: bool  # nothing was measured at the far end


def summarise_excitation(records: Sequence[Record]) -> ExcitationSummary:
    """What was measured in these records."""
    speeds = [
        float(np.percentile(np.abs(np.gradient(p.input_m, r.step_s)), 95))
        for r in records
        for p in r.pieces
        if p.input_m is not None
    ]
    proximal = not all(r.has_output for r in records)
    output = np.concatenate([r.joined("input_N" if proximal else "output_N") for r in records])
    return ExcitationSummary(
        positions=all(r.has_positions for r in records),
        hold_s=longest_hold_s(records),
        speed_m_per_s=max(speeds, default=0.0),
        load_swing=float(np.ptp(output) / max(abs(output.mean()), 1e-12)),
        proximal=proximal,
    )


def reason(
    name: DynamicParameter,
    now: ExcitationSummary,
    transmission: Transmission,
    relative_error: float | None = None,
    *,
    fitted: bool = False,
) -> str:
    """Why a value is not identifiable, with the way out.

    Parameters
    ----------
    relative_error : float, optional
        Standard error it has or would have, as a share of the value.
    fitted : bool, optional
        It is part of the law, and doubtful; else it does not reduce the validation error.
    """
    tau = transmission.tendon.relaxation_time_s
    known = relative_error is not None and np.isfinite(relative_error)
    doubt = _standard_error(float(relative_error or 0)) if known else ""
    if unmeasured := _unmeasured(name, now, doubt):
        return unmeasured
    if name in (D.RELAXATION_TIME, D.RELAXING) and now.hold_s < 3 * tau:
        return (
            f"no hold longer than {now.hold_s:.2g} s: {name} is not identifiable; "
            f"add a hold of 3 tau, {3 * tau:.3g} s with the scenario's tau"
        )
    if name in (D.STATIC_EXCESS, D.STRIBECK_VELOCITY):
        omega = transmission.friction.stribeck_velocity_m_per_s
        speed = f" (the input end moved at up to {now.speed_m_per_s:.2g} m/s)" if now.speed_m_per_s else ""
        useless = doubt.removesuffix("; ") if fitted else "adding a Stribeck term does not reduce the validation error"
        return (
            f"{useless}{speed}; "
            f"add strokes at speeds from {0.2 * omega:.2g} to {5 * omega:.2g} m/s, around the Stribeck velocity"
        )
    if name in (D.INPUT_BIAS, D.OUTPUT_BIAS):
        return "not separable from adhesion and the other cell's offset; read both cells with a slack tendon"
    if name in EFFECTS and not fitted:
        doubt += f"{EFFECTS[name]} does not reduce the validation error; "
    if name in ADVICE:
        return doubt + ADVICE[name]
    if now.load_swing < 0.3:
        return f"{doubt}the output tension varies too little; repeat at several loads"
    return f"{doubt}repeat with full strokes in both directions at several loads"


def _standard_error(share: float) -> str:
    return f"standard error {f'{100 * share:.3g}' if share < 10 else 'above 1000'} %; "


def _unmeasured(name: DynamicParameter, now: ExcitationSummary, doubt: str) -> str:
    """Which sensor would tell a value; empty where it is not for want of one."""
    if now.proximal and name in (D.STIFFNESS, D.OUTPUT_BIAS, D.INPUT_BIAS):
        return f"{doubt}nothing was measured at the far end; measure the output tension to tell {name}"
    if name in (D.STIFFNESS, D.RELAXING, D.RELAXATION_TIME) and not now.positions and not now.proximal:
        what = "tensions alone do not show elongation"
        return f"no positions of both ends were measured: {name} is not identifiable ({what}); measure both positions"
    return ""
