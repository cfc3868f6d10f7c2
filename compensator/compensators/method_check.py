"""Response to one command by two methods: the equations alone, without the step of this package, beside it."""

from dataclasses import dataclass

import numpy as np

from tendonff.compensator.compensators.score import scale_of
from tendonff.compensator.files.reading import FloatArray
from tendonff.ocp.integrate.method import Method


@dataclass(frozen=True, slots=True, kw_only=True)
class MethodCheck:
    """Response to one profile by two methods.

    Attributes
    ----------
    method : Method
        That checks the fixed step.
    compensator : str
        Label of the profile.
    unit : str
        Of both differences.
    rms, peak : float
        Difference of the responses, root mean square and largest.
    rms_percent_of_range, error_percent_of_range : float
        The first over the range of the reference, and the error of the profile by the method that checks [%].
    """

    method: Method
    compensator: str
    unit: str
    rms: float
    peak: float
    rms_percent_of_range: float
    error_percent_of_range: float

    @classmethod
    def of(
        cls,
        method: Method,
        compensator: str,
        unit: str,
        reference: FloatArray,
        responses: tuple[FloatArray, FloatArray],
    ) -> "MethodCheck":
        """Compare the response by the fixed step with that by the method, shape (rows,) each."""
        by_step, by_method = responses
        apart, scale = by_method - by_step, scale_of(reference)
        rms, error = (float(np.sqrt(np.mean(each**2))) for each in (apart, by_method - reference))
        return cls(
            method=method,
            compensator=compensator,
            unit=unit,
            rms=rms,
            peak=float(np.abs(apart).max()),
            rms_percent_of_range=100 * rms / scale,
            error_percent_of_range=100 * error / scale,
        )

    @property
    def sentence(self) -> str:
        """The finding in words."""
        return (
            f"check by {self.method}: {self.compensator}, RMS error {self.error_percent_of_range:.3g} % of range; it "
            f"differs from the fixed step by {self.rms:.2g} {self.unit} RMS ({self.rms_percent_of_range:.2g} % of "
            f"range), {self.peak:.2g} {self.unit} at most"
        )
