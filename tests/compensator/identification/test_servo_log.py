"""`identify` of a drive's lag and delay from a log of its command and its answer."""

import tomllib

import numpy as np
import pytest

from tendonff.compensator.cli import run
from tendonff.compensator.files.reading import read_csv
from tendonff.compensator.files.writing import write_csv
from tendonff.models.servo import Servo


@pytest.mark.compiler
@pytest.mark.parametrize(
    ("example", "table", "pair"),
    [("finger", "actuator", ("command_N", "force_N")), ("hand_joint", "drive", ("command_rad", "motor_rad"))],
)
def test_a_chirp_of_the_drive_gives_the_keys_of_the_scenario(examples, tmp_path, example, table, pair, capsys):
    scenario = str(examples / f"{example}.toml")
    assert run(["identify", scenario, "--suggest", "--out", str(tmp_path / "s")]) == 0
    chirp = read_csv(tmp_path / "s" / "suggested_drive.csv", ("time_s", pair[0]))
    step = float(chirp["time_s"][1])
    answer = Servo(servo_time_s=0.02, delay_s=0.007).follow(chirp[pair[0]], step)
    noise = 0.01 * np.ptp(answer) * np.random.default_rng(1).standard_normal(len(answer))
    write_csv(tmp_path / "log.csv", {**chirp, pair[1]: answer + noise})
    assert run(["identify", scenario, "--data", str(tmp_path / "log.csv"), "--out", str(tmp_path / "fit")]) == 0
    assert "95 % interval" in " ".join(capsys.readouterr().err.split())
    found = tomllib.loads((tmp_path / "fit" / "drive.toml").read_text("utf-8"))
    assert found[table]["servo_time_s"] == pytest.approx(0.02, abs=1e-3)
    assert found[table]["delay_s"] == pytest.approx(0.007, abs=1e-3)
    low, high = found["robust"]["spread"][f"{table}.servo_time_s"]
    assert low < found[table]["servo_time_s"] < high


def test_a_file_without_a_header_is_read_by_the_names_given_for_its_columns(examples, tmp_path, capsys):
    (tmp_path / "log.csv").write_text("0,40,39\n0.01,41,40\n", encoding="utf-8")
    asked = [
        "identify",
        str(examples / "finger.toml"),
        "--data",
        str(tmp_path / "log.csv"),
        "--out",
        str(tmp_path / "f"),
    ]
    assert run([*asked, "--columns", "time_s,input_tension_N"]) == 2
    assert "log.csv row 1 has 3 cells, --columns names 2" in capsys.readouterr().err
    assert run([*asked, "--columns", "time_s,input_tension_N,output_tension_N"]) == 2
    assert "at least 10 are needed" in capsys.readouterr().err
