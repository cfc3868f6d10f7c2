"""The exported C inverse as a library of this machine: what a controller would run."""

import ctypes
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tendonff.compensator.export.c_project import export_project
from tendonff.compensator.scenario.joints import SineJoint
from tendonff.compensator.scenario.reference import SineReference
from tendonff.compensator.scenario.scenario import Scenario, load_scenario
from tendonff.models.parameters import Transmission
from tendonff.ocp.codegen.compiler import find_compiler, run_compiler
from tendonff.ocp.errors import CodeError

_DRIVER = """
#include "tff_inverse.h"
static tff_inverse self;
void start(double tension) { tff_inverse_init(&self, tension); }
double step(double reference, const double *joint_rad) { return tff_inverse_step(&self, reference, joint_rad); }
"""


def scenario_of(rig: Transmission, start_N: float, step_s: float) -> Scenario:
    """The finger's flexor as a scenario; its reference and motion stand for what the controller will meet."""
    base = load_scenario(Path(__file__).parents[1] / "finger_moving.toml")
    swing = SineJoint(offset_rad=0.5, amplitudes_rad=(0.4,), frequencies_Hz=(0.9,), fade_in_s=0.5)
    return replace(
        base,
        name="flexor of the finger in MuJoCo",
        transmission=replace(rig, motion=None),
        joints=dict.fromkeys(rig.joints, swing),
        reference=SineReference(
            initial_tension_N=start_N, amplitudes_N=(7.0,), frequencies_Hz=(0.6,), duration_s=2.0, fade_in_s=0.5
        ),
        run=replace(base.run, step_s=step_s),
    )


class ExportedInverse:
    """`tff_inverse` in motion, from rest under a tension."""

    def __init__(self, rig: Transmission, start_N: float, step_s: float) -> None:
        compiler = find_compiler()
        if compiler is None:
            raise CodeError("no C compiler found: the exported inverse cannot run here")
        with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as scratch:
            folder = Path(scratch)
            export_project(scenario_of(rig, start_N, step_s), profile_N=np.full(2, start_N)).write(folder)
            (folder / "driver.c").write_text(_DRIVER, encoding="utf-8")
            sources = ["driver.c", *(f"tff_{name}.c" for name in ("parameters", "limits", "path", "inverse"))]
            flags = ["-std=c99", "-O2", "-shared", "-fPIC", "-ffp-contract=off", "-o", "code.so", *sources, "-lm"]
            if complaint := run_compiler(compiler, flags, folder):
                raise CodeError(f"the exported sources: {complaint}")
            self._code = ctypes.CDLL(str(folder / "code.so"))
        self._code.step.restype = ctypes.c_double
        self._code.start.argtypes = [ctypes.c_double]
        self._code.step.argtypes = [ctypes.c_double, ctypes.POINTER(ctypes.c_double)]
        self._code.start(start_N)

    def step(self, reference_N: float, joint_rad: NDArray[np.float64]) -> float:
        """Force at the end of a sample, for the tension and the joint angles there."""
        angles = np.ascontiguousarray(joint_rad, dtype=np.float64)
        pointer = angles.ctypes.data_as(ctypes.POINTER(ctypes.c_double))
        return float(self._code.step(reference_N, pointer))
