"""`tendonff example`."""

from pathlib import Path

import pytest

import tendonff as tf
from tendonff.compensator.cli import run
from tendonff.compensator.door import look_at

ROOT = Path(__file__).resolve().parents[3]
NAMES = sorted(path.stem for path in (ROOT / "examples").glob("*.toml"))


@pytest.mark.parametrize("name", NAMES)
def test_every_example_is_written_with_the_files_that_it_names(name: str, tmp_path: Path) -> None:
    assert run(["example", name, "--out", str(tmp_path)]) == 0
    path = tmp_path / f"{name}.toml"
    assert (tmp_path / f"{name}.toml").read_bytes() == (ROOT / "examples" / f"{name}.toml").read_bytes()
    look_at(tf.load_scenario(path))  # reads the files that it names


def test_without_a_name_the_examples_are_listed(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["example"]) == 0
    assert [line.split()[0] for line in capsys.readouterr().out.splitlines()] == NAMES


def test_an_unknown_example_is_refused_with_the_nearest(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["example", "fingr"]) == 2
    assert 'no example "fingr", did you mean "finger"?' in capsys.readouterr().err


def test_a_file_that_exists_is_replaced_only_on_request(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "finger.toml").write_text("mine", encoding="utf-8")
    assert run(["example", "finger", "--out", str(tmp_path)]) == 2
    assert "exists; choose another folder" in capsys.readouterr().err
    assert (tmp_path / "finger.toml").read_text(encoding="utf-8") == "mine"
    assert run(["example", "finger", "--out", str(tmp_path), "--force"]) == 0
    assert tf.load_scenario(tmp_path / "finger.toml").name
