"""The exported inverse of a joint on emulated controllers: bits and instructions."""

import numpy as np
import pytest

from tendonff.compensator.export.joint.text import joint_sources
from tendonff.compensator.scenario.driven.joint import sample_joint
from tendonff.compensator.scenarios import load_scenario

pytestmark = pytest.mark.compiler

MOST = {"m4f": 9000, "m7": 11000}


@pytest.fixture
def module(toolbox, examples, tmp_path):
    """Folder with the module of a joint, and its course there and back with jumps of the reference."""

    def folder(board, example):
        target = tmp_path / f"{board.machine}{example}"
        target.mkdir()
        scenario = load_scenario(examples / f"{example}.toml")
        for name, text in joint_sources((scenario,), precision=board.precision).items():
            (target / name).write_text(text)
        angle = sample_joint(scenario).angle_rad
        toolbox.write_reference(target, np.concatenate([angle, angle[::-2], angle[::5]]), board.precision)
        return target

    return folder


@pytest.mark.each_value
@pytest.mark.parametrize("board", ["m4f", "m7"])
@pytest.mark.parametrize("example", ["hand_joint", "instrument_pair"])
def test_a_step_of_a_joint_takes_at_most_9000_instructions_in_float(toolbox, module, board, example, record_property):
    """Six masses a tendon of the hand, eight of the instrument in two sections; the most of all calls, and of those on
    a fast way to and fro. Its sine is another one on the host: the commands agree to rounding."""
    ceiling, board = MOST[board], getattr(toolbox, board)
    source = module(board, example)
    there, _ = toolbox.on_board(board, source, source, kinds=("joint",))
    here = toolbox.on_host(source, source, board.precision, kinds=("joint",))
    assert there.shown.shape == here.shown.shape
    assert np.abs(there.shown - here.shown).max() < (1e-4 if board is toolbox.m4f else 1e-9)
    _, most, mean = there.counts["joint"]
    record_property("figure", f"{board.name}, {example}: {mean:.0f} instructions a step, {most} at most")
    assert most <= ceiling
