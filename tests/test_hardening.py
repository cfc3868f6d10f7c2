"""Bad input and bad luck: one clear message or a result, never a traceback, never half a result."""

import contextlib
import csv
import io
import os
import resource
import signal
import subprocess
import sys
import time
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st
from random_examples import tried_on

from tendonff.compensator.cli import run
from tendonff.compensator.identification.measured.reading import read_measurement
from tendonff.compensator.scenario.measurement import Measurement
from tendonff.compensator.scenario.scenario import parse_scenario, scenario_to_toml
from tendonff.compensator.scenarios import load_scenario
from tendonff.compensator.studies.compare.run import compare
from tendonff.compensator.studies.design.output import summary
from tendonff.compensator.studies.design.run import design
from tendonff.compensator.studies.experiment.machine import plan_experiment
from tendonff.compensator.studies.explore.run import Explorer
from tendonff.compensator.studies.tables.force import ForceTables
from tendonff.compensator.studies.tables.force_pages import summary as table_summary
from tendonff.models.errors import TendonffError

TENDONFF = [sys.executable, "-m", "tendonff.compensator.cli"]

# --- damaged scenarios and files, through whole commands -------------------------------------------------------------


@pytest.fixture(scope="module")
def tiny(examples):
    """A scenario of fifty steps on two masses."""
    scenario = load_scenario(examples / "finger.toml")
    return replace(
        scenario,
        transmission=replace(scenario.transmission, path=replace(scenario.transmission.path, segments=2)),
        reference=replace(scenario.reference, duration_s=0.1, fade_in_s=0.02, frequencies_Hz=(10.0, 23.0)),
        run=replace(scenario.run, step_s=2e-3),
    )


@pytest.fixture(scope="module")
def lines(tiny):
    """The tiny scenario, line by line."""
    return scenario_to_toml(tiny).splitlines()


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("fuzz")


# What a person may type, and what a program may write. Sizes that would only take long are left out below.
WRONG = (
    "0",
    "-1",
    "nan",
    "inf",
    "-inf",
    "true",
    '""',
    '"0.2"',
    "[]",
    "[1.0]",
    "{}",
    "1,5",
    "=",
    "'",
    '"""',
    "3.0e",
    "",
)
ODD = ("0.0", "1e300", "1e-300", "1e999", "0x10", "2024-01-01", "1e-9", "1e9")
VALUES = st.one_of(
    st.sampled_from(WRONG + ODD),
    st.floats(-1e3, 1e3).map(str),
    st.floats(-6, 6).map(lambda exponent: f"{10**exponent:.6g}"),
)
SIZES = ("duration_s", "step_s", "segments", "fine_segments", "samples", "fade_in_s", "hold_s", "rest_s", "pull_time_s")


CELLS = st.one_of(
    st.floats(0, 100).map(str),
    st.sampled_from(["", " ", "nan", "inf", "-3", "1e400", "1,5", "text", '"', "'", "\x00", "é", "1;2", "0x1", "--"]),
)


def with_value(lines, index, value):
    """The scenario with another value in one line; sizes only get values that are wrong."""
    key = lines[index].partition(" =")[0]
    if key in SIZES and value not in WRONG:
        value = "-1"
    return "\n".join([*lines[:index], f"{key} = {value}" if "=" in lines[index] else value, *lines[index + 1 :]])


def message_of(action):
    """The message of a refused action, None where it gave a result; anything but a clear message fails the test."""
    try:
        action()
    except TendonffError as error:
        text = str(error)
        assert len(text) > 10
        assert "\n" not in text
        assert "Traceback" not in text
        return text
    return None


def ran(arguments):
    """Exit code and messages of a command; whatever it is, it is one of those promised."""
    error = io.StringIO()
    with contextlib.redirect_stderr(error), contextlib.redirect_stdout(io.StringIO()):
        code = run([str(argument) for argument in arguments])
    said = error.getvalue()
    assert code in (0, 1, 2)
    assert "Traceback" not in said
    assert said.count("error: ") == (1 if code else 0), said
    return code


# numpy says when numbers such as 1e300 overflow on the way; what counts is how the command ends.
pytestmark = pytest.mark.filterwarnings("ignore::RuntimeWarning")


@tried_on(100)
@given(data=st.data())
def test_a_damaged_scenario_is_simulated_or_refused(tiny, lines, folder, data):
    index = data.draw(st.integers(0, len(lines) - 1))
    scenario, force, out = folder / "s.toml", folder / "f.csv", folder / "o.csv"
    scenario.write_text(with_value(lines, index, data.draw(VALUES)), encoding="utf-8")
    force.write_text("time_s,force_N\n0,30\n0.03,45\n0.06,12\n", encoding="utf-8")
    out.unlink(missing_ok=True)
    code = ran(["simulate", scenario, "--force", force, "--out", out])
    assert out.exists() == (code == 0)


@tried_on(60)
@given(data=st.data())
def test_a_damaged_scenario_is_designed_or_refused(lines, folder, data):
    index = data.draw(st.integers(0, len(lines) - 1))
    text = with_value(lines, index, data.draw(VALUES))
    message_of(lambda: summary(design(parse_scenario(text, folder / "s.toml"))))


@tried_on(15)
@given(data=st.data())
def test_a_damaged_scenario_is_compared_or_refused(lines, folder, data):
    index = data.draw(st.integers(0, len(lines) - 1))
    text = with_value(lines, index, data.draw(VALUES))
    message_of(lambda: compare(parse_scenario(text, folder / "s.toml")))


@tried_on(20)
@given(data=st.data())
def test_a_damaged_scenario_is_tabulated_or_refused(lines, folder, data):
    index = data.draw(st.integers(0, len(lines) - 1))
    text = with_value(lines, index, data.draw(VALUES))
    message_of(lambda: table_summary(ForceTables.made(parse_scenario(text, folder / "s.toml"))))


def test_an_actuator_too_slow_for_the_two_motor_test_is_refused_before_it_starts(tiny):
    slow = replace(tiny.transmission.actuator, force_rate_max_N_per_s=1e-3)
    scenario = replace(tiny, transmission=replace(tiny.transmission, actuator=slow))
    assert "the states may take" in message_of(lambda: plan_experiment(scenario))


# What is read from a rig: good rows with a damaged one among them.
@tried_on(30)
@given(cells=st.lists(CELLS, min_size=1, max_size=4), at=st.integers(0, 60), rows=st.sampled_from([0, 1, 60]))
def test_a_damaged_measurement_is_read_or_refused(folder, cells, at, rows):
    good = [f"{0.01 * k:.2f},{40 + k % 7},{30 + k % 5}" for k in range(rows)]
    path = folder / "m.csv"
    text = ["time_s,input_tension_N,output_tension_N", *good[:at], ",".join(cells), *good[at:]]
    path.write_text("\n".join(text), encoding="utf-8")
    message_of(lambda: read_measurement(path, Measurement()))


@tried_on(40)
@given(data=st.data())
def test_any_position_of_the_sliders_is_drawn_or_refused(tiny, data):
    explorer = Explorer(tiny)
    number = st.floats(0, 10) | st.floats(allow_nan=True)
    start = {knob.key: knob.value for knob in explorer.knobs}
    values = start | {data.draw(st.sampled_from(sorted(start))): data.draw(number)}
    knows = data.draw(st.booleans())
    message_of(lambda: explorer.explore(values, design_knows=knows, curves=explorer.fast))


def test_friction_that_lets_nothing_through_is_refused_and_radians_are_mentioned(tiny):
    absurd = replace(tiny.transmission, path=replace(tiny.transmission.path, total_angle_rad=1800.0))
    assert "total_angle_rad, which is in radians" in message_of(lambda: design(replace(tiny, transmission=absurd)))


@tried_on(100)
@given(
    header=st.sampled_from(["time_s,force_N", "force_N,time_s", "time_s;force_N", "", "t,F", "time_s,force_N,extra"]),
    rows=st.lists(st.lists(CELLS, min_size=1, max_size=3), max_size=6),
    ending=st.sampled_from(["\n", "\r\n", "\r", "\n\n"]),
    encoding=st.sampled_from(["utf-8", "utf-16", "latin-1"]),
)
def test_a_damaged_force_file_is_played_or_refused(tiny, folder, header, rows, ending, encoding):
    scenario, force, out = folder / "good.toml", folder / "f.csv", folder / "o.csv"
    if not scenario.exists():
        scenario.write_text(scenario_to_toml(tiny), encoding="utf-8")
    # Good times, so that some of the files get as far as the simulation; 0.2 s at most.
    good = [",".join([f"{0.02 * k:g}", *cells]) if k % 2 == 0 else ",".join(cells) for k, cells in enumerate(rows)]
    force.write_bytes(ending.join([header, *good]).encode(encoding, errors="replace"))
    out.unlink(missing_ok=True)
    code = ran(["simulate", scenario, "--force", force, "--out", out])
    assert out.exists() == (code == 0)
    if code == 0:
        with out.open(encoding="utf-8", newline="") as stream:
            table = list(csv.reader(stream))
        assert all(len(row) == len(table[0]) for row in table)


@tried_on(40)
@given(content=st.one_of(st.binary(max_size=80), st.text(max_size=80).map(lambda s: s.encode("utf-8", "ignore"))))
def test_a_reference_file_of_any_bytes_is_designed_or_refused(lines, folder, content):
    (folder / "reference.csv").write_bytes(b"time_s,tension_N\n0,30\n" + content)
    first = lines.index("[reference]")
    last = lines.index("[run]")
    text = "\n".join([*lines[:first], "[reference]", 'kind = "csv"', 'file = "reference.csv"', "", *lines[last:]])
    message_of(lambda: design(parse_scenario(text, folder / "s.toml")))


# --- interrupted runs ------------------------------------------------------------------------------------------------


def results_of(folder):
    """What lies in a folder, without the hidden files of a run under way."""
    return sorted(path.name for path in folder.iterdir() if not path.name.startswith("."))


@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
@pytest.mark.parametrize(
    "number", [signal.SIGINT, signal.SIGKILL, pytest.param(signal.SIGTERM, marks=pytest.mark.nightly)]
)
def test_a_stopped_design_leaves_what_was_there(examples, tmp_path, number):
    """Stopped while it computes: Ctrl-C and an ended job clean up and say so; a killed one at least leaves no half."""
    out = tmp_path / "out"
    out.mkdir()
    (out / "profile.csv").write_text("of an earlier run", encoding="utf-8")
    command = [*TENDONFF, "compare", str(examples / "finger_fast.toml"), "--out", str(out)]
    with subprocess.Popen(command, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True) as process:
        deadline = time.monotonic() + 60
        while process.poll() is None and not list(tmp_path.glob(".out.*")):
            assert time.monotonic() < deadline
            time.sleep(0.02)
        time.sleep(0.2)
        process.send_signal(number)
        said = process.communicate(timeout=60)[1]
    assert results_of(tmp_path) == ["out"]
    assert results_of(out) == ["profile.csv"]
    assert (out / "profile.csv").read_text(encoding="utf-8") == "of an earlier run"
    if number is not signal.SIGKILL:
        # Interrupted inside an `exec` (a dataclass being made), Python ends by SIGINT itself; a shell shows 130 too.
        assert process.returncode in (130, -signal.SIGINT), said
        assert said.strip() == "interrupted; nothing was written"
        assert list(tmp_path.iterdir()) == [out]


LONG = {
    "design of a joint whose moment arm is 8 m": ("design", "arm", "--yes"),
    "comparison of levels of a joint": ("compare", "hand_joint"),
    "sweep of a joint": ("sweep", "hand_joint", "--samples", "2000"),
    "design of a finger": ("design", "three_joint_finger"),
    "comparison of a finger": ("compare", "three_joint_finger"),
    "export of a tension": ("export-c", "bowden"),
    "table of a tension": ("table", "bowden"),
    "sweep of a tension": ("sweep", "bowden", "--samples", "2000"),
    "experiment of a tension": ("experiment", "bowden"),
    "study of self-tuning": ("adapt", "finger_adaptive"),
    "study of self-tuning of a joint": ("adapt", "hand_joint_adaptive"),
    "design of a tension": ("design", "bowden"),
    "design of a pair": ("design", "instrument_pair"),
    "design of a path that moves": ("design", "finger_moving"),
    "comparison of a tension": ("compare", "bowden"),
    "sweep of a finger": ("sweep", "three_joint_finger", "--samples", "2000"),
    "export of a joint": ("export-c", "hand_joint"),
    "export of a finger": ("export-c", "three_joint_finger"),
    "unit of a finger": ("export-fmu", "three_joint_finger"),
}


@pytest.mark.compiler
@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
@pytest.mark.parametrize("name", [next(iter(LONG)), *(pytest.param(n, marks=pytest.mark.nightly) for n in [*LONG][1:])])
def test_every_long_command_hears_ctrl_c(examples, tmp_path, name):
    command, example, *options = LONG[name]
    file = examples / f"{example}.toml"
    if example == "arm":
        file = tmp_path / "arm.toml"
        text = (examples / "hand_joint.toml").read_text("utf-8")
        file.write_text(text.replace("moment_arm_m = 0.008", "moment_arm_m = 8").replace("= -0.008", "= -8"), "utf-8")
    arguments = [*TENDONFF, command, str(file), *options, "--out", str(tmp_path / "out")]
    with subprocess.Popen(arguments, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True) as process:
        try:
            time.sleep(4.0)
            if process.poll() is not None:
                pytest.skip("done before it could be interrupted")
            process.send_signal(signal.SIGINT)
            said = process.communicate(timeout=60)[1]
        finally:
            process.kill()
    assert process.returncode in (130, -signal.SIGINT), said
    assert "Traceback" not in said
    assert "interrupted; " in said


@pytest.fixture(scope="module")
def compiled(examples, tmp_path_factory):
    """Environment in which what is compiled was compiled before the disk fills up."""
    folder = tmp_path_factory.mktemp("compiled")
    (folder / "f.csv").write_text("time_s,force_N\n0,30\n1,45\n", encoding="utf-8")
    environment = {**os.environ, "XDG_CACHE_HOME": str(folder / "cache")}
    command = [*TENDONFF, "simulate", str(examples / "finger.toml"), "--force", str(folder / "f.csv")]
    subprocess.run([*command, "--out", str(folder / "o.csv")], check=True, capture_output=True, env=environment)
    return environment


@pytest.mark.skipif(sys.platform != "linux", reason="limits of Linux")
@pytest.mark.parametrize("limit_bytes", [2_000, pytest.param(60_000, marks=pytest.mark.nightly)])
def test_a_full_disk_leaves_nothing_and_says_so(examples, tmp_path, compiled, limit_bytes):
    """A limit on the size of files stands for a disk that runs full: while the CSV, or the report, is written."""
    force = tmp_path / "f.csv"
    force.write_text("time_s,force_N\n0,30\n2,45\n4,12\n", encoding="utf-8")
    out = tmp_path / "results" / "o.csv"
    command = [*TENDONFF, "simulate", str(examples / "finger.toml"), "--force", str(force), "--out"]
    done = subprocess.run(
        [*command, str(out)],
        capture_output=True,
        text=True,
        check=False,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (limit_bytes, limit_bytes)),
        env=compiled,
    )
    assert done.returncode == 1
    assert "File too large" in done.stderr
    assert done.stderr.count("error: ") == 1
    assert "nothing was written" in done.stderr
    assert not out.parent.exists()
