"""The exported C inverse and plant as libraries of this machine: what a controller and a test bench would run."""

import ctypes
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from tendonff.compensator.export.c_project import export_project
from tendonff.compensator.scenario.joints import SineJoint
from tendonff.compensator.scenario.reference import SineReference
from tendonff.compensator.scenario.scenario import Scenario
from tendonff.compensator.scenarios import load_scenario
from tendonff.models.parameters import Transmission
from tendonff.ocp.codegen.compiler import find_compiler, run_compiler
from tendonff.ocp.errors import CodeError

Array = NDArray[np.float64]

_INVERSE = """
#include "tff_inverse.h"
static tff_inverse self;
void start(double tension) { tff_inverse_init(&self, tension); }
double step(double reference, const double *joint_rad) { return tff_inverse_step(&self, reference, joint_rad); }
"""
# The plant gives the output tension; each joint needs that of its own link, which the laws printed into the file give.
_PLANT = """
#include "tff_chain.c"
#include "tff_plant.h"
static tff_plant self;
static tff_chain_work work;
/* A step of no length: what elongation and relaxed elongation alone make of the force. */
static const tff_weights instant = { .link_start_1 = WHOLE_N_PER_M, .link_start_2 = RELAXING_N_PER_M };
void start(double tension, const double *joint_rad)
{
    tff_plant_init(&self, tension);
    tff_plant_step(&self, tension, joint_rad);
}
unsigned step(double force, const double *joint_rad, double *tension)
{
    const tff_chain_place place = { &self.chain.path, self.chain.contact };
    int i;
    tff_plant_step(&self, force, joint_rad);
    tff_chain_spread(&place, &work);
    tff_chain_link_starts(&instant, TFF_PLANT_COUNT, work.ratio, self.chain.x, work.start, work.gain);
    tff_chain_tensions(&instant, TFF_PLANT_COUNT, work.gain, work.drift, self.chain.x, &work);
    for (i = 0; i <= TFF_PLANT_COUNT; i++) {
        tension[i] = work.force[i];
    }
    return self.status & TFF_FAILED;
}
double output(void) { return self.tension; }
double actuator(void) { return tff_plant_actuator_position(&self); }
"""


def scenario_of(rig: Transmission, start_N: float, step_s: float) -> Scenario:
    """The finger's flexor as a scenario; its reference and motion stand for what the controller will meet."""
    base = cast("Scenario", load_scenario(Path(__file__).parents[1] / "finger_moving.toml"))
    swing = SineJoint(offset_rad=0.5, amplitudes_rad=(0.4,), frequencies_Hz=(0.9,), fade_in_s=0.5)
    return replace(
        base,
        name="flexor of the finger in MuJoCo",
        transmission=replace(rig, motion=None),
        joints=dict.fromkeys(rig.joints, swing),
        reference=SineReference(
            initial_tension_N=start_N, amplitudes_N=(7.0,), frequencies_Hz=(0.6,), duration_s=1.0, fade_in_s=0.5
        ),
        run=replace(base.run, step_s=step_s),
    )


def _compiled(driver: str, modules: tuple[str, ...], rig: Transmission, start_N: float, step_s: float) -> ctypes.CDLL:
    """The exported folder's modules behind a driver, as a library; what the driver includes is not repeated."""
    compiler = find_compiler()
    if compiler is None:
        raise CodeError("no C compiler found: the exported code cannot run here")
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as scratch:
        folder = Path(scratch)
        export_project(scenario_of(rig, start_N, step_s), profile_N=np.full(2, start_N)).write(folder)
        (folder / "driver.c").write_text(driver, encoding="utf-8")
        sources = ["driver.c", *(f"tff_{name}.c" for name in ("parameters", "limits", "path", "state", *modules))]
        flags = ["-std=c99", "-O2", "-shared", "-fPIC", "-ffp-contract=off", "-o", "code.so", *sources, "-lm"]
        if complaint := run_compiler(compiler, flags, folder):
            raise CodeError(f"the exported sources: {complaint}")
        return ctypes.CDLL(str(folder / "code.so"))


def _pointer(values: Array) -> Any:
    return values.ctypes.data_as(ctypes.POINTER(ctypes.c_double))


class ExportedInverse:
    """`tff_inverse` in motion, from rest under a tension."""

    def __init__(self, rig: Transmission, start_N: float, step_s: float) -> None:
        self._code = _compiled(_INVERSE, ("inverse",), rig, start_N, step_s)
        self._code.step.restype = ctypes.c_double
        self._code.start.argtypes = [ctypes.c_double]
        self._code.step.argtypes = [ctypes.c_double, ctypes.POINTER(ctypes.c_double)]
        self._code.start(start_N)

    def step(self, reference_N: float, joint_rad: Array) -> float:
        """Force at the end of a sample, for the tension and the joint angles there."""
        return float(self._code.step(reference_N, _pointer(np.ascontiguousarray(joint_rad, dtype=np.float64))))


class ExportedPlant:
    """`tff_plant` in motion: force and joint angles in, the tension of each link out.

    Attributes
    ----------
    tension_N : ndarray, shape (links,)
        Tension of each link from the actuator on.
    held : int
        Samples in which its bounded work found no balance: it held its tension, as the exported code says.
    """

    def __init__(self, rig: Transmission, start_N: float, step_s: float) -> None:
        tendon = rig.tendon
        relaxing = tendon.relaxing_stiffness_N_per_m
        numbers = {"WHOLE": tendon.stiffness_N_per_m + relaxing, "RELAXING": relaxing}
        known = "".join(f"#define {name}_N_PER_M {value!r}\n" for name, value in numbers.items())
        self._code = _compiled(known + _PLANT, ("plant",), rig, start_N, step_s)
        real, array = ctypes.c_double, ctypes.POINTER(ctypes.c_double)
        self._code.start.argtypes = [real, array]
        self._code.step.argtypes = [real, array, array]
        self._code.step.restype = ctypes.c_uint
        self._code.output.restype = self._code.actuator.restype = real
        self.held = 0
        self._start_N, self.tension_N = start_N, np.full(rig.path.segments + 1, start_N)

    def start(self, joint_rad: Array) -> None:
        """At rest, where the joints stand."""
        self._code.start(self._start_N, _pointer(np.ascontiguousarray(joint_rad, dtype=np.float64)))
        self.tension_N = np.full_like(self.tension_N, self._start_N)

    def step(self, force_N: float, joint_rad: Array) -> None:
        """To the end of a sample, where force and joint angles are these."""
        found = np.empty_like(self.tension_N)
        if self._code.step(force_N, _pointer(np.ascontiguousarray(joint_rad, dtype=np.float64)), _pointer(found)):
            self.held += 1
        else:
            self.tension_N = found

    @property
    def output_N(self) -> float:
        """Output tension as the plant itself gives it."""
        return float(self._code.output())

    @property
    def actuator_m(self) -> float:
        """Position of the actuator, positive away from the tendon."""
        return float(self._code.actuator())
