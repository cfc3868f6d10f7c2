"""Scaling of the whole tendon's parameters to the N elements of a chain.

`Whole.divided` is the only place where they are divided, so that results do not depend on the number of elements.
"""

from dataclasses import dataclass

import casadi as ca

from tendonff.models.errors import ParameterError
from tendonff.models.fidelity import Level
from tendonff.models.parameters import Transmission


@dataclass(frozen=True, slots=True, kw_only=True)
class Elements:
    """The transmission divided among N masses and N + 1 links; all per element, SI units.

    The coefficients are the equivalent ones of eqs. (8), (9): tanh(mu phi/2) with phi = theta/N.

    Parameters
    ----------
    count : int
        Number N of masses on the path.
    mass_kg, viscous_N_s_per_m, bristle_stiffness_N_per_m, element_angle_rad : float
        m/N, b/N, sigma0/N (of the level's bristle), phi = theta/N.
    stiffness_N_per_m, relaxing_stiffness_N_per_m, damping_N_s_per_m : float
        k1 (N + 1), k2 (N + 1) (0 for a link that does not relax), c (N + 1).
    relaxation_time_s, stribeck_velocity_m_per_s, adhesion_N : float
        tau, omega, p: the same for every element.
    mu_dynamic_pull, mu_static_pull, mu_dynamic_release, mu_static_release : float
        Equivalent coefficients [-].
    """

    count: int
    mass_kg: float
    viscous_N_s_per_m: float
    bristle_stiffness_N_per_m: float
    element_angle_rad: float
    stiffness_N_per_m: float
    relaxing_stiffness_N_per_m: float
    damping_N_s_per_m: float
    relaxation_time_s: float
    stribeck_velocity_m_per_s: float
    adhesion_N: float
    mu_dynamic_pull: float
    mu_static_pull: float
    mu_dynamic_release: float
    mu_static_release: float

    @property
    def weakens_with_speed(self) -> bool:
        """Static and dynamic coefficients differ in some direction (Stribeck effect)."""
        return self.mu_static_pull != self.mu_dynamic_pull or self.mu_static_release != self.mu_dynamic_release


def equivalent_coefficient(mu: float, element_angle_rad: float) -> float:
    """Coefficient of one lumped element, (1 - e^{-mu phi})/(1 + e^{-mu phi}) = tanh(mu phi/2) [-].

    Eqs. (8), (9): with it N elements in one-way slip give e^{mu theta} exactly.

    Parameters
    ----------
    mu : float or ca.SX
        Coefficient of tendon on path [-].
    element_angle_rad : float or ca.SX
        phi = theta/N [rad].
    """
    return ca.tanh(mu * element_angle_rad / 2)  # type: ignore[no-any-return]


@dataclass(frozen=True, slots=True, kw_only=True)
class Whole:
    """The undivided tendon at one fidelity level, defaults resolved; numbers or CasADi scalars.

    Parameters
    ----------
    total_angle_rad : float
        theta [rad].
    mass_kg, viscous_N_s_per_m, bristle_stiffness_N_per_m : float
        m, b, sigma0 (of the level's bristle).
    stiffness_N_per_m, relaxing_stiffness_N_per_m, damping_N_s_per_m, relaxation_time_s : float
        k1, k2 (0 for a link that does not relax), c, tau.
    stribeck_velocity_m_per_s, adhesion_N : float
        omega, p.
    mu_dynamic_pull, mu_static_pull, mu_dynamic_release, mu_static_release : float
        Coefficients of tendon on path [-].
    """

    total_angle_rad: float
    mass_kg: float
    viscous_N_s_per_m: float
    bristle_stiffness_N_per_m: float
    stiffness_N_per_m: float
    relaxing_stiffness_N_per_m: float
    damping_N_s_per_m: float
    relaxation_time_s: float
    stribeck_velocity_m_per_s: float
    adhesion_N: float
    mu_dynamic_pull: float
    mu_static_pull: float
    mu_dynamic_release: float
    mu_static_release: float

    def divided(self, n: int) -> Elements:
        """Divide the tendon among N masses and N + 1 links: the only place that knows how.

        Parameters
        ----------
        n : int
            N.
        """
        phi = self.total_angle_rad / n
        return Elements(
            count=n,
            mass_kg=self.mass_kg / n,
            viscous_N_s_per_m=self.viscous_N_s_per_m / n,
            bristle_stiffness_N_per_m=self.bristle_stiffness_N_per_m / n,
            element_angle_rad=phi,
            stiffness_N_per_m=self.stiffness_N_per_m * (n + 1),
            relaxing_stiffness_N_per_m=self.relaxing_stiffness_N_per_m * (n + 1),
            damping_N_s_per_m=self.damping_N_s_per_m * (n + 1),
            relaxation_time_s=self.relaxation_time_s,
            stribeck_velocity_m_per_s=self.stribeck_velocity_m_per_s,
            adhesion_N=self.adhesion_N,
            mu_dynamic_pull=equivalent_coefficient(self.mu_dynamic_pull, phi),
            mu_static_pull=equivalent_coefficient(self.mu_static_pull, phi),
            mu_dynamic_release=equivalent_coefficient(self.mu_dynamic_release, phi),
            mu_static_release=equivalent_coefficient(self.mu_static_release, phi),
        )


def whole_of(transmission: Transmission, level: Level) -> Whole:
    """The numbers of the undivided tendon at a level, defaults resolved.

    Parameters
    ----------
    transmission : Transmission
    level : Level
    """
    tendon, friction, features = transmission.tendon, transmission.friction, level.features
    return Whole(
        total_angle_rad=transmission.path.total_angle_rad,
        mass_kg=tendon.mass_kg,
        viscous_N_s_per_m=friction.viscous_N_s_per_m,
        bristle_stiffness_N_per_m=(
            friction.soft_bristle_stiffness_N_per_m if features.soft_bristle else friction.bristle_stiffness_N_per_m
        ),
        stiffness_N_per_m=tendon.stiffness_N_per_m,
        relaxing_stiffness_N_per_m=tendon.relaxing_stiffness_N_per_m if features.link_relaxes else 0.0,
        damping_N_s_per_m=tendon.damping_N_s_per_m,
        relaxation_time_s=tendon.relaxation_time_s,
        stribeck_velocity_m_per_s=friction.stribeck_velocity_m_per_s,
        adhesion_N=friction.adhesion_N,
        mu_dynamic_pull=friction.mu_dynamic,
        mu_static_pull=friction.mu_static,
        mu_dynamic_release=friction.release_dynamic,
        mu_static_release=friction.release_static,
    )


def elements_of(transmission: Transmission, level: Level, segments: int | None = None) -> Elements:
    """Divide a transmission's tendon among its elements.

    Parameters
    ----------
    transmission : Transmission
    level : Level
        Fidelity level.
    segments : int, optional
        Number N of masses; default: the path's own.

    Raises
    ------
    ParameterError
        If there is no mass.
    """
    n = transmission.path.segments if segments is None else segments
    if not n >= 1:
        raise ParameterError(f"segments must be >= 1, got {n}; 6 is a good start")
    return whole_of(transmission, level).divided(n)
