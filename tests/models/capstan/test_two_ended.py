"""The law with two ends, against a quasi-static chain that is written here and shares no code with the tool."""

import math
from dataclasses import replace

import numpy as np
import pytest

from tendonff.models.capstan import CapstanLaw
from tendonff.models.capstan.two_ended import TwoEndedLaw
from tendonff.models.errors import ParameterError
from tendonff.models.parameters import Transmission
from tendonff.models.path import Section

STIFFNESS, ADHESION, START = 2e4, 0.5, 30.0
ANGLES, LENGTHS = (1.1, 0.0, 0.8), (0.02, 0.05, 0.03)


@pytest.fixture(scope="module")
def law(generic: Transmission) -> TwoEndedLaw:
    """Three sections, one of them straight and one with coefficients of its own."""
    own = {2: {"mu_dynamic": 0.3, "mu_static": 0.3, "mu_dynamic_release": 0.25, "mu_static_release": 0.25}}
    sections = tuple(
        Section(name=f"s{k}", angle_rad=ANGLES[k], length_m=LENGTHS[k], **own.get(k, {})) for k in range(3)
    )
    return TwoEndedLaw.of(
        replace(generic, path=replace(generic.path, total_angle_rad=1.9, sections=sections, segments=10))
    )


class Chain:
    """Blocks on a rail with springs between them: whatever is out of its friction's bounds is moved until it is not."""

    def __init__(self) -> None:
        self.growth = [math.exp(mu * a) for mu, a in ((0.2, 1.1 / 6),) * 6 + ((0.3, 0.2),) * 4]
        self.fall = [math.exp(-mu * a) for mu, a in ((0.15, 1.1 / 6),) * 6 + ((0.25, 0.2),) * 4]
        middles = [0.02 * (j + 0.5) / 6 for j in range(6)] + [0.07 + 0.03 * (j + 0.5) / 4 for j in range(4)]
        self.k = (STIFFNESS * 0.1 / np.diff([0.0, *middles, 0.1])).tolist()
        self.lifted = [START + ADHESION] * 11

    def settle(self, near_N: float, far_N: float | None = None, far_travel_m: float = 0.0) -> np.ndarray:
        """Tensions at rest; far end by its tension, or by what it moves."""
        f, last = self.lifted, 0.0 if far_N is not None else self.k[-1]
        f[0] = near_N + ADHESION
        f[-1] = f[-1] - last * far_travel_m if far_N is None else far_N + ADHESION
        k = [0.0, *self.k[1:-1], last]
        for _ in range(100_000):
            most = 0.0
            for i in range(10):
                ratio = f[i] / f[i + 1]
                held = min(max(ratio, self.fall[i]), self.growth[i])
                if held != ratio:
                    step = (f[i] - f[i + 1] * held) / (k[i] + k[i + 1] * held)
                    f[i] -= k[i] * step
                    f[i + 1] += k[i + 1] * step
                    most = max(most, abs(ratio - held))
            if most < 1e-9:
                return np.array(f) - ADHESION
        raise AssertionError("the blocks do not come to rest")


def ramps(rng: np.random.Generator, corners: int, steps: int) -> tuple[np.ndarray, np.ndarray]:
    """Tensions of both ends that friction can hold against each other."""
    near = np.log(rng.uniform(15, 60, corners) + ADHESION)
    far = near - rng.uniform(-0.32, 0.44, corners)  # within full slip, -0.365 and 0.46
    near[0] = far[0] = math.log(START + ADHESION)
    at = np.arange(corners * steps - steps + 1) / steps
    return tuple(np.exp(np.interp(at, np.arange(corners), each)) - ADHESION for each in (near, far))


def test_the_profile_is_that_of_a_chain_under_random_ramps_of_both_ends(law: TwoEndedLaw) -> None:
    rng, worst, moved = np.random.default_rng(5), 0.0, 0.0
    for _ in range(4):
        near, far = ramps(rng, 6, 12)
        chain = Chain()
        brute = np.array([chain.settle(a, b) for a, b in zip(near, far, strict=True)])
        found = law.history_N(near, far, np.full(11, START))
        worst = max(worst, np.abs(np.log(found + ADHESION) - np.log(brute + ADHESION)).max())
        moved = max(moved, np.ptp(brute[:, 5]))
    assert worst < 1e-6
    assert moved > 10


@pytest.mark.parametrize("seed", [pytest.param(1, marks=pytest.mark.nightly), 5])
def test_a_far_end_that_is_moved_has_the_tension_of_the_chain(law: TwoEndedLaw, seed: int) -> None:
    """Exact while the ends go straight; where the sliding turns within a step, of first order in the step."""
    rms = []
    for steps in (10, 30):
        rng = np.random.default_rng(seed)
        near, _ = ramps(rng, 5, steps)
        travel = np.interp(np.arange(len(near)) / steps, np.arange(5), np.append(0.0, rng.uniform(-1, 1, 4) * 4e-4))
        chain, profile, off, brute = Chain(), np.full(11, START), [], []
        for tension, moved in zip(near, np.diff(travel, prepend=0.0), strict=True):
            brute.append(chain.settle(tension, far_travel_m=moved)[-1])
            far = law.far_tension_N(profile, tension, moved, STIFFNESS)
            profile = law.profile_N(profile, tension, far)
            off.append(far - brute[-1])
        assert np.abs(off[: steps // 3]).max() < 1e-5
        rms.append(np.sqrt(np.mean(np.square(off))) / np.ptp(brute))
    assert rms[1] < 0.45 * rms[0]
    assert rms[1] < 0.015


def test_a_far_end_that_turns_in_full_slip_holds_the_last_mass(law: TwoEndedLaw) -> None:
    """All slide towards the load when it gives way: the last link shortens by what it moves, the others follow on."""
    before = law.profile_N(np.full(11, START), 20.0, 20.0 * math.exp(0.36))
    full = law.profile_N(before, 19.0, law.far_tension_N(before, 19.0, -1e-4, STIFFNESS))
    slid = np.diff(np.log(full + ADHESION))
    assert slid == pytest.approx(np.diff(law.release_exponent), abs=1e-6)
    far = law.far_tension_N(full, 18.5, 4e-6, STIFFNESS)
    last = STIFFNESS / law.length_share[-1]
    assert far == pytest.approx(full[-1] - last * 4e-6, rel=1e-6)


def test_a_far_end_that_only_follows_is_the_play_law(law: TwoEndedLaw) -> None:
    """The far end hangs on a soft spring: it moves with the tendon."""
    one = CapstanLaw(
        pull_exponent=float(law.pull_exponent[-1]),
        release_exponent=float(law.release_exponent[-1]),
        adhesion_N=ADHESION,
    )
    near, _ = ramps(np.random.default_rng(2), 12, 5)
    far = one.output_history_N(near)
    profiles = law.history_N(near, far, np.full(11, START))
    for j in (3, 7):
        part = CapstanLaw(
            pull_exponent=float(law.pull_exponent[j]),
            release_exponent=float(law.release_exponent[j]),
            adhesion_N=ADHESION,
        )
        assert profiles[:, j] == pytest.approx(part.output_history_N(near), rel=1e-9)


def test_the_elongation_goes_by_the_lengths(law: TwoEndedLaw) -> None:
    """The straight in the middle, half of the length, belongs to one link."""
    profile = np.full(11, START)
    assert law.elongation_m(profile, STIFFNESS) == pytest.approx(START / STIFFNESS)
    profile[6] += 10.0
    share = 0.5 + 0.1 / 6 + 0.15 / 4
    assert law.elongation_m(profile, STIFFNESS) == pytest.approx((START + 10 * share) / STIFFNESS)


def test_ends_that_friction_cannot_hold_are_refused(law: TwoEndedLaw) -> None:
    with pytest.raises(ParameterError, match=r"near_N = 60 and far_N = 20 cannot both act.*0\.6942 and 1\.584"):
        law.profile_N(np.full(11, START), 60.0, 20.0)
    just = math.exp(0.46 + 0.001) * 20.5 - 0.5
    assert law.profile_N(np.full(11, START), just, 20.0, excess=0.01)[-1] == pytest.approx(20.0, rel=2e-3)
