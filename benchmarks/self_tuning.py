"""The exported self-tuning C, blind, on three rigs of 40 masses whose laws, scheme and step are others.

    python benchmarks/self_tuning.py [--sensor output_tension] [--gain 40] [--parameters mu] [--motions all] [CASE ...]

Two sines (or every one of `MOTIONS`), 8 s, 1 kHz, 2 ms of delay, noise of 0.5 % of range or of travel. Errors are RMS
after 2 s in % of range (after the change and 2 s where something changes in mid-run: those of the last second are
stated too); *worst* is the largest ratio to the plain inverse over any second (every 10 ms) in which more than
0.5 % of range is left, *any* that of all, *share* how many of all have more than 1.3 times and more than 0.5 %.
`--load-exponent 0.2` states friction that falls with the tension, at that of the start; `--seed` is of the noise.
"""

import argparse
import ctypes
import importlib.util
import itertools
import sys
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from tendonff.compensator.compensators.base import Problem
from tendonff.compensator.export.modules import ADAPTIVE_MODULES
from tendonff.compensator.export.text.c_text import c_sources
from tendonff.compensator.scenario.reference import Shape, SineReference, WaypointReference
from tendonff.compensator.scenario.scenario import Scenario
from tendonff.compensator.scenario.settings import Adaptation
from tendonff.compensator.scenarios import load_scenario
from tendonff.models.fidelity import Level
from tendonff.ocp.adaptation.tuning import Sensor, Tunable
from tendonff.ocp.codegen.compiler import load_library
from tendonff.ocp.codegen.precision import Precision

ROOT = Path(__file__).parents[1]
DURATION_S, STEP_S, NOISE = 8.0, 1e-3, 0.005
RIGS = {"finger": (30.0, (12.0, 5.0)), "bowden": (100.0, (45.0, 20.0)), "surgical": (12.0, (5.0, 2.0))}
# Courses of the tension about that of the start, in shares of the sum of a rig's amplitudes.
MOTIONS: dict[str, tuple[tuple[float, ...], tuple[float, ...]] | tuple[Shape, tuple[float, ...], tuple[float, ...]]] = {
    "two sines": ((0.5, 1.3), ()),  # with the rig's own amplitudes
    "slow sine": ((0.25,), (1.0,)),
    "fast sines": ((1.7, 2.9), (0.3, 0.15)),
    "three sines": ((0.3, 0.7, 1.9), (0.5, 0.3, 0.2)),
    "strokes": (
        Shape.SMOOTH,
        (0, 0.5, 1, 1.5, 2, 3, 3.3, 4, 5, 5.5, 6, 7, 8),
        (0, 1, 1, -1, -1, 0.7, -0.2, 0.5, -0.8, -0.8, 1, 0, 0),
    ),
    "triangle": (Shape.LINEAR, (0, 0.5, 1.5, 2.5, 3.5, 4.5, 5.5, 6.5, 7.5, 8), (0, 1, -1, 1, -1, 1, -1, 1, -1, 0)),
}
DRIVER = """
tff_adaptive *made(void) { return (tff_adaptive *)calloc(1, sizeof(tff_adaptive)); }
void begin(tff_adaptive *self, double tension) { tff_adaptive_init(self, (tff_real)tension); }
double step(tff_adaptive *self, double wanted, double measured) { return tff_adaptive_step(self, wanted, measured); }
unsigned status(const tff_adaptive *self) { return self->output.status; }
double value(const tff_adaptive *self, int k) { return tff_adaptive_tuner_value(&self->tuner, k); }
double estimate(const tff_adaptive *self, int k) { return self->tuner.f[k]; }
int last(void) { return TFF_ADAPTIVE_TUNER_TUNED - 1; }
double gain(const tff_adaptive *self) { return 1 + self->tuner.correction; }
double level(const tff_adaptive *self) { return self->tuner.level; }
"""


def _rig_module() -> ModuleType:
    spec = importlib.util.spec_from_file_location("independent_rig", ROOT / "tests" / "independent_rig.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["independent_rig"] = module
    spec.loader.exec_module(module)
    return module


INDEPENDENT: Any = _rig_module()


@dataclass
class World:
    """Case: deviations of the rig and its sensor."""

    hidden: dict[str, float] = field(default_factory=dict)
    change: Callable[[Any, float], None] | None = None
    gear_share: float = 0.0  # dry friction of the drive, of the range
    gain: float = 1.0  # of the sensor
    delay: int = 2
    start: float = 1.0  # true tension at the start over the one that was stated
    stuck_s: tuple[float, float] = (np.inf, np.inf)  # time in which the sensor says the same


def _lubricated(rig: Any, t: float) -> None:
    if abs(t - 4.0) < STEP_S / 2:
        rig.lubricate(0.4, 0.65, 0.6)


def _stretched(rig: Any, t: float) -> None:
    if 3.0 <= t < 3.5:
        rig.stretch(1e-3 * STEP_S / 0.5)


def _posture(rig: Any, t: float) -> None:
    load = 1 + 0.3 * np.sin(2 * np.pi * 0.25 * t)
    rig.set(mu=rig.mu, load=float(load))


def _step(rig: Any, t: float) -> None:
    if abs(t - 4.0) < STEP_S / 2:
        rig.set(mu=1.2, load=1.0)


def _loosened(rig: Any, t: float) -> None:
    if abs(t - 3.2) < STEP_S / 2:
        rig.set(mu=1.2, load=2 / 3)


CASES: dict[str, World] = {
    "as stated": World(),
    "start tension +5 %": World(start=1.05),
    "start tension -5 %": World(start=0.95),
    "friction +20 %, start tension +5 %": World({"mu": 1.2}, start=1.05),
    "friction +20 %, sensor stuck from the start": World({"mu": 1.2}, stuck_s=(0.0, np.inf)),
    "friction +20 %, sensor stuck for a second": World({"mu": 1.2}, stuck_s=(4.3, 5.3)),
    "load steps by -33 %": World({"mu": 1.2}, change=_loosened),
    "friction -20 %": World({"mu": 0.8}),
    "friction +20 %": World({"mu": 1.2}),
    "release -30 %": World({"release": 0.7}),
    "friction +20 %, release -30 %": World({"mu": 1.2, "release": 0.7}),
    "stretched by 1 mm": World({"mu": 1.1}, change=_stretched),
    "lubricated spot": World({"mu": 1.0}, change=_lubricated),
    "friction steps by 20 %": World(change=_step),
    "posture": World(change=_posture),
    "posture, friction +20 %": World({"mu": 1.2}, change=_posture),
    "gear friction 3 %": World(gear_share=0.03),
    "gain of the sensor +3 %": World(gain=1.03),
    "delay of 5": World(delay=5),
    "friction +20 %, delay of 5": World({"mu": 1.2}, delay=5),
    "bristles twice as stiff": World({"bristle": 2.0}),
    "friction +20 %, bristles twice as stiff": World({"mu": 1.2, "bristle": 2.0}),
    "load +20 %": World({"load": 1.2}),
    "tendon -20 %": World({"stiffness": 0.8}),
}
CASES |= {f"mu ~ T^-{n:g}": World({"load_exponent": n}) for n in (0.1, 0.2, 0.3)}
CASES |= {
    f"friction {p:+g} %, mu ~ T^-{n:g}": World({"mu": 1 + p / 100, "load_exponent": n})
    for n in (0.1, 0.2, 0.3)
    for p in (-20, 20)
}


def reference_of(name: str, motion: str) -> SineReference | WaypointReference:
    """Motion of a rig."""
    tension, amplitudes = RIGS[name]
    course, whole = MOTIONS[motion], sum(amplitudes)
    if len(course) == 3:
        shape, times_s, shares = course
        return WaypointReference(
            times_s=times_s, shape=shape, tensions_N=tuple(tension + whole * share for share in shares)
        )
    frequencies, shares = course
    return SineReference(
        initial_tension_N=tension,
        frequencies_Hz=frequencies,
        amplitudes_N=tuple(whole * share for share in shares) or amplitudes,
        duration_s=DURATION_S,
        fade_in_s=0.5,
    )


def scenario_of(
    name: str,
    sensor: Sensor,
    parameters: tuple[Tunable, ...],
    gain_per_s: float | None,
    motion: str = "two sines",
    load_exponent: float = 0.0,
) -> Scenario:
    """An example on a motion, with self-tuning."""
    amplitudes = RIGS[name][1]
    scenario = load_scenario(ROOT / "examples" / f"{name}.toml")
    if load_exponent:
        friction = scenario.transmission.friction
        friction = replace(friction, load_exponent=load_exponent, reference_tension_N=RIGS[name][0])
        scenario = replace(scenario, transmission=replace(scenario.transmission, friction=friction))
    run = replace(scenario.run, step_s=STEP_S, level=Level.PRESLIDING)
    span = (
        2
        * sum(amplitudes)
        * (1.0 if sensor is Sensor.OUTPUT_TENSION else 1.5 / scenario.transmission.load.stiffness_N_per_m)
    )
    gain = {} if gain_per_s is None else {"integral_gain_per_s": gain_per_s}
    adaptation = Adaptation(sensor=sensor, parameters=parameters, noise=NOISE * span, delay_samples=2, **gain)
    return replace(scenario, reference=reference_of(name, motion), run=run, adaptation=adaptation)


class Tuner:
    """The compiled C module."""

    def __init__(self, library: ctypes.CDLL, tension_N: float, deaf: bool) -> None:
        for name in ("step", "value", "estimate", "gain", "level"):
            getattr(library, name).restype = ctypes.c_double
        library.made.restype, library.status.restype = ctypes.c_void_p, ctypes.c_uint
        self._c, self._deaf, self._self = library, deaf, ctypes.c_void_p(library.made())
        library.begin(self._self, ctypes.c_double(tension_N))
        self._last = library.last()
        self.log: list[tuple[float, ...]] = []

    def step(self, reference_N: float, measured: float) -> float:
        """Force at the end of the step."""
        given = float("nan") if self._deaf else measured
        force = float(self._c.step(self._self, ctypes.c_double(reference_N), ctypes.c_double(given)))
        numbers = [getattr(self._c, n)(self._self, k) for n in ("value", "estimate") for k in (0, self._last)]
        self.log.append((*numbers, self._c.gain(self._self), self._c.level(self._self)))
        return force

    @property
    def status(self) -> int:
        """Bits of the last step."""
        return int(self._c.status(self._self))


def compiled(scenario: Scenario, problem: Problem) -> ctypes.CDLL:
    """The adaptive module with its driver."""
    texts = c_sources(scenario, problem, ADAPTIVE_MODULES, Precision.DOUBLE, "tff")
    names = ("parameters", "limits", "state", "chain", "adaptive")
    order = ("types.h", *(f"{name}.h" for name in (*names, "inversion")), *(f"{name}.c" for name in names))
    own = "\n".join(texts[f"tff_{name}"] for name in order)
    lines = [line for line in own.splitlines() if not line.startswith('#include "')]
    return load_library("\n".join(["#include <stdlib.h>", *lines, DRIVER]))


def play(
    library: ctypes.CDLL, scenario: Scenario, problem: Problem, world: World, *, deaf: bool, seed: int = 0
) -> tuple[Any, ...]:
    """Error over time, in % of range, status, and what was found."""
    assert scenario.adaptation is not None
    reference, sensor = problem.reference, scenario.adaptation.sensor
    start, scale = reference.initial_tension_N, float(np.ptp(reference.tension_N))
    hidden = dict(world.hidden) | ({"gear_N": world.gear_share * scale} if world.gear_share else {})
    rig = INDEPENDENT.Rig(scenario.transmission, start, step_s=2e-5, true_tension_N=world.start * start, **hidden)
    held: list[float] = []
    tuner = Tuner(library, start, deaf)

    def measure(r: Any) -> float:
        value = world.gain * (r.tension_N if sensor is Sensor.OUTPUT_TENSION else r.position_m)
        if world.stuck_s[0] <= STEP_S * len(tuner.log) < world.stuck_s[1]:
            held.append(value)
            return held[0] - noise[len(tuner.log)]
        return value

    noise = scenario.adaptation.noise * np.random.default_rng(seed).normal(size=len(reference.tension_N))
    tension, status = INDEPENDENT.closed_loop(
        rig, tuner, reference.tension_N, measure, noise, delay=world.delay, change=world.change
    )
    return 100 * (tension - reference.tension_N) / scale, status, np.array(tuner.log)


def rms(error: np.ndarray) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(error**2)))


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])  # type: ignore[union-attr]
    parser.add_argument("cases", nargs="*", default=list(CASES))
    parser.add_argument("--sensor", default=Sensor.OUTPUT_TENSION, type=Sensor)
    parser.add_argument("--rigs", default=",".join(RIGS))
    parser.add_argument("--parameters", default="", help="default: the scenario's")
    parser.add_argument("--motions", default="two sines", help="names, separated by commas; or all")
    parser.add_argument("--load-exponent", type=float, default=0.0, help="stated in the scenario")
    parser.add_argument("--seed", type=int, default=0, help="of the noise")
    parser.add_argument("--gain", type=float, default=None, help="integral action [1/s]; default: the scenario's")
    options = parser.parse_args()
    motions = list(MOTIONS) if options.motions == "all" else options.motions.split(",")
    for name, motion in itertools.product(options.rigs.split(","), motions):
        parameters = tuple(Tunable(p) for p in options.parameters.split(",") if p)
        scenario = scenario_of(name, options.sensor, parameters, options.gain, motion, options.load_exponent)
        problem = Problem.of(scenario)
        library = compiled(scenario, problem)
        for case in options.cases:
            world = CASES[case]
            plain, _, _ = play(library, scenario, problem, world, deaf=True)
            error, status, log = play(library, scenario, problem, world, deaf=False, seed=options.seed)
            late, second = round(2 / STEP_S), round(1 / STEP_S)
            seconds = [slice(k, k + second) for k in range(0, len(error) - second + 1, second // 100)]
            ratios = np.array([rms(error[s]) / rms(plain[s]) for s in seconds])
            counts = np.array([rms(error[s]) > 0.5 for s in seconds])
            print(
                f"{name:9} {motion:11} {options.sensor:17} {case:40} plain {rms(plain[late:]):6.2f}  "
                f"tuned {rms(error[late:]):6.2f}  "
                f"last {rms(error[-second:]):6.2f} worst {np.where(counts, ratios, 0).max():5.2f}  "
                f"any {ratios.max():6.2f}  share {100 * np.mean(counts & (ratios > 1.3)):3.0f} %  frozen "
                f"{100 * np.mean((status & 64) > 0):3.0f} %  doubt {100 * np.mean((status & 256) > 0):3.0f} %  "
                f"{np.round(log[-1, :2], 3)} gain {log[-1, 4]:.3f}",
                flush=True,
            )


if __name__ == "__main__":
    main()
