"""What the points of a centreline say about the path."""

from dataclasses import dataclass

from tendonff.compensator.files.reading import FloatArray

_LONGEST_M = 50.0
_UNSURE = 0.1  # of the angle: an uncertainty above that is worth a word


@dataclass(frozen=True, slots=True, kw_only=True)
class Stretch:
    """A section of the path."""

    name: str
    start_m: float
    length_m: float
    angle_rad: float  # wrap angle; 0 for a straight
    uncertainty_rad: float  # half the width of the angle's 95 % interval


@dataclass(frozen=True, slots=True, kw_only=True)
class CentrelineData:
    """A measured centreline."""

    file: str
    points_m: FloatArray  # shape (n, 3)
    curve_m: FloatArray  # shape (places, 3); the smooth curve
    # length_m, turned_rad, spread_rad: shape (places,); along the curve: length, angle turned, and half the width of
    # its 95 % interval
    length_m: FloatArray
    turned_rad: FloatArray
    spread_rad: FloatArray
    noise_m: float  # standard deviation of the points across the curve
    inflation_rad: float  # by how much noise had inflated the whole angle; taken off
    stretches: tuple[Stretch, ...]

    @property
    def angle_rad(self) -> float:
        """Wrap angle of the whole."""
        return float(self.turned_rad[-1])

    @property
    def uncertainty_rad(self) -> float:
        """Half the width of its 95 % interval."""
        return float(self.spread_rad[-1])

    @property
    def warnings(self) -> tuple[str, ...]:
        """What to look at before the sections are used."""
        notes = []
        if self.length_m[-1] > _LONGEST_M:
            notes.append(f"the path is {self.length_m[-1]:.4g} m long; are the coordinates in millimetres? Give metres")
        if self.uncertainty_rad > max(_UNSURE * self.angle_rad, _UNSURE):
            notes.append(
                f"the wrap angle is known to within {self.uncertainty_rad:.2g} rad of {self.angle_rad:.3g} only: "
                "measure more points, or more exact ones"
            )
        return tuple(notes)
