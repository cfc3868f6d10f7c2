"""The mechanism as a law that is fitted: its residuals and their slopes."""

from dataclasses import replace

import numpy as np
import pytest

from tendonff.compensator.identification.motors.law import MechanismLaw
from tendonff.compensator.identification.motors.log import read_logs
from tendonff.compensator.identification.parameters import Parameter
from tendonff.compensator.scenario.measurement import Measurement
from tests.compensator.identification.motors import own_log
from tests.hidden_loop import scenario

pytestmark = pytest.mark.compiler


@pytest.mark.parametrize("size", [1e12, np.nan])
def test_slopes_that_grow_without_end_while_a_tendon_is_loose_are_those_of_simulations(tmp_path, monkeypatch, size):
    """They did on one of ten fresh logs with relaxing tendons: no interval was left, and none could be written."""
    true = own_log.other()
    [log] = read_logs(scenario(), [own_log.write(tmp_path, true)], Measurement())
    law = MechanismLaw(mechanism=true, logs=[log])
    values = {n: n.of(true) for n in (Parameter.MU, Parameter.TENSION, Parameter.COULOMB)}
    exact = law.evaluate(values, list(values))
    own = MechanismLaw._slopes

    def grown(self, log, values, over):
        answer, by = own(self, log, values, over)
        torque = by.torque_N_m.copy()
        torque[len(torque) // 2, :, 0] = size
        return answer, replace(by, torque_N_m=torque)

    monkeypatch.setattr(MechanismLaw, "_slopes", grown)
    found = law.evaluate(values, list(values))
    assert found.slopes[:, 1:] == pytest.approx(exact.slopes[:, 1:])
    assert np.abs(found.slopes).max() < 1e4 * np.abs(exact.slopes).max()
    assert np.linalg.norm(found.slopes[:, 0] - exact.slopes[:, 0]) < 0.3 * np.linalg.norm(exact.slopes[:, 0])
