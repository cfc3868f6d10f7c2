"""A recommended profile simulated again by another method."""

from dataclasses import replace

from tendonff.compensator.compensators.method_check import MethodCheck
from tendonff.compensator.finger.result import FingerDesign
from tendonff.compensator.finger.task import task_of
from tendonff.compensator.joint.design.result import JointDesign
from tendonff.compensator.studies.design.result import Design
from tendonff.ocp.integrate.method import Method


def check_design(result: Design, method: Method) -> MethodCheck:
    """Simulate the recommended profile by a method on the design level; SolveError if that fails."""
    name = result.recommended.name
    verified = result.on_level(name, result.level)
    plant = replace(verified.plant, method=method)
    response = plant.respond(result.profiles[name], result.reference).require()
    outputs = verified.response.output_N, response.output_N
    return MethodCheck.of(method, result.recommended.label, "N", result.reference.tension_N, outputs)


def check_driven(result: JointDesign | FingerDesign, method: Method) -> MethodCheck:
    """Simulate the recommended motor angles by the fixed step and by a method on the design model.

    SolveError if a simulation fails.
    """
    task = task_of(result.scenario)
    recommended = task.compensator(result.expectation.recommended)
    command = recommended.command_rad(task)
    shown = task.unit.factor
    by_step, by_method = (
        shown * task.reached(task.system, command, method=each).values for each in (Method.BDF2, method)
    )
    return MethodCheck.of(method, recommended.label, task.unit.shown, shown * task.wanted, (by_step, by_method))
