"""A recommended profile simulated again by another method."""

from dataclasses import replace

from tendonff.compensator.compensators.method_check import MethodCheck
from tendonff.compensator.studies.design.motors.result import MotorDesign
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


def check_driven(result: MotorDesign, method: Method) -> MethodCheck:
    """Simulate the recommended motor angles on the design model by the fixed step and by a method.

    SolveError if a simulation fails.
    """
    task, unit = result.task, result.goal.unit
    command = task.answer(result.recommended)
    first, second = (
        unit.factor * task.values_of(task.respond(task.system, command, method=each)) for each in (Method.BDF2, method)
    )
    return MethodCheck.of(method, result.recommended.label, unit.shown, unit.factor * task.wanted, (first, second))
