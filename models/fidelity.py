"""The paper's three models as data: which link, and which bristle."""

from dataclasses import dataclass
from enum import StrEnum


class Level(StrEnum):
    """Fidelity level of the chain (Palli, Borghesan, Melchiorri, ICRA 2010, section IV).

    Attributes
    ----------
    ELASTIC
        Elastic link (6), stiff bristle.
    VISCOELASTIC
        Visco-elastic link (7), stiff bristle.
    PRESLIDING
        Visco-elastic link (7), soft bristle: displacement before gross sliding.
    """

    ELASTIC = "elastic"
    VISCOELASTIC = "viscoelastic"
    PRESLIDING = "presliding"

    @property
    def features(self) -> "LevelFeatures":
        """What this level switches on."""
        return _FEATURES[self]


@dataclass(frozen=True, slots=True, kw_only=True)
class LevelFeatures:
    """What distinguishes one level from another."""

    link_relaxes: bool  # the link has the relaxing branch k2, tau of eq. (7)
    soft_bristle: bool  # the bristle has the soft stiffness instead of the stiff one


_FEATURES = {
    Level.ELASTIC: LevelFeatures(link_relaxes=False, soft_bristle=False),
    Level.VISCOELASTIC: LevelFeatures(link_relaxes=True, soft_bristle=False),
    Level.PRESLIDING: LevelFeatures(link_relaxes=True, soft_bristle=True),
}
