"""Table [run]: the time step and the level of the design."""

from dataclasses import dataclass

from tendonff.models.errors import require
from tendonff.models.fidelity import Level


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """How the scenario is computed.

    Parameters
    ----------
    step_s : float
        Time step of reference, force profile and simulation [s], > 0.
    level : Level
        Fidelity level for the design: elastic, viscoelastic or presliding.
    """

    step_s: float
    level: Level

    def __post_init__(self) -> None:
        require("step_s", self.step_s, above=0, hint="0.001 is a good start")
