"""Ways of calling exported C that follow each other: mixed steps, missed calls and lost angles, as figures.

    python benchmarks/call_sequences.py

Largest change of the output from call to call where `_step` and `_step_dt` alternate, and where every call is
`_step_dt` at the same times; and on the finger that moves, how far the force is from that of one that lost nothing.
"""

import ctypes
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import IntEnum
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import tendonff as tf
from tendonff.compensator.compensators.base import Problem
from tendonff.compensator.compensators.stream import choose_stream
from tendonff.compensator.compensators.table import table_of
from tendonff.compensator.export.host import HostCode, compile_on_host
from tendonff.compensator.export.modules import STREAM, c_modules
from tendonff.compensator.export.text.c_text import c_sources, table_context
from tendonff.compensator.scenario.settings import Adaptation, Stream
from tendonff.models.parameters.drive import Drive
from tendonff.ocp.adaptation.tuning import Sensor
from tendonff.ocp.codegen.precision import Precision

Array = NDArray[np.float64]
EXAMPLES = Path(__file__).parents[1] / "examples"
FOLLOWERS = ("inverse", "stream", "adaptive", "capstan", "table")


class Op(IntEnum):
    """Kind of a call, and the meaning of its `value`."""

    STEP = 0
    STEP_DT = 1  # time since the last call [s]
    MISSED = 2  # calls
    INIT = 3
    INIT_AT = 4  # force [N]
    USE = 5  # factor on friction; narrower limits with it


@dataclass(frozen=True, slots=True, kw_only=True)
class Call:
    """A call of a module; a start has its tension in `reference`."""

    op: Op
    reference: float = math.nan  # [N]
    value: float = math.nan
    measured: float = math.nan
    joints_rad: tuple[float, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Answers:
    """Answers of a module after each call, shape (calls,)."""

    output: Array  # [N], of a position drive [m]
    force: Array  # [N]
    status: NDArray[np.int64]
    seen: NDArray[np.int64]


_DRIVER = """
#include <string.h>
#include "tff_{module}.h"
void run_{module}(long n, const double *rows, double *answers)
{{
    tff_{module} self;
    long k;
    memset(&self, 0xA5, sizeof self);
    for (k = 0; k < n; k++) {{
        const double *const row = &rows[k * {width}];
        tff_parameters own;
        const tff_real reference = row[1];
        double given = answers[4 * k];
        switch ((int)row[0]) {{
        case 0: given = tff_{module}_step(&self, reference{arguments}); break;
        case 1: given = tff_{module}_step_dt(&self, row[2], reference{arguments}); break;
        case 2: tff_{module}_missed(&self, (int32_t)row[2]); given = answers[4 * (k - 1)]; break;
        case 3: tff_{module}_init(&self, reference); given = {kept}; break;
        case 4: tff_{module}_init_at(&self, reference, row[2]{angles}); given = {kept}; break;
        default:
            tff_parameters_init(&own);
            own.mu_pull *= row[2];
            own.mu_release *= row[2];
            own.force_max -= 0.1 * (own.force_max - own.force_min);
            own.force_rate_max *= 0.9;
            (void)tff_{module}_use(&self, &own);
            given = answers[4 * (k - 1)];
            break;
        }}
        answers[4 * k] = given;
        answers[(4 * k) + 1] = self.output.force;
        answers[(4 * k) + 2] = self.output.status;
        answers[(4 * k) + 3] = self.output.seen;
    }}
}}
"""


class Modules:
    """Exported modules of a scenario, compiled here in double, that take any sequence of calls."""

    def __init__(self, scenario: tf.Scenario, names: Sequence[str] = FOLLOWERS) -> None:
        problem = Problem.of(scenario)
        known = {module.name: module for module in c_modules(scenario, with_stream=True)}
        self.names = tuple(name for name in names if name in known)
        self.problem, self.scenario = problem, scenario
        self.time_s = problem.reference.time_s
        motion = problem.chain.motion
        self.course = (problem.reference.tension_N, *(() if motion is None else motion.at(self.time_s).T))
        chosen = [known[name] for name in dict.fromkeys(("inverse", *self.names))]
        further: dict[str, object] = {}
        self.stream, self.table = None, None
        if STREAM in chosen and (choice := choose_stream(problem, scenario.stream or Stream())) is not None:
            further["stream"] = self.stream = choice.picked.design
        if "table" in self.names:
            built = table_of(problem)
            self.table, further = built.table, further | table_context(built, Precision.DOUBLE)
        sources = c_sources(scenario, problem, chosen, Precision.DOUBLE, "tff", further)
        self.width = 4 + len(scenario.joints)
        angles = ", &row[4]" if scenario.joints else ""
        drivers = (
            _DRIVER.format(
                module=name,
                width=self.width,
                arguments=(", row[3]" if name == "adaptive" else "") + angles,
                angles=angles if name == "adaptive" else "",
                kept=self._kept(name),
            )
            for name in self.names
        )
        code = compile_on_host(sources, "\n".join(drivers), Precision.DOUBLE, keep=True)
        assert code is not None, "needs a C compiler"
        self.code: HostCode = code

    def _kept(self, name: str) -> str:
        """Expression of what a module commands without a step."""
        if self.problem.transmission.actuator.drive is not Drive.POSITION:
            return "self.output.force"
        return "self.inverse.command" if name == "stream" else "self.command"

    def answers(self, name: str, calls: Sequence[Call]) -> Answers:
        """Answers of a module; the first call must be a start."""
        rows = np.full((len(calls), self.width), math.nan)
        for row, c in zip(rows, calls, strict=True):
            row[: 4 + len(c.joints_rad)] = (c.op, c.reference, c.value, c.measured, *c.joints_rad)
        found = np.zeros((len(calls), 4))
        run = self.code.function(f"run_{name}", ctypes.c_long, self.code.reals, self.code.reals)
        run(len(calls), rows, found)
        return Answers(
            output=found[:, 0], force=found[:, 1], status=found[:, 2].astype(int), seen=found[:, 3].astype(int)
        )


def mixed_steps(modules: Modules, name: str, calls: int = 600, seed: int = 0) -> tuple[float, float]:
    """Largest change of the output from call to call: `_step` and `_step_dt` drawn at random, and all by `_step_dt`.

    The reference and the joints move on as the scenario's do, by the time of each call.
    """
    chance, step = np.random.default_rng(seed), modules.problem.reference.step_s
    start, now, sequence = modules.problem.reference.initial_tension_N, 0.25 * calls * step, []
    plain = False
    for _ in range(calls):
        plain = plain if chance.random() < 0.9 else not plain
        dt = step if plain else step * float(chance.uniform(0.3, 2.5))
        now += dt
        sequence.append(replace(wanted_at(modules, now, Op.STEP if plain else Op.STEP_DT), value=dt))
    alike = [replace(call, op=Op.STEP_DT) for call in sequence]
    first = wanted_at(modules, 0.25 * calls * step, Op.INIT)
    found = [modules.answers(name, [replace(first, reference=start), *each]).output[51:] for each in (sequence, alike)]
    mixed, control = (float(np.abs(np.diff(each)).max()) for each in found)
    return mixed, control


def wanted_at(modules: Modules, time_s: float, op: Op = Op.STEP) -> Call:
    """A call with the scenario's reference and joint angles at a time."""
    tension, *angles = (float(np.interp(time_s, modules.time_s, column)) for column in modules.course)
    return Call(op=op, reference=tension, joints_rad=tuple(angles))


class Gap(IntEnum):
    """Kind of a gap of some samples, in which the rig moves on."""

    TOLD = 0  # calls, and `_missed` says how many
    PAUSE = 1  # calls, and the next `_step_dt` says how long
    ANGLES = 2  # joint angles are no numbers
    STUCK = 3  # joint angles stay what they were
    UNTOLD = 4  # calls, and nothing says so


def gap_error(modules: Modules, name: str, gap: Gap, at: int, lost: int, later: int = 400) -> float:
    """Largest distance of the force from that of a module that lost nothing, in the samples after a gap [N]."""
    step = modules.problem.reference.step_s
    every = [wanted_at(modules, 0.0, Op.INIT), *(wanted_at(modules, k * step) for k in range(at + lost + later))]
    before, during, after = every[: at + 1], every[at + 1 : at + 1 + lost], every[at + 1 + lost :]
    if gap is Gap.TOLD:
        during = [Call(op=Op.MISSED, value=lost)]
    elif gap is Gap.PAUSE:
        during, after = [], [replace(after[0], op=Op.STEP_DT, value=(lost + 1) * step), *after[1:]]
    elif gap is Gap.UNTOLD:
        during = []
    else:
        stays = before[-1].joints_rad if gap is Gap.STUCK else (math.nan,) * len(before[-1].joints_rad)
        during = [replace(call, joints_rad=stays) for call in during]
    whole = modules.answers(name, every).force[-len(after) :]
    torn = modules.answers(name, [*before, *during, *after]).force[-len(after) :]
    return float(np.abs(torn - whole).max())


def moving_finger() -> tf.Scenario:
    """The finger that moves, with self-tuning, and no rate limit that would hide a jump of the force."""
    settings = Adaptation(sensor=Sensor.OUTPUT_TENSION, noise=0.02)
    scenario = tf.load_scenario(EXAMPLES / "finger_moving.toml")
    rig = scenario.transmission
    rig = replace(rig, actuator=replace(rig.actuator, force_rate_max_N_per_s=1e6))
    return replace(scenario, transmission=rig, adaptation=settings)


def main() -> None:
    """Print the tables."""
    moving = Modules(moving_finger())
    print("largest change of the output from call to call: mixed [N], all by _step_dt [N], ratio")
    for file, modules in (
        ("finger_adaptive", Modules(tf.load_scenario(EXAMPLES / "finger_adaptive.toml"))),
        ("finger_moving", moving),
    ):
        for name in modules.names:
            found = np.array([mixed_steps(modules, name, seed=seed) for seed in range(5)])
            ratio = float((found[:, 0] / found[:, 1]).max())
            print(f"  {file}, {name}: {found[:, 0].max():.3g}, {found[:, 1].max():.3g}, {ratio:.3g}")
    print("finger_moving: distance from a module that lost nothing [N], of 16 gaps the worst")
    for gap in Gap:
        for lost in (1, 3, 10, 50, 200):
            if gap is Gap.PAUSE and lost * moving.problem.reference.step_s < 0.03:
                continue
            worst = {
                name: max(gap_error(moving, name, gap, at, lost) for at in range(600, 2200, 100))
                for name in moving.names
            }
            print(f"  {gap.name.lower()}, {lost}: " + ", ".join(f"{name} {off:.3g}" for name, off in worst.items()))


if __name__ == "__main__":
    main()
