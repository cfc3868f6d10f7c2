"""Modules beside the inverse in exports of driven joints: profile and table, and the one list that they stand in."""

import re
from pathlib import Path

import numpy as np
import pytest

from tendonff.compensator.compensators.motors.joint import JointTask
from tendonff.compensator.compensators.motors.table import tabulated
from tendonff.compensator.export.driven import modules
from tendonff.compensator.export.driven.module import Content, Designed, Module
from tendonff.compensator.export.driven.table import LiveTable
from tendonff.compensator.export.joint.project import export_joints
from tendonff.compensator.export.motors import JudgedJoint
from tendonff.compensator.export.script import Script
from tendonff.ocp.codegen.precision import Precision

from .test_joint_export import changed, make

pytestmark = pytest.mark.compiler


@pytest.fixture(scope="module")
def pair(tmp_path_factory):
    """Two tendons behind motors with play and a limit of their speed."""
    source = Path(__file__).parents[3] / "examples" / "instrument_pair.toml"
    changes = (("[drive]\n", "[drive]\nbacklash_rad = 0.02\n"), ("max_rad_per_s = 50.0", "max_rad_per_s = 4.0"))
    return changed(source, tmp_path_factory.mktemp("pair") / "pair.toml", *changes)


@pytest.fixture(scope="module")
def exported(pair):
    return export_joints(pair)


def test_profile_and_table_answer_as_python_does_and_their_tests_notice_a_number_that_is_off(exported, tmp_path):
    exported.write(tmp_path)
    done = make(tmp_path, "test")
    assert done.returncode == 0, done.stdout + done.stderr
    for name in ("profile", "table"):
        code = tmp_path / f"tff_{name}_data.h"
        text = code.read_text()
        found = re.search(r"(?<=, )-?0\.[1-9]\d{8,}(?=,)", text).group(0)
        code.write_text(text.replace(found, f"{float(found) + 1e-6!r}"))
        assert f"passes {name}_0: golden vectors, " in done.stdout
        assert f"FAILS  {name}_0: golden vectors; row " in make(tmp_path, "test").stdout
        code.write_text(text)


def test_the_table_is_the_quasi_static_law_once_the_joint_turns_one_way(pair):
    """Twice the play apart on the branches at least; away from reversals live and known ahead are one."""
    task = JointTask.of(pair)
    live, angle = LiveTable.of(task), task.sampled.angle_rad
    ways = np.array(live.ways(angle, Precision.DOUBLE))
    wanted = tabulated(task).command(task)
    still, turns = live.branch_rad[1], np.sign(live.branch_rad[1][-1] - live.branch_rad[1][0])
    offset = np.column_stack([np.interp(angle[0], live.angle_rad, column) for column in still.T])
    found = np.stack(
        [
            np.column_stack([np.interp(angle, live.angle_rad, column) for column in branch.T])
            for branch in live.branch_rad
        ]
    )[ways + 1, np.arange(len(angle))]
    steady = (ways != 0) & (ways == np.sign(np.gradient(angle)))
    assert steady.mean() > 0.9
    play = ways[:, None] * turns * task.mechanism.drive.play_rad / 2
    assert (found - play)[steady] == pytest.approx(wanted[steady], abs=1e-12)
    assert offset == pytest.approx(np.zeros_like(offset), abs=1e-12)


def test_the_table_does_not_turn_with_noise_and_keeps_the_speed_limit(pair):
    task = JointTask.of(pair)
    live = LiveTable.of(task)
    middle = float(live.angle_rad.mean())
    ramp = np.linspace(middle, middle + 0.2, 200)
    noisy = ramp + 0.4 * live.turning_rad * np.random.default_rng(3).uniform(-1, 1, 200)
    assert set(live.ways(noisy, Precision.DOUBLE)[20:]) == {1}
    command, binds = live.respond(np.concatenate([ramp, ramp[::-1]]), Precision.DOUBLE)
    assert binds.any()
    assert np.abs(np.diff(command, axis=0)).max() <= live.change_rad * (1 + 1e-12)


def test_a_module_is_one_entry_and_goes_with_it(pair, exported, tmp_path, monkeypatch):
    """Header, checks, build files and README are made from its record; what else there is stays to the byte."""
    echo = Module(
        name="echo",
        content="the number one",
        about=("An example.",),
        state=(),
        build=lambda designed, data: Content(  # noqa: ARG005
            record=["1"],
            given=np.empty((1, 0)),
            command_rad=np.ones((1, len(designed.task.motors))),
            status=np.zeros(1, dtype=np.int64),
        ),
    )
    fixed, known = modules.core_file, modules.MODULES
    monkeypatch.setattr(
        modules, "core_file", lambda name, prefix: "/* fixed */\n" if "echo" in name else fixed(name, prefix)
    )
    monkeypatch.setattr(modules, "MODULES", (*known, echo))
    files = export_joints(pair).files
    added = {f"tff_echo{end}" for end in (".h", ".c", "_data.h")}
    assert set(files) - set(exported.files) == added
    differ = {name for name, text in exported.files.items() if files[name] != text}
    assert differ == {"Makefile", "CMakeLists.txt", "README.md", "self_test_data.h"}
    assert all("echo" in files[name] for name in differ)
    assert "tff_echo_init(tff_echo *self, int32_t which)" in files["tff_echo.h"]


def test_a_table_that_is_worse_than_the_ratio_is_left_out_with_a_warning(pair, monkeypatch):
    monkeypatch.setattr(modules, "rms_of", lambda task, command: 1.0)  # noqa: ARG005
    task = JointTask.of(pair)
    judged = JudgedJoint(name="wrist", rms=0.01, plain_rms=0.02, range=0.8, is_angle=True, fault="")
    found = modules.modules_beside(
        [Designed(task=task, motor_rad=task.lengths_rad)],
        [judged],
        prefix="tff",
        script=Script(precision=Precision.DOUBLE, prefix="tff"),
        include="tff_joint.h",
        provenance="",
    )
    assert "tff_table.c" not in found.files
    assert found.warnings == (
        "the module table is left out: the RMS error of wrist is 57 deg, by the ratio alone 1.1 deg",
    )
