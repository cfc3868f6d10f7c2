"""Exported C of fingers: compiled, and compared with the Python model and the runtime."""

import ctypes
import json
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import tendonff as tf
from tendonff.compensator.cli import run
from tendonff.compensator.compensators.motors.finger import FingerTask
from tendonff.compensator.export.finger import project
from tendonff.compensator.export.finger.fmu import build_finger_fmu
from tendonff.compensator.export.finger.golden import FingerCourse, followed_course, largest_departure, run_courses
from tendonff.compensator.export.finger.project import export_fingers
from tendonff.compensator.export.finger.text import finger_module
from tendonff.compensator.export.host import compile_on_host
from tendonff.compensator.export.kinds import FmiVersion, Kind
from tendonff.compensator.files.reading import InputError
from tendonff.compensator.scenario.driven.finger import FingerScenario, parse_finger_scenario
from tendonff.ocp.codegen.precision import Precision
from tendonff.ocp.errors import SolveError

pytestmark = pytest.mark.compiler
EXAMPLE = Path(__file__).parents[3] / "examples/three_joint_finger.toml"
TEXT = EXAMPLE.read_text("utf-8")
STRICT = ("-Wshadow", "-Wconversion", "-Wdouble-promotion", "-pedantic", "-Wall", "-Wextra", "-Werror")
ARMS = {"mcp": (0.010, 0.0, 0.0), "pip": (0.002, 0.010, 0.0), "dip": (0.002, 0.002, 0.008)}


def shortened(text: str, masses: int = 6) -> str:
    for old, new in (
        ("duration_s = 3.0", "duration_s = 0.4"),
        ("fade_in_s = 0.5", "fade_in_s = 0.3"),
        ("segments = 12", f"segments = {masses}"),
    ):
        assert old in text
        text = text.replace(old, new)
    return text


def finger(stem: str = "three", *changes: tuple[str, str], text: str = "") -> FingerScenario:
    text = text or shortened(TEXT)
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new)
    return parse_finger_scenario(text, EXAMPLE.with_name(f"{stem}.toml"))


def loops() -> FingerScenario:
    """Three loops on three joints, whose tendons pass the others."""
    text = shortened(TEXT)
    head, reference = text[: text.index("[[tendons]]")], text[text.index("[reference]") :]
    for name, arms in ARMS.items():
        for side, sign in (("flexor", 1), ("extensor", -1)):
            head += f'[[tendons]]\nname = "{name}_{side}"\n[tendons.path]\nsegments = 8\n'
            head += '[[tendons.path.sections]]\nname = "channel"\nangle_rad = 2.0\nlength_m = 0.25\n'
            for joint, arm in zip(ARMS, arms, strict=True):
                if arm:
                    head += f'[[tendons.path.sections]]\nname = "at_{joint}"\nangle_rad = 0.3\nlength_m = 0.03\n'
                    head += f'joint = "{joint}"\nlength_per_rad_m = {-sign * arm}\nangle_per_rad = 0.3\n'
        head += f'[[motors]]\nname = "{name}"\ndrums_m = {{ {name}_flexor = 0.008, {name}_extensor = -0.008 }}\n'
        head += "pretension_N = 14.0\nservo_time_s = 0.02\nbacklash_rad = 0.01\nspeed_max_rad_per_s = 2.0\n"
    return finger("loops", text=head + reference)


UNDER = """schema = 1
[joints.a]
kind = "driven"
inertia_kg_m2 = 8e-5
damping_N_m_s_per_rad = 2e-3
stiffness_N_m_per_rad = 0.12
rest_rad = -0.3
[joints.b]
kind = "driven"
inertia_kg_m2 = 3e-5
damping_N_m_s_per_rad = 2e-3
stiffness_N_m_per_rad = 0.10
rest_rad = -0.3
[[tendons]]
name = "flexor"
moment_arms_m = { b = 0.007 }
[tendons.path]
segments = 6
[[tendons.path.sections]]
name = "channel"
angle_rad = 1.5
length_m = 0.2
[[tendons.path.sections]]
name = "at_a"
angle_rad = 0.3
length_m = 0.03
joint = "a"
length_per_rad_m = -0.010
[drive]
drum_radius_m = 0.008
gear_ratio = 2.0
"""


def springed() -> FingerScenario:
    """One tendon, two springed joints, of which one follows; friction with the Stribeck effect, no bristle."""
    rope = TEXT[TEXT.index("[tendon]") : TEXT.index("# A section that follows")]
    rope = rope.replace("mu_static = 0.15", "mu_static = 0.18\nstribeck_velocity_m_per_s = 5e-3")
    text = UNDER + rope + '[reference]\nkind = "sine"\nduration_s = 0.4\nfade_in_s = 0.3\n'
    text += "[reference.joints.a]\noffset_rad = 0.6\namplitudes_rad = [0.2]\nfrequencies_Hz = [1.5]\n"
    return finger("under", text=text + '[run]\nstep_s = 1e-3\nlevel = "viscoelastic"\n')


@pytest.mark.parametrize("precision", [Precision.FLOAT, pytest.param(Precision.DOUBLE, marks=pytest.mark.nightly)])
def test_fingers_of_all_kinds_in_one_folder_pass_their_self_test_without_a_warning(precision, tmp_path):
    """N + 1 tendons, three loops, and one tendon on two springed joints: all of their numbers differ."""
    exported = export_fingers(finger(), further=(loops(), springed()), precision=precision, prefix="hand")
    assert exported.loss_rad < (1e-9 if precision is Precision.DOUBLE else 2e-3)
    exported.write(tmp_path / "c")
    optimised = "-O1" if precision is Precision.FLOAT else "-O0"
    command = ["make", "-s", "test", "example", f"CFLAGS={optimised} {' '.join(STRICT)}"]
    done = subprocess.run(command, cwd=tmp_path / "c", check=False, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
    assert "self test passed" in done.stdout
    text = "".join(text for name, text in exported.files.items() if name.endswith(("core.h", "finger.c", "data.h")))
    assert "malloc" not in text
    assert "tff_" not in text


def test_the_exported_inverse_is_the_runtime():
    scenario = finger()
    task = FingerTask.of(scenario)
    module = finger_module([task], [task.problem(task.finger)], Precision.DOUBLE, "tff")
    course = followed_course(task, Precision.DOUBLE)
    [answers], _ = run_courses(module.files, "tff", Precision.DOUBLE, [course], [0])
    runtime = tf.Runtime(scenario)
    live = np.array([runtime.step(row) for row in course.angle_rad[1:]])
    assert np.abs(answers.command_rad[1:] - live).max() < 1e-9
    assert largest_departure([course], [answers]) < 1e-9
    assert answers.evaluations.max() <= 60


def turning_back(task: FingerTask, precision: Precision, rows: int = 6000) -> FingerCourse:
    """The reference to and fro, with turns within a sample at random."""
    noise, course = np.random.default_rng(3), followed_course(task, precision)
    place, at, way = [0], 0, 1
    while len(place) < rows:
        for _ in range(int(noise.integers(20, 150))):
            at = abs(at + way)
            place.append(min(at, len(course.angle_rad) - 1))
        at, way = place[-1], -way
    return replace(course, angle_rad=course.angle_rad[place], torque_N_m=course.torque_N_m[place])


def test_tensions_are_found_in_a_dozen_evaluations_where_joints_turn_back_within_a_sample():
    """Hardly more than three in the mean, and in float the motors of double: no row goes without an answer."""
    task, found = FingerTask.of(finger()), []
    for precision in Precision:
        module = finger_module([task], [task.problem(task.finger)], precision, "tff")
        [answers], _ = run_courses(module.files, "tff", precision, [turning_back(task, precision)], [0])
        assert answers.evaluations.max() <= 12
        assert answers.evaluations.mean() < 3.2
        found.append(answers.motor_rad)
    assert np.abs(found[0] - found[1]).max() < 1e-3


def test_the_command_writes_the_folder_and_states_the_errors(tmp_path, capsys):
    (tmp_path / "three.toml").write_text(shortened(TEXT), "utf-8")
    assert run(["export-c", str(tmp_path / "three.toml"), "--out", str(tmp_path / "c"), "--precision", "float"]) == 0
    said = "".join(capsys.readouterr())
    assert "three: RMS error" in said
    assert "by the ratio alone" in said
    design = json.loads((tmp_path / "c/design.json").read_text("utf-8"))
    scores = design["fingers"][0]["scores"]
    assert scores["inverse"]["rmse_rad"] < 0.1 * scores["linear"]["rmse_rad"]
    readme = (tmp_path / "c/README.md").read_text("utf-8")
    assert "TFF_FINGER_THREE" in readme
    assert "mcp, pip, dip" in readme
    expected = tf.Runtime(str(tmp_path / "three.toml")).expectation.headline("exact inverse", "")
    sentence = expected[: expected.index("Next:")]
    assert sentence.startswith("Tracking error up to")
    assert f"- three: {sentence}" in readme
    assert f"three: {sentence}" in said


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ((("step_s = 1e-3", "step_s = 2e-3"),), "share their sample time"),
        ((), "files of this name"),
    ],
)
def test_fingers_that_do_not_go_together_are_refused(changes, message):
    with pytest.raises(InputError, match=message):
        export_fingers(finger(), further=(finger("other" if changes else "three", *changes),))


@pytest.mark.nightly  # as modules of a tension that are worse than none
def test_commands_that_are_worse_than_the_ratio_are_not_exported(monkeypatch):
    judge = project.judge
    monkeypatch.setattr(project, "judge", lambda task, name, command_rad: judge(task, name, 0 * command_rad))
    with pytest.raises(SolveError, match="not better than the ratio alone"):
        export_fingers(finger())
    assert "exported because of --force-export" in export_fingers(finger(), force_export=True).warnings[0]


@pytest.mark.parametrize("fmi", [pytest.param(FmiVersion.V2, marks=pytest.mark.nightly), FmiVersion.V3])
def test_a_unit_of_a_finger_is_valid_and_equals_the_runtime(fmi, tmp_path):
    """FMPy records the input a row late: row k + 1 holds what step k used."""
    fmpy = pytest.importorskip("fmpy", reason="FMPy is not installed")
    from fmpy.validation import validate_fmu

    scenario = finger()
    unit = build_finger_fmu(scenario, fmi=fmi)
    assert "by the ratio alone" in unit.lines[0]
    unit.write(tmp_path)
    path = str(tmp_path / unit.name)
    assert validate_fmu(path) == []
    task = FingerTask.of(scenario)
    angle = task.wanted_rad[:150]
    names = [f"angle_{joint}" for joint in task.finger.names]
    motors = [f"motor_{motor.name}" for motor in task.finger.motors]
    rows = [(k * 1e-3, *row) for k, row in enumerate(angle)]
    out = fmpy.simulate_fmu(
        path,
        stop_time=rows[-1][0],
        step_size=1e-3,
        output_interval=1e-3,
        input=np.array(rows, dtype=[("time", float), *((name, float) for name in names)]),
        output=[*names, *motors],
        fmi_type="CoSimulation",
    )
    runtime = tf.Runtime(scenario)
    live = np.array([runtime.step([row[name] for name in names]) for row in out[2:]])  # the first repeats the start
    assert np.array([[row[name] for name in motors] for row in out[2:]]) == pytest.approx(live, abs=1e-9)
    assert np.ptp(live, axis=0).max() > 0.01


PLANT = """#include "tff_finger.h"
int move(long n, int joints, int motors, int tendons, const tff_real *motor, tff_real *angle, tff_real *tension)
{
    static tff_finger self;
    const tff_real none[TFF_FINGER_BODIES] = { 0 };
    int good = (int)tff_finger_init_at(&self, 0, angle, none);
    unsigned seen = 0u;
    long k;
    int j;
    for (k = 1; k < n; k++) {
        const uint32_t status = tff_finger_observe(&self, TFF_STEP_S, &motor[motors * k], none);
        good = good && ((status & ~(TFF_SLACK | TFF_TORQUE_LIMITED)) == TFF_OK);
        seen |= (unsigned)status;
        for (j = 0; j < joints; j++) {
            angle[(joints * k) + j] = self.joint_rad[j];
        }
        for (j = 0; j < tendons; j++) {
            tension[(tendons * k) + j] = self.tension_N[j];
        }
    }
    return good * (((seen & TFF_SLACK) != 0u) ? 2 : 1);
}
"""


@pytest.mark.parametrize(
    ("made", "precision", "beside_rad", "most_rad", "most_N"),
    [
        (finger, Precision.DOUBLE, 0.1, 1e-9, 1e-6),
        (finger, Precision.FLOAT, 0.1, 5e-5, 0.02),
        (loops, Precision.DOUBLE, 0.05, 1e-9, 1e-6),
        (springed, Precision.DOUBLE, 0.1, 1e-9, 1e-6),
        (finger, Precision.DOUBLE, -0.05, 0.03, 1.0),  # slack: what friction holds in a tendon that hangs is left out
    ],
)
def test_the_plant_goes_where_the_simulation_has_it(made, precision, beside_rad, most_rad, most_N):
    """Each motor winds more or less than the inverse would, by a way of its own."""
    task = FingerTask.of(made())
    module = finger_module([task], [task.problem(task.finger)], precision, "tff")
    motor = followed_course(task, precision).run.motor
    place = np.linspace(0, 1, len(motor))[:, None] * (2.0 + np.arange(motor.shape[1]))
    motor = motor + beside_rad * (1 - np.cos(np.pi * place))
    there = task.turned(motor).response
    joints, tendons = there.position_rad.shape[1], there.tension_N.shape[1]
    code = compile_on_host(module.files, PLANT, precision)
    angle = code.array(np.tile(task.sampled.angle_rad[0], (len(motor), 1)))
    tension = code.array(np.zeros((len(motor), tendons)))
    sizes = (ctypes.c_long, *(ctypes.c_int,) * 3)
    call = code.function("move", *sizes, *(code.reals,) * 3, result=ctypes.c_int)
    found = call(len(motor), joints, motor.shape[1], tendons, code.array(motor), angle, tension)
    assert found == (1 if beside_rad > 0 else 2)
    assert np.abs(there.position_rad - task.sampled.angle_rad).max() > 0.01
    assert np.abs(angle - there.position_rad)[1:].max() < most_rad
    assert np.abs(tension - there.tension_N)[1:].max() < most_N


def test_the_plant_of_a_finger_as_a_unit_undoes_its_inverse(tmp_path):
    fmpy = pytest.importorskip("fmpy", reason="FMPy is not installed")
    from fmpy.validation import validate_fmu

    scenario = finger()
    unit = build_finger_fmu(scenario, Kind.PLANT)
    assert unit.lines == ()  # the errors of the inverse are none of a plant's
    unit.write(tmp_path)
    assert validate_fmu(str(tmp_path / unit.name)) == []
    task = FingerTask.of(scenario)
    run = followed_course(task, Precision.DOUBLE).run
    names = [f"motor_{motor.name}" for motor in task.finger.motors]
    joints = [f"angle_{joint}" for joint in task.finger.names]
    rows = [(k * 1e-3, *row) for k, row in enumerate(run.motor[1:])]
    out = fmpy.simulate_fmu(
        str(tmp_path / unit.name),
        stop_time=rows[-1][0],
        step_size=1e-3,
        output_interval=1e-3,
        input=np.array(rows, dtype=[("time", float), *((name, float) for name in names)]),
        output=[*joints, f"tension_{task.finger.tendons[0].name}"],
        fmi_type="CoSimulation",
    )
    found = np.array([[row[name] for name in joints] for row in out[1:]])
    assert found == pytest.approx(run.position[1:-1], abs=1e-7)
    assert out[f"tension_{task.finger.tendons[0].name}"][1:] == pytest.approx(run.tension_N[1:-1, 0], abs=1e-4)
