"""What a fit will have to do is said first, and asked about where it is very much."""

import re
from types import SimpleNamespace

import numpy as np
import pytest

from tendonff.compensator.cli import run
from tendonff.compensator.cli.progress import interruptible
from tendonff.compensator.files.reading import InputError
from tendonff.compensator.files.writing import write_csv
from tendonff.compensator.identification.identify import identify
from tendonff.compensator.identification.measured.cleaning import clean
from tendonff.compensator.identification.measured.doubts import data_doubts
from tendonff.compensator.identification.measured.plan import LONG_FIT_S, check_plan, check_signs, reversal_doubts
from tendonff.compensator.identification.measured.reading import read_measurement
from tendonff.compensator.identification.pace import Pace, SlowFitError
from tendonff.compensator.scenario.measurement import Explain, Measurement
from tendonff.compensator.scenarios import load_scenario


def log(samples=70000, step_s=1.0):
    time = np.arange(samples) * step_s
    return SimpleNamespace(name="a.csv", time_s=time, input_N=30 + np.sin(time))


def plan(*files, confirm=lambda _: False, static_only=False):
    said = []
    check_plan(files, Measurement(), static_only=static_only, say=said.append, confirm=confirm)
    return said


def test_milliseconds_read_as_seconds_are_asked_about_before_any_work():
    with pytest.raises(InputError, match=r"about 140 min.*milliseconds\? --scale time=0\.001.*--yes.*--static"):
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
    assert "ms.csv: 30000 samples over 30000 s (1 Hz)" in printed
    assert "--scale time=0.001" in printed
    assert not out.exists()


def test_a_short_log_with_milliseconds_is_asked_about_too():
    with pytest.raises(InputError, match=r"every 1 s: is the time in milliseconds\? .* accept = \["):
        plan(log(500))


@pytest.mark.parametrize(
    ("option", "value", "message"),
    [
        ("--offset", "two", "--offset must be a number"),
        ("--offset", "time=1", 'unknown column "time"'),
        ("--tare", "2", "--tare must be FROM:TO"),
        ("--tare", "2:1", "tare_s must be from and to"),
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


@pytest.fixture
def record(tmp_path):
    """A file, read and cleaned."""

    def make(joints=(), **columns):
        time = np.arange(0, 20, 0.01)
        write_csv(tmp_path / "a.csv", {"time_s": time, **columns})
        return clean(read_measurement(tmp_path / "a.csv", Measurement(), joints), Measurement())

    return make


WAVE = np.sin(2 * np.pi * 0.3 * np.arange(0, 20, 0.01))


def tensions(input_N, output_N, **more):
    return {"input_tension_N": input_N, "output_tension_N": output_N, **more}


def test_reversed_tensions_are_asked_about(record):
    sound = record(**tensions(30 + 10 * WAVE, 30 + 7 * WAVE))
    assert reversal_doubts([sound], Explain.AUTO) == ()
    swapped = record(**tensions(30 + 7 * WAVE, 30 + 10 * WAVE))
    assert reversal_doubts([swapped], Explain.INPUT) == ()  # the far end is driven
    [doubt] = reversal_doubts([swapped], Explain.AUTO)
    assert doubt.startswith(
        "a.csv: the output tension swings by 20 N, the input by 14 N: are the two columns reversed?"
    )


def test_other_units_of_tensions_positions_and_joints_are_doubted_with_their_factor(record):
    def doubts(*columns, how=Measurement()):  # noqa: B008  frozen
        return list(data_doubts(columns, how, 200.0))

    even = tensions(30 + WAVE, 30 + WAVE)
    assert doubts(record(**even, input_position_m=0.01 * WAVE)) == []
    [doubt] = doubts(record(**even, input_position_m=10 * WAVE))
    assert "moves by 20 m: millimetres? Then it is 0.02 m: --scale input_position=0.001" in doubt.text
    [doubt] = doubts(record(["wrist"], **even, wrist_rad=45 * WAVE))
    assert (doubt.key, doubt.text) == ("joints.wrist", "a.csv: wrist: it turns to 45 rad: degrees? Then it is 0.7854")
    mixed = record(**tensions(30 + WAVE, 1e3 * (40 + WAVE)))
    [doubt] = doubts(mixed)
    assert doubt.key == "measurement.output_scale"
    assert "reaches 41000 N, the scenario's actuator 200 N: mN? Then it is 41 N: --scale output=0.001" in doubt.text
    assert doubts(mixed, how=Measurement(output_column="output_torque_mNm")) == []  # the user named a torque
    found = doubts(record(**tensions(0.03 + 1e-3 * WAVE, 0.03 + 1e-3 * WAVE)))
    assert [each.key for each in found] == ["measurement.input_scale", "measurement.output_scale"]
    assert "kN? Then it is 31 N: --scale input=1000" in found[0].text


def test_one_end_in_another_unit_is_doubted_whole_or_from_where_it_changes(record):
    """By the other end: a part of a recording in N and a part in kN, and a tendon that hangs slack for as long."""
    half = np.arange(len(WAVE)) < len(WAVE) // 2
    pulled, held = 30 + 10 * WAVE, 30 + 7 * WAVE
    [doubt] = data_doubts([record(**tensions(pulled, 1e-3 * held))], Measurement(), 200.0)
    assert doubt.key == "measurement.output_scale"
    assert "reaches 0.037 N where the input reaches 40 N: kN? Then --scale output=1000" in doubt.text
    [doubt] = data_doubts([record(**tensions(pulled, np.where(half, held, 1e-3 * held)))], Measurement(), 200.0)
    assert doubt.key == "measurement.output_scale"
    assert re.search(r"from 10(\.\d+)? s on the output tension alone is 0.00\d+ times as large as before", doubt.text)
    both = record(**tensions(np.where(half, pulled, 1e-3 * pulled), np.where(half, held, 1e-3 * held)))
    [doubt] = data_doubts([both], Measurement(), 200.0)
    assert re.search(r"from 10(\.\d+)? s on both tensions are 0.00\d+ times as large as before", doubt.text)
    noise = 0.01 * np.random.default_rng(0).standard_normal((2, len(WAVE)))
    for left in (0.0, 1.0):
        slack = record(**tensions(np.where(half, pulled, left * noise[0]), np.where(half, held, left * noise[1])))
        assert not list(data_doubts([slack], Measurement(), 200.0))


def test_a_spike_of_a_cell_is_no_sign_of_reversed_columns(record):
    output = 30 + 7 * WAVE
    output[700] += 60.0
    assert reversal_doubts([record(**tensions(30 + 10 * WAVE, output))], Explain.AUTO) == ()


def strokes_of_a_sheath(near, far, offset_N=0.0):
    """Tensions of a capstan that slides each way, with positions of these signs."""
    rate = np.gradient(WAVE)
    tension = 30 + 20 * WAVE
    lost = tension * np.tanh(rate / np.abs(rate).max() * 20) * 0.3 + offset_N
    positions = {"input_position_m": near * 0.01 * WAVE, "output_position_m": far * 0.01 * WAVE}
    return tensions(tension + lost, tension, **positions)


def test_reversed_tensions_beside_a_position_are_not_taken_for_its_sign_alone(record):
    columns = strokes_of_a_sheath(1, 1)
    columns["input_tension_N"], columns["output_tension_N"] = columns["output_tension_N"], columns["input_tension_N"]
    with pytest.raises(InputError, match="if the two are reversed, exchange --input-column and --output-column; else"):
        check_signs([record(**columns)], lambda _: False)


@pytest.mark.parametrize(
    ("near", "far", "asked"),
    [(1, 1, ""), (-1, 1, "input"), (1, -1, "output"), (-1, -1, "input and output")],
)
def test_a_position_by_whose_sign_friction_drives_the_tendon_is_asked_about_before_the_fit(record, near, far, asked):
    """Offsets of the cells do not matter."""
    file = record(**strokes_of_a_sheath(near, far, offset_N=8.0))
    if not asked:
        check_signs([file], pytest.fail)
        return
    with pytest.raises(InputError, match=f"a rising {asked} position") as error:
        check_signs([file], lambda _: False)
    for end in asked.split(" and "):
        assert f"--scale {end}_position=-1" in str(error.value)
    check_signs([file], lambda _: True)


@pytest.mark.parametrize("end", ["input", "output"])
def test_a_cell_the_other_way_round_is_named_before_any_position(record, end):
    """By a reversed tension the position seems reversed, and turning that one ended in a mu of 0.003."""
    columns = strokes_of_a_sheath(1, 1)
    columns[f"{end}_tension_N"] = -columns[f"{end}_tension_N"]
    with pytest.raises(InputError, match=rf"{end} is below zero in \d+ % .*Not started: --scale {end}=-1, or"):
        check_signs([record(**columns)], lambda _: False)


def test_two_cells_the_other_way_round_are_named_before_any_position(record):
    """Turning the position instead ended in a mu of 0.108 for 0.16, accepted."""
    columns = strokes_of_a_sheath(1, 1)
    columns |= {name: -columns[name] for name in ("input_tension_N", "output_tension_N")}
    with pytest.raises(InputError, match=r"both tensions are below zero .*: --scale input=-1 --scale output=-1, or"):
        check_signs([record(**columns)], lambda _: False)


def test_a_log_in_reversed_order_is_told_so(record):
    columns = strokes_of_a_sheath(1, 1)
    with pytest.raises(InputError, match=r"time_s rises in 0 % of the rows only; .* or sort the file by it"):
        record(**{**columns, "time_s": -np.arange(len(WAVE)) * 0.01})


def test_a_fit_beyond_its_time_says_what_it_does_and_stops_at_a_bound():
    said, now = [], [0.0]
    pace = Pace(said.append, announced_s=2.0, clock=lambda: now[0])
    pace.begin("law of the chain")
    for now[0] in (9.9, 10.1, 19.9):
        pace.keep()
    assert said[0] == "law of the chain"
    assert len(said) == 2
    assert "10.1 s so far: law of the chain" in said[1]
    assert "stops at 20 s" in said[1]
    now[0] = 20.1
    with pytest.raises(SlowFitError, match="stopped after 20 s of computing, 10 times what was announced"):
        pace.keep()
    pace.end()
    pace.keep()


def test_the_static_laws_answer_where_the_chain_takes_too_long(examples, tmp_path, monkeypatch):
    monkeypatch.setattr("tendonff.compensator.identification.pace.MOST", 0.0)
    write_csv(tmp_path / "a.csv", {"time_s": np.arange(0, 20, 0.01), **strokes_of_a_sheath(1, 1)})
    found = identify(load_scenario(examples / "finger.toml"), [tmp_path / "a.csv"])
    [line] = [text for text in found.warnings if "times what was announced" in text]
    assert line.startswith("first look: stopped after 0 s of computing")
    assert all(law.stage == "static" for law in found.laws)


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


def test_a_log_in_other_units_is_refused_before_the_fit_and_goes_on_as_the_user_says(examples, tmp_path, capsys):
    time = np.arange(0, 10, 0.01)
    wave = 1e3 * (40 + 10 * np.sin(time))
    lost = 0.7 * wave + 4e3 * np.tanh(20 * np.cos(time))
    write_csv(tmp_path / "mN.csv", {"time_s": time, "input_tension_N": wave, "output_tension_N": lost})
    scenario = tmp_path / "mine.toml"
    scenario.write_text((examples / "finger.toml").read_text(encoding="utf-8"), encoding="utf-8")
    out = tmp_path / "fit"
    arguments = ["identify", str(scenario), "--static", "--data", str(tmp_path / "mN.csv"), "--out", str(out)]
    assert run(arguments) == 2
    said = " ".join(capsys.readouterr().err.split())
    assert "mN.csv: the input tension reaches 50000 N, the scenario's actuator 200 N: mN? Then it is 50 N" in said
    keys = '"measurement.input_scale", "measurement.output_scale"'
    assert (
        f"Nothing was computed: correct this, or go on all the same with --yes or, for good, with accept = [{keys}]"
        in said
    )
    assert not out.exists()
    assert run([*arguments, "--yes"]) == 0
    assert "mN? Then it is 50 N" in capsys.readouterr().err
    text = scenario.read_text(encoding="utf-8").replace("[run]\n", f"[run]\naccept = [{keys}]\n")
    scenario.write_text(text, encoding="utf-8")
    assert run(arguments) == 0
    assert "mN?" not in capsys.readouterr().err
