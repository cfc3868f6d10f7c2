"""Parameters of a chain known before a controller runs, to fold into the laws, row by row of the scheme."""

import itertools
from collections.abc import Mapping
from dataclasses import replace

import casadi as ca
import numpy as np

from tendonff.models.tendon.chain import Chain
from tendonff.ocp.codegen.partial_evaluation import PartialEvaluator
from tendonff.ocp.codegen.precision import Precision
from tendonff.ocp.codegen.printer import Law, literal
from tendonff.ocp.step.c_engine import link_ratios
from tendonff.ocp.step.laws import ElementLaws
from tendonff.ocp.step.protocol import Array
from tendonff.ocp.step.scheme import BDF2_CARRY, BDF2_WEIGHT
from tendonff.ocp.step.target_joints import Contact

Weights = tuple[tuple[float, float], ...]
"""Weight H [s] and carry of each row of the scheme."""


def scheme_rows(step_s: float, splits: int = 0) -> Weights:
    """Rows for the first step (implicit Euler), for every later one, and for each halving of a step that is split."""
    halved = ((step_s / 2**k, 0.0) for k in range(1, splits + 1))
    return ((step_s, 0.0), (BDF2_WEIGHT * step_s, BDF2_CARRY), *halved)


def chain_evaluator(
    chain: Chain,
    weights: Weights,
    prefix: str,
    precision: Precision,
    contact: Contact | None = None,
    free: tuple[str, ...] = (),
    *,
    floors: Mapping[str, float] | None = None,
    whole: bool = True,
    record: str = "",
    coefficients: dict[str, tuple[float, ...]] | None = None,
) -> PartialEvaluator:
    """Parameters that fold the laws of a chain for the rows of a scheme.

    On a path in sections (`contact`) a link is the whole tendon, or with `whole` unset its ratio is unknown. Numbers
    that are `free` are known at run time only; of some of them the caller keeps `floors`. Laws that share a `record`
    add to the same `coefficients`.
    """
    reorder = precision is Precision.FLOAT or contact is not None
    ratios = link_ratios(chain.elements.ratio) if contact is None else (1.0,)
    rows = [(weight, ratio) for weight, _ in weights for ratio in ratios]
    numbers = _snapped(chain) if contact is None else contact.constants
    parameters: dict[str, tuple[float, ...]]
    parameters = {name: (value,) * len(rows) for name, value in numbers.items() if name not in free}
    parameters["H"] = tuple(weight for weight, _ in rows)
    floors = dict(floors or {}) | ({} if contact is None else contact.floors)
    gains = False
    if whole or contact is None:
        parameters["ratio"] = tuple(ratio for _, ratio in rows)
        if not any(name.startswith("link_") for name in free):
            gains = True
    folder = PartialEvaluator(
        prefix=prefix,
        precision=precision,
        record=record,
        parameters=parameters,
        reorder=reorder,
        floors=floors,
        steady=() if contact is None else contact.own,
        coefficients={} if coefficients is None else coefficients,
    )
    if gains:
        folder.follow("gain", ElementLaws.of(chain).link_gain())
    return folder


def _snapped(chain: Chain) -> dict[str, float]:
    """Coefficients that differ by rounding only are made equal, so that no code is spent on the difference."""
    numbers = chain.numbers()
    names = [name for name in numbers if name.startswith("friction_")]
    for k, name in enumerate(names):
        for other in names[:k]:
            if abs(numbers[name] - numbers[other]) <= 1e-14 * abs(numbers[other]):
                numbers[name] = numbers[other]
    return numbers


def weighted_sum(law: Law, *names: str) -> Law:
    """A law that is linear in these arguments as their weighted sum: the weights are numbers of the chain."""
    over = [s for s in law.inputs if s.name() in names]
    outputs = {
        name: sum((ca.jacobian(value, s) * s for s in over), start=ca.SX(0)) for name, value in law.outputs.items()
    }
    return replace(law, outputs=outputs)


def record_code(folder: PartialEvaluator, columns: Mapping[str, tuple[float, ...]]) -> tuple[str, str]:
    """Type of the record of what depends on the weight H, and a constant array of its rows, `<prefix>_rows`."""
    real, name = folder.precision.value, folder.weights_type
    fields = "\n".join(f"    {real} {column};" for column in columns)
    each = [", ".join(literal(v, folder.precision) for v in row) for row in zip(*columns.values(), strict=True)]
    rows = "\n".join(f"    {{ {row} }}," for row in each)
    array = f"{name.removesuffix('_weights')}_rows[{len(each)}]"
    return f"typedef struct {{\n{fields}\n}} {name};\n", f"const {name} {array} = {{\n{rows}\n}};\n"


def rest_statements(slopes: Array, precision: Precision, array: str = "self->x") -> str:
    """C statements for a state at rest that is so many times `tension`; an int j must be there."""
    lines = []
    borders = [0, *(np.flatnonzero(np.abs(np.diff(slopes)) > 1e-14 * np.abs(slopes).max()) + 1).tolist(), len(slopes)]
    for first, last in itertools.pairwise(borders):
        slope = float(slopes[first])
        value = f"tension * {literal(slope, precision)}" if slope else literal(0.0, precision)
        if last - first == 1:
            lines.append(f"    {array}[{first}] = {value};")
        else:
            lines.append(f"    for (j = {first}; j < {last}; j++) {{\n        {array}[j] = {value};\n    }}")
    return "\n".join(lines)
