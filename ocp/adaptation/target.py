"""The tuner in C for a controller, beside the time step and the exact inverse of its chain."""

from dataclasses import dataclass

from tendonff.models.tendon.chain import Chain
from tendonff.models.tendon.friction import COEFFICIENT_FLOOR
from tendonff.ocp.adaptation.code import (
    TunedChain,
    lacks_exponent,
    nuisances_of,
    render_tuner,
    tuner_context,
    tuner_laws,
)
from tendonff.ocp.adaptation.tuning import Tunable, Tuning
from tendonff.ocp.codegen.partial_evaluation import PartialEvaluator
from tendonff.ocp.codegen.precision import Precision
from tendonff.ocp.codegen.printer import literal
from tendonff.ocp.errors import CodeError
from tendonff.ocp.step.joints import Joints
from tendonff.ocp.step.laws import way_of
from tendonff.ocp.step.target import ChainCode, Tuned
from tendonff.ocp.step.target_joints import SLOPE_OF, slopes_code

MOST_EVALUATIONS = 5_000
"""Evaluations of balances in a step of the model: never reached, for its guesses and pieces are at most 21 solves of
20 moves, each of them tried at most 10 times."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TunerCode:
    """Parts of the C module of a tuner."""

    header: str  # types; the last is `<prefix>_tuner`
    source: str  # static functions
    model_rows: int  # rows of coefficients of the model


def tuned_numbers(tuned: TunedChain, tuning: Tuning) -> Tuned:
    """Numbers of the chain that the tuner changes, and its sensitivities: over the factors and an exponent it lacks."""
    beside = lacks_exponent(tuned, nuisances_of(tuned, tuning))
    return Tuned(numbers=tuned.retuned_numbers()[1], directions=len(tuned.parameters) + beside)


def tuner_code(tuned: TunedChain, tuning: Tuning, prefix: str, precision: Precision, *, beside: ChainCode) -> TunerCode:
    """All of the tuner for a controller, beside the chain, whose time step and exact inverse it calls."""
    nuisances, types = nuisances_of(tuned, tuning), prefix.rpartition("_")[0]
    ahead, back = beside.plant, beside.inverse
    if ahead is None or back is None:
        raise CodeError("a tuner needs the time step of its chain and the inverse beside it")
    model, inverse = f"{types}_chain", f"{prefix}_inverse"
    context = tuner_context(tuned, nuisances, precision, prefix=prefix, past=tuning.delay_samples + 1)
    names, chain, slopes = tuned.retuned_numbers()[1], tuned.chain, ""
    if chain.moving:
        slopes, own_slopes = slopes_code(chain, Joints.of(chain), prefix, precision)
        context |= _on_path(tuned, own_slopes, types, precision)
    shifted, zero = precision is Precision.FLOAT, literal(0.0, precision)
    given = {"near_force_N": "force", "far_force_N": "self->tension"}
    context |= {
        "model": model,
        "inverse": inverse,
        "record_of": {model: f"{types}_weights", inverse: f"{inverse}_weights"},
        "kinds": beside.kinds,
        "model_rows": beside.count,
        "inverse_rows": 1 if names else 0,
        "load_row": 0,
        "invert": f"{types}_inverse",
        "inverse_chain": f"{types}_rows, ",
        "inverse_numbers": [_inverse_number(chain, name, names, precision) for name in back.free],
        "shifted": shifted,
        "rest": "\n".join(_rest(chain, types, precision)),
        "inverse_rest": _inverse_rest(chain, types, precision),
        "gain_calls": {model: ahead.gain_call, inverse: ""},
        "ends": [*(given.get(name, zero) for name in ahead.inputs), "0"],
        "most": MOST_EVALUATIONS,
        "directions": context["columns"],
        "work_argument": "",
        "work_declaration": f"{model}_work work_area;",
        "work": "&work_area",
    }
    printer = PartialEvaluator(prefix=prefix, precision=precision, parameters={})
    own = [printer.fold(law).code for law in tuner_laws(tuned, nuisances, on_target=True)]
    numbers = [
        "/* What is tuned of the inverse. */",
        "typedef struct {",
        *(f"    {precision} {name};" for name in names),
        f"}} {inverse}_weights;\n",
    ]
    header = [*(numbers if names else []), render_tuner("tuner.h.j2", context)]
    source = [
        slopes,
        ahead.gain,
        *own,
        render_tuner("tuner.c.j2", context),
    ]
    return TunerCode(header="\n".join(header), source="\n".join(source), model_rows=beside.count)


def _rest(chain: Chain, types: str, precision: Precision) -> tuple[str, ...]:
    """Statements for the model at rest: the load's spring holds the tension where it is at zero."""
    zero, q_a, q_l = literal(0.0, precision), chain.layout.part("q_a").start, chain.layout.part("q_l").start
    if chain.moving:
        return (f"    {types}_adaptive_tuner_stretch(&self->path, tension, {zero}, self->x, self->x_old);",)
    return (
        f"    {types}_state_rest(self->x, self->x_old, tension);",
        f"    self->x[{q_a}] -= self->x[{q_l}];",
        f"    self->x_old[{q_a}] = self->x[{q_a}];",
        f"    self->x[{q_l}] = {zero};",
        f"    self->x_old[{q_l}] = {zero};",
    )


def _inverse_rest(chain: Chain, types: str, precision: Precision) -> str:
    """The same for the inverse, whose load is where its spring alone holds it."""
    if precision is Precision.FLOAT:
        return f"    {types}_past_rest(&self->inverse_past, self->inverse_x, self->inverse_x_old, tension);"
    if not chain.moving:
        return f"    {types}_state_rest(self->inverse_x, self->inverse_x_old, tension);"
    far = literal(0.0 if chain.far_joint is not None else 1 / float(chain.far.stiffness_N_per_m), precision)
    stretch = f"{types}_adaptive_tuner_stretch(&self->path, tension, tension * {far}"
    return f"    {stretch}, self->inverse_x, self->inverse_x_old);"


def _inverse_number(chain: Chain, name: str, tuned: tuple[str, ...], precision: Precision) -> str:
    """C text of an argument of the inverse; coefficients are never zero there."""
    least = COEFFICIENT_FLOOR if name.startswith("friction_") else 0.0
    return f"self->inverse[0].{name}" if name in tuned else literal(max(chain.numbers()[name], least), precision)


def _on_path(tuned: TunedChain, own: tuple[str, ...], types: str, precision: Precision) -> dict[str, object]:
    """Values for the templates of a path in sections."""
    chain, layout = tuned.chain, tuned.chain.layout
    friction = [name for name in chain.numbers() if name.startswith("friction_")]
    slopes = [
        (friction.index(name), name, k)
        for name in friction
        if SLOPE_OF + name in own
        for k, key in enumerate(tuned.parameters)
        if key in (Tunable.MU, f"mu_{way_of(name.removeprefix('friction_'))}")
    ]
    stretch, states = chain.link.rest(1.0)
    of_links = dict(zip(("e", *layout.link_states), (stretch, *states), strict=True))
    ways = (Tunable.MU, Tunable.MU_PULL), (Tunable.MU, Tunable.MU_RELEASE)
    found = [next((k for k, key in enumerate(tuned.parameters) if key in way), None) for way in ways]
    one = literal(1.0, precision)
    return {
        "types": types,
        "friction": friction,
        "slopes": slopes,
        "slope_of": SLOPE_OF,
        "friction_at": [(name, layout.part(name).start) for name in layout.friction_states],
        "factors": ", ".join(one if k is None else f"f[{k}]" for k in found),
        "link_parts": [(layout.part(n).start, literal(float(v), precision)) for n, v in of_links.items()],
    }
