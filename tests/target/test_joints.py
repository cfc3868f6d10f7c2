"""The exported inverse on a moving path, on emulated controllers: bits and instructions."""

from dataclasses import replace

import numpy as np
import pytest

from tendonff.compensator.compensators.base import Problem
from tendonff.compensator.export.modules import c_modules
from tendonff.compensator.export.text.c_text import c_sources
from tendonff.compensator.scenarios import load_scenario

pytestmark = pytest.mark.compiler


@pytest.fixture
def inverse(toolbox, examples, tmp_path):
    """Folder with the inverse of the moving finger, or of the same finger at rest in one section, and its course."""
    scenario = load_scenario(examples / "finger_moving.toml")

    def folder(board, segments, moving):
        path, joints = replace(scenario.transmission.path, segments=segments), scenario.joints
        if not moving:
            path, joints = replace(path, sections=()), {}
        made = replace(scenario, transmission=replace(scenario.transmission, path=path), joints=joints)
        problem = Problem.of(made)
        module = next(m for m in c_modules(made) if m.name == "inverse")
        target = tmp_path / f"{board.machine}{segments}{moving}"
        target.mkdir()
        for name, text in c_sources(made, problem, (module,), board.precision, "tff").items():
            (target / name).write_text(text)
        toolbox.write_reference(target, problem.reference.tension_N, board.precision)
        motion = problem.chain.motion
        angles = np.empty((0, 0)) if motion is None else motion.at(problem.reference.time_s)
        rows = ",\n".join(f"{{ {', '.join(f'(tff_real){q:.17g}' for q in row)} }}" for row in angles)
        text = f"static const tff_real joints[ROWS][TFF_JOINTS] = {{\n{rows}\n}};\n" if moving else ""
        (target / "joints.h").write_text(text)
        return target

    return folder


FIRST_RELEASE = {"m4f": {6: 924, 12: 1644, 40: 5006}, "m7": {6: 845, 12: 1499, 40: 4471}}
"""Most instructions of a call of the inverse of 0.1.0 on a path at rest, measured with GCC 12.2."""


@pytest.mark.each_value
@pytest.mark.parametrize("board", ["m4f", "m7"])
@pytest.mark.parametrize("segments", [6, pytest.param(12, marks=pytest.mark.nightly), 40])
def test_joints_cost_at_most_three_tenths_of_what_the_inverse_took_in_the_first_release(
    toolbox, inverse, board, segments, record_property
):
    """Two joints, four sections that touch; the most of all calls. At rest it takes no more than it did."""
    first, board = FIRST_RELEASE[board][segments], getattr(toolbox, board)
    most = {}
    for moving in (False, True):
        source = inverse(board, segments, moving)
        there, _ = toolbox.on_board(board, source, source, kinds=("inverse",))
        assert there.hashes == toolbox.on_host(source, source, board.precision, kinds=("inverse",)).hashes
        most[moving] = there.counts["inverse"][1]
    record_property(
        "figure",
        f"{board.name}, N = {segments}, joints: {most[True]} = {most[True] / first:.2f} of 0.1.0 at rest, "
        f"{most[True] / most[False]:.2f} of {most[False]} at rest",
    )
    assert most[False] <= first
    assert most[True] <= 1.3 * first
