"""Preview against a rate limit: ramps on forces made by hand, and the exported module on a plant apart."""

import math
import shutil
import subprocess
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks.independent_plant import Plant
from tendonff.compensator.compensators.base import Problem
from tendonff.compensator.compensators.score import scale_of
from tendonff.compensator.compensators.stream import Ramp, StreamDesign, StreamFilter
from tendonff.compensator.export.c_project import export_project
from tendonff.compensator.export.host import run_on_host
from tendonff.compensator.scenario.settings import Stream
from tendonff.compensator.scenarios import load_scenario
from tendonff.models.errors import ParameterError
from tendonff.ocp.codegen.precision import Precision
from tendonff.ocp.tracking.limits import ForceLimits

LIMITS = ForceLimits(minimum_N=0.0, maximum_N=100.0, rate_N_per_s=1000.0)
STEP = 1e-3  # so that a sample changes the force by 1 N at most


def ramped(force, tension=None, samples=20, overshoot=0.0, limits=LIMITS):
    tension = np.full(len(force), 30.0) if tension is None else tension
    return Ramp(samples=samples, overshoot=overshoot).apply(force, tension, limits, STEP, float(force[0]))


def test_a_force_within_the_rate_comes_as_it_is_after_the_preview():
    force = 50 + 10 * np.sin(np.arange(300) / 15)
    assert np.array_equal(ramped(force)[20:], force[:-20])


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_jump_that_preview_covers_is_over_when_it_is_due(sign):
    """11.5 N at 1 N a sample: 11 samples up to the jump, which is due at sample 60, and half a newton after it."""
    found = ramped(50 + sign * 11.5 * (np.arange(100) >= 40))
    assert found[:50] == pytest.approx(50.0, abs=1e-9)
    assert found[50:61] == pytest.approx(50 + sign * np.arange(1, 12), abs=1e-9)
    assert found[61:] == pytest.approx(50 + sign * 11.5, abs=1e-9)


def test_a_jump_longer_than_preview_begins_as_soon_as_it_is_seen():
    """30 N with 20 samples ahead: 21 N are on their way when the jump is due, the others come late."""
    found = ramped(50 - 30.0 * (np.arange(120) >= 40))
    assert np.flatnonzero(found < 50)[0] == 40
    assert found[60] == pytest.approx(50 - 21, abs=1e-9)
    assert found[70:] == pytest.approx(20, abs=1e-9)


def test_the_force_first_goes_on_until_the_output_stands_between_here_and_the_turn():
    """A tension that rises by 0.1 N a sample to a turn, force twice the tension: lifted by its share."""
    rise = np.concatenate([np.full(30, 20.0), 20 + 0.1 * np.arange(60), np.full(60, 26.0)])
    force = np.where(np.arange(150) < 90, 2 * rise, 10.0)
    straight, lifted = (ramped(force, rise, samples=60, overshoot=share) for share in (0.0, 0.5))
    out = np.flatnonzero(np.diff(straight) <= -0.999)[0]  # the sample before the ramp
    here = 0.5 * straight[out]
    assert lifted.max() == pytest.approx(2 * (here + 0.5 * (26 - here)), abs=1.01)  # to a sample's change
    assert lifted.max() > straight.max() + 2
    assert np.abs(np.diff(lifted)).max() <= 1 + 1e-12


@given(
    corners=st.lists(st.floats(-20, 120), min_size=2, max_size=8),
    samples=st.integers(1, 40),
    overshoot=st.sampled_from([0.0, 0.5, 0.7]),
)
def test_no_course_takes_the_force_out_of_its_limits(corners, samples, overshoot):
    force = np.repeat(corners, 25).astype(float)
    tension = 1 + np.abs(force)
    found = ramped(force, tension, samples, overshoot)
    assert found.min() >= 0
    assert found.max() <= 100
    assert np.abs(np.diff(found)).max() <= 1 + 1e-12
    assert abs(found[0] - np.clip(force[0], 0, 100)) <= 1 + 1e-12


def test_filter_and_ramp_share_the_preview():
    shape = StreamFilter(half=6, is_flat=False, corner_per_sample=0.13, ahead=20, step_s=STEP)
    with pytest.raises(ParameterError, match=r"samples of the ramp must be at most 14, got 15"):
        StreamDesign(filter=shape, band_N=0, low_N=1, high_N=9, ramp=Ramp(samples=15, overshoot=0.5))


@pytest.fixture(scope="module")
def finger_fast(examples):
    return load_scenario(examples / "finger_fast.toml")


@pytest.fixture(scope="module")
def exported(finger_fast):
    if shutil.which("cc") is None:
        pytest.skip("cc is not installed")
    scenario = replace(finger_fast, stream=Stream(preview_s=0.25))
    return export_project(scenario, precision=Precision.FLOAT, profile_N=np.ones(3))


@pytest.mark.compiler
def test_preview_for_the_largest_jump_comes_near_the_optimum_on_a_plant_apart(finger_fast, exported, record_property):
    """3.6 % without preview, 0.34 % for the optimal profile, which shakes the bristles loose before the turn."""
    sources = {name: text for name, text in exported.files.items() if name.startswith("tff_")}
    tension = Problem.of(finger_fast).reference.tension_N
    handed_over = np.pad(tension, (0, 250), mode="edge")
    run = run_on_host(sources, "tff", Precision.FLOAT, [{"stream": handed_over}])[0]
    force = run["stream"][250:]
    output = Plant(transmission=finger_fast.transmission).respond(force, STEP, float(tension[0]))[:, 1]
    error = 100 * math.sqrt(np.mean((output - tension) ** 2)) / scale_of(tension)
    record_property("figure", f"rate limit and 250 ms of preview: {error:.2g} % of range")
    assert error <= 0.7
    assert np.abs(np.diff(force)).max() <= 0.25 * (1 + 1e-5)


@pytest.mark.compiler
def test_the_self_test_of_a_module_with_ramps_passes_and_dies_with_their_rules(exported, tmp_path):
    exported.write(tmp_path / "c")
    folder = tmp_path / "c"

    flags = ("-std=c99", "-O0", "-Wall", "-Wextra", "-Werror")
    others = ["self_test.c", *(path.name for path in folder.glob("tff_*.c") if path.name != "tff_stream.c")]
    subprocess.run(["cc", *flags, "-c", *others], cwd=folder, check=True)
    objects = [name.replace(".c", ".o") for name in others]

    def passes():
        subprocess.run(["cc", *flags, "tff_stream.c", *objects, "-lm", "-o", "test"], cwd=folder, check=True)
        return subprocess.run([str(folder / "test")], capture_output=True, check=False).returncode == 0

    assert passes()
    text = (folder / "tff_stream.c").read_text()
    for old, new in (
        ("? -self->side : self->side", "? self->side : self->side"),
        ("further > rest", "further < rest"),
        ("|= TFF_RATE_LIMITED", "|= 0u"),
        ("self->tension[last] = reference", "self->tension[last] = exact"),
    ):
        assert old in text
        (folder / "tff_stream.c").write_text(text.replace(old, new))
        assert not passes(), old
