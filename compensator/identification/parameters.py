"""The numbers that identification looks for: each is one entry here, which fit, file, report and advice all read.

A number of the undivided tendon that a fit shall find as well needs nothing but its entry, if `Whole` has it.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import Enum, ReprEnum
from typing import Any

from tendonff.compensator.identification.constants import TUNED
from tendonff.compensator.identification.pace import UNHURRIED
from tendonff.compensator.identification.spec import Scale, Spec
from tendonff.compensator.scenario.scenario import Scenario
from tendonff.models.parameters import Transmission
from tendonff.models.parameters.transmission import LARGEST_EXPONENT
from tendonff.ocp.fits.chain import ChainModel, ChainResponse, Drive, Numbers, Reading
from tendonff.ocp.fits.entries import Entry
from tendonff.ocp.fits.least_squares import Unknown
from tendonff.ocp.fits.static import StaticParameter
from tendonff.ocp.sensitivity import Parameter as Number


class Role(Enum):
    """When a number is free."""

    CORE = "always"
    TENDON = "where the elongation, or the position of the near end, is explained"
    CONSTANT = "where the data support it"
    LOAD = "where friction that falls with the load explains more than load-independent friction"
    SPEED = "where the data support a dependence on speed"
    KEPT = "never; with the number that it belongs to"
    CELL = "never; found where friction does not act"


@dataclass(frozen=True, slots=True, kw_only=True)
class OfTendon(Spec):
    """Everything that is particular to one number of a tendon.

    Parameters
    ----------
    role : Role
    nudge : float
        Where the search starts if the number may vanish.
    size : float
        What a standard error is judged against; 0 for the value itself.
    alike : float
        Factor by which the scatter between blocks understates the error.
    whole : Number, optional
        Number of the undivided tendon that it is.
    static : StaticParameter, optional
        What the static laws call it.
    may_vanish : bool
        A law may do without it.

    Notes
    -----
    `floor` is a share of the value, for `Scale.TENSION` of the mean tension. Without an `advice` it is full strokes at
    several loads.
    """

    role: Role
    scale: Scale = Scale.START
    low: float = 0.0
    high: float = 1e3
    step: float = 0.7
    nudge: float = 0.0
    size: float = 0.0
    alike: float = 1.0
    whole: Number | None = None
    static: StaticParameter | None = None
    may_vanish: bool = False


_MU: dict[str, Any] = {"role": Role.CORE, "high": 20.0, "step": 0.2}
_BIAS: dict[str, Any] = {
    "role": Role.CONSTANT,
    "scale": Scale.TENSION,
    "low": -1.0,
    "high": 1.0,
    "step": 0.05,
    "size": 0.05,
    "floor": TUNED.adhesion_floor,
    "advice": "not separable from load-independent friction and the other cell's offset; read both cells with a slack "
    "tendon",
}
_NO_RELAXATION = "the holds show no relaxation beyond the noise; use larger steps before longer holds"


_READINGS = {str(reading): reading for reading in Reading}


class Parameter(Entry[OfTendon], ReprEnum):
    """The list; values are names of estimates, in the order of the report."""

    MU_PULL = (
        "mu_dynamic",
        OfTendon(**_MU, floor=0.0005, key="friction.mu_dynamic", static=StaticParameter.PULL),
    )
    MU_RELEASE = (
        "mu_dynamic_release",
        OfTendon(**_MU, floor=0.0008, key="friction.mu_dynamic_release", static=StaticParameter.RELEASE),
    )
    # mu_static/mu_dynamic - 1 in both directions
    STATIC_EXCESS = (
        "static_excess",
        OfTendon(
            role=Role.SPEED,
            scale=Scale.ABSOLUTE,
            high=3.0,
            step=0.1,
            nudge=0.02,
            size=0.2,
            may_vanish=True,
            effect="Stribeck effect",
        ),
    )
    STRIBECK_VELOCITY = (
        "stribeck_velocity_m_per_s",
        OfTendon(
            role=Role.KEPT,
            high=20.0,
            whole=Number.STRIBECK_VELOCITY,
            key="friction.stribeck_velocity_m_per_s",
        ),
    )
    VISCOUS = (
        "viscous_N_s_per_m",
        OfTendon(
            role=Role.SPEED,
            scale=Scale.ABSOLUTE,
            high=1e6,
            step=1.0,
            whole=Number.VISCOUS,
            key="friction.viscous_N_s_per_m",
            may_vanish=True,
            effect="viscous friction",
            advice="add faster strokes (10 times)",
        ),
    )
    BRISTLE = (
        "soft_bristle_stiffness_N_per_m",
        OfTendon(
            role=Role.CORE,
            floor=0.0025,
            alike=3.0,
            whole=Number.BRISTLE_STIFFNESS,
            key="friction.soft_bristle_stiffness_N_per_m",
            static=StaticParameter.BRISTLE,
            advice="add small reversals that do not reach gross sliding",
        ),
    )
    ADHESION = (
        "adhesion_N",
        OfTendon(
            role=Role.CONSTANT,
            scale=Scale.TENSION,
            high=20.0,
            step=0.05,
            nudge=0.05,
            size=0.05,
            floor=TUNED.adhesion_floor,
            whole=Number.ADHESION,
            key="friction.adhesion_N",
            static=StaticParameter.ADHESION,
            may_vanish=True,
            effect="load-independent friction",
            advice="add strokes at low tension",
        ),
    )
    LOAD_EXPONENT = (
        "load_exponent",
        OfTendon(
            role=Role.LOAD,
            scale=Scale.ABSOLUTE,
            low=1e-4,
            high=LARGEST_EXPONENT,
            step=0.1,
            nudge=0.1,
            size=0.1,
            whole=Number.LOAD_EXPONENT,
            key="friction.load_exponent",
            may_vanish=True,
            effect="load exponent",
            advice="add strokes over a wider range of tensions",
        ),
    )
    STIFFNESS = (
        "stiffness_N_per_m",
        OfTendon(
            role=Role.TENDON,
            step=0.2,
            floor=0.0005,
            whole=Number.STIFFNESS,
            key="tendon.stiffness_N_per_m",
            advice="the elongation does not follow the tension; check the positions' units, sign and zero drift",
        ),
    )
    RELAXING = (
        "relaxing_stiffness_N_per_m",
        OfTendon(
            role=Role.TENDON,
            floor=0.001,
            whole=Number.RELAXING_STIFFNESS,
            key="tendon.relaxing_stiffness_N_per_m",
            advice=_NO_RELAXATION,
        ),
    )
    RELAXATION_TIME = (
        "relaxation_time_s",
        OfTendon(
            role=Role.TENDON,
            floor=0.0025,
            whole=Number.RELAXATION_TIME,
            key="tendon.relaxation_time_s",
            advice=_NO_RELAXATION,
        ),
    )
    DAMPING = (
        "damping_N_s_per_m",
        OfTendon(
            role=Role.KEPT,
            whole=Number.DAMPING,
            key="tendon.damping_N_s_per_m",
            advice="it acts on fast changes only; add excitation above 20 Hz",
        ),
    )
    INPUT_GAIN = "input_gain", OfTendon(role=Role.CELL)
    OUTPUT_GAIN = "output_gain", OfTendon(role=Role.CELL)
    INPUT_BIAS = "input_offset_N", OfTendon(**_BIAS, static=StaticParameter.INPUT_BIAS, effect="input offset")
    OUTPUT_BIAS = "output_offset_N", OfTendon(**_BIAS, static=StaticParameter.OUTPUT_BIAS, effect="output offset")

    @property
    def signed(self) -> bool:
        """The number may be negative."""
        return self.spec.low < 0

    @property
    def number(self) -> Number | Reading | None:
        """Number of the tendon or of the measurement that it is; None for one that several follow from."""
        return self.spec.whole or _READINGS.get(str(self))

    def unknown(self, start: float, span_N: float) -> Unknown:
        """Bounds and step of its search, the output tension's range being `span_N`."""
        step = max(start, self.spec.step) if self.spec.scale is Scale.ABSOLUTE else None
        return self.spec.unknown(self, start, step, span_N)

    def size(self, value: float, mean_N: float) -> float:
        """Scale of its standard error, the mean output tension being `mean_N`."""
        return (self.spec.size * (mean_N if self.spec.scale is Scale.TENSION else 1.0)) or abs(value)

    def floor(self, value: float, mean_N: float) -> float:
        """Standard error of the method itself."""
        return self.spec.floor * (mean_N if self.spec.scale is Scale.TENSION else abs(value))

    def of(self, scenario: Scenario) -> float | None:
        """The scenario's value; None where it has none."""
        table, _, key = self.spec.key.partition(".")
        if not key:
            return None
        friction = scenario.transmission.friction
        return (
            friction.release_dynamic
            if self is MU_RELEASE
            else float(getattr(getattr(scenario.transmission, table), key) or 0.0)
        )


PARAMETERS = tuple(Parameter)
MU_PULL, MU_RELEASE, STATIC_EXCESS = Parameter.MU_PULL, Parameter.MU_RELEASE, Parameter.STATIC_EXCESS
CORE, TENDON, CONSTANTS, SPEED_TERMS, CELL_GAINS = (
    tuple(p for p in PARAMETERS if p.spec.role is role)
    for role in (Role.CORE, Role.TENDON, Role.CONSTANT, Role.SPEED, Role.CELL)
)
BIASES = tuple(p for p in PARAMETERS if p.signed)

Values = Mapping[Parameter, float]


def _direction(parameter: Parameter, values: Values) -> Numbers:
    """Sensitivity of the tendon's numbers, and of the cells' readings, to a parameter."""
    excess = 1 + values[STATIC_EXCESS]
    if parameter is MU_PULL:
        return {Number.MU_DYNAMIC_PULL: 1.0, Number.MU_STATIC_PULL: excess}
    if parameter is MU_RELEASE:
        return {Number.MU_DYNAMIC_RELEASE: 1.0, Number.MU_STATIC_RELEASE: excess}
    if parameter is STATIC_EXCESS:
        return {Number.MU_STATIC_PULL: values[MU_PULL], Number.MU_STATIC_RELEASE: values[MU_RELEASE]}
    return {} if parameter.number is None else {parameter.number: 1.0}


@dataclass(frozen=True, slots=True, kw_only=True)
class ParametricChain(ChainModel):
    """The chain over the parameters of identification.

    Parameters
    ----------
    symmetric : bool
        `MU_PULL` counts for both directions.
    keep_pace : callable
        Called before each simulation.
    """

    symmetric: bool = False
    keep_pace: Callable[[], None] = UNHURRIED.keep

    def values(self) -> dict[Parameter, float]:
        """The scenario's own values of all parameters."""
        own = self.numbers()
        mu = own[Number.MU_DYNAMIC_PULL]
        return {
            **{p: own[p.number] for p in PARAMETERS if p.number is not None},
            MU_PULL: mu,
            MU_RELEASE: own[Number.MU_DYNAMIC_RELEASE],
            STATIC_EXCESS: own[Number.MU_STATIC_PULL] / mu - 1 if mu > 0 else 0.0,
        }

    def numbers_of(self, values: Values) -> dict[str, float]:
        """Numbers of the tendon and the cells' readings at given values, all of them."""
        values = self.tied(values)
        direct: dict[str, float] = {p.number: values[p] for p in PARAMETERS if p.number is not None}
        mus = {k: by * values[p] for p in (MU_PULL, MU_RELEASE) for k, by in _direction(p, values).items()}
        return {**direct, **mus}

    def tied(self, values: Values) -> dict[Parameter, float]:
        """All values, where one coefficient counts for both directions."""
        return {**values, **({MU_RELEASE: values[MU_PULL]} if self.symmetric else {})}

    def predict(self, values: Values, drive: Drive, over: Sequence[Parameter] = ()) -> ChainResponse:
        """Simulate a drive at all values, with derivatives over some; SolveError if that fails."""
        self.keep_pace()
        values = self.tied(values)
        directions = [_direction(p, values) for p in over]
        if self.symmetric:
            both = {**_direction(MU_PULL, values), **_direction(MU_RELEASE, values)}
            directions = [both if p is MU_PULL else d for p, d in zip(over, directions, strict=True)]
        return self.respond(self.numbers_of(values), drive, directions)


def put_into(transmission: Transmission, model: ParametricChain, values: Values) -> Transmission:
    """The transmission with all values of a fitted chain: they were fitted together and belong together."""
    numbers, tables = model.numbers_of(values), dict[str, dict[str, float]]()
    for parameter in PARAMETERS:
        table, _, key = parameter.spec.key.partition(".")
        if key and parameter.spec.whole is not None:
            tables.setdefault(table, {})[key] = numbers[parameter.spec.whole]
    del tables["friction"]["load_exponent"]
    tables["friction"] |= {
        "mu_dynamic": numbers[Number.MU_DYNAMIC_PULL],
        "mu_static": numbers[Number.MU_STATIC_PULL],
        "mu_dynamic_release": numbers[Number.MU_DYNAMIC_RELEASE],
        "mu_static_release": numbers[Number.MU_STATIC_RELEASE],
    }
    loaded = replace(transmission, friction=model.loaded(numbers[Number.LOAD_EXPONENT]))
    changed: dict[str, Any] = {table: replace(getattr(loaded, table), **keys) for table, keys in tables.items()}
    return replace(transmission, **changed)
