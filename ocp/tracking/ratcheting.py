"""Ratcheting: whether a profile pumps the bristles.

A force that shakes can make the output of soft bristles creep beyond what static friction admits: on the model it
pays, on no rig was it measured, so it counts as an artefact. A profile that does it gives itself away: with stiff
bristles, and by the static law (a play operator), much less arrives than on the model, and the models differ by far
more than they do under the clipped inverse.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tendonff.models.capstan import CapstanLaw
from tendonff.models.chain import Chain
from tendonff.ocp.simulate import simulate
from tendonff.ocp.step.protocol import Array
from tendonff.ocp.tracking.diagnosis import law_of

_TINY_N = 1e-12
STIFFER = 30.0  # bristles about as stiff as those of the other levels
_MORE = 2.0  # times what the models differ under the clipped inverse
_LEAST = 0.03  # of the reference's range: differences below this are not looked into


@dataclass(frozen=True, slots=True, kw_only=True)
class StaticGoal:
    """What is asked of a tendon by the static law, which no force can pump."""

    law: CapstanLaw
    weight: float  # of its squared error beside that of the chain [-]
    start_N: float  # output before row 0 [N]
    wanted_N: Array  # shape (n,); what the exact inverse without limits gives there [N]

    @classmethod
    def of(cls, chain: Chain, inverse_N: Array, step_s: float, tension_N: float, weight: float) -> "StaticGoal":
        """Of a chain that starts under uniform tension.

        The weight is taken times the share that stiff bristles have in what the law leaves out: where that is inertia,
        damping or relaxation, the law is no judge.
        """
        law, force = law_of(chain), np.maximum(inverse_N, 0.0)
        wanted = law.output_history_N(force, tension_N)
        if weight > 0:
            own, stiff = (
                simulate(each, force, step_s, initial_tension_N=tension_N).output_tension_N
                for each in (chain, chain.stiffened(STIFFER))
            )
            usable = len(own) == len(stiff) == len(wanted)
            missed = _rms(stiff - wanted) / max(_rms(stiff - own), _TINY_N) if usable else np.inf
            weight *= max(1 - missed**2, 0.0)
        return cls(law=law, weight=weight, start_N=tension_N, wanted_N=wanted)

    def output_N(self, force_N: Array) -> Array:
        """Output under a force, shape (n,)."""
        return self.law.output_history_N(force_N, self.start_N)

    def slopes(self, force_N: Array, output_N: Array) -> tuple[NDArray[np.int_], Array]:
        """Of each row: the row whose force set its output, and the slope over that force, 0 where it is the start's."""
        low, high = self.law.output_bounds_N(force_N)
        pulled, released = output_N <= low, output_N >= high
        at = np.maximum.accumulate(np.where(pulled | released, np.arange(len(force_N)), -1))
        rise = np.where(pulled, np.exp(-self.law.pull_exponent), np.exp(self.law.release_exponent))
        return np.maximum(at, 0), np.where((at >= 0) & (output_N > 0), rise[at], 0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Disagreement:
    """How far other models' outputs are from a chain's under one force, root mean square [N]."""

    stiff_N: float  # with stiff bristles
    play_N: float  # by the static law

    def exceeds(self, usual: "Disagreement", range_N: float) -> bool:
        """Whether both differ by far more than usual, that is under a force that is above suspicion."""
        return self.stiff_N > max(_MORE * usual.stiff_N, _LEAST * range_N) and self.play_N > max(
            _MORE * usual.play_N, _LEAST * range_N
        )


def disagreement(chain: Chain, force_N: Array, step_s: float, initial_tension_N: float) -> Disagreement:
    """Compare a chain with one of stiff bristles and with the static law, under a force from rest at T0 [N]."""
    own = simulate(chain, force_N, step_s, initial_tension_N=initial_tension_N).output_tension_N
    stiff = simulate(chain.stiffened(STIFFER), force_N, step_s, initial_tension_N=initial_tension_N).output_tension_N
    play = law_of(chain).output_history_N(np.maximum(force_N, 0.0), initial_tension_N)
    return Disagreement(stiff_N=_rms(stiff - own), play_N=_rms(play - own))


def _rms(error: Array) -> float:
    """Infinite where a simulation failed."""
    return float(np.sqrt(np.mean(np.nan_to_num(error, nan=np.inf) ** 2)))
