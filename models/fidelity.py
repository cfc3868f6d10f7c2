"""The paper's three models as data: which link, and which bristle."""

from tendonff.models.choice import Choice


class Level(Choice):
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
    def link_relaxes(self) -> bool:
        """The link has the relaxing branch k2, tau of eq. (7)."""
        return self is not Level.ELASTIC

    @property
    def soft_bristle(self) -> bool:
        """The bristle has the soft stiffness instead of the stiff one."""
        return self is Level.PRESLIDING
