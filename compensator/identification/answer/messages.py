"""Messages beside the estimates: on the files, the law, and the limits of the result."""

from collections.abc import Sequence

import numpy as np

from tendonff.compensator.files.notices import Remark
from tendonff.compensator.identification.answer.records import ELONGATION, CandidateLaw, Channel
from tendonff.compensator.identification.fitting.delay import Delay
from tendonff.compensator.identification.fitting.dynamic import DynamicFit
from tendonff.compensator.identification.fitting.sliding import SlidingRatio
from tendonff.compensator.identification.fitting.tendon import stretches_within
from tendonff.compensator.identification.measured.cleaning import Record
from tendonff.compensator.identification.measured.reading import DataIssue
from tendonff.compensator.identification.outcome import Fitted, Outcome
from tendonff.compensator.identification.parameters import Parameter
from tendonff.compensator.scenario.measurement import Explain
from tendonff.ocp.fits.static import StaticParameter

P, D = StaticParameter, Parameter

MOST_ALIKE = 3
"""So many files may each have a line about the same kind of data issue."""

_TREATED = (
    *(DataIssue.LONG, DataIssue.MISSING, DataIssue.DUPLICATE, DataIssue.OUT_OF_ORDER, DataIssue.GAP),
    *(DataIssue.SPIKE, DataIssue.ONSET, DataIssue.UNITS, DataIssue.DATES),
)
"""Findings after whose treatment the file is as good as another."""

MOST_MOMENTS = 5

STILL_SHARE, MOVED_SHARE = 0.01, 0.05
"""The law holds the output while it changes by less than the first share of the range; the measured output moves when
it changes by more than the second."""

LEAST_S = 0.1


def moved_inside(channels: Sequence[Channel]) -> list[tuple[str, float]]:
    """File and time [s] of every stretch in which the measured output moves while the law holds it."""
    found = []
    for channel in channels:
        span = float(np.ptp(channel.measured))
        for start, stop in stretches_within(channel.model, STILL_SHARE * span):
            time, measured = channel.time_s[start:stop], channel.measured[start:stop]
            if time[-1] - time[0] >= LEAST_S and float(np.ptp(measured)) > MOVED_SHARE * span:
                row = int(np.argmax(np.abs(measured - measured[0]) > MOVED_SHARE * span / 2))
                found.append((channel.file, float(time[row])))
    return found


def about_delay(delay: Delay | None) -> str:
    """Message where one channel is read later than the other; empty where none is."""
    if delay is None or not delay.identified:
        return ""
    return (
        f"the output is read {1e3 * abs(delay.seconds):.3g} ms {'later' if delay.seconds > 0 else 'earlier'} than the "
        f"input (+-{1e3 * delay.error_s:.2g} ms), which was taken out before the fit: log both with one clock"
    )


def about_uneven_path(chain: DynamicFit | None, theta: float) -> str:
    """Message where the elongation fits an uneven path better; empty where it does not."""
    if chain is None or chain.concentration == 0:
        return ""
    near = float(np.clip((1 + chain.concentration) / 2, 0, 1))
    return (
        f"the elongation fits better where the half of the path next to the actuator has {near * theta:.3g} of the "
        f"{theta:.3g} rad: the tendon's stiffness and relaxation are doubtful; give the path in [[path.sections]] with "
        "angle_rad and length_m"
    )


def about_other_law(chain: DynamicFit | None, records: Sequence[Record]) -> str:
    """Message where load-independent friction and friction that falls with the load explain the files alike."""
    if chain is None or chain.other is None:
        return ""
    adhesion_N, exponent = (
        next(values[name] for values in (chain.values, chain.other) if values[name] > 0)
        for name in (D.ADHESION, D.LOAD_EXPONENT)
    )
    name = "input_N" if chain.explain is Explain.POSITION else "output_N"
    tension = np.concatenate([r.joined(name) for r in records])
    which = "first" if chain.values[D.ADHESION] else "second"
    return (
        f"load-independent friction of {adhesion_N:.2g} N and friction that falls as T^-{exponent:.2g} explain these "
        f"files alike: fitted.toml has the {which}, a design counts both ([robust.other_law]); they differ outside "
        f"{tension.min():.3g} to {tension.max():.3g} N, the tensions of these files: log strokes beyond (--suggest)"
    )


def about_moments(outcome: Outcome) -> str:
    """Moments at which the output moved although the law holds it; empty without any."""
    moments = moved_inside([channel for channel in outcome.channels if channel.figure != ELONGATION])
    if not moments:
        return ""
    shown = ", ".join(f"{name} {time:.4g} s" for name, time in moments[:MOST_MOMENTS])
    more = " ..." if len(moments) > MOST_MOMENTS else ""
    return (
        f"the output moves inside the deadband {len(moments)} times ({shown}{more}): was the far end touched or moved "
        "there? Leave these times out, or hold it"
    )


def about_issues(records: Sequence[Record]) -> list[str]:
    """Findings in the files, one line each; a kind common to many files takes one line for all of them.

    Those that were treated for good ask for no action.
    """
    lines: list[str] = []
    for issue in DataIssue:
        found = [(r.name, f.text) for r in records for f in r.findings if f.issue is issue]
        if issue is DataIssue.SKIPPED or not found:
            continue
        files = len({name for name, _ in found})
        kind = Remark if issue in _TREATED else str
        if files <= MOST_ALIKE:
            lines += [kind(f"{name}: {text}") for name, text in found]
        else:
            name, text = found[0]
            said = text.removeprefix(f"{issue}: ")
            lines.append(kind(f"{issue} in {files} files; {name}: {said} (the others are in fit.json)"))
    return lines


def about_no_law(
    laws: Sequence[CandidateLaw], failure: str, sliding: Sequence[SlidingRatio], records: Sequence[Record]
) -> str:
    """Why nothing was taken over, and what the files tell all the same."""
    best = next(law.name for law in laws if law.chosen)
    shown = [
        f"{g.branch} {g.log_ratio:.3g} ({g.interval[0]:.3g} to {g.interval[1]:.3g})"
        for g in sliding
        if g.log_ratio is not None and g.interval is not None
    ]
    ratios = f"; ln(T_in/T_out) in gross sliding: {', '.join(shown)}" if shown else ""
    return (
        f"no law explains these files: the best, {best}, has {failure}. A transmission driven at its near end "
        "alone behaves differently: is the far end, or the path itself, driven, or the loop pre-tensioned? No value "
        f"was taken over into the fitted scenario{ratios}{_positions_wanted(records)}"
    )


def about_fitted(fitted: Fitted, records: Sequence[Record], with_offsets_percent: float) -> list[str]:
    """Parts of the law that a design, or some of its profiles, do not include."""
    found = []
    if fitted.chain_percent is not None:
        found.append(
            "the law is static, and [friction] of fitted.toml has all of it; the chain of the same values leaves "
            f"{fitted.chain_percent:.2f} % of range on these files"
        )
    places = [each.spec.key.partition(".") for each in P]
    kept = [key for table, _, key in places if table == "measurement" and getattr(fitted.scenario.measurement, key)]
    if kept:
        found.append(
            f"{', '.join(kept)} of this law are kept in [measurement] of fitted.toml; they are no part of a design"
        )
    if any(fitted.offsets_N):
        shown = ", ".join(f"{end} {v:.4g} N" for end, v in zip(("input", "output"), fitted.offsets_N, strict=True) if v)
        if fitted.doubtful:
            place = "which does not stand out from its doubt: fitted.toml does not have it; zero the cells when slack"
        elif any(r.zeroed for r in records):
            place = "beyond what was taken off; a design with fitted.toml does not have it"
        else:
            place = "kept in [measurement] of fitted.toml for reading files; it is no part of a design"
        found.append(
            f"the cells' readings without tension (input_offset_N, output_offset_N): {shown}, {place}; with them the "
            f"law has an RMS error of {with_offsets_percent:.2g} %"
        )
    return found


def _positions_wanted(records: Sequence[Record]) -> str:
    """Columns needed to fit a law for a driven output, where it was not."""
    if all(r.has_input_position for r in records):
        return ""
    unread = sorted({name for r in records for name in r.unread})
    offered = f" (columns not read: {', '.join(unread)})" if unread else ""
    return (
        "; laws for a driven output need the motion of the near end, which was not read: name it with "
        f"--input-position-column{offered}"
    )
