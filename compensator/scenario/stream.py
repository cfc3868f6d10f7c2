"""Table [stream]: how a reference arrives that is not known in advance."""

from dataclasses import dataclass

from tendonff.models.errors import require


@dataclass(frozen=True, slots=True, kw_only=True)
class Stream:
    """A reference that arrives sample by sample.

    Parameters
    ----------
    lag_max_s : float
        Largest lag of the output tension behind the reference that the filter may cause [s], >= 0.
    preview_s : float
        Time by which the caller knows the reference ahead [s], >= 0; 0: not at all. With preview there is no lag.
    resolution_N : float
        Step of the converter that measures the reference [N], >= 0; changes up to this size are ignored.
    """

    lag_max_s: float = 0.015
    preview_s: float = 0.0
    resolution_N: float = 0.0

    def __post_init__(self) -> None:
        require("lag_max_s", self.lag_max_s, least=0, hint="0.015 is a good start; 0 for no filter")
        require("preview_s", self.preview_s, least=0, hint="0 where nothing is known ahead")
        require("resolution_N", self.resolution_N, least=0, hint="0 where the reference is exact")
