"""Laws as CasADi expressions, and how they are printed as straight-line C99: the table of operators, and literals.

CasADi's own generator passes arrays of pointers with a null check per entry and writes double literals and double
maths whatever the real type. Element laws are called inside the innermost loop and must also run on controllers
without double arithmetic, so they are printed here as `static` functions of plain values.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import casadi as ca

from tendonff.ocp.codegen.precision import Precision
from tendonff.ocp.errors import CodeError


@dataclass(frozen=True, slots=True, kw_only=True)
class Law:
    """Law with named scalar inputs and named scalar outputs."""

    # name, comment: identifier, and what it computes with source
    name: str
    comment: str
    inputs: tuple[ca.SX, ...]  # scalar symbols
    outputs: dict[str, ca.SX]  # expressions
    # arguments that stay while the others change from call to call, as in a search: see `PartialEvaluator.split`
    held: tuple[str, ...] = ()

    def function(self) -> ca.Function:
        """The law as a CasADi function."""
        return ca.Function(self.name, [*self.inputs], [*self.outputs.values()])

    def without_zeros(self) -> "Law":
        """The law without outputs that are zero whatever its inputs."""
        return replace(self, outputs={name: value for name, value in self.outputs.items() if not value.is_zero()})


@dataclass(frozen=True, slots=True)
class Operator:
    """Operation of a CasADi tape."""

    text: str  # C, with {0} and {1} for operands, {f} for the suffix of maths functions, {zero} and {one} for literals
    evaluate: Callable[..., float]  # what it gives for numbers
    operands: int = 2  # 1 or 2
    condition: bool = False  # the text is a condition: true or false, which C code uses where it stands
    of_conditions: bool = False  # the operands are conditions too


def _truth(text: str, evaluate: Callable[..., bool], *, operands: int = 2, of_conditions: bool = False) -> Operator:
    return Operator(text, lambda *a: float(evaluate(*a)), operands, condition=True, of_conditions=of_conditions)


def _function(name: str, evaluate: Callable[[float], float]) -> Operator:
    return Operator(f"{name}{{f}}({{0}})", evaluate, 1)


SELECT = -1
"""Our own operation: condition ? a : b."""

OPERATORS: dict[int, Operator] = {
    ca.OP_ADD: Operator("{0} + {1}", lambda a, b: a + b),
    ca.OP_SUB: Operator("{0} - {1}", lambda a, b: a - b),
    ca.OP_MUL: Operator("{0} * {1}", lambda a, b: a * b),
    ca.OP_DIV: Operator("{0} / {1}", lambda a, b: a / b),
    ca.OP_POW: Operator("pow{f}({0}, {1})", math.pow),
    ca.OP_CONSTPOW: Operator("pow{f}({0}, {1})", math.pow),
    ca.OP_IF_ELSE_ZERO: Operator("({0} != {zero}) ? {1} : {zero}", lambda a, b: b if a else 0.0),
    ca.OP_FMIN: Operator("({0} < {1}) ? {0} : {1}", min),
    ca.OP_FMAX: Operator("({0} > {1}) ? {0} : {1}", max),
    ca.OP_LT: _truth("{0} < {1}", lambda a, b: a < b),
    ca.OP_LE: _truth("{0} <= {1}", lambda a, b: a <= b),
    ca.OP_EQ: _truth("{0} == {1}", lambda a, b: a == b),
    ca.OP_NE: _truth("{0} != {1}", lambda a, b: a != b),
    ca.OP_AND: _truth("{0} && {1}", lambda a, b: bool(a) and bool(b), of_conditions=True),
    ca.OP_OR: _truth("{0} || {1}", lambda a, b: bool(a) or bool(b), of_conditions=True),
    ca.OP_NOT: _truth("!{0}", lambda a: not a, operands=1, of_conditions=True),
    ca.OP_NEG: Operator("-{0}", lambda a: -a, 1),
    ca.OP_SIGN: Operator(
        "({0} > {zero}) ? {one} : (({0} < {zero}) ? -{one} : {zero})", lambda a: float((a > 0) - (a < 0)), 1
    ),
    ca.OP_SQRT: _function("sqrt", math.sqrt),
    ca.OP_EXP: _function("exp", math.exp),
    ca.OP_LOG: _function("log", math.log),
    ca.OP_TANH: _function("tanh", math.tanh),
    ca.OP_ATANH: _function("atanh", math.atanh),
    ca.OP_SIN: _function("sin", math.sin),
    ca.OP_COS: _function("cos", math.cos),
    ca.OP_FABS: _function("fabs", abs),
}
"""Every operation that generated code may use; squares, doubles, inverses and choices are made of these."""


def operator(op: int, law: str) -> Operator:
    """Known properties of an operation of a CasADi tape.

    Raises
    ------
    CodeError
        If it has no C spelling here.
    """
    if (known := OPERATORS.get(op)) is None:
        raise CodeError(f"{law}: CasADi operation {op} has no C spelling; add it to tendonff.ocp.codegen.printer")
    return known


def literal(value: float, precision: Precision) -> str:
    """A C literal that reads back as the same number: 17 significant digits, or 9 and a suffix for float."""
    digits, suffix = ("9", "f") if precision is Precision.FLOAT else ("17", "")
    text = format(value, f".{digits}g")
    if not any(mark in text for mark in ".en"):
        text += ".0"
    return text + suffix
