"""Switches of laws rounded off, for solvers that need derivatives.

The laws stay what they are: in their expressions every abs(x) becomes sqrt(x^2 + w^2), and every comparison of an x
with zero becomes the share (1 + x/sqrt(x^2 + w^2))/2. In friction, eqs. (5a), (5b), x is a sliding speed: below the
width w a bristle creeps instead of sticking, and pulling passes gradually into releasing. In a link x is its tension:
it goes slack gradually. Above a few widths nothing changes: the relative error is (w/x)^2/2 at most.
"""

from collections.abc import Callable

import casadi as ca
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Width = Callable[[ca.SX], ca.SX]


def switches(function: ca.Function) -> ca.Function:
    """Arguments of abs and of comparisons with zero in a function of dense columns; shape (switches,)."""
    inputs, found = function.sx_in(), [ca.SX(0, 1)]

    def collect(x: ca.SX) -> ca.SX:
        found.append(x)
        return ca.SX(1)

    _rounded(function, inputs, collect)
    return ca.Function("switches", inputs, [ca.vertcat(*found)])


def smoothed(function: ca.Function, widths: Array) -> ca.Function:
    """The function with its switches rounded off.

    Parameters
    ----------
    function : ca.Function
        Of dense columns, made of SX.
    widths : ndarray, shape (switches,)
        In the units of `switches(function)`, > 0.
    """
    inputs, left = function.sx_in(), iter(widths.tolist())
    outputs = _rounded(function, inputs, lambda _: ca.SX(next(left)))
    return ca.Function(function.name(), inputs, outputs, function.name_in(), function.name_out())


def _rounded(function: ca.Function, inputs: list[ca.SX], width: Width) -> list[ca.SX]:
    """A function's operations one by one, with rounded switches; `width` is asked for each in turn."""
    work: dict[int, ca.SX] = {}
    shares: set[int] = set()  # places of `work` that hold a share between 0 and 1 where a condition was
    outputs = [ca.SX(function.sparsity_out(k)) for k in range(function.n_out())]
    for k in range(function.n_instructions()):
        op, at, (to, *element) = (
            function.instruction_id(k),
            function.instruction_input(k),
            function.instruction_output(k),
        )
        is_share = False
        if op == ca.OP_INPUT:
            value = inputs[at[0]].nz[at[1]]
        elif op == ca.OP_CONST:
            value = ca.SX(function.instruction_constant(k))
        elif op == ca.OP_OUTPUT:
            outputs[to].nz[element[0]] = work[at[0]]
            continue
        elif op == ca.OP_FABS:
            value = _size(work[at[0]], width)
        elif op in (ca.OP_LT, ca.OP_LE) and any(work[each].is_zero() for each in at):  # x < 0, or 0 < x
            x = work[at[1]] if work[at[0]].is_zero() else -work[at[0]]
            value, is_share = (1 + x / _size(x, width)) / 2, True
        elif op == ca.OP_NOT and at[0] in shares:
            value, is_share = 1 - work[at[0]], True
        elif op == ca.OP_IF_ELSE_ZERO and at[0] in shares:
            value = work[at[0]] * work[at[1]]
        else:
            value = ca.SX.unary(op, work[at[0]]) if len(at) == 1 else ca.SX.binary(op, work[at[0]], work[at[1]])
        work[to] = value
        shares = shares | {to} if is_share else shares - {to}
    return outputs


def _size(x: ca.SX, width: Width) -> ca.SX:
    """Rounded abs(x)."""
    return ca.sqrt(x * x + width(x) ** 2)
