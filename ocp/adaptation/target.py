"""The tuner in C for a controller: model and inverse with all numbers folded in but those that are tuned."""

from dataclasses import dataclass, fields, replace

import casadi as ca

from tendonff.models.tendon.chain import Chain
from tendonff.models.tendon.friction import COEFFICIENT_FLOOR
from tendonff.ocp.adaptation.code import (
    TunedChain,
    nuisances_of,
    render_tuner,
    tuner_context,
    tuner_laws,
)
from tendonff.ocp.adaptation.tuning import Tunable, Tuning
from tendonff.ocp.codegen.partial_evaluation import FoldedLaw, PartialEvaluator
from tendonff.ocp.codegen.precision import Precision
from tendonff.ocp.codegen.printer import literal
from tendonff.ocp.step.folding import Weights, chain_evaluator, record_code, rest_statements, scheme_rows
from tendonff.ocp.step.joints import Joints
from tendonff.ocp.step.laws import ElementLaws, end_mass, end_mass_tangent, way_of
from tendonff.ocp.step.render import Limits, law_calls
from tendonff.ocp.step.target import controller_limits, step_code
from tendonff.ocp.step.target_joints import SLOPE_OF, Contact, contact_code


@dataclass(frozen=True, slots=True, kw_only=True)
class FreeCode:
    """C of a scheme some of whose numbers are fields of its coefficient record."""

    record: str  # the type of the record
    rows: str  # its values at factors of 1, one row per weight of the scheme
    code: str  # element laws as static functions, and the scheme around them
    gain_call: str  # statement that renews the slope of a link's force in `rows[k]`, where the tendon is tuned


@dataclass(frozen=True, slots=True, kw_only=True)
class TunerCode:
    """Parts of the C module of a tuner."""

    header: str  # types; the last is `<prefix>_tuner`
    source: str  # static functions
    model_rows: int  # rows of coefficients of the model


def model_free_code(
    chain: Chain, step_s: float, prefix: str, precision: Precision, names: tuple[str, ...], contact: Contact | None
) -> FreeCode:
    """The time step with its sensitivities, and with free numbers; those of the ends are free anyway."""
    limits = controller_limits(precision)
    weights = scheme_rows(step_s, limits.splits)
    ends = tuple(name for name in chain.numbers() if name.startswith(("near_", "far_")))
    free = tuple(dict.fromkeys((*names, *ends)))
    folder = chain_evaluator(chain, weights, prefix, precision, contact, free, whole=False)
    laws = ElementLaws.of(chain, folded=True)
    if contact is not None:  # slopes over every number, as those of the host; numbers that equal another have none
        laws = replace(contact.laws, friction_symbols=_every_symbol(contact.laws))
    folded = (
        folder.fold(laws.link_gain()),
        folder.fold(laws.link_start()),
        folder.fold(laws.link_force()),
        folder.fold(laws.link_states()),
        folder.fold(laws.link_tangent()),
        folder.fold(laws.path_mass()),
        folder.fold(laws.path_mass_tangent()),
        *(folder.fold(end_mass(end)) for end in laws.ends),
        *(folder.fold(end_mass_tangent(end)) for end in laws.ends),
    )
    templates = (*(() if contact is None else ("moving_target.c.j2",)), "kernel.c.j2", "tangent.c.j2")
    solver = prefix.rpartition("_")[0].rpartition("_")[0]
    return _free_code(chain, folder, weights, folded, free, templates, limits=limits, contact=contact, solver=solver)


def _every_symbol(laws: ElementLaws) -> tuple[ca.SX, ...]:
    known = {s.name(): s for s in laws.friction_symbols}
    names = [f"friction_{field.name}" for field in fields(laws.friction)]  # type: ignore[arg-type]
    return tuple(known[name] if name in known else ca.SX.sym(name) for name in names)


def inverse_numbers(tuned: TunedChain) -> tuple[str, ...]:
    """Numbers that the tuner changes in the inverse, whose force hardly depends on the tendon's stiffness."""
    return tuple(name for name in tuned.retuned_numbers()[1] if not name.startswith("link_"))


def tuner_code(
    tuned: TunedChain, tuning: Tuning, prefix: str, precision: Precision, *, taken: tuple[str, ...]
) -> TunerCode:
    """All of the tuner for a controller, beside the exact inverse, which takes the numbers `taken` as arguments."""
    step_s, nuisances = tuning.step_s, nuisances_of(tuned, tuning)
    model_prefix, inverse_prefix = f"{prefix}_model", f"{prefix}_inverse"
    context = tuner_context(tuned, nuisances, precision, prefix=prefix, past=tuning.delay_samples + 1)
    names, chain, limits = tuned.retuned_numbers()[1], tuned.chain, controller_limits(precision)
    contact, kinds = None, 2  # of links: inner ones, and those at the ends
    if chain.moving:
        types, kinds = prefix.rpartition("_")[0], 1
        joints = Joints.of(chain)
        contact = contact_code(chain, joints, model_prefix, precision, settable=True, slopes=True, types=types)
        context |= _on_path(tuned, contact, types, precision)
    model = model_free_code(chain, step_s, model_prefix, precision, names, contact)
    shifted = precision is Precision.FLOAT
    slopes = (chain.rest_state(1.0).vector() - chain.rest_state(0.0).vector()) * (0.0 if shifted else 1.0)
    context |= {
        "model": model_prefix,
        "inverse": inverse_prefix,
        "kinds": kinds,
        "model_rows": kinds * (2 + limits.splits),
        "inverse_rows": 1 if names else 0,
        "load_row": 0,
        "invert": f"{prefix.rpartition('_')[0]}_inverse",
        "inverse_chain": f"{prefix.rpartition('_')[0]}_rows, ",
        "inverse_numbers": [_inverse_number(chain, name, names, precision) for name in taken],
        "shifted": shifted,
        "inverse_rest": lambda array: rest_statements(slopes, precision, array),
        "gain_calls": {model_prefix: model.gain_call, inverse_prefix: ""},
        "work_argument": "",
        "work_declaration": f"{model_prefix}_work work_area;",
        "work": "&work_area",
    }
    count = f"#define {model_prefix.upper()}_COUNT {chain.count}"
    types_code = step_code(chain, model_prefix, precision, (), limits=limits, contact=contact, tuned=True)
    printer = PartialEvaluator(prefix=prefix, precision=precision, parameters={})
    own = [printer.fold(law).code for law in tuner_laws(tuned, nuisances, on_target=True)]
    numbers = [
        "/* What is tuned of the inverse. */",
        "typedef struct {",
        *(f"    {precision} {name};" for name in names),
        f"}} {inverse_prefix}_weights;\n",
    ]
    bends = [] if contact is None else [contact.record]
    header = [model.record, *(numbers if names else []), *bends, render_tuner("tuner.h.j2", context)]
    source = [
        count,
        *(types_code.render(name) for name in ("types.h.j2", "target.h.j2")),
        model.rows,
        *([] if contact is None else [contact.functions]),
        model.code,
        *own,
        render_tuner("tuner.c.j2", context),
    ]
    return TunerCode(
        header="\n".join(header),
        source="\n".join(source),
        model_rows=kinds * (2 + limits.splits),
    )


def _inverse_number(chain: Chain, name: str, tuned: tuple[str, ...], precision: Precision) -> str:
    """C text of an argument of the inverse; coefficients are never zero there."""
    least = COEFFICIENT_FLOOR if name.startswith("friction_") else 0.0
    return f"self->inverse[0].{name}" if name in tuned else literal(max(chain.numbers()[name], least), precision)


def _on_path(tuned: TunedChain, contact: Contact, types: str, precision: Precision) -> dict[str, object]:
    """Values for the templates of a path in sections."""
    chain, layout = tuned.chain, tuned.chain.layout
    friction = [name for name in chain.numbers() if name.startswith("friction_")]
    slopes = [
        (friction.index(name), name, k)
        for name in contact.own
        if SLOPE_OF + name in contact.record
        for k, key in enumerate(tuned.parameters)
        if key in (Tunable.MU, f"mu_{way_of(name.removeprefix('friction_'))}")
    ]
    stretch, states = chain.link.rest(1.0)
    of_links = dict(zip(("e", *layout.link_states), (stretch, *states), strict=True))
    ways = (Tunable.MU, Tunable.MU_PULL), (Tunable.MU, Tunable.MU_RELEASE)
    found = [next((k for k, key in enumerate(tuned.parameters) if key in way), None) for way in ways]
    one, zero = literal(1.0, precision), literal(0.0, precision)
    spring = literal(0.0 if chain.far_joint is not None else 1 / float(chain.far.stiffness_N_per_m), precision)
    return {
        "types": types,
        "friction": friction,
        "slopes": slopes,
        "slope_of": SLOPE_OF,
        "friction_at": [(name, layout.part(name).start) for name in layout.friction_states],
        "factors": ", ".join(one if k is None else f"f[{k}]" for k in found),
        "link_parts": [(layout.part(n).start, literal(float(v), precision)) for n, v in of_links.items()],
        "spring": spring if precision is Precision.DOUBLE else zero,
    }


def _rows_function(record: str, rows: str) -> str:
    """Rows that one function reads, as a function that tells where they are."""
    name = f"{record.removesuffix('_weights')}_rows"
    inside = rows.replace(f"const {record} {name}[", f"    static const {record} rows[", 1)
    return f"static const {record} *{name}(void)\n{{\n{inside}    return rows;\n}}\n"


def _free_code(
    chain: Chain,
    folder: PartialEvaluator,
    weights: Weights,
    folded: tuple[FoldedLaw, ...],
    free: tuple[str, ...],
    templates: tuple[str, ...],
    *,
    limits: Limits | None = None,
    contact: Contact | None = None,
    solver: str = "",
) -> FreeCode:
    laws = {law.name: law for law in folded}
    gain, linked = laws["link_gain"], any(name.startswith("link_") for name in free)
    by_length = "ratio" in gain.inputs  # then the scheme asks for each link's
    used = [law for law in folded if law is not gain or linked or by_length]
    code = step_code(
        chain,
        folder.prefix,
        folder.precision,
        folded,
        limits=limits,
        contact=contact,
        tuned=True,
        solver=solver,
    )
    numbers = chain.numbers()
    weights = tuple(weight for weight in weights for _ in range(1 if contact else 2))  # links inside, at the ends
    columns: dict[str, tuple[float, ...]] = {"H": tuple(w for w, _ in weights), "carry": tuple(c for _, c in weights)}
    columns |= dict(folder.coefficients)
    columns |= {name: (numbers[name],) * len(weights) for name in free}
    if linked and not by_length:  # `retune` fills it in
        columns["gain"] = (0.0,) * len(weights)
    record, rows = record_code(folder, columns)
    return FreeCode(
        record=f"/* What depends on the weight H [s] of the scheme, and what is tuned. */\n{record}",
        rows=_rows_function(folder.weights_type, rows),
        code="\n".join([*(law.code for law in used), *(code.render(template) for template in templates)]),
        gain_call="" if by_length else law_calls(laws)("link_gain", {"gain": "&rows[k].gain"}),
    )
