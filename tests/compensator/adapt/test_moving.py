"""The study where joints move the path, and what is not exported there."""

from dataclasses import replace

import pytest

from tendonff.compensator.adapt.result import Scheme
from tendonff.compensator.adapt.run import adapt
from tendonff.compensator.compensators.base import Problem
from tendonff.compensator.export.adaptive import ADAPTIVE_MODULES
from tendonff.compensator.export.text.c_text import c_sources
from tendonff.compensator.files.text import InputError
from tendonff.compensator.scenario.adaptation import Adaptation
from tendonff.compensator.scenario.scenario import load_scenario
from tendonff.ocp.adaptation.tuning import Sensor
from tendonff.ocp.codegen.compiler import find_compiler
from tendonff.ocp.codegen.precision import Precision
from tendonff.ocp.errors import CodeError


@pytest.fixture(scope="module")
def moving(examples):
    settings = Adaptation(sensor=Sensor.ACTUATOR_POSITION, noise=2e-5, delay_samples=2)
    return replace(load_scenario(examples / "finger_moving.toml"), adaptation=settings)


@pytest.mark.compiler
def test_friction_that_is_off_is_tuned_away_while_joints_move(moving, monkeypatch):
    """On four of the study's plants: 40 masses, another step; the joints go on beyond the reference with it."""
    from tendonff.compensator.adapt import run

    names = ("friction \N{MINUS SIGN}20 %", "friction +20 %", "load +20 %", "friction drifts by +30 % in a minute")
    every = run.variations
    monkeypatch.setattr(run, "variations", lambda sensor: tuple(v for v in every(sensor) if v.name in names))
    study = adapt(moving)
    errors = {case.variation.name: {s: t.settled_percent for s, t in case.traces.items()} for case in study.cases}
    for name in names[:2]:
        assert errors[name][Scheme.FEEDFORWARD] > 5
        assert errors[name][Scheme.SELF_TUNING] < 0.5
    assert errors[names[2]][Scheme.SELF_TUNING] < 1.3 * errors[names[2]][Scheme.FEEDFORWARD]
    assert errors[names[3]][Scheme.SELF_TUNING] < 0.15 * errors[names[3]][Scheme.FEEDFORWARD]
    assert study.interval is None


def test_the_tuner_is_not_exported_for_a_path_that_moves(moving):
    with pytest.raises(InputError, match="not exported as C or FMU yet; leave the table out here"):
        c_sources(moving, Problem.of(moving), ADAPTIVE_MODULES, Precision.DOUBLE, "tff")


def test_without_a_compiler_it_is_said_what_brings_one(moving, monkeypatch):
    from tendonff.ocp.adaptation import code

    assert find_compiler is code.find_compiler
    monkeypatch.setattr(code, "find_compiler", lambda: None)
    with pytest.raises(CodeError, match=r"self-tuning runs as compiled C only.*ziglang"):
        adapt(moving)
