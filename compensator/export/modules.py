"""Which modules a scenario can have on a controller, and what is refused."""

import re

from tendonff.compensator.compensators.base import CModule, Compensator
from tendonff.compensator.compensators.registry import COMPENSATORS
from tendonff.compensator.files.reading import InputError
from tendonff.compensator.scenario.scenario import Scenario
from tendonff.models.parameters import Transmission
from tendonff.models.parameters.drive import Drive

STREAM = CModule(name="stream", content="exact inverse behind a filter, for references that arrive live")
"""Modules exported for references that are not known in advance."""

PLANT = CModule(name="plant", content="the chain itself")  # what is exported beside the compensators, for tests

OBSERVER = CModule(name="observer", content="output tension, with bounds, from what the near end measures")

ADAPTIVE = CModule(name="adaptive", content="exact inverse that tunes itself to a measurement")
BOUNDS = CModule(name="bounds", content="certified interval of the output tension")
ADAPTIVE_MODULES = (ADAPTIVE, BOUNDS)  # what is exported for a scenario with [adaptation]

FOLDER_FILES = ("example_main.c", "Makefile", "CMakeLists.txt", "README.md")
"""Files of every exported folder beside its sources; their templates stand with those of a kind, or in `library`."""

STATIC = ("capstan", "table")  # modules without the chain's states: they answer with a force and cannot tell a command

_KEYWORDS = frozenset(
    re.findall(
        r"\w+",
        """
        auto break case char const continue default do double else enum extern float for goto if inline int
        long register restrict return short signed sizeof static struct switch typedef union unsigned void
        volatile while main nan class new delete this template public private try catch throw bool true false
        """,
    )
)


def check_prefix(prefix: str) -> None:
    """Refuse a prefix that not every C and C++ compiler takes."""
    good = prefix.isascii() and prefix.isidentifier() and not prefix.startswith("_") and len(prefix) <= 24
    if not good or prefix.endswith("_") or "__" in prefix or prefix.lower() in _KEYWORDS:
        raise InputError(
            f'--prefix must be a C identifier of at most 24 letters, digits and single underscores, got "{prefix}"; '
            'the default is "tff"'
        )


def c_modules(scenario: Scenario, with_stream: bool = False) -> tuple[CModule, ...]:
    """Modules of the compensators that can be exported, then those for live references, plant, observer, tuner."""
    stream = (STREAM,) if with_stream else ()
    # The interval's ratios are constants: there is none where joints move the path or friction falls with the load.
    varies = scenario.joints or scenario.transmission.friction.load_exponent
    tuned = (ADAPTIVE,) if varies else ADAPTIVE_MODULES
    more = () if scenario.adaptation is None else tuned
    own = tuple(module for _, module in exportable(scenario.transmission, moving=bool(scenario.joints)))
    return (*own, *stream, PLANT, OBSERVER, *more)


def accepted_steps(step_s: float) -> tuple[float, float]:
    """Shortest and longest time between two calls that exported code takes as one step [s]; longer is a pause."""
    return 0.5 * min(step_s, 1e-3), 1.5 * max(step_s, 0.02)


def exportable(transmission: Transmission, *, moving: bool) -> tuple[tuple[Compensator, CModule], ...]:
    """Compensators with a module that serves this drive and path (`moving`: by joints), in the order they are shown."""
    servo = transmission.actuator.drive is Drive.POSITION
    return tuple(
        (each, module)
        for each in COMPENSATORS
        if (module := each.c_module) and (module.knows_joints or not moving) and not (servo and module.name in STATIC)
    )
