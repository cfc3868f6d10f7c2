"""All that the checks of a tension's modules know."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from tendonff.compensator.compensators.base import Problem
from tendonff.compensator.compensators.lookup_table import LookupTable
from tendonff.compensator.compensators.profile import FloatArray
from tendonff.compensator.compensators.stream import RE_ENTRY_S, RE_ENTRY_SHARE, StreamDesign
from tendonff.compensator.export.golden import Golden, servo_of
from tendonff.compensator.export.modules import accepted_steps
from tendonff.compensator.export.repeat import Compared
from tendonff.compensator.export.script import ModuleRecord, Port, Script
from tendonff.compensator.export.tension import modules as tested
from tendonff.compensator.export.tension.data import LimitCase
from tendonff.compensator.export.tension.following import (
    Allowed,
    Times,
)
from tendonff.compensator.export.text.parameters import parameters_of

_BINDS = 1e9  # forces beyond are no limits


@dataclass(frozen=True, kw_only=True)
class TensionTest:
    """All that the checks of a tension's modules know.

    Attributes
    ----------
    compared : dict of str to dict of str to Compared
        Rows by course and module.
    led_to_N : float or None
        A reference away from the first one, None where the course never moves.
    narrow_N : tuple of float
        Limits of force inside the scenario's [N].
    push_N : tuple of float or None
        References of a fall that no tendon follows, and the sample in which it pushes most.
    start_force_N : tuple of float or None
        Tension and force of a start in motion that knows the friction.
    """

    problem: Problem
    names: Sequence[str]
    script: Script
    golden: Golden
    compared: Mapping[str, Mapping[str, Compared]]
    table: LookupTable | None
    profile_N: FloatArray
    stream: StreamDesign | None
    limit_cases: Sequence[LimitCase]
    jump_bits: Mapping[str, int]
    led_to_N: float | None
    narrow_N: tuple[float, float]
    push_N: tuple[float, float, int] | None
    start_force_N: tuple[float, float] | None
    live_ramps: bool
    plant_ends_m: tuple[float, float]
    position_m: float
    slack_rows: int
    slack_drive: float
    settable: Mapping[str, Sequence[str]]

    @property
    def prefix(self) -> str:
        """Prefix of every C name."""
        return self.script.prefix

    @property
    def joint_rad(self) -> FloatArray:
        """Joint angles of the course, shape (rows, joints)."""
        return self.golden.course.joint_rad

    @property
    def joints(self) -> int:
        """Joint angles that steps take."""
        return int(self.joint_rad.shape[1])

    @property
    def first(self) -> float:
        """Reference of the start [N]."""
        return float(self.golden.course.reference_N[0])

    @property
    def allowed(self) -> Allowed:
        """Bounds of the actuator."""
        actuator = self.problem.transmission.actuator
        change = actuator.force_rate_max_N_per_s * self.problem.reference.step_s
        return Allowed(low_N=actuator.force_min_N, high_N=actuator.force_max_N, change_N=change)

    @property
    def slack(self) -> float:
        """Rounding of forces of the course [N]."""
        most = float(np.abs(self.golden.course.plant_force_N).max())
        return 3 * self.script.rounding(max(most, self.allowed.high_N if self.binds else 0.0))

    @property
    def binds(self) -> bool:
        """Whether the actuator's range is one."""
        return self.allowed.low_N > -_BINDS and self.allowed.high_N < _BINDS

    @property
    def times(self) -> Times:
        """Times between calls."""
        step = self.problem.reference.step_s
        return Times(
            step_s=step,
            part_s=0.5 * accepted_steps(step)[0],
            pause_s=0.5,
            re_entry=max(1, round(RE_ENTRY_S / step)),
            re_entry_share=RE_ENTRY_SHARE,
        )

    @property
    def record(self) -> dict[str, float]:
        """The scenario's parameters by name."""
        return {p.name: p.value for p in parameters_of(self.problem)}

    def with_record(self, **changed: float) -> list[float]:
        """Parameters of which some are changed."""
        return list((self.record | changed).values())

    def joint(self, rows: int | slice = 0) -> dict[str, FloatArray]:
        """Joint angles of some rows of the course, as an input of steps."""
        return {"joint": np.asarray(self.joint_rad[rows])} if self.joints else {}

    @property
    def laws(self) -> list[str]:
        """Modules that follow the reference without the chain's states: capstan law, table, those that are added."""
        return [name for name in self.golden.course.columns if name not in ("inverse", "plant")]

    def modules(self) -> dict[str, ModuleRecord]:
        """Records of the exported modules by name."""
        chain, joints = self.problem.chain, self.joints
        prefix, servo = self.prefix, servo_of(self.problem) is not None
        count, settable = len(self.record), self.settable["inverse"]
        made = [
            tested.inverse(prefix, count, joints, chain, settable, servo=servo),
            *(tested.called(name, prefix, count, joints, self._own(name)) for name in self.laws),
            tested.stream(prefix, count, joints, servo),
            tested.plant(prefix, joints),
            tested.profile(prefix),
        ]
        return {each.name: each for each in made if each.name in self.names}

    def _own(self, name: str) -> list[Port]:
        if name == "table":
            return [Port(name="branch", member="branch", kind="i")]
        return [Port(name=member, member=member) for member in self.settable.get(name, ())]
