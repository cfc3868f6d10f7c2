"""Engine COMPILED: the templated stepper in C."""

import ctypes
import functools
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tendonff.models.layout import ChainInputs
from tendonff.models.path import CutPath, JointMotion
from tendonff.models.tendon.chain import Chain, path_at
from tendonff.models.turns import out_of_turn
from tendonff.ocp.codegen.compiler import load_library
from tendonff.ocp.codegen.partial_evaluation import PartialEvaluator
from tendonff.ocp.codegen.precision import Precision
from tendonff.ocp.codegen.printer import Law
from tendonff.ocp.step.laws import ElementLaws, twins_of
from tendonff.ocp.step.protocol import Array, InverseRows, Rows, StepperMemory
from tendonff.ocp.step.render import StepCode, core_text

PREFIX = "tff"
CORE = "tff_core.h"
"""Name of the fixed text of bodies and tendons among templates."""


class ReportStruct(ctypes.Structure):
    """`tff_report` of types.h.j2."""

    _fields_ = (
        ("converged", ctypes.c_int),
        ("residual_N", ctypes.c_double),
        ("iterations", ctypes.c_long),
        ("splits", ctypes.c_long),
        ("evaluations", ctypes.c_long),
    )


def chain_struct(chain: Chain) -> ctypes.Structure:
    """The numbers of a chain as `tff_weights` of host.h.j2; what belongs to a weight is left for the C code to fill."""
    numbers, elements = chain.numbers(), chain.elements
    of_masses = np.ascontiguousarray(np.stack(list(chain.of_masses().values())))
    inner, ends = link_ratios(elements.ratio)
    run_end = elements.path.run_end
    struct = _struct_type(tuple(numbers))(
        *(chain.count, 0.0, 0.0, 0.0, inner, ends, of_masses.ctypes.data, run_end.ctypes.data),
        *(elements.path.total_angle_rad, chain.far_joint is not None, *numbers.values()),
    )
    struct.kept_alive = of_masses, run_end
    return struct


def link_ratios(ratio: Array) -> tuple[float, float]:
    """Length of the whole over that of an inner link, and over that of an end link, where all masses are alike."""
    return float(ratio[1]) if len(ratio) > 2 else float(ratio[0]), float(ratio[0])


@functools.cache
def _struct_type(names: tuple[str, ...]) -> type[ctypes.Structure]:
    fields = [
        ("count", ctypes.c_int),
        *((name, ctypes.c_double) for name in ("H", "carry", "gain", "ratio", "ratio_of_ends")),
        ("of_masses", ctypes.c_void_p),
        ("run_end", ctypes.c_void_p),
        ("total_angle_rad", ctypes.c_double),
        ("far_driven", ctypes.c_int),
        *((name, ctypes.c_double) for name in names),
    ]
    return type("Weights", (ctypes.Structure,), {"_fields_": fields})


def places_of(chain: Chain, time_s: float, step_s: float, rows: int) -> list[Array]:
    """Where the path is one step before an instant, at it, and at the ends of the steps that follow; as arguments in C.

    None where all masses are alike and nothing moves.
    """
    if not chain.moving:
        return []
    return [_places(chain.elements.path, chain.motion, chain.far_joint, time_s, step_s, rows)]


@functools.lru_cache(maxsize=2)  # the search for the steady state of a cycle runs one period over and over
def _places(
    path: CutPath,
    motion: JointMotion | None,
    far_joint: tuple[str, float] | None,
    time_s: float,
    step_s: float,
    rows: int,
) -> Array:
    table = np.ascontiguousarray(path_at(path, motion, far_joint, time_s + step_s * np.arange(-1.0, rows + 1)).table())
    table.flags.writeable = False
    return table


def host_source(
    chain: Chain,
    laws: tuple[Law, ...],
    templates: tuple[str, ...],
    *,
    ways_differ: bool = False,
    joint_numbers: tuple[str, ...] = (),
) -> str:
    """C for chains of any size with the laws of this one; friction of the two directions may be set apart."""
    printer = PartialEvaluator(prefix=PREFIX, precision=Precision.DOUBLE, parameters={})
    elements = ElementLaws.of(chain, folded=True)
    moved = (elements.contact(twins_of(chain, ways_differ=ways_differ)),) if chain.moving else ()
    whole = () if CORE in templates else tuple(law.name for law in laws)
    printed = {law.name: law for law in printer.parts((*laws, *moved), whole)}
    templates = ("moving.c.j2", *templates) if chain.moving else templates
    code = StepCode(
        prefix=PREFIX,
        precision=Precision.DOUBLE,
        layout=chain.layout,
        laws=printed,
        count="c->count",
        size="n",
        numbers={name: f"c->{name}" for name in chain.numbers()},
        host=True,
        moving=chain.moving,
        of_masses=tuple(chain.of_masses()),
        joint_numbers=joint_numbers,
    )
    parts = ["#include <math.h>\n#include <stddef.h>\n", *(code.render(name) for name in ("types.h.j2", "host.h.j2"))]
    parts += [law.code for law in printed.values()]
    parts += [core_text(PREFIX) if name == CORE else code.render(name) for name in templates]
    return "\n".join(parts)


def library_of(chain: Chain, make_source: Callable[[Chain], str]) -> ctypes.CDLL:
    """The library for the laws of a chain; chains that differ in numbers alone share it."""
    aliases = frozenset(chain.friction.aliases().items())
    twins = frozenset(twins_of(chain).items()) if chain.moving else None
    key = (make_source.__name__, type(chain.friction), type(chain.link), type(chain.near), aliases, twins)
    if (known := _LIBRARIES.get(key)) is None:
        known = _LIBRARIES[key] = load_library(make_source(chain))
        known.tff_work_reals.restype = ctypes.c_int
    return known


_LIBRARIES: dict[object, ctypes.CDLL] = {}


def _step_source(chain: Chain) -> str:
    laws = ElementLaws.of(chain, folded=True)
    templates = ("kernel.c.j2", "pieces.c.j2", "inverse.c.j2", "weigh.c.j2", "run.c.j2", "invert_run.c.j2")
    return host_source(chain, (*laws.simulation(), *laws.inverse()), templates)


def _library_of(chain: Chain) -> ctypes.CDLL:
    """The library for a chain: an exponential that only the Stribeck effect needs takes up to two thirds of a step."""
    library = library_of(chain, _step_source)
    library.tff_run.restype = ctypes.c_long
    library.tff_invert_run.restype = None
    return library


def pointer(values: NDArray[Any] | None) -> ctypes.c_void_p:
    """Address of a contiguous array, or null."""
    return ctypes.c_void_p(None if values is None else values.ctypes.data)


class CompiledStepper:
    """Advance one chain in compiled C; releases the interpreter lock while it runs.

    Raises
    ------
    CodeError
        If no C compiler works here.
    """

    def __init__(self, chain: Chain, step_s: float) -> None:
        self._chain, self._step_s = chain, step_s
        self._struct = chain_struct(chain)
        self._library = _library_of(chain)
        self._work = np.empty(self._library.tff_work_reals(ctypes.c_int(chain.count)))
        self._work_at = pointer(self._work)

    def advance(self, memory: StepperMemory, inputs: ChainInputs, record: bool) -> Rows:
        """See `protocol.Stepper`."""
        rows = len(inputs)
        table = inputs.table(memory.inputs)
        tension, ends = np.empty((rows, self._chain.count + 1)), np.empty((rows, 2))
        states = np.empty((rows, self._chain.layout.size)) if record else None
        report, worst = ReportStruct(), ctypes.c_int()
        places = places_of(self._chain, memory.time_s, self._step_s, rows)
        with out_of_turn():
            done = self._library.tff_run(
                *(ctypes.byref(self._struct), ctypes.c_double(self._step_s), pointer(table)),
                *(ctypes.c_long(rows), ctypes.c_int(memory.fresh)),
                *map(pointer, (*places, memory.x, memory.x_old)),
                self._work_at,
                *map(pointer, (tension, ends, states)),
                *map(ctypes.byref, (report, worst)),
            )
        if done:
            memory.fresh = False
            memory.time_s += done * self._step_s
            memory.inputs = inputs[done - 1 : done]
        return Rows(
            tension_N=tension[:done],
            ends_m=ends[:done],
            states=None if states is None else states[:done],
            iterations=report.iterations,
            splits=report.splits,
            evaluations=report.evaluations,
            residual_N=report.residual_N,
            worst_mass=worst.value,
        )


class CompiledInverse:
    """The exact inverse of one chain in compiled C.

    Raises
    ------
    CodeError
        If no C compiler works here.
    """

    def __init__(self, chain: Chain, step_s: float) -> None:
        self._chain, self._struct, self._step_s = chain, chain_struct(chain), step_s
        self._library = _library_of(chain)

    def invert(self, x: Array, time_s: float, reference: Array, record: bool) -> InverseRows:
        """See `protocol.Inverse`."""
        rows, now, old = len(reference), x.copy(), x.copy()
        reference = np.ascontiguousarray(reference, dtype=np.float64)
        force, least = np.empty(rows), np.empty(rows)
        states = np.empty((rows, len(x))) if record else None
        places = places_of(self._chain, time_s, self._step_s, rows)
        work = np.empty(self._library.tff_work_reals(ctypes.c_int(self._chain.count)))
        with out_of_turn():
            self._library.tff_invert_run(
                *(ctypes.byref(self._struct), ctypes.c_double(self._step_s), pointer(reference)),
                *(ctypes.c_long(rows), ctypes.c_int(1), *map(pointer, [*places, work] if places else [])),
                *map(pointer, (now, old, force, least, states)),
            )
        return InverseRows(force_N=force, least_tension_N=least, states=states, x=now)
