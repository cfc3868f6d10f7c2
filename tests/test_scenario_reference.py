"""The reference of scenario files holds every table and every key that the reader takes."""

import dataclasses
import runpy
from pathlib import Path

import pytest

from tendonff.compensator.scenario import joints, scenario
from tendonff.compensator.scenario.driven import reference as joint_reference

ROOT = Path(__file__).resolve().parents[1]
PAGE = runpy.run_path(str(ROOT / "docs" / "scenario_reference.py"))
READ = {
    *scenario._TABLES.values(),
    *scenario._OPTIONAL.values(),
    *scenario._ON_REQUEST.values(),
    *scenario._KINDS.values(),
    *joints.KINDS.values(),
    *joint_reference.KINDS.values(),
}


def test_every_table_that_is_read_is_in_it() -> None:
    assert {cls for table in PAGE["TABLES"] for cls in table.classes} >= READ


@pytest.mark.parametrize("table", PAGE["TABLES"], ids=lambda table: table.title)
def test_every_key_has_a_meaning_and_its_own_default(table) -> None:
    rows = {key: (unit, default, meaning) for key, unit, default, meaning in PAGE["rows"](table)}
    keys = {field.name: field for cls in table.classes for field in dataclasses.fields(cls)}
    assert rows.keys() == keys.keys() - set(table.unwritten)
    for key, (_, default, meaning) in rows.items():
        assert len(meaning) > 8, key
        missing = keys[key].default is dataclasses.MISSING and keys[key].default_factory is dataclasses.MISSING
        assert (default == "required") == (missing and key not in table.filled), key


def test_the_stored_table_of_keys_is_that_of_the_code() -> None:
    """After a change: python docs/scenario_reference.py."""
    assert (ROOT / "docs" / "scenario_keys.csv").read_text(encoding="utf-8") == PAGE["as_csv"]()


def test_no_meaning_refers_to_a_class() -> None:
    assert [row for table in PAGE["TABLES"] for row in PAGE["rows"](table) if row[3].startswith("As in")] == []


@pytest.mark.parametrize(
    ("title", "key", "unit"),
    [
        ("[tendon]", "second_relaxation_time_s", "s"),
        ("[tendon]", "stiffening_tension_N", "N"),
        ("[actuator.motor]", "no_load_speed_rad_per_s", "rad/s"),
        ("[measurement]", "channels", ""),
    ],
)
def test_a_key_that_shares_its_meaning_has_its_own_unit(title: str, key: str, unit: str) -> None:
    table = next(table for table in PAGE["TABLES"] if table.title == title)
    assert {name: own for name, own, *_ in PAGE["rows"](table)}[key] == unit


def test_units_stand_in_their_own_column() -> None:
    path = next(table for table in PAGE["TABLES"] if table.title == "[friction]")
    rows = {key: (unit, meaning) for key, unit, _, meaning in PAGE["rows"](path)}
    assert rows["stribeck_velocity_m_per_s"][0] == "m/s"
    assert "[" not in rows["stribeck_velocity_m_per_s"][1]
