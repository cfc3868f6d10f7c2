"""Scaling of the whole tendon's parameters to the N elements of a chain.

`Whole.divided` is the only place where they are divided, so that results do not depend on the number of elements.
"""

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any, Protocol

import casadi as ca
import numpy as np

from tendonff.models.fidelity import Level
from tendonff.models.layout import Array, fields_of
from tendonff.models.parameters import Friction, Path, Tendon
from tendonff.models.path import CutPath, JointMotion, Section, cut_path
from tendonff.models.tendon.assembly import Piece
from tendonff.models.tendon.friction import FrictionLaw, LoadedBristle, LuGreBristle
from tendonff.models.tendon.link import LinkLaw, TwoTimesLink, ZenerLink
from tendonff.models.tendon.stiffening import StiffeningLink


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Elements:
    """The transmission divided among N masses and N + 1 links; SI units.

    Attributes
    ----------
    path : CutPath
        Who gets which angle and which length.
    piece : Piece
        Mass of one mass on the path, or of each, shape (N,); and p.
    contact : FrictionLaw
        Law of the whole, or for each mass that of its section: fields are numbers, or arrays of shape (N,).
    friction : FrictionLaw
        Of one mass at joint angle zero, or of each.
    link : LinkLaw
        Of the whole; a link is `link.shortened(ratio)`.
    ratio : numpy.ndarray
        Shape (N + 1,); length of the whole over that of each link at joint angle zero [-].
    """

    path: CutPath
    piece: Piece
    contact: FrictionLaw
    friction: FrictionLaw
    link: LinkLaw
    ratio: Array

    @property
    def count(self) -> int:
        """Number N of masses on the path."""
        return self.path.count

    @property
    def uniform(self) -> bool:
        """All masses are alike."""
        return len(self.path.sections) == 1

    @property
    def load_dependence(self) -> tuple[float, float]:
        """Exponent n [-] and T_0 [N] of friction that falls with the load; of several sections, the largest n."""
        if not isinstance(self.contact, LoadedBristle):
            return 0.0, 1.0
        return float(np.max(self.contact.load_exponent)), float(np.max(self.contact.reference_tension_N))

    @property
    def laws(self) -> tuple[FrictionLaw, LinkLaw]:
        """Laws of the masses and of the links at joint angle zero."""
        return self.friction, self.link.shortened(ca.DM(self.ratio))

    def laws_at(self, angle_rad: ca.SX, ratio: ca.SX) -> tuple[FrictionLaw, LinkLaw]:
        """The same for wrap angles of the pieces, (N, 1), and lengths of the whole over those of links, (N + 1, 1)."""
        columns = {
            name: ca.DM(value) if isinstance(value, np.ndarray) else value
            for name, value in fields_of(self.contact).items()
        }
        contact: FrictionLaw = replace(self.contact, **columns)  # type: ignore[type-var]
        share = self.angle_share(angle_rad)
        return contact.on_piece(angle_rad, share, ca.DM(self.path.length_share)), self.link.shortened(ratio)

    def angle_share(self, angle_rad: Any) -> Any:
        """Share of the contact that a piece with phi_i has [-]: phi_i/theta; by length on a path straight at rest."""
        total = self.path.total_angle_rad
        return angle_rad / total if total > 0 else self.path.length_share


@dataclass(frozen=True, slots=True, kw_only=True)
class Whole:
    """The undivided tendon at one fidelity level, defaults resolved; numbers or CasADi scalars."""

    sections: tuple[Section, ...]  # the path, one section or several
    radius_m: float | None  # gives lengths to sections that have none
    piece: Piece  # m, p
    friction: FrictionLaw  # with the level's bristle
    link: LinkLaw  # with k2 = 0 where the level's link does not relax

    def value(self, name: str) -> float:
        """Number by the name of its field, from the record that has it."""
        return float(getattr(self._record(name)[1], name))

    def changed(self, values: Mapping[str, object]) -> "Whole":
        """The same tendon with other numbers or symbols, by the names of their fields, in whichever record they are."""
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

    def divided(self, n: int, motion: JointMotion | None = None) -> Elements:
        """Divide the tendon among N masses and N + 1 links: the only place that knows how.

        Masses sit in the middle of equal pieces of a section, wherever the tendon touches under the motion; links reach
        from middle to middle, half a piece at the ends. Mass and viscous friction go by length, bristles by wrap angle.
        """
        path = cut_path(self.sections, n, self.radius_m, motion)
        rows = path.at_zero
        if len(self.sections) == 1:
            phi, share, contact = self.sections[0].angle_rad / n, 1 / n, self.friction.in_section(self.sections[0])
            friction, mass = contact.on_piece(phi, share, share), self.piece.mass_kg / n
        else:
            laws = [self.friction.in_section(self.sections[k]) for k in path.section_of]
            columns = {name: _column([getattr(law, name) for law in laws]) for name in fields_of(self.friction)}
            contact = replace(self.friction, **columns)  # type: ignore[type-var]
            phi_i, total = rows.angle_rad[0], path.total_angle_rad
            angle_share = phi_i / total if total > 0 else path.length_share
            friction = contact.on_piece(phi_i, angle_share, path.length_share)
            mass = self.piece.mass_kg * path.length_share
        return Elements(
            path=path,
            piece=replace(self.piece, mass_kg=mass),
            contact=contact,
            friction=friction,
            link=self.link,
            ratio=rows.ratio[0],
        )


def _column(values: list[Any]) -> Any:
    """Numbers as an array, symbols as a column."""
    if any(isinstance(value, ca.SX) for value in values):
        return ca.vertcat(*values)
    return np.array(values)


class Sliding(Protocol):
    """Tendon on its path: of a transmission, or one of several tendons."""

    @property
    def path(self) -> Path:
        """Where it slides."""

    @property
    def tendon(self) -> Tendon:
        """Sliding part."""

    @property
    def friction(self) -> Friction:
        """Part that supports it."""


def whole_of(sliding: Sliding, level: Level) -> Whole:
    """The numbers of the undivided tendon at a level, defaults resolved."""
    tendon, friction, path = sliding.tendon, sliding.friction, sliding.path
    return Whole(
        sections=path.parts,
        radius_m=path.radius_m,
        piece=Piece(mass_kg=tendon.mass_kg, adhesion_N=friction.adhesion_N),
        friction=_friction_of(friction, level),
        link=_link_of(tendon, relaxes=level.link_relaxes),
    )


def _friction_of(friction: Friction, level: Level) -> LuGreBristle:
    """The law of the whole tendon on its path; a load exponent costs a power, and only those who state one."""
    bristle = LuGreBristle(
        bristle_stiffness_N_per_m=bristle_stiffness_N_per_m(friction, level),
        mu_dynamic_pull=friction.mu_dynamic,
        mu_static_pull=friction.mu_static,
        mu_dynamic_release=friction.release_dynamic,
        mu_static_release=friction.release_static,
        stribeck_velocity_m_per_s=friction.stribeck_velocity_m_per_s,
        viscous_N_s_per_m=friction.viscous_N_s_per_m,
    )
    exponent, reference = friction.load_dependence
    if exponent == 0:
        return bristle
    return LoadedBristle(**fields_of(bristle), load_exponent=exponent, reference_tension_N=reference)


def bristle_stiffness_N_per_m(friction: Friction, level: Level) -> float:
    """sigma0 of the whole tendon at a level [N/m]."""
    return friction.soft_bristle_stiffness_N_per_m if level.soft_bristle else friction.bristle_stiffness_N_per_m


def _link_of(tendon: Tendon, *, relaxes: bool) -> ZenerLink:
    """The law of the whole tendon as a link; a second branch costs a state, and only those who ask for it."""
    second, time = tendon.second_relaxing_stiffness_N_per_m, tendon.second_relaxation_time_s
    link = ZenerLink(
        stiffness_N_per_m=tendon.stiffness_N_per_m,
        relaxing_stiffness_N_per_m=tendon.relaxing_stiffness_N_per_m if relaxes else 0.0,
        relaxation_time_s=tendon.relaxation_time_s,
        damping_N_s_per_m=tendon.damping_N_s_per_m,
    )
    if tendon.stiffening and tendon.stiffening_tension_N:
        return StiffeningLink(
            **fields_of(link), stiffening=tendon.stiffening, stiffening_tension_N=tendon.stiffening_tension_N
        )
    if not relaxes or second is None or time is None:
        return link
    return TwoTimesLink(**fields_of(link), second_relaxing_stiffness_N_per_m=second, second_relaxation_time_s=time)
