"""The chain over the parameters of identification."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from tendonff.compensator.identification.pace import UNHURRIED
from tendonff.compensator.identification.parameters import BY_TENSIONS, MU, MU_RELEASE, STATIC_EXCESS, Parameter
from tendonff.models.parameters import Transmission
from tendonff.ocp.fits.chain import ChainModel, ChainResponse, Drive, Numbers
from tendonff.ocp.sensitivity import Parameter as ChainNumber

Values = Mapping[Parameter, float]


def _direction(parameter: Parameter, values: Values) -> Numbers:
    """Sensitivity of the tendon's numbers, and of the cells' readings, to a parameter."""
    excess = 1 + values[STATIC_EXCESS]
    if parameter is MU:
        return {ChainNumber.MU_DYNAMIC_PULL: 1.0, ChainNumber.MU_STATIC_PULL: excess}
    if parameter is MU_RELEASE:
        return {ChainNumber.MU_DYNAMIC_RELEASE: 1.0, ChainNumber.MU_STATIC_RELEASE: excess}
    if parameter is STATIC_EXCESS:
        return {ChainNumber.MU_STATIC_PULL: values[MU], ChainNumber.MU_STATIC_RELEASE: values[MU_RELEASE]}
    return {} if parameter.tensions.number is None else {parameter.tensions.number: 1.0}


@dataclass(frozen=True, slots=True, kw_only=True)
class ParametricChain(ChainModel):
    """The chain over the parameters of identification.

    Parameters
    ----------
    symmetric : bool
        `MU` counts for both directions.
    keep_pace : callable
        Called before each simulation.
    """

    symmetric: bool = False
    keep_pace: Callable[[], None] = UNHURRIED.keep

    def values(self) -> dict[Parameter, float]:
        """The scenario's own values of all parameters."""
        own = self.numbers()
        mu = own[ChainNumber.MU_DYNAMIC_PULL]
        return {
            **{p: own[p.tensions.number] for p in BY_TENSIONS if p.tensions.number is not None},
            MU: mu,
            MU_RELEASE: own[ChainNumber.MU_DYNAMIC_RELEASE],
            STATIC_EXCESS: own[ChainNumber.MU_STATIC_PULL] / mu - 1 if mu > 0 else 0.0,
        }

    def numbers_of(self, values: Values) -> dict[str, float]:
        """Numbers of the tendon and the cells' readings at given values, all of them."""
        values = self.tied(values)
        direct: dict[str, float] = {p.tensions.number: values[p] for p in BY_TENSIONS if p.tensions.number is not None}
        mus = {k: by * values[p] for p in (MU, MU_RELEASE) for k, by in _direction(p, values).items()}
        return {**direct, **mus}

    def tied(self, values: Values) -> dict[Parameter, float]:
        """All values, where one coefficient counts for both directions."""
        return {**values, **({MU_RELEASE: values[MU]} if self.symmetric else {})}

    def predict(self, values: Values, drive: Drive, over: Sequence[Parameter] = ()) -> ChainResponse:
        """Simulate a drive at all values, with derivatives over some; SolveError if that fails."""
        self.keep_pace()
        values = self.tied(values)
        directions = [_direction(p, values) for p in over]
        if self.symmetric:
            both = {**_direction(MU, values), **_direction(MU_RELEASE, values)}
            directions = [both if p is MU else d for p, d in zip(over, directions, strict=True)]
        return self.respond(self.numbers_of(values), drive, directions)


def put_into(transmission: Transmission, model: ParametricChain, values: Values) -> Transmission:
    """The transmission with all values of a fitted chain: they were fitted together and belong together."""
    numbers, tables = model.numbers_of(values), dict[str, dict[str, float]]()
    for parameter in BY_TENSIONS:
        table, _, key = parameter.spec.key.partition(".")
        if key and parameter.tensions.number is not None:
            tables.setdefault(table, {})[key] = numbers[parameter.tensions.number]
    del tables["friction"]["load_exponent"]
    tables["friction"] |= {
        "mu_dynamic": numbers[ChainNumber.MU_DYNAMIC_PULL],
        "mu_static": numbers[ChainNumber.MU_STATIC_PULL],
        "mu_dynamic_release": numbers[ChainNumber.MU_DYNAMIC_RELEASE],
        "mu_static_release": numbers[ChainNumber.MU_STATIC_RELEASE],
    }
    loaded = replace(transmission, friction=model.loaded(numbers[ChainNumber.LOAD_EXPONENT]))
    changed: dict[str, Any] = {table: replace(getattr(loaded, table), **keys) for table, keys in tables.items()}
    return replace(transmission, **changed)
