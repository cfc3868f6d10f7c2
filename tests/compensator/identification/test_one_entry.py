"""A candidate law is one entry in one file: added, found in a log that has it, and stated in the fitted scenario."""

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from synthetic import Faults, write_synthetic

from tendonff.compensator.identification.motors import parameters as of_motors
from tendonff.compensator.scenarios import load_scenario
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
tf.identify(tf.load_scenario(scenario), [log]).write(out)
"""

DAMPING = """    JOINT_DAMPING = (
        "joint_damping_N_m_s_per_rad",
        Spec(
            unit="N m s/rad",
            role=Role.EXTRA,
            key="joint.damping_N_m_s_per_rad",
            low=0.0,
            step=0.01,
            of_force=True,
            effect="viscous friction of the joint",
        ),
    )
"""

INERTIA = """    MASS = (
        "mass_kg",
        Spec(
            unit="kg",
            role=Role.SPEED,
            scale=Scale.ABSOLUTE,
            step=0.1,
            nudge=0.05,
            size=0.1,
            whole=Number.MASS,
            key="tendon.mass_kg",
            may_vanish=True,
            effect="inertia of the tendon",
        ),
    )
"""


def fitted(name, before, entry, scenario, log):
    """The answer of a package whose list has one more entry, and its fitted scenario."""
    out = log.parent / "out"
    command = [sys.executable, "-c", RUN, name, before, entry, str(scenario), str(log), str(out)]
    subprocess.run(command, check=True)
    found = load_scenario(out / "fitted.toml")
    return json.loads((out / "fit.json").read_text("utf-8")), (out / "report.html").read_text("utf-8"), found


def test_viscous_friction_of_a_joint_is_found_by_one_entry(tmp_path):
    true = own_log.other()
    true = replace(true, joints=(replace(true.joint, damping_N_m_s_per_rad=0.02),))
    (tmp_path / "hand.toml").write_text(hand().text, encoding="utf-8")
    place = of_motors.__name__, "    ADHESION = (\n"
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
    name = "tendonff.compensator.identification.parameters"
    answer, report, found = fitted(name, "    INPUT_GAIN = ", INERTIA, Path(examples / "finger.toml"), log)
    assert "inertia of the tendon" in answer["law"]
    assert "inertia of the tendon" in report
    assert found.transmission.tendon.mass_kg == pytest.approx(2.0, rel=0.2)
