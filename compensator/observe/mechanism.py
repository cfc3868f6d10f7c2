"""The observer of a driven joint with one motor: the exported C inverted, at three amounts of friction.

Angle and contact are both unknown, angle and torque of the motor are both measured: the angle follows from the motor's
by the chain, and the contact is integrated until the chain asks for the torque that the motor gives.
"""

import ctypes
import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np

from tendonff.compensator.export.host import compile_on_host
from tendonff.compensator.export.joint.text import joint_sources, problem_of
from tendonff.compensator.files.reading import InputError
from tendonff.compensator.observe.estimate import Estimate, Observation, ObserverStatus, statuses
from tendonff.compensator.scenario.driven.joint import JointScenario, sample_joint
from tendonff.models.joint.parameters import Mechanism
from tendonff.models.joint.parameters.finger import Finger
from tendonff.ocp.codegen.compiler import why_no_compiler
from tendonff.ocp.codegen.precision import Precision
from tendonff.ocp.errors import CodeError
from tendonff.ocp.joint.target import other_joints
from tendonff.ocp.step.protocol import Array

SPREAD = 0.2
"""Relative half-width of the friction that the bounds admit."""

FOLLOW_S, FOLLOW_PERIODS = 0.005, 1.5
"""Time in which the contact follows the motor's torque, at least; and over 1/omega of the joint on its tendons."""

_PROBE_RAD = 1e-5

_DRIVER = """#include "tff_joint.h"
typedef struct {{
    tff_joint joint[{count}];
    double contact[{count}];
    double motor;
    double way;
}} tff_watched;
long tff_watch_size(void) {{ return (long)sizeof(tff_watched); }}
int tff_watch_init(void *memory, double start, const double *others)
{{
    tff_watched *const self = memory;
    int k, good = 1;
    (void)others;
    for (k = 0; k < {count}; k++) {{
        self->contact[k] = 0.0;
        good = good && (tff_joint_init(&self->joint[k], k, start, 0.0{others}) != 0);
    }}
    self->motor = 0.0;
    self->way = 0.0;
    return good;
}}
unsigned tff_watch_step(void *memory, double dt, double motor, double torque, const double *others, double *out)
{{
    tff_watched *const self = memory;
    unsigned status = 0u;
    int k;
    (void)others;
    for (k = 0; k < {count}; k++) {{
        tff_joint *const one = &self->joint[k];
        status |= tff_joint_observe(one, dt, motor, self->contact[k]{others});
        if ((torque == torque) && ((one->status & (TFF_FAILED | TFF_INPUT_HELD)) == 0u)) {{
            const double share = dt / (dt + {follow!r});
            const double asked = one->motor_torque_N_m[0] + ({coulomb!r} * self->way);
            self->contact[k] += share * (torque - asked) / tff_joint_each[k].observed / {steep!r};
        }}
        out[3 * k] = one->angle_rad;
        out[(3 * k) + 1] = one->tension_N[0];
        out[(3 * k) + 2] = one->tension_N[1];
    }}
    if (motor == motor) {{
        const double moved = (motor - self->motor) / {turn!r};
        self->way = fmax(-1.0, fmin(1.0, self->way + moved)); /* a bristle of the drive's dry friction */
        self->motor = motor;
    }}
    return status;
}}
"""


class MechanismObserver:
    """The compiled joint at the scenario's friction, and at less and more of it."""

    tensions = 0

    def __init__(self, scenario: JointScenario, start: float | None) -> None:
        sampled = sample_joint(scenario)
        problem, mechanism = problem_of(scenario, sampled), scenario.mechanism
        plants = tuple(
            replace(scenario, name=f"{scenario.name} {word}", mechanism=rubbing(mechanism, factor))
            for word, factor in (("as it is", 1.0), ("less friction", 1 - SPREAD), ("more friction", 1 + SPREAD))
        )
        names = other_joints((problem,))
        columns = sampled.others(mechanism.joint.name)
        self.joints: tuple[str, ...] = tuple(names)
        self._mechanism = mechanism
        self._others = np.array([*(float(columns[name][0]) for name in names), 0.0])
        largest = max(
            sum(s.angle_rad * (s.mu_dynamic or t.friction.mu_dynamic) for s in t.path.parts) for t in mechanism.tendons
        )
        driver = _DRIVER.format(
            count=len(plants),
            others=", others" if names else "",
            follow=self._follow_s(mechanism, float(sampled.angle_rad[0])),
            coulomb=mechanism.drive.coulomb_N_m or 0.0,
            steep=math.exp(2 * (1 + SPREAD) * largest),
            turn=1e-3,
        )
        host = compile_on_host(joint_sources(plants), driver, Precision.DOUBLE, keep=True)
        if host is None:
            raise CodeError(f"an observer runs compiled C; {why_no_compiler()}")
        self.step_s = scenario.run.step_s
        self.start = float(sampled.angle_rad[0]) if start is None else start
        self._out = np.zeros(3 * len(plants))
        address, real = ctypes.c_void_p, ctypes.c_double
        self._memory = ctypes.create_string_buffer(host.function("tff_watch_size", result=ctypes.c_long)())
        self._step = host.function("tff_watch_step", address, real, real, real, address, address, result=ctypes.c_uint)
        self._places = tuple(ctypes.c_void_p(a.ctypes.data) for a in (self._others, self._out))
        init = host.function("tff_watch_init", address, real, address, result=ctypes.c_int)
        if init(self._memory, self.start, self._places[0]) != 1:
            raise InputError(f"an observer cannot start at {self.start:g} rad: it is out of the scenario's range")
        self.status: tuple[ObserverStatus, ...] = ()

    def step(self, dt: float, motor_rad: float, motor_torque_N_m: float, others: Sequence[float]) -> Observation:
        """Advance; NaN for what is not measured."""
        self._others[: len(others)] = others
        self.status = statuses(self._step(self._memory, dt, motor_rad, motor_torque_N_m, *self._places))
        rows = self._out.reshape(-1, 3)
        angles = rows[:, 0].tolist()
        torques = [float(self._arms(row[0]) @ row[1 : 1 + len(self._mechanism.tendons)]) for row in rows]
        return Observation(angle_rad=_enclosed(angles), torque_N_m=_enclosed(torques))

    def _follow_s(self, mechanism: Mechanism, angle_rad: float) -> float:
        """Time in which the contact can follow without shaking the joint on its tendons."""
        stiff = sum(
            float(arm) ** 2 * (t.tendon.stiffness_N_per_m + t.tendon.relaxing_stiffness_N_per_m)
            for arm, t in zip(self._arms(angle_rad), mechanism.tendons, strict=True)
        )
        return max(FOLLOW_S, FOLLOW_PERIODS * math.sqrt(mechanism.joint.inertia_kg_m2 / stiff))

    def _arms(self, angle_rad: float) -> Array:
        """Moment arms at an angle [m]."""
        ends = np.array([angle_rad - _PROBE_RAD, angle_rad + _PROBE_RAD])
        others = {name: np.full(2, value) for name, value in zip(self.joints, self._others, strict=False)}
        travels = [np.diff(tendon.path_travel_m(ends, others))[0] for tendon in self._mechanism.tendons]
        return np.array(travels) / (2 * _PROBE_RAD)


def _enclosed(values: Sequence[float]) -> Estimate:
    return Estimate(value=values[0], low=min(values), high=max(values))


S = TypeVar("S", Mechanism, Finger)


def rubbing(mechanism: S, factor: float) -> S:
    """The mechanism with all friction coefficients of its tendons times a factor."""

    def scaled(part: object, names: Sequence[str]) -> dict[str, float]:
        return {n: factor * value for n in names if (value := getattr(part, n)) is not None}

    mus = ("mu_dynamic", "mu_static", "mu_dynamic_release", "mu_static_release")
    tendons = []
    for tendon in mechanism.tendons:
        sections = tuple(replace(s, **scaled(s, mus)) for s in tendon.path.sections)  # type: ignore[arg-type]
        friction = replace(tendon.friction, **scaled(tendon.friction, mus))
        tendons.append(replace(tendon, friction=friction, path=replace(tendon.path, sections=sections)))
    return replace(mechanism, tendons=tuple(tendons))
