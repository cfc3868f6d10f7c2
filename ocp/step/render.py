"""The time step in C: templates filled in, for the host and for a controller alike, and how they call the laws."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import jinja2

from tendonff.models.layout import INPUT_NAMES, StateLayout
from tendonff.ocp.codegen.partial_evaluation import SpecialisedLaw
from tendonff.ocp.codegen.precision import Precision
from tendonff.ocp.codegen.printer import literal, real_type
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


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """Bounds of the loops of a generated step, and the balance that counts as solved.

    Parameters
    ----------
    iterations, halvings, splits, pieces : int
        Newton iterations, halvings of one, halvings of the step, and pieces of a step that was split.
    rounding : float
        Relative addition to the tolerance: rounding of the largest link force [-].
    tolerance_N : float
        Balance that counts as solved [N].
    """

    iterations: int = MAX_ITERATIONS
    halvings: int = MAX_HALVINGS
    splits: int = MAX_SPLITS
    pieces: int = MAX_PIECES
    rounding: float = RESIDUAL_ROUNDING
    tolerance_N: float = RESIDUAL_TOLERANCE_N


def law_calls(prefix: str, laws: Mapping[str, SpecialisedLaw]) -> Callable[..., str]:
    """How generated code calls its laws: arguments by name, parameters from the record `c`.

    Parameters
    ----------
    prefix : str
        Prefix of every C name.
    laws : mapping of str to SpecialisedLaw
        By their names; those of an end mass that differ between the ends with "_near" or "_far" behind.

    Returns
    -------
    callable
        (law, *arguments, end) -> C text. `arguments` hold the text of inputs that are no parameters and of outputs;
        `end` is "near" or "far" for the laws of an end mass.
    """

    def call(law: str, *parts: Mapping[str, str], end: str = "") -> str:
        arguments = {name: text for part in parts for name, text in part.items()}
        known = laws.get(f"{law}_{end}") or laws[law]
        parameters = (arguments.get(name) or f"c->{name.replace('end_', f'{end}_', 1)}" for name in known.inputs)
        passed = [*(["c"] if known.weighted else []), *parameters, *(arguments[name] for name in known.outputs)]
        return f"{prefix}_{known.name}({', '.join(passed)})"

    return call


@dataclass(frozen=True, slots=True, kw_only=True)
class StepCode:
    """What the templates need to know.

    Parameters
    ----------
    prefix : str
        Prefix of every C name.
    precision : Precision
    layout : StateLayout
        Its count does not matter.
    laws : mapping of str to SpecialisedLaw
    count, size : str
        C text of the number of masses, in functions and where arrays are declared.
    solve : str
        Template of one implicit step.
    numbers : mapping of str to str
        C text of each of the chain's numbers where it stands alone.
    host : bool, optional
        Help the host's compiler: arrays do not overlap, and the numbers do not change.
    limits : Limits, optional
    compliances : mapping of str to float or C text, optional
        For an inverse that keeps states relative to what the tension alone would cause: by state, [m/N].
    """

    prefix: str
    precision: Precision
    layout: StateLayout
    laws: Mapping[str, SpecialisedLaw]
    count: str
    size: str
    solve: str
    numbers: Mapping[str, str]
    host: bool = False
    limits: Limits = Limits()
    compliances: Mapping[str, float | str] | None = None

    def work(self) -> tuple[tuple[str, str], ...]:
        """Arrays of the work area of one step, with their sizes in C."""
        n = self.size
        links = ((name, f"{n} + 1") for name in ("start", "force", "slope"))
        own = ((f"new_{name}", n) for name in self.layout.friction_states)
        masses = ("v", "trial", "residual", "lower", "diag", "upper", "move")
        return (("base", _text(*self.layout.offset("end"), n)), *links, *own, *((name, f"{n} + 2") for name in masses))

    def render(self, template: str) -> str:
        """One of the templates in `ocp/step/templates`, filled in.

        Parameters
        ----------
        template : str
            File name.
        """
        limits, precision, states = self.limits, self.precision, self.layout
        target = f"const {self.prefix}_weights *const c = given;\n    (void)c;"

        def number(value: float) -> str:
            return literal(value, precision)

        def indexed(names: Sequence[str], array: str, at: str) -> dict[str, str]:
            return {f"{s}_base": f"{array}[{_text(*states.offset(s), 'n')} + {_inner(at)}]" for s in names}

        return _TEMPLATES.get_template(template).render(
            prefix=self.prefix,
            upper=self.prefix.upper(),
            real=real_type(precision),
            fabs="fabsf" if precision is Precision.FLOAT else "fabs",
            restrict="restrict " if self.host else "",
            # On the host a copy that nothing can change lets the compiler keep the numbers in registers.
            enter=f"const {self.prefix}_weights own = *given, *const c = &own;" if self.host else target,
            count=self.count,
            solve=self.solve,
            call=law_calls(self.prefix, self.laws),
            at=lambda name: _text(*states.offset(name), "n"),
            bases=indexed,
            ends=lambda names, prefix, at: {s: f"&{prefix}{s}[{at}]" for s in names},
            based=lambda names: {f"{s}_base": f"{s}_base" for s in names},
            same=lambda names: {s: s for s in names},
            number=lambda name: self.numbers[name],
            numbers=tuple(self.numbers),
            parameters=lambda prefix: [name for name in self.numbers if name.startswith(prefix)],
            index=list(self.numbers).index,
            outputs={name: law.outputs for name, law in self.laws.items()},
            addresses=lambda law: {name: f"&{name}" for name in self.laws[law].outputs},
            work=self.work(),
            state_text=", ".join(name for name, _, _ in states.blocks),
            link_states=states.link_states,
            friction_states=states.friction_states,
            input_names=INPUT_NAMES,
            shifted=self.compliances is not None,
            compliances={
                name: value if isinstance(value, str) else number(value)
                for name, value in (self.compliances or {}).items()
            },
            zero=number(0.0),
            half=number(0.5),
            one=number(1.0),
            minus_one=number(-1.0),
            bdf2_carry=number(BDF2_CARRY),
            bdf2_weight=number(BDF2_WEIGHT),
            limits={
                "iterations": limits.iterations,
                "halvings": limits.halvings,
                "splits": limits.splits,
                "pieces": limits.pieces,
                "rounding": number(limits.rounding),
                "tolerance": number(limits.tolerance_N),
            },
            easy={"contraction": number(EASY_CONTRACTION), "moves": EASY_MOVES, "goal": number(EASY_GOAL)},
        )


def _text(per_mass: int, more: int, n: str) -> str:
    """C text of a N + b."""
    if per_mass == 0:
        return str(more)
    product = n if per_mass == 1 else f"({per_mass} * {n})"
    return product if more == 0 else f"({product} + {more})"


def _inner(at: str) -> str:
    return at if at.isidentifier() else f"({at})"
