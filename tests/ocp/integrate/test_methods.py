"""CasADi's integrators against the fixed step: the same equations, the same inputs."""

import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest
from _pytest.mark import ParameterSet
from numpy.typing import NDArray
from typer.testing import CliRunner

import tendonff as tf
from tendonff.compensator.cli import app
from tendonff.compensator.compensators.plant import behind_servo
from tendonff.compensator.scenario.driven.joint import sample_joint
from tendonff.compensator.scenario.sampled.joint_motion import moved
from tendonff.models.errors import ParameterError
from tendonff.models.fidelity import Level
from tendonff.models.joint.description import describe
from tendonff.models.mechanism import Mechanism, equations_of, rest_state
from tendonff.models.parameters import Path as TendonPath
from tendonff.models.parameters import Transmission
from tendonff.models.parameters.drive import Drive
from tendonff.models.path import JointMotion, Section
from tendonff.models.tendon.chain import Chain
from tendonff.ocp.codegen.engine import Engine
from tendonff.ocp.integrate.method import Accuracy, Method
from tendonff.ocp.joint.protocol import JointProblem
from tendonff.ocp.joint.simulate import JointOutcome, JointSimulation
from tendonff.ocp.tendon.simulate import Outcome, Simulation

Array = NDArray[np.float64]

STEP = 1e-3
TIME = STEP * np.arange(201)
INTEGRATORS = (Method.CVODES, Method.IDAS, Method.COLLOCATION)


def nightly(value: str) -> ParameterSet:
    return pytest.param(value, marks=pytest.mark.nightly)


def wave(start: float, swing: float) -> Array:
    """Up, and down to far below the start: both ways of sliding within 0.2 s."""
    return start + swing * np.sin(2 * np.pi * 7 * TIME) * np.minimum(TIME / 0.05, 1.0)


def tendons(generic: Transmission) -> dict[str, tuple[Chain, Array]]:
    """Chains and their forces: every level, joints that move path and far end, a servo, dry friction, slack."""
    pull = wave(30.0, 15.0)
    section = Section(name="bend", angle_rad=1.0, length_m=0.1, joint="elbow", angle_per_rad=0.8, length_per_rad_m=0.01)
    straight = Section(name="sheath", angle_rad=1.5, length_m=0.2)
    elbow = JointMotion(names=("elbow",), time_s=TIME, angle_rad=0.4 * np.sin(2 * np.pi * 3 * TIME)[:, None])
    path = TendonPath(total_angle_rad=2.5, segments=5, sections=(straight, section))
    moving = replace(generic, path=path, motion=elbow)
    far = replace(moving, load=replace(generic.load, joint="elbow", moment_arm_m=0.004))
    rubbing = replace(generic, actuator=replace(generic.actuator, coulomb_N=3.0))
    servo = replace(generic.actuator, drive=Drive.POSITION, servo_stiffness_N_per_m=2e5)
    chains = {level.value: (Chain.of(generic, level), pull) for level in Level}
    chains["moving"] = Chain.of(moving, Level.PRESLIDING), pull
    chains["far end"] = Chain.of(far, Level.PRESLIDING), pull
    chains["rubbing"] = Chain.of(rubbing, Level.PRESLIDING), pull
    chains["servo"] = behind_servo(Chain.of(generic, Level.PRESLIDING), servo, 30.0, 4e-4 * wave(0.0, 1.0))
    chains["slack"] = Chain.of(generic, Level.PRESLIDING), np.maximum(wave(10.0, 18.0), 0.0)
    return chains


def simulated(chain: Chain, force: Array, refinement: int = 1, **options: Any) -> Simulation:
    """From rest under the first force, of a servo under 30 N; rows as TIME."""
    start = 30.0 if chain.near.stiffness_N_per_m else float(force[0])
    inner = np.arange(200 * refinement + 1) / refinement
    return tf.simulate(
        chain, np.interp(inner, np.arange(201), force), STEP / refinement, initial_tension_N=start, **options
    )


def apart(a: Array, b: Array) -> float:
    """RMS difference over the range of the second."""
    return float(np.sqrt(np.mean((a - b) ** 2)) / np.ptp(b))


@pytest.mark.parametrize(
    "rig", ["elastic", nightly("viscoelastic"), "presliding", "moving", nightly("far end"), "rubbing", "servo"]
)
def test_a_tendon_integrated_is_what_the_fixed_step_tends_to(rig: str, generic: Transmission) -> None:
    chain, force = tendons(generic)[rig]
    exact = simulated(chain, force, 50).output_tension_N[::50]
    by_step = apart(simulated(chain, force).output_tension_N, exact)  # at 7 Hz
    for method in INTEGRATORS:
        run = simulated(chain, force, method=method)
        assert run.outcome is Outcome.DONE
        assert apart(run.output_tension_N, exact) < min(5e-4, by_step / 10), method


@pytest.mark.parametrize("method", [Method.CVODES, Method.IDAS])
def test_the_difference_shrinks_with_the_tolerance(method: Method, generic: Transmission) -> None:
    chain, force = tendons(generic)["presliding"]
    exact = simulated(chain, force, method=method, rtol=1e-10, atol=1e-13).output_tension_N
    found = [
        apart(simulated(chain, force, method=method, rtol=tolerance, atol=1e-3 * tolerance).output_tension_N, exact)
        for tolerance in (1e-3, 1e-5, 1e-7)
    ]
    assert found[0] > 5 * found[1] > 25 * found[2]
    assert found[2] < 1e-5


def test_a_slack_tendon_carries_nothing_by_any_method(generic: Transmission) -> None:
    chain, force = tendons(generic)["slack"]
    exact = simulated(chain, force, 50)
    assert exact.outcome is Outcome.SLACK
    for method in INTEGRATORS:
        run = simulated(chain, force, method=method)
        assert run.outcome is Outcome.SLACK
        assert run.tension_N.min() == 0.0
        assert apart(run.output_tension_N, exact.output_tension_N[::50]) < 2e-3, method


def test_a_run_goes_on_from_a_recorded_state(generic: Transmission) -> None:
    chain, force = tendons(generic)["moving"]
    whole = simulated(chain, force, method=Method.IDAS, record=True)
    assert whole.states is not None
    half = tf.simulate(chain, force[:101], STEP, method=Method.IDAS)
    rest = tf.simulate(chain, force[100:], STEP, state=half.final, method=Method.IDAS)
    assert rest.output_tension_N[-1] == pytest.approx(whole.output_tension_N[-1], rel=1e-5)
    assert whole.states[-1] == pytest.approx(whole.final.vector())


def test_an_integrator_that_gives_up_says_when_and_what_to_try(generic: Transmission) -> None:
    chain, force = tendons(generic)["presliding"]
    run = simulated(chain, force, method=Method.CVODES, rtol=1e-18, atol=1e-21)
    assert run.outcome is Outcome.FAILED
    assert "cvodes gave up there: check the input for jumps, try less accurate tolerances" in run.message


def test_numbers_that_mean_nothing_are_refused(generic: Transmission) -> None:
    chain, force = tendons(generic)["presliding"]
    with pytest.raises(ParameterError, match="rtol must be a finite number > 0, got 0"):
        simulated(chain, force, method=Method.IDAS, rtol=0.0)
    with pytest.raises(ParameterError, match="elements must be >= 1, got 0"):
        Accuracy(elements=0)
    page = equations_of(Mechanism.of(generic).cut(Level.ELASTIC))
    start = np.zeros(page.state.numel())
    with pytest.raises(ParameterError, match=r'"bdf2" is that of simulate; integrate takes "idas"'):
        tf.integrate(page, start, np.zeros((3, 2)), STEP, method=Method.BDF2)
    with pytest.raises(ParameterError, match=r"inputs must be finite numbers of shape \(3, 2\), got shape \(3, 1\)"):
        tf.integrate(page, start, np.zeros((3, 1)), STEP)
    with pytest.raises(ParameterError, match="start must have 30 states, got 29"):
        tf.integrate(page, start[:-1], np.zeros((3, 2)), STEP)


@pytest.mark.parametrize(("method", "within"), [(Method.COLLOCATION, 1e-5), (Method.CVODES, 2e-2)])
def test_sensitivities_are_those_of_differences(method: Method, within: float, generic: Transmission) -> None:
    """Over friction and stiffness of the tendon, which the state at rest depends on as well."""
    symbols, values = (ca.SX.sym("mu"), ca.SX.sym("k")), np.array([0.2, 2e4])
    force = np.column_stack([wave(30.0, 15.0), np.zeros(201)])

    def run(mu: ca.SX, k: ca.SX, **over: Any) -> tf.Integration:
        numbers = {"tendon": {"mu_dynamic_pull": mu, "mu_static_pull": mu, "stiffness_N_per_m": k}}
        cut = Mechanism.of(generic).cut(Level.PRESLIDING, numbers=numbers)
        start = rest_state(cut, {"tendon": 30.0}, {"actuator": 0.0, "load": 30.0 / generic.load.stiffness_N_per_m})
        return tf.integrate(equations_of(cut), start, force, STEP, method=method, rtol=1e-9, atol=1e-12, **over)

    slopes = run(*symbols, over=ca.vertcat(*symbols), at=values).require().slopes
    for k, value in enumerate(values):
        d = 1e-4 * value * np.eye(2)[k]
        up, down = (run(*(values + sign * d)).require().states for sign in (1, -1))
        by_difference = (up - down) / (2e-4 * value)
        for column in (0, 3):  # where the ends are
            largest = np.abs(by_difference[:, column]).max()
            assert np.abs(slopes[:, column, k] - by_difference[:, column]).max() < within * largest
            assert largest > 0


def test_sensitivities_of_a_joint_are_those_of_differences(examples: Path) -> None:
    """A loop that turns: over friction of one tendon and the inertia of the joint."""
    scenario = tf.load_scenario(examples / "hand_joint.toml")
    motion = sample_joint(scenario).motion
    loop = describe(scenario.mechanism, motion)
    motor = 0.1 * (1 - np.cos(2 * np.pi * 10 * TIME[:101]))[:, None]
    start_rad = float(motion.angle_rad[0, 0])

    def run(mu: ca.SX, inertia: ca.SX, **over: Any) -> tf.Integration:
        bodies = tuple(replace(b, inertia=inertia) if b.name == loop.bodies[0].name else b for b in loop.bodies)
        name = loop.tendons[0].name
        numbers = {name: {"mu_dynamic_pull": mu, "mu_static_pull": mu}}
        cut = replace(loop, bodies=bodies).cut(Level.PRESLIDING, numbers=numbers)
        tensions = dict.fromkeys((tendon.name for tendon in cut.tendons), 5.0)
        start = rest_state(cut, tensions, {b.name: start_rad if b in cut.free else 0.0 for b in cut.bodies})
        zero = np.zeros((101, 1))
        return tf.integrate(equations_of(cut), start, zero, STEP, places=motor, method=Method.COLLOCATION, **over)

    symbols, values = (ca.SX.sym("mu"), ca.SX.sym("J")), np.array([0.15, scenario.mechanism.joint.inertia_kg_m2])
    slopes = run(*symbols, over=ca.vertcat(*symbols), at=values).require().slopes[:, 0]
    for k, value in enumerate(values):
        d = 1e-4 * value * np.eye(2)[k]
        up, down = (run(*(values + sign * d)).require().states[:, 0] for sign in (1, -1))
        by_difference = (up - down) / (2e-4 * value)
        assert np.abs(slopes[:, k] - by_difference).max() < 1e-3 * np.abs(by_difference).max()


def joint_rigs(examples: Path, swing_rad: float = 0.1) -> dict[str, tuple[JointProblem, Array]]:
    """A loop, a pair, one tendon against a spring; and the motor's way."""
    found = {}
    for name in ("hand_joint", "instrument_pair"):
        scenario = tf.load_scenario(examples / f"{name}.toml")
        sampled = sample_joint(scenario)
        swing = swing_rad * wave(0.0, 1.0)[:, None] * (1.0 if name == "hand_joint" else np.array([1.0, -1.0]))
        found[name] = tf.system_of(scenario.mechanism, Level.PRESLIDING, sampled.motion), swing
    pair = tf.load_scenario(examples / "instrument_pair.toml").mechanism
    joint = replace(pair.joint, stiffness_N_m_per_rad=0.05, rest_rad=-2.0, coulomb_N_m=1e-3)
    single = replace(pair, joints=(joint,), tendons=pair.tendons[:1], drive=replace(pair.drive, drum_radius_m=(0.004,)))
    problem = found["instrument_pair"][0]
    motion = problem.chains[0].motion
    assert motion is not None
    found["one and a spring"] = tf.system_of(single, Level.VISCOELASTIC, motion), 0.1 * wave(0.0, 1.0)[:, None]
    return found


def turned(problem: JointProblem, motor: Array, refinement: int = 1, **options: Any) -> JointSimulation:
    inner = np.arange(200 * refinement + 1) / refinement
    rows = np.column_stack([np.interp(inner, np.arange(201), column) for column in motor.T])
    return tf.simulate(problem, rows, STEP / refinement, **options)


@pytest.mark.compiler
@pytest.mark.parametrize("rig", ["hand_joint", nightly("instrument_pair")])
def test_a_tendon_of_a_joint_may_go_slack(rig: str, examples: Path) -> None:
    """Under a swing of 0.4 rad at 7 Hz; cvodes and collocation may give up there."""
    problem, motor = joint_rigs(examples, 0.4)[rig]
    exact, run = turned(problem, motor, 20), turned(problem, motor, method=Method.IDAS)
    assert run.outcome is exact.outcome is JointOutcome.SLACK
    assert run.lowest_N.min() == 0.0
    assert apart(run.angle_rad, exact.angle_rad[::20]) < 1e-4
    assert apart(run.tension_N, exact.tension_N[::20]) < 5e-3


@pytest.mark.compiler
@pytest.mark.parametrize("rig", ["hand_joint", nightly("instrument_pair"), "one and a spring"])
def test_a_joint_integrated_is_what_the_compiled_step_tends_to(rig: str, examples: Path) -> None:
    problem, motor = joint_rigs(examples)[rig]
    exact = turned(problem, motor, 20)
    for method in INTEGRATORS:
        run = turned(problem, motor, method=method)
        assert run.outcome is JointOutcome.DONE
        assert run.method is method
        assert apart(run.angle_rad, exact.angle_rad[::20]) < 3e-4, method
        for name in ("torque_N_m", "tension_N", "drum_N"):
            assert apart(getattr(run, name), getattr(exact, name)[::20]) < 2e-3, (method, name)


@pytest.mark.parametrize(
    ("rig", "method"),
    [
        ("hand_joint", Method.IDAS),
        pytest.param("hand_joint", Method.CVODES, marks=pytest.mark.nightly),
        pytest.param("instrument_pair", Method.IDAS, marks=pytest.mark.nightly),
        pytest.param("instrument_pair", Method.CVODES, marks=pytest.mark.nightly),
    ],
)
def test_the_difference_of_a_joint_shrinks_with_the_tolerance(rig: str, method: Method, examples: Path) -> None:
    problem, motor = joint_rigs(examples)[rig]
    exact = turned(problem, motor, method=method, rtol=1e-10, atol=1e-13).tension_N
    found = [
        apart(turned(problem, motor, method=method, rtol=tolerance, atol=1e-3 * tolerance).tension_N, exact)
        for tolerance in (1e-3, 1e-5, 1e-7)
    ]
    assert found[0] > 5 * found[1] > 25 * found[2]
    assert found[2] < 1e-5


@pytest.mark.compiler
def test_a_led_joint_gives_its_torque_by_any_method(examples: Path) -> None:
    problem, motor = joint_rigs(examples)["hand_joint"]
    led = problem.start_rad + 0.05 * wave(0.0, 1.0)
    fine = np.interp(np.arange(4001) / 20, np.arange(201), led)
    exact = turned(problem, motor, 20, led_rad=fine).torque_N_m[::20]
    assert apart(turned(problem, motor, method=Method.IDAS, led_rad=led).torque_N_m, exact) < 2e-3


@pytest.mark.compiler
def test_a_joint_goes_on_by_the_compiled_step_where_an_integrator_ended(examples: Path) -> None:
    problem, motor = joint_rigs(examples)["hand_joint"]
    half = tf.simulate(problem, motor[:101], STEP, method=Method.IDAS)
    for method in (Method.BDF2, Method.IDAS):
        rest = tf.simulate(problem, motor[100:], STEP, memory=half.final, method=method)
        assert rest.angle_rad[-1] == pytest.approx(turned(problem, motor, 20).angle_rad[-1], abs=2e-3)


@pytest.mark.compiler
def test_a_joint_needs_no_compiler(examples: Path) -> None:
    problem, motor = joint_rigs(examples)["instrument_pair"]
    run = turned(problem, motor, engine=Engine.CASADI)
    assert run.method is Method.BDF2
    assert apart(run.angle_rad, turned(problem, motor).angle_rad) < 1e-6


def test_the_command_line_takes_a_method(examples: Path, tmp_path: Path) -> None:
    scenario = shutil.copy(examples / "finger.toml", tmp_path)
    rows = "\n".join(f"{t:.3f},{f:.9f}" for t, f in zip(TIME, wave(30.0, 15.0), strict=True))
    (tmp_path / "force.csv").write_text(f"time_s,force_N\n{rows}\n")
    tables = []
    for method in ("bdf2", "idas"):
        out = tmp_path / f"{method}.csv"
        given = ["--force", str(tmp_path / "force.csv"), "--out", str(out), "--method", method]
        done = CliRunner().invoke(app, ["simulate", str(scenario), *given])
        assert done.exit_code == 0, done.output
        tables.append(np.genfromtxt(out, delimiter=",", names=True)["tension_7_N"])
    assert 0 < apart(tables[1], tables[0]) < 5e-3
    done = CliRunner().invoke(app, ["simulate", str(scenario), *given, "--check"])
    assert "--check halves the fixed step, which --method idas does not have" in str(done.exception)


@pytest.mark.nightly
@pytest.mark.parametrize("name", ["bowden", "exosuit", "finger", "finger_moving", "finger_stribeck", "surgical"])
@pytest.mark.parametrize("method", INTEGRATORS)
def test_every_example_is_simulated_alike_by_every_method(name: str, method: Method, examples: Path) -> None:
    """Within 0.05 % of range of the default."""
    scenario = tf.load_scenario(examples / f"{name}.toml")
    reference = tf.sample_reference(scenario)
    chain = Chain.of(moved(scenario, float(reference.time_s[-1])), scenario.run.level)
    start = reference.initial_tension_N
    force = tf.invert(chain, reference.tension_N, reference.step_s, initial_tension_N=start).force_N
    force = np.clip(force, scenario.transmission.actuator.force_min_N, scenario.transmission.actuator.force_max_N)
    by_step, run = (
        tf.simulate(chain, force, reference.step_s, initial_tension_N=start, method=each).require()
        for each in (Method.BDF2, method)
    )
    assert apart(run.output_tension_N, by_step.output_tension_N) < 5e-4


@pytest.mark.compiler
@pytest.mark.nightly
@pytest.mark.parametrize("name", ["hand_joint", "instrument_pair"])
@pytest.mark.parametrize("method", INTEGRATORS)
def test_every_joint_is_simulated_alike_by_every_method(name: str, method: Method, examples: Path) -> None:
    scenario = tf.load_scenario(examples / f"{name}.toml")
    sampled, step = sample_joint(scenario), scenario.run.step_s
    problem = tf.system_of(scenario.mechanism, scenario.run.level, sampled.motion)
    motor = tf.invert(problem, sampled.angle_rad, step, contact_N_m=sampled.contact_N_m).motor_rad
    by_step, run = (
        tf.simulate(problem, motor, step, contact_N_m=sampled.contact_N_m, method=each).require()
        for each in (Method.BDF2, method)
    )
    assert apart(run.angle_rad, by_step.angle_rad) < 5e-4
