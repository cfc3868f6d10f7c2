"""The chain in C for a controller where the path moves or has sections: friction of each bend, and the schemes."""

from dataclasses import dataclass, replace

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

_TANH = """/* tanh without a library: a fraction that is exact to rounding where friction of one mass is moderate. */
static {real} {prefix}_short_tanh({real} x)
{{
    const {real} y = x * x;
    return (y > {one}) ? tanh{f}(x) : (x * ({a0} + (y * ({a1} + (y * ({a2} + y)))))) / ({a0} + (y * ({b1} + (y * ({b2} + (y * {b3}))))));
}}
"""
_FRACTION = {"a0": 135135.0, "a1": 17325.0, "a2": 378.0, "b1": 62370.0, "b2": 3150.0, "b3": 28.0}
"""tanh x = x (a0 + a1 y + a2 y^2 + y^3)/(a0 + b1 y + b2 y^2 + b3 y^3), y = x^2: its continued fraction, cut off."""


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
        reorder=precision is Precision.FLOAT,
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
        law = _contact_law(chain, laws, bend.first, twins)
        moved |= set(law.outputs)
        key = tuple(str(e) for e in law.outputs.values())
        if key not in printed:
            printed[key] = f"contact_{len(printed) + 1}"
            texts.append(printer.fold(law, printed[key]).code)
        outputs = ", ".join(f"&contact[{k}].{name}" for name in law.outputs)
        calls.append(f"    {prefix}_{printed[key]}(path->bend[{k}].angle, {outputs});")
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
        *([_helper(prefix, precision), *texts, *touch] if calls else []),
        "/* Friction where they stand at the start. */",
        f"static void {prefix}_contact_init({prefix}_contact *contact)",
        "{",
        *init,
        "}",
        "",
    ]
    record = [f"typedef struct {{ /* friction of one mass of a bend */\n    {real} {', '.join(own)};", f"}} {prefix}_contact;\n"]
    everything = {**chain.numbers(), **{name: float(values[0]) for name, values in known.items()}}
    return Contact(
        laws=laws,
        own=own,
        constants={name: value for name, value in everything.items() if name not in own},
        record="\n".join(record),
        functions="\n".join(functions),
    )


def _helper(prefix: str, precision: Precision) -> str:
    numbers = {name: literal(value, precision) for name, value in _FRACTION.items()}
    suffix = "f" if precision is Precision.FLOAT else ""
    return _TANH.format(
        prefix=prefix, real=real_type(precision), one=literal(1.0, precision), f=suffix, **numbers
    )


def _distinct(record: object) -> tuple[ca.SX, ...]:
    found: dict[str, ca.SX] = {s.name(): s for s in fields_of(record).values()}
    return tuple(found.values())


def _of_masses(chain: Chain, value: object) -> np.ndarray:
    return np.broadcast_to(np.asarray(value, float), (chain.count,))


def _contact_law(chain: Chain, laws: ElementLaws, mass: int, twins: dict[str, str]) -> Law:
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
