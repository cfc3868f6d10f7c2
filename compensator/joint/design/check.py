"""A recommended motor angle simulated again by another method; see `studies.design.check`."""

import numpy as np

from tendonff.compensator.compensators.method_check import MethodCheck
from tendonff.compensator.joint.design.result import JointDesign
from tendonff.compensator.joint.plant import JointPlant
from tendonff.ocp.integrate.method import Method


def check_joint_design(result: JointDesign, method: Method) -> MethodCheck:
    """Simulate the recommended motor angle on the design model by the fixed step and by a method.

    SolveError if a simulation fails.
    """
    name, sampled = result.expectation.recommended, result.sampled
    command = np.concatenate([result.homing_rad, result.profiles[name].motor_rad])
    kept, responses = slice(sampled.lead, None), []
    for each in (Method.BDF2, method):
        plant = JointPlant(mechanism=result.scenario.mechanism, scenario=result.scenario, sampled=sampled, method=each)
        responses.append(plant.reached(plant.respond(command))[kept])
    label = next(c.label for c in result.compensators if c.name == name)
    wanted = sampled.wanted[kept]
    return MethodCheck.of(method, label, "rad" if result.is_angle else "N m", wanted, (responses[0], responses[1]))
