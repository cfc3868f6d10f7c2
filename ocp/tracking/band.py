"""A band for the output, row by row: what lies outside costs its square."""

from dataclasses import dataclass

import numpy as np

from tendonff.ocp.step.protocol import Array


@dataclass(frozen=True, slots=True, kw_only=True)
class Band:
    """Where the output may be."""

    # low_N, high_N: shape (n,); infinite for no bound [N]
    low_N: Array
    high_N: Array
    weight: float  # of the squared distance to the band beside the squared error [-]

    def outside_N(self, output_N: Array) -> Array:
        """Distance to the band, signed, 0 inside, shape (n,) [N]."""
        distance: Array = output_N - np.clip(output_N, self.low_N, self.high_N)
        return distance

    def rows(self, taken: slice | np.typing.NDArray[np.int_]) -> "Band":
        """The same band on some rows."""
        return Band(low_N=self.low_N[taken], high_N=self.high_N[taken], weight=self.weight)
