"""The tuner in C for a controller: model and inverse with all numbers folded in but those that are tuned."""

from dataclasses import dataclass

from tendonff.models.chain import Chain
from tendonff.ocp.adaptation.code import (
    LOAD_STIFFNESS,
    TunedChain,
    render_tuner,
    rest_statements,
    tuner_context,
    tuner_laws,
)
from tendonff.ocp.codegen.partial_evaluation import SpecialisedLaw, Specialiser
from tendonff.ocp.codegen.precision import Precision
from tendonff.ocp.codegen.printer import literal, real_type
from tendonff.ocp.step.c_engine import link_ratios
from tendonff.ocp.step.laws import ElementLaws, end_mass, end_mass_tangent, far_velocity, near_force
from tendonff.ocp.step.render import Compliances, Limits, StepCode, law_calls
from tendonff.ocp.step.scheme import BDF2_CARRY, BDF2_WEIGHT
from tendonff.ocp.step.target import controller_limits, link_compliances

Weights = tuple[tuple[float, float], ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class FreeCode:
    """C of a scheme some of whose numbers are fields of its coefficient record.

    Parameters
    ----------
    record : str
        The type of the record.
    rows : str
        Its values at factors of 1, one row per weight of the scheme.
    laws, body : str
        Element laws as static functions, and the scheme around them.
    gain_call : str
        Statement that renews the slope of a link's force in `rows[k]`, where the tendon is tuned.
    """

    record: str
    rows: str
    laws: str
    body: str
    gain_call: str


@dataclass(frozen=True, slots=True, kw_only=True)
class TunerCode:
    """Parts of the C module of a tuner.

    Parameters
    ----------
    header : str
        Types; the last is `<prefix>_tuner`.
    source : str
        Static functions.
    """

    header: str
    source: str


def inverse_free_code(
    tuned: TunedChain, step_s: float, prefix: str, precision: Precision, names: tuple[str, ...]
) -> FreeCode:
    """The exact inverse with free numbers.

    Parameters
    ----------
    tuned : TunedChain
    step_s : float
        h [s].
    prefix : str
        Prefix of every C name.
    precision : Precision
    names : tuple of str
        The free numbers, as in `Chain.numbers`.
    """
    chain = tuned.chain
    weights = ((step_s, 0.0), (BDF2_WEIGHT * step_s, BDF2_CARRY))
    folder, laws = _specialiser(chain, weights, prefix, precision, names), ElementLaws.of(chain, folded=True)
    shifted = precision is Precision.FLOAT
    far: dict[str, float] = {"f_c": 0.0, "x_c": 0.0, "pull": 1.0} | ({"f": 0.0} if shifted else {})
    numbers = chain.numbers()
    ends = {
        which: {
            f"end_{n[len(which) + 1 :]}": v for n, v in numbers.items() if n.startswith(f"{which}_") and n not in names
        }
        for which in ("near", "far")
    }
    folded = (
        folder.fold(laws.link_gain()),
        folder.fold(laws.link_start()),
        folder.fold(laws.link_rate(), fixed={"force": 0.0} if shifted else {}),
        folder.fold(laws.link_states()),
        folder.fold(far_velocity(), fixed=ends["far"] | far),
        folder.fold(near_force(chain.near), fixed=ends["near"] | {"x_c": 0.0, "pull": -1.0}),
        folder.fold(laws.path_mass_inverse(drop=shifted)),
    )
    compliances: Compliances | None = None
    if shifted:
        of_links = link_compliances(chain, precision)
        one, load = literal(1.0, precision), float(chain.far.stiffness_N_per_m)
        free_load = f"({one} / c->{LOAD_STIFFNESS})" if LOAD_STIFFNESS in names else literal(1 / load, precision)
        compliances = {"q_l": free_load, **of_links}
    return _free_code(chain, folder, weights, folded, names, ("inverse.c.j2",), compliances=compliances)


def model_free_code(
    tuned: TunedChain, step_s: float, prefix: str, precision: Precision, names: tuple[str, ...]
) -> FreeCode:
    """The time step with its sensitivities, and with free numbers; those of the ends are free anyway."""
    chain, limits = tuned.chain, controller_limits(precision)
    pieces = tuple((step_s / 2**k, 0.0) for k in range(1, limits.splits + 1))
    weights = ((step_s, 0.0), (BDF2_WEIGHT * step_s, BDF2_CARRY), *pieces)
    ends = tuple(name for name in chain.numbers() if name.startswith(("near_", "far_")))
    free = tuple(dict.fromkeys((*names, *ends)))
    folder, laws = _specialiser(chain, weights, prefix, precision, free), ElementLaws.of(chain, folded=True)
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
    return _free_code(chain, folder, weights, folded, free, ("kernel.c.j2", "tangent.c.j2"), limits=limits)


def tuner_code(tuned: TunedChain, step_s: float, prefix: str, precision: Precision, delay: int) -> TunerCode:
    """All of the tuner for a controller.

    Parameters
    ----------
    tuned : TunedChain
    step_s : float
        h [s].
    prefix : str
        Prefix of every C name.
    precision : Precision
    delay : int
        Age of a measurement when it arrives, in steps.
    """
    model_prefix, inverse_prefix = f"{prefix}_model", f"{prefix}_inverse"
    context = tuner_context(tuned, precision, prefix=prefix, past=delay + 1)
    names = tuned.retuned_numbers()[1]
    model = model_free_code(tuned, step_s, model_prefix, precision, names)
    inverse = inverse_free_code(tuned, step_s, inverse_prefix, precision, names)
    shifted, chain = precision is Precision.FLOAT, tuned.chain
    zero, one = (chain.rest_state(value).vector() * (0.0 if shifted else 1.0) for value in (0.0, 1.0))
    limits = controller_limits(precision)
    context |= {
        "model": model_prefix,
        "inverse": inverse_prefix,
        "model_rows": 2 * (2 + limits.splits),
        "inverse_rows": 4,
        "shifted": shifted,
        "inverse_rest": lambda array: rest_statements(zero, one, array, precision),
        "gain_calls": {model_prefix: model.gain_call, inverse_prefix: inverse.gain_call},
        "work_argument": "",
        "work_declaration": f"{model_prefix}_work work_area;",
        "work": "&work_area",
    }
    counts = [f"#define {p.upper()}_COUNT {chain.count}" for p in (model_prefix, inverse_prefix)]
    types = _code(chain, model_prefix, precision, {}, limits=limits)
    printer = Specialiser(prefix=prefix, precision=precision, parameters={})
    own = [printer.fold(law).code for law in tuner_laws(tuned)]
    past = [
        "/* Tensions of the last sample, as changes: states are kept relative to what these alone would cause. */",
        "typedef struct {",
        f"    {real_type(precision)} reference;",
        f"    {real_type(precision)} change[{chain.count + 1}];",
        f"    {real_type(precision)} drop[{chain.count}];",
        f"}} {inverse_prefix}_past;\n",
    ]
    header = [model.record, inverse.record, *(past if shifted else []), render_tuner("tuner.h.j2", context)]
    source = [
        *counts,
        *(types.render(name) for name in ("types.h.j2", "target.h.j2")),
        model.rows,
        inverse.rows,
        model.laws,
        model.body,
        inverse.laws,
        inverse.body,
        *own,
        render_tuner("tuner.c.j2", context),
    ]
    return TunerCode(header="\n".join(header), source="\n".join(source))


def _specialiser(
    chain: Chain, weights: Weights, prefix: str, precision: Precision, free: tuple[str, ...]
) -> Specialiser:
    ratios = link_ratios(chain.elements.ratio)
    rows = [(weight, ratio) for weight, _ in weights for ratio in ratios]
    parameters = {name: (value,) * len(rows) for name, value in chain.numbers().items() if name not in free}
    parameters["H"], parameters["ratio"] = tuple(weight for weight, _ in rows), tuple(ratio for _, ratio in rows)
    reorder = precision is Precision.FLOAT
    if not any(name.startswith("link_") for name in free):
        whole = Specialiser(prefix=prefix, precision=precision, parameters=parameters)
        (parameters["gain"],) = whole.evaluate(ElementLaws.of(chain).link_gain())
    return Specialiser(prefix=prefix, precision=precision, parameters=parameters, reorder=reorder)


def _code(
    chain: Chain,
    prefix: str,
    precision: Precision,
    laws: dict[str, SpecialisedLaw],
    *,
    limits: Limits | None = None,
    compliances: Compliances | None = None,
) -> StepCode:
    return StepCode(
        prefix=prefix,
        precision=precision,
        layout=chain.layout,
        laws=laws,
        count=f"{prefix.upper()}_COUNT",
        size=f"{prefix.upper()}_COUNT",
        numbers={name: literal(value, precision) for name, value in chain.numbers().items()},
        limits=limits or Limits(),
        compliances=compliances,
    )


def _free_code(
    chain: Chain,
    folder: Specialiser,
    weights: Weights,
    folded: tuple[SpecialisedLaw, ...],
    free: tuple[str, ...],
    templates: tuple[str, ...],
    *,
    limits: Limits | None = None,
    compliances: Compliances | None = None,
) -> FreeCode:
    laws = {law.name: law for law in folded}
    gain, linked = laws["link_gain"], any(name.startswith("link_") for name in free)
    used = [law for law in folded if law is not gain or linked]
    code = _code(chain, folder.prefix, folder.precision, laws, limits=limits, compliances=compliances)
    real, numbers = real_type(folder.precision), chain.numbers()
    weights = tuple(weight for weight in weights for _ in range(2))  # of inner links, and of those at the ends
    columns: dict[str, tuple[float, ...]] = {"H": tuple(w for w, _ in weights), "carry": tuple(c for _, c in weights)}
    columns |= dict(folder.coefficients)
    columns |= {name: (numbers[name],) * len(weights) for name in free}
    if linked:  # `retune` fills it in
        columns["gain"] = (0.0,) * len(weights)
    fields = "\n".join(f"    {real} {name};" for name in columns)
    rows = "\n".join(
        f"        {{ {', '.join(literal(column[k], folder.precision) for column in columns.values())} }},"
        for k in range(len(weights))
    )
    name = f"{folder.prefix}_weights"
    record = f"typedef struct {{\n{fields}\n}} {name};\n"
    return FreeCode(
        record=f"/* What depends on the weight H [s] of the scheme, and what is tuned. */\n{record}",
        rows=(
            f"static const {name} *{folder.prefix}_rows(void)\n{{\n    static const {name} rows[{len(weights)}] = {{\n"
            f"{rows}\n    }};\n    return rows;\n}}\n"
        ),
        laws="\n".join(law.code for law in used),
        body="\n".join(code.render(template) for template in templates),
        gain_call=law_calls(folder.prefix, laws)("link_gain", {"gain": "&rows[k].gain"}),
    )
