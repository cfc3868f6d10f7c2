"""Noise on the input, which the play of friction rectifies: the input is estimated together with the values."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from synthetic import Faults, write_synthetic

from tendonff.compensator.identification.constants import TUNED
from tendonff.compensator.identification.fitting import noisy_input, second_look, uncertainty
from tendonff.compensator.identification.fitting.chain_law import fit_free
from tendonff.compensator.identification.fitting.noisy_input import (
    input_slopes,
    residuals_of,
    with_implied_input,
    with_input_estimated,
)
from tendonff.compensator.identification.fitting.parametric_chain import ParametricChain
from tendonff.compensator.identification.fitting.residuals import ChainResiduals, fit_pieces, spans_of
from tendonff.compensator.identification.fitting.second_look import look_again
from tendonff.compensator.identification.fitting.uncertainty import doubt_of_other_laws, slopes_over_all
from tendonff.compensator.identification.measured.cleaning import clean
from tendonff.compensator.identification.measured.reading import read_measurement
from tendonff.compensator.identification.parameters import BY_TENSIONS, CORE
from tendonff.compensator.identification.parameters import Parameter as D
from tendonff.compensator.scenarios import load_scenario
from tendonff.models.errors import ParameterError
from tendonff.models.fidelity import Level
from tendonff.ocp.errors import SolveError

pytestmark = pytest.mark.compiler

ADHESION_N, MASSES, STEP_S = 0.8, 8, 2e-3
"""Truth and fit are the same chain: what is left is the noise."""


@pytest.fixture(scope="module")
def nominal(examples):
    return load_scenario(examples / "finger.toml")


def fitted(nominal, folder, seed, noise, **true):
    """A fit that has the law right, before and after the input is estimated."""
    t = nominal.transmission
    truth = replace(t, friction=replace(t.friction, **(true or {"adhesion_N": ADHESION_N})))
    rng = np.random.default_rng(seed)
    time = np.arange(0, 16, STEP_S)
    turns = np.concatenate([[30.0], np.ravel([[rng.uniform(45, 100), rng.uniform(10, 30)] for _ in range(10)])])
    place = time / 0.8
    k = place.astype(int)
    s = np.clip((place - k) / 0.8, 0, 1)
    force = turns[k] + (turns[k + 1] - turns[k]) * s**3 * (10 - 15 * s + 6 * s * s)
    path = folder / f"log{seed}.csv"
    write_synthetic(path, truth, time, force, Faults(noise=noise, seed=seed), masses=MASSES, step_s=STEP_S)
    how = nominal.measurement
    pieces = fit_pieces([clean(read_measurement(path, how, ()), how)])
    model = ParametricChain(transmission=truth, level=Level.PRESLIDING, count=MASSES, longest_step_s=STEP_S)
    span, travel = spans_of(pieces)
    task = ChainResiduals(
        model=model,
        pieces=pieces,
        fixed=model.values(),
        free=(*CORE, D.STIFFNESS, D.ADHESION),
        output_unit=0.02 * span,
        elongation_unit_m=0.02 * travel,
        block_s=1.0,
    )
    start = task.evaluate({name: task.fixed[name] for name in task.free})
    output, elongation = task.channel_rms(start)
    task = replace(task, output_unit=2 * output, elongation_unit_m=2 * elongation)
    solution = fit_free(task, task.fixed, span, 8, 1e-4)
    return task, solution, with_input_estimated(task, solution)[0]


def test_adhesion_is_told_apart_from_noise_on_the_input(nominal, tmp_path):
    every = [fitted(nominal, tmp_path, seed, 0.006)[1:] for seed in range(3)]
    before, after = (np.array([each[k].values[D.ADHESION] for each in every]) - ADHESION_N for k in (0, 1))
    errors = np.array([joint.standard_error(D.ADHESION) for _, joint in every])
    assert before.min() > 0.2  # rectified, it looks like adhesion every time
    assert abs(after.mean()) < 0.2 * before.mean()
    assert np.all(np.abs(after) < 2 * errors)
    assert errors.max() < 0.2


def test_a_quiet_input_leaves_the_answer_alone(nominal, tmp_path):
    task, plain, joint = fitted(nominal, tmp_path, 0, 0.0)
    assert all(run.record.input_noise_N < 1e-3 for run in task.pieces)
    for name, value in plain.values.items():
        assert joint.values[name] == pytest.approx(value, rel=2e-3, abs=5e-3)


def failing(error):
    def fail(*_args, **_options):
        raise error

    return fail


@pytest.mark.parametrize("error", [SolveError("mass 3 did not converge"), np.linalg.LinAlgError("Singular matrix")])
def test_noise_that_could_not_be_taken_out_is_said_with_its_cause(nominal, tmp_path, monkeypatch, error):
    """The answer before it stays, and nobody takes it for one without the input's noise."""
    task, plain, _ = fitted(nominal, tmp_path, 0, 0.006)
    monkeypatch.setattr(noisy_input, "_step", failing(error))
    with pytest.raises(SolveError, match=str(error)):
        with_input_estimated(task, plain)
    found = look_again("the law", task, plain, 1.0, offsets=False)
    assert (found.law, found.task, found.solution) == ("the law", task, plain)
    assert "the noise of the input could not be taken out" in found.caution
    assert str(error) in found.caution


def test_values_that_explain_less_once_the_noise_is_taken_out_are_not_taken(nominal, tmp_path, monkeypatch):
    """A term may be dropped that the data need: the other values then went 13 % off, and the error from 0.1 to 10 %."""
    task, plain, joint = fitted(nominal, tmp_path, 0, 0.006)
    off = plain.values | {D.MU: 1.13 * plain.values[D.MU]}
    worse = replace(plain, values=off, residuals=residuals_of(task, off))
    for other, taken in ((joint, True), (worse, False)):
        again = second_look.SecondLook(law="another law", task=task, solution=other)
        monkeypatch.setattr(second_look, "_looked_again", lambda *_, again=again: again)
        found = look_again("the law", task, plain, 1.0, offsets=False)
        assert found.law == ("another law" if taken else "the law")
        assert (found.solution is other, not found.caution) == (taken, taken)
    assert "the error of the law grew by a factor of" in found.caution


@pytest.mark.parametrize(
    ("mine", "its", "value", "answer"),
    [
        (250.0, 40.0, 0.1, ("its", None)),
        (100.0, 40.0, 0.1, ("mine", "its")),
        (40.0, 100.0, 0.1, ("mine", "its")),
        (40.0, 250.0, 0.1, ("mine", None)),
        (40.0, 100.0, 0.0, ("mine", None)),  # the same law without its constant
    ],
)
def test_of_two_dependences_on_the_load_both_are_answered_unless_the_misfit_decides(
    monkeypatch, mine, its, value, answer
):
    own = (SimpleNamespace(name="mine", free=(D.ADHESION,)), SimpleNamespace(values={D.ADHESION: 1.0}))
    other = (SimpleNamespace(name="its", free=(D.LOAD_EXPONENT,)), SimpleNamespace(values={D.LOAD_EXPONENT: value}))
    monkeypatch.setattr(second_look, "_with_other_dependence", lambda *_: other)
    monkeypatch.setattr(second_look, "_at_its_best", lambda *_: other)
    monkeypatch.setattr(second_look, "_misfits", lambda *_: [mine, its])
    chosen, left = second_look._by_load(*own, slopes=())
    assert (chosen[0].name, left and left[0].name) == answer


def test_laws_are_compared_behind_the_input_that_they_imply(nominal, tmp_path):
    """Values fitted to the measured input explain what its noise is rectified to, and right ones seem worse by 15 %."""
    task, plain, joint = fitted(nominal, tmp_path, 0, 0.006)
    implied = [with_implied_input(task, found) for found in (plain, joint)]
    noise_N = np.std(implied[1].pieces[0].drive.input_N - task.pieces[0].drive.input_N)
    assert 0 < noise_N < task.pieces[0].record.input_noise_N
    left = [residuals_of(own, found.values).values for own, found in zip(implied, (plain, joint), strict=True)]
    assert np.linalg.norm(joint.residuals.values) > 1.1 * np.linalg.norm(plain.residuals.values)
    assert np.linalg.norm(left[1]) < 1.05 * np.linalg.norm(left[0])


@pytest.mark.parametrize(("its", "taken"), [(160.0, True), (500.0, False)])
def test_where_the_error_grew_both_ways_the_misfit_decides(nominal, tmp_path, monkeypatch, its, taken):
    """A noisy input hides much friction in the values: the error of right ones may well be twice as large."""
    task, plain, joint = fitted(nominal, tmp_path, 0, 0.006)
    again = second_look.SecondLook(law="another law", task=task, solution=joint)
    sizes = iter((1.0, 2.0, 1.0, 2.0))  # as measured, and behind the input that both imply
    monkeypatch.setattr(second_look, "_looked_again", lambda *_: again)
    monkeypatch.setattr(second_look, "_size", lambda _: next(sizes))
    misfits = iter((170.0, its))
    monkeypatch.setattr(second_look, "misfit", lambda *_: next(misfits))
    assert (look_again("the law", task, plain, 1.0, offsets=False) is again) == taken


@pytest.mark.parametrize(
    ("true", "falls"), [({"adhesion_N": 1.5}, False), ({"load_exponent": 0.2, "reference_tension_N": 40.0}, True)]
)
def test_friction_that_falls_with_the_load_is_told_from_adhesion_by_the_misfit(nominal, tmp_path, true, falls):
    """The law with adhesion is fitted in either case; the other one starts from it, and takes its place where true."""
    task, plain, _ = fitted(nominal, tmp_path, 1, 0.003, **true)
    free = (*CORE, D.STIFFNESS, D.ADHESION)
    model = replace(task.model, transmission=nominal.transmission, load_reference_N=40.0)
    start = {**plain.values, D.ADHESION: 1.5}
    task = replace(task, model=model, free=free, fixed={**task.fixed, **start, D.LOAD_EXPONENT: 0.0})
    solution = fit_free(task, task.fixed, float(np.ptp(task.pieces[0].measured)), 8, 1e-4)
    found = with_input_estimated(task, solution)[0]
    slopes = input_slopes(task, found)
    rival, other = second_look._at_its_best(*second_look._with_other_dependence(task, found), slopes)
    assert (D.LOAD_EXPONENT in rival.free, D.ADHESION in rival.free) == (True, False)
    mine, its = second_look._misfits([(task, found), (rival, other)], slopes)
    assert (mine - its > TUNED.decisive) is falls
    if falls:
        assert other.values[D.LOAD_EXPONENT] == pytest.approx(0.2, rel=0.1)


def test_a_path_that_cannot_be_split_for_the_doubt_about_it_is_no_silence(nominal, tmp_path, monkeypatch):
    task, plain, _ = fitted(nominal, tmp_path, 0, 0.0)
    every = (*task.free, *(name for name in BY_TENSIONS if name not in task.free and name is not D.LOAD_EXPONENT))
    slopes = slopes_over_all(replace(task, fixed=task.complete(plain.values)), every)
    monkeypatch.setattr(uncertainty, "Section", failing(ParameterError("no such section")))
    with pytest.raises(ParameterError, match="no such section"):
        doubt_of_other_laws(plain, slopes, every, task)
