"""The exported inverse of a finger on emulated controllers: instructions, and the host's answers."""

import numpy as np
import pytest

from tendonff.compensator.compensators.motors.finger import FingerTask
from tendonff.compensator.export.finger.text import finger_module
from tendonff.compensator.scenarios import load_scenario
from tendonff.ocp.codegen.precision import Precision

pytestmark = pytest.mark.compiler

MOST = {("m4f", "turn"): 60_000, ("m7", "reference"): 50_000, ("m7", "turn"): 82_000, ("m4f", "reference"): 40_000}


@pytest.fixture
def module(toolbox, examples, tmp_path):
    """Folder with the module of a finger, and its course: the reference, or a piece of it and the way back."""

    def folder(board, course):
        target = tmp_path / f"{board.machine}{course}"
        target.mkdir()
        task = FingerTask.of(load_scenario(examples / "three_joint_finger.toml"))
        made = finger_module([task], [task.problem(task.finger)], board.precision, "tff")
        for name, text in made.files.items():
            (target / name).write_text(text)
        suffix = "f" if board.precision is Precision.FLOAT else ""
        angle = task.wanted_rad[:400]
        rows = task.wanted_rad[:1200] if course == "reference" else np.concatenate([angle, angle[::-1]])
        lines = ",\n".join("{ " + ", ".join(f"{v:.17e}{suffix}" for v in row) + " }" for row in rows)
        course = f"#define ROWS {len(rows)}\nstatic const tff_real course[ROWS][{angle.shape[1]}] = {{\n{lines}\n}};\n"
        (target / "course.h").write_text(course)
        return target

    return folder


@pytest.mark.each_value
@pytest.mark.parametrize(("board", "course"), list(MOST))
def test_a_step_of_three_joints_and_four_tendons_takes_at_most_60000_instructions_in_float(
    toolbox, module, board, course, record_property
):
    """Twelve masses a tendon, the most of all calls, also where joints turn back at speed within a sample."""
    ceiling, board = MOST[board, course], getattr(toolbox, board)
    source = module(board, course)
    there, image = toolbox.on_board(board, source, source, kinds=("finger",))
    here = toolbox.on_host(source, source, board.precision, kinds=("finger",))
    assert there.shown.shape == here.shown.shape
    assert np.abs(there.shown - here.shown).max() < (1e-3 if board is toolbox.m4f else 1e-9)
    symbols = toolbox.run("arm-none-eabi-nm", image).stdout
    assert board is not toolbox.m4f or not [s for s in symbols.split() if s.startswith("__aeabi_d")]
    _, most, mean = there.counts["finger"]
    record_property("figure", f"{board.name}, 3 x 4 x 12, {course}: {mean:.0f} instructions a step, {most} at most")
    assert most <= ceiling
