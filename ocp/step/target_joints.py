"""The chain in C for a controller where the path moves or has sections: friction of each bend, and the schemes."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import zip_longest

import casadi as ca
import numpy as np

from tendonff.models.layout import fields_of
from tendonff.models.tendon.bounds import at_least
from tendonff.models.tendon.chain import Chain
from tendonff.models.tendon.friction import COEFFICIENT_FLOOR
from tendonff.ocp.codegen.partial_evaluation import PartialEvaluator
from tendonff.ocp.codegen.precision import Precision
from tendonff.ocp.codegen.printer import Law, literal
from tendonff.ocp.step.joints import Joints
from tendonff.ocp.step.laws import ElementLaws, symbolic, twins_of, way_of

_TANH = """/* tanh without a library where friction of one mass is moderate: a fraction, exact to rounding there. */
{kind} {real} {prefix}_short_tanh({real} x)
{{
    const {real} y = x * x;
    return (y > {most}) ? tanh{f}(x) : ((x * {above}) / {below});
}}
"""
_COEFFICIENTS = "friction_mu_"
SLOPE_OF = "slope_of_"
_SPARE = 1.25
"""Factor on the largest argument over the motion up to which the fraction holds."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Contact:
    """Friction of the bends of a path, as C."""

    types: str  # prefix of the C names of the path
    prefix: str  # of its own
    laws: ElementLaws  # with one symbol for numbers that are always equal
    own: tuple[str, ...]  # numbers that differ from bend to bend or with the joints: fields of the record
    # constants, floors: the chain's other numbers, and lower bounds of some of those in the record
    constants: dict[str, float]
    floors: dict[str, float]
    record: str  # type of the record
    # `contact_init`, and where joints move bends `touch`, which renews their records. Where friction is settable,
    # `touch_all` renews all of them; both then take factors on the coefficients, pulling and releasing
    functions: str
    inline: str = ""  # those of a step, where a header has them


def contact_code(
    chain: Chain,
    joints: Joints,
    prefix: str,
    precision: Precision,
    *,
    settable: bool = False,
    types: str = "",
    shared: bool = False,
) -> Contact:
    """Friction of the bends.

    Where it is settable, coefficients carry factors that are known at run time only. `types` is the prefix of the C
    names of the path; default: `prefix` without its last word. `shared`: those of a step stand in a header.
    """
    types = types or prefix.rpartition("_")[0]
    twins = twins_of(chain, ways_differ=settable)
    friction = symbolic(chain.friction, "friction_", twins)
    known = {name: _of_masses(chain, value) for name, value in fields_of(chain.friction, "friction_").items()}
    known["piece_mass_kg"] = _of_masses(chain, chain.elements.piece.mass_kg)
    known = {name: values[[b.first for b in joints.bends]] for name, values in known.items()}
    known |= {n: np.maximum(values, COEFFICIENT_FLOOR) for n, values in known.items() if n.startswith(_COEFFICIENTS)}
    texts, calls, renewed = _renewals(chain, joints, _printer(prefix, precision, shared), twins, settable=settable)
    own = tuple(
        name
        for name, values in known.items()
        if name.removeprefix("friction_") not in twins and (name in renewed or np.ptp(values) > 0)
    ) or ("piece_mass_kg",)
    more = f", {precision.value} pull, {precision.value} release" if settable else ""
    head = f"const {types}_path *path, {prefix}_contact *contact{more}"
    if all(calls[False][k].split("(")[0] == text.split("(")[0] for k, text in calls[True].items()):
        calls[True] = {}
    moving = {alike: [t for k, t in made.items() if joints.bends[k].joint >= 0] for alike, made in calls.items()}
    init = [
        f"    contact[{k}].{name} = {literal(float(known[name][k]), precision)};"
        for k in range(len(joints.bends))
        for name in own
    ]
    kind = "static inline" if shared else "static"
    inline = [*([_helper(chain, prefix, precision, kind), *texts] if calls[False] else [])]
    if joints.names:
        inline += _function(
            "Friction where the joints stand now.", f"{kind} void {prefix}_touch", head, _either(moving, types)
        )
    rare = "void" if shared else "static void"
    functions = [
        *(
            _function("Friction everywhere.", f"{rare} {prefix}_touch_all", head, [*calls[False].values()])
            if settable
            else []
        ),
        *_function("Friction at the start.", f"{rare} {prefix}_contact_init", f"{prefix}_contact *contact", init),
    ]
    everything = {**chain.numbers(), **{name: float(values[0]) for name, values in known.items()}}
    return Contact(
        types=types,
        prefix=prefix,
        laws=replace(ElementLaws.of(chain), friction=friction, friction_symbols=_distinct(friction)),
        own=own,
        constants={name: value for name, value in everything.items() if name not in own},
        floors={name: COEFFICIENT_FLOOR for name in own if name.startswith(_COEFFICIENTS)},
        record=_bend_record("friction of one mass of a bend", precision, own, f"{prefix}_contact"),
        functions="\n".join(functions if shared else [*inline, *functions]),
        inline="\n".join(inline) if shared else "",
    )


def slopes_code(chain: Chain, joints: Joints, prefix: str, precision: Precision) -> tuple[str, tuple[str, ...]]:
    """Change of settable friction with its factors: a record, the function that fills it, and its fields.

    Fields are numbers of friction with `SLOPE_OF` in front; the path's C names have the prefix without its last word.
    """
    twins, printer = twins_of(chain, ways_differ=True), _printer(prefix, precision, shared=False)
    texts, calls, fields = _renewals(chain, joints, printer, twins, settable=True, slopes=True)
    names = tuple(sorted(fields))
    real = precision.value
    head = f"const {prefix.rpartition('_')[0]}_path *path, {prefix}_slopes *contact, {real} pull, {real} release"
    lines = [
        _bend_record("change of friction of one mass of a bend with a factor", precision, names, f"{prefix}_slopes"),
        _helper(chain, prefix, precision, "static"),
        *texts,
        *_function("The same everywhere.", f"static void {prefix}_slopes_all", head, [*calls[False].values()]),
    ]
    return "\n".join(lines), names


def _bend_record(comment: str, precision: Precision, names: Sequence[str], name: str) -> str:
    fields = "".join(f"    {precision} {field};\n" for field in names)
    return f"typedef struct {{ /* {comment} */\n{fields}}} {name};\n"


def _printer(prefix: str, precision: Precision, shared: bool) -> PartialEvaluator:
    return PartialEvaluator(
        prefix=prefix,
        precision=precision,
        shared=shared,
        parameters={},
        reorder=True,
        functions={ca.OP_TANH: "short_tanh"},
        steady=("pull", "release"),
    )


def _renewals(
    chain: Chain,
    joints: Joints,
    printer: PartialEvaluator,
    twins: dict[str, str],
    *,
    settable: bool,
    slopes: bool = False,
) -> tuple[list[str], dict[bool, dict[int, str]], set[str]]:
    """Functions of bends, calls by bend and by whether both ways have one factor, and the fields that they fill."""
    printed: dict[tuple[str, ...], str] = {}
    texts, renewed = [], set[str]()
    calls: dict[bool, dict[int, str]] = {False: {}, True: {}}
    for k, bend in enumerate(joints.bends):
        if bend.joint < 0 and not settable:
            continue
        for alike in (False, True) if settable and bend.joint >= 0 and not slopes else (False,):
            factors = ("pull", "pull" if alike else "release") if settable else ()
            law = _contact_law(chain, bend.first, twins, factors, slopes=slopes)
            renewed |= set(law.outputs)
            key = tuple(str(e) for e in law.outputs.values())  # bends with the same coefficients share a function
            if key not in printed:
                printed[key] = f"contact_{len(printed) + 1}"
                texts.append(printer.fold(law, printed[key]).code)
            results = ca.vertcat(*law.outputs.values())
            given = [s.name() for s in law.inputs if ca.depends_on(results, s)]
            given = [f"path->angle[{k}]" if name == "angle_rad" else name for name in given]
            arguments = [*given, *(f"&contact[{k}].{name}" for name in law.outputs)]
            calls[alike][k] = f"    {printer.prefix}_{printed[key]}({', '.join(arguments)});"
    return texts, calls, renewed


def _either(calls: dict[bool, list[str]], types: str) -> list[str]:
    """Statements: fewer where friction is the same both ways."""
    if not calls[True]:
        return calls[False]
    return [
        f"    if ({types}_is_within(pull, release, release) != 0) {{ /* the same factor both ways */",
        *(f"    {line}" for line in calls[True]),
        "    } else {",
        *(f"    {line}" for line in calls[False]),
        "    }",
    ]


def _function(comment: str, name: str, arguments: str, lines: list[str]) -> list[str]:
    names = ("path", "contact", "pull", "release")
    idle = [n for n in names if f" {n}" in f" {arguments}".replace("*", " ") and not any(n in line for line in lines)]
    return [
        f"/* {comment} */",
        f"{name}({arguments})",
        "{",
        *(f"    (void){n};" for n in idle),
        *lines,
        "}",
        "",
    ]


def _helper(chain: Chain, prefix: str, precision: Precision, kind: str) -> str:
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
        kind=kind,
        prefix=prefix,
        real=precision.value,
        f="f" if precision is Precision.FLOAT else "",
        most=literal(x * x, precision),
        above=text(above),
        below=text(below),
    )


def tanh_fraction(most: float, rounding: float) -> tuple[list[int], list[int]]:
    """Polynomials P, Q in y = x^2, lowest power first, with tanh x = x P/Q to rounding for abs(x) <= `most`.

    Convergents of the continued fraction x/(1 + y/(3 + y/(5 + ...))) lie on both sides of tanh in turn.
    """
    y = Fraction(most) ** 2
    rows: list[tuple[list[int], list[int]]] = [([], [1]), ([1], [1])]
    while True:
        odd = 2 * len(rows) - 1
        rows.append((_next(odd, rows[-1][0], rows[-2][0]), _next(odd, rows[-1][1], rows[-2][1])))
        last, now = (_value(above, y) / _value(below, y) for above, below in rows[-2:])
        if abs(now - last) <= Fraction(rounding) / 4 * now:
            return rows[-2]


def _value(factors: list[int], y: Fraction) -> Fraction:
    return sum((c * y**k for k, c in enumerate(factors)), Fraction(0))


def _next(odd: int, last: list[int], before: list[int]) -> list[int]:
    return [odd * a + b for a, b in zip_longest(last, [0, *before], fillvalue=0)]


def _distinct(record: object) -> tuple[ca.SX, ...]:
    found: dict[str, ca.SX] = {s.name(): s for s in fields_of(record).values()}
    return tuple(found.values())


def _of_masses(chain: Chain, value: object) -> np.ndarray:
    return np.broadcast_to(np.asarray(value, float), (chain.count,))


def _contact_law(chain: Chain, mass: int, twins: dict[str, str], factor_names: tuple[str, ...], *, slopes: bool) -> Law:
    """Numbers of friction on one mass that follow its wrap angle and, where there are any, factors by direction."""
    e = chain.elements
    symbols = {name: ca.SX.sym(name) for name in factor_names}
    factors = dict(zip(("pull", "release"), (symbols[name] for name in factor_names), strict=False))
    own: dict[str, object] = {}
    for name, value in fields_of(e.contact).items():
        number = float(_of_masses(chain, value)[mass])
        own[name] = number * factors[way_of(name)] if factors and way_of(name) else number
    length = float(e.path.length_share[mass])
    angle = ca.SX.sym("angle_rad")
    share = e.angle_share(angle) if e.path.total_angle_rad > 0 else length
    there = fields_of(replace(e.contact, **own).on_piece(angle, share, length), "friction_")  # type: ignore[type-var]
    outputs = {
        name: at_least(value, COEFFICIENT_FLOOR) if name.startswith(_COEFFICIENTS) else value
        for name, value in there.items()
        if name.removeprefix("friction_") not in twins and isinstance(value, ca.SX) and not value.is_constant()
    }
    if slopes:
        over = ca.vertcat(*symbols.values())
        tuned = [name for name in outputs if ca.depends_on(there[name], over)]
        outputs = {SLOPE_OF + name: ca.sum2(ca.jacobian(there[name], over)) for name in tuned}
    return Law(
        name="contact",
        comment="Friction of a mass for a wrap angle [rad], eqs. (8), (9).",
        inputs=(angle, *symbols.values()),
        outputs=outputs,
    )
