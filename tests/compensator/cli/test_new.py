import re
from pathlib import Path

import pytest

from tendonff.compensator.cli import run
from tendonff.compensator.scenario.sampled.sampling import sample_reference
from tendonff.compensator.scenarios import load_scenario


def test_a_new_scenario_is_valid_and_can_be_delivered(tmp_path: Path) -> None:
    assert run(["new", str(tmp_path / "mine.toml")]) == 0
    assert sample_reference(load_scenario(tmp_path / "mine.toml")).range_N > 0


@pytest.mark.parametrize("rig", ["tendon", "bowden", "surgical", "exosuit"])
def test_a_scenario_for_a_rig_has_plausible_values_that_can_be_delivered(tmp_path: Path, rig: str) -> None:
    path = tmp_path / "mine.toml"
    assert run(["new", str(path), "--for", rig]) == 0
    scenario = load_scenario(path)
    assert all("least_tension_N" in note for note in sample_reference(scenario).warnings)
    assert scenario.transmission.actuator.motor is not None
    text = path.read_text(encoding="utf-8")
    assert all("#" in line for line in text.splitlines() if line.startswith(("elastic", "mu_dynamic", "drum_radius")))


def test_the_example_of_an_exosuit_is_what_new_writes(tmp_path: Path, examples: Path) -> None:
    assert run(["new", str(tmp_path / "mine.toml"), "--for", "exosuit"]) == 0
    assert (tmp_path / "mine.toml").read_text(encoding="utf-8") == (examples / "exosuit.toml").read_text(
        encoding="utf-8"
    )


@pytest.mark.parametrize("rig", ["tendon", "bowden", "surgical", "exosuit"])
def test_every_range_names_its_source_or_says_that_it_is_an_estimate(tmp_path: Path, rig: str, examples: Path) -> None:
    assert run(["new", str(tmp_path / "mine.toml"), "--for", rig]) == 0
    body = (tmp_path / "mine.toml").read_text(encoding="utf-8").partition("\nschema")[2]
    comments = re.findall(r"^[^#\n]*# (.*(?:\n +# .*)*)", body, flags=re.MULTILINE)
    guide = (examples.parent / "docs" / "guide" / "parameters.md").read_text(encoding="utf-8")
    ranges = [" ".join(text.replace("#", " ").split()) for text in comments if re.search(r"\d to \d", text)]
    assert len(ranges) > 5
    for text in ranges:
        names = re.findall(r"\(([^()]*[a-z][^()]*)\)", text)
        assert "estimate" in text or "lumped masses" in text or names, text
        for name in names:
            if re.search(r"\.com|\.org|\.de|Strand Core|CTIA|DSM", name):
                assert name.split(",")[0] in guide, name


def test_a_scenario_that_exists_is_replaced_only_on_request(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "mine.toml"
    path.write_text("precious", encoding="utf-8")
    assert run(["new", str(path)]) == 2
    assert "mine.toml exists; choose another name, or replace it with --force" in capsys.readouterr().err
    assert path.read_text(encoding="utf-8") == "precious"
    assert run(["new", str(path), "--force"]) == 0
    assert path.read_text(encoding="utf-8") != "precious"


@pytest.mark.parametrize("command", [["new"], ["simulate", "s.toml", "--force", "f.csv", "--out"]])
def test_a_result_that_would_end_as_another_kind_of_file_is_refused(
    command: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    kind = ".toml" if command == ["new"] else ".csv"
    assert run([*command, "mine.json"]) == 2
    assert f"mine.json must end in {kind}, as what is written is; try mine{kind}" in capsys.readouterr().err
