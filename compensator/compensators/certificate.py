"""Certificate of the integral action around the self-tuning inverse, by the circle criterion.

In logarithms the static transmission is a play: its output follows its input with a slope that is 0 or 1 at every
instant, whatever the history. The integral action u' = k (ln r - ln T_out) then closes a loop around a gain in the
sector [0, 1] that varies in time. With the delay and the compliance of the loop, L(z) = k h z^-(d+1)/(1 - z^-1) G(z),
it is stable for every such gain where Re L > -1 at all frequencies. G is what the exact inverse leaves of the linear
dynamics of actuator, tendon and load where their stiffness differs from the design.
"""

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tendonff.models.parameters import Transmission

ComplexArray = NDArray[np.complexfloating]

STIFFNESS_SPREAD = 0.2
RECOMMENDED_SHARE = 0.5
DEFAULT_SHARE = 0.375
"""Of the bound, where something is unexplained: takes out what tuning cannot. A third of it where nothing is."""

_FREQUENCIES = 4000


@dataclass(frozen=True, slots=True, kw_only=True)
class FeedbackCertificate:
    """Largest gain for which no limit cycle exists.

    Attributes
    ----------
    gain_per_s : float
        Integral gain k of the scenario [1/s]; 0 for none.
    largest_gain_per_s : float
        Bound of the circle criterion [1/s].
    worst_frequency_Hz : float
        Frequency at which Re L is least [Hz].
    delay_samples : int
        Age d of a measurement when it arrives.
    """

    gain_per_s: float
    largest_gain_per_s: float
    worst_frequency_Hz: float
    delay_samples: int

    @property
    def recommended_gain_per_s(self) -> float:
        """Half the bound."""
        return RECOMMENDED_SHARE * self.largest_gain_per_s

    @property
    def default_gain_per_s(self) -> float:
        """Gain where the scenario states none."""
        return DEFAULT_SHARE * self.largest_gain_per_s

    @property
    def holds(self) -> bool:
        """The scenario's gain is below the bound."""
        return self.gain_per_s < self.largest_gain_per_s

    def sentence(self) -> str:
        """For the user."""
        bound = (
            f"circle criterion, sector [0, 1], stiffness within {100 * STIFFNESS_SPREAD:.0f} %: stable for "
            f"integral_gain_per_s < {self.largest_gain_per_s:.3g} (worst at {self.worst_frequency_Hz:.3g} Hz)"
        )
        if self.gain_per_s == 0:
            return f"{bound}; {self.recommended_gain_per_s:.3g} is a good choice, 0 switches it off"
        if self.holds:
            return f"{bound}; {self.gain_per_s:g} is certified"
        return f"{bound}; {self.gain_per_s:g} is not certified, use {self.recommended_gain_per_s:.3g}"


def transmission_dynamics(
    transmission: Transmission, s: ComplexArray, tendon: float = 1.0, load: float = 1.0
) -> ComplexArray:
    """Output tension over actuator force without friction: two masses joined by the tendon, stiffness times factors.

    At Laplace variables of any shape [1/s].
    """
    t, a, far = transmission.tendon, transmission.actuator, transmission.load
    viscous = transmission.friction.viscous_N_s_per_m / 2
    link = tendon * t.quick_stiffness_N_per_m + t.damping_N_s_per_m * s
    near = a.mass_kg * s**2 + (a.damping_N_s_per_m + viscous) * s
    end = far.mass_kg * s**2 + (far.damping_N_s_per_m + viscous) * s + load * far.stiffness_N_per_m
    return link * end / (near * end + link * (near + end))


def feedback_certificate(
    transmission: Transmission, step_s: float, delay_samples: int, gain_per_s: float
) -> FeedbackCertificate:
    """Bound the gain of the integral action; `gain_per_s` is the one that is wanted."""
    omega = np.geomspace(1e-3, 1, _FREQUENCIES) * np.pi / step_s
    z = np.exp(1j * omega * step_s)
    integrator = step_s * z ** -(delay_samples + 1.0) / (1 - 1 / z)
    design = transmission_dynamics(transmission, 1j * omega)
    factors = (1 - STIFFNESS_SPREAD, 1.0, 1 + STIFFNESS_SPREAD)
    least, where = 0.0, float(omega[-1])
    for tendon, load in itertools.product(factors, factors):
        actual = transmission_dynamics(transmission, 1j * omega, tendon, load)
        real = np.real(integrator * actual / design)
        if real.min() < least:
            least, where = float(real.min()), float(omega[np.argmin(real)])
    return FeedbackCertificate(
        gain_per_s=gain_per_s,
        largest_gain_per_s=-1 / least,
        worst_frequency_Hz=where / (2 * np.pi),
        delay_samples=delay_samples,
    )
