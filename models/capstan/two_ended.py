"""The static Coulomb capstan law of a path both of whose ends act.

Each end bounds the profile of ln(T + p) by a cone that opens along the path.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from tendonff.models.capstan.law import section_exponents
from tendonff.models.errors import ParameterError
from tendonff.models.layout import Array
from tendonff.models.parameters.transmission import Transmission
from tendonff.models.path import cut_path
from tendonff.models.tendon.load_dependence import lifted_N, lowered_N

_HALVINGS = 60
_INSIDE = 1e-9  # of ln(T + p) from full slip, at which the mass that sticks most is determined


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TwoEndedLaw:
    """Static law of a path both of whose ends act, at the links of a path cut into N pieces.

    With y = ln(T + p), a_pull and a_release the exponents between the actuator and a place and A those of the whole::

        y <- clip(y, max(y_near - a_pull, y_far - (A_release - a_release)),
                     min(y_near + a_release, y_far + (A_pull - a_pull)))

    It holds at each place by itself, so it is exact at the links for every N, for steps in which neither end turns.
    With a far end that only follows it is the play law of `CapstanLaw`.

    Parameters
    ----------
    pull_exponent, release_exponent : ndarray, shape (N + 1,)
        Mu phi between the actuator and each link [-].
    length_share : ndarray, shape (N + 1,)
        Of each link [-].
    adhesion_N : float
        p [N], >= 0.
    load_exponent, reference_tension_N : float
        As in `CapstanLaw`; with them y = ln L(T + p).
    """

    pull_exponent: Array
    release_exponent: Array
    length_share: Array
    adhesion_N: float = 0.0
    load_exponent: float = 0.0
    reference_tension_N: float = 1.0

    @classmethod
    def of(cls, transmission: Transmission, segments: int | None = None) -> "TwoEndedLaw":
        """Law of a transmission with its joints at zero; N is the path's own, unless it is given."""
        path = transmission.path
        cut = cut_path(path.parts, path.segments if segments is None else segments, path.radius_m)
        pull, release = (
            np.concatenate([[0.0], np.cumsum(np.array(each)[cut.section_of] / cut.pieces)])
            for each in section_exponents(transmission)
        )
        return cls(
            pull_exponent=pull,
            release_exponent=release,
            length_share=1 / cut.at_zero.ratio[0],
            adhesion_N=transmission.friction.adhesion_N,
            load_exponent=transmission.friction.load_dependence[0],
            reference_tension_N=transmission.friction.load_dependence[1],
        )

    def profile_N(self, before_N: ArrayLike, near_N: float, far_N: float, *, excess: float = 1e-9) -> Array:
        """Tension in each link after both ends took new tensions, shape (N + 1,) [N].

        Parameters
        ----------
        before_N : array_like, shape (N + 1,)
            The profile until then.
        near_N, far_N : float
            Tensions at the actuator and at the load.
        excess : float, optional
            By how much ln of their ratio may be beyond full slip, as inertia makes it [-]; the mean of the two bounds
            is taken there.

        Raises
        ------
        ParameterError
            If friction cannot hold the two tensions against each other.
        """
        y_near, y_far = self._log(near_N), self._log(far_N)
        left_pull, left_release = (a[-1] - a for a in (self.pull_exponent, self.release_exponent))
        low = np.maximum(y_near - self.pull_exponent, y_far - left_release)
        high = np.minimum(y_near + self.release_exponent, y_far + left_pull)
        if not (low - high).max() <= excess:
            raise ParameterError(
                f"near_N = {near_N:g} and far_N = {far_N:g} cannot both act: (T_near + p)/(T_far + p) must be within "
                f"{math.exp(-left_release[0]):.4g} and {math.exp(left_pull[0]):.4g}; beyond, the tendon runs away"
            )
        middle = 0.5 * (low + high)
        y = np.clip(self._log(before_N), np.minimum(low, middle), np.maximum(high, middle))
        profile: Array = self._tension_N(y)
        return profile

    def history_N(self, near_N: ArrayLike, far_N: ArrayLike, before_N: ArrayLike, *, excess: float = 1e-9) -> Array:
        """Profiles at successive instants, shape (n, N + 1) [N].

        Parameters
        ----------
        near_N, far_N : array_like, shape (n,)
        before_N : array_like, shape (N + 1,)
        excess : float, optional
            All as in `profile_N`.
        """
        profile, rows = np.asarray(before_N, dtype=np.float64), []
        for near, far in zip(np.asarray(near_N, float), np.asarray(far_N, float), strict=True):
            profile = self.profile_N(profile, float(near), float(far), excess=excess)
            rows.append(profile)
        return np.array(rows)

    def elongation_m(self, profile_N: ArrayLike, tendon_stiffness_N_per_m: float) -> Array:
        """Elongation of the tendon, the mean tension over the length divided by k = EA/L [m]."""
        mean: Array = np.asarray(profile_N, dtype=np.float64) @ self.length_share / tendon_stiffness_N_per_m
        return mean

    def far_tension_N(
        self, before_N: ArrayLike, near_N: float, far_travel_m: float, tendon_stiffness_N_per_m: float
    ) -> float:
        """Tension at a far end that is moved while the near end takes a new tension [N].

        What the far end moves is taken up between it and the mass that sticks most; that falls as the far tension
        rises, so there is one root. Beyond full slip the tendon slides as a whole.

        Parameters
        ----------
        before_N : array_like, shape (N + 1,)
            The profile until then.
        near_N : float
        far_travel_m : float
            Positive towards the actuator.
        tendon_stiffness_N_per_m : float
            k = EA/L of the whole tendon.
        """
        before, y_near = np.asarray(before_N, dtype=np.float64), float(self._log(near_N))
        pull, release = np.diff(self.pull_exponent), np.diff(self.release_exponent)

        def left(y_far: float) -> float:
            after = self.profile_N(before, near_N, float(self._tension_N(y_far)))
            drop = -np.diff(self._log(after))
            sticks = int(np.argmax(np.minimum(pull - drop, drop + release)))
            taken = (self.length_share * (after - before))[sticks + 1 :].sum() / tendon_stiffness_N_per_m
            return float(-taken - far_travel_m)

        least, most = y_near - self.pull_exponent[-1], y_near + self.release_exponent[-1]
        if left(least + _INSIDE) <= 0:
            y = least
        elif left(most - _INSIDE) >= 0:
            y = most
        else:
            for _ in range(_HALVINGS):
                y = 0.5 * (least + most)
                least, most = (y, most) if left(y) > 0 else (least, y)
        return float(self._tension_N(y))

    def _log(self, tension_N: ArrayLike) -> Array:
        tension = np.maximum(np.asarray(tension_N, dtype=np.float64) + self.adhesion_N, 1e-12)
        y: Array = np.log(lifted_N(tension, self.load_exponent, self.reference_tension_N))
        return y

    def _tension_N(self, y: ArrayLike) -> Array:
        tension: Array = lowered_N(np.exp(y), self.load_exponent, self.reference_tension_N) - self.adhesion_N
        return tension
