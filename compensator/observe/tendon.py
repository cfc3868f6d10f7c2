"""The observer of one tendon: the exported C, compiled here."""

import ctypes
from collections.abc import Sequence

import numpy as np

from tendonff.compensator.compensators.base import Problem
from tendonff.compensator.export.host import compile_on_host
from tendonff.compensator.export.modules import OBSERVER
from tendonff.compensator.export.text.c_text import c_sources
from tendonff.compensator.observe.estimate import Estimate, Observation, ObserverStatus, statuses
from tendonff.compensator.scenario.scenario import Scenario
from tendonff.ocp.codegen.compiler import why_no_compiler
from tendonff.ocp.codegen.precision import Precision
from tendonff.ocp.errors import CodeError
from tendonff.ocp.step.joints import Joints

_DRIVER = """#include "tff_observer.h"
long tff_observe_size(void) {{ return (long)sizeof(tff_observer); }}
unsigned tff_observe_init(void *memory, double tension, double input)
{{
    tff_observer *const self = memory;
    if (input == input) {{
        tff_observer_init_at(self, tension, input);
    }} else {{
        tff_observer_init(self, tension);
    }}
    return self->output.status;
}}
unsigned tff_observe_step(
    void *memory, double dt, double tension, double position, const double *joint_rad, double *out)
{{
    tff_observer *const self = memory;
    (void)joint_rad;
    out[0] = tff_observer_step_dt(self, dt, tension, position{joints});
    out[1] = self->output.low;
    out[2] = self->output.high;
    return self->output.status;
}}
"""


class TendonObserver:
    """The compiled observer of one tendon; the arguments are those of `Observer`."""

    tensions = 1

    def __init__(self, scenario: Scenario, start: float | None, given: float | None) -> None:
        problem = Problem.of(scenario)
        joints = Joints.of(problem.chain) if scenario.joints else None
        sources = c_sources(scenario, problem, (OBSERVER,), Precision.DOUBLE, "tff")
        driver = _DRIVER.format(joints="" if joints is None else ", joint_rad")
        host = compile_on_host(sources, driver, Precision.DOUBLE, keep=True)
        if host is None:
            raise CodeError(f"an observer runs compiled C; {why_no_compiler()}")
        self.joints: tuple[str, ...] = () if joints is None else tuple(joints.names)
        self.step_s = problem.reference.step_s
        self.start = problem.reference.initial_tension_N if start is None else start
        address, real = ctypes.c_void_p, ctypes.c_double
        self._memory = ctypes.create_string_buffer(host.function("tff_observe_size", result=ctypes.c_long)())
        self._step = host.function(
            "tff_observe_step", address, real, real, real, address, address, result=ctypes.c_uint
        )
        self._angles = np.array([0.0] if joints is None else [float(q) for q in joints.start_rad])
        self._out = np.zeros(3)
        self._places = tuple(ctypes.c_void_p(a.ctypes.data) for a in (self._angles, self._out))
        init = host.function("tff_observe_init", address, real, real, result=ctypes.c_uint)
        self.status: tuple[ObserverStatus, ...] = statuses(
            init(self._memory, self.start, np.nan if given is None else given)
        )

    def step(self, dt: float, tension_N: float, position_m: float, joint_rad: Sequence[float]) -> Observation:
        """Advance; NaN for what is not measured."""
        self._angles[: len(joint_rad)] = joint_rad
        self.status = statuses(self._step(self._memory, dt, tension_N, position_m, *self._places))
        tension, low, high = self._out.tolist()
        return Observation(tension_N=Estimate(value=tension, low=low, high=high))
