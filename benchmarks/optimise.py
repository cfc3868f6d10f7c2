"""Optimal profiles on plants that the search did not own, against what a user would do otherwise.

    python benchmarks/optimise.py             12 rigs, several plants, a long horizon: the tables of the docs
    python benchmarks/optimise.py --others    also ours beside Opti/IPOPT, rockit and do-mpc on a grid of 10 ms
    python benchmarks/optimise.py --fine      the same, on 4 and 1 ms too: about an hour more

A plant is a chain of 40 masses at a tenth of the step: the design level, stiffer bristles (the viscoelastic level, or
ten times as stiff where the design has stiff ones), and friction 10 % off either way. The rigs are the examples, some
with another rate or largest force, and the first random rigs of `random_rigs` on which the clipped inverse has an
error of 0.5 to 20 % of the range and friction does not weaken with speed, which no feedforward can hold.
Errors are root mean squares in per cent of the reference's range; turns are those of the force by more than 0.6 % of
it. Times are seconds of CPU; ours includes nothing cached but the compiled stepper.
"""

import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from optimise_others import EXAMPLES, do_mpc, finger, opti, ours, rockit
from optimise_others import Problem as Bare
from random_rigs import random_problem

from tendonff.compensator.compensators.base import Problem
from tendonff.compensator.compensators.registry import compensator
from tendonff.compensator.scenario.sampled.sampling import Reference, sample_reference
from tendonff.compensator.scenarios import load_scenario
from tendonff.models.capstan import held_within
from tendonff.models.fidelity import Level
from tendonff.models.parameters import Transmission
from tendonff.models.parameters.numbers import with_numbers
from tendonff.models.tendon.chain import Chain
from tendonff.ocp.optimal.track import track, track_robust
from tendonff.ocp.tendon.simulate import simulate

Array = NDArray[np.float64]
RIVALS = ("inverse", "smoothed", "table")
_MASSES, _FINER = 40, 10
_RANDOM = 4
_STIFFER = 10.0
_LEAST, _MOST = 0.5, 20.0


@dataclass(frozen=True)
class Rig:
    """A transmission, its design level and its reference."""

    name: str
    transmission: Transmission
    level: Level
    reference: Reference

    @cached_property
    def problem(self) -> Problem:
        """Problem of the compensators."""
        return Problem(transmission=self.transmission, level=self.level, reference=self.reference)

    @cached_property
    def plants(self) -> tuple[Chain, ...]:
        """Design level, stiffer bristles, friction 10 % less and more."""
        own = self.transmission
        if self.level is Level.PRESLIDING:
            stiffer = Chain.of(own, Level.VISCOELASTIC, _MASSES)
        else:
            stiffer = Chain.of(own, self.level, _MASSES).stiffened(_STIFFER)
        off = (Chain.of(with_numbers(own, {"mu": factor}), self.level, _MASSES) for factor in (0.9, 1.1))
        return (Chain.of(own, self.level, _MASSES), stiffer, *off)

    def percent(self, force: Array, plants: tuple[Chain, ...] | None = None) -> list[float]:
        """Error on each plant."""
        step, wanted = self.reference.step_s, self.reference.tension_N
        at = np.arange(len(force)) * step
        fine = np.arange((len(force) - 1) * _FINER + 1) * step / _FINER
        drive, found = np.interp(fine, at, force), []
        for plant in plants or self.plants:
            run = simulate(plant, drive, step / _FINER, initial_tension_N=self.reference.initial_tension_N)
            output = run.output_tension_N[::_FINER]
            error = np.sqrt(np.mean((output - wanted) ** 2)) if len(output) == len(wanted) else np.inf
            found.append(100 * float(error) / self.reference.range_N)
        return found

    def turns(self, force: Array) -> int:
        """Number of reversals of the force."""
        half = 0.003 * self.reference.range_N
        lazy = held_within(float(force[0]), force - half, force + half)
        way = np.sign(np.diff(lazy))
        return int(np.count_nonzero(np.diff(way[way != 0])))


def example(name: str, level: Level, *, rate: float | None = None, most: float | None = None) -> Rig:
    """An example with another rate limit or largest force."""
    scenario = load_scenario(EXAMPLES / f"{name}.toml")
    actuator = scenario.transmission.actuator
    actuator = replace(actuator, force_rate_max_N_per_s=rate or actuator.force_rate_max_N_per_s)
    actuator = replace(actuator, force_max_N=most or actuator.force_max_N)
    rig = replace(scenario.transmission, actuator=actuator)
    label = f"{name}, {actuator.force_rate_max_N_per_s:g} N/s" + (f", at most {most:g} N" if most else "")
    return Rig(label, rig, level, sample_reference(scenario))


def random_rig(seed: int) -> Rig | None:
    """A random rig that can be judged; else None."""
    rig, level, tension, step = random_problem(seed)
    time_s = np.arange(len(tension)) * step
    reference = Reference(time_s=time_s, tension_N=tension, step_s=step, initial_tension_N=float(tension[0]))
    found = Rig(f"random rig {seed}", rig, level, reference)
    weakens = rig.friction.mu_static > rig.friction.mu_dynamic
    left = np.inf if weakens else found.percent(compensator("inverse").profile(found.problem).force_N)[0]
    return found if _LEAST < left < _MOST else None


def rigs() -> Iterator[Rig]:
    """All twelve."""
    soft, stiff = Level.PRESLIDING, Level.VISCOELASTIC
    yield example("finger_fast", soft)
    yield example("finger_fast", soft, most=60.0)
    yield example("finger_fast", soft, rate=500.0)
    yield example("finger_fast", stiff, rate=400.0)
    yield example("bowden", stiff, rate=1000.0)
    yield example("bowden", stiff, rate=500.0)
    yield example("surgical", soft, rate=120.0)
    yield example("surgical", soft)
    seed, left = 0, _RANDOM
    while left:
        if (found := random_rig(seed)) is not None:
            left -= 1
            yield found
        seed += 1


def judge() -> None:
    """Every rig on every plant."""
    print("| rig | profile | design level | stiffer | mu -10 % | mu +10 % | turns | search, CPU |")
    print("|---|---|---:|---:|---:|---:|---:|---:|")
    for rig in rigs():
        worst = {}
        for name in (*RIVALS, "optimal"):
            began = time.process_time()
            force = compensator(name).profile(rig.problem).force_N
            seconds = time.process_time() - began
            errors = rig.percent(force)
            worst[name] = max(errors)
            taken = f"{seconds:.2f} s" if name == "optimal" else ""
            cells = " | ".join(f"{error:.2f}" for error in errors)
            print(f"| {rig.name} | {name} | {cells} | {rig.turns(force)} | {taken} |", flush=True)
        least = min(worst["inverse"], worst["smoothed"])
        verdict = "no worse" if worst["optimal"] <= least * (1 + 1e-9) else "WORSE"
        print(f"| | worst: {worst['optimal']:.2f} beside {least:.2f}: {verdict} | | | | | | |", flush=True)


def robust() -> None:
    """The finger at 2000 N/s with friction known to 20 %: worst plant, turns of the force."""
    rig = example("finger_fast", Level.PRESLIDING, rate=2000.0)
    factors = (1.0, 0.8, 1.2)
    chains, plants = (
        tuple(Chain.of(with_numbers(rig.transmission, {"mu": f}), rig.level, masses) for f in factors)
        for masses in (None, _MASSES)
    )
    began = time.process_time()
    found = track_robust(chains, rig.reference.tension_N, rig.reference.step_s, rig.problem.limits)
    seconds, span = time.process_time() - began, rig.reference.range_N
    for name, force in (("inverse", rig.problem.inversion.force_N), ("robust", found.force_N)):
        worst = 0.01 * span * max(rig.percent(force, plants))
        print(f"{name}: worst of mu +-20 % {worst:.2f} N, {rig.turns(force)} turns")
    print(f"{seconds:.2f} s; {found.message}")


def long_horizon() -> None:
    """Up to 60 s at 1 ms."""
    short = finger(Level.PRESLIDING, 1e-3, 250.0)
    for seconds in (15, 60):
        t = np.arange(seconds * 1000 + 1) * 1e-3
        reference = 30 + np.minimum(t / 0.5, 1) * (12 * np.sin(np.pi * t) + 5 * np.sin(2.6 * np.pi * t))
        began = time.process_time()
        found = track(short.chain, reference, 1e-3, short.limits)
        print(f"{seconds:3d} s: {found.windows} pieces, {time.process_time() - began:.1f} s of CPU, {found.message}")


def main() -> None:
    warm: Bare = finger(Level.PRESLIDING, 1e-3, 250.0)
    track(warm.chain, warm.reference[:60], warm.step, warm.limits)
    judge()
    print()
    robust()
    print()
    long_horizon()
    if "--others" in sys.argv or "--fine" in sys.argv:
        print()
        for step in (10e-3, 4e-3, 1e-3) if "--fine" in sys.argv else (10e-3,):
            problem = finger(Level.PRESLIDING, step)
            ours(problem)
            for other in (opti, rockit, do_mpc):
                other(problem)


if __name__ == "__main__":
    main()
