"""Whether the two tensions are what they are called: exchanged columns, a reversed sign, no friction at all."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tendonff.compensator.files.reading import InputError
from tendonff.compensator.identification.constants import TUNED
from tendonff.compensator.identification.fitting.delay import earlier
from tendonff.compensator.identification.fitting.errors import percent_of
from tendonff.compensator.identification.fitting.static import StaticModel, fit_static
from tendonff.compensator.identification.measured import Array
from tendonff.compensator.identification.measured.cleaning import Piece, Record
from tendonff.compensator.scenario.measurement import Explain, Measurement
from tendonff.ocp.fits.static import StaticParameter

P = StaticParameter

PLAY = StaticModel(name="play", free=(P.PULL, P.RELEASE))
SHIFTS_S = (-0.08, -0.04, -0.02, -0.01, 0.01, 0.02)
"""Delays of the output that could look like exchanged columns."""


def check_channels(records: Sequence[Record], how: Measurement) -> None:
    """Refuse by InputError tensions that no transmission driven at its near end can have."""
    near, far = (np.concatenate([r.joined(name) for r in records]) for name in ("input_N", "output_N"))
    correlation = float(np.corrcoef(near, far)[0, 1])
    files = ", ".join(r.name for r in records)
    if correlation < -TUNED.alike and float(near.mean() * far.mean()) < 0:
        raise InputError(
            f"{files}: {how.output_column} falls where {how.input_column} rises (correlation {correlation:.2f}): the "
            "sign of one is reversed; --scale output=-1 or --scale input=-1"
        )
    if correlation < TUNED.alike or how.explain is Explain.INPUT or any(r.signed for r in records):
        return
    own = percent_of(fit_static(records, PLAY, Explain.OUTPUT, most=15), records)
    _check_proportional(files, near, far, how, own)
    if float(np.std(far)) > float(np.std(near)):
        _check_order(files, records, how, own)


def _check_proportional(files: str, near: Array, far: Array, how: Measurement, play_percent: float) -> None:
    """An output that is a multiple of the input at every moment has no friction before it."""
    gain = float(near @ far / (near @ near))
    percent = 100 * float(np.sqrt(np.mean((far - gain * near) ** 2)) / np.ptp(far))
    if abs(gain - 1) > TUNED.gain_off and percent < min(
        TUNED.proportional_percent, TUNED.other_channel_below * play_percent
    ):
        raise InputError(
            f"{files}: {how.output_column} is {gain:.3g} times {how.input_column} at every moment (to {percent:.2g} % "
            "of range): friction would open a loop between them; check whether both columns are of one cell, and their "
            "gains with a slack and a loaded tendon at rest"
        )


def _check_order(files: str, records: Sequence[Record], how: Measurement, own_percent: float) -> None:
    """The tension that moves more, and earlier, is the input's."""
    exchanged = [_exchanged(r) for r in records]
    other = percent_of(fit_static(exchanged, PLAY, Explain.OUTPUT, most=15), exchanged)
    if other > TUNED.other_channel_below * own_percent:
        return
    for shift_s in SHIFTS_S:
        shifted = [earlier(r, shift_s) for r in records]
        if other > TUNED.other_channel_below * percent_of(fit_static(shifted, PLAY, Explain.OUTPUT, most=10), shifted):
            return  # a delay explains it as well
    raise InputError(
        f"{files}: {how.output_column} explains {how.input_column} ({other:.2g} % of range), not conversely "
        f"({own_percent:.2g} %): the columns are exchanged, or the tendon is driven at its far end; "
        f"--input-column {how.output_column} --output-column {how.input_column}"
    )


def _exchanged(record: Record) -> Record:
    def turned(piece: Piece) -> Piece:
        return replace(piece, input_N=piece.output_N, output_N=piece.input_N)

    return replace(record, pieces=tuple(turned(piece) for piece in record.pieces))
