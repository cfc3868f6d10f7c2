"""The exported tuner on emulated controllers: the answers of Python, and what a step costs."""

from dataclasses import replace

import numpy as np
import pytest

from tendonff.compensator.compensators.base import Problem
from tendonff.compensator.compensators.tuning import tuned_chain, tuning_of
from tendonff.compensator.export.modules import ADAPTIVE
from tendonff.compensator.export.text.c_text import c_sources
from tendonff.compensator.scenarios import load_scenario
from tendonff.ocp.adaptation.tuner import SelfTuner, SimulatedRig
from tendonff.ocp.adaptation.tuning import Sensor, Tunable
from tendonff.ocp.codegen.precision import Precision

pytestmark = pytest.mark.compiler

MOST = 25_000
"""Instructions of a step with N = 6: 15 % of a period of 1 ms at 168 MHz."""

MOST_FALLING = 55_000
"""Where a load exponent is stated, and every mass takes a power."""

BOTH = (Tunable.MU, Tunable.LOAD_STIFFNESS)
FALLING = (Tunable.MU, Tunable.LOAD_EXPONENT)
STATED = (Tunable.LOAD_EXPONENT, Tunable.MU)  # the same where the scenario has an exponent
APART = (Tunable.MU_PULL, Tunable.MU_RELEASE)


def recorded(problem, settings):
    """References and measurements of a closed loop on a rig with 20 % more friction, noise included."""
    tuning = tuning_of(problem, settings)
    tuned, reference = tuned_chain(problem, tuning), problem.reference
    rig = SimulatedRig(tuned.with_factors({Tunable.MU: 1.2}), reference.step_s, 1, reference.initial_tension_N)
    tuner = SelfTuner(tuned, reference.step_s, tuning, problem.limits, reference.initial_tension_N)
    wanted = reference.tension_N[1:]
    noise = tuning.noise * np.random.default_rng(0).normal(size=len(wanted))
    run = tuner.run(rig, wanted, noise)
    return wanted, run.measured, run.force_N


def angles_of(problem):
    """Joint angles at the ends of the steps; nothing where none moves."""
    motion = problem.chain.motion
    if motion is None:
        return ""
    rows = ", ".join(f"{{ {', '.join(f'{q:.17e}' for q in row)} }}" for row in motion.at(problem.reference.time_s[1:]))
    return f"static const tff_real joints[ROWS][TFF_JOINTS] = {{ {rows} }};\n"


def numbers(kind, name, values):
    rows = ",\n".join(f"({kind}){float(v):.17e}" for v in values)
    return f"static const {kind} {name}[ROWS] = {{\n{rows}\n}};\n"


@pytest.mark.each_value
@pytest.mark.parametrize("board", ["m4f", "m7"])
@pytest.mark.parametrize(
    ("example", "sensor", "parameters"),
    [
        ("finger", Sensor.ACTUATOR_POSITION, (Tunable.MU,)),
        pytest.param("finger", Sensor.ACTUATOR_POSITION, BOTH, marks=pytest.mark.nightly),
        pytest.param("finger", Sensor.ACTUATOR_POSITION, FALLING, marks=pytest.mark.nightly),
        pytest.param("finger", Sensor.ACTUATOR_POSITION, STATED, marks=pytest.mark.nightly),
        ("finger_moving", Sensor.ACTUATOR_POSITION, (Tunable.MU,)),
        ("finger_moving", Sensor.OUTPUT_TENSION, APART),
        ("finger_moving", Sensor.ACTUATOR_POSITION, BOTH),
    ],
)
def test_a_step_of_the_tuner_stays_within_its_instructions_and_says_what_python_says(
    toolbox, examples, tmp_path, board, example, sensor, parameters, record_property
):
    """Six masses; two joints of the moving finger turn two of its four bends."""
    board = getattr(toolbox, board)
    scenario = load_scenario(examples / f"{example}.toml")
    path = replace(scenario.transmission.path, segments=6)
    friction = scenario.transmission.friction
    if parameters == STATED:
        friction = replace(friction, load_exponent=0.2, reference_tension_N=30.0)
    scenario = replace(scenario, transmission=replace(scenario.transmission, path=path, friction=friction))
    settings = replace(
        load_scenario(examples / "finger_adaptive.toml").adaptation,
        sensor=sensor,
        parameters=parameters,
        noise=0.1 if sensor is Sensor.OUTPUT_TENSION else 2e-5,
    )
    scenario = replace(scenario, adaptation=settings)
    problem = Problem.of(scenario)
    for name, text in c_sources(scenario, problem, (ADAPTIVE,), board.precision, "tff").items():
        (tmp_path / name).write_text(text)
    wanted, measured, force = recorded(problem, settings)
    toolbox.write_reference(tmp_path, wanted, board.precision)
    start = f"#define START_N ((tff_real){problem.reference.initial_tension_N!r})\n"
    arrays = numbers("tff_real", "measured", measured), numbers("double", "expected", force)
    (tmp_path / "measured.h").write_text("".join([start, *arrays, angles_of(problem)]))
    there, _ = toolbox.on_board(board, tmp_path, tmp_path, kinds=("adaptive",))
    _, most, mean = there.counts["adaptive"]
    what = " and ".join(parameters) + (", one stated" if parameters == STATED else "")
    record_property(
        "figure",
        f"{board.name}, N = 6, {example}, tuner of {what}: {most} instructions at most, {mean:.0f} mean, "
        f"{1e-9 * int(there.hashes[0], 16):.1g} N from Python",
    )
    assert most <= (MOST_FALLING if parameters == STATED else MOST)
    assert 1e-9 * int(there.hashes[0], 16) <= (0.02 if board.precision is Precision.FLOAT else 1e-6)
