"""The certificate of the integral action: its closed form, and random loops inside it."""

import numpy as np
import pytest

from tendonff.compensator.compensators.certificate import feedback_certificate, transmission_dynamics


@pytest.mark.parametrize("delay", [0, 2, 7])
def test_without_dynamics_the_bound_is_that_of_an_integrator_with_a_delay(generic, delay, monkeypatch):
    """Re of h z^-(d+1)/(1 - z^-1) is -h (d + 1/2) at low frequencies, its least."""
    monkeypatch.setattr("tendonff.compensator.compensators.certificate.STIFFNESS_SPREAD", 0.0)
    found = feedback_certificate(generic, 1e-3, delay, 0.0)
    assert found.largest_gain_per_s == pytest.approx(1 / (1e-3 * (delay + 0.5)), rel=1e-3)


def test_the_output_tension_is_the_force_at_rest_and_none_of_it_beyond_the_resonance(generic):
    still, fast = np.abs(transmission_dynamics(generic, np.array([1e-6j, 1e5j])))
    assert still == pytest.approx(1.0, abs=1e-6)
    assert fast < 1e-3


def test_a_gain_is_judged_and_a_way_out_is_given(generic):
    found = feedback_certificate(generic, 1e-3, 2, 1e4)
    assert not found.holds
    assert "is not certified" in found.sentence()
    assert feedback_certificate(generic, 1e-3, 2, found.recommended_gain_per_s).holds


H, LOOPS = 1e-3, 10_000


def random_loops(share: float) -> tuple[np.ndarray, np.ndarray]:
    """Largest errors after 1.5 s and after 4.5 s of loops whose gain is up to `share` of their own bound.

    Plays of random width, delays up to 7 steps, second-order lags; the bound is that of the circle criterion for the
    same recursion that is simulated.
    """
    rng = np.random.default_rng(0)
    delay, width = rng.integers(0, 8, LOOPS), rng.uniform(0.05, 1.0, (2, LOOPS))
    omega, damping = rng.uniform(60, 600, LOOPS), rng.uniform(0.3, 1.0, LOOPS)
    a1, a0 = 2 * damping * omega * H, (omega * H) ** 2
    z, least = np.exp(1j * H * np.geomspace(1, np.pi / H, 1500)), np.zeros(LOOPS)
    for k in range(0, LOOPS, 500):
        part = slice(k, k + 500)
        lag = a0[part, None] / ((1 - 1 / z) ** 2 + a1[part, None] * (1 - 1 / z) + a0[part, None])
        loop = H * z ** -(delay[part, None] + 1.0) / (1 - 1 / z) * lag
        least[part] = loop.real.min(axis=1)
    gain = share * rng.uniform(0.3, 1.0, LOOPS) / -least
    target = rng.uniform(0.3, 1, LOOPS) * rng.choice([-1, 1], LOOPS)
    u, memory, y, before, middle, end = (np.zeros(LOOPS) for _ in range(6))
    late, every = np.zeros((9, LOOPS)), np.arange(LOOPS)
    for row in range(9000):
        u = u + gain * H * (target - late[(row - 1 - delay) % 9, every])
        memory = np.minimum(np.maximum(memory, u - width[0]), u + width[1])
        y, before = (a0 * memory + (2 + a1) * y - before) / (1 + a1 + a0), y
        late[row % 9] = y
        if row >= 1500:
            peak = middle if row < 4500 else end
            np.fmax(peak, np.abs(target - y), out=peak)
    return middle, end


def test_no_limit_cycle_in_ten_thousand_random_loops_inside_the_certificate():
    """Errors die out in all of them; what is left waits for the deadband to be crossed once more."""
    middle, end = random_loops(0.95)
    assert middle.max() < 0.1
    assert end.max() < 0.03


def test_far_outside_the_certificate_loops_do_oscillate():
    """The same loops with 2.5 times the gain: what the test above would look like if it failed."""
    with np.errstate(all="ignore"):
        _, end = random_loops(2.4)
    assert np.mean(~(end < 0.05)) > 0.3
