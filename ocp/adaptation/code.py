"""The tuner in C: its laws from the symbolic models, its template, and the library of the host."""

import functools
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import casadi as ca

from tendonff.models.fidelity import Level
from tendonff.models.layout import INPUT_NAMES, fields_of
from tendonff.models.parameters import Transmission
from tendonff.models.parameters.transmission import LARGEST_EXPONENT
from tendonff.models.tendon.chain import Chain
from tendonff.models.tendon.elements import Whole, whole_of
from tendonff.ocp.adaptation.recursion import RECALL, Prior, covariance_names, return_law, trust_law, update_law
from tendonff.ocp.adaptation.tuning import (
    DOUBTED,
    EXPLAINED,
    GATE,
    MAX_DELAY,
    PEAK,
    SPREADS,
    START_DEVIATION,
    STATED_EXPONENT,
    UNKNOWN_EXPONENT,
    Nuisance,
    Tunable,
    Tuning,
)
from tendonff.ocp.codegen.compiler import find_compiler, load_library, why_no_compiler
from tendonff.ocp.codegen.partial_evaluation import FoldedLaw, PartialEvaluator
from tendonff.ocp.codegen.precision import Precision
from tendonff.ocp.codegen.printer import Law, literal
from tendonff.ocp.codegen.prototype import CFunction
from tendonff.ocp.codegen.templates import environment
from tendonff.ocp.errors import CodeError
from tendonff.ocp.step.c_engine import PREFIX, host_source
from tendonff.ocp.step.folding import rest_statements
from tendonff.ocp.step.laws import ElementLaws
from tendonff.ocp.step.protocol import Array
from tendonff.ocp.step.render import law_calls
from tendonff.ocp.step.target import LOAD_STIFFNESS

_TEMPLATES = environment("tendonff.ocp.adaptation")
_FRICTION = ("mu_dynamic_pull", "mu_static_pull"), ("mu_dynamic_release", "mu_static_release")
_SCALED: dict[Tunable, tuple[str, ...]] = {
    Tunable.MU: _FRICTION[0] + _FRICTION[1],
    Tunable.MU_PULL: _FRICTION[0],
    Tunable.MU_RELEASE: _FRICTION[1],
    Tunable.TENDON_STIFFNESS: (
        "stiffness_N_per_m",
        "relaxing_stiffness_N_per_m",
        "second_relaxing_stiffness_N_per_m",  # where the tendon has one
    ),
}
_OF_SECTIONS = _FRICTION[0] + _FRICTION[1]
LEAST_LOAD = 1e-2
"""Least tension, of that at the start, under which friction still changes with it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TunedChain:
    """A chain some of whose parameters carry a factor."""

    whole: Whole  # the tendon at factors of 1
    chain: Chain  # made of it
    parameters: tuple[Tunable, ...]

    @classmethod
    @functools.lru_cache(maxsize=32)
    def of(
        cls, transmission: Transmission, level: Level, parameters: tuple[Tunable, ...], segments: int | None = None
    ) -> "TunedChain":
        """Chain of a transmission; for the same numbers the same object, whose code is compiled once."""
        return cls(
            whole=whole_of(transmission, level), chain=Chain.of(transmission, level, segments), parameters=parameters
        )

    def exponent(self) -> Prior:
        """Prior of what is added to the load exponent."""
        stated = float(fields_of(self.whole.friction).get("load_exponent", 0.0))
        width = (STATED_EXPONENT if stated else UNKNOWN_EXPONENT) / START_DEVIATION
        return Prior(width=width, least=-stated, most=LARGEST_EXPONENT - stated)

    @property
    def priors(self) -> tuple[Prior, ...]:
        """Priors of the factors; that of the exponent adds to it as much as it is above 1."""
        n = self.exponent()
        factor = Prior(width=n.width, least=1 + n.least, most=1 + n.most)
        return tuple(factor if p is Tunable.LOAD_EXPONENT else Prior() for p in self.parameters)

    def with_factors(self, factors: Mapping[Tunable, ca.SX | float], load: ca.SX | float = 0.0) -> Chain:
        """The chain at other factors; numbers or CasADi scalars.

        A factor of 1 + dn on the load exponent adds dn to it, 0 where none is stated: friction of the whole path
        changes by (T/T_0)^-dn at its mean tension T. `load` is ln(T/T_0), see `load_law`: in slip the mean of ln T over
        all masses, so that the law of each mass is met to first order in dn, at the cost of one power a sample.
        """
        known = fields_of(self.whole.friction) | fields_of(self.whole.link)
        scales = {n: f for key, f in factors.items() for n in _SCALED.get(key, ()) if n in known}
        if Tunable.LOAD_EXPONENT in factors:
            fall = ca.exp((1 - factors[Tunable.LOAD_EXPONENT]) * load)
            scales |= {n: scales.get(n, 1.0) * fall for n in _OF_SECTIONS if n in known}
        own = self.chain.moving  # then sections may have friction of their own
        values = {n: f * known[n] for n, f in scales.items() if not (own and n in _OF_SECTIONS)}
        far = self.chain.far
        if Tunable.LOAD_STIFFNESS in factors:
            far = replace(far, stiffness_N_per_m=factors[Tunable.LOAD_STIFFNESS] * far.stiffness_N_per_m)
        elements = self.whole.changed(values).divided(self.chain.count, self.chain.motion)
        if own and (mus := {n: f * getattr(elements.contact, n) for n, f in scales.items() if n in _OF_SECTIONS}):
            path, contact = elements.path, replace(elements.contact, **mus)  # type: ignore[type-var]
            phi = path.at_zero.angle_rad[0]
            friction = contact.on_piece(phi, elements.angle_share(phi), path.length_share)
            elements = replace(elements, contact=contact, friction=friction)
        return replace(self.chain, elements=elements, far=far)

    def retuned_numbers(self) -> tuple[Law, tuple[str, ...]]:
        """The chain's numbers that follow the factors, with their slopes; and their names."""
        factors = [ca.SX.sym(f"f{k}") for k in range(len(self.parameters))]
        known = dict(zip(self.parameters, factors, strict=True))
        if self.chain.moving:  # friction is the masses' own: see `own_slopes`
            known = {key: f for key, f in known.items() if not set(_SCALED.get(key, ())) & set(_OF_SECTIONS)}
        load = ca.SX.sym("load")
        symbolic = self.with_factors(known, load).numbers()
        every = ca.vertcat(*factors)
        found = {name: ca.SX(value) for name, value in symbolic.items()}
        names = tuple(name for name, value in found.items() if ca.depends_on(value, every))
        outputs = {name: found[name] for name in names}
        outputs |= {f"{n}_by_f{k}": ca.jacobian(found[n], f) for n in names for k, f in enumerate(factors)}
        comment = "Numbers of the chain that are tuned, and their slopes over the factors."
        return Law(name="retuned_numbers", comment=comment, inputs=(*factors, load), outputs=outputs), names

    def scaled_rows(self) -> list[tuple[int, int]]:
        """Rows of `Chain.of_masses` that carry a factor, with its place among the parameters."""
        of_masses = list(self.chain.of_masses())
        return [
            (of_masses.index(f"contact_{name}"), k)
            for k, key in enumerate(self.parameters)
            for name in _SCALED.get(key, ())
            if name in _OF_SECTIONS
        ]

    def own_slopes(self) -> Law:
        """Change of a mass's friction with each factor, from its scaled coefficients and its wrap angle."""
        law = ElementLaws.of(self.chain).contact({})
        factors = [ca.SX.sym(f"f{k}") for k in range(len(self.parameters))]
        by_name = {symbol.name(): symbol for symbol in law.inputs}
        outputs = {}
        for k, key in enumerate(self.parameters):
            for name, value in law.outputs.items():
                mus = [by_name[f"contact_{n}"] for n in _SCALED.get(key, ()) if n in _OF_SECTIONS]
                slope = sum((ca.jacobian(value, mu) * mu for mu in mus), start=ca.SX(0)) / factors[k]
                if not slope.is_zero():
                    outputs[f"{name}_by_f{k}"] = slope
        comment = "Change of friction on a piece with the tuned factors."
        return Law(name="own_slopes", comment=comment, inputs=(*law.inputs, *factors), outputs=outputs)


def rest_on_spring(chain: Chain, tension_N: float) -> Array:
    """State at rest with q_l = 0, where the load's spring has the start tension, unless a joint holds the end."""
    anchor = 0.0 if chain.far_joint is not None else -tension_N / chain.far.stiffness_N_per_m
    return chain.rest_state(tension_N, anchor).vector()


def nuisances_of(tuned: TunedChain, tuning: Tuning) -> tuple[Nuisance, ...]:
    """Nuisance parameters of a chain; the travel of an end that a joint holds is known."""
    return tuple(n for n in tuning.nuisances if n is not Nuisance.LOAD or tuned.chain.far_joint is None)


def lacks_exponent(tuned: TunedChain, nuisances: tuple[Nuisance, ...]) -> bool:
    """Whether friction counts only as far as a load exponent leaves it: tuned alone, from the position, at rest."""
    return bool(nuisances) and tuned.parameters == (Tunable.MU,) and not tuned.chain.moving


def tuner_context(
    tuned: TunedChain, nuisances: tuple[Nuisance, ...], precision: Precision, *, prefix: str, past: int
) -> dict[str, object]:
    """Values for the template `tuner.c.j2`; `past` samples are remembered."""
    chain, (law, names) = tuned.chain, tuned.retuned_numbers()
    layout = chain.layout
    return {
        "prefix": prefix,
        "upper": f"{prefix.upper()}_TUNER",
        "real": precision.value,
        "fabs": "fabsf" if precision is Precision.FLOAT else "fabs",
        "number": lambda value: literal(value, precision),
        "zero": literal(0.0, precision),
        "one": literal(1.0, precision),
        "tuned": len(tuned.parameters),
        "entries": len(covariance_names(len(tuned.parameters))),
        "wide": (wide := len(tuned.parameters) + len(nuisances)),
        "wide_entries": len(covariance_names(wide)),
        "nuisances": nuisances,
        "spreads": [literal(SPREADS[n], precision) for n in nuisances],
        "past": past,
        "gate": GATE,
        "peak": PEAK,
        "doubted": DOUBTED,
        "explained": EXPLAINED,
        "recall": RECALL,
        "reals": layout.size,
        "masses": chain.count,
        "numbers": list(chain.numbers()),
        "retuned": names,
        "retuned_inputs": tuple(
            f"f[{f.name()[1:]}]" if f.name() != "load" else "load"
            for f in law.inputs
            if ca.depends_on(ca.vertcat(*law.outputs.values()), f)
        ),
        "by_load": Tunable.LOAD_EXPONENT in tuned.parameters,
        "lacks_exponent": (beside := lacks_exponent(tuned, nuisances)),
        "columns": len(tuned.parameters) + beside,
        "exponent_width": literal(tuned.exponent().width, precision),
        "widths": ["" if p.width == 1 else f"{literal(p.width**2, precision)} * " for p in tuned.priors],
        "retuned_outputs": tuple(law.outputs),
        "retuned_link": any(name.startswith("link_") for name in names),
        "retuned_load": LOAD_STIFFNESS if LOAD_STIFFNESS in names else "",
        "link_factor": next((k for k, p in enumerate(tuned.parameters) if p is Tunable.TENDON_STIFFNESS), -1),
        "e": (layout.part("e").start, layout.part("e").stop + len(layout.link_states) * (chain.count + 1)),
        "load_stiffness": (
            f"self->model[1].{LOAD_STIFFNESS}"
            if LOAD_STIFFNESS in names
            else literal(float(chain.far.stiffness_N_per_m), precision)
        ),
        "q_a": layout.part("q_a").start,
        "q_l": layout.part("q_l").start,
        "moving": chain.moving,
        "types": "",
        "far_driven": chain.far_joint is not None,
        "inverse_argument": "",
    }


def tuner_laws(tuned: TunedChain, nuisances: tuple[Nuisance, ...], *, on_target: bool = False) -> tuple[Law, ...]:
    """The laws of the recursion and of the tuned numbers; on a controller friction of masses has laws elsewhere."""
    count = len(tuned.parameters)
    numbers = tuned.retuned_numbers()[0]
    own = (tuned.own_slopes(),) if tuned.chain.moving and not on_target else ()
    beside = lacks_exponent(tuned, nuisances)
    spreads = tuple(SPREADS[n] for n in nuisances)
    update = update_law(count, spreads, tuned.priors, tuned.exponent() if beside else None)
    by_load = beside or Tunable.LOAD_EXPONENT in tuned.parameters
    load = (load_law(tuned.whole.value("adhesion_N")),) if by_load else ()
    return update, trust_law(count), return_law(), *((numbers,) if numbers.outputs else ()), *own, *load


def load_law(adhesion_N: float) -> Law:
    """ln(T/T_0) of the path [-]: T is the geometric mean of the tensions at its ends, T_0 that of the start."""
    given = [ca.SX.sym(name) for name in ("near", "far", "start")]
    near, far, start = (tension + adhesion_N for tension in given)
    least = LEAST_LOAD * start
    return Law(
        name="tuning_load",
        comment="Logarithm of the mean tension of the path over that of the start: friction may fall with it.",
        inputs=tuple(given),
        outputs={"load": ca.log(ca.fmax(near, least) * ca.fmax(far, least) / (start * start)) / 2},
    )


def render_tuner(template: str, context: Mapping[str, object]) -> str:
    """Template of this package, filled in."""
    return _TEMPLATES.get_template(template).render(**context)


def _host_text(tuned: TunedChain, nuisances: tuple[Nuisance, ...]) -> str:
    chain, precision = tuned.chain, Precision.DOUBLE
    laws = ElementLaws.of(chain, folded=True)
    every = (*laws.simulation(), *laws.inverse(), *laws.tangent())
    templates = ("kernel.c.j2", "pieces.c.j2", "inverse.c.j2", "weigh.c.j2", "tangent.h.j2", "tangent.c.j2")
    scheme = host_source(chain, every, templates, ways_differ=True)  # as they may in a rig
    printer = PartialEvaluator(prefix=PREFIX, precision=precision, parameters={})
    own = {law.name: printer.fold(law) for law in tuner_laws(tuned, nuisances)}
    gain_arguments = ", ".join(f"c->{symbol.name()}" for symbol in laws.link_gain().inputs)
    context = tuner_context(tuned, nuisances, precision, prefix=PREFIX, past=MAX_DELAY) | {
        "model": PREFIX,
        "inverse": PREFIX,
        "record_of": {PREFIX: f"{PREFIX}_weights"},
        "ends": [{"near_force_N": "force", "far_force_N": "self->tension"}.get(n, "0.0") for n in INPUT_NAMES],
        "most": 0,
        "directions": 0,
        "model_rows": f"{PREFIX.upper()}_ROWS",
        "kinds": 2,
        "inverse_rows": 4,
        "load_row": 1,
        "invert": PREFIX,
        "inverse_chain": "self->inverse, ",
        "inverse_numbers": (),
        "shifted": False,
        "rest": _at_rest(lambda tension_N: rest_on_spring(chain, tension_N), "self->x"),
        "inverse_rest": _at_rest(lambda tension_N: chain.rest_state(tension_N).vector(), "self->inverse_x"),
        "gain_calls": {PREFIX: f"{PREFIX}_link_gain({gain_arguments}, &rows[k].gain)"},
        "work_argument": f", {precision} *memory",
        "work_declaration": f"{PREFIX}_work work_area = {PREFIX}_work_of(memory, {PREFIX.upper()}_TUNER_COUNT);",
        "work": "&work_area",
        "plant_q_a": "(({} * n) + {})".format(*chain.layout.offset("q_a")),
    }
    if chain.moving:
        context |= _moving_context(tuned, own["own_slopes"]) | {"inverse_argument": ", double *inverse_memory"}
    parts = [render_tuner(name, context) for name in ("tuner.h.j2", "tuner.c.j2", "tuner_host.c.j2")]
    return "\n".join([scheme, *(law.code for law in own.values()), *parts])


def _at_rest(state: Callable[[float], Array], x: str) -> str:
    """Statements for a state at rest that follows a tension, as that of two steps; an int j must be there."""
    statements = rest_statements(state(1.0) - state(0.0), Precision.DOUBLE, x)
    return f"{statements}\n    for (j = 0; j < {len(state(0.0))}; j++) {{\n        {x}_old[j] = {x}[j];\n    }}"


def _moving_context(tuned: TunedChain, own_slopes: FoldedLaw) -> dict[str, object]:
    of_masses, layout = list(tuned.chain.of_masses()), tuned.chain.layout

    def per_mass(name: str) -> str:
        return f"c->of_masses[({of_masses.index(name)} * n) + i]"

    known = {name: per_mass(name) for name in of_masses} | {"angle_rad": "angle_rad", "angle_share": "angle_share"}
    known |= {f"f{k}": f"self->f[{k}]" for k in range(len(tuned.parameters))} | {"length_share": "length_share"}
    known |= {name: f"&{name}" for name in own_slopes.outputs}
    return {
        "of_masses": of_masses,
        "friction": [name for name in tuned.chain.numbers() if name.startswith("friction_")],
        "friction_at": [(name, layout.part(name).start) for name in layout.friction_states],
        "scaled_rows": tuned.scaled_rows(),
        "per_mass": per_mass,
        "own_outputs": own_slopes.outputs,
        "own_call": law_calls({"own_slopes": own_slopes})("own_slopes", known),
    }


@dataclass(frozen=True, slots=True, kw_only=True)
class HostTuner:
    """The compiled tuner of the host; double."""

    size: CFunction  # bytes of its memory
    begin: CFunction
    step: CFunction
    report: CFunction
    run: CFunction
    work_reals: CFunction  # reals of the memory of a step of a chain


@functools.lru_cache(maxsize=32)
def host_tuner(tuned: TunedChain, nuisances: tuple[Nuisance, ...]) -> HostTuner:
    """The tuner for a chain, compiled or from the cache.

    Raises
    ------
    CodeError
        If no C compiler works here.
    """
    if find_compiler() is None:
        raise CodeError(
            f"self-tuning runs as compiled C only: {why_no_compiler()} (whatever has no [adaptation] works without, "
            "several times slower)"
        )
    source = _host_text(tuned, nuisances)
    library = load_library(source)

    def function(name: str) -> CFunction:
        return CFunction(library, source, f"{PREFIX}_{name}")

    return HostTuner(
        size=function("tuner_bytes"),
        begin=function("tuner_begin"),
        step=function("tuner_step"),
        report=function("tuner_report"),
        run=function("tuner_run"),
        work_reals=function("work_reals"),
    )
