"""The exported tuner, compiled and closed around the independent rig."""

import ctypes
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from tendonff.compensator.compensators.base import Problem
from tendonff.compensator.export.adaptive import ADAPTIVE_MODULES
from tendonff.compensator.export.text.c_text import c_sources
from tendonff.compensator.scenario.adaptation import Adaptation
from tendonff.compensator.scenario.scenario import Scenario, load_scenario
from tendonff.ocp.adaptation.tuning import Sensor, Tunable
from tendonff.ocp.codegen.compiler import load_library
from tendonff.ocp.codegen.precision import Precision

NOISE = {Sensor.OUTPUT_TENSION: 0.165, Sensor.ACTUATOR_POSITION: 2e-5}
DRIVER = """
tff_adaptive *made(void) { return (tff_adaptive *)calloc(1, sizeof(tff_adaptive)); }
void begin(tff_adaptive *self, double tension) { tff_adaptive_init(self, (tff_real)tension); }
double step(tff_adaptive *self, double reference, double measured)
{
    return (double)tff_adaptive_step(self, (tff_real)reference, (tff_real)measured);
}
double mu(const tff_adaptive *self) { return (double)tff_adaptive_mu(self); }
unsigned status(const tff_adaptive *self) { return self->output.status; }
void keep(const tff_adaptive *from, tff_adaptive *to)
{
    tff_adaptive_memory memory;
    tff_adaptive_save(from, &memory);
    tff_adaptive_restore(to, &memory);
}
"""


class ExportedTuner:
    """The C module as an object."""

    def __init__(self, library: ctypes.CDLL, tension_N: float) -> None:
        self.library = library
        library.made.restype = ctypes.c_void_p
        library.step.restype = library.mu.restype = ctypes.c_double
        library.status.restype = ctypes.c_uint
        self.address = ctypes.c_void_p(library.made())
        library.begin(self.address, ctypes.c_double(tension_N))

    def step(self, reference_N: float, measured: float) -> float:
        return float(self.library.step(self.address, ctypes.c_double(reference_N), ctypes.c_double(measured)))

    @property
    def status(self) -> int:
        return int(self.library.status(self.address))

    @property
    def mu(self) -> float:
        return float(self.library.mu(self.address))


def adapted(scenario: Scenario, sensor: Sensor, parameters: tuple[Tunable, ...]) -> Scenario:
    """The scenario with another table [adaptation]."""
    adaptation = Adaptation(sensor=sensor, parameters=parameters, noise=NOISE[sensor], delay_samples=2)
    return replace(scenario, adaptation=adaptation)


@pytest.fixture(scope="session")
def finger(examples) -> Scenario:
    return load_scenario(examples / "finger.toml")


@pytest.fixture(scope="session")
def exported(finger) -> Callable[..., ExportedTuner]:
    """A new tuner of the compiled C."""
    made: dict[object, tuple[ctypes.CDLL, float]] = {}

    def tuner(sensor: Sensor, parameters=(Tunable.MU,), precision: Precision = Precision.DOUBLE) -> ExportedTuner:
        key = (sensor, parameters, precision)
        if key not in made:
            scenario = adapted(finger, sensor, parameters)
            problem = Problem.of(scenario)
            texts = c_sources(scenario, problem, ADAPTIVE_MODULES, precision, "tff")
            order = ("types.h", "parameters.h", "limits.h", "adaptive.h", "parameters.c", "limits.c", "adaptive.c")
            own = "\n".join(texts[f"tff_{name}"] for name in order)
            lines = [line for line in own.splitlines() if not line.startswith('#include "')]
            source = "\n".join(["#include <stdlib.h>", *lines, DRIVER])
            made[key] = load_library(source), problem.reference.initial_tension_N
        return ExportedTuner(*made[key])

    return tuner


@pytest.fixture(scope="session")
def blind(finger, independent_rig) -> Callable[..., np.ndarray]:
    """RMS error after 2 s in percent of range, of a tuner around a rig with hidden values."""

    def error(tuner: ExportedTuner, sensor: Sensor, **hidden: float) -> float:
        reference = Problem.of(finger).reference
        rig = independent_rig.Rig(finger.transmission, reference.initial_tension_N, step_s=2e-5, **hidden)
        measure = (lambda r: r.tension_N) if sensor is Sensor.OUTPUT_TENSION else (lambda r: r.position_m)
        noise = NOISE[sensor] * np.random.default_rng(0).normal(size=len(reference.tension_N))
        tension, _ = independent_rig.closed_loop(rig, tuner, reference.tension_N, measure, noise)
        late = slice(round(2 / reference.step_s), None)
        return 100 * float(np.sqrt(np.mean((tension - reference.tension_N)[late] ** 2))) / reference.range_N

    return error
