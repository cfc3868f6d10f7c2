"""Ratcheting: whether a profile pumps the bristles.

A force that shakes can make the output of soft bristles creep beyond what static friction admits: on the model it
pays, on no rig was it measured, so it counts as an artefact. A profile that does it gives itself away: with stiff
bristles, and by the static law (a play operator), much less arrives than on the model, and the models differ by far
more than they do under the clipped inverse.
"""

from dataclasses import dataclass, replace

import numpy as np

from tendonff.models.chain import Chain
from tendonff.models.friction import LuGreBristle
from tendonff.ocp.simulate import simulate
from tendonff.ocp.step.protocol import Array
from tendonff.ocp.tracking.diagnosis import law_of

_STIFFER = 30.0  # bristles about as stiff as those of the other levels
_MORE = 2.0  # times what the models differ under the clipped inverse
_LEAST = 0.03  # of the reference's range: differences below this are not looked into


def stiffened(chain: Chain) -> Chain:
    """The chain with bristles so stiff that they cannot be pumped."""
    bristle = chain.friction
    if not isinstance(bristle, LuGreBristle):
        return chain
    stiff = replace(bristle, bristle_stiffness_N_per_m=_STIFFER * bristle.bristle_stiffness_N_per_m)
    return replace(chain, elements=replace(chain.elements, friction=stiff))


@dataclass(frozen=True, slots=True, kw_only=True)
class Disagreement:
    """How far other models' outputs are from a chain's under one force, root mean square [N].

    Parameters
    ----------
    stiff_N : float
        With stiff bristles.
    play_N : float
        By the static law.
    """

    stiff_N: float
    play_N: float

    def exceeds(self, usual: "Disagreement", range_N: float) -> bool:
        """Whether both differ by far more than usual.

        Parameters
        ----------
        usual : Disagreement
            Under a force that is above suspicion.
        range_N : float
            Of the reference [N].
        """
        return self.stiff_N > max(_MORE * usual.stiff_N, _LEAST * range_N) and self.play_N > max(
            _MORE * usual.play_N, _LEAST * range_N
        )


def disagreement(chain: Chain, force_N: Array, step_s: float, initial_tension_N: float) -> Disagreement:
    """Compare a chain with one of stiff bristles and with the static law.

    Parameters
    ----------
    chain : Chain
    force_N : ndarray, shape (n,)
    step_s : float
    initial_tension_N : float
        T0 [N].
    """
    own = simulate(chain, force_N, step_s, initial_tension_N=initial_tension_N).output_tension_N
    stiff = simulate(stiffened(chain), force_N, step_s, initial_tension_N=initial_tension_N).output_tension_N
    play = law_of(chain).output_history_N(np.maximum(force_N, 0.0), initial_tension_N)
    return Disagreement(stiff_N=_rms(stiff - own), play_N=_rms(play - own))


def _rms(error: Array) -> float:
    """Infinite where a simulation failed."""
    return float(np.sqrt(np.mean(np.nan_to_num(error, nan=np.inf) ** 2)))
