"""Certified interval of the output tension: two plays a step, no model of elasticity, no drift.

The play w <- min(max(w, u - r_pull), u + r_release) of u = ln(T_in + p) rises with w, with u, with r_release, and falls
with r_pull. So for any r within a band and any error of the input within another the output stays, for all time,
between the play with the largest pull and the smallest release exponent on the smallest input and the opposite
play. Effects outside the quasi-static law (stretch, presliding, inertia, viscous friction) are a margin in ln(T + p),
measured on the chain along the reference.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from tendonff.models.capstan import CapstanLaw
from tendonff.models.capstan.spread_bounds import play_exponents
from tendonff.models.errors import ParameterError, require
from tendonff.ocp.step.protocol import Array


@dataclass(frozen=True, slots=True, kw_only=True)
class CertifiedInterval:
    """Two plays that enclose the output tension.

    Attributes
    ----------
    law : CapstanLaw
        Capstan law at the values that are known best.
    spread : float
        Relative half-width d of what mu theta may be, 0 <= d < 1.
    noise_N : float
        Largest error of the actuator's force [N], >= 0.
    margin : float
        Margin m: what the capstan law leaves out, in ln(T + p), >= 0.
    """

    law: CapstanLaw
    spread: float
    noise_N: float
    margin: float = 0.0

    def __post_init__(self) -> None:
        if not 0 <= self.spread < 1:
            raise ParameterError(f"spread must be >= 0 and < 1, got {self.spread}; 0.2 means within 20 % either way")
        for name in ("noise_N", "margin"):
            require(name, getattr(self, name), least=0, hint="use 0 for none")

    def _with(self, side: int) -> CapstanLaw:
        """The law with one play; of several with spread bounds, whose mean is the output, that which bounds them."""
        law, far = self.law, side * self.spread
        pull = -play_exponents(-law.pull_exponent * (1 + far), law.pull_spread)
        release = play_exponents(law.release_exponent * (1 - far), law.release_spread)
        return CapstanLaw(
            pull_exponent=float(pull.max() if side > 0 else pull.min()),
            release_exponent=float(release.min() if side > 0 else release.max()),
            adhesion_N=law.adhesion_N,
            load_exponent=law.load_exponent,
            reference_tension_N=law.reference_tension_N,
        )

    @property
    def low_law(self) -> CapstanLaw:
        """Law whose play is never above the output: needs more force to pull, falls sooner on release."""
        return self._with(1)

    @property
    def high_law(self) -> CapstanLaw:
        """Law whose play is never below the output."""
        return self._with(-1)

    def history_N(self, force_N: Array, initial_N: float | None = None) -> tuple[Array, Array]:
        """Lower and upper bound of the output tension for a force history from t = 0, each of shape (n,) [N].

        The output tension before is that of the first force (uniform tension), unless it is given.
        """
        force = np.asarray(force_N, dtype=np.float64)
        start, p = float(force[0]) if initial_N is None else initial_N, self.law.adhesion_N
        low = self.low_law.output_history_N(np.maximum(force - self.noise_N, 0.0), start)
        high = self.high_law.output_history_N(force + self.noise_N, start)
        narrow, wide = math.exp(-self.margin), math.exp(self.margin)
        return np.maximum((low + p) * narrow - p, 0.0), (high + p) * wide - p

    def with_margin_for(self, force_N: Array, outputs_N: Array) -> "CertifiedInterval":
        """The same interval, with the least margin that holds outputs of a richer model, shape (m, n) [N].

        They are simulations with that force at values of mu theta within the spread.
        """
        p = self.law.adhesion_N
        bare = replace(self, margin=0.0)
        low, high = bare.history_N(force_N, float(outputs_N[0, 0]))
        above, below = _largest_log(outputs_N + p, high + p), _largest_log(low + p, outputs_N + p)
        return replace(self, margin=max(above, below, 0.0))


def _largest_log(more: Array, less: Array) -> float:
    """Largest of ln(more/less) where there is more, shape (m, n); infinite where there is nothing less."""
    more, less = np.broadcast_arrays(more, less)
    there = more > 0
    if np.any(less[there] <= 0):
        return math.inf
    return float(np.log(more[there] / less[there]).max(initial=-math.inf))
