"""The palette of every picture and page: Okabe and Ito's, which stays apart for colour-blind readers."""

from dataclasses import dataclass

INK = "#000000"
ORANGE = "#E69F00"
SKY = "#56B4E9"
GREEN = "#009E73"
BLUE = "#0072B2"
VERMILION = "#D55E00"
PURPLE = "#CC79A7"
GREY = "#7F7F7F"


@dataclass(frozen=True, slots=True, kw_only=True)
class Style:
    """Drawing style of a compensator.

    Attributes
    ----------
    color : str
        Colour as Matplotlib names it.
    linestyle : str
        "-", "--", "-." or ":".
    """

    color: str
    linestyle: str
