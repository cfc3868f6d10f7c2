"""A plant that shares nothing with the package but the physics: its own C text, discretisation and time step.

It also does what no model of the package does: uneven paths, bristles that fill up faster or slower than Dahl's,
friction that grows along the path, and cells with an offset.
"""

import ctypes
import functools
import hashlib
import subprocess
import tempfile
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tendonff.models.parameters import Transmission
from tendonff.ocp.codegen.compiler import find_compiler

Array = NDArray[np.float64]

SOURCE = Path(__file__).resolve().with_name("plant.c")
MASSES, STEP_S = 40, 5e-5
POINTER = ctypes.POINTER(ctypes.c_double)


@functools.cache
def library() -> ctypes.CDLL:
    """The compiled plant."""
    compiler = find_compiler()
    if compiler is None:
        raise RuntimeError("the plant needs a C compiler; `pip install 'tendonff[compiler]'` brings one")
    name = hashlib.sha256(SOURCE.read_bytes()).hexdigest()[:16]
    target = Path(tempfile.gettempdir()) / f"tendonff-plant-{name}.so"
    if not target.exists():
        partial = target.with_suffix(f".{id(target)}")
        command = [*compiler, "-O2", "-shared", "-fPIC", "-o", str(partial), str(SOURCE), "-lm"]
        subprocess.run(command, check=True)
        partial.replace(target)
    return ctypes.CDLL(str(target))


@dataclass(frozen=True, slots=True, kw_only=True)
class Plant:
    """A rig.

    Parameters
    ----------
    transmission : Transmission
        Parameters of the physics that the package knows; presliding.
    power : float
        Exponent of the bristle's law; 1 is Dahl's.
    concentration : float
        So many times the mean wrap angle per length in the first quarter of the length; 1 is an even path.
    pulley : float
        Share of the friction's exponent that one place in the middle carries, as a pulley's bearing does.
    second_relaxation : tuple of float
        Stiffness [N/m] and time [s] of a second relaxing element; a stiffness of 0 is none.
    falling : tuple of float
        Exponent by which friction falls with tension, and the tension at which the coefficients hold [N].
    growing : float
        By which share friction is less than its mean at the near end, and more at the far end.
    """

    transmission: Transmission
    power: float = 1.0
    concentration: float = 1.0
    pulley: float = 0.0
    second_relaxation: tuple[float, float] = (0.0, 1.0)
    falling: tuple[float, float] = (0.0, 1.0)
    growing: float = 0.0
    masses: int = field(default=MASSES)

    def respond(self, force_N: Array, sample_s: float, rest_N: float) -> Array:
        """Input tension, output tension, actuator's and load's position at the samples, shape (n, 4)."""
        t, f = self.transmission, self.transmission.friction
        numbers = (
            *(t.tendon.mass_kg, f.viscous_N_s_per_m, t.tendon.stiffness_N_per_m, t.tendon.relaxing_stiffness_N_per_m),
            *(t.tendon.relaxation_time_s, t.tendon.damping_N_s_per_m, f.soft_bristle_stiffness_N_per_m),
            *(f.mu_dynamic, f.release_dynamic, f.mu_static / f.mu_dynamic - 1, f.stribeck_velocity_m_per_s),
            *(f.adhesion_N, self.power, t.actuator.mass_kg, t.actuator.damping_N_s_per_m),
            *(t.load.mass_kg, t.load.stiffness_N_per_m, t.load.damping_N_s_per_m),
            *self.second_relaxation,
            *(*self.falling, self.growing),
        )
        plant = (ctypes.c_double * len(numbers))(*numbers)
        place = (np.arange(self.masses) + 0.5) / self.masses
        dense = np.where(place < 0.25, self.concentration, (1 - 0.25 * self.concentration) / 0.75)
        angle = t.path.total_angle_rad * (1 - self.pulley) * dense / dense.sum()
        angle[self.masses // 2] += t.path.total_angle_rad * self.pulley
        share = np.full(self.masses + 1, 1.0 / self.masses)
        share[[0, -1]] /= 2
        force = np.ascontiguousarray(force_N, dtype=np.float64)
        out = np.empty((len(force), 4))
        steps = max(1, round(sample_s / STEP_S))
        status = library().run(
            plant,
            ctypes.c_int(self.masses),
            angle.ctypes.data_as(POINTER),
            share.ctypes.data_as(POINTER),
            ctypes.c_double(rest_N),
            force.ctypes.data_as(POINTER),
            ctypes.c_int(len(force)),
            ctypes.c_double(sample_s),
            ctypes.c_int(steps),
            out.ctypes.data_as(POINTER),
        )
        if status:
            raise RuntimeError(f"the plant failed with status {status}")
        return out
