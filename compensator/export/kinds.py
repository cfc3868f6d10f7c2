"""Options of the co-simulation units; light, because the command line imports them."""

from tendonff.models.choice import Choice


class Kind(Choice):
    """Kind of computation of the unit."""

    INVERSE = "inverse"  # reference in, force or motor angles out, within their limits
    PLANT = "plant"  # force in, output tension and end positions out; of a joint its motor's angle in, its own out
    CAPSTAN = "capstan"  # as INVERSE, by the capstan law
    TABLE = "table"  # as INVERSE, from the compensation table
    OBSERVER = (
        "observer"  # input tension and position of the near end in, output tension with bounds out; a joint's PLANT
    )
    ADAPTIVE = "adaptive"  # reference and measurement in, force and present mu out, or motor's angle and factor
    FEEDBACK = "feedback"  # reference and measurement in, the command of INVERSE with its feedback out


class FmiVersion(Choice):
    """Version of the interface."""

    V2 = "2.0"
    V3 = "3.0"

    @property
    def headers(self) -> tuple[str, ...]:
        """The standard's header files, under the 2-clause BSD licence that they state."""
        types = "fmi2TypesPlatform.h" if self is FmiVersion.V2 else "fmi3PlatformTypes.h"
        letter = self.value[0]
        return types, f"fmi{letter}FunctionTypes.h", f"fmi{letter}Functions.h"
