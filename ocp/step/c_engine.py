"""Engine COMPILED: the templated stepper in C."""

import ctypes
import functools

import numpy as np

from tendonff.models.chain import Chain
from tendonff.ocp.codegen.compiler import load_library
from tendonff.ocp.codegen.precision import Precision
from tendonff.ocp.step.laws import inverse_laws, simulation_laws
from tendonff.ocp.step.protocol import Array, InverseRows, Rows, StepperMemory
from tendonff.ocp.step.render import print_laws, render_template
from tendonff.ocp.step.scheme import RESIDUAL_TOLERANCE_N

PREFIX = "tff"


CHAIN_NAMES = (
    *("k1", "k2", "tau", "c", "mass", "b", "p"),
    *("sigma0", "mu_dp", "mu_sp", "mu_dr", "mu_sr", "omega"),
    *("near_mass", "near_damping", "near_stiffness", "far_mass", "far_damping", "far_stiffness"),
)
"""Names of `chain_numbers`, in order; those of the laws' arguments, with the end in front for the end masses."""


class ChainStruct(ctypes.Structure):
    """`tff_chain` of stepper.h.j2, in its order."""

    _fields_ = (
        ("count", ctypes.c_int),
        *((name, ctypes.c_double) for name in ("step_s", *CHAIN_NAMES, "tolerance_N")),
    )


class ReportStruct(ctypes.Structure):
    """`tff_report` of stepper.h.j2."""

    _fields_ = (
        ("converged", ctypes.c_int),
        ("worst_mass", ctypes.c_int),
        ("residual_N", ctypes.c_double),
        ("iterations", ctypes.c_long),
        ("splits", ctypes.c_long),
    )


def chain_struct(chain: Chain, step_s: float) -> ChainStruct:
    """The numbers of a chain in the order that the C code expects.

    Parameters
    ----------
    chain : Chain
    step_s : float
        h [s].
    """
    e = chain.elements
    return ChainStruct(
        e.count,
        step_s,
        *chain_numbers(chain),
        RESIDUAL_TOLERANCE_N,
    )


def chain_numbers(chain: Chain) -> tuple[float, ...]:
    """k1 k2 tau c, mass b p, the bristle's six, near and far mass, damping, stiffness: per element, SI units.

    Parameters
    ----------
    chain : Chain
    """
    e = chain.elements
    return (
        e.stiffness_N_per_m,
        e.relaxing_stiffness_N_per_m,
        e.relaxation_time_s,
        e.damping_N_s_per_m,
        e.mass_kg,
        e.viscous_N_s_per_m,
        e.adhesion_N,
        e.bristle_stiffness_N_per_m,
        e.mu_dynamic_pull,
        e.mu_static_pull,
        e.mu_dynamic_release,
        e.mu_static_release,
        e.stribeck_velocity_m_per_s,
        chain.near.mass_kg,
        chain.near.damping_N_s_per_m,
        chain.near.stiffness_N_per_m,
        chain.far.mass_kg,
        chain.far.damping_N_s_per_m,
        chain.far.stiffness_N_per_m,
    )


@functools.cache
def _source(*, stribeck: bool) -> str:
    parts = [
        "#include <math.h>\n#include <stddef.h>\n",
        render_template("stepper.h.j2", PREFIX, Precision.DOUBLE),
        print_laws((*simulation_laws(stribeck=stribeck), *inverse_laws(stribeck=stribeck)), PREFIX, Precision.DOUBLE),
        render_template("stepper.c.j2", PREFIX, Precision.DOUBLE),
        render_template("inverse.c.j2", PREFIX, Precision.DOUBLE),
        render_template("run.c.j2", PREFIX, Precision.DOUBLE),
    ]
    return "\n".join(parts)


@functools.cache
def _library(*, stribeck: bool) -> ctypes.CDLL:
    library = load_library(_source(stribeck=stribeck))
    library.tff_run.restype = ctypes.c_long
    library.tff_invert_run.restype = None
    library.tff_work_reals.restype = ctypes.c_int
    return library


def _library_of(chain: Chain) -> ctypes.CDLL:
    """The library for a chain: an exponential that only the Stribeck effect needs takes up to two thirds of a step."""
    return _library(stribeck=chain.elements.weakens_with_speed)


def pointer(values: Array | None) -> ctypes.c_void_p:
    """Address of a contiguous array, or null.

    Parameters
    ----------
    values : ndarray or None
    """
    return ctypes.c_void_p(None if values is None else values.ctypes.data)


class CompiledStepper:
    """Advance one chain in compiled C; releases the interpreter lock while it runs.

    Parameters
    ----------
    chain : Chain
    step_s : float
        h [s].

    Raises
    ------
    CodeError
        If no C compiler works here.
    """

    def __init__(self, chain: Chain, step_s: float) -> None:
        self._count = chain.count
        self._struct = chain_struct(chain, step_s)
        self._library = _library_of(chain)
        self._work = np.empty(self._library.tff_work_reals(ctypes.c_int(chain.count)))

    def advance(self, memory: StepperMemory, inputs: Array, record: bool) -> Rows:
        """See `stepping.Stepper`."""
        n, rows = self._count, len(inputs)
        all_inputs = np.ascontiguousarray(np.vstack([memory.inputs, inputs]))
        tension, ends = np.empty((rows, n + 1)), np.empty((rows, 2))
        states = np.empty((rows, 4 * n + 6)) if record else None
        report = ReportStruct()
        done = self._library.tff_run(
            ctypes.byref(self._struct),
            pointer(all_inputs),
            ctypes.c_long(rows),
            ctypes.c_int(memory.fresh),
            pointer(memory.x),
            pointer(memory.x_old),
            pointer(self._work),
            pointer(tension),
            pointer(ends),
            pointer(states),
            ctypes.byref(report),
        )
        if done:
            memory.fresh = False
            memory.inputs = all_inputs[done].copy()
        return Rows(
            tension_N=tension[:done],
            ends_m=ends[:done],
            states=None if states is None else states[:done],
            iterations=report.iterations,
            splits=report.splits,
            residual_N=report.residual_N,
            worst_mass=report.worst_mass,
        )


class CompiledInverse:
    """The exact inverse of one chain in compiled C.

    Parameters
    ----------
    chain : Chain
    step_s : float
        h [s].

    Raises
    ------
    CodeError
        If no C compiler works here.
    """

    def __init__(self, chain: Chain, step_s: float) -> None:
        self._struct = chain_struct(chain, step_s)
        self._library = _library_of(chain)

    def invert(self, x: Array, reference: Array, record: bool) -> InverseRows:
        """Force, least tension and states for references at the ends of the coming steps.

        Parameters
        ----------
        x : ndarray, shape (4 N + 6,)
            State before the first step; not changed.
        reference : ndarray, shape (rows,)
            Output tension [N].
        record : bool
            Keep every state.
        """
        rows, now, old = len(reference), x.copy(), x.copy()
        reference = np.ascontiguousarray(reference, dtype=np.float64)
        force, least = np.empty(rows), np.empty(rows)
        states = np.empty((rows, len(x))) if record else None
        self._library.tff_invert_run(
            ctypes.byref(self._struct),
            pointer(reference),
            ctypes.c_long(rows),
            ctypes.c_int(1),
            pointer(now),
            pointer(old),
            pointer(force),
            pointer(least),
            pointer(states),
        )
        return InverseRows(force_N=force, least_tension_N=least, states=states)
