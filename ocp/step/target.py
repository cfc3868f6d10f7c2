"""The chain in C for a controller: element laws with the parameters folded in, and the scheme around them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace

import casadi as ca

from tendonff.models.layout import INPUT_NAMES, fields_of
from tendonff.models.tendon.chain import Chain
from tendonff.models.tendon.friction import COEFFICIENT_FLOOR
from tendonff.models.tendon.stiffening import StiffeningLink
from tendonff.ocp.codegen.partial_evaluation import FoldedLaw, PartialEvaluator
from tendonff.ocp.codegen.precision import Precision
from tendonff.ocp.codegen.printer import literal
from tendonff.ocp.errors import CodeError
from tendonff.ocp.step.c_engine import link_ratios
from tendonff.ocp.step.folding import (
    Weights,
    chain_evaluator,
    record_code,
    rest_statements,
    scheme_rows,
    weighted_sum,
)
from tendonff.ocp.step.joints import Joints
from tendonff.ocp.step.laws import ElementLaws, end_mass, end_mass_tangent, far_velocity, near_force
from tendonff.ocp.step.render import Compliances, Limits, OnJoints, StepCode, law_calls
from tendonff.ocp.step.scheme import RESIDUAL_ROUNDING, RESIDUAL_TOLERANCE_N
from tendonff.ocp.step.target_joints import Contact, contact_code

_KINDS = 2
_ARGUMENTS = {"force_N": "f_c", "rest_m": "x_c"}  # of an end's balance, by what the input of an end is called
_OF_LINKS = (
    "/* What depends on the weight H [s] of the scheme: two rows for the first step (implicit Euler), two for",
    " * every later step (second-order backward differences; `carry` is the share of the last change in the base),",
    " * and two for each halving of a step, where there are any: for inner links, and for those at the ends, which",
    " * are half as long. Fields are named after the law that needs them. */",
)
_OF_WEIGHTS = (
    "/* What depends on the weight H [s] of the scheme: a row for the first step (implicit Euler), one for every",
    " * later step (second-order backward differences; `carry` is the share of the last change in the base), and one",
    " * for each halving of a step, where there are any. Fields are named after the law that needs them. */",
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Tuned:
    """Parts of a time step that the tuner of a chain needs."""

    numbers: tuple[str, ...]  # that it changes at run time, named as in `Chain.numbers`
    directions: int  # sensitivities


@dataclass(frozen=True, slots=True, kw_only=True)
class SchemeCode:
    """Parts of a C file about one of the schemes of a chain."""

    header: str  # types of the stepper; empty for the inverse
    laws: str  # element laws as static functions
    body: str  # the scheme around them
    # statements that set `travel` to that of the actuator's end since the rest under `self->start`; of the inverse. On
    # a path in sections to its position but for a constant
    travel: str = ""
    free: tuple[str, ...] = ()  # numbers of the chain that the inverse takes as arguments
    reweigh: str = ""  # function that gives the rows for a step of any length; of the inverse
    inputs: tuple[str, ...] = ()  # names of the inputs of a time step, in their order
    # gain, gain_call: law of the slope of a link's force, and the statement that renews it in `rows[k]`, for a tendon
    # that is tuned
    gain: str = ""
    gain_call: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class ChainCode:
    """A chain in C: what its schemes share, which is named after the prefix alone, and the schemes."""

    record: str  # type of the record of coefficients
    values: str  # its rows, one per weight of the scheme
    count: int  # of all rows
    kinds: int  # rows of one weight
    links: str  # laws of the links, for a header
    solver: str  # functions for the tridiagonal equations of a time step
    rest: str  # statements that fill `x` with the state at rest under `tension`
    contact: str  # record of friction on a bend, where the path moves or has sections; else empty
    touch: str  # its functions for each step, for a header
    touch_all: str  # its other functions
    inverse: SchemeCode | None
    plant: SchemeCode | None


def controller_limits(precision: Precision) -> Limits:
    """Loop bounds of an exported model, and the balance that its real type can reach."""
    single = precision is Precision.FLOAT
    return Limits(
        iterations=20,
        halvings=10,
        splits=3,
        rounding=2e-6 if single else RESIDUAL_ROUNDING,
        tolerance_N=1e-5 if single else RESIDUAL_TOLERANCE_N,
    )


def plant_limits(precision: Precision) -> Limits:
    """Loop bounds of an exported plant with a ceiling for the work of one call, whatever the force.

    A step is not split: under this ceiling no split step has ever been solved, but starting over is (`FAILED`).
    """
    return replace(controller_limits(precision), splits=0, evaluations=60)


LOAD_STIFFNESS = "far_stiffness_N_per_m"
"""Number of a chain that is the stiffness of its load."""

SETTABLE = (
    "piece_adhesion_N",
    *(f"friction_mu_{kind}_{way}" for way in ("pull", "release") for kind in ("dynamic", "static")),
)
"""Numbers of a chain that an exported inverse can take at run time; those of friction at least COEFFICIENT_FLOOR."""


def chain_code(
    chain: Chain,
    step_s: float,
    prefix: str,
    precision: Precision,
    *,
    inverse: bool = True,
    forward: Chain | None = None,
    tuned: Tuned | None = None,
) -> ChainCode:
    """A chain in C: its exact inverse, whose friction the caller can set, and the time step of `forward`, if any.

    `forward` differs from the chain in its ends only. The input of its time step says whether a tension cell stands in
    for the near end (`led_by_tension`); the rest position of the load's spring is an input too, where no joint moves
    the far end. Where a tuner runs the time step too, with its sensitivities, `tuned` numbers are fields of the record,
    and but for those of the tendon arguments of the inverse.
    """
    weights = scheme_rows(step_s, 0 if tuned is None else controller_limits(precision).splits)
    coefficients = dict[str, tuple[float, ...]]()
    contact = None
    if chain.moving:
        contact = contact_code(chain, Joints.of(chain), prefix, precision, settable=True, types=prefix, shared=True)

    def folder_of(chain: Chain, scheme: str, free: tuple[str, ...], floor: float, *, whole: bool) -> PartialEvaluator:
        return chain_evaluator(
            chain,
            weights,
            f"{prefix}_{scheme}",
            precision,
            contact,
            free,
            floors={name: floor if name.startswith("friction_") else 0.0 for name in free},
            whole=whole,
            record=f"{prefix}_weights",
            coefficients=coefficients,
        )

    settable, own = SETTABLE if contact is None else ("piece_adhesion_N",), () if tuned is None else tuned.numbers
    left = tuple(dict.fromkeys((*settable, *(name for name in own if not name.startswith("link_")))))
    folder = folder_of(chain, "inverse", left, COEFFICIENT_FLOOR, whole=True)
    laws = ElementLaws.of(chain, folded=True) if contact is None else contact.laws
    links = folded_links(chain, replace(folder, prefix=prefix, shared=True), laws)
    back = _inverse_code(chain, folder, laws, links, contact, left) if inverse else None
    columns = {name: (chain.numbers()[name],) * folder.weights for name in own}
    if any(name.startswith("link_") for name in own) and contact is None:
        columns["gain"] = folder.parameters["gain"]
    ahead = None
    if forward is not None:
        folder = folder_of(forward, "chain", own, 0.0, whole=False)
        laws = ElementLaws.of(forward, folded=True) if contact is None else contact.laws
        ahead = _plant_code(forward, folder, laws, links, contact, tuned)
    record, rows = _record(folder, weights, columns)
    return ChainCode(
        record=record,
        values=rows,
        count=folder.weights,
        kinds=folder.weights // len(weights),
        links="\n".join(law.code for law in links),
        solver=step_code(chain, prefix, precision, ()).render("tridiagonal.c.j2"),
        rest=_rest(chain, precision),
        contact=contact.record if contact else "",
        touch=contact.inline if contact else "",
        touch_all=contact.functions if contact else "",
        inverse=back,
        plant=ahead,
    )


def _inverse_code(
    chain: Chain,
    folder: PartialEvaluator,
    laws: ElementLaws,
    links: tuple[FoldedLaw, ...],
    contact: Contact | None,
    left: tuple[str, ...],
) -> SchemeCode:
    """The exact inverse; those of `left` that the laws need are arguments."""
    precision = folder.precision
    compliances = None
    if precision is Precision.FLOAT:
        load = f"({literal(1.0, precision)} / {LOAD_STIFFNESS})" if LOAD_STIFFNESS in left else ""
        compliances = compliances_of(chain, precision, load)
    folded = folded_inverse(chain, folder, laws, links, relative=compliances is not None, free=left)
    ends = {"far_velocity": "far_"}
    inputs = {name.replace("end_", ends.get(law.name, "end_"), 1) for law in folded for name in law.inputs}
    free = tuple(name for name in left if name in inputs)
    code = step_code(chain, folder.prefix, precision, folded, compliances=compliances, contact=contact, free=free)
    ratios = link_ratios(chain.elements.ratio) if contact is None else (1.0,)
    lengths = tuple(literal(ratio, precision) for ratio in ratios)
    count = f"{folder.prefix.rpartition('_')[0].upper()}_STATE_COUNT"
    code = replace(code, count=count, record_type=folder.weights_type, weigh=folder.weigh(), lengths=lengths)
    return SchemeCode(
        header="",
        laws=_own(folder, folded),
        body=code.render("inverse.c.j2"),
        travel=_travel(chain, precision, folder.prefix),
        free=free,
        reweigh=f"{folder.weigh().code}\n{code.render('reweigh.c.j2')}",
    )


def _plant_code(
    chain: Chain,
    folder: PartialEvaluator,
    laws: ElementLaws,
    links: tuple[FoldedLaw, ...],
    contact: Contact | None,
    tuned: Tuned | None,
) -> SchemeCode:
    """The time step."""
    near, far = _ends(chain, tuned)
    free = () if tuned is None else tuned.numbers
    cell = _end(chain.led_by_tension(), "near") | {"pull": -1.0, "x_c": 0.0}
    ends = {
        "near": folder.fold(end_mass(chain.near), "end_mass_near", fixed=near),
        "far": folder.fold(end_mass(), "end_mass_far", fixed=far),
        "cell": folder.fold(end_mass(), "end_mass_cell", fixed=cell),
    }
    linked, gain, call = any(name.startswith("link_") for name in free), "", ""
    if linked:  # those of the inverse know all numbers
        links = folded_links(chain, folder, laws)
    if linked and contact is None:  # else links ask for it
        law = folder.fold(laws.link_gain())
        gain, call = law.code, law_calls({law.name: law})("link_gain", {"gain": "&rows[k].gain"})
    folded = (
        *links,
        folder.fold(laws.link_force()),
        folder.fold(laws.path_mass()),
        *ends.values(),
        *((folder.fold(laws.link_gain()),) if contact else ()),
        *(() if tuned is None else _tangent_laws(chain, folder, laws, contact, tuned)),
    )
    types, shared = folder.prefix.rpartition("_")[0], tuned is not None
    code = step_code(
        chain,
        folder.prefix,
        folder.precision,
        folded,
        limits=_split_limits(folder.precision) if shared else plant_limits(folder.precision),
        contact=contact,
        tuned=shared,
        solver=types,
    )
    split = {name: name.split("_", 1) for name in INPUT_NAMES}
    taken = tuple(name for name, (end, what) in split.items() if _ARGUMENTS[what] in ends[end].inputs)
    code = replace(code, record_type=folder.weights_type, inputs=taken, shared=shared)
    code = replace(code, directions=0 if tuned is None else tuned.directions)
    header = ("types.h.j2", "target.h.j2", *(("place.h.j2",) if contact else ()), *(("steps.h.j2",) if shared else ()))
    body = (*(("moving_target.c.j2",) if contact else ()), "kernel.c.j2")
    body += ("pieces.c.j2", "tangent.c.j2") if shared else ()
    return SchemeCode(
        header="\n".join(map(code.render, header)),
        laws=_own(folder, folded),
        body="\n".join(map(code.render, body)),
        inputs=code.inputs,
        gain=gain,
        gain_call=call,
    )


def _tangent_laws(
    chain: Chain, folder: PartialEvaluator, laws: ElementLaws, contact: Contact | None, tuned: Tuned
) -> tuple[FoldedLaw, ...]:
    """Laws of the sensitivities of a time step."""
    near, far = _ends(chain, tuned)
    if contact is not None:  # slopes over every number, as those of the host; numbers that equal another have none
        laws = replace(laws, friction_symbols=_every_symbol(laws))
    return (
        folder.fold(laws.link_tangent()),
        folder.fold(laws.path_mass_tangent()),
        folder.fold(end_mass_tangent(chain.near), "end_mass_tangent_near", fixed=near),
        folder.fold(end_mass_tangent(), "end_mass_tangent_far", fixed=far),
    )


def _split_limits(precision: Precision) -> Limits:
    """Those of a plant, whose steps a tuner splits."""
    return replace(plant_limits(precision), splits=controller_limits(precision).splits)


def _ends(chain: Chain, tuned: Tuned | None) -> tuple[dict[str, float], dict[str, float]]:
    """Inputs of the ends; a tuner's load is held by a force, so that it starts at zero."""
    free = () if tuned is None else tuned.numbers
    near, far = _end(chain, "near", free) | {"pull": -1.0}, _end(chain, "far", free) | {"pull": 1.0}
    if tuned is None:
        far["f_c"] = 0.0
    if chain.far_joint is not None:
        far["x_c"] = 0.0
    if not chain.near.stiffness_N_per_m:
        near["x_c"] = 0.0
    return near, far


def _every_symbol(laws: ElementLaws) -> tuple[ca.SX, ...]:
    known = {s.name(): s for s in laws.friction_symbols}
    names = [f"friction_{field.name}" for field in fields(laws.friction)]  # type: ignore[arg-type]
    return tuple(known[name] if name in known else ca.SX.sym(name) for name in names)


def folded_links(chain: Chain, folder: PartialEvaluator, laws: ElementLaws) -> tuple[FoldedLaw, ...]:
    """Laws of a link that inverse and time step share: its force at zero rate, and its states at the end of a step."""
    start = laws.link_start()
    if folder.reorder:
        start = weighted_sum(start, "e_base", *(f"{name}_base" for name in chain.link.states))
    return folder.fold(start), folder.fold(laws.link_states())


def folded_inverse(
    chain: Chain,
    folder: PartialEvaluator,
    laws: ElementLaws,
    links: tuple[FoldedLaw, ...],
    *,
    relative: bool,
    free: Sequence[str] = (),
) -> tuple[FoldedLaw, ...]:
    """The laws of the exact inverse, with everything folded in but numbers of the ends that are free.

    Where states are kept relative to what the tension alone would cause, the laws depend on tension and position
    through their balance only.
    """
    far, rate = {"f_c": 0.0, "x_c": 0.0, "pull": 1.0}, {}
    if relative:
        far["f"], rate["force"] = 0.0, 0.0
    return (
        *links,
        folder.fold(laws.link_rate(), fixed=rate),
        *(() if chain.far_joint else (folder.fold(far_velocity(), fixed=_end(chain, "far", free) | far),)),
        folder.fold(near_force(chain.near), fixed=_end(chain, "near", free) | {"x_c": 0.0, "pull": -1.0}),
        folder.fold(laws.path_mass_inverse(drop=relative)),
    )


def step_code(
    chain: Chain,
    prefix: str,
    precision: Precision,
    laws: Sequence[FoldedLaw],
    *,
    limits: Limits | None = None,
    compliances: Compliances | None = None,
    contact: Contact | None = None,
    free: tuple[str, ...] = (),
    tuned: bool = False,
    solver: str = "",
) -> StepCode:
    """Values for the templates of a chain on a controller; `tuned` for one of the schemes of a tuner."""
    on_joints = None
    if contact is not None:
        on_joints = OnJoints(
            types=contact.types,
            contact=contact.prefix,
            own=contact.own,
            joints=chain.motion is not None,
            far_driven=chain.far_joint is not None,
            factors=tuned,
        )
    return StepCode(
        prefix=prefix,
        precision=precision,
        solver=solver,
        layout=chain.layout,
        laws={law.name: law for law in laws},
        count=f"{prefix.upper()}_COUNT",
        size=f"{prefix.upper()}_COUNT",
        numbers={name: literal(value, precision) for name, value in chain.numbers().items()},
        limits=limits or Limits(),
        compliances=compliances,
        free=free,
        moving=contact is not None,
        on_joints=on_joints,
        held=precision is Precision.FLOAT and chain.near.stiffness_N_per_m > 0,
    )


def _own(folder: PartialEvaluator, folded: tuple[FoldedLaw, ...]) -> str:
    """Text of the laws that no header has."""
    return "\n".join(law.code for law in folded if law.prefix == folder.prefix)


def compliances_of(chain: Chain, precision: Precision, load: str = "") -> Compliances:
    """Static compliance of the load (default: its number) and of the states of a link [m/N], as C text.

    Of links it is that of an inner one and that of one at an end; where links differ, of the whole. A float holds a
    position of centimetres to nanometres only, which a stiff bristle turns into newtons over a hold. Relative to what
    the tension alone would cause, positions are small and their rounding harmless. Double code keeps the states
    themselves, and so agrees with Python to rounding.
    """
    ratios = (1.0, 1.0) if chain.moving else link_ratios(chain.elements.ratio)
    (e, states), (e_of_end, states_of_end) = (chain.link.shortened(ratio).rest(1.0) for ratio in ratios)
    links = zip(("e", *chain.link.states), (e, *states), (e_of_end, *states_of_end), strict=True)
    known: dict[str, str | tuple[str, str]] = {
        name: (literal(float(inner), precision), literal(float(end), precision)) for name, inner, end in links
    }
    if not chain.far_joint:
        known["q_l"] = load or literal(1 / float(chain.far.stiffness_N_per_m), precision)
    return known


def _travel(chain: Chain, precision: Precision, prefix: str) -> str:
    """Statements for the travel; where states are relative, from elongations and tensions: rounding adds up nowhere."""
    compliances = None if precision is Precision.DOUBLE else compliances_of(chain, precision)
    layout, more, upper = chain.layout, "(tension - self->start)", prefix.upper()
    if chain.moving:
        return _position(chain, precision, compliances, prefix)
    if compliances is None:
        slope = literal(chain.rest_state(1.0).near_position_m, precision)
        return f"    travel = self->chain.x[{layout.part('q_a').start}] - (self->start * {slope});"
    of_link = "(((i == 0) || (i == n)) ? {1} : {0})".format(*compliances["e"])
    lines = (
        "    {",
        f"        const int32_t n = {upper}_COUNT;",
        f"        {precision} tension = self->past.reference;",
        "        int32_t i;",
        f"        travel = self->chain.x[{layout.part('q_l').start}] + ({more} * {compliances['q_l']});",
        "        for (i = n; i >= 0; i--) {",
        f"            travel += self->chain.x[{layout.part('e').start} + i] + ({more} * {of_link});",
        f"            tension += (i > 0) ? self->past.drop[i - 1] : {literal(0.0, precision)};",
        "        }",
        "    }",
    )
    return "\n".join(lines)


def _position(chain: Chain, precision: Precision, compliances: Compliances | None, prefix: str) -> str:
    """The same on a path in sections, but for a constant; what the path gains takes the end back."""
    layout, types, joints = chain.layout, prefix.rpartition("_")[0], Joints.of(chain)
    if compliances is None:
        return f"    travel = self->chain.x[{layout.part('q_a').start}];"
    link = f"self->chain.path.link[{types}_path_link_of[i]]"
    stretched = f"(self->past.tension[i] * {link}.length) * {compliances['e'][0]}"
    far = f"self->chain.x[{layout.part('q_l').start}] + (self->past.reference * {compliances.get('q_l')})"
    lines = [
        "    {",
        f"        const int32_t n = {prefix.upper()}_COUNT;",
        "        int32_t i;",
        f"        travel = {literal(0.0, precision) if chain.far_joint else far};",
        "        for (i = n; i >= 0; i--) {",
        f"            travel += self->chain.x[{layout.part('e').start} + i] + ({stretched});",
        "        }",
        *(
            f"        travel += self->chain.path.joint[{k}] * {literal(gained, precision)};"
            for k, gained in enumerate(joints.near_m)
            if gained
        ),
        "    }",
    ]
    return "\n".join(lines)


def _end(chain: Chain, which: str, free: Sequence[str] = ()) -> dict[str, float]:
    known = fields_of(chain.near if which == "near" else chain.far, "end_")
    return {name: value for name, value in known.items() if name.replace("end", which, 1) not in free}


def _record(folder: PartialEvaluator, weights: Weights, more: Mapping[str, tuple[float, ...]]) -> tuple[str, str]:
    kinds = folder.weights // len(weights)
    columns = {
        "H": tuple(w for w, _ in weights for _ in range(kinds)),
        "carry": tuple(carry for _, carry in weights for _ in range(kinds)),
        **folder.coefficients,
        **more,
    }
    comment = "\n".join(_OF_LINKS if kinds == _KINDS else _OF_WEIGHTS)
    record, rows = record_code(folder, columns)
    return f"{comment}\n{record}", rows


def require_linear(chain: Chain) -> None:
    """Refuse a tendon whose elongation at rest is not in proportion to its tension: C code starts by one number."""
    if isinstance(chain.link, StiffeningLink):
        raise CodeError("a tendon with `stiffening` cannot be exported yet; leave it out, at the stiffness there")


def _rest(chain: Chain, precision: Precision) -> str:
    """Statements for the state at rest: affine in the tension, so two evaluations of `rest_state` say it all."""
    require_linear(chain)
    slopes = chain.rest_state(1.0).vector() - chain.rest_state(0.0).vector()
    return rest_statements(slopes, precision, "x")
