"""The one table of works: which function does a work on a kind of scenario, or why there is none.

Nothing else looks up what a scenario describes. A function named here stands in the room that asks for it, or below.

Where a row names several, they differ by physics or by what a file holds, and each module says how: a table's axes and
what is tuned (below one body, `Tables.made` and `Trials.run`), a force file against motor angles, the data sheet of a
tension against that of motors in a design, and what a tension cell tells against what a motor feels in a fit. Rows that
make a problem, a runtime, an observer or a first look make the object that hides the difference from all else.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from importlib import import_module
from operator import attrgetter
from types import MappingProxyType
from typing import Any

from tendonff.compensator.files.text import InputError
from tendonff.compensator.scenario.kind import Kind
from tendonff.models.errors import ParameterError


@dataclass(frozen=True, slots=True, kw_only=True)
class Work:
    """A work on scenarios.

    Attributes
    ----------
    by : mapping of Kind to str
        "module:function" or "module:Class.method" of this package that does it, imported where it is needed.
    refused : mapping of Kind to str
        Why the other kinds have none, and what to do instead.
    options : mapping of str to (mapping of Kind to str)
        Options that a kind does not have, and why.
    """

    by: Mapping[Kind, str]
    refused: Mapping[Kind, str] = field(default_factory=dict)
    options: Mapping[str, Mapping[Kind, str]] = field(default_factory=dict)


_MOTORS = (Kind.JOINT, Kind.FINGER)


def _not(kinds: Sequence[Kind], why: str) -> Mapping[Kind, str]:
    return dict.fromkeys(kinds, why)


_FINGER_ALONE = "tf.Runtime and export-c give their motor angles step by step"
_NO_CELLS = (
    "--tension-column, --actuator-force-column, --explain, --static, --gear-ratio and --drum-radius are for tensions, "
    "known at both ends of one tendon; of a joint what its motors feel is fitted, friction, tendons and load at once: "
    "leave them out"
)

WORKS: Mapping[str, Work] = MappingProxyType(
    {
        "problem": Work(
            by={
                Kind.TENSION: "compensators.base:Problem.of",
                Kind.JOINT: "compensators.motors.joint:JointTask.of",
                Kind.FINGER: "compensators.motors.finger:FingerTask.of",
            }
        ),
        "compensators": Work(
            by={
                Kind.TENSION: "compensators.registry:known",
                Kind.JOINT: "compensators.motors.registry:known",
                Kind.FINGER: "compensators.motors.registry:known",
            }
        ),
        "runtime": Work(
            by={
                Kind.TENSION: "runtime.core:of_tension",
                Kind.JOINT: "runtime.core:of_joint",
                Kind.FINGER: "runtime.core:of_several_joints",
            }
        ),
        "observer": Work(
            by={Kind.TENSION: "observe.observer:of_tension", Kind.JOINT: "observe.observer:of_joint"},
            refused={
                Kind.FINGER: "an observer knows one tendon or one joint; the motors of a finger do not tell the far "
                "ends of its tendons apart"
            },
        ),
        "look": Work(
            by={
                Kind.TENSION: "scenario.sampled.first_look:first_look",
                Kind.JOINT: "scenario.driven.joint_doubts:look_at_joint",
                Kind.FINGER: "scenario.driven.finger_doubts:look_at_finger",
            }
        ),
        "design": Work(
            by={
                Kind.TENSION: "studies.design.run:design",
                Kind.JOINT: "studies.design.motors.run:design_motors",
                Kind.FINGER: "studies.design.motors.run:design_motors",
            },
        ),
        "compare": Work(by=dict.fromkeys(Kind, "studies.compare.run:compare")),
        "explore": Work(by=dict.fromkeys(Kind, "studies.explore.run:Explorer")),
        "simulate": Work(
            by={
                Kind.TENSION: "studies.simulate.run:simulate_force_file",
                Kind.JOINT: "studies.simulate.motors:simulate_motor_file",
                Kind.FINGER: "studies.simulate.motors:simulate_motor_file",
            },
        ),
        "experiment": Work(
            by={Kind.TENSION: "studies.experiment.run:experiment"},
            refused=_not(
                _MOTORS,
                "the experiment holds one tendon between two motors; describe that tendon by a scenario of its tension",
            ),
        ),
        "identify": Work(
            by=dict.fromkeys(Kind, "identification.identify:identify"),
            options=dict.fromkeys(
                ("tension_columns", "actuator_force_column", "explain", "static_only", "gear_ratio", "drum_radius_m"),
                _not(_MOTORS, _NO_CELLS),
            ),
        ),
        "fit": Work(
            by={
                Kind.TENSION: "identification.run:fit_tendon",
                Kind.JOINT: "identification.motors.run:fit_motors",
                Kind.FINGER: "identification.motors.run:fit_motors",
            }
        ),
        "suggest": Work(
            by={
                Kind.TENSION: "identification.suggest:suggest",
                Kind.JOINT: "identification.motors.run:suggest_motor_routine",
                Kind.FINGER: "identification.motors.run:suggest_motor_routine",
            },
        ),
        "write_suggestion": Work(by=dict.fromkeys(Kind, "identification.answer.output:write_suggestion")),
        "watch": Work(
            by={Kind.JOINT: "studies.watch.run:watch"},
            refused=_not(
                (Kind.TENSION, Kind.FINGER),
                "watch follows friction and pre-tension of a closed loop by the torque of its own motor; a tension is "
                "set by its drive, and of tendons that fingers share one torque tells of many: tendonff "
                "identify with several --data compares days there",
            ),
        ),
        "adapt": Work(
            by={
                Kind.TENSION: "studies.adapt.tension:TensionTrials.run",
                Kind.JOINT: "studies.adapt.loop:LoopTrials.run",
            },
            refused={
                Kind.FINGER: "adapt tunes one number from one motor; the joints of a finger share tendons, so that one "
                "torque tells of many"
            },
        ),
        "table": Work(
            by={
                Kind.TENSION: "studies.tables.force:ForceTables.made",
                Kind.JOINT: "studies.tables.motor:MotorTables.made",
            },
            refused={
                Kind.FINGER: "a table of several joints needs an axis for the angle and the way of each, 2 n in all, "
                f"which fits no controller; {_FINGER_ALONE}"
            },
        ),
        "opti": Work(
            by={
                Kind.TENSION: "studies.opti.run:opti_of_tension",
                Kind.JOINT: "studies.opti.run:opti_of_joint",
                Kind.FINGER: "studies.opti.run:opti_of_finger",
            }
        ),
        "export_c": Work(
            by={
                Kind.TENSION: "export.several:export_tensions",
                Kind.JOINT: "export.joint.project:export_joints",
                Kind.FINGER: "export.finger.project:export_fingers",
            },
        ),
        "export_fmu": Work(
            by={
                Kind.TENSION: "export.fmu:build_fmu",
                Kind.JOINT: "export.joint.fmu:build_joint_fmu",
                Kind.FINGER: "export.finger.fmu:build_finger_fmu",
            },
        ),
    }
)
"""All works, for every kind of scenario: the table of what is possible."""


def require_options(work: str, scenario: Any, asked: Mapping[str, object]) -> None:
    """Refuse the options of a work that a scenario's kind does not have; those not asked for are None, False, empty."""
    for name, why in WORKS[work].options.items():
        if scenario.kind in why and _is_given(asked.get(name)):
            raise InputError(f"{scenario.source.name}: {why[scenario.kind]}")


def require_one_work(work: str, scenarios: Sequence[Any]) -> None:
    """Refuse scenarios that one function does not take together; InputError names the first that is apart."""
    done = [function_of(work, each).func for each in scenarios]
    for scenario, by in zip(scenarios, done, strict=True):
        if by is not done[0]:
            raise InputError(f"{scenario.source.name}: {_APART}")


_APART = (
    "a project holds tensions, single joints or fingers; give one kind at a time, each with a --prefix of its own: "
    "the folders then go into one program"
)


def _is_given(value: object) -> bool:
    return not (value is None or value is False or (isinstance(value, Sequence | Mapping) and not value))


def function_of(work: str, scenario: Any, asked: Mapping[str, object] = MappingProxyType({})) -> "partial[Any]":
    """Function that does a work on scenarios of this kind, with the options that were asked for.

    InputError, with the reason, where there is none, or an option is not for this kind.
    """
    kind = getattr(scenario, "kind", None)
    if not isinstance(kind, Kind):
        raise ParameterError(f"scenario must be one that tf.load_scenario(file) gives, got {scenario!r:.60}")
    entry = WORKS[work]
    if kind in entry.refused:
        raise InputError(f"{scenario.source.name}: {entry.refused[kind]}")
    require_options(work, scenario, asked)
    module, _, name = entry.by[kind].partition(":")
    found: Callable[..., Any] = attrgetter(name)(import_module(f"tendonff.compensator.{module}"))
    return partial(found, **{key: value for key, value in asked.items() if _is_given(value)})
