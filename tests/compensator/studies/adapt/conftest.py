"""The exported tuner, compiled and closed around the independent rig."""

import ctypes
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from tendonff.compensator.compensators.base import Problem
from tendonff.compensator.export.modules import ADAPTIVE, ADAPTIVE_MODULES
from tendonff.compensator.export.text.c_text import c_sources
from tendonff.compensator.scenario.scenario import Scenario
from tendonff.compensator.scenario.settings import Adaptation
from tendonff.compensator.scenarios import load_scenario
from tendonff.ocp.adaptation.tuning import Sensor, Tunable
from tendonff.ocp.codegen.compiler import load_library
from tendonff.ocp.codegen.precision import Precision

NOISE = {Sensor.OUTPUT_TENSION: 0.165, Sensor.ACTUATOR_POSITION: 2e-5}
DRIVER = """
tff_adaptive *made(void) { return (tff_adaptive *)calloc(1, sizeof(tff_adaptive)); }
void begin(tff_adaptive *self, double tension) { tff_adaptive_init(self, (tff_real)tension); }
double step(tff_adaptive *self, double reference, double measured, const double *joint_rad)
{
#ifdef TFF_JOINTS
    tff_real angle[TFF_JOINTS];
    for (int k = 0; k < TFF_JOINTS; k++) {
        angle[k] = (tff_real)joint_rad[k];
    }
    return (double)tff_adaptive_step(self, (tff_real)reference, (tff_real)measured, angle);
#else
    (void)joint_rad;
    return (double)tff_adaptive_step(self, (tff_real)reference, (tff_real)measured);
#endif
}
#ifdef TFF_JOINTS
void begin_at(tff_adaptive *self, double tension, const double *joint_rad)
{
    tff_real angle[TFF_JOINTS];
    for (int k = 0; k < TFF_JOINTS; k++) {
        angle[k] = (tff_real)joint_rad[k];
    }
    tff_adaptive_init_at(self, (tff_real)tension, (tff_real)tension, angle);
}
#endif
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
        self.library, self.start_N = library, tension_N
        library.made.restype = ctypes.c_void_p
        library.step.restype = library.mu.restype = ctypes.c_double
        library.status.restype = ctypes.c_uint
        self.address = ctypes.c_void_p(library.made())
        library.begin(self.address, ctypes.c_double(tension_N))

    def step(self, reference_N: float, measured: float, joint_rad=()) -> float:
        angles = (ctypes.c_double * len(joint_rad))(*joint_rad)
        numbers = ctypes.c_double(reference_N), ctypes.c_double(measured)
        return float(self.library.step(self.address, *numbers, angles))

    def begin_at(self, tension_N: float, joint_rad) -> None:
        angles = (ctypes.c_double * len(joint_rad))(*joint_rad)
        self.library.begin_at(self.address, ctypes.c_double(tension_N), angles)

    @property
    def status(self) -> int:
        return int(self.library.status(self.address))

    @property
    def mu(self) -> float:
        return float(self.library.mu(self.address))


def compiled_tuner(scenario: Scenario, problem: Problem, precision: Precision) -> ExportedTuner:
    """The tuner of a scenario's exported C, at rest."""
    modules, path = (ADAPTIVE_MODULES, ()) if problem.chain.motion is None else ((ADAPTIVE,), ("path",))
    texts = c_sources(scenario, problem, modules, precision, "tff")
    names = ("parameters", "limits", *path, "state", "chain", "adaptive")
    order = ("types.h", *(f"{name}.h" for name in (*names, "inversion")), *(f"{name}.c" for name in names))
    own = "\n".join(texts[f"tff_{name}"] for name in order)
    lines = [line for line in own.splitlines() if not line.startswith('#include "')]
    library = load_library("\n".join(["#include <stdlib.h>", *lines, DRIVER]))
    return ExportedTuner(library, problem.reference.initial_tension_N)


@pytest.fixture(scope="session")
def tuner_of() -> Callable[..., ExportedTuner]:
    return compiled_tuner


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
    made: dict[object, ExportedTuner] = {}

    def tuner(sensor: Sensor, parameters=(Tunable.MU,), precision: Precision = Precision.DOUBLE) -> ExportedTuner:
        key = (sensor, parameters, precision)
        if key not in made:
            scenario = adapted(finger, sensor, parameters)
            made[key] = compiled_tuner(scenario, Problem.of(scenario), precision)
        return ExportedTuner(made[key].library, made[key].start_N)

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
