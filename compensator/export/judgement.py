"""What the exported modules are worth: each on the scenario's own reference and plant, against no compensation."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace

from tendonff.compensator.compensators.base import CModule, FloatArray, Problem, Profile, with_motion
from tendonff.compensator.compensators.registry import compensator
from tendonff.compensator.compensators.score import Score, SimulatedPlant, is_worse, verify
from tendonff.compensator.compensators.stream import StreamChoice
from tendonff.compensator.compensators.table import BuiltTable, CompensationTable
from tendonff.compensator.export.modules import ADAPTIVE, BOUNDS, PLANT, exportable
from tendonff.models.parameters.drive import Drive
from tendonff.ocp.errors import SolveError

UNCOMPENSATED = "none"


@dataclass(frozen=True, slots=True, kw_only=True)
class Judged:
    """One module on the chain of the export's level."""

    module: str  # name of the module; "none" for the reference itself as force
    score: Score | None  # against the reference; None where the plant could not be simulated under this force
    fault: str  # why the module should not run on the rig; empty where nothing speaks against it

    def as_dict(self) -> dict[str, object]:
        """The entry of `design.json`."""
        return {**(asdict(self.score) if self.score is not None else {}), "fault": self.fault}


def judge(problem: Problem, forces_N: Mapping[str, FloatArray]) -> tuple[Judged, ...]:
    """Simulate each module's force [N] or command [m] on the chain of the problem's level; none comes first."""
    nothing = _score(problem, answer_of(problem, UNCOMPENSATED, compensator(UNCOMPENSATED).profile(problem)))
    if nothing is None:
        raise SolveError(
            "the reference itself as force cannot be simulated on this chain, so no module can be judged; "
            "check the parameters with tendonff simulate"
        )
    judged = [Judged(module=UNCOMPENSATED, score=nothing, fault="")]
    for module, force in forces_N.items():
        score = _score(problem, force)
        fault = ""
        if score is None:
            fault = "the chain cannot be simulated under its force"
        elif is_worse(score, nothing, problem.reference.tension_N):
            fault = (
                f"RMS error {score.percent} % of range, worse than no compensation ({nothing.percent} %) "
                "on the scenario's reference"
            )
        judged.append(Judged(module=module, score=score, fault=fault))
    return tuple(judged)


def forces_of(
    problem: Problem, built: BuiltTable | None, profile_N: FloatArray | None = None, names: Sequence[str] = ()
) -> dict[str, FloatArray]:
    """Force [N] or command [m] of each module, or of some, at the samples of the reference, for `judge`.

    A module reads the reference live: it keeps no force in a hold, and does not know where the reference ends. Table
    and profile are those that are exported; a profile of another length than the reference is left out.
    """
    forces, following = {}, replace(problem, live=True)
    for each, module in exportable(problem.transmission, moving=problem.chain.motion is not None):
        if names and module.name not in names:
            continue
        if module.plays_back:
            if profile_N is not None and len(profile_N) == len(problem.reference.tension_N):
                forces[module.name] = profile_N
        else:
            exported = CompensationTable(built.table) if built and isinstance(each, CompensationTable) else each
            forces[module.name] = driven(problem, answer_of(following, each.name, exported.profile(following)))
    return forces


def driven(problem: Problem, answer: FloatArray) -> FloatArray:
    """What the actuator makes of a module's force [N]: the limits of its motion, which no module knows, bind as well.

    A command [m] stays as it is.
    """
    return answer if problem.transmission.actuator.drive is Drive.POSITION else problem.limited(answer)


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
    if all(module in (PLANT, BOUNDS) for module in modules):
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
    if choice is None:
        return Judged(module="stream", score=None, fault="the chain cannot be simulated under its force")
    own, nothing = choice.picked.score, judged[0].score
    if not fault and nothing is not None and is_worse(own, nothing, problem.reference.tension_N):
        fault = f"RMS error {own.percent} % of range, worse than no compensation ({nothing.percent} %)"
    return Judged(module="stream", score=own, fault=fault)


def score_lines(judged: Sequence[Judged]) -> list[str]:
    """The judgement as a table for the terminal."""
    lines = [f"{'module':<10} {'RMS error, % of range':>22} {'largest error [N]':>18}"]
    for each in judged:
        score = each.score
        figures = ("-", "-") if score is None else (score.percent, f"{score.peak_error_N:.3g}")
        lines.append(f"{each.module:<10} {figures[0]:>22} {figures[1]:>18}{'  unfit' if each.fault else ''}")
    return lines


def answer_of(problem: Problem, name: str, profile: Profile) -> FloatArray:
    """What the actuator is told: the force of a profile [N], or the command of a position drive [m]."""
    if problem.transmission.actuator.drive is not Drive.POSITION:
        return profile.force_N
    moved = with_motion(problem, name, profile)
    if moved.command_m is None:
        raise SolveError(f"{name}: the chain cannot be simulated under its force, so no command is known")
    return moved.command_m


def _score(problem: Problem, answer: FloatArray) -> Score | None:
    plant = SimulatedPlant(level=problem.level)
    command = answer if problem.transmission.actuator.drive is Drive.POSITION else None
    profile = Profile(force_N=answer, command_m=command)
    try:
        return verify(problem.transmission, plant, "", profile, problem.reference).score
    except SolveError:
        return None
