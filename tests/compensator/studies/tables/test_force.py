"""`tendonff table`: what it says and writes."""

import csv
import io
import shutil
import subprocess
from dataclasses import replace

import numpy as np
import pytest

from tendonff.compensator.cli import run
from tendonff.compensator.compensators.base import Problem
from tendonff.compensator.compensators.expectation import two_digits
from tendonff.compensator.compensators.plant import FINE_SEGMENTS, Plant
from tendonff.compensator.compensators.score import verify
from tendonff.compensator.compensators.table import CompensationTable
from tendonff.compensator.files.writing import csv_text
from tendonff.compensator.scenarios import load_scenario
from tendonff.compensator.studies.tables.force import ForceTables
from tendonff.compensator.studies.tables.force_pages import table_columns
from tendonff.models.capstan import Branch
from tendonff.models.fidelity import Level
from tendonff.ocp.errors import SolveError


@pytest.fixture(scope="module")
def finger(examples):
    return load_scenario(examples / "finger.toml")


@pytest.fixture(scope="module")
def tables(finger):
    return ForceTables.made(finger)


def test_as_a_compensator_it_leaves_less_than_half_a_percent_where_the_static_law_leaves_ten(tables):
    assert tables.scores[tables.level].rmse_percent_of_range < 0.5


def test_its_first_sentence_is_the_worst_case_over_the_friction_and_not_the_model_against_itself(tables, finger):
    """The plant with 10 % less friction, simulated apart."""
    friction = finger.transmission.friction
    softer = replace(
        finger.transmission,
        friction=replace(friction, mu_dynamic=0.9 * friction.mu_dynamic, mu_static=0.9 * friction.mu_static),
    )
    profile = CompensationTable(tables.tables[0].built.table).profile(Problem.of(finger))
    apart = verify(Plant(softer, tables.level, FINE_SEGMENTS), "table", profile, tables.reference).score
    worst = tables.expectation.worst_percent
    assert worst["table"] == pytest.approx(apart.rmse_percent_of_range, rel=1e-6)
    assert f"({two_digits(worst['table'])} % of range)" in tables.headline
    assert f"{two_digits(worst['frictionless'])} % without friction compensation" in tables.headline


@pytest.mark.compiler
def test_a_table_that_does_harm_is_called_so_and_the_limit_named(finger):
    slow = replace(finger.transmission.actuator, force_rate_max_N_per_s=40.0)
    made = ForceTables.made(
        replace(finger, transmission=replace(finger.transmission, actuator=slow)), level=Level.ELASTIC
    )
    said = "\n".join(made.warnings)
    worst = made.expectation.worst_percent
    assert worst["table"] > worst["none"]
    assert "more than the reference applied directly" in said
    assert "needs" in said
    assert "at the actuator, limit 40" in said
    assert made.harm


def test_the_command_writes_a_table_that_does_harm_only_if_forced(examples, tmp_path, capsys):
    text = (examples / "finger.toml").read_text(encoding="utf-8")
    text = text.replace("force_rate_max_N_per_s = 100000.0", "force_rate_max_N_per_s = 40.0")
    (tmp_path / "slow.toml").write_text(text, encoding="utf-8")
    command = ["table", str(tmp_path / "slow.toml"), "--level", "elastic", "--out", str(tmp_path / "out")]
    assert run(command) == 1
    said = capsys.readouterr().err
    assert "at the actuator, limit 40" in said
    assert "more than the reference applied directly" in said.splitlines()[-1]
    assert "--force writes it all the same" in said.splitlines()[-1]
    assert not (tmp_path / "out").exists()
    assert run([*command, "--force"]) == 0
    assert (tmp_path / "out" / "table.csv").exists()


def rows_of(tables):
    """The rows of `table.csv`, as a program reads them."""
    columns = table_columns(tables)
    text = csv_text(columns, zip(*columns.values(), strict=True))
    return list(csv.DictReader(io.StringIO(text)))


def test_the_csv_has_the_agreed_columns_no_empty_cell_and_reads_back(tables):
    rows = rows_of(tables)
    assert list(rows[0]) == ["reference_N", "branch", "tension_since_reversal_N", "force_N", "share"]
    assert {row["branch"] for row in rows} == {"pull", "release"}
    assert all(np.isfinite(float(row[name])) for row in rows for name in row if name != "branch")
    table = tables.tables[0].built.table
    for branch in Branch:
        ours = [row for row in rows if row["branch"] == branch]
        assert [float(row["force_N"]) for row in ours] == table.branch(branch).force_N.ravel().tolist()
        assert [float(row["share"]) for row in ours] == np.tile(
            table.branch(branch).share, table.reference_N.size
        ).tolist()
        travelled = table.branch(branch).share * (table.reference_N[:, None] + table.adhesion_N)
        assert [float(row["tension_since_reversal_N"]) for row in ours] == travelled.ravel().tolist()


@pytest.mark.compiler
def test_angles_and_rates_become_further_columns(finger):
    tables = ForceTables.made(finger, level=Level.VISCOELASTIC, bound=0.5, angles_rad=(1.0, 3.0), rates=(5.0, 50.0))
    rows = rows_of(tables)
    assert {(row["total_angle_rad"], row["rate_N_per_s"]) for row in rows} == {
        (a, r) for a in ("1.0", "3.0") for r in ("5.0", "50.0")
    }
    ratios = [run.built.table.ratio(Branch.PULL)[:, -1].mean() for run in tables.tables]
    assert ratios[0] == pytest.approx(np.exp(0.2 * 1.0), abs=0.03)
    assert ratios[2] == pytest.approx(np.exp(0.2 * 3.0), abs=0.03)


@pytest.mark.compiler
def test_every_branch_has_five_references_and_two_tables_have_names_of_their_own(finger, tmp_path):
    """Two scenarios in one file of C: other guards, and with other prefixes no name twice."""
    stiffer = replace(finger.transmission.load, stiffness_N_per_m=2000.0)
    other = replace(finger, transmission=replace(finger.transmission, load=stiffer))
    guards = []
    for k, scenario in enumerate((finger, other)):
        tables = ForceTables.made(scenario, level=Level.ELASTIC, bound=2.0)
        assert tables.tables[0].built.table.reference_N.size >= 5
        tables.write(tmp_path / str(k), prefix=f"rig{k}")
        text = (tmp_path / str(k) / "table.h").read_text()
        guards.append(text[text.index("#ifndef") :].split()[1].replace(f"RIG{k}", ""))
    assert guards[0] != guards[1]
    both = "(int)(sizeof rig0_table_pull_share == sizeof rig1_table_pull_ratio)"
    main = f'#include "0/table.h"\n#include "1/table.h"\nint main(void) {{ return {both}; }}\n'
    (tmp_path / "main.c").write_text(main)
    if shutil.which("cc") is not None:
        subprocess.run(["cc", "-std=c99", "-Wno-unused", "-Werror", "-c", "main.c"], check=True, cwd=tmp_path)


def test_a_load_without_stiffness_is_refused_in_words(finger):
    slack = replace(finger.transmission.load, stiffness_N_per_m=1e-308)
    with pytest.raises(SolveError, match="forces that are not finite; check the stiffness"):
        ForceTables.made(replace(finger, transmission=replace(finger.transmission, load=slack)))
