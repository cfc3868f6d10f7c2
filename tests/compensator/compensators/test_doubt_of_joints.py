"""Doubts of a joint: what [robust] states, and the profile for the middle of the compliances."""

import math
from pathlib import Path

import numpy as np
import pytest

from tendonff.compensator.compensators.every import answering, compensator_of
from tendonff.compensator.compensators.motors.joint import JointTask
from tendonff.compensator.compensators.motors.task import middle_compliance
from tendonff.compensator.files.reading import InputError
from tendonff.compensator.scenario.driven.joint import JointScenario, parse_joint_scenario
from tendonff.models.parameters.numbers import with_numbers
from tendonff.models.parameters.uncertainty import Objective, Uncertainty

pytestmark = pytest.mark.compiler
STATED = '[robust]\nmu = 0.1\n[robust.spread]\n"tendon.stiffness_N_per_m" = 0.2\n"drive.pretension_N" = [4.0, 6.0]\n'


def hand(examples: Path, more: str = "") -> JointScenario:
    """The example behind an ideal servo."""
    text = (examples / "hand_joint.toml").read_text("utf-8")
    for key in ("resolution_rad", "command_interval_s"):
        text = "".join(line for line in text.splitlines(keepends=True) if not line.startswith(key))
    return parse_joint_scenario(text + more, examples / "hand_joint.toml")


def test_the_middle_of_the_compliances_is_as_far_from_both_ends(examples: Path) -> None:
    rig = hand(examples).mechanism
    for robust in (Uncertainty(stiffness=0.2), hand(examples, STATED).robust):
        middle = middle_compliance(rig, robust)
        assert middle is not None
        assert middle.tendons[0].tendon.stiffness_N_per_m == pytest.approx(0.96 * 2e4)
        assert middle.tendons[1].friction == rig.tendons[1].friction
    assert middle_compliance(rig, Uncertainty(mu=0.2)) is None
    assert middle_compliance(rig, Uncertainty(stiffness=0.2, objective=Objective.MEAN)) is None


def test_what_is_expected_is_what_plants_at_the_ends_do(examples: Path) -> None:
    """The worst over the samples, each number alone, and the corner that is worst for the profile."""
    task = JointTask.of(hand(examples, STATED))
    assert [each.name for each in answering(task)] == ["linear", "static", "inverse", "robust"]
    command = task.answer(compensator_of(task, "inverse"))
    found = task.expect({"inverse": command})

    def error(**numbers: float) -> float:
        rig = with_numbers(task.mechanism, {key.replace("__", "."): value for key, value in numbers.items()})
        found = task.respond(rig, command, masses=task.masses)
        return float(np.sqrt(np.mean((task.values_of(found) - task.wanted) ** 2)))

    alone = {each.key: each.rmse for each in found.contributions}
    assert alone["tendon.stiffness_N_per_m"] == pytest.approx(error(tendon__stiffness_N_per_m=0.8 * 2e4))
    assert alone["drive.pretension_N"] == pytest.approx(max(error(drive__pretension_N=t) for t in (4.0, 6.0)))
    corner = error(mu=1.1, tendon__stiffness_N_per_m=0.8 * 2e4, drive__pretension_N=6.0)
    assert found.best.worst.rmse == pytest.approx(corner)
    assert f"up to {math.degrees(corner):.2g} deg RMS" in found.headline("exact inverse", "stop")


def test_the_middle_compliance_makes_the_worse_end_of_the_stiffness_better(examples: Path) -> None:
    task = JointTask.of(hand(examples, "[robust]\nstiffness = 0.2\n"))
    found = task.expect({name: task.answer(compensator_of(task, name)) for name in ("inverse", "robust")})
    assert found.recommended == "robust"
    bare, robust = found.bands["inverse"], found.bands["robust"]
    assert robust.worst.rmse < 0.93 * bare.worst.rmse
    assert robust.nominal.rmse > bare.nominal.rmse


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ('[robust.spread]\n"friction.mu_dynamc" = 0.2\n', 'unknown key "friction.mu_dynamc"'),
        ('[robust.spread]\n"drive.gear_ratio" = [-1.0, 1.0]\n', "gear_ratio must be"),
        ('[robust.spread]\n"drive.least_tension_N" = 0.1\n', "the number is not set"),
        ('[robust.spread]\n"path.segments" = 0.1\n', "a whole number cannot be uncertain"),
    ],
)
def test_a_spread_without_meaning_is_refused(examples: Path, more: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        hand(examples, more)
