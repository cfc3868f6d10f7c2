"""The chain in C: element laws with the parameters folded in, and the templates of the scheme around them."""

from collections.abc import Mapping
from dataclasses import dataclass

from tendonff.models.chain import Chain
from tendonff.ocp.codegen.partial_evaluation import SpecialisedLaw, Specialiser
from tendonff.ocp.codegen.precision import Precision
from tendonff.ocp.codegen.printer import literal
from tendonff.ocp.step.c_engine import CHAIN_NAMES, chain_numbers
from tendonff.ocp.step.laws import (
    end_mass,
    far_velocity,
    link_force,
    link_gain,
    link_rate,
    link_start,
    link_states,
    near_force,
    path_mass,
    path_mass_drop,
    path_mass_inverse,
)
from tendonff.ocp.step.render import LawCalls, Limits, render_template
from tendonff.ocp.step.scheme import BDF2_CARRY, BDF2_WEIGHT, RESIDUAL_ROUNDING, RESIDUAL_TOLERANCE_N

_PER_END = ("mass", "damping", "stiffness")


@dataclass(frozen=True, slots=True, kw_only=True)
class ChainCode:
    """Parts of a C file about the chain.

    Parameters
    ----------
    header : str
        Types of the stepper; empty for the inverse.
    record : str
        The coefficient record and its values, one row per weight of the scheme.
    laws : str
        Element laws as static functions.
    body : str
        The scheme around them.
    rest : str
        Statements that fill `self->x` with the state at rest under `tension`.
    """

    header: str
    record: str
    laws: str
    body: str
    rest: str


def controller_limits(precision: Precision) -> Limits:
    """Loop bounds of an exported plant, and the balance that its real type can reach.

    Parameters
    ----------
    precision : Precision
    """
    single = precision is Precision.FLOAT
    return Limits(
        iterations=20,
        halvings=10,
        splits=3,
        rounding=2e-6 if single else RESIDUAL_ROUNDING,
        tolerance_N=1e-5 if single else RESIDUAL_TOLERANCE_N,
    )


def inverse_code(chain: Chain, step_s: float, prefix: str, precision: Precision) -> ChainCode:
    """The exact inverse.

    Parameters
    ----------
    chain : Chain
    step_s : float
        h [s].
    prefix : str
        Prefix of every C name in the file.
    precision : Precision
    """
    weights = ((step_s, 0.0), (BDF2_WEIGHT * step_s, BDF2_CARRY))
    folder = _specialiser(chain, weights, prefix, precision)
    far = {"f_c": 0.0, "x_c": 0.0, "pull": 1.0}
    rate: dict[str, float] = {}
    compliances = _compliances(chain, precision)
    if compliances is not None:  # the laws depend on tension and position through their balance only
        far["f"], rate["force"] = 0.0, 0.0
    laws = {
        "link_start": folder.fold(link_start()),
        "link_rate": folder.fold(link_rate(), fixed=rate),
        "link_states": folder.fold(link_states()),
        "far_velocity": folder.fold(far_velocity(), fixed=_end(chain, "far") | far),
        "near_force": folder.fold(near_force(), fixed=_end(chain, "near") | {"x_c": 0.0, "pull": -1.0}),
    }
    mass = path_mass_inverse() if compliances is None else path_mass_drop()
    laws[mass.name] = folder.fold(mass)
    calls = _calls(prefix, laws)
    return ChainCode(
        header="",
        record=_record(folder, weights),
        laws="\n".join(law.code for law in laws.values()),
        body=render_template("inverse.c.j2", prefix, precision, calls=calls, compliances=compliances),
        rest=_rest(chain, precision, relative=compliances is not None),
    )


def plant_code(chain: Chain, step_s: float, prefix: str, precision: Precision) -> ChainCode:
    """The time step.

    Parameters
    ----------
    chain : Chain
    step_s : float
        h [s].
    prefix : str
        Prefix of every C name in the file.
    precision : Precision
    """
    limits = controller_limits(precision)
    masses = (chain.near.mass_kg, chain.elements.mass_kg, chain.far.mass_kg)
    pieces = tuple((step_s / 2**k, 0.0) for k in range(1, limits.splits + 1))
    weights = ((step_s, 0.0), (BDF2_WEIGHT * step_s, BDF2_CARRY), *pieces)
    folder = _specialiser(chain, weights, prefix, precision)
    laws = {
        "link_start": folder.fold(link_start()),
        "link_force": folder.fold(link_force()),
        "link_states": folder.fold(link_states()),
        "path_mass": folder.fold(path_mass()),
        "end_mass_near": folder.fold(
            end_mass(), "end_mass_near", fixed=_end(chain, "near") | {"x_c": 0.0, "pull": -1.0}
        ),
        "end_mass_far": folder.fold(
            end_mass(), "end_mass_far", fixed=_end(chain, "far") | {"x_c": 0.0, "f_c": 0.0, "pull": 1.0}
        ),
    }
    calls = _calls(prefix, laws)
    return ChainCode(
        header=render_template("stepper.h.j2", prefix, precision, calls=calls),
        record=_record(folder, weights),
        laws="\n".join(law.code for law in laws.values()),
        body=render_template("stepper.c.j2", prefix, precision, calls=calls, limits=limits, masses_kg=masses),
        rest=_rest(chain, precision),
    )


def _compliances(chain: Chain, precision: Precision) -> tuple[float, float] | None:
    """Compliances of load and link [m/N] for an inverse in deviations; None where it keeps the states themselves.

    A float holds a position of centimetres to nanometres only, which a stiff bristle turns into newtons over a hold.
    Relative to what the tension alone would cause, positions are small and their rounding harmless. Double code keeps
    the states themselves, and so agrees with the Python model to rounding.
    """
    if precision is Precision.DOUBLE:
        return None
    return 1 / chain.far.stiffness_N_per_m, 1 / chain.elements.stiffness_N_per_m


def _specialiser(
    chain: Chain, weights: tuple[tuple[float, float], ...], prefix: str, precision: Precision
) -> Specialiser:
    numbers = _snapped(dict(zip(CHAIN_NAMES, chain_numbers(chain), strict=True)))
    element = {name: value for name, value in numbers.items() if not name.startswith(("near_", "far_"))}
    parameters = {name: (value,) * len(weights) for name, value in element.items()}
    parameters["H"] = tuple(weight for weight, _ in weights)
    folder = Specialiser(prefix=prefix, precision=precision, parameters=parameters)
    (gain,) = folder.evaluate(link_gain())
    reorder = precision is Precision.FLOAT
    return Specialiser(prefix=prefix, precision=precision, parameters=parameters | {"gain": gain}, reorder=reorder)


def _snapped(numbers: dict[str, float]) -> dict[str, float]:
    """Coefficients that differ by rounding only are made equal, so that no code is spent on the difference."""
    names = ("mu_dp", "mu_sp", "mu_dr", "mu_sr")
    for k, name in enumerate(names):
        for other in names[:k]:
            if abs(numbers[name] - numbers[other]) <= 1e-14 * numbers[other]:
                numbers[name] = numbers[other]
    return numbers


def _end(chain: Chain, which: str) -> dict[str, float]:
    end = chain.near if which == "near" else chain.far
    return dict(zip(_PER_END, (end.mass_kg, end.damping_N_s_per_m, end.stiffness_N_per_m), strict=True))


def _calls(prefix: str, laws: Mapping[str, SpecialisedLaw]) -> LawCalls:
    """Calls of folded laws, with the coefficient record in `c`."""

    def call(law: str, arguments: Mapping[str, str], end: str = "") -> str:
        known = laws.get(f"{law}_{end}") or laws[law]
        passed = ["c"] if known.weighted else []
        passed += [arguments[name] for name in (*known.inputs, *known.outputs)]
        return f"{prefix}_{known.name}({', '.join(passed)})"

    return call


def _record(folder: Specialiser, weights: tuple[tuple[float, float], ...]) -> str:
    real = "float" if folder.precision is Precision.FLOAT else "double"
    fields = ["H", "carry", *folder.coefficients]
    columns = [
        tuple(w for w, _ in weights),
        tuple(carry for _, carry in weights),
        *folder.coefficients.values(),
    ]
    lines = [
        "/* What depends on the weight H [s] of the scheme: one row for the first step (implicit Euler), one for every",
        " * later step (second-order backward differences; `carry` is the share of the last change in the base), and",
        " * one for each halving of a step, where there are any. Fields are named after the law that needs them. */",
        "typedef struct {",
        *(f"    {real} {name};" for name in fields),
        f"}} {folder.prefix}_weights;",
        "",
        f"static const {folder.prefix}_weights *{folder.prefix}_weights_of(int row)",
        "{",
        f"    static const {folder.prefix}_weights rows[{len(weights)}] = {{",
    ]
    rows = ([literal(column[k], folder.precision) for column in columns] for k in range(len(weights)))
    lines += [f"        {{ {', '.join(row)} }}," for row in rows]
    return "\n".join([*lines, "    };", "", "    return &rows[row];", "}", ""])


def _rest(chain: Chain, precision: Precision, *, relative: bool = False) -> str:
    """Statements for the state at rest: affine in the tension, so two evaluations of `rest_state` say it all."""
    zero, one = chain.rest_state(0.0).vector(), chain.rest_state(1.0).vector()
    zero_text = literal(0.0, precision)
    n = chain.count
    blocks = ((0, n + 2), (n + 2, 3 * n + 4), (3 * n + 4, 4 * n + 4), (4 * n + 4, 4 * n + 5), (4 * n + 5, 4 * n + 6))
    lines = []
    for first, last in blocks:
        slope = 0.0 if relative else float(one[first] - zero[first])
        value = f"tension * {literal(slope, precision)}" if slope else zero_text
        if last - first == 1:
            lines.append(f"    self->x[{first}] = {value};")
        else:
            lines.append(f"    for (j = {first}; j < {last}; j++) {{\n        self->x[j] = {value};\n    }}")
    return "\n".join(lines)
