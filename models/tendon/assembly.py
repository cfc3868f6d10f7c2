r"""Balances of the masses, each stated once: simulation, inverse and continuous chain put their laws together here.

::

        f_i <-----[ mass i ]-----> f_{i+1}        m dv_i/dt = f_i - f_{i+1} - f_f,i
                      |--> f_f,i                  positive is towards the actuator (pulling)

Equation numbers are those of Palli, Borghesan, Melchiorri (ICRA 2010).
"""

from dataclasses import dataclass
from typing import ClassVar

import casadi as ca

from tendonff.models.tendon.bounds import at_least

NORMAL_FORCE_FLOOR_N = 1e-9
"""Least normal force in a friction law [N]: the bristle's rate has no limit as a tendon goes slack."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Piece:
    """A mass on the path, apart from its friction; numbers or CasADi scalars.

    Attributes
    ----------
    mass_kg : ca.SX
        M/N [kg].
    adhesion_N : ca.SX
        Load-independent tension p [N].
    """

    mass_kg: ca.SX
    adhesion_N: ca.SX


@dataclass(frozen=True, slots=True, kw_only=True)
class End:
    """End of the chain: a mass with a damper, its drive and its support.

    Attributes
    ----------
    mass_kg : float
        Moving mass [kg], > 0.
    damping_N_s_per_m : float
        Viscous damping [N s/m].
    stiffness_N_per_m : float
        k_c [N/m]; 0 for an actuator.
    """

    states: ClassVar[tuple[str, ...]] = ()

    mass_kg: float
    damping_N_s_per_m: float
    stiffness_N_per_m: float

    def rate(self, v: ca.SX, states: tuple[ca.SX, ...], tension: ca.SX) -> tuple[ca.SX, ...]:  # noqa: ARG002
        """Time derivatives of its own states, under the tension of its link; none here."""
        return ()

    def implicit(
        self,
        v: ca.SX,  # noqa: ARG002
        base: tuple[ca.SX, ...],  # noqa: ARG002
        step_s: ca.SX,  # noqa: ARG002
        tension: ca.SX,  # noqa: ARG002
    ) -> tuple[ca.SX, ...]:
        """Its own states at the end of a step of weight H; none here."""
        return ()


def tension_sum(f_near: ca.SX, f_far: ca.SX, adhesion_N: ca.SX) -> ca.SX:
    """Normal force of an element on its path, f_i + f_{i+1} + 2 p [N], with load-independent friction p.

    In the inverse the tension that its bristle will add is not known yet, and left out.
    """
    return f_near + f_far + 2 * adhesion_N


def normal_force(f_near: ca.SX, f_far: ca.SX, adhesion_N: ca.SX) -> ca.SX:
    """Normal force f_n of an element, the `tension_sum` of its two sides; at least the floor [N]."""
    return at_least(tension_sum(f_near, f_far, adhesion_N), NORMAL_FORCE_FLOOR_N)


def path_force(f_near: ca.SX, f_far: ca.SX, f_f: ca.SX) -> ca.SX:
    """Sum of the forces on a mass on the path, f_i - f_{i+1} - f_f [N]."""
    return f_near - f_far - f_f


def near_tension(f_far: ca.SX, f_f: ca.SX, inertia: ca.SX) -> ca.SX:
    """The same balance solved for the tension on the actuator's side, f_i = f_{i+1} + f_f + m dv/dt [N]."""
    return f_far + f_f + inertia


def end_force(
    v: ca.SX, q: ca.SX, tension: ca.SX, pull: ca.SX, f_c: ca.SX, x_c: ca.SX, end: End, own: tuple[ca.SX, ...] = ()
) -> ca.SX:
    """Sum of the forces on an end mass, positive towards the actuator [N].

    The tension of the adjacent link pulls the mass in the direction `pull`: -1 at the near end, +1 at the far end. The
    motor force f_c acts away from the tendon, x_c is the rest position of the end's spring. The end's `own` states are
    forces that oppose its motion [N].
    """
    without = pull * (tension - f_c) - end.damping_N_s_per_m * v - end.stiffness_N_per_m * (q - x_c)
    return without - sum(own) if own else without


def rest_damper_force(x_c_rate: ca.SX, pull: ca.SX, end: End) -> ca.SX:
    """Motor force f_c that a damper between an end mass and its moving rest position amounts to [N].

    The damper acts on v - dx_c/dt, `end_force` has it against the frame: -b (v - dx_c/dt) = -b v - pull f_c.
    """
    return -pull * end.damping_N_s_per_m * x_c_rate
