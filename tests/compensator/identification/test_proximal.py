"""No sensor at the far end: input tension, position of the near end, and the scenario's load."""

from dataclasses import replace

import numpy as np
import pytest
from synthetic import Faults, write_synthetic

from tendonff.compensator.files.reading import InputError
from tendonff.compensator.files.writing import write_csv
from tendonff.compensator.identification.identify import identify
from tendonff.compensator.scenario.measurement import Explain, Measurement
from tendonff.compensator.scenarios import load_scenario

pytestmark = pytest.mark.compiler

MU, STEP = 0.27, 2e-3


@pytest.fixture(scope="module")
def nominal(examples):
    return load_scenario(examples / "finger.toml")


def proximal(path, keep=(0, 1, 3)):
    """Leave the columns of the far end out."""
    rows = [line.split(",") for line in path.read_text().splitlines()]
    path.write_text("\n".join(",".join(row[k] for k in keep) for row in rows) + "\n")
    return path


@pytest.fixture(scope="module")
def file(nominal, tmp_path_factory):
    t = nominal.transmission
    truth = replace(t, friction=replace(t.friction, mu_dynamic=MU, mu_static=MU))
    time = np.arange(0, 14, STEP)
    force = 45 + np.minimum(time, 1) * (28 * np.sin(2 * np.pi * 0.31 * time) + 9 * np.sin(2 * np.pi * 0.83 * time))
    path = tmp_path_factory.mktemp("proximal") / "a.csv"
    write_synthetic(path, truth, time, force, Faults(noise=0.002, seed=3), step_s=STEP)
    return proximal(path)


@pytest.fixture(scope="module")
def found(nominal, file):
    return identify(nominal, [file])


def test_friction_is_found_without_a_sensor_at_the_far_end(found):
    assert found.explain is Explain.POSITION
    estimate = found.estimate("mu_dynamic")
    assert estimate.identifiable
    assert estimate.value == pytest.approx(MU, rel=0.03)
    assert found.scenario.transmission.friction.mu_dynamic == estimate.value


def test_what_cannot_be_told_from_one_end_is_named_with_the_way_out(found):
    for name in ("input_offset_N", "output_offset_N"):
        assert not found.estimate(name).identifiable
        assert "measure the output tension" in found.estimate(name).why
    assert any("the load is the scenario's, 3000 N/m" in w for w in found.warnings)


def test_its_errors_are_those_of_the_position(found, file, tmp_path):
    assert found.fit_percent < 1.0
    assert found.replay_percent == pytest.approx(found.fit_percent, rel=0.05)
    [one] = found.as_json()["files"]
    assert one["rms_m"] == pytest.approx(found.fit_percent / 100 * one["range_m"], rel=0.01)
    found.write(tmp_path / "out")
    assert (tmp_path / "out" / "loop.svg").stat().st_size > 5000


def test_a_file_without_output_among_others_is_refused(nominal, file, tmp_path):
    other = tmp_path / "b.csv"
    time = np.arange(0, 4, STEP)
    wave = 30 + 10 * np.sin(time)
    write_csv(
        other,
        {"time_s": time, "input_tension_N": wave, "output_tension_N": 0.7 * wave, "input_position_m": 1e-4 * wave},
    )
    with pytest.raises(InputError, match=r"a\.csv: no output tension, which the other files have"):
        identify(nominal, [file, other])


def test_the_static_law_needs_the_output(nominal, file):
    with pytest.raises(InputError, match="the capstan law needs the output tension"):
        identify(nominal, [file], static_only=True)


def test_a_named_column_that_is_missing_is_no_reason_to_do_without(nominal, file):
    wanted = replace(nominal, measurement=Measurement(output_column="load_cell_2"))
    with pytest.raises(InputError, match='column "load_cell_2" is missing'):
        identify(wanted, [file])
