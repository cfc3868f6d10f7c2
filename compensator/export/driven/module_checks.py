"""Checks of a module beside the inverse of driven joints: golden vectors, and what it does with bad numbers."""

import math
from collections.abc import Sequence

from tendonff.compensator.export.driven.checks import HELD, Status
from tendonff.compensator.export.driven.module import Content, Module, tolerance_rad
from tendonff.compensator.export.script import ANSWER, ModuleRecord, Port, Script

_FAR = 1e6  # outside of what any module accepts


def check_module(script: Script, module: Module, contents: Sequence[Content], prefix: str) -> None:
    """Check the module for each joint or finger, and that there is none beyond them."""
    tested = [_tested(module, number, content, prefix) for number, content in enumerate(contents)]
    for each, content in zip(tested, contents, strict=True):
        _golden(script, module, each, content)
    check = script.check(tested[0], "one that is none is refused, and no step is made")
    first = dict(zip(tested[0].inputs, contents[0].given[0].tolist(), strict=False))
    for which in (-1.0, float(len(contents))):
        check.call("init_of", which=which, **first).near(ANSWER, 0.0, 0.0)
        check.call("step").bits("status", some=Status.FAILED).near("command", 0.0, 0.0)


def _tested(module: Module, number: int, content: Content, prefix: str) -> ModuleRecord:
    call, motors = f"{prefix}_{module.name}", content.command_rad.shape[1]
    more = "".join(f", {{{port.name}}}" for port in module.inputs)
    return ModuleRecord(
        name=f"{module.name}_{number}",
        type=call,
        inputs={**{port.name: 0 for port in module.inputs}, "which": 0},
        calls={
            "init": f"answer = (double){call}_init(self, {number}{more})",
            "init_of": f"answer = (double){call}_init(self, (int32_t){{which}}{more})",
            "step": f"answer = (double){call}_step(self{more})",
        },
        ports=(
            Port(name="command [rad]", member="command_rad", count=motors),
            Port(name="status", member="status", kind="u"),
            Port(name="seen", member="seen", kind="u"),
        ),
    )


def _golden(script: Script, module: Module, tested: ModuleRecord, content: Content) -> None:
    most, names = tolerance_rad(content, script.precision), [port.name for port in module.inputs]
    given = dict(zip(names, content.given.T, strict=True))
    check = script.check(tested, "golden vectors")
    check.call("init", **{name: values[0] for name, values in given.items()}).near(ANSWER, 1.0, 0.0)
    check.near("command", content.command_rad[0], most).near("status", float(content.status[0]), 0.0)
    check = check.then(len(content.command_rad) - 1)
    check.call("step", **{name: values[1:] for name, values in given.items()}).same(ANSWER, other=0, versus="status")
    check.near("command", content.command_rad[1:], most).near("status", content.status[1:], 0.0)
    if not names:
        return
    check = script.check(tested, "bad numbers hold the command and are reported, a start with one is refused")
    for value, bit in ((math.nan, Status.INPUT_HELD), (_FAR, Status.RANGE)):
        check.call("step", **dict.fromkeys(names, value)).bits("status", some=bit).held("command")
    check.bits("seen", some=HELD).call("init", **dict.fromkeys(names, math.nan)).near(ANSWER, 0.0, 0.0)
