"""The feedback in C: header, source and self test from its law, which is printed from the expression."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tendonff.ocp.codegen.partial_evaluation import PartialEvaluator
from tendonff.ocp.codegen.precision import Precision
from tendonff.ocp.codegen.printer import literal
from tendonff.ocp.codegen.templates import environment
from tendonff.ocp.feedback.law import LEARNED, NUMBERS, STATES, FeedbackController, FeedbackLaw, feedback_step
from tendonff.ocp.step.render import law_calls

_TEMPLATES = environment("tendonff.compensator.export", "templates/feedback")
_ROWS, _MISSING = 300, 1e30
_TOLERANCE = {Precision.DOUBLE: 1e-12, Precision.FLOAT: 2e-3}
"""Largest departure of the corrections, as a share of the clamp: rounding, which the least squares pass on."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FeedbackModule:
    """Law and signals of an exported feedback.

    Attributes
    ----------
    law : FeedbackLaw
    direction : tuple of float
        Correction of each command per unit of the correction.
    start : float
        First reference of the scenario.
    reference : tuple of float
        Of the golden vectors, one a sample.
    unit, command_unit : str
    """

    law: FeedbackLaw
    direction: tuple[float, ...]
    start: float
    reference: tuple[float, ...]
    unit: str
    command_unit: str


def feedback_files(
    module: FeedbackModule, *, prefix: str, precision: Precision, include: str, provenance: str
) -> dict[str, str]:
    """Texts by file name; `include` is the header with the real type, `provenance` the lines of the comment on top."""
    law = module.law
    printer = PartialEvaluator(prefix=f"{prefix}_feedback", precision=precision, parameters={})
    fixed = {**dict(zip(NUMBERS, law.numbers, strict=True)), "shape": 0.0, "aged_shape": 0.0}
    folded = printer.fold(feedback_step(), fixed=fixed)
    states = {name: f"self->{name}" for name in STATES}
    found = {f"{name}_new": f"&self->{name}" for name in STATES}
    given = {"reference": "wanted", "aged": "aged", "lagged_aged": "lagged_aged", "measured": "taken", "fresh": "fresh"}
    whole, part = law.age
    started = [
        (name, "start" if other != value else literal(value, precision))
        for name, value, other in zip(STATES, law.start(0.0), law.start(1.0), strict=True)
        if name != "correction"
    ]
    golden = _golden(module)

    def numbers(values: Sequence[float]) -> str:
        text = [literal(float(v), precision) for v in values]
        return ",\n".join("    " + ", ".join(text[k : k + 5]) for k in range(0, len(text), 5))

    context = {
        "prefix": prefix,
        "guard": prefix.upper(),
        "real": precision.value,
        "num": lambda value: literal(float(value), precision),
        "include": include,
        "provenance": provenance,
        "law": law,
        "unit": module.unit,
        "command_unit": module.command_unit,
        "sample_s": repr(law.sample_s),
        "delay_ms": f"{1e3 * law.delay_s:.3g}",
        "age_words": "The age of the measurement is learned on the way." if law.learns_age else "",
        "past": whole + 2,
        "whole": whole,
        "part": part,
        "direction": [literal(value, precision) for value in module.direction],
        "states": [name for name in STATES if name != "correction"],
        "start": module.start,
        "started": started,
        "code": folded.code,
        "call": law_calls({"feedback_step": folded})("feedback_step", given, states, found),
        "age_state": LEARNED[3],
        "golden": golden,
        "references": numbers([row[0] for row in golden]),
        "measurements": numbers([row[1] for row in golden]),
        "corrections": numbers([row[2] for row in golden]),
        "tolerance": _TOLERANCE[precision] * law.clamp,
        "far": module.start + 1e3 * max(law.clamp, 1.0),
    }
    names = ("feedback.h", "feedback.c", "feedback_test.c")
    return {f"{prefix}_{name}": _TEMPLATES.get_template(f"{name}.j2").render(context) for name in names}


def _golden(module: FeedbackModule) -> list[tuple[float, float, float]]:
    """Reference, measurement and correction of samples, some measurements missing."""
    rng = np.random.default_rng(7)
    reference = np.resize(np.array(module.reference), _ROWS)
    off = np.cumsum(rng.standard_normal(_ROWS)) * 0.02 * np.ptp(reference)
    controller, found = FeedbackController(module.law, module.start), []
    for k, wanted in enumerate(reference.tolist()):
        seen = _MISSING if k % 50 == 49 else float(reference[max(k - 3, 0)] - off[k])
        correction = controller.step(wanted, float("nan") if seen == _MISSING else seen)
        found.append((wanted, seen, correction))
    return found
