"""The time step in C: templates filled in, and how they call the laws."""

import functools
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

import jinja2

from tendonff.ocp.codegen.law import Law
from tendonff.ocp.codegen.precision import Precision
from tendonff.ocp.codegen.printer import c_function, literal
from tendonff.ocp.step.laws import inverse_laws, simulation_laws
from tendonff.ocp.step.scheme import (
    BDF2_CARRY,
    BDF2_WEIGHT,
    EASY_CONTRACTION,
    EASY_GOAL,
    EASY_MOVES,
    MAX_HALVINGS,
    MAX_ITERATIONS,
    MAX_PIECES,
    MAX_SPLITS,
    RESIDUAL_ROUNDING,
    RESIDUAL_TOLERANCE_N,
)

_TEMPLATES = jinja2.Environment(  # noqa: S701 - C, not HTML
    loader=jinja2.PackageLoader("tendonff.ocp.step"),
    undefined=jinja2.StrictUndefined,
    keep_trailing_newline=True,
    trim_blocks=True,
)


class LawCalls(Protocol):
    """How generated code calls a law."""

    def __call__(self, law: str, arguments: Mapping[str, str], end: str = "") -> str:
        """C text of a call.

        Parameters
        ----------
        law : str
            Name of a law in `elements`.
        arguments : mapping of str to str
            C text of each input that belongs to the state, and of each output, by the law's own names.
        end : str, optional
            "near" or "far" for the laws of an end mass.
        """
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """Bounds of the loops of a generated step, and the balance that counts as solved.

    Parameters
    ----------
    iterations, halvings, splits : int
        Newton iterations, halvings of one, and halvings of the step.
    rounding : float
        Relative addition to the tolerance: rounding of the largest link force [-].
    tolerance_N : float
        Balance that counts as solved [N].
    """

    iterations: int = MAX_ITERATIONS
    halvings: int = MAX_HALVINGS
    splits: int = MAX_SPLITS
    rounding: float = RESIDUAL_ROUNDING
    tolerance_N: float = RESIDUAL_TOLERANCE_N


@functools.cache
def _law_table() -> dict[str, Law]:
    return {law.name: law for law in (*simulation_laws(), *inverse_laws())}


def struct_calls(prefix: str) -> LawCalls:
    """Calls of laws whose parameters are fields of `<prefix>_chain *s`, with the weight in `H`.

    Parameters
    ----------
    prefix : str
    """

    def call(law: str, arguments: Mapping[str, str], end: str = "") -> str:
        known = _law_table()[law]

        def argument(name: str) -> str:
            if name in arguments:
                return arguments[name]
            return "H" if name == "H" else f"s->{end}{'_' if end else ''}{name}"

        inputs = [argument(symbol.name()) for symbol in known.inputs]
        return f"{prefix}_{law}({', '.join([*inputs, *(arguments[name] for name in known.outputs)])})"

    return call


def render_template(
    name: str,
    prefix: str,
    precision: Precision,
    *,
    calls: LawCalls | None = None,
    limits: Limits | None = None,
    compliances: tuple[float, float] | None = None,
    masses_kg: tuple[float, float, float] | None = None,
) -> str:
    """One of the C templates with its real type, prefix and literals filled in.

    Parameters
    ----------
    name : str
        File name in `ocp/templates`.
    prefix : str
        Prefix of every C name.
    precision : Precision
    calls : LawCalls, optional
        How laws are called where their parameters are folded in (`specialise`); default: parameters in a record.
    limits : Limits, optional
        Bounds of the loops; default: those of the scheme.
    compliances : tuple of float, optional
        Compliance of the load's spring and lasting compliance of a link [m/N], for an inverse that keeps the load's
        position and the elongations relative to them.
    masses_kg : tuple of float, optional
        Near end, one mass on the path, far end, where they are folded in.
    """

    def number(value: float) -> str:
        return literal(value, precision)

    single, exported = precision is Precision.FLOAT, calls is not None
    limits = limits or Limits()
    return _TEMPLATES.get_template(name).render(
        prefix=prefix,
        exported=exported,
        call=calls or struct_calls(prefix),
        H="c->H" if exported else "H",
        masses=("s->near_mass", "s->mass", "s->far_mass") if masses_kg is None else tuple(map(number, masses_kg)),
        shifted=compliances is not None,
        load_compliance="" if compliances is None else number(compliances[0]),
        link_compliance="" if compliances is None else number(compliances[1]),
        real="float" if single else "double",
        fabs="fabsf" if single else "fabs",
        zero=number(0.0),
        half=number(0.5),
        one=number(1.0),
        minus_one=number(-1.0),
        bdf2_carry=number(BDF2_CARRY),
        bdf2_weight=number(BDF2_WEIGHT),
        tolerance=number(limits.tolerance_N) if exported else "s->tolerance_N",
        rounding=number(limits.rounding),
        max_iterations=limits.iterations,
        max_halvings=limits.halvings,
        max_splits=limits.splits,
        easy=number(EASY_CONTRACTION),
        easy_moves=EASY_MOVES,
        goal=number(EASY_GOAL),
        max_pieces=MAX_PIECES,
    )


def print_laws(laws: tuple[Law, ...], prefix: str, precision: Precision) -> str:
    """The laws as static C functions named `<prefix>_<law>`.

    Parameters
    ----------
    laws : tuple of Law
    prefix : str
    precision : Precision
    """
    real = "float" if precision is Precision.FLOAT else "double"
    return "\n".join(
        c_function(f"{prefix}_{law.name}", law.comment, law.inputs, law.outputs, precision, real).code for law in laws
    )
