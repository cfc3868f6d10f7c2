import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from tendonff.compensator.cli import run
from tendonff.compensator.files.reading import read_csv
from tendonff.compensator.files.writing import write_csv, write_text
from tendonff.compensator.scenarios import load_scenario
from tendonff.compensator.studies.simulate import run as simulation
from tendonff.models.fidelity import Level
from tendonff.models.tendon.chain import Chain
from tendonff.ocp.codegen.engine import Engine, resolve_engine
from tendonff.ocp.tendon.simulate import simulate

Capture = pytest.CaptureFixture[str]
FORCE = "time_s,force_N\n0,30\n0.3,60\n0.55,20\n1,50\n"
TENSIONS = [f"tension_{k}_N" for k in range(1, 8)]
COLUMNS = ["time_s", "force_N", *TENSIONS, "actuator_position_m", "load_position_m"]


@pytest.fixture
def force(tmp_path: Path) -> Path:
    write_text(tmp_path / "F.csv", FORCE)
    return tmp_path / "F.csv"


def play(examples: Path, force: Path, out: Path, *extra: str, level: str = "presliding", name: str = "finger") -> int:
    scenario = str(examples / f"{name}.toml")
    return run(["simulate", scenario, "--level", level, "--force", str(force), "--out", str(out), *extra])


def output_tension(examples: Path, step_s: float) -> np.ndarray:
    chain = Chain.of(load_scenario(examples / "finger.toml").transmission, Level.PRESLIDING)
    time = np.arange(round(1 / step_s) + 1) * step_s
    return simulate(chain, np.interp(time, [0, 0.3, 0.55, 1], [30, 60, 20, 50]), step_s).output_tension_N


@pytest.mark.parametrize("level", Level)
def test_the_file_holds_what_the_simulator_computes(examples: Path, force: Path, tmp_path: Path, level: Level) -> None:
    assert play(examples, force, tmp_path / "O.csv", level=level) == 0
    with (tmp_path / "O.csv").open(encoding="utf-8") as stream:
        assert stream.readline().strip().split(",") == COLUMNS
    rows = read_csv(tmp_path / "O.csv", COLUMNS)
    assert np.array_equal(rows["time_s"], np.arange(1001) * 1e-3)
    assert rows["force_N"] == pytest.approx(np.interp(rows["time_s"], [0, 0.3, 0.55, 1], [30, 60, 20, 50]))
    chain = Chain.of(load_scenario(examples / "finger.toml").transmission, level)
    direct = simulate(chain, rows["force_N"], 1e-3, initial_tension_N=30.0)
    assert np.column_stack([rows[name] for name in TENSIONS]) == pytest.approx(direct.tension_N, abs=1e-9)
    assert rows["actuator_position_m"] == pytest.approx(direct.near_position_m, abs=1e-12)
    assert rows["load_position_m"] == pytest.approx(direct.far_position_m, abs=1e-12)


def test_pieces_of_a_long_run_join_without_a_seam(
    examples: Path, force: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert play(examples, force, tmp_path / "whole.csv", "--check") == 0
    monkeypatch.setattr(simulation, "_CHUNK_VALUES", 37 * 11)
    assert play(examples, force, tmp_path / "parts.csv", "--check") == 0
    parts, whole = (read_csv(tmp_path / name, COLUMNS) for name in ("parts.csv", "whole.csv"))
    if resolve_engine(Engine.AUTO) is Engine.COMPILED:
        assert (tmp_path / "parts.csv").read_bytes() == (tmp_path / "whole.csv").read_bytes()
    for name in COLUMNS:  # without a compiler, chunks of steps are cut differently: equal to rounding
        assert parts[name] == pytest.approx(whole[name], abs=1e-9)


def test_the_check_states_an_error_that_shrinks_with_the_step(
    examples: Path, force: Path, tmp_path: Path, capsys: Capture
) -> None:
    text = (examples / "finger.toml").read_text(encoding="utf-8")
    errors = []
    for step in (0.004, 0.001):
        write_text(tmp_path / "finger.toml", text.replace("step_s = 0.001", f"step_s = {step}"))
        assert play(tmp_path, force, tmp_path / "O.csv", "--check") == 0
        message = capsys.readouterr().err
        assert f"check: output tension against a run with step {step / 2:g} s: " in message
        assert "% of range" in message
        errors.append(float(message.split(" s: ")[1].split(" N RMS")[0]))
        coarse, fine = (output_tension(examples, step / k)[::k] for k in (1, 2))
        assert errors[-1] == pytest.approx(np.sqrt(np.mean((coarse - fine)[1:] ** 2)), rel=1e-2)
    assert 0 < errors[1] < errors[0] / 2


def test_forces_beyond_the_actuator_are_played_and_said(examples: Path, tmp_path: Path, capsys: Capture) -> None:
    write_text(tmp_path / "F.csv", "time_s,force_N\n0,30\n0.2,500\n0.4,40\n")
    assert play(examples, tmp_path / "F.csv", tmp_path / "O.csv") == 0
    limit = load_scenario(examples / "finger.toml").transmission.actuator.force_max_N
    assert f"F.csv asks for 500 N where force_max_N is {limit:g}: simulated as it is" in capsys.readouterr().err
    assert read_csv(tmp_path / "O.csv", COLUMNS)["force_N"].max() == 500


def test_a_force_that_jumps_at_the_start_or_lets_the_tendon_go_slack_is_warned_of(
    examples: Path, tmp_path: Path, capsys: Capture
) -> None:
    write_text(tmp_path / "F.csv", "time_s,force_N\n0,33\n0.01,0\n0.5,0\n")
    assert play(examples, tmp_path / "F.csv", tmp_path / "O.csv") == 0
    first = read_csv(tmp_path / "O.csv", TENSIONS, increasing=None)
    assert [float(first[name][0]) for name in TENSIONS] == pytest.approx([30.0] * 7)
    message = capsys.readouterr().err
    assert "warning: F.csv starts at 33 N, but the run starts at rest at 30 N: the force jumps by 3 N" in message
    assert "warning: the tendon goes slack at t = " in message


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("time_s,force\n0,1\n", 'F.csv: column "force_N" is missing; is it "force"?'),
        ("time_s,force_N\n0,30\n0.1,30\n0.1,30\n", "F.csv row 4: time_s must increase, got 0.1 after 0.1"),
        ("time_s,force_N\n0,30\n0.1,x\n", 'F.csv row 3: force_N must be a number, got "x"'),
        ("time_s,force_N\n1,30\n2,30\n", "F.csv row 2: time_s must start at 0, got 1"),
    ],
)
def test_a_bad_force_file_is_one_message_exit_2_and_no_output(
    examples: Path, tmp_path: Path, capsys: Capture, text: str, message: str
) -> None:
    write_text(tmp_path / "F.csv", text)
    assert play(examples, tmp_path / "F.csv", tmp_path / "O.csv") == 2
    assert capsys.readouterr().err.startswith(f"error: {message}")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["F.csv"]


def test_the_result_never_replaces_an_input(examples: Path, force: Path, capsys: Capture) -> None:
    assert play(examples, force, force.parent / "." / "F.csv") == 2
    assert "F.csv is an input of this run" in capsys.readouterr().err
    assert force.read_text(encoding="utf-8") == FORCE


def test_a_single_row_gives_the_row_at_rest(examples: Path, tmp_path: Path) -> None:
    write_text(tmp_path / "F.csv", "time_s,force_N\n0,30\n")
    assert play(examples, tmp_path / "F.csv", tmp_path / "O.csv") == 0
    rows = read_csv(tmp_path / "O.csv", COLUMNS)
    assert [float(rows[name][0]) for name in TENSIONS] == pytest.approx([30.0] * 7)
    assert rows["load_position_m"][0] == pytest.approx(30 / 3000)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupted_run_exits_130_and_leaves_nothing(
    examples: Path, tmp_path: Path, number: signal.Signals
) -> None:
    write_csv(tmp_path / "F.csv", {"time_s": np.array([0.0, 20_000.0]), "force_N": np.array([30.0, 60.0])})
    command = [sys.executable, "-m", "tendonff.compensator.cli", "simulate", str(examples / "finger.toml")]
    command += ["--force", str(tmp_path / "F.csv"), "--out", str(tmp_path / "O.csv")]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as process:
        for _ in range(300):
            if any(path.stat().st_size > 0 for path in tmp_path.glob(".O.csv*")):
                break
            time.sleep(0.05)
        assert process.poll() is None
        process.send_signal(number)
        _, message = process.communicate(timeout=30)
    assert process.returncode == 130
    assert message.strip() == "interrupted; nothing was written"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["F.csv"]


PROFILE = "time_s,reference_N,force_none_N,force_inverse_N,force_optimal_N\n0,30,30,30,30\n0.2,31,31,40,50\n"


@pytest.mark.parametrize(("options", "last"), [((), 50.0), (("--force-column", "force_inverse_N"), 40.0)])
def test_a_profile_is_played_by_its_optimal_column_unless_another_is_named(
    examples: Path, tmp_path: Path, capsys: Capture, options: tuple[str, ...], last: float
) -> None:
    write_text(tmp_path / "profile.csv", PROFILE)
    assert play(examples, tmp_path / "profile.csv", tmp_path / "O.csv", *options) == 0
    assert read_csv(tmp_path / "O.csv", COLUMNS)["force_N"][-1] == pytest.approx(last)
    said = "profile.csv: simulating force_optimal_N (--force-column for force_none_N, force_inverse_N)"
    assert (said in capsys.readouterr().err) is not bool(options)


def test_a_file_whose_force_is_ambiguous_is_asked_about(examples: Path, tmp_path: Path, capsys: Capture) -> None:
    write_text(tmp_path / "p.csv", "time_s,force_none_N,force_capstan_N\n0,30,30\n0.1,31,31\n")
    assert play(examples, tmp_path / "p.csv", tmp_path / "O.csv") == 2
    assert 'choose with --force-column "force_none_N"' in capsys.readouterr().err


SERVO = 'drive = "position"\nservo_stiffness_N_per_m = 2e5\n'


def test_a_servo_is_simulated_under_its_command(examples: Path, tmp_path: Path) -> None:
    """The force that a force drive is given is what the servo gives under travel + (F - T0)/k."""
    text = (examples / "finger.toml").read_text(encoding="utf-8")
    write_text(tmp_path / "servo.toml", text.replace("force_rate_max", f"{SERVO}force_rate_max", 1))
    write_text(tmp_path / "F.csv", FORCE)
    assert play(examples, tmp_path / "F.csv", tmp_path / "forced.csv") == 0
    forced = read_csv(tmp_path / "forced.csv", COLUMNS)
    travel = forced["actuator_position_m"] - forced["actuator_position_m"][0]
    command = travel + (forced["force_N"] - 30.0) / 2e5
    write_csv(tmp_path / "C.csv", {"time_s": forced["time_s"], "command_m": command})
    assert play(tmp_path, tmp_path / "C.csv", tmp_path / "commanded.csv", name="servo") == 0
    commanded = read_csv(tmp_path / "commanded.csv", COLUMNS)
    for name in COLUMNS[1:]:
        assert commanded[name] == pytest.approx(forced[name], abs=1e-6)
