"""Options of the co-simulation units; light, because the command line imports them."""

from tendonff.models.choice import Choice


class Kind(Choice):
    """Kind of computation of the unit."""

    INVERSE = "inverse"  # reference tension in, force out, within the actuator's limits
    PLANT = "plant"  # force in, output tension and end positions out
    CAPSTAN = "capstan"  # as INVERSE, by the capstan law
    TABLE = "table"  # as INVERSE, from the compensation table
    OBSERVER = "observer"  # input tension and position of the near end in, output tension with bounds out
    ADAPTIVE = "adaptive"  # reference tension and measurement in, force and present mu out


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
