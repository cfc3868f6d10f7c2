"""Methods of simulation, and how accurate they are to be."""

from dataclasses import dataclass

from tendonff.models.choice import Choice
from tendonff.models.errors import ParameterError, require


class Method(Choice):
    """Method of advancing a simulation in time.

    Attributes
    ----------
    BDF2
        The implicit step of this package, of a fixed length; in compiled C where there is a compiler.
    CVODES, IDAS
        Variable order and step, SUNDIALS: backward differences for ordinary and for differential-algebraic equations.
    COLLOCATION
        Implicit Runge-Kutta steps of a fixed length, Radau of order 5.
    """

    BDF2 = "bdf2"
    CVODES = "cvodes"
    IDAS = "idas"
    COLLOCATION = "collocation"


@dataclass(frozen=True, slots=True, kw_only=True)
class Accuracy:
    """Tolerances of an integrator, by SciPy's names, and the steps of one that has none.

    Parameters
    ----------
    rtol : float, optional
        Relative tolerance of the states [-], > 0.
    atol : float, optional
        Absolute tolerance of every state in its SI unit, > 0: of elongations [m] above all.
    elements : int, optional
        Steps of collocation in a sample, >= 1.
    """

    rtol: float = 1e-6
    atol: float = 1e-9
    elements: int = 1

    def __post_init__(self) -> None:
        require("rtol", self.rtol, above=0, hint="1e-6 is usual")
        require("atol", self.atol, above=0, hint="1e-9 is usual")
        if not self.elements >= 1:
            raise ParameterError(f"elements must be >= 1, got {self.elements}; 1 is usual")
