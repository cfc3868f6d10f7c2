"""`identify --static`: what it takes over, what it does not try, and what it may claim."""

from dataclasses import replace

import numpy as np
import pytest
from synthetic import Faults, write_synthetic

from tendonff.compensator.files.reading import InputError
from tendonff.compensator.files.writing import write_csv
from tendonff.compensator.identification.identify import identify
from tendonff.compensator.scenarios import load_scenario
from tendonff.models.capstan import CapstanLaw
from tendonff.models.path import Section, SectionKind

STEP_S = 0.01


@pytest.fixture(scope="module")
def finger(examples):
    return load_scenario(examples / "finger.toml")


def strokes(seconds=20.0, step_s=STEP_S):
    time = np.arange(0.0, seconds, step_s)
    return time, 42 - 26 * np.cos(2.0 * time) + 10 * np.sin(0.71 * time)


def write_play(path, law, *, input_offset_N=0.0, output_offset_N=0.0, **columns):
    """What cells with biases read beside a transmission that is the play law itself."""
    time, force = strokes()
    output, rng = law.output_history_N(force), np.random.default_rng(0)
    read = {"input_tension_N": force + input_offset_N, "output_tension_N": output + output_offset_N}
    read = {name: x + 0.02 * rng.normal(size=len(time)) for name, x in read.items()}
    write_csv(path, {"time_s": time, **read, **{name: np.full(len(time), x) for name, x in columns.items()}})
    return path


@pytest.fixture(scope="module")
def wristed(finger):
    """A scenario whose mu is 0.15; bearing and wrist have friction of their own."""
    sections = (
        Section(name="shaft", angle_rad=0.4),
        Section(name="pulley", angle_rad=1.57, kind=SectionKind.PULLEY, bearing_exponent=0.02),
        Section(name="wrist", angle_rad=0.3, joint="wrist", angle_per_rad=1.0, mu_dynamic=0.2),
        Section(name="jaw", angle_rad=1.2),
    )
    t = finger.transmission
    path = replace(t.path, sections=sections, total_angle_rad=sum(s.angle_rad for s in sections))
    friction = replace(t.friction, mu_dynamic=0.15, mu_static=0.15, adhesion_N=0.0)
    return replace(finger, transmission=replace(t, path=path, friction=friction))


def test_sections_keep_their_own_friction_where_the_joints_stand(wristed, tmp_path):
    exponent = 0.17 * 1.6 + 0.2 * (0.3 + 0.4) + 0.02
    law = CapstanLaw(pull_exponent=exponent, release_exponent=exponent)
    found = identify(wristed, [write_play(tmp_path / "log.csv", law, wrist_rad=0.4)], static_only=True)
    assert found.estimate("mu_theta").value == pytest.approx(exponent, rel=0.01)
    assert found.estimate("mu_dynamic").value == pytest.approx(0.17, rel=0.01)
    assert found.scenario.transmission.friction.mu_dynamic == pytest.approx(found.estimate("mu_dynamic").value)
    assert found.replay_percent == pytest.approx(found.fit_percent, rel=1e-3)
    lines = found.lines()
    assert any("mu_theta = " in line and "with wrist at 0.4 rad" in line for line in lines)
    assert found.estimate("mu_theta").reason.endswith("with wrist at 0.4 rad (mean)")  # of report and fit.json
    assert found.estimate("wrist: mu_dynamic").why == "a section's own value is not fitted"
    [unknown] = [line for line in lines if "not identifiable" in line]
    assert "wrist: mu_dynamic" in unknown
    assert found.estimate("stiffness_N_per_m").why == "not fitted: --static"
    assert "fitted.toml, read back" in lines[-1]


def test_a_path_that_moves_is_refused(wristed, tmp_path):
    law = CapstanLaw(pull_exponent=0.35, release_exponent=0.35)
    file = write_play(tmp_path / "log.csv", law, wrist_rad=0.5 * np.sin(strokes()[0]))
    with pytest.raises(InputError, match=r"log\.csv: wrist moves by 1 rad.*leave --static out"):
        identify(wristed, [file], static_only=True)


def test_sections_that_all_have_their_own_friction_leave_nothing_to_find(wristed, tmp_path):
    t = wristed.transmission
    sections = tuple(s if s.bearing_exponent is not None else replace(s, mu_dynamic=0.2) for s in t.path.sections)
    own = replace(wristed, transmission=replace(t, path=replace(t.path, sections=sections)))
    file = write_play(tmp_path / "log.csv", CapstanLaw(pull_exponent=0.4, release_exponent=0.4), wrist_rad=0.0)
    with pytest.raises(InputError, match="mu_dynamic acts nowhere; leave mu_dynamic out of the sections"):
        identify(own, [file], static_only=True)


def test_bearings_of_a_path_on_pulleys_alone_are_found(wristed, tmp_path):
    t = wristed.transmission
    wheels = tuple(
        Section(name=f"wheel {k}", angle_rad=1.0, kind=SectionKind.PULLEY, bearing_exponent=0.05) for k in (1, 2)
    )
    own = replace(wristed, transmission=replace(t, path=replace(t.path, sections=wheels, total_angle_rad=2.0)))
    file = write_play(tmp_path / "log.csv", CapstanLaw(pull_exponent=0.3, release_exponent=0.3))
    found = identify(own, [file], static_only=True)
    assert found.estimate("mu_dynamic").value == pytest.approx(0.15, rel=0.01)
    assert found.scenario.transmission.friction.mu_dynamic == found.estimate("mu_dynamic").value
    assert any("bearing_exponent of a pulley is mu_dynamic times its angle_rad" in line for line in found.warnings)


def test_the_printed_error_is_that_of_the_fitted_file(finger, tmp_path, monkeypatch):
    """Offsets of the cells that do not stand out from their doubt are no part of the file."""
    monkeypatch.setattr("tendonff.compensator.identification.outcome.StaticFit.stands_out", lambda *_: False)
    law = CapstanLaw(pull_exponent=0.4, release_exponent=0.4)
    files = [write_play(tmp_path / f"{k}.csv", law, input_offset_N=2.0, output_offset_N=4.0) for k in "ab"]
    found = identify(finger, files[:1], files[1:], static_only=True)
    assert found.replay_percent > 2 * found.fit_percent
    assert f"explains the log to {found.replay_percent:.2g} % and the validation files to" in found.lines()[0]
    assert found.replay_validation_percent == pytest.approx(found.replay_percent, rel=1e-6)
    [line] = [text for text in found.warnings if "input_offset_N" in text]
    assert line.endswith(f"with them the law has an RMS error of {found.fit_percent:.2g} %")


def test_adhesion_that_only_the_biases_could_tell_apart_is_that_of_the_scenario(finger, tmp_path):
    """Adhesion and both biases act through their differences: with the true adhesion given, the biases are found."""
    t = finger.transmission
    friction = replace(t.friction, mu_dynamic=0.2, mu_static=0.2, adhesion_N=1.5)
    scenario = replace(finger, transmission=replace(t, friction=friction))
    law = CapstanLaw.of(scenario.transmission)
    file = write_play(tmp_path / "log.csv", law, input_offset_N=2.0, output_offset_N=4.0)
    found = identify(scenario, [file], static_only=True)
    adhesion = found.estimate("adhesion_N")
    assert (adhesion.value, adhesion.fitted, adhesion.standing) == (1.5, False, "no")
    assert found.scenario.transmission.friction.adhesion_N == 1.5
    how = found.scenario.measurement
    for name, bias, kept in (("input", 2.0, how.input_offset_N), ("output", 4.0, how.output_offset_N)):
        estimate = found.estimate(f"{name}_offset_N")
        assert estimate.identifiable
        assert estimate.value == kept == pytest.approx(bias, abs=0.05)
    assert found.replay_percent == pytest.approx(found.fit_percent, rel=1e-3)


@pytest.mark.compiler
def test_biases_that_presliding_imitates_are_not_claimed(finger, tmp_path):
    """Cells without offset on a soft contact: whatever the capstan law says of a bias, zero is within its doubt."""
    t = finger.transmission
    friction = replace(t.friction, adhesion_N=1.5, soft_bristle_stiffness_N_per_m=1.5e4)
    file = tmp_path / "log.csv"
    write_synthetic(file, replace(t, friction=friction), *strokes(12.0), Faults(), masses=12, step_s=STEP_S / 4)
    found = identify(replace(finger, transmission=replace(t, friction=friction)), [file], static_only=True)
    for name in ("input_offset_N", "output_offset_N"):
        estimate = found.estimate(name)
        assert estimate.interval is None or estimate.interval[0] <= 0 <= estimate.interval[1]
        assert not estimate.identifiable
    assert not found.scenario.measurement.input_offset_N
    assert not found.scenario.measurement.output_offset_N
