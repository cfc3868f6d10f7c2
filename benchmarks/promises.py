"""Worst cases that `design` states, beside an independent plant of 40 masses over the stated uncertainty.

    python -m benchmarks.promises

The plant is that of the tests: another cut, another integrator, no code in common. It is tried at all corners of the
stated intervals; that takes some minutes.
"""

import itertools
from dataclasses import replace
from pathlib import Path

import numpy as np

from tendonff.compensator.compensators.closed_form import Frictionless, Inverse, Uncompensated
from tendonff.compensator.scenario.reference import Shape, SineReference, WaypointReference
from tendonff.compensator.scenario.scenario import Scenario
from tendonff.compensator.scenarios import load_scenario
from tendonff.compensator.studies.design.run import design
from tendonff.models.parameters.drive import Drive, Motor
from tendonff.models.parameters.numbers import with_numbers
from tendonff.models.parameters.uncertainty import Spread, Uncertainty
from tests.independent_plant import respond

EXAMPLES = Path(__file__).resolve().parents[1] / "examples"
MASSES = 40
PERIODS = 4


def rigs() -> dict[str, Scenario]:
    """A servo finger, a cycle, and a geared knee exosuit whose gearbox rubs by an unknown amount."""
    finger, bowden = (load_scenario(EXAMPLES / f"{name}.toml") for name in ("finger", "bowden"))
    short = SineReference(
        initial_tension_N=30.0, amplitudes_N=(12.0, 5.0), frequencies_Hz=(0.5, 1.3), duration_s=1.2, fade_in_s=0.3
    )
    actuator = replace(finger.transmission.actuator, drive=Drive.POSITION, servo_stiffness_N_per_m=2e5)
    servo = replace(
        finger,
        reference=short,
        transmission=replace(finger.transmission, actuator=actuator),
        robust=Uncertainty(mu=0.1, samples=3),
    )
    bell = WaypointReference(times_s=(0.0, 0.25, 0.6), tensions_N=(20.0, 50.0, 20.0), shape=Shape.SMOOTH, periodic=True)
    cycle = replace(finger, reference=bell, robust=Uncertainty(mu=0.15, samples=3))
    motor = Motor(
        drum_radius_m=0.02, gear_ratio=30.0, inertia_kg_m2=2e-6, torque_max_N_m=0.3, speed_max_rad_per_s=900.0
    )
    geared = replace(bowden.transmission.actuator, motor=motor, **motor.at_the_drum)
    lift = WaypointReference(
        times_s=(0.0, 0.3, 0.5, 0.8, 1.2), tensions_N=(40.0, 140.0, 140.0, 70.0, 40.0), shape=Shape.SMOOTH
    )
    exosuit = replace(
        bowden,
        reference=lift,
        transmission=replace(bowden.transmission, actuator=geared),
        robust=Uncertainty(mu=0.05, spread=(Spread(keys=("actuator.coulomb_N",), low=0.0, high=15.0),), samples=5),
    )
    return {"finger behind a servo": servo, "cycle": cycle, "exosuit, gear 30:1": exosuit}


def measured_percent(scenario: Scenario, name: str = "inverse") -> tuple[float, float, str]:
    """Worst case stated, worst case of the plant [% of range], and the first contribution."""
    found = design(scenario, compensators=(Uncompensated(), Frictionless(), Inverse()))
    profile, reference, rig = found.profiles[name], found.reference, scenario.transmission
    position = rig.actuator.drive is Drive.POSITION
    given = profile.command_m if position else profile.force_N
    assert given is not None
    periods = PERIODS if reference.periodic else 1
    drive = np.append(np.tile(given[:-1], periods), given[-1])
    time = np.arange(len(drive)) * reference.step_s
    spreads = scenario.robust.spreads
    places = itertools.product((-1.0, 1.0), repeat=len(spreads))
    errors = []
    for place in places:
        values: dict[str, float] = {}
        for spread, at in zip(spreads, place, strict=True):
            values |= spread.values(rig, at)
        seen = respond(
            with_numbers(rig, values), time, drive, reference.initial_tension_N, masses=MASSES, position=position
        )
        error = seen.output_N[-len(given) :] - reference.tension_N
        errors.append(100 * float(np.sqrt(np.mean(error**2))) / reference.range_N)
    first = found.expectation.contributions[0].key
    return found.expectation.worst_percent[name], max(errors), first


def main() -> None:
    """Print the table."""
    print(f"{'rig':<24}{'stated %':>10}{'plant %':>10}{'ratio':>8}  largest contribution")
    for name, scenario in rigs().items():
        stated, plant, first = measured_percent(scenario)
        print(f"{name:<24}{stated:>10.3g}{plant:>10.3g}{stated / plant:>8.3f}  {first}", flush=True)


if __name__ == "__main__":
    main()
