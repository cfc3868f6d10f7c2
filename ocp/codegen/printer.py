"""Print CasADi expressions as straight-line C99.

CasADi's own generator passes arrays of pointers with a null check per entry and writes double literals and double
maths whatever the real type. Element laws are called inside the innermost loop and must also run on controllers
without double arithmetic, so they are printed here as `static` functions of plain values.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca

from tendonff.ocp.codegen.precision import Precision
from tendonff.ocp.errors import CodeError

_BINARY = {
    ca.OP_ADD: "{0} + {1}",
    ca.OP_SUB: "{0} - {1}",
    ca.OP_MUL: "{0} * {1}",
    ca.OP_DIV: "{0} / {1}",
    ca.OP_LT: "({0} < {1}) ? {one} : {zero}",
    ca.OP_LE: "({0} <= {1}) ? {one} : {zero}",
    ca.OP_EQ: "({0} == {1}) ? {one} : {zero}",
    ca.OP_NE: "({0} != {1}) ? {one} : {zero}",
    ca.OP_FMIN: "({0} < {1}) ? {0} : {1}",
    ca.OP_FMAX: "({0} > {1}) ? {0} : {1}",
    ca.OP_IF_ELSE_ZERO: "({0} != {zero}) ? {1} : {zero}",
    ca.OP_AND: "(({0} != {zero}) && ({1} != {zero})) ? {one} : {zero}",
    ca.OP_OR: "(({0} != {zero}) || ({1} != {zero})) ? {one} : {zero}",
}
_UNARY = {
    ca.OP_NEG: "-{0}",
    ca.OP_SQ: "{0} * {0}",
    ca.OP_TWICE: "{0} + {0}",
    ca.OP_INV: "{one} / {0}",
    ca.OP_NOT: "({0} == {zero}) ? {one} : {zero}",
    ca.OP_SIGN: "({0} > {zero}) ? {one} : (({0} < {zero}) ? -{one} : {zero})",
    ca.OP_SQRT: "sqrt{f}({0})",
    ca.OP_EXP: "exp{f}({0})",
    ca.OP_LOG: "log{f}({0})",
    ca.OP_TANH: "tanh{f}({0})",
    ca.OP_FABS: "fabs{f}({0})",
}


def literal(value: float, precision: Precision) -> str:
    """A C literal that reads back as the same number: 17 significant digits, or 9 and a suffix for float.

    Parameters
    ----------
    value : float
        Finite.
    precision : Precision
    """
    digits, suffix = ("9", "f") if precision is Precision.FLOAT else ("17", "")
    text = format(value, f".{digits}g")
    if not any(mark in text for mark in ".en"):
        text += ".0"
    return text + suffix


@dataclass(frozen=True, slots=True, kw_only=True)
class CFunction:
    """A scalar function in C: every input by value, every output through a pointer.

    Parameters
    ----------
    name : str
        C identifier.
    inputs, outputs : tuple of str
        Names, in order.
    code : str
        The whole definition.
    """

    name: str
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    code: str


def c_function(
    name: str, comment: str, inputs: Sequence[ca.SX], outputs: dict[str, ca.SX], precision: Precision, real: str
) -> CFunction:
    """Print scalar expressions as one static C function without branches that jump or loops.

    Parameters
    ----------
    name : str
        C identifier.
    comment : str
        What it computes, with units and source.
    inputs : sequence of ca.SX
        Scalar symbols; their names become the arguments.
    outputs : dict of str to ca.SX
        Scalar expressions by name.
    precision : Precision
        Decides literals and the suffix of the maths functions.
    real : str
        Name of the real type in the surrounding file.

    Raises
    ------
    CodeError
        If an expression uses an operation that has no C spelling here.
    """
    names = [symbol.name() for symbol in inputs]
    # Dense, because the tape numbers the structural nonzeros of its output.
    results = ca.densify(ca.vertcat(*outputs.values()))
    tape = ca.Function(name, [ca.vertcat(*inputs)], [results], {"cse": True})
    out_names = list(outputs)
    constants = {"zero": literal(0.0, precision), "one": literal(1.0, precision)}
    suffix = "f" if precision is Precision.FLOAT else ""
    register: dict[int, str] = {}
    lines: list[str] = []
    used: set[str] = set()
    for k in range(tape.n_instructions()):
        op = tape.instruction_id(k)
        ins, outs = tape.instruction_input(k), tape.instruction_output(k)
        if op == ca.OP_CONST:
            text = literal(tape.instruction_constant(k), precision)
            register[outs[0]] = text if not text.startswith("-") else f"({text})"
        elif op == ca.OP_INPUT:
            register[outs[0]] = names[ins[1]]
            used.add(names[ins[1]])
        elif op == ca.OP_OUTPUT:
            lines.append(f"    *{out_names[outs[1]]} = {register[ins[0]]};")
        else:
            pattern = _UNARY.get(op) or _BINARY.get(op)
            if pattern is None:
                raise CodeError(
                    f"{name}: CasADi operation {op} has no C spelling; add it to tendonff.ocp.codegen.printer"
                )
            value = pattern.format(*(register[i] for i in ins), f=suffix, **constants)
            variable = f"t{k}"
            lines.append(f"    const {real} {variable} = {value};")
            register[outs[0]] = variable
    lines[:0] = [f"    (void){unused};" for unused in names if unused not in used]
    arguments = [f"{real} {n}" for n in names] + [f"{real} *{n}" for n in out_names]
    head = f"/* {comment} */\nstatic void {name}(\n    " + ",\n    ".join(arguments) + ")\n{\n"
    return CFunction(name=name, inputs=tuple(names), outputs=tuple(out_names), code=head + "\n".join(lines) + "\n}\n")
