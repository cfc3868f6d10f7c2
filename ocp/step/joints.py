"""Effect of joints on a chain, as numbers for a controller: wrap angles of its bends, lengths of its links.

Masses of one section are alike, and so are links of one kind: what a controller keeps is one record each, and which
mass and which link belongs to which.
"""

import math
from dataclasses import dataclass

import numpy as np

from tendonff.models.path import FURTHEST_RAD, MOST_TURNS, JointMotion, Section
from tendonff.models.tendon.chain import Chain


@dataclass(frozen=True, slots=True, kw_only=True)
class Bend:
    """A section that carries masses."""

    # angle_rad, per_rad: wrap angle of one of its pieces at joint angle zero, and its change per radian of the joint
    angle_rad: float
    per_rad: float
    joint: int  # which joint moves it; -1: none
    length_share: float  # of one of its pieces in the length of all of them
    first: int  # its first mass


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkKind:
    """Links that are alike."""

    length: float  # share of the whole tendon's length at joint angle zero [-]
    per_rad: tuple[float, ...]  # its change per radian of each joint
    gained_m: tuple[float, ...]  # what the path gains between the ends of the link per radian of each joint [m]

    @property
    def moves(self) -> bool:
        """Whether any joint changes it."""
        return any(self.per_rad) or any(self.gained_m)


@dataclass(frozen=True, slots=True, kw_only=True)
class Joints:
    """A chain's path as a controller keeps it."""

    names: tuple[str, ...]  # joints in the order of the scenario
    # start_rad, least_rad, most_rad: their angles at the start, and the range in which the path has a meaning
    start_rad: tuple[float, ...]
    least_rad: tuple[float, ...]
    most_rad: tuple[float, ...]
    bends: tuple[Bend, ...]
    bend_of: tuple[int, ...]  # bend of each mass
    links: tuple[LinkKind, ...]
    link_of: tuple[int, ...]  # kind of each link
    far_m: tuple[float, ...]  # change of the far end's position per radian of each joint [m]
    far_driven: bool  # a joint moves the far end

    @property
    def ranges(self) -> dict[str, tuple[float, float]]:
        """Angles that are accepted, low and high, by name [rad]."""
        return dict(zip(self.names, zip(self.least_rad, self.most_rad, strict=True), strict=True))

    @property
    def near_m(self) -> tuple[float, ...]:
        """Change of the near end's position per radian of each joint, links and far end being as they are [m]."""
        gained = (sum(self.links[k].gained_m[j] for k in self.link_of) for j in range(len(self.names)))
        return tuple(far - gain for far, gain in zip(self.far_m, gained, strict=True))

    @classmethod
    def of(cls, chain: Chain) -> "Joints":
        """Those of a chain."""
        path, motion = chain.elements.path, chain.motion
        names = () if motion is None else motion.names
        touching, first, bend_of = np.unique(path.section_of, return_index=True, return_inverse=True)
        bends = []
        for k, at in zip(touching, first, strict=True):
            section, pieces = path.sections[k], path.pieces[at]
            bends.append(
                Bend(
                    angle_rad=section.angle_rad / pieces,
                    per_rad=section.angle_per_rad / pieces,
                    joint=-1 if section.joint is None else names.index(section.joint),
                    length_share=float(path.length_share[at]),
                    first=int(at),
                )
            )
        moved = np.array([[s.joint == name for name in names] for s in path.sections], float)
        moved = moved.reshape(len(path.sections), len(names)) * np.array([[s.length_per_rad_m] for s in path.sections])
        kinds: dict[tuple[float, ...], int] = {}
        link_of = [kinds.setdefault(tuple(row), len(kinds)) for row in path.parts.tolist()]
        links = []
        for row in kinds:
            gained = np.array(row) @ moved
            per_rad = np.zeros(len(names)) if path.length_m is None else gained / path.length_m
            length = float(np.array(row) @ path.lengths)
            links.append(LinkKind(length=length, per_rad=tuple(per_rad.tolist()), gained_m=tuple(gained.tolist())))
        least, most = _ranges(path.sections, names, motion)
        far = [0.0] * len(names)
        if chain.far_joint is not None and chain.far_joint[0] in names:
            far[names.index(chain.far_joint[0])] = -chain.far_joint[1]
        return cls(
            names=names,
            start_rad=() if motion is None else tuple(float(q) for q in motion.at(np.zeros(1))[0]),
            least_rad=least,
            most_rad=most,
            bends=tuple(bends),
            bend_of=tuple(int(b) for b in bend_of),
            links=tuple(links),
            link_of=tuple(link_of),
            far_m=tuple(far),
            far_driven=chain.far_joint is not None,
        )


def _ranges(
    sections: tuple[Section, ...], names: tuple[str, ...], motion: JointMotion | None
) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Angles that are accepted: those of a joint's range, in which no section has a negative length."""
    least, most = [], []
    for k, name in enumerate(names):
        angle = np.zeros(1) if motion is None else motion.angle_rad[:, k]
        given = None if motion is None or not motion.range_rad else motion.range_rad[k]
        low, high = min(-FURTHEST_RAD, float(angle.min())), max(FURTHEST_RAD, float(angle.max()))
        if given is not None:
            low, high = given
        for section in sections:
            if section.joint != name:
                continue
            room = 2 * math.pi * MOST_TURNS - section.angle_rad
            bounds = [(section.angle_per_rad, room)]
            if section.length_m is not None:
                bounds.append((-section.length_per_rad_m, section.length_m))
            for slope, most_of_it in bounds:
                high = min(high, most_of_it / slope) if slope > 0 else high
                low = max(low, most_of_it / slope) if slope < 0 else low
        least.append(low)
        most.append(high)
    return tuple(least), tuple(most)
