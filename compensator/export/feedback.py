"""The feedback in C: header, source and self test from its law, which is printed from the expression."""

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from tendonff.ocp.codegen.partial_evaluation import PartialEvaluator
from tendonff.ocp.codegen.precision import Precision
from tendonff.ocp.codegen.printer import literal
from tendonff.ocp.codegen.templates import environment
from tendonff.ocp.feedback.law import LEARNED, NUMBERS, STATES, FeedbackController, FeedbackLaw, feedback_step
from tendonff.ocp.step.render import law_calls

FEEDBACK_SOURCES = ("feedback", "control")
"""Modules in C: the feedback, and feedforward and feedback in one call."""

_TEMPLATES = environment("tendonff.compensator.export", "templates/feedback")
_MISSING = 1e30
_TOLERANCE = {Precision.DOUBLE: 1e-12, Precision.FLOAT: 2e-3}
"""Largest departure of the corrections, as a share of the largest: rounding, which the least squares pass on."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Line:
    """A delay line: of what, its value now, that at rest, and the name of the value as old as the measurement."""

    name: str
    now: str
    at_rest: str
    aged: str


@dataclass(frozen=True, slots=True, kw_only=True)
class FeedbackModule(ABC):
    """Law and signals of an exported feedback.

    Attributes
    ----------
    law : FeedbackLaw
    every : int
        Steps of the feedforward in a sample.
    reference : tuple of float
        Of the golden vectors, one a sample; the first is that at rest.
    unit, seen_unit, command_unit : str
        Of the measurement, of what the law compares, and of the command that is corrected.
    """

    law: FeedbackLaw
    every: int
    reference: tuple[float, ...]
    unit: str
    seen_unit: str
    command_unit: str
    stem: ClassVar[str]  # of the templates
    feedforward: ClassVar[str]  # module whose command is corrected
    streamed: ClassVar[tuple[str, ...]] = ()  # inputs of the law beside both values, computed at each sample
    fixed: ClassVar[Mapping[str, float]] = {}  # inputs of the law that are always the same

    @abstractmethod
    def seen(self, value: float) -> float:
        """A reference or measurement as the law sees it."""

    @abstractmethod
    def context(self, precision: Precision) -> dict[str, object]:
        """Values of the templates beside those of the law."""

    def golden(self) -> dict[str, list[float]]:
        """Columns of samples in the order of the arguments, some measurements missing; the last are the corrections."""
        rng, rows = np.random.default_rng(7), len(self.reference)
        reference = np.array(self.reference)
        off = np.cumsum(rng.standard_normal(rows)) * 0.02 * np.ptp(reference)
        seen = np.maximum(reference[np.maximum(np.arange(rows) - 3, 0)] - off, self.least)
        seen[49::50] = _MISSING
        controller, found = FeedbackController(self.law, self.seen(float(reference[0]))), []
        for row, (wanted, measured) in enumerate(zip(reference.tolist(), seen.tolist(), strict=True)):
            taken = math.nan if measured == _MISSING else self.seen(measured)
            answer = controller.step(self.seen(wanted), taken, self.shape_at(row))
            found.append(self.commanded(answer, row))
        return {"reference": reference.tolist(), "measured": seen.tolist(), "expected": found}

    @property
    def least(self) -> float:
        """Smallest measurement of the golden vectors."""
        return -math.inf

    @property
    def largest(self) -> float:
        """Largest correction of the command along the golden vectors."""
        return self.law.clamp

    def shape_at(self, row: int) -> float:  # noqa: ARG002
        """Shape of friction at a row of the golden vectors, where the law takes it."""
        return 0.0

    def commanded(self, correction: float, row: int) -> float:  # noqa: ARG002
        """Correction of the command, of one of the law, at a row of the golden vectors."""
        return correction


@dataclass(frozen=True, slots=True, kw_only=True)
class JointModule(FeedbackModule):
    """Feedback of a joint.

    Attributes
    ----------
    direction : tuple of float
        Correction of each command per unit of the correction.
    other_rad : tuple of float
        Angles at the start of the joints that move paths.
    """

    direction: tuple[float, ...]
    other_rad: tuple[float, ...]
    stem, feedforward = "joint", "joint"
    fixed = {"shape": 0.0, "aged_shape": 0.0}  # noqa: RUF012 - nobody writes it

    def seen(self, value: float) -> float:
        """See `FeedbackModule.seen`."""
        return value

    def context(self, precision: Precision) -> dict[str, object]:
        """See `FeedbackModule.context`."""
        return {
            "direction": [literal(value, precision) for value in self.direction],
            "other_rad": [literal(value, precision) for value in self.other_rad],
        }


@dataclass(frozen=True, slots=True, kw_only=True)
class TensionModule(FeedbackModule):
    """Feedback of a tension, with two inverses of its own.

    Attributes
    ----------
    force_N, more_N : tuple of float
        What inverse, and inverse with more friction, say for the references.
    joint_rad : tuple of tuple of float
        Angles of the joints that move the path, for the references.
    offset_N : float
        Added to forces before their logarithm.
    more_friction : float
        Share by which friction is changed in the second inverse [-].
    command_per_N : float
        Command per force on the actuator.
    """

    force_N: tuple[float, ...]
    more_N: tuple[float, ...]
    joint_rad: tuple[tuple[float, ...], ...]
    offset_N: float
    more_friction: float
    command_per_N: float
    stem, feedforward = "tension", "inverse"
    streamed = ("shape",)

    def seen(self, value: float) -> float:
        """See `FeedbackModule.seen`."""
        return math.log(max(value, 0.0) + self.offset_N)

    def context(self, precision: Precision) -> dict[str, object]:
        """See `FeedbackModule.context`."""
        return {
            "offset_N": self.offset_N,
            "more_friction": self.more_friction,
            "command_per_N": self.command_per_N,
            "suffix": "f" if precision is Precision.FLOAT else "",
            "joints": len(self.joint_rad[0]),
            "joint_rad": [angle for row in self.joint_rad for angle in row],
            "start_rad": [literal(angle, precision) for angle in self.joint_rad[0]],
        }

    @property
    def least(self) -> float:
        """See `FeedbackModule.least`."""
        return 0.0

    @property
    def largest(self) -> float:
        """See `FeedbackModule.largest`."""
        return max(self.force_N) * self.command_per_N * self.law.clamp

    def shape_at(self, row: int) -> float:
        """See `FeedbackModule.shape_at`."""
        return (self.seen(self.more_N[row]) - self.seen(self.force_N[row])) / self.more_friction

    def commanded(self, correction: float, row: int) -> float:
        """See `FeedbackModule.commanded`."""
        return self.command_per_N * (self.force_N[row] + self.offset_N) * math.expm1(correction)


def feedback_sources(module: FeedbackModule, prefix: str, provenance: str = " *") -> dict[str, str]:
    """Headers and sources in double precision, without the self test; arguments as of `feedback_files`."""
    found = feedback_files(module, prefix=prefix, precision=Precision.DOUBLE, provenance=provenance)
    return {name: text for name, text in found.items() if not name.endswith("_test.c")}


def feedback_files(module: FeedbackModule, *, prefix: str, precision: Precision, provenance: str) -> dict[str, str]:
    """Texts by file name; `provenance` holds the lines of the comment on top."""
    law, golden = module.law, module.golden()

    def num(value: float) -> str:
        return literal(float(value), precision)

    def numbers(values: Sequence[float]) -> str:
        text = [num(value) for value in values]
        return ",\n".join("    " + ", ".join(text[k : k + 5]) for k in range(0, len(text), 5))

    start = module.reference[0]
    context = {
        "prefix": prefix,
        "guard": prefix.upper(),
        "real": precision.value,
        "num": num,
        "provenance": provenance,
        "unit": module.unit,
        "seen_unit": module.seen_unit,
        "command_unit": module.command_unit,
        "first": start,
        "start": module.seen(start),
        "columns": [(name, numbers(values)) for name, values in golden.items()],
        "numbers": numbers,
        "rows": len(module.reference),
        "joints": 0,
        "other_rad": (),
        "every": module.every,
        "sample": law.sample_s,
        "feedforward": module.feedforward,
        "tolerance": _TOLERANCE[precision] * module.largest,
        "far": start + 1e3 * max(law.clamp, 1.0),
        **_law_context(module, prefix, precision),
        **module.context(precision),
    }

    def array(name: str, present: object) -> str:
        return f", const {prefix}_real {name}[]" if present else ""

    moved, others = context["joints"], context["other_rad"]
    context |= {
        "joint_parameter": array("joint_rad", moved),
        "arguments": ", joint_rad" if moved else "",
        "other_parameter": array("other_rad", others),
        "other_arguments": ", other_rad" if others else "",
    }
    templates = {
        "feedback.h": f"{module.stem}.h",
        "feedback.c": f"{module.stem}.c",
        "feedback_test.c": f"{module.stem}_test.c",
        "control.h": f"{module.stem}_control.h",
        "control.c": f"{module.stem}_control.c",
    }
    return {
        f"{prefix}_{name}": _TEMPLATES.get_template(f"{template}.j2").render(context)
        for name, template in templates.items()
    }


def _law_context(module: FeedbackModule, prefix: str, precision: Precision) -> dict[str, object]:
    """The law and its memory, as the templates take them."""
    law = module.law
    printer = PartialEvaluator(prefix=f"{prefix}_feedback", precision=precision, parameters={})
    folded = printer.fold(feedback_step(), fixed={**dict(zip(NUMBERS, law.numbers, strict=True)), **module.fixed})
    states = {name: f"self->{name}" for name in STATES}
    found = {f"{name}_new": f"&self->{name}" for name in STATES}
    zero = literal(0.0, precision)
    lines = [
        _Line(name="reference", now="wanted", at_rest="start", aged="aged"),
        _Line(name="correction", now="self->lagged", at_rest=zero, aged="lagged_aged"),
        *(_Line(name=name, now=name, at_rest=zero, aged=f"aged_{name}") for name in module.streamed),
    ]
    given = {"reference": "wanted", "measured": "taken", "fresh": "fresh"}
    given |= {name: name for name in (*(line.aged for line in lines), *module.streamed)}
    started = [
        (name, "start" if other != value else literal(value, precision))
        for name, value, other in zip(STATES, law.start(0.0), law.start(1.0), strict=True)
        if name != "correction"
    ]
    whole, part = law.age
    return {
        "law": law,
        "sample_s": repr(law.sample_s),
        "delay_ms": f"{1e3 * law.delay_s:.3g}",
        "age_words": "The age of the measurement is learned on the way." if law.learns_age else "",
        "past": whole + 2,
        "whole": whole,
        "part": part,
        "lines": lines,
        "streamed": module.streamed,
        "states": [name for name in STATES if name != "correction"],
        "started": started,
        "code": folded.code,
        "call": law_calls({"feedback_step": folded})("feedback_step", given, states, found),
        "age_state": LEARNED[3],
    }
