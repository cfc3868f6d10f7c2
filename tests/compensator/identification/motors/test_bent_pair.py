"""A pair through a sheath whose bend differs from file to file, on an explicit plant of its own."""

import json

import numpy as np
import pytest

from tendonff.compensator.cli import run
from tendonff.compensator.files.reading import InputError
from tendonff.compensator.identification.identify import identify
from tendonff.compensator.identification.motors.log import read_several
from tendonff.compensator.identification.motors.numbers import numbers_of
from tendonff.compensator.identification.motors.run import mechanism_of
from tendonff.compensator.identification.parameters import Parameter
from tendonff.compensator.scenario.measurement import Measurement
from tendonff.compensator.scenarios import load_scenario
from tests.bent_instrument import TEXT, BentInstrument

pytestmark = pytest.mark.compiler

FITTED, UNSEEN = (1, 8), 5


@pytest.fixture(scope="module")
def rig():
    return BentInstrument.drawn(7)


@pytest.fixture(scope="module")
def logs(rig, tmp_path_factory):
    """Scenario, logs of two bends to fit and of one to judge, and their conditions."""
    folder = tmp_path_factory.mktemp("bends")
    (folder / "instrument.toml").write_text(TEXT, encoding="utf-8")
    made = [rig.log(folder, number, seconds=6.0, masses=6, step_s=4e-6) for number in (*FITTED, UNSEEN)]
    return folder / "instrument.toml", [file for file, _ in made], [condition for _, condition in made]


@pytest.fixture(scope="module")
def fitted(logs, tmp_path_factory):
    """Folder that the command writes."""
    scenario, files, conditions = logs
    out = tmp_path_factory.mktemp("fitted") / "fit"
    asked = [*(word for file in files[:-1] for word in ("--data", str(file))), "--validate", str(files[-1])]
    asked += [word for condition in conditions for word in ("--condition", condition)]
    assert run(["identify", str(scenario), *asked, "--out", str(out)]) == 0
    return out


@pytest.mark.slow
def test_files_of_other_bends_tell_one_friction_one_stiffness_and_the_spring_of_the_joint(rig, fitted):
    fit = json.loads((fitted / "fit.json").read_text())
    for key, value in rig.truth.items():
        assert fit["estimates"][key]["identifiable"], key
        assert fit["estimates"][key]["estimate"] == pytest.approx(value, rel=0.02), key
    scenario = load_scenario(fitted / "fitted.toml")
    assert scenario.mechanism.joint.stiffness_N_m_per_rad == pytest.approx(
        rig.truth["joints.wrist.stiffness_N_m_per_rad"], rel=0.02
    )
    assert "motors.open.drive.coulomb_N_m" not in fit["estimates"]  # no motor is in the way of its cell
    assert scenario.mechanism.drive.coulomb_N_m == 3e-3


def test_each_file_is_listed_with_its_bend_and_the_joint_by_tensions_alone(logs, fitted):
    files = json.loads((fitted / "fit.json").read_text())["files"]
    for file, condition in zip(files, logs[2], strict=True):
        bend = float(condition.rpartition("=")[2])
        assert file["condition_rad"] == {"bend": bend}
        assert file["mu_theta"]["open"] / file["mu_theta"]["close"] == pytest.approx(
            files[0]["mu_theta"]["open"] / files[0]["mu_theta"]["close"]
        )
        assert 0 < file["joint_rms_deg"]["wrist"] < 0.1
        assert file["joint_rms_deg"]["wrist"] < file["joint_by_torques_rms_deg"]["wrist"] < 1.0
    angles = [1.0 + file["condition_rad"]["bend"] for file in files]
    assert [f["mu_theta"]["open"] for f in files] == pytest.approx(
        [files[0]["mu_theta"]["open"] / angles[0] * a for a in angles]
    )
    page = (fitted / "report.html").read_text(encoding="utf-8")
    assert f"--condition {logs[2][0]}"[:-1] in page
    assert "mu theta of close" in page


def test_the_bend_of_a_file_may_be_a_column_of_it(logs, tmp_path):
    scenario, [file, *_], _ = logs
    finger, sampled = mechanism_of(load_scenario(scenario))
    lines = file.read_text().splitlines()
    bent = tmp_path / "bent.csv"

    def standing(angles, **how):
        rows = [f"{line},{angle}" for line, angle in zip(lines, ["bend_rad", *angles], strict=True)]
        bent.write_text("\n".join(rows))
        [log] = read_several(finger, [bent], sampled.angle_rad[0], Measurement(**how))
        return log.run.standing_rad["bend"]

    still = 1.2 + 0.01 * np.random.default_rng(0).uniform(-1, 1, len(lines) - 1)
    assert standing(still) == pytest.approx(1.2, abs=1e-3)
    assert standing(still, conditions=("bent.csv:bend=0.7", "bend=0.1")) == 0.7
    with pytest.raises(InputError, match=r"bent.csv: bend moves by 0\.\d+ rad; a condition holds for a whole file"):
        standing(np.linspace(0.5, 1.0, len(lines) - 1))


@pytest.mark.parametrize(
    ("conditions", "said"),
    [
        (["bend_1.csv:bend=0.5"], r"bend_8.csv: the angle of bend is not known, which other files state; .*bend=RAD"),
        (
            ["bend_1.csv:bnd=0.5"],
            r'instrument.toml: a condition must name a joint .*\(bend\), got "bnd", did you mean "bend"\?',
        ),
        (["bend_1.csv:bend=90"], r"bend_1.csv: bend must be within \+-7 rad, got 90; 90 deg are 1.571 rad"),
        (["bend_1.csv:wrist=0.5"], r'no tendon drives \(bend\), got "wrist"'),
        (["bend_l.csv:bend=0.5"], r'a measured file \(.*\), got "bend_l.csv", did you mean'),
    ],
)
def test_a_condition_that_is_not_known_or_has_no_place_is_refused(logs, conditions, said):
    scenario, files, _ = logs
    with pytest.raises(InputError, match=said):
        identify(load_scenario(scenario), files[:2], how=Measurement(conditions=tuple(conditions)))


def test_a_bend_that_moves_in_the_scenario_must_be_stated(logs, tmp_path):
    moving = TEXT.replace(
        'kind = "constant"\nangle_rad = 1.0', 'kind = "sine"\namplitudes_rad = [0.5]\nfrequencies_Hz = [1.0]'
    )
    (tmp_path / "moving.toml").write_text(moving, encoding="utf-8")
    with pytest.raises(InputError, match=r"the angle of bend is not known, which moves in moving.toml"):
        identify(load_scenario(tmp_path / "moving.toml"), logs[1][:1])


def test_a_loop_is_fitted_at_one_bend(logs, tmp_path):
    loop = TEXT.replace('kind = "pair"', 'kind = "loop"').replace("least_tension_N = 3.0", "pretension_N = 5.0")
    (tmp_path / "loop.toml").write_text(loop, encoding="utf-8")
    with pytest.raises(InputError, match=r"loop.toml: a loop is fitted at one bend: its pre-tension is another"):
        identify(load_scenario(tmp_path / "loop.toml"), logs[1][:1])


def test_the_spring_of_a_joint_is_one_more_number_and_of_a_joint_without_one_none(logs, examples):
    spring = f"joints.wrist.{Parameter.JOINT_STIFFNESS.spec.key.partition('.')[2]}"
    assert spring in numbers_of(mechanism_of(load_scenario(logs[0]))[0], [])
    assert spring not in numbers_of(mechanism_of(load_scenario(examples / "instrument_pair.toml"))[0], [])
