"""A candidate law is one entry in one file: added, found in a log that has it, and stated in the fitted scenario.

Laws of joints, of the chain, and of the quasi-static stage.
"""

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from synthetic import Faults, write_synthetic

from tendonff.compensator.files.writing import write_csv
from tendonff.compensator.identification import parameters
from tendonff.compensator.scenarios import load_scenario
from tendonff.models.capstan import CapstanLaw
from tests.compensator.identification.motors import own_log
from tests.hidden_loop import scenario as hand

pytestmark = [pytest.mark.compiler, pytest.mark.nightly]

RUN = """
import importlib.util, sys
from pathlib import Path
name, before, entry, scenario, log, out = sys.argv[1:]
spec = importlib.util.find_spec(name)
text = Path(spec.origin).read_text(encoding="utf-8")
assert text.count(before) == 1
module = sys.modules[name] = importlib.util.module_from_spec(spec)
exec(compile(text.replace(before, entry + before), spec.origin, "exec"), module.__dict__)
import tendonff as tf
tf.identify(tf.load_scenario(scenario), [log], **OPTIONS).write(out)
"""

DAMPING = """    JOINT_DAMPING = (
        "joint_damping_N_m_s_per_rad",
        Spec(
            key="joint.damping_N_m_s_per_rad",
            effect="viscous friction of the joint",
            motors=ByMotors(role=Role.EXTRA, low=0.0, step=0.01, of_force=True),
        ),
    )
"""

INERTIA = """    MASS = (
        "mass_kg",
        Spec(
            key="tendon.mass_kg",
            effect="inertia of the tendon",
            tensions=ByTensions(
                role=Role.SPEED,
                scale=Scale.ABSOLUTE,
                step=0.1,
                nudge=0.05,
                size=0.1,
                number=ChainNumber.MASS,
                may_vanish=True,
            ),
        ),
    )
"""


FALLING = """    LOAD_EXPONENT = (
        "load_exponent",
        StaticTerm(
            bounds=lambda _, __: (0.1, 1e-3, 0.9, 0.1),
            effect="friction that falls with tension",
            explains="output",
            key="friction.load_exponent",
            beside_keys=(("friction.reference_tension_N", 40.0),),
            exponents=lambda n, tension, pair: (
                -ca.log(1 - (n + 1e-9) * pair[0] * (40 / tension) ** n) / (n + 1e-9),
                ca.log(1 + (n + 1e-9) * pair[1] * (40 / tension) ** n) / (n + 1e-9),
            ),
        ),
    )
"""


def fitted(name, before, entry, scenario, log, options="{}"):
    """The answer of a package whose list has one more entry, and its fitted scenario."""
    out = log.parent / "out"
    command = [
        sys.executable,
        "-c",
        RUN.replace("OPTIONS", options),
        name,
        before,
        entry,
        str(scenario),
        str(log),
        str(out),
    ]
    subprocess.run(command, check=True)
    found = load_scenario(out / "fitted.toml")
    return json.loads((out / "fit.json").read_text("utf-8")), (out / "report.html").read_text("utf-8"), found


def test_viscous_friction_of_a_joint_is_found_by_one_entry(tmp_path):
    true = own_log.other()
    true = replace(true, joints=(replace(true.joint, damping_N_m_s_per_rad=0.02),))
    (tmp_path / "hand.toml").write_text(hand().text, encoding="utf-8")
    place = parameters.__name__, "    ADHESION = (\n"
    answer, report, found = fitted(*place, DAMPING, tmp_path / "hand.toml", own_log.write(tmp_path, true))
    assert answer["law"] == "loop with presliding, viscous friction of the joint"
    assert "viscous friction of the joint" in report
    estimate = answer["estimates"]["joint_damping_N_m_s_per_rad"]
    low, high = estimate["interval_95"]
    assert low < 0.02 < high < 0.025
    assert found.mechanism.joint.damping_N_m_s_per_rad == pytest.approx(estimate["estimate"])


def test_inertia_of_a_tendon_is_found_by_one_entry(tmp_path, examples):
    nominal = load_scenario(examples / "finger.toml")
    heavy = replace(nominal.transmission, tendon=replace(nominal.transmission.tendon, mass_kg=2.0))
    time = np.arange(0, 12, 4e-3)
    force = 45 + 25 * np.sin(2 * np.pi * 0.5 * time) + 10 * np.sin(2 * np.pi * 3.1 * time) * np.minimum(time, 1)
    log = tmp_path / "log.csv"
    write_synthetic(log, heavy, time, force, Faults(noise=0.002), step_s=4e-3)
    answer, report, found = fitted(
        parameters.__name__, "    INPUT_GAIN = ", INERTIA, Path(examples / "finger.toml"), log
    )
    assert "inertia of the tendon" in answer["law"]
    assert "inertia of the tendon" in report
    assert found.transmission.tendon.mass_kg == pytest.approx(2.0, rel=0.2)


@pytest.fixture
def log_of_falling_friction(examples, tmp_path):
    """What two cells read on a transmission whose friction falls with the tension, n = 0.3 at 40 N."""
    nominal, log, noise = load_scenario(examples / "finger.toml"), tmp_path / "log.csv", np.random.default_rng(5)
    friction = replace(nominal.transmission.friction, adhesion_N=0.0, load_exponent=0.3, reference_tension_N=40.0)
    law = CapstanLaw.of(replace(nominal.transmission, friction=friction))
    time = np.arange(0, 20, 0.01)
    force = 42 - 26 * np.cos(2 * time) + 10 * np.sin(0.71 * time)
    output = law.output_history_N(force) + 0.02 * noise.normal(size=len(time))
    write_csv(log, {"time_s": time, "input_tension_N": force, "output_tension_N": output})
    return log


def test_a_quasi_static_law_is_found_by_one_entry(log_of_falling_friction, examples):
    place = "tendonff.ocp.fits.static", "\n\nP = StaticParameter\n"
    log, options = log_of_falling_friction, "{'static_only': True}"
    answer, report, found = fitted(*place, FALLING, examples / "finger.toml", log, options)
    assert answer["law"] == "symmetric with friction that falls with tension"
    assert answer["law"] in report
    low, high = answer["estimates"]["load_exponent"]["interval_95"]
    assert low < 0.3 < high < low + 0.05
    friction = found.transmission.friction
    assert (friction.load_exponent, friction.reference_tension_N) == pytest.approx((0.3, 40.0), rel=0.03)
    assert answer["fitted_toml_percent_of_range"] < 0.1


def test_without_the_entry_the_law_is_gone(log_of_falling_friction, examples):
    place = "tendonff.ocp.fits.static", "\n\nP = StaticParameter\n"
    options = "{'static_only': True}"
    answer, *_ = fitted(*place, "", examples / "finger.toml", log_of_falling_friction, options)
    assert "falls" not in json.dumps(answer["laws"])
