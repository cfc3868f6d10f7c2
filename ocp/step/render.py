"""The time step in C: templates filled in, for the host and for a controller alike, and how they call the laws."""

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from importlib.resources import files

from tendonff.models.layout import INPUT_NAMES, StateLayout
from tendonff.ocp.codegen.partial_evaluation import FoldedLaw
from tendonff.ocp.codegen.precision import Precision
from tendonff.ocp.codegen.printer import literal
from tendonff.ocp.codegen.templates import environment
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
    MOST_RATIO,
    RESIDUAL_ROUNDING,
    RESIDUAL_TOLERANCE_N,
)

_TEMPLATES = environment("tendonff.ocp.step")

_ALL_LINKS = (("c", "for (i = 0; i <= n; i++)"),)
_LINKS_BY_KIND = (("c", "for (i = 1; i < n; i++)"), ("(&c[1])", "for (i = 0; i <= n; i += n)"))
_HOST_LINKS = (("c", "for (i = 1; i < n; i++)"), ("of_ends", "i = 0;"), ("of_ends", "i = n;"))
"""Loops over links: those at the ends are half as long, and have rows of their own. On the host a loop over the two
ends would be made one over vectors, and cost more than the rest."""


_OF_MASSES = ("friction_", "piece_mass")
"""Prefixes of the names of numbers that each mass may have for itself."""

Compliances = Mapping[str, str | tuple[str, str]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """Bounds of the loops of a generated step, and the balance that counts as solved."""

    # iterations, halvings, splits, pieces: Newton iterations, halvings of one, halvings of the step, and pieces of a
    # step that was split
    iterations: int = MAX_ITERATIONS
    halvings: int = MAX_HALVINGS
    splits: int = MAX_SPLITS
    pieces: int = MAX_PIECES
    rounding: float = RESIDUAL_ROUNDING  # relative addition to the tolerance: rounding of the largest link force [-]
    tolerance_N: float = RESIDUAL_TOLERANCE_N  # balance that counts as solved [N]
    evaluations: int = 0  # evaluations of the balances in one call, whatever happens; 0 for no such bound


@dataclass(frozen=True, slots=True, kw_only=True)
class OnJoints:
    """Data of a path in sections that a controller stores."""

    types: str  # prefix of the C names of the path itself
    contact: str  # prefix of those of friction on its bends
    own: tuple[str, ...]  # numbers of friction that differ from bend to bend, or with the joints
    # joints, far_driven: there are any; one moves the far end
    joints: bool
    far_driven: bool
    factors: bool = False  # friction carries factors that are known at run time only


@dataclass(frozen=True, slots=True, kw_only=True)
class Roots:
    """Method that finds the tensions of a joint's tendons."""

    # moves, tolerance: most moves of a search, and the relative move that counts as none [-]
    moves: int = 60
    tolerance: float = 1e-10
    loose_N: float = 1e-6  # tension at the drum of an end that hangs loose

    def texts(self, precision: Precision) -> dict[str, str]:
        """C texts of these, and of numbers that the search needs."""
        known = {"tolerance": self.tolerance, "loose": self.loose_N, "large": 1e30, "two": 2.0, "three": 3.0}
        return {"moves": str(self.moves)} | {name: literal(value, precision) for name, value in known.items()}


@dataclass(frozen=True, slots=True, kw_only=True)
class Core:
    """Sizes and bounds of the core of bodies and tendons, `core/tff_core.h`."""

    bodies: int = 16
    tendons: int = 24
    moves: int = 30  # of one search for tensions
    evaluations: int = 10_000  # of all tendons in one step
    tolerance: float = 1e-11  # relative move of a tension that counts as none [-]
    nudge_rad: float = 1e-7  # of a joint that follows, for a slope

    def texts(self, precision: Precision) -> dict[str, str]:
        """C texts of these."""
        numbers = {"tolerance": literal(self.tolerance, precision), "nudge": literal(self.nudge_rad, precision)}
        return numbers | {n: str(getattr(self, n)) for n in ("bodies", "tendons", "moves", "evaluations")}


def core_text(prefix: str) -> str:
    """The fixed text of the core, under a prefix of its own."""
    text = files("tendonff.ocp.step").joinpath("core/tff_core.h").read_text("utf-8")
    return text.replace("tff_", f"{prefix}_").replace("TFF_", f"{prefix.upper()}_")


def law_calls(laws: Mapping[str, FoldedLaw]) -> Callable[..., str]:
    """Convention by which generated code calls its laws: see `StepCode.call`.

    Laws of an end mass that differ between the ends are named with "_near" or "_far" behind.
    """

    def call(law: str, *parts: Mapping[str, str], end: str = "", link: str = "c", own: str = "", mass: str = "") -> str:
        known = laws.get(f"{law}_{end}") or laws[law]
        arguments = {name: text for part in parts for name, text in part.items()}

        def value(name: str) -> str:
            if (text := arguments.get(name)) is not None:
                return text
            if own and mass and name.startswith(_OF_MASSES):
                return own.format(name=name, mass=mass)
            of_end = name.replace("end_", f"{end}_", 1)
            return arguments.get(of_end, f"{link}->{of_end}")

        passed = [*([link] if known.weighted else []), *map(value, known.inputs)]
        return f"{known.prefix}_{known.name}({', '.join([*passed, *(arguments[name] for name in known.outputs)])})"

    return call


@dataclass(frozen=True, slots=True, kw_only=True)
class StepCode:
    """Values for the templates."""

    prefix: str  # prefix of every C name
    precision: Precision
    record_type: str = ""  # C type of the record of coefficients; default: `<prefix>_weights`
    solver: str = ""  # prefix of the C functions that solve its linear equations; default: `prefix`
    shared: bool = False  # other files call its steps too
    directions: int = 0  # of its sensitivities; 0: as many as the caller says
    layout: StateLayout  # its count does not matter
    laws: Mapping[str, FoldedLaw]
    # count, size: C text of the number of masses, in functions and where arrays are declared
    count: str
    size: str
    numbers: Mapping[str, str]  # C text of each of the chain's numbers where it stands alone
    host: bool = False  # for the host: any number of masses, numbers in a record, easy steps; else for a controller
    moving: bool = False  # masses differ from one another, or from step to step
    of_masses: tuple[str, ...] = ()  # names of what differs from mass to mass
    limits: Limits = Limits()
    free: tuple[str, ...] = ()  # numbers that the caller of the inverse hands over
    # for an inverse that keeps states relative to what the tension alone would cause: by state, [m/N]; those of links
    # for inner ones and for those at the ends
    compliances: Compliances | None = None
    on_joints: OnJoints | None = None  # for a controller, where the path moves or has sections
    held: bool = False  # a servo's stiffness holds the near end, whose rounding counts too
    joint_numbers: tuple[str, ...] = ()  # of a driven joint between two chains
    roots: Roots | None = None  # of a driven joint on a controller, whose inverse is all that is wanted
    record: tuple[str, ...] = ()  # numbers of its tendons that its laws take from a record
    weigh: FoldedLaw | None = None  # what depends on the weight H, where that may be known at run time only
    core: Core | None = None  # of bodies and tendons
    lean: bool = False  # of those the inverse is all that is wanted
    inputs: tuple[str, ...] = INPUT_NAMES  # that its laws take
    lengths: tuple[str, ...] = ("",)  # of its rows of one weight: C text of the ratio that each kind of link has

    def call(
        self,
        law: str,
        *parts: Mapping[str, str],
        end: str = "",
        link: str = "c",
        mass: str = "",
        own: str = "own_{name}[{mass}]",
    ) -> str:
        """C text of a call: arguments by name, parameters from the record `c`, or each mass's own where masses differ.

        `parts` are texts of inputs that are no parameters, and of outputs; what the law does not take is left out.
        `end` is "near" or "far" for the laws of an end mass, `link` the record of the link and `mass` the index of the
        mass that the law is for, `own` the text of a mass's own number by {name} and {mass}.
        """
        given = {name: name for name in self.free}
        if self.on_joints is not None:
            own = f"contact[{self.on_joints.types}_path_bend_of[{{mass}}]].{{name}}"
        elif not self.moving:
            own = ""
        return law_calls(self.laws)(law, given, *parts, end=end, link=link, own=own, mass=mass)

    @property
    def small(self) -> bool:
        """For a controller that runs the inverse alone."""
        return self.roots is not None or self.lean

    @property
    def friction_numbers(self) -> tuple[str, ...]:
        """Names of the parameters of friction on one mass."""
        return tuple(name for name in self.numbers if name.startswith("friction_"))

    @property
    def ready(self) -> dict[str, tuple[str, ...]]:
        """By name of a law that was split: results of its first part."""
        return {name: made.outputs for name in self.laws if (made := self.laws.get(f"{name}_ready")) is not None}

    def work(self) -> tuple[tuple[str, str], ...]:
        """Arrays of the work area of one step, with their sizes in C."""
        n = self.size
        links = ((name, f"{n} + 1") for name in ("start", "force", "slope"))
        own = [(f"new_{name}", n) for name in self.layout.friction_states]
        own += [(f"new_{name}", "1") for name in self.layout.end_states]
        if "path_mass_tangent" in self.laws:
            own += [(f"{name}_by_{over}", n) for name in self.layout.friction_states for over in ("v", "near", "far")]
        masses: tuple[str, ...] = ("v", "trial", "residual", "lower", "diag", "upper", "move")
        if self.small:
            links, masses = ((name, f"{n} + 1") for name in ("start", "force")), ("v",)
        extra: list[tuple[str, str]] = []
        if self.moving:
            extra += [("gain", f"{n} + 1"), ("ratio", f"{n} + 1"), ("drift", f"{n} + 2")]
        if self.moving and self.host:
            extra += [(name, n) for name in ("angle", "kept", "kept_old", "piece_mass_kg", *self.friction_numbers)]
        if self.ready:
            extra.append(("ready", f"{sum(map(len, self.ready.values()))} * ({n} + 1)"))
        base = ("base", _text(*self.layout.offset("end"), n))
        return (base, *links, *own, *((name, f"{n} + 2") for name in masses), *extra)

    def render(self, template: str) -> str:
        """Template of `ocp/step/templates`, filled in."""
        limits, precision, states = self.limits, self.precision, self.layout
        record_type = self.record_type or f"{self.prefix}_weights"
        enter = f"const {record_type} *const c = given;\n    (void)c;"
        if (
            self.host and not self.small
        ):  # a copy that nothing can change lets the compiler keep the numbers in registers
            enter = f"const {record_type} local = given[0], *const c = &local;"
        real, restrict = precision.value, "restrict " if self.host and not self.small else ""
        own = ("piece_mass_kg", *self.friction_numbers) if self.moving and self.host else ()
        on_joints = self.on_joints
        contact = f"const {on_joints.contact}_contact *contact, " if on_joints else ""

        def number(value: float) -> str:
            return literal(value, precision)

        def of_masses(name: str) -> str:
            row = self.of_masses.index(name)
            return f"c->of_masses[{('', 'n + ')[row] if row < 2 else f'({row} * n) + '}i]"

        def at(name: str) -> str:
            return _text(*states.offset(name), "n")

        return _TEMPLATES.get_template(template).render(
            prefix=self.prefix,
            record_type=record_type,
            solver=self.solver or self.prefix,
            solver_kind="static " if self.host else "",
            kind="" if self.shared else "static ",
            directions=self.directions,
            upper=self.prefix.upper(),
            real=real,
            fabs="fabsf" if precision is Precision.FLOAT else "fabs",
            restrict=restrict,
            enter=enter,
            enter_links=enter.replace(", ", ", ends = given[1], ", 1).replace(";", ", *const of_ends = &ends;")
            if self.host and not self.moving
            else enter,
            count=self.count,
            weights=f"const {record_type} *c",
            given=f"const {record_type} *given",
            solve="solve_host.c.j2" if self.host else "solve_target.c.j2",
            host=self.host,
            view="" if self.host else "w->",
            apart=f"{self.prefix.upper()}_APART " if self.host and not self.small else "",
            moving=self.moving,
            call=self.call,
            rate=lambda i, drift: (
                f"v[{i}] - v[{i} + 1]" if not self.moving else f"(v[{i}] - v[{i} + 1]) + {drift}[{i}]"
            ),
            row_of=lambda k: k if on_joints or self.small else f"2 * ({k})",
            link_loops=_ALL_LINKS if self.moving else _HOST_LINKS if self.host else _LINKS_BY_KIND,
            link_of_i="c" if self.moving else "l",
            ratio_given=lambda record, i="i": f"ratio[{i}]" if self.moving and record == "c" else f"{record}->ratio",
            gain_given=lambda record: "gain[i]" if self.moving else f"{record}->gain",
            per_mass=of_masses,
            contact_numbers=own[1:],
            contact_arguments={f"contact_{n[9:]}": of_masses(f"contact_{n[9:]}") for n in own[1:]}
            | {name: f"&{name}" for name in own[1:]},
            free=self.free,
            ratio_parameter=f"const {real} *{restrict}ratio, " if self.moving else "",
            ratio_argument="w->ratio, " if self.moving else "",
            gain_parameter=f", {real} *{restrict}gain" if self.moving else "",
            gain_argument=", w->gain" if self.moving else "",
            drift_parameter=f"const {real} *{restrict}drift, " if self.moving else "",
            drift_argument="w->drift, " if self.moving else "",
            own_parameter=contact or "".join(f"const {real} *{restrict}own_{name}, " for name in own),
            own_argument="w->contact, " if on_joints else "".join(f"w->{name}, " for name in own),
            on_joints=on_joints,
            skips_friction=on_joints is not None and on_joints.joints,
            links_parameter=f"const {real} *restrict start, {real} *restrict force, {real} *restrict slope, "
            if self.host
            else "",
            links_argument="w->start, w->force, w->slope, " if self.host else "",
            gains_parameter=f"const {real} *{restrict}gain, " if self.moving else "",
            gains_argument="w->gain, " if self.moving else "",
            place_argument="&place, " if self.moving else "",
            of_masses=self.of_masses,
            at=at,
            bases=lambda names, array, i: {f"{s}_base": f"{array}[{at(s)} + {_inner(i)}]" for s in names},
            ends=lambda names, prefix, at: {s: f"&{prefix}{s}[{at}]" for s in names},
            elements=lambda names, i: {s: f"&x[{at(s)} + {i}]" for s in names},
            based_seeds=lambda names: {f"{s}_base": f"{s}_base[k]" for s in names},
            own_seeds=lambda names: {s: f"own_{s}[k]" for s in names},
            slopes="joint_torque_tangent" in self.laws,
            based=lambda names: {f"{s}_base": f"{s}_base" for s in names},
            same=lambda names: {s: s for s in names},
            number=lambda name: self.numbers[name],
            numbers=tuple(self.numbers),
            parameters=lambda prefix: [name for name in self.numbers if name.startswith(prefix)],
            end_states=states.end_states,
            rubs=lambda base: {f"{name}_base": f"{base}[{at(name)}]" for name in states.end_states},
            end_addresses=lambda x: {name: f"&{x}[{at(name)}]" for name in states.end_states},
            own_law=lambda law, end: f"{law}_{end}" if f"{law}_{end}" in self.laws else law,
            index=list(self.numbers).index,
            takes=lambda law, name: name in self.laws[law].inputs,
            outputs={name: law.outputs for name, law in self.laws.items()},
            ready=self.ready,
            addressed=lambda law, first: {name: f"&ready[{first + k}]" for k, name in enumerate(self.ready[law])},
            given_ready=lambda law, first: {name: f"ready[{first + k}]" for k, name in enumerate(self.ready[law])},
            addresses=lambda law: {name: f"&{name}" for name in self.laws[law].outputs},
            work=self.work(),
            state_text=", ".join(name for name, _, _ in states.blocks),
            link_states=states.link_states,
            friction_states=states.friction_states,
            input_names=self.inputs,
            held=self.held,
            joint_numbers=self.joint_numbers,
            record=self.record,
            weigh=self.weigh,
            lengths=self.lengths,
            most_ratio=number(MOST_RATIO),
            shifted=self.compliances is not None,
            compliances=self.compliances,
            zero=number(0.0),
            half=number(0.5),
            one=number(1.0),
            minus_one=number(-1.0),
            bdf2_carry=number(BDF2_CARRY),
            bdf2_weight=number(BDF2_WEIGHT),
            on_joint=self.roots is not None,
            small=self.small,
            core=(self.core or Core()).texts(precision),
            sqrt="sqrtf" if precision is Precision.FLOAT else "sqrt",
            root=(self.roots or Roots()).texts(precision),
            counted=self.host or limits.evaluations > 0,
            limits=asdict(limits) | {"rounding": number(limits.rounding), "tolerance": number(limits.tolerance_N)},
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
