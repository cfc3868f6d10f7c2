"""The one door: what is done with a scenario, whatever it describes.

The functions take any scenario and look into the table `works.WORKS` for what does their work.
"""

import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, overload

from tendonff.compensator.export.kinds import FmiVersion
from tendonff.compensator.export.kinds import Kind as Unit
from tendonff.compensator.files.progress import Progress, silent
from tendonff.compensator.files.text import InputError
from tendonff.compensator.works import function_of, require_one_work
from tendonff.models.errors import ParameterError
from tendonff.models.fidelity import Level
from tendonff.models.turns import in_turn
from tendonff.ocp.codegen.precision import Precision
from tendonff.ocp.integrate.method import Method
from tendonff.ocp.opti.choices import Collocation

if TYPE_CHECKING:
    from tendonff.compensator.compensators.base import Compensator
    from tendonff.compensator.compensators.motors.task import MotorCompensator
    from tendonff.compensator.export.c_project import Exported
    from tendonff.compensator.export.motors import ExportedMotors
    from tendonff.compensator.export.several import ExportedTensions
    from tendonff.compensator.export.unit import Fmu
    from tendonff.compensator.identification.answer.result import Identification, S
    from tendonff.compensator.identification.motors.loop_routine import MotorRoutine
    from tendonff.compensator.identification.motors.routine import MotorsRoutine
    from tendonff.compensator.identification.suggest import Excitation
    from tendonff.compensator.scenario.driven.finger import FingerScenario
    from tendonff.compensator.scenario.driven.joint import JointScenario
    from tendonff.compensator.scenario.measurement import Measurement
    from tendonff.compensator.scenario.scenario import Scenario
    from tendonff.compensator.studies.adapt.study import AdaptationStudy
    from tendonff.compensator.studies.compare.result import Comparison
    from tendonff.compensator.studies.design.motors.result import MotorDesign
    from tendonff.compensator.studies.design.result import Design
    from tendonff.compensator.studies.explore.run import Explorer
    from tendonff.compensator.studies.simulate.result import SimulatedFile
    from tendonff.compensator.studies.tables.result import Tables
    from tendonff.ocp.opti.joint import JointFormulation
    from tendonff.ocp.opti.tendon import TensionFormulation

    MotorScenario = JointScenario | FingerScenario
    AnyScenario = Scenario | MotorScenario
    Files = Sequence[str | os.PathLike[str]]


def look_at(
    scenario: "AnyScenario", *, follows_reference: bool = True, strict: bool = False, accept: bool = False
) -> tuple[str, ...]:
    """Warnings about a scenario and the files it names, before any work; arguments and errors as of `first_look`."""
    found: tuple[str, ...] = function_of("look", scenario)(
        scenario, follows_reference=follows_reference, strict=strict, accept=accept
    )
    return found


@overload
def design(
    scenario: "Scenario",
    *,
    compensators: "Sequence[Compensator | str] | None" = None,
    strict: bool = False,
    progress: Progress = silent,
) -> "Design": ...
@overload
def design(
    scenario: "MotorScenario",
    *,
    compensators: "Sequence[MotorCompensator | str] | None" = None,
    strict: bool = False,
    progress: Progress = silent,
) -> "MotorDesign": ...
@in_turn
def design(
    scenario: "AnyScenario",
    *,
    compensators: "Sequence[Compensator | MotorCompensator | str] | None" = None,
    strict: bool = False,
    progress: Progress = silent,
) -> "Design | MotorDesign":
    """Design the command of a drive by every compensator, and verify each on a finer model.

    Parameters
    ----------
    scenario : Scenario, JointScenario or FingerScenario
        The command is a force (of a position drive a position), or the angle of each motor.
    compensators : sequence of Compensator, MotorCompensator or str, optional
        By themselves or by name. Default: all. Of a tension the one named "none" is what the others are compared with;
        of joints "linear" and "inverse" must be among them.
    strict : bool, optional
        Refuse a reference out of reach, beyond a stop, or for which a tendon would have to push, instead of designing
        what comes closest.
    progress : callable, optional
        Callback(completed, total).

    Raises
    ------
    InputError
        If the reference has no meaning, or cannot be delivered.
    SolveError
        If a simulation fails.

    Examples
    --------
    >>> import tendonff as tf
    >>> scenario = tf.load_scenario("examples/finger.toml")
    >>> fast = [each for each in tf.COMPENSATORS if each.is_fast]
    >>> result = tf.design(scenario, compensators=fast)
    >>> print(result.recommended.label)
    exact inverse
    """
    found: Design | MotorDesign = function_of("design", scenario, {"compensators": compensators})(
        scenario, strict=strict, progress=progress
    )
    return found


@in_turn
def compare(
    scenario: "AnyScenario",
    *,
    compensators: "Sequence[Compensator | MotorCompensator | str] | None" = None,
    progress: Progress = silent,
) -> "Comparison":
    """Compare the fidelity levels with each other: every compensator, designed on each, simulated on each.

    Parameters
    ----------
    scenario : Scenario, JointScenario or FingerScenario
    compensators : sequence of Compensator, MotorCompensator or str, optional
        By themselves or by name, one whose model depends on the level among them. Default: all but the optimal profile
        of a tension.
    progress : callable, optional
        Callback(completed, total).

    Raises
    ------
    InputError
        If the reference has no meaning, or cannot be delivered.
    SolveError
        If a simulation fails.

    Examples
    --------
    >>> import tendonff as tf
    >>> comparison = tf.compare(tf.load_scenario("examples/hand_joint.toml"))  # doctest: +SKIP
    >>> print(comparison.recommendation)  # doctest: +SKIP
    """
    found: Comparison = function_of("compare", scenario, {"compensators": compensators})(scenario, progress=progress)
    return found


@in_turn
def adapt(scenario: "AnyScenario", *, progress: Progress = silent) -> "AdaptationStudy":
    """Try self-tuning on rigs that differ from a scenario, beside feedforward and feedback alone.

    Parameters
    ----------
    scenario : Scenario or JointScenario
        With the table [adaptation].
    progress : callable, optional
        Callback(completed, total).

    Raises
    ------
    InputError
        If the scenario has nothing to tune, or its reference cannot be delivered.
    SolveError
        If a simulation fails.

    Examples
    --------
    >>> import tendonff as tf
    >>> study = tf.adapt(tf.load_scenario("examples/hand_joint_adaptive.toml"))  # doctest: +SKIP
    >>> print(study.headline)  # doctest: +SKIP
    """
    found: AdaptationStudy = function_of("adapt", scenario)(scenario, progress=progress)
    return found


def explore(scenario: "AnyScenario") -> "Explorer":
    """The subject of the interactive page of a scenario."""
    found: Explorer = function_of("explore", scenario)(scenario)
    return found


def simulate_file(
    scenario: "AnyScenario",
    commands: Path,
    out: Path,
    *,
    column: str | None = None,
    joints: Path | None = None,
    level: Level | None = None,
    check: bool = False,
    method: Method = Method.BDF2,
    accept: bool = False,
    progress: Progress = silent,
) -> "SimulatedFile":
    """Simulate what a file of commands does, and write a table.

    Parameters
    ----------
    scenario : Scenario, JointScenario or FingerScenario
    commands : Path
        Columns time_s, from 0, and force_N (of a position drive command_m) or motor_rad; of several motors
        motor_NAME_rad.
    out : Path
        CSV file of tensions and motion.
    column : str, optional
        Name of the command's column, if it has another; of several motors NAME in it stands for the motor's name.
    joints : Path, optional
        Motion of the joints that no tendon drives, instead of the scenario's.
    level : Level, optional
        Default: the scenario's own.
    check : bool, optional
        Simulate with smaller steps too, and state the discretisation error.
    method : Method, optional
        How it advances in time.
    accept : bool, optional
        Warn of values that look like another unit, instead of refusing them.
    progress : callable, optional

    Raises
    ------
    InputError
        If a file has no meaning.
    SolveError
        If the simulation fails.
    """
    if out.exists() and any(out.samefile(source) for source in (scenario.source, commands, joints) if source):
        raise InputError(f"{out} is an input of this run; name another file for the result")
    if check and method is not Method.BDF2:
        raise InputError(f"--check halves the fixed step, which --method {method} does not have; leave one of them out")
    asked = {"column": column, "joints": joints, "check": check, "method": method}
    found: SimulatedFile = function_of("simulate", scenario, asked)(
        scenario, _level(level) or scenario.run.level, commands, out, accept=accept, progress=progress
    )
    return found


@in_turn
def identify(
    scenario: "S",
    data: "Files",
    validate: "Files" = (),
    *,
    how: "Measurement | None" = None,
    static_only: bool = False,
    say: Callable[[str], None] = lambda _: None,
    confirm: Callable[[str], bool] | None = None,
) -> "Identification[S]":
    """Find the parameters of a rig from files that were measured on it.

    Parameters
    ----------
    scenario : Scenario, JointScenario or FingerScenario
        Of the rig: its values are where the fit starts.
    data : sequence of path
        Files to fit: tensions at both ends of a tendon, or angles and torques of motors.
    validate : sequence of path, optional
        Files that judge the laws.
    how : Measurement, optional
        How the files are read; default: the scenario's table [measurement], of a joint the usual names of columns.
    static_only : bool, optional
        Of a tension: fit the quasi-static laws only.
    say : callable, optional
        Takes lines on what was read and what comes next.
    confirm : callable, optional
        Asked before very long files are fitted, and where a value looks like another unit; default: no.

    Raises
    ------
    InputError
        If a file has no meaning, or does not belong to the scenario.

    Examples
    --------
    >>> import tendonff as tf
    >>> scenario = tf.load_scenario("examples/hand_joint.toml")
    >>> fit = tf.identify(scenario, ["log.csv"])  # doctest: +SKIP
    """
    for name, files in (("data", data), ("validate", validate)):
        if isinstance(files, str | os.PathLike):
            raise ParameterError(f'{name} must be a list of files, got "{files}"; write ["{files}"]')
    asked = {"how": how, "static_only": static_only}
    found: Identification[S] = function_of("identify", scenario, asked)(
        scenario, data, validate, say=say, **({} if confirm is None else {"confirm": confirm})
    )
    return found


@overload
def suggest(scenario: "Scenario") -> "Excitation": ...
@overload
def suggest(scenario: "JointScenario | FingerScenario") -> "MotorRoutine | MotorsRoutine": ...
@in_turn
def suggest(scenario: "AnyScenario") -> "Excitation | MotorRoutine | MotorsRoutine":
    """Suggest what to command for an identification: a force over time, or angles of motors.

    Examples
    --------
    >>> import tendonff as tf
    >>> routine = tf.suggest(tf.load_scenario("examples/hand_joint.toml"))
    >>> routine.motor_rad[0]
    np.float64(0.0)
    """
    found: Excitation | MotorRoutine | MotorsRoutine = function_of("suggest", scenario)(scenario)
    return found


@in_turn
def make_table(
    scenario: "AnyScenario",
    *,
    level: Level | None = None,
    bound: float | None = None,
    angles_rad: Sequence[float] = (),
    rates: Sequence[float] = (),
    pose_rad: Mapping[str, float] = MappingProxyType({}),
) -> "Tables":
    """Tabulate the feedforward: a force over reference, branch and tension since the last reversal; a motor's angle
    over the joint's angle and the way it turns.

    Parameters
    ----------
    scenario : Scenario or JointScenario
    level : Level, optional
        Default: the scenario's own.
    bound : float, optional
        Largest interpolation error, of a force [N] or of the joint's angle [rad]; default: 0.5 % of the reference's
        range, of a joint 0.1 %.
    angles_rad : sequence of float, optional
        Of a tension wrap angles, a further axis; of a joint the nodes of its angle.
    rates : sequence of float, optional
        Rates of the reference, a further axis [N/s, of a joint rad/s].
    pose_rad : mapping of str to float, optional
        Angles of joints that no tendon drives, constant for the table.

    Raises
    ------
    InputError
        If no table holds what the scenario describes.

    Examples
    --------
    >>> import tendonff as tf
    >>> tables = tf.make_table(tf.load_scenario("examples/finger.toml"))  # doctest: +SKIP
    >>> tables.write("table")  # doctest: +SKIP
    """
    found: Tables = function_of("table", scenario)(
        scenario, level=_level(level), bound=bound, angles_rad=angles_rad, rates=rates, pose_rad=pose_rad
    )
    return found


@in_turn
def export_c(
    scenario: "AnyScenario",
    *,
    further: "Sequence[AnyScenario]" = (),
    precision: Precision = Precision.DOUBLE,
    prefix: str = "tff",
    level: Level | None = None,
    force_export: bool = False,
) -> "Exported | ExportedTensions | ExportedMotors":
    """Print a folder of C99 for the controller, with its self test.

    Every module is simulated on the scenario's reference first; one that is worse than no compensation is left out.

    Parameters
    ----------
    scenario : Scenario, JointScenario or FingerScenario
    further : sequence of scenarios of the same kind, optional
        Others of the same project: joints and fingers share one copy of the code, tensions have a folder each.
    precision : Precision, optional
        Real type of all arithmetic.
    prefix : str, optional
        Prefix of every C name and file.
    level : Level, optional
        Fidelity level of what is exported; default: the scenario's own.
    force_export : bool, optional
        Export modules all the same that are worse than no compensation.

    Raises
    ------
    InputError
        If the prefix is no C identifier, the reference cannot be delivered, or scenarios do not go together.
    SolveError
        If nothing is better than no compensation.

    Examples
    --------
    >>> import tendonff as tf
    >>> knuckle = tf.load_scenario("examples/hand_joint.toml")
    >>> exported = tf.export_c(knuckle, precision=tf.Precision.FLOAT)  # doctest: +SKIP
    >>> exported.write("c")  # doctest: +SKIP
    """
    export = function_of("export_c", scenario, {"further": further})
    require_one_work("export_c", (scenario, *further))
    found: Exported | ExportedTensions | ExportedMotors = export(
        scenario,
        precision=Precision(precision),
        prefix=prefix,
        level=_level(level),
        force_export=force_export,
    )
    return found


@overload
def opti(
    scenario: "Scenario",
    *,
    level: Level | None = None,
    interval_s: float = 0.005,
    degree: int = 1,
    smoothing: float = 3e-4,
    payload: bool = False,
) -> "TensionFormulation": ...
@overload
def opti(
    scenario: "JointScenario | FingerScenario",
    *,
    level: Level | None = None,
    interval_s: float = 0.005,
    degree: int = 1,
    smoothing: float = 3e-4,
    payload: bool = False,
) -> "JointFormulation": ...
@in_turn
def opti(
    scenario: "AnyScenario",
    *,
    level: Level | None = None,
    interval_s: float = 0.005,
    degree: int = 1,
    smoothing: float = 3e-4,
    payload: bool = False,
) -> "TensionFormulation | JointFormulation":
    """Pose the optimal-control problem of a scenario by direct collocation, to be extended and solved by IPOPT.

    Parameters
    ----------
    scenario : Scenario, JointScenario or FingerScenario
        The tension of one tendon, with the weights and bounds of its table [optimal], or angles of driven joints.
    level : Level, optional
        Of the model; default: the scenario's.
    interval_s : float, optional
        Length of an interval, over which force and motors are linear [s], > 0. Default 0.005.
    degree : int, optional
        Of the states' polynomials, 1 to 9; 1, the default, is implicit Euler.
    smoothing : float, optional
        Friction switches over this share of the largest sliding speed of the first guess [-], > 0: abs(v) becomes
        sqrt(v^2 + w^2). Default 3e-4.
    payload : bool, optional
        What the load or the joints give to what they touch are variables that your equations decide.

    Raises
    ------
    InputError
        If the scenario is none that this can pose.
    SolveError
        If the first guess cannot be simulated.

    Examples
    --------
    >>> from dataclasses import replace
    >>> import tendonff as tf
    >>> scenario = tf.load_scenario("examples/finger_fast.toml")
    >>> short = replace(scenario.reference, duration_s=0.1)
    >>> problem = tf.opti(replace(scenario, reference=short))
    >>> problem.opti.subject_to(problem.tension_N[3, 1:] <= 60.0)  # at the middle of the path
    >>> answer = problem.solve()
    >>> answer.value(problem.force_N).shape
    (21,)
    """
    how = Collocation(interval_s=interval_s, degree=degree, smoothing=smoothing)
    work = function_of("opti", scenario)
    found: TensionFormulation | JointFormulation = work(scenario, how, level=_level(level), payload=payload)
    return found


@in_turn
def export_fmu(
    scenario: "AnyScenario",
    kind: Unit = Unit.INVERSE,
    fmi: FmiVersion = FmiVersion.V2,
    *,
    prefix: str = "tff",
    level: Level | None = None,
    everywhere: bool = False,
    force_export: bool = False,
) -> "Fmu":
    """Wrap the exported C into a co-simulation unit.

    Parameters
    ----------
    scenario : Scenario, JointScenario or FingerScenario
    kind : Kind, optional
        What it computes; of a joint inverse, adaptive, plant or observer, the last two of one motor; of a finger its
        inverse.
    fmi : FmiVersion, optional
    prefix : str, optional
        Prefix of the C names.
    level : Level, optional
        Default: the scenario's own.
    everywhere : bool, optional
        Binaries for Windows and macOS too, built here by ziglang; what is run here are those of this machine alone.
    force_export : bool, optional
        Make a unit all the same that is worse than no compensation.

    Raises
    ------
    SolveError
        If what it computes fails, or is worse than no compensation.
    CodeError
        If a compiler refuses the sources.

    Examples
    --------
    >>> import tendonff as tf
    >>> knuckle = tf.load_scenario("examples/hand_joint.toml")
    >>> tf.export_fmu(knuckle, fmi=tf.FmiVersion.V3).write("fmu")  # doctest: +SKIP
    """
    asked = {"kind": None if kind is Unit.INVERSE else kind}
    found: Fmu = function_of("export_fmu", scenario, asked)(
        scenario, fmi=fmi, prefix=prefix, level=_level(level), everywhere=everywhere, force_export=force_export
    )
    return found


def _level(level: Level | str | None) -> Level | None:
    """A level by itself or by name; None for the scenario's own. ParameterError for another name."""
    return None if level is None else Level(level)
