"""What a time step of the host costs, in instructions."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest

from tendonff.compensator.scenarios import load_scenario
from tendonff.models.fidelity import Level
from tendonff.models.layout import ChainInputs
from tendonff.models.parameters import Transmission
from tendonff.models.path import JointMotion, Section
from tendonff.models.tendon.chain import Chain
from tendonff.ocp.codegen.compiler import _GCC_FLAGS, _machine_flags
from tendonff.ocp.step.c_engine import _step_source, chain_struct, places_of

pytestmark = pytest.mark.compiler

ROWS, STEP_S, START_N = 500, 1e-3, 40.0
CEILINGS = {6: 3500, 40: 9200}
"""With registers for four numbers: loops that are not made vectors cost half as much again."""


def on_a_joint(rig: Transmission) -> Transmission:
    """The same path in three sections, the middle one on a joint."""
    time = STEP_S * np.arange(ROWS + 1)
    angle = rig.path.total_angle_rad / 3
    middle = Section(name="b", angle_rad=angle, length_m=0.1, joint="j", angle_per_rad=1.0, length_per_rad_m=0.01)
    sections = (replace(middle, name="a", joint=None, angle_per_rad=0.0, length_per_rad_m=0.0), middle)
    sections = (*sections, replace(sections[0], name="c"))
    motion = JointMotion(names=("j",), time_s=time, angle_rad=0.3 * np.sin(4 * time)[:, None])
    return replace(rig, path=replace(rig.path, sections=sections), motion=motion)


def array(kind: str, name: str, values: np.ndarray) -> str:
    texts = (str(v) if kind != "double" else float(v).hex() for v in np.ravel(values))
    return f"static const {kind} {name}[] = {{ {', '.join(texts)} }};\n"


@pytest.fixture
def cost(toolbox, examples, tmp_path, shipped_flags):
    """Instructions of one row."""
    toolbox.need("gcc", "valgrind")
    rig = load_scenario(examples / "finger.toml").transmission
    time = STEP_S * np.arange(ROWS + 1)
    table = ChainInputs.of_force(START_N + 30 * np.sin(4 * math.pi * time) * (1 - np.exp(-20 * time**2))).table()

    def instructions(count: int, moving: bool) -> float:
        chain = Chain.of(on_a_joint(rig) if moving else rig, Level.PRESLIDING, count)
        record, start = chain_struct(chain), chain.rest_state(START_N).vector()
        folder = tmp_path / f"{count}{moving}"
        folder.mkdir()
        (folder / "generated.c").write_text(_step_source(chain))
        case = f"#define STEP_S {STEP_S}\n#define COUNT {count}\n#define SIZE {len(start)}\n"
        case += f"#define PLACES {'places,' if moving else ''}\n"
        case += array("unsigned char", "record", np.frombuffer(record, np.uint8)) + array("double", "start", start)
        of_masses, run_end = record.kept_alive
        case += array("double", "of_masses", of_masses) + array("int", "run_end", run_end)
        case += array("double", "inputs", table)
        case += "".join(array("double", "places", p) for p in places_of(chain, 0.0, STEP_S, ROWS))
        (folder / "case.h").write_text(case)
        flags = [flag for flag in (*shipped_flags, *_machine_flags(), *_GCC_FLAGS) if flag not in ("-shared", "-fPIC")]
        toolbox.run(
            *("gcc", *flags, "-w", "-I", folder, toolbox.here / "step_cost.c", "-o", folder / "run", "-lm"),
        )

        def total(rows: int) -> int:
            counter = ("valgrind", "--tool=callgrind", f"--callgrind-out-file={folder / 'out'}")
            said = toolbox.run(*counter, folder / "run", str(rows)).stderr
            return int(re.search(r"Collected : (\d+)", said)[1])

        return (total(ROWS) - total(0)) / ROWS

    return instructions


@pytest.mark.parametrize("count", [6, pytest.param(40, marks=pytest.mark.nightly)])
def test_a_step_on_a_moving_path_costs_at_most_thirteen_tenths_of_one_at_rest(cost, count, record_property):
    rest, moving = cost(count, False), cost(count, True)
    record_property("figure", f"step at N = {count}: {rest:.0f} instructions at rest, {moving:.0f} on a moving path")
    if _machine_flags():
        assert rest <= CEILINGS[count]
    assert moving <= 1.3 * rest
