"""Errors of the exported modules on the scenario's reference, against the reference applied directly."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from tendonff.compensator.compensators.base import CModule, Problem, with_travel
from tendonff.compensator.compensators.plant import Plant
from tendonff.compensator.compensators.profile import Profile
from tendonff.compensator.compensators.registry import compensator
from tendonff.compensator.compensators.score import Score, is_worse, verify
from tendonff.compensator.compensators.stream import StreamChoice, stream_candidate
from tendonff.compensator.compensators.table import BuiltTable, CompensationTable
from tendonff.compensator.export.modules import ADAPTIVE, BOUNDS, OBSERVER, PLANT, exportable
from tendonff.compensator.scenario.unit import Unit
from tendonff.ocp.errors import SolveError

UNCOMPENSATED = "none"


@dataclass(frozen=True, slots=True, kw_only=True)
class Judged:
    """Module on the chain of the export's level.

    Attributes
    ----------
    module : str
        Name of the module; "none" for the reference itself as force.
    score : Score or None
        Against the reference; None where the plant could not be simulated under this force.
    fault : str
        Why the module should not run on the rig; empty where nothing speaks against it.
    unit : Unit
        Of the errors.
    """

    module: str
    score: Score | None
    fault: str
    unit: Unit

    def as_dict(self) -> dict[str, object]:
        """The entry of `design.json`."""
        return {**(self.score.named(self.unit) if self.score is not None else {}), "fault": self.fault}


def judge(problem: Problem, profiles: Mapping[str, Profile]) -> tuple[Judged, ...]:
    """Simulate each module's profile on the plant that a design is verified on; none comes first."""
    plain = compensator(UNCOMPENSATED)
    unit = problem.reference.unit
    nothing = _score(problem, with_travel(problem, UNCOMPENSATED, plain.profile(problem)))
    if nothing is None:
        raise SolveError(
            "the reference itself as force cannot be simulated on this chain, so no module can be judged; "
            "check the parameters with tendonff simulate"
        )
    judged = [Judged(module=UNCOMPENSATED, score=nothing, fault="", unit=unit)]
    for module, profile in profiles.items():
        score = _score(problem, profile)
        fault = ""
        if score is None:
            fault = "the chain cannot be simulated under its force"
        elif is_worse(score, nothing, problem.reference.wanted):
            fault = (
                f"RMS error {score.percent} % of range, worse than the reference applied directly ({nothing.percent} %)"
            )
        judged.append(Judged(module=module, score=score, fault=fault, unit=unit))
    return tuple(judged)


def profiles_of(
    problem: Problem, built: BuiltTable | None, optimal: Profile | None = None, names: Sequence[str] = ()
) -> dict[str, Profile]:
    """Commands of each module, or some, at the samples of the reference, for `judge`.

    A module reads the reference live: it keeps no force in a hold, and does not know where the reference ends. Table
    and profile are those that are exported; a profile of another length than the reference is left out.
    """
    found, following = {}, replace(problem, live=True)
    for each, module in exportable(problem.transmission, moving=problem.chain.motion is not None):
        if names and module.name not in names:
            continue
        if module.plays_back:
            if optimal is not None and len(optimal.force_N) == len(problem.reference.tension_N):
                found[module.name] = optimal
        else:
            exported = CompensationTable(built.table) if built and isinstance(each, CompensationTable) else each
            found[module.name] = problem.applied(each.name, exported.profile(following))
    return found


def chosen(
    judged: Sequence[Judged], every: Sequence[CModule], *, force_export: bool
) -> tuple[tuple[CModule, ...], tuple[str, ...]]:
    """Modules to export, and warnings of those that do harm; SolveError if nothing is left that follows a reference."""
    faults = {each.module: each.fault for each in judged if each.fault}
    if "inverse" in faults and ADAPTIVE in every:  # what it tunes
        faults[ADAPTIVE.name] = faults["inverse"]
    if force_export:
        kept = (f"{module}: {fault}; exported because of --force-export" for module, fault in faults.items())
        return tuple(every), tuple(kept)
    modules = tuple(module for module in every if module.name not in faults)
    if all(module in (PLANT, OBSERVER, BOUNDS) for module in modules):
        said = "; ".join(f"{module}: {fault}" for module, fault in faults.items())
        raise SolveError(
            f"nothing to export: {said}. Let the reference move more slowly, raise the actuator's limits, "
            "or export all the same with --force-export"
        )
    left = (f"{module} is not exported: {fault}; --force-export exports it" for module, fault in faults.items())
    return modules, tuple(left)


def judge_stream(judged: Sequence[Judged], choice: StreamChoice | None, problem: Problem) -> Judged:
    """The stream module, against the reference delayed by its stated lag; it needs the inverse among those judged."""
    fault = next((each.fault for each in judged if each.module == "inverse"), "")
    unit = problem.reference.unit
    unsolved = Judged(module="stream", score=None, fault="the chain cannot be simulated under its force", unit=unit)
    if choice is None:
        return unsolved
    fine = stream_candidate(problem, choice.picked.design, Plant.fine(problem.transmission, problem.level))
    if fine is None:
        return unsolved
    own, nothing = fine.score, judged[0].score
    if not fault and nothing is not None and is_worse(own, nothing, problem.reference.wanted):
        fault = f"RMS error {own.percent} % of range, worse than the reference applied directly ({nothing.percent} %)"
    return Judged(module="stream", score=own, fault=fault, unit=unit)


def score_lines(judged: Sequence[Judged]) -> tuple[str, ...]:
    """The judgement as a table for the terminal."""
    if not judged:
        return ()
    unit = judged[0].unit
    lines = [f"{'module':<10} {'RMS error, % of range':>22} {f'largest error [{unit.shown}]':>18}"]
    for each in judged:
        score = each.score
        figures = ("-", "-") if score is None else (score.percent, f"{unit.factor * score.peak_error:.3g}")
        lines.append(f"{each.module:<10} {figures[0]:>22} {figures[1]:>18}{'  unfit' if each.fault else ''}")
    return tuple(lines)


def _score(problem: Problem, profile: Profile) -> Score | None:
    """Error on the plant that a design is verified on; None where it cannot be simulated."""
    try:
        return verify(Plant.fine(problem.transmission, problem.level), "", profile, problem.reference).score
    except SolveError:
        return None
