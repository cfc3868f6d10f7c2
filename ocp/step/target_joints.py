"""The chain in C for a controller where the path moves or has sections: friction of each bend, and the schemes."""

import math
from dataclasses import dataclass, replace
from fractions import Fraction

import casadi as ca
import numpy as np

from tendonff.models.chain import Chain
from tendonff.models.layout import fields_of
from tendonff.ocp.codegen.law import Law
from tendonff.ocp.codegen.partial_evaluation import Specialiser
from tendonff.ocp.codegen.precision import Precision
from tendonff.ocp.codegen.printer import literal, real_type
from tendonff.ocp.step.joints import Joints, equal_numbers
from tendonff.ocp.step.laws import ElementLaws, symbolic

_TANH = """/* tanh without a library where friction of one mass is moderate: a fraction, exact to rounding there. */
static {real} {prefix}_short_tanh({real} x)
{{
    const {real} y = x * x;
    return (y > {most}) ? tanh{f}(x) : ((x * {above}) / {below});
}}
"""
_SPARE = 1.25
"""Factor on the largest argument over the motion up to which the fraction holds."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Contact:
    """Friction of the bends of a path, as C.

    Parameters
    ----------
    laws : ElementLaws
        With one symbol for numbers that are always equal.
    own : tuple of str
        Numbers that differ from bend to bend or with the joints: fields of the record.
    constants : dict of str to float
        The chain's other numbers.
    record : str
        Type of the record.
    functions : str
        `touch`, which renews the records of bends that move, and `contact_init`.
    """

    laws: ElementLaws
    own: tuple[str, ...]
    constants: dict[str, float]
    record: str
    functions: str


def contact_code(chain: Chain, joints: Joints, prefix: str, precision: Precision) -> Contact:
    """Friction of the bends.

    Parameters
    ----------
    chain : Chain
    joints : Joints
        Of the chain.
    prefix : str
        Prefix of every C name in the file.
    precision : Precision
    """
    twins, real = equal_numbers(chain), real_type(precision)
    friction = symbolic(chain.friction, "friction_", twins)
    link = symbolic(chain.link, "link_")
    laws = ElementLaws(link, friction, tuple(fields_of(link).values()), _distinct(friction))
    printer = Specialiser(
        prefix=prefix,
        precision=precision,
        parameters={},
        reorder=True,
        functions={ca.OP_TANH: "short_tanh"},
    )
    at_start = {name: _of_masses(chain, value) for name, value in fields_of(chain.friction, "friction_").items()}
    at_start["piece_mass_kg"] = _of_masses(chain, chain.elements.piece.mass_kg)
    bends = [b.first for b in joints.bends]
    known = {name: values[bends] for name, values in at_start.items()}
    printed: dict[tuple[object, ...], str] = {}
    texts, calls, moved = [], [], set()
    for k, bend in enumerate(joints.bends):
        if bend.joint < 0:
            continue
        law = _contact_law(chain, bend.first, twins)
        moved |= set(law.outputs)
        key = tuple(str(e) for e in law.outputs.values())
        if key not in printed:
            printed[key] = f"contact_{len(printed) + 1}"
            texts.append(printer.fold(law, printed[key]).code)
        outputs = ", ".join(f"&contact[{k}].{name}" for name in law.outputs)
        calls.append(f"    {prefix}_{printed[key]}(path->angle[{k}], {outputs});")
    own = tuple(
        name
        for name, values in known.items()
        if name.removeprefix("friction_") not in twins and (name in moved or np.ptp(values) > 0)
    ) or ("piece_mass_kg",)
    # A function for each set of coefficients gives what moves; the rest is written once.
    types = prefix.rpartition("_")[0]
    init = [
        f"    contact[{k}].{name} = {literal(float(known[name][k]), precision)};"
        for k in range(len(bends))
        for name in own
    ]
    touch = [
        "/* Friction where the joints stand now. */",
        f"static void {prefix}_touch(const {types}_path *path, {prefix}_contact *contact)",
        "{",
        *calls,
        "}",
        "",
    ]
    functions = [
        *([_helper(chain, prefix, precision), *texts, *touch] if calls else []),
        "/* Friction where they stand at the start. */",
        f"static void {prefix}_contact_init({prefix}_contact *contact)",
        "{",
        *init,
        "}",
        "",
    ]
    record = [
        f"typedef struct {{ /* friction of one mass of a bend */\n    {real} {', '.join(own)};",
        f"}} {prefix}_contact;\n",
    ]
    everything = {**chain.numbers(), **{name: float(values[0]) for name, values in known.items()}}
    return Contact(
        laws=laws,
        own=own,
        constants={name: value for name, value in everything.items() if name not in own},
        record="\n".join(record),
        functions="\n".join(functions),
    )


def _helper(chain: Chain, prefix: str, precision: Precision) -> str:
    """Tanh of what the largest wrap angles over the motion need: a few terms of its continued fraction."""
    e, motion = chain.elements, chain.motion
    joints = {} if motion is None else dict(zip(motion.names, motion.angle_rad.T, strict=True))
    angles = e.path.at(joints).angle_rad.max(axis=0)
    columns = {name: _of_masses(chain, value) for name, value in fields_of(e.contact).items()}
    law = replace(e.contact, **columns).on_piece(angles, e.angle_share(angles), e.path.length_share)  # type: ignore[type-var]
    slip = max(float(np.max(mu)) for mu in law.slip_coefficients)
    x = _SPARE * math.atanh(min(slip, 0.7)) + 0.01
    above, below = tanh_fraction(x, 2.0**-24 if precision is Precision.FLOAT else 2.0**-53)

    def text(factors: list[int]) -> str:
        nested = literal(float(factors[-1]), precision)
        for factor in factors[-2::-1]:
            nested = f"({literal(float(factor), precision)} + (y * {nested}))"
        return nested

    return _TANH.format(
        prefix=prefix,
        real=real_type(precision),
        f="f" if precision is Precision.FLOAT else "",
        most=literal(x * x, precision),
        above=text(above),
        below=text(below),
    )


def tanh_fraction(most: float, rounding: float) -> tuple[list[int], list[int]]:
    """Polynomials P, Q in y = x^2, lowest power first, with tanh x = x P/Q to rounding for abs(x) <= `most`.

    Convergents of the continued fraction x/(1 + y/(3 + y/(5 + ...))) lie on both sides of tanh in turn.

    Parameters
    ----------
    most : float
    rounding : float
        Relative error allowed.
    """
    y, rows = Fraction(most) ** 2, [([0], [1]), ([1], [1])]
    while True:
        odd = 2 * len(rows) - 1
        rows.append((_next(odd, rows[-1][0], rows[-2][0]), _next(odd, rows[-1][1], rows[-2][1])))
        last, now = (_value(above, y) / _value(below, y) for above, below in rows[-2:])
        if abs(now - last) <= Fraction(rounding) / 4 * now:
            return rows[-2]


def _value(factors: list[int], y: Fraction) -> Fraction:
    return sum((c * y**k for k, c in enumerate(factors)), Fraction(0))


def _next(odd: int, last: list[int], before: list[int]) -> list[int]:
    grown = [0, *before]
    size = max(len(last), len(grown))
    first, second = last + [0] * (size - len(last)), grown + [0] * (size - len(grown))
    result = [odd * a + b for a, b in zip(first, second, strict=True)]
    while result[-1] == 0:
        result.pop()
    return result


def _distinct(record: object) -> tuple[ca.SX, ...]:
    found: dict[str, ca.SX] = {s.name(): s for s in fields_of(record).values()}
    return tuple(found.values())


def _of_masses(chain: Chain, value: object) -> np.ndarray:
    return np.broadcast_to(np.asarray(value, float), (chain.count,))


def _contact_law(chain: Chain, mass: int, twins: dict[str, str]) -> Law:
    """Numbers of friction on one mass that follow its wrap angle."""
    e = chain.elements
    own = {name: float(_of_masses(chain, value)[mass]) for name, value in fields_of(e.contact).items()}
    length = float(e.path.length_share[mass])
    angle = ca.SX.sym("angle_rad")
    share = angle / e.path.total_angle_rad if e.path.total_angle_rad > 0 else length
    there = fields_of(replace(e.contact, **own).on_piece(angle, share, length))  # type: ignore[type-var]
    outputs = {
        f"friction_{name}": value
        for name, value in there.items()
        if name not in twins and isinstance(value, ca.SX) and not value.is_constant()
    }
    return Law(
        name="contact",
        comment="Friction of a mass for a wrap angle [rad], eqs. (8), (9).",
        inputs=(angle,),
        outputs=outputs,
    )
