from pathlib import Path

import pytest
import typer

from tendonff.compensator.cli import app, run
from tendonff.compensator.cli.options import opened
from tendonff.compensator.files.text import InputError
from tendonff.models.errors import ParameterError, TendonffError
from tendonff.ocp.errors import SolveError

Capture = pytest.CaptureFixture[str]


def stderr_of(capsys: Capture) -> str:
    text = capsys.readouterr().err
    assert "Traceback" not in text
    return text


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["simulat"], "No such command 'simulat'"),
        (["simulate", "x.toml"], "Missing option '--"),
        (["simulate", "x.toml", "--force", "f", "--out", "o", "--level", "soft"], "'soft' is not one of 'elastic'"),
        (["simulate", "x.toml", "--nonsense"], "No such option"),
        (["new"], "Missing argument 'FILE.toml'"),
        (["identify", "x.toml", "log.csv"], "(log.csv); for instance: tendonff identify mine.toml --data log.csv"),
    ],
)
def test_a_bad_command_line_is_one_message_and_exit_2(capsys: Capture, arguments: list[str], message: str) -> None:
    assert run(arguments) == 2
    text = stderr_of(capsys)
    assert text.startswith("error: ")
    assert message in text
    assert len(text.splitlines()) == 1


def test_design_takes_a_reference_out_of_reach_unless_it_is_strict(examples: Path, tmp_path: Path) -> None:
    text = (examples / "finger.toml").read_text(encoding="utf-8").replace("force_max_N = 200.0", "force_max_N = 60.0")
    (tmp_path / "weak.toml").write_text(text, encoding="utf-8")
    with opened(tmp_path / "weak.toml", tmp_path / "out", strict=False) as (scenario, _):
        assert scenario.transmission.actuator.force_max_N == 60
    with (
        pytest.raises(InputError, match="force_max_N = 60 delivers at most"),
        opened(tmp_path / "weak.toml", tmp_path / "out2", strict=True),
    ):
        pass
    assert not (tmp_path / "out2").exists()


def test_no_command_shows_the_help(capsys: Capture) -> None:
    assert run([]) == 2
    assert "simulate" in capsys.readouterr().out


def test_help_and_version_succeed(capsys: Capture) -> None:
    assert run(["--help"]) == 0
    assert run(["simulate", "--help"]) == 0
    assert run(["--version"]) == 0
    assert "tendonff 0." in capsys.readouterr().out


@pytest.mark.parametrize(
    ("error", "code", "message"),
    [
        (ParameterError("mass_kg must be > 0"), 2, "error: mass_kg must be > 0"),
        (TendonffError("bad input"), 2, "error: bad input"),
        (SolveError("no force found"), 1, "error: no force found"),
        (KeyboardInterrupt(), 130, "interrupted; nothing was written"),
        (MemoryError(), 1, "not enough memory"),
        (
            OSError(28, "No space left on device", "o.csv"),
            1,
            "error: o.csv: No space left on device; nothing was written",
        ),
    ],
)
def test_what_goes_wrong_becomes_a_message_and_an_exit_code(
    capsys: Capture, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, error: BaseException, code: int, message: str
) -> None:
    def fail(*_: object) -> None:
        raise error

    monkeypatch.setattr("tendonff.compensator.files.writing.write_text", fail)
    assert run(["new", str(tmp_path / "x.toml")]) == code
    assert message in stderr_of(capsys)


def test_the_example_of_every_command_has_its_options_and_required_ones() -> None:
    commands = typer.main.get_command(app).commands
    assert len(commands) > 10
    for name, command in commands.items():
        words = command.epilog.split()
        assert words[:3] == ["Example:", "tendonff", name]
        options = {option: each for each in command.params for option in each.opts if option.startswith("--")}
        used = {word for word in words if word.startswith("--")}
        assert used <= options.keys(), name
        assert {option for option, each in options.items() if each.required} <= used, name


def test_every_command_stands_in_one_group_of_the_help(capsys: Capture) -> None:
    assert run(["--help"]) == 0
    said = capsys.readouterr().out
    assert [line for line in said.splitlines() if line in ("Model:", "Decide:", "Rig:", "Deploy:")]
    for name in typer.main.get_command(app).commands:
        assert sum(line.startswith(f"  {name} ") for line in said.splitlines()) == 1, name
