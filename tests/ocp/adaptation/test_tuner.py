"""What the tuner does beside learning: it stands still, stays within bounds, freezes, starts anew, makes no jumps."""

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from random_examples import tried_on

from tendonff.models.errors import ParameterError
from tendonff.models.fidelity import Level
from tendonff.models.tendon.chain import Chain
from tendonff.models.tendon.friction import at_load
from tendonff.ocp.adaptation.code import TunedChain, load_law
from tendonff.ocp.adaptation.tuner import SelfTuner, SimulatedRig, TunerStatus
from tendonff.ocp.adaptation.tuning import Sensor, Tunable, Tuning
from tendonff.ocp.tendon.inverse import invert
from tendonff.ocp.tracking.limits import ForceLimits

pytestmark = pytest.mark.compiler
TENSION, POSITION = Sensor.OUTPUT_TENSION, Sensor.ACTUATOR_POSITION


def own_rig(bench, **factors):
    """A rig that is the tuner's own chain, with other values."""
    names = {Tunable(name): value for name, value in factors.items()}
    tuned = TunedChain.of(bench.transmission, Level.PRESLIDING, tuple(names))
    return SimulatedRig(tuned.with_factors(names), bench.step_s, 1, bench.start_N)


class Recorder:
    """A tuner and the forces it asks for."""

    def __init__(self, tuner) -> None:
        self.tuner, self.forces = tuner, []

    def step(self, reference_N, measured):
        self.forces.append(self.tuner.step(reference_N, measured))
        return self.forces[-1]

    @property
    def status(self):
        return self.tuner.status


def silent(reference):
    return np.zeros(len(reference) - 1)


def test_without_learning_it_is_the_exact_inverse(bench, reference):
    """Another implementation of the same law, to rounding."""
    tuner = bench.tuner(bench.tuning(POSITION))
    run = tuner.run(own_rig(bench, mu=1.1), reference[1:], silent(reference), adapt=False)
    chain = Chain.of(bench.transmission, Level.PRESLIDING)
    assert run.force_N == pytest.approx(invert(chain, reference, bench.step_s).force_N[1:], abs=1e-7)


@tried_on(12)
@given(mu=st.floats(0.6, 0.97) | st.floats(1.03, 1.4), sensor=st.sampled_from(Sensor))
def test_estimates_within_40_percent_converge_in_two_seconds(bench, reference, mu, sensor):
    """What is less than 3 % off takes longer to stand out from doubt, and costs 0.2 % of range meanwhile."""
    run = bench.tuner(bench.tuning(sensor)).run(own_rig(bench, mu=mu), reference[1:], silent(reference))
    near = 2e-3 if sensor is TENSION else 5e-3  # from the position three other parameters are found as well
    assert run.factors[2100:, 0] == pytest.approx(mu, rel=near)
    assert abs(run.tension_N[2500:] - reference[2501:]).max() < near * np.ptp(reference)
    assert not (run.status[2000:] & (TunerStatus.DOUBT | TunerStatus.FROZEN)).any()


@tried_on(12)
@given(mu=st.floats(0.55, 1.9), sensor=st.sampled_from(Sensor))
def test_estimates_converge_from_any_start_within_the_range(bench, reference, mu, sensor):
    tuner = bench.tuner(bench.tuning(sensor))
    wanted = np.concatenate([reference, reference[-2:1999:-1]])
    run = tuner.run(own_rig(bench, mu=mu), wanted[1:], silent(wanted))
    assert run.factors[-1, 0] == pytest.approx(mu, rel=0.01)
    assert abs(run.tension_N[5000:] - wanted[5001:]).max() < 0.01 * np.ptp(reference)


def test_pull_and_release_are_found_apart(bench, reference):
    both = (Tunable.MU_PULL, Tunable.MU_RELEASE)
    tuner = bench.tuner(bench.tuning(TENSION, both))
    run = tuner.run(own_rig(bench, mu_pull=1.2, mu_release=0.9), reference[1:], silent(reference))
    assert run.factors[-1] == pytest.approx([1.2, 0.9], rel=5e-3)


def test_friction_and_tendon_stiffness_are_found_from_the_position(bench, reference):
    both = (Tunable.MU, Tunable.TENDON_STIFFNESS)
    tuner = bench.tuner(bench.tuning(POSITION, both))
    run = tuner.run(own_rig(bench, mu=1.2, tendon_stiffness=0.9), reference[1:], silent(reference))
    assert run.factors[-1] == pytest.approx([1.2, 0.9], rel=0.03)


@pytest.mark.parametrize("sensor", Sensor)
def test_slopes_are_the_derivatives_of_the_prediction(bench, reference, sensor):
    """Against runs of two tuners that hold other factors: central differences."""
    tuning = bench.tuning(sensor)
    base = bench.tuner(tuning).run(own_rig(bench, mu=1.0), reference[1:], silent(reference), adapt=False)
    outputs = []
    for mu in (1 - 1e-5, 1 + 1e-5):
        chain = TunedChain.of(bench.transmission, Level.PRESLIDING, (Tunable.MU,)).with_factors({Tunable.MU: mu})
        rig = SimulatedRig(chain, bench.step_s, 1, bench.start_N)
        positions = []
        follower = bench.tuner(tuning)
        for wanted in reference[1:]:  # the same force, for the plain inverse does not look at the rig
            follower.run(rig, np.array([wanted]), np.zeros(1), adapt=False)
            positions.append(rig.struct.output if sensor is TENSION else rig.x[-2])
        outputs.append(np.array(positions))
    expected = (outputs[1] - outputs[0]) / 2e-5
    assert base.slopes[:, 0] == pytest.approx(expected, abs=2e-3 * np.abs(expected).max())


@pytest.mark.parametrize("sensor", Sensor)
def test_at_rest_noise_moves_nothing(bench, reference, sensor):
    """After motion: 2 minutes of noise leave the estimate where it was, to the bit."""
    tuner, rig = bench.tuner(bench.tuning(sensor)), own_rig(bench, mu=1.2)
    tuner.run(rig, reference[1:], silent(reference))
    hold = np.full(120_000, reference[-1])
    noise = bench.noise[sensor] * np.random.default_rng(0).normal(size=len(hold))
    run = tuner.run(rig, hold, noise)
    assert np.all(run.factors[3000:] == run.factors[3000])  # once it has stopped creeping
    assert run.factors[-1, 0] == pytest.approx(1.2, rel=0.01)


def test_before_any_motion_noise_moves_nothing(bench):
    tuner = bench.tuner(bench.tuning(TENSION))
    hold = np.full(5000, bench.start_N)
    run = tuner.run(own_rig(bench, mu=1.2), hold, np.random.default_rng(0).normal(size=5000))
    assert np.all(run.factors == 1.0)


def test_an_actuator_in_its_limit_teaches_nothing(bench, reference):
    """The force stands at its upper limit: no motion, no learning; away from it, it goes on."""
    limits = ForceLimits(minimum_N=0.0, maximum_N=40.0, rate_N_per_s=1e5)
    tuner, tuning = bench.tuner(bench.tuning(TENSION), limits), bench.tuning(TENSION)
    noise = tuning.noise * np.random.default_rng(0).normal(size=len(reference) - 1)
    run = tuner.run(own_rig(bench, mu=1.2), reference[1:], noise)
    stuck = (run.status & TunerStatus.LIMITED) > 0
    settled = np.convolve(stuck, np.ones(200))[: len(stuck)] == 200  # limited for 0.2 s and more
    assert settled.sum() > 100
    still = np.abs(np.diff(run.factors[:, 0]))[settled[1:]]
    assert still.max() < 1e-5
    assert run.factors[-1, 0] == pytest.approx(1.2, rel=0.02)


@pytest.mark.parametrize("sensor", Sensor)
def test_the_force_makes_no_jump_beyond_the_sensors_noise(bench, reference, sensor):
    """Force per step against that of the exact inverse of the rig, which knows everything."""
    tuning = bench.tuning(sensor)
    run = bench.tuner(tuning).run(own_rig(bench, mu=1.4), reference[1:], silent(reference))
    chain = TunedChain.of(bench.transmission, Level.PRESLIDING, (Tunable.MU,)).with_factors({Tunable.MU: 1.4})
    exact = np.abs(np.diff(invert(chain, reference, bench.step_s).force_N)).max()
    assert np.abs(np.diff(run.force_N)).max() < exact + bench.noise[TENSION]


def test_a_sensor_that_fails_for_a_while_changes_nothing(bench, reference):
    tuner, rig = bench.tuner(bench.tuning(TENSION)), own_rig(bench, mu=1.2)
    tuner.run(rig, reference[1:2001], np.zeros(2000))
    dead = tuner.run(rig, reference[2001:2501], np.full(500, np.nan))
    rest = tuner.run(rig, reference[2501:], np.zeros(1500))
    assert np.all(dead.factors[2:] == dead.factors[2])  # two good ones were still on their way
    assert rest.factors[-1, 0] == pytest.approx(1.2, rel=2e-3)
    assert not (rest.status & TunerStatus.FROZEN).any()


def broken(bench, tuner, reference):
    """A rig whose load softens by a third after six seconds, and what came before; its friction is 20 % higher."""
    free = (Tunable.MU, Tunable.LOAD_STIFFNESS)
    plant = TunedChain.of(bench.transmission, Level.PRESLIDING, free)
    rigs = [plant.with_factors({Tunable.MU: 1.2, Tunable.LOAD_STIFFNESS: load}) for load in (1.0, 0.67)]
    rig = SimulatedRig(rigs[0], bench.step_s, 1, bench.start_N)
    before = tuner.run(rig, reference[1:6001], np.zeros(6000))
    assert not (before.status & TunerStatus.FROZEN).any()
    rig.change(rigs[1])
    return rig, rigs[0]


PAIR = (Tunable.MU_PULL, Tunable.MU_RELEASE)  # has no parameter that explains another load


def test_a_wrong_model_keeps_what_held_last_and_starts_anew_at_rest(bench, reference):
    both = np.concatenate([reference, reference[-2::-1]])
    tuner = bench.tuner(bench.tuning(POSITION, PAIR))
    rig, _ = broken(bench, tuner, both)
    moving = tuner.run(rig, both[6001:], np.zeros(2000))
    frozen = (moving.status & TunerStatus.FROZEN) > 0
    assert frozen[500:].all()
    assert moving.factors[frozen][-1] == pytest.approx([1.2, 1.2], rel=0.02)  # not the scenario's
    rest = tuner.run(rig, np.full(2500, reference[0]), np.zeros(2500))  # the tendon creeps for a second
    assert not rest.status[-1] & TunerStatus.FROZEN
    assert rest.factors[-1] == pytest.approx([1.2, 1.2], rel=0.02)


def test_a_model_that_explains_the_data_again_thaws_without_a_rest(bench, reference):
    both = np.concatenate([reference, reference[-2::-1]])
    tuner = bench.tuner(bench.tuning(POSITION, PAIR))
    rig, good = broken(bench, tuner, both)
    assert tuner.run(rig, both[6001:7501], np.zeros(1500)).status[-1] & TunerStatus.FROZEN
    rig.change(good)
    tuner.run(rig, both[7501:], np.zeros(500))
    more = tuner.run(rig, both[1:4001], np.zeros(4000))
    assert not (more.status[-1000:] & TunerStatus.FROZEN).any()
    assert more.factors[-1] == pytest.approx([1.2, 1.2], rel=0.02)


def test_what_explained_two_spans_at_the_start_is_kept_where_the_sensor_sticks(bench, reference):
    both = np.concatenate([reference, reference[-2::-1]])
    spans = np.cumsum(np.abs(np.diff(both))) / np.ptp(both)
    rows = int(np.argmax(spans > 2.2))
    tuner, rig = bench.tuner(bench.tuning(TENSION)), own_rig(bench, mu=1.2)
    tuner.run(rig, both[1 : rows + 1], np.zeros(rows))
    for wanted in both[rows + 1 : rows + 501]:
        tuner.step(wanted, rig.struct.output)
    assert tuner.status & TunerStatus.FROZEN
    assert tuner.factors[0] == pytest.approx(1.2, rel=0.01)


def test_what_counts_stays_until_motion_tells_what_has_changed(bench, reference):
    """A tendon that is 2 mm longer at once looks like 14 % less friction until the motion turns."""
    tuner, rig = bench.tuner(bench.tuning(POSITION)), own_rig(bench, mu=1.2)
    before = tuner.run(rig, reference[1:3501], np.zeros(3500)).factors[-1]
    assert before == pytest.approx(1.2, rel=0.01)
    rig.stretch(2e-3)
    after = tuner.run(rig, reference[3501:], np.zeros(len(reference) - 3501))
    assert after.factors[:, 0] == pytest.approx(before[0], rel=0.01)


@pytest.mark.parametrize("sensor", Sensor)
@pytest.mark.parametrize("stuck_at", [0, 4300])
def test_a_sensor_that_sticks_is_said_and_teaches_nothing(bench, reference, sensor, stuck_at):
    """Its value stays where it was, to the bit; the prediction goes on. What was learnt before stays."""
    both = np.concatenate([reference, reference[-2::-1]])
    tuner, rig = bench.tuner(bench.tuning(sensor)), own_rig(bench, mu=1.2)
    before = tuner.run(rig, both[1 : stuck_at + 1], np.zeros(stuck_at)).factors[-1:, 0] if stuck_at else [1.0]
    frozen = rig.struct.output if sensor is TENSION else float(rig.x[-2]) - rig.struct.start
    for wanted in both[stuck_at + 1 : stuck_at + 2001]:
        tuner.step(wanted, frozen)
        assert tuner.factors[0] == pytest.approx(before[-1], rel=0.02)
    assert tuner.status & TunerStatus.FROZEN


def test_a_bound_that_binds_is_said(bench, reference):
    tuning = replace(bench.tuning(TENSION), highest=1.3)
    run = bench.tuner(tuning).run(own_rig(bench, mu=1.4), reference[1:], silent(reference))
    assert run.factors.max() == pytest.approx(1.3, rel=0.02)
    assert (run.status & TunerStatus.AT_BOUND).any()


def test_integral_action_takes_out_what_is_left(bench, reference):
    """A sensor offset is none of its business; bristles that differ are."""
    plain, held = bench.tuning(TENSION), bench.tuning(TENSION, gain=40.0)
    errors = []
    for tuning in (plain, held):
        tension, _ = bench.blind(bench.tuner(tuning), tuning, reference, mu=1.2, bristle=2.0)
        errors.append(np.sqrt(np.mean((tension[2000:] - reference[2000:]) ** 2)))
    assert errors[1] < 0.5 * errors[0]


@pytest.mark.parametrize("bristle", [1.0, 1.03])
def test_integral_action_leaves_alone_what_does_not_stand_out(bench, reference, percent, bristle):
    """Noise, or bristles 3 % stiffer than stated: the inverse leaves 0.09 % of range, and its force is kept."""
    tuning = bench.tuning(TENSION, gain=30.0)
    forces = []
    for each in (tuning, tuning.with_integral_gain(0.0)):
        tuner = Recorder(bench.tuner(each))
        tension, _ = bench.blind(tuner, each, reference, bristle=bristle)
        forces.append(tuner.forces)
    assert percent(tension) < 0.1
    assert forces[0] == forces[1]


def test_what_was_integrated_goes_back_where_it_is_no_longer_needed(bench):
    """At rest: the output was 1 N low for a while; then it is as asked within noise."""
    tuner = bench.tuner(replace(bench.tuning(TENSION, gain=40.0), drift_level=0.1))
    for measured, samples in ((29.0, 50), (30.05, 15000)):
        forces = [tuner.step(30.0, measured) for _ in range(samples)]
        assert measured > 30 or forces[-1] > 30.1
    plain = bench.tuner(bench.tuning(TENSION))
    for wanted in np.linspace(30.0, 40.0, 500):  # on the same branch of friction
        force, expected = tuner.step(wanted, np.nan), plain.step(wanted, np.nan)
    assert force == pytest.approx(expected, rel=5e-4)


def test_the_integral_acts_with_a_third_where_nothing_is_unexplained(bench):
    """At rest, 0.1 N below the reference: the force is that of the plain inverse for a reference that grows so."""
    tuner = bench.tuner(replace(bench.tuning(TENSION, gain=40.0), drift_level=0.0))
    plain, factor = bench.tuner(bench.tuning(TENSION)), 1.0
    for _ in range(100):
        factor *= 1 + 40.0 * bench.step_s / 3 * 2 * (30.0 - 29.9) / (30.0 + 29.9)
        force, expected = tuner.step(30.0, 29.9), plain.step(30.0 * factor, np.nan)
    assert force > 30.05
    assert force == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"parameters": (Tunable.LOAD_STIFFNESS,)}, "must tune the friction"),
        ({"parameters": (Tunable.MU, Tunable.MU_PULL)}, "a part of it"),
        ({"parameters": (Tunable.MU, Tunable.MU)}, "one name or two different ones"),
        ({"delay_samples": 64}, "from 0 to 63, got 64"),
        ({"lowest": 1.2}, "range must hold 1"),
        ({"span": 0.0}, "a constant reference teaches nothing"),
        ({"sensor": POSITION, "integral_gain_per_s": 5.0}, "needs the output tension"),
    ],
)
def test_what_cannot_be_tuned_is_refused_with_the_way_out(changes, text):
    good = {
        "sensor": TENSION,
        "parameters": (Tunable.MU,),
        "delay_samples": 2,
        "noise": 0.1,
        "span": 30.0,
        "step_s": 1e-3,
    }
    with pytest.raises(ParameterError, match=text):
        Tuning.of(**(good | changes))


def test_a_tuner_and_its_numbers_must_agree(bench):
    tuned = TunedChain.of(bench.transmission, Level.PRESLIDING, (Tunable.MU,))
    with pytest.raises(ParameterError, match="must carry the factors"):
        SelfTuner(tuned, 1e-3, bench.tuning(TENSION, (Tunable.MU_PULL,)), bench.limits, 30.0)


def test_an_exponent_that_is_tuned_is_the_law_of_every_mass_at_the_mean_tension(bench):
    """Coefficient of an element where the ends have 45 and 80 N, 60 in the mean, and the start 30."""
    tuned = TunedChain.of(bench.transmission, Level.PRESLIDING, (Tunable.MU, Tunable.LOAD_EXPONENT))
    load = float(load_law(0.0).function()(45.0, 80.0, 30.0))
    found = tuned.with_factors({Tunable.LOAD_EXPONENT: 1.2}, load).numbers()
    for name in ("friction_mu_dynamic_pull", "friction_mu_static_release"):
        known = float(tuned.chain.numbers()[name])
        there, _ = at_load(ca.SX(known), ca.SX(60.0), ca.SX(0.2), ca.SX(30.0))
        assert float(found[name]) == pytest.approx(float(ca.evalf(there)), rel=1e-12)
        assert float(found[name]) < 0.9 * known
