"""Force files and references as loggers and spreadsheets write them, through the commands: read, or asked about."""

from dataclasses import replace

import numpy as np
import pytest

from tendonff.compensator.cli import run
from tendonff.compensator.scenario.reference import CsvReference
from tendonff.compensator.scenario.sampled.sampling import sample_reference
from tendonff.compensator.scenario.scenario import load_scenario

pytestmark = pytest.mark.compiler
TIME, VALUE = np.arange(0, 0.101, 0.01), 30 + 5 * np.arange(11) / 10


def table(separator: str = ",", *, decimal: str = ".", head: str = "time_s,{}_N", time: float = 1.0, unit: float = 1.0):
    def number(value: float) -> str:
        return f"{value:.6f}".replace(".", decimal)

    rows = [separator.join((number(t * time), number(v * unit))) for t, v in zip(TIME, VALUE, strict=True)]
    return "\n".join([head.replace(",", separator), *rows]) + "\n"


READ = {
    "plain": table(),
    "semicolons and decimal commas": table(";", decimal=","),
    "semicolons": table(";"),
    "tabs": table("\t"),
    "bars": table("|"),
    "spaces": table(" "),
    "remarks": "# bench 3\n% second try\n// third\n" + table(),
    "a line of units": table(head="time_s,{}_N\ns,N"),
    "lines above the header": "Logger;3\nDate;2026-01-01\n" + table(";"),
    "milliseconds by header": table(head="time_ms,{}_N", time=1e3),
    "kilonewtons by header": table(head="time_s,{} [kN]", unit=1e-3),
}
ASKED = {
    "no time": (table(head="x,{}_N"), "time"),
    "no value": (table(head="time_s,y"), "column"),
    "text among the numbers": (table().replace("30.500000", "broken"), "broken"),
    "time that falls": (table().replace("0.020000", "0.000500"), "increase"),
    "an empty file": ("", "empty"),
}


def words(text: str, name: str) -> str:
    return text.replace("{}", name)


@pytest.fixture(scope="module")
def expected(examples, tmp_path_factory):
    folder = tmp_path_factory.mktemp("plain")
    (folder / "f.csv").write_text(words(READ["plain"], "force"))
    argv = ["simulate", str(examples / "finger.toml"), "--force", str(folder / "f.csv"), "--out", str(folder / "o.csv")]
    assert run(argv) == 0
    return (folder / "o.csv").read_text()


@pytest.mark.parametrize("form", READ)
def test_every_form_is_read_as_force_and_as_reference(examples, tmp_path, expected, form):
    (tmp_path / "f.csv").write_text(words(READ[form], "force"))
    argv = [
        "simulate",
        str(examples / "finger.toml"),
        "--force",
        str(tmp_path / "f.csv"),
        "--out",
        str(tmp_path / "o.csv"),
    ]
    assert run(argv) == 0
    assert (tmp_path / "o.csv").read_text() == expected
    (tmp_path / "r.csv").write_text(words(READ[form], "tension"))
    scenario = load_scenario(examples / "finger.toml")
    scenario = replace(scenario, reference=CsvReference(file=str(tmp_path / "r.csv")))
    assert sample_reference(scenario).tension_N[::10] == pytest.approx(VALUE, rel=1e-9)


@pytest.mark.parametrize("form", ASKED)
def test_what_cannot_be_read_is_answered_with_one_message(examples, tmp_path, capsys, form):
    text, hint = ASKED[form]
    (tmp_path / "f.csv").write_text(words(text, "force"))
    argv = [
        "simulate",
        str(examples / "finger.toml"),
        "--force",
        str(tmp_path / "f.csv"),
        "--out",
        str(tmp_path / "o.csv"),
    ]
    assert run(argv) == 2
    said = capsys.readouterr().err.strip()
    assert said.count("error:") == 1
    assert "f.csv" in said
    assert hint in said
    assert not (tmp_path / "o.csv").exists()
