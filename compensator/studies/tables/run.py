"""`tendonff table`: make the tables of a scenario, and say how good they are."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType

from tendonff.compensator.compensators.base import Problem, limit_warnings, with_motion
from tendonff.compensator.compensators.expectation import FRICTIONLESS
from tendonff.compensator.compensators.plant import Plant
from tendonff.compensator.compensators.registry import compensator
from tendonff.compensator.compensators.score import harm_warnings, verify
from tendonff.compensator.compensators.table import CompensationTable, table_of, table_range
from tendonff.compensator.files.reading import InputError
from tendonff.compensator.scenario.sampled.joint_motion import posed
from tendonff.compensator.scenario.scenario import Scenario
from tendonff.compensator.studies.tables.result import AngleTable, Tables
from tendonff.models.fidelity import Level
from tendonff.models.turns import in_turn
from tendonff.ocp.tracking.diagnosis import law_of, reasons


@in_turn
def make_tables(
    scenario: Scenario,
    *,
    level: Level | None = None,
    bound: float | None = None,
    angles_rad: Sequence[float] = (),
    rates: Sequence[float] = (),
    pose_rad: Mapping[str, float] = MappingProxyType({}),
) -> Tables:
    """Tables over the requested axes, and the scores of the scenario's own.

    Arguments and errors as of `tendonff.make_table`.
    """
    scenario = posed(scenario, pose_rad) if pose_rad else scenario
    for name, values in (("angles", angles_rad), ("rates", rates)):
        for value in values:
            if not 0 < value < float("inf"):
                raise InputError(f"--{name}: every value must be a finite number > 0, got {value}")
    problem = Problem.of(scenario, level=level)
    transmission, reference = problem.transmission, problem.reference
    if refused := CompensationTable().refusal(problem):
        raise InputError(refused)
    own_angle, covered = transmission.path.total_angle_rad, table_range(problem)
    own = table_of(problem, bound_N=bound)
    tables = [AngleTable(built=own, total_angle_rad=own_angle)]
    if angles_rad or rates:
        tables = []
        for angle in sorted(angles_rad or [own_angle]):
            bent = replace(transmission, path=replace(transmission.path, total_angle_rad=angle))
            there = replace(problem, transmission=bent)
            tables += [
                AngleTable(
                    built=table_of(there, bound_N=bound, rate_N_per_s=rate, range_N=covered), total_angle_rad=angle
                )
                for rate in sorted(rates or [own.rate_N_per_s])
            ]
    compensation = CompensationTable(own.table)
    every = (compensator("none"), compensator(FRICTIONLESS), compensation)
    profiles = {each.name: with_motion(problem, each.name, each.profile(problem)) for each in every}
    profile = profiles["table"]
    scores = {on: verify(Plant(transmission, on), "table", profile, reference).score for on in Level}
    nothing = verify(Plant(transmission, problem.level), "none", profiles["none"], reference).score
    expectation = problem.expect(profiles, "table")
    harm = harm_warnings({"none": nothing, "table": scores[problem.level]}, reference.wanted, "table")
    met = limit_warnings("table", compensation.wanted_N(problem), profile.force_N)
    bounds = problem.options.minimum_tension_N, problem.options.maximum_tension_N
    needed = problem.inversion.force_N, reference.step_s, problem.limits
    causes = reasons(law_of(problem.chain), reference.tension_N, *needed, *bounds, problem.chain.drive) if met else ()
    options = {"level": level, "bound": bound, "angles": _listed(angles_rad), "rates": _listed(rates)}
    options["pose"] = " --pose ".join(f"{name}={angle}" for name, angle in pose_rad.items())
    return Tables(
        scenario=scenario,
        level=problem.level,
        reference=reference,
        tables=tuple(tables),
        axes=(("total_angle_rad",) if angles_rad else ()) + (("rate_N_per_s",) if rates else ()),
        scores=scores,
        expectation=expectation,
        options=" ".join(f"--{name} {value}" for name, value in options.items() if value),
        warnings=(*reference.warnings, *met, *causes, *harm),
        harm=tuple(harm),
    )


def _listed(values: Sequence[float]) -> str:
    """Numbers as the command line takes them."""
    return ",".join(str(value) for value in values)
