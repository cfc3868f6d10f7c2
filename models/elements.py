"""Scaling of the whole tendon's parameters to the N elements of a chain.

`Whole.divided` is the only place where they are divided, so that results do not depend on the number of elements.
"""

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any

from tendonff.models.assembly import Piece
from tendonff.models.errors import ParameterError
from tendonff.models.fidelity import Level
from tendonff.models.friction import FrictionLaw, LuGreBristle
from tendonff.models.link import LinkLaw, ZenerLink
from tendonff.models.parameters import Transmission


@dataclass(frozen=True, slots=True, kw_only=True)
class Elements:
    """The transmission divided among N masses and N + 1 links; all per element, SI units.

    Parameters
    ----------
    count : int
        Number N of masses on the path.
    piece : Piece
        m/N, and p.
    friction : FrictionLaw
        Of one mass.
    link : LinkLaw
        Of one link.
    """

    count: int
    piece: Piece
    friction: FrictionLaw
    link: LinkLaw


@dataclass(frozen=True, slots=True, kw_only=True)
class Whole:
    """The undivided tendon at one fidelity level, defaults resolved; numbers or CasADi scalars.

    Parameters
    ----------
    total_angle_rad : float
        theta [rad].
    piece : Piece
        m, p.
    friction : FrictionLaw
        With the level's bristle.
    link : LinkLaw
        With k2 = 0 where the level's link does not relax.
    """

    total_angle_rad: float
    piece: Piece
    friction: FrictionLaw
    link: LinkLaw

    def value(self, name: str) -> float:
        """One of the numbers, by the name of its field, in whichever record it stands.

        Parameters
        ----------
        name : str
        """
        return float(getattr(self._record(name)[1], name))

    def changed(self, values: Mapping[str, object]) -> "Whole":
        """The same tendon with other numbers.

        Parameters
        ----------
        values : mapping of str to float or ca.SX
            By the names of their fields, in whichever record they stand.
        """
        whole = self
        for name, value in values.items():
            where, record = whole._record(name)
            whole = replace(whole, **{where: replace(record, **{name: value})})
        return whole

    def _record(self, name: str) -> tuple[str, Any]:
        for where in ("piece", "friction", "link"):
            record = getattr(self, where)
            if any(f.name == name for f in fields(record)):
                return where, record
        raise KeyError(name)

    def divided(self, n: int) -> Elements:
        """Divide the tendon among N masses and N + 1 links: the only place that knows how.

        Parameters
        ----------
        n : int
            N.
        """
        return Elements(
            count=n,
            piece=replace(self.piece, mass_kg=self.piece.mass_kg / n),
            friction=self.friction.on_piece(self.total_angle_rad / n, n),
            link=self.link.shortened(n + 1),
        )


def whole_of(transmission: Transmission, level: Level) -> Whole:
    """The numbers of the undivided tendon at a level, defaults resolved.

    Parameters
    ----------
    transmission : Transmission
    level : Level
    """
    tendon, friction, features = transmission.tendon, transmission.friction, level.features
    soft, stiff = friction.soft_bristle_stiffness_N_per_m, friction.bristle_stiffness_N_per_m
    return Whole(
        total_angle_rad=transmission.path.total_angle_rad,
        piece=Piece(mass_kg=tendon.mass_kg, adhesion_N=friction.adhesion_N),
        friction=LuGreBristle(
            bristle_stiffness_N_per_m=soft if features.soft_bristle else stiff,
            mu_dynamic_pull=friction.mu_dynamic,
            mu_static_pull=friction.mu_static,
            mu_dynamic_release=friction.release_dynamic,
            mu_static_release=friction.release_static,
            stribeck_velocity_m_per_s=friction.stribeck_velocity_m_per_s,
            viscous_N_s_per_m=friction.viscous_N_s_per_m,
        ),
        link=ZenerLink(
            stiffness_N_per_m=tendon.stiffness_N_per_m,
            relaxing_stiffness_N_per_m=tendon.relaxing_stiffness_N_per_m if features.link_relaxes else 0.0,
            relaxation_time_s=tendon.relaxation_time_s,
            damping_N_s_per_m=tendon.damping_N_s_per_m,
        ),
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
