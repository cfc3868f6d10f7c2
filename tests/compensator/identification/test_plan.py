"""What a fit will have to do is said first, and asked about where it is very much."""

from types import SimpleNamespace

import numpy as np
import pytest

from tendonff.compensator.cli import run
from tendonff.compensator.cli.progress import interruptible
from tendonff.compensator.files.reading import InputError
from tendonff.compensator.files.writing import write_csv
from tendonff.compensator.identification.measured.plan import LONG_FIT_S, check_plan, data_doubts
from tendonff.compensator.scenario.measurement import Explain, Measurement
from tendonff.models.path import JointMotion


def log(samples=70000, step_s=1.0):
    time = np.arange(samples) * step_s
    return SimpleNamespace(name="a.csv", time_s=time, input_N=30 + np.sin(time))


def plan(*files, confirm=lambda _: False, static_only=False):
    said = []
    check_plan(files, Measurement(), static_only=static_only, say=said.append, confirm=confirm)
    return said


def test_milliseconds_read_as_seconds_are_asked_about_before_any_work():
    with pytest.raises(InputError, match=r"about 1\.4e\+02 min.*milliseconds\? --scale time=0\.001.*--yes.*--static"):
        plan(log())


def test_the_answer_decides():
    asked = []
    said = plan(log(), confirm=lambda question: asked.append(question) or True)
    assert len(asked) == 1
    assert said == ["a.csv: 70000 samples over 7e+04 s (1 Hz), input 29 to 31 N", "the fit takes about 8.4e+03 s"]


def test_the_static_law_simulates_nothing_and_is_not_asked_about():
    [line] = plan(log(int(2e4 * LONG_FIT_S), 1e-3), static_only=True)
    assert line.endswith("input 29 to 31 N")


def test_milliseconds_read_as_seconds_are_asked_about_for_the_static_law_too():
    with pytest.raises(InputError, match=r"every 1 s: is the time in milliseconds\? --scale time=0\.001.*--yes"):
        plan(log(), static_only=True)


def test_an_ordinary_log_is_not_asked_about():
    line, announced = plan(log(50_000, 2e-3))
    assert "500 Hz" in line
    assert announced == "the fit takes about 13 s"


def test_the_command_says_what_it_read_before_it_refuses(examples, tmp_path, capsys):
    time = np.arange(30000.0)
    wave = 30 + 10 * np.sin(time / 300)
    write_csv(tmp_path / "ms.csv", {"time_s": time, "input_tension_N": wave, "output_tension_N": 0.7 * wave})
    out = tmp_path / "out"
    arguments = ["identify", str(examples / "finger.toml"), "--data", str(tmp_path / "ms.csv"), "--out", str(out)]
    assert run(arguments) == 2
    printed = capsys.readouterr().err
    assert "ms.csv: 30000 samples over 3e+04 s (1 Hz)" in printed
    assert "--scale time=0.001" in printed
    assert not out.exists()


@pytest.mark.parametrize(
    ("option", "value", "message"),
    [
        ("--offset", "two", "--offset must be a number"),
        ("--offset", "time=1", 'unknown column "time"'),
        ("--tare", "2", "--tare must be FROM:TO"),
        ("--tare", "2:1", "tare_s must be from and to"),
        ("--condition", "wet", "--condition must be FILE=LABEL"),
        ("--condition", "y.csv=wet", '"y.csv" is not given with --data'),
    ],
)
def test_options_that_cannot_be_read_are_one_message(examples, tmp_path, capsys, option, value, message):
    arguments = ["identify", str(examples / "finger.toml"), "--data", "x.csv", option, value]
    assert run([*arguments, "--out", str(tmp_path / "o")]) == 2
    assert message in capsys.readouterr().err


def test_what_goes_wrong_beside_the_main_thread_is_raised_in_it():
    assert interruptible(lambda: 3) == 3
    with pytest.raises(InputError, match="no such file"):
        interruptible(lambda: (_ for _ in ()).throw(InputError("no such file")))


def measured(**values):
    usual = {"name": "a.csv", "has_output": True, "input_m": None, "output_m": None, "motion": None}
    return SimpleNamespace(**usual | values)


def test_reversed_tensions_and_other_units_of_positions_and_joints_are_asked_about():
    wave = np.sin(np.arange(100.0))
    sound = measured(input_N=30 + 10 * wave, output_N=30 + 7 * wave, input_m=0.01 * wave)
    swapped = measured(input_N=sound.output_N, output_N=sound.input_N)
    assert data_doubts([sound], Explain.AUTO) == ()
    assert data_doubts([swapped], Explain.INPUT) == ()  # the output end is driven
    [doubt] = data_doubts([swapped], Explain.AUTO)
    assert doubt.startswith(
        "a.csv: the output tension swings by 20 N, the input by 14 N: are the two columns reversed?"
    )
    [doubt] = data_doubts([measured(input_N=wave, output_N=wave, input_m=10 * wave)], Explain.AUTO)
    assert doubt.endswith("moves by 20 m: millimetres? --scale input_position=0.001")
    motion = JointMotion(names=("wrist",), time_s=np.arange(2.0), angle_rad=np.array([[0.0], [45.0]]))
    [doubt] = data_doubts([measured(input_N=wave, output_N=wave, motion=motion)], Explain.AUTO)
    assert doubt == "a.csv: wrist: it turns to 45 rad: degrees? Then it is 0.7854"


def test_the_command_says_doubts_before_it_fits(examples, tmp_path, capsys, monkeypatch):
    def fitted(*_, **__):
        raise InputError(f"fitting; said before: {capsys.readouterr().err}")

    monkeypatch.setattr("tendonff.compensator.identification.run.check_channels", fitted)
    time = np.arange(0, 10, 0.01)
    wave = 30 + 10 * np.sin(time)
    write_csv(tmp_path / "swapped.csv", {"time_s": time, "input_tension_N": 0.7 * wave, "output_tension_N": wave})
    data = ["--data", str(tmp_path / "swapped.csv"), "--out", str(tmp_path / "out")]
    assert run(["identify", str(examples / "finger.toml"), *data]) == 2
    assert "said before: swapped.csv: 1000 samples" in (said := capsys.readouterr().err)
    assert "warning: swapped.csv: the output tension swings by 20 N, the input by 14 N" in said
