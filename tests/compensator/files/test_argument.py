"""A path in a message is what a command in this folder would take."""

from pathlib import Path

import pytest

from tendonff.compensator.files.text import as_argument


def test_below_the_working_folder_it_is_relative_and_quoted_elsewhere_its_name_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    assert as_argument(Path("fit") / "fitted.toml") == "fit/fitted.toml"
    assert as_argument(tmp_path / "here" / "my fit" / "fitted.toml") == "'my fit/fitted.toml'"
    assert as_argument(tmp_path / "there" / "finger.toml") == "finger.toml"
