"""Co-simulation units: valid, equal to the Python model, and rebuilt from their own sources."""

import io
import shutil
import subprocess
import zipfile
from dataclasses import replace

import numpy as np
import pytest

from tendonff.compensator.cli import run
from tendonff.compensator.compensators.base import Problem
from tendonff.compensator.compensators.table import table_of
from tendonff.compensator.export import fmu
from tendonff.compensator.export import unit as packing
from tendonff.compensator.export.fmu import build_fmu
from tendonff.compensator.export.golden import answers
from tendonff.compensator.export.kinds import FmiVersion, Kind
from tendonff.compensator.files.reading import InputError
from tendonff.compensator.scenario.reference import Shape, WaypointReference
from tendonff.compensator.scenario.sampled.sampling import sample_reference
from tendonff.compensator.scenario.scenario import scenario_to_toml
from tendonff.compensator.scenarios import load_scenario
from tendonff.models.tendon.chain import Chain
from tendonff.ocp.codegen.compiler import has_cross_compiler
from tendonff.ocp.codegen.precision import Precision
from tendonff.ocp.tendon.inverse import invert
from tendonff.ocp.tendon.simulate import simulate

pytestmark = pytest.mark.compiler

fmpy = pytest.importorskip("fmpy", reason="fmpy is not installed")
NAMES = {
    Kind.INVERSE: ("reference", "force"),
    Kind.CAPSTAN: ("reference", "force"),
    Kind.TABLE: ("reference", "force"),
    Kind.PLANT: ("force", "tension"),
    Kind.OBSERVER: ("input_tension", "tension"),
}
ROWS = 1000
SAID = []


def take_message(*message):
    """One logger for all runs: FMPy keeps a reference to the last one, so it must not be collected."""
    SAID.append(message)


@pytest.fixture(scope="module")
def finger(examples):
    return load_scenario(examples / "finger.toml")


@pytest.fixture(scope="module")
def unit(finger, tmp_path_factory):
    """Path of a unit, made once."""
    if shutil.which("cc") is None:
        pytest.skip("cc is not installed")
    folder, made = tmp_path_factory.mktemp("fmu"), {}

    def path(kind, fmi):
        target = folder / f"{kind}{fmi}.fmu"
        if (kind, fmi) not in made:
            made[kind, fmi] = build_fmu(finger, kind, fmi)
            target.write_bytes(made[kind, fmi].content)
        return target

    return path


def play(path, finger, kind, step=1):
    """Recorded input and output of a unit over the scenario's reference, or its force."""
    tension = sample_reference(finger).tension_N[: ROWS + 1]
    given = tension
    if kind in (Kind.PLANT, Kind.OBSERVER):
        given = invert(Chain.of(finger.transmission, finger.run.level), tension, finger.run.step_s).force_N
    name, answer = NAMES[kind]
    signal = np.array(list(zip(np.arange(ROWS + 1) * 1e-3, given, strict=True)), dtype=[("time", float), (name, float)])
    out = fmpy.simulate_fmu(
        str(path),
        stop_time=ROWS * 1e-3,
        step_size=step * 1e-3,
        output_interval=step * 1e-3,
        input=signal,
        output=[name, answer],
        fmi_type="CoSimulation",
    )
    return out[name], out[answer]


@pytest.mark.each_value
@pytest.mark.parametrize("fmi", FmiVersion)
@pytest.mark.parametrize("kind", NAMES)
def test_a_unit_is_valid_and_equals_the_python_model(unit, finger, kind, fmi, record_property):
    """FMPy records the input a row late: row k + 1 holds what step k used."""
    from fmpy.validation import validate_fmu

    path = unit(kind, fmi)
    assert validate_fmu(str(path)) == []
    given, answer = play(path, finger, kind)
    chain, used = Chain.of(finger.transmission, finger.run.level), given[1:]
    if kind is Kind.INVERSE:
        expected = invert(chain, used, finger.run.step_s).force_N
    elif kind is Kind.OBSERVER:
        expected = simulate(chain.led_by_tension(), used, finger.run.step_s).output_tension_N
    elif kind is not Kind.PLANT:
        problem = Problem.of(finger)
        table = table_of(problem).table if kind is Kind.TABLE else None
        expected = answers(problem, table, used, Precision.DOUBLE, problem.chain).columns[kind]
    else:
        expected = simulate(chain, used, finger.run.step_s).output_tension_N
    error = float(np.abs(answer[1:] - expected).max())
    record_property("figure", f"FMU {kind}, FMI {fmi}, against Python over {ROWS} steps: {error:.2g} N")
    assert np.ptp(answer) > 5
    assert error <= 1e-9


def test_a_unit_knows_the_time_from_its_start(unit, tmp_path):
    from fmpy import extract, read_model_description
    from fmpy.fmi2 import FMU2Slave

    path = unit(Kind.INVERSE, FmiVersion.V2)
    described = read_model_description(str(path))
    slave = FMU2Slave(
        guid=described.guid,
        unzipDirectory=extract(str(path), str(tmp_path)),
        modelIdentifier=described.coSimulation.modelIdentifier,
    )
    slave.instantiate()
    slave.setupExperiment(startTime=2.0)
    slave.enterInitializationMode()
    slave.exitInitializationMode()
    assert slave.getReal([0]) == [2.0]
    for k in range(3):
        slave.doStep(currentCommunicationPoint=2.0 + 0.002 * k, communicationStepSize=0.002)
    assert slave.getReal([0]) == pytest.approx([2.006])
    slave.terminate()
    slave.freeInstance()


@pytest.mark.parametrize("fmi", FmiVersion)
def test_a_state_survives_as_bytes_and_says_what_it_accepts(unit, fmi, tmp_path):
    from fmpy import extract, read_model_description
    from fmpy.fmi2 import FMU2Slave
    from fmpy.fmi3 import FMU3Slave

    path = unit(Kind.INVERSE, fmi)
    described = read_model_description(str(path))
    second = fmi is FmiVersion.V2
    slave = (FMU2Slave if second else FMU3Slave)(
        guid=described.guid if second else described.instantiationToken,
        unzipDirectory=extract(str(path), str(tmp_path)),
        modelIdentifier=described.coSimulation.modelIdentifier,
    )
    slave.instantiate()
    if second:
        slave.setupExperiment()
    slave.enterInitializationMode()
    slave.exitInitializationMode()
    read, put = (slave.getReal, slave.setReal) if second else (slave.getFloat64, slave.setFloat64)

    def forces(first):
        found = []
        for k in range(first, first + 40):
            put([1], [30 + 0.1 * k])
            slave.doStep(currentCommunicationPoint=k * 1e-3, communicationStepSize=1e-3)
            found.append(read([4])[0])
        return found

    forces(0)
    state = slave.getFMUState()
    kept = slave.serializeFMUState(state)
    expected = forces(40)
    slave.setFMUState(slave.deserializeFMUState(kept))
    assert forces(40) == expected
    for at in (0, 17, len(kept) // 2, len(kept) - 1):
        damaged = bytearray(kept)
        damaged[at] ^= 4
        with pytest.raises(Exception, match=r"(?i)deserialize"):
            slave.deserializeFMUState(bytes(damaged))
    slave.terminate()
    slave.freeInstance()
    ranges = {v.name: (v.min, v.max) for v in described.modelVariables}
    for name in ("reference", "initial_tension", "mu"):
        low, high = map(float, ranges[name])
        assert 0 <= low < high


def test_communication_steps_of_several_samples_are_taken_sample_by_sample(unit, finger):
    coarse = play(unit(Kind.INVERSE, FmiVersion.V2), finger, Kind.INVERSE, step=4)
    assert len(coarse[1]) == ROWS // 4 + 1
    assert np.all(np.isfinite(coarse[1]))


def test_a_step_that_is_no_whole_number_of_samples_is_refused(unit, finger):
    from fmpy.fmi1 import FMICallException

    with pytest.raises(FMICallException):
        fmpy.simulate_fmu(
            str(unit(Kind.PLANT, FmiVersion.V3)), stop_time=0.01, step_size=0.0015, output_interval=0.0015
        )


def test_only_what_a_unit_needs_is_computed(finger, monkeypatch):
    def never(*_):
        raise AssertionError("no table is needed")

    monkeypatch.setattr(fmu, "table_of", never)
    with zipfile.ZipFile(io.BytesIO(build_fmu(finger, Kind.INVERSE).content)) as archive:
        names = {name for name in archive.namelist() if name.startswith("sources/tff_") and name.endswith(".c")}
    assert names == {f"sources/tff_{name}.c" for name in ("parameters", "limits", "state", "inverse")}


@pytest.mark.parametrize(
    ("fmi", "libraries"),
    [
        (FmiVersion.V2, {"win64/tff_table.dll", "darwin64/tff_table.dylib"}),
        (
            FmiVersion.V3,
            {"x86_64-windows/tff_table.dll", "x86_64-darwin/tff_table.dylib", "aarch64-darwin/tff_table.dylib"},
        ),
    ],
)
def test_a_unit_for_everywhere_has_a_binary_compiled_for_each_system(finger, stand_in_ziglang, fmi, libraries):
    with zipfile.ZipFile(io.BytesIO(build_fmu(finger, Kind.TABLE, fmi, everywhere=True).content)) as archive:
        binaries = {name: archive.read(name) for name in archive.namelist() if name.startswith("binaries/")}
    assert {f"binaries/{name}" for name in libraries} < set(binaries)
    assert all(f"fmi{fmi[0]}DoStep".encode() in binary for binary in binaries.values())
    targets = [line.split()[2] for line in stand_in_ziglang.read_text().splitlines()]
    assert targets == ["x86_64-windows-gnu", "x86_64-macos", "aarch64-macos"][: len(libraries)]


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("system", "library", "start", "name"),
    [
        # The C library of Windows is built first, which takes two minutes.
        ("x86_64-windows", "tff_table.dll", b"MZ", b"\0fmi3DoStep\0"),
        ("x86_64-darwin", "tff_table.dylib", b"\xcf\xfa\xed\xfe\x07\x00\x00\x01", b"_fmi3DoStep\0"),
        ("aarch64-darwin", "tff_table.dylib", b"\xcf\xfa\xed\xfe\x0c\x00\x00\x01", b"_fmi3DoStep\0"),
    ],
)
def test_a_binary_for_another_system_is_built_and_exports_the_interface(
    finger, monkeypatch, system, library, start, name
):
    """Looked into, not run: a Windows library with the functions in its table of exports, Mach-O of the right chip."""
    if not has_cross_compiler():
        pytest.skip("ziglang is not installed")
    monkeypatch.setattr(packing, "_ELSEWHERE", [each for each in packing._ELSEWHERE if each[-1] == system])
    with zipfile.ZipFile(io.BytesIO(build_fmu(finger, Kind.TABLE, FmiVersion.V3, everywhere=True).content)) as archive:
        binary = archive.read(f"binaries/{system}/{library}")
    assert binary.startswith(start)
    assert name in binary


@pytest.mark.parametrize("fmi", FmiVersion)
def test_the_sources_in_a_unit_rebuild_it_bit_for_bit(unit, finger, fmi, tmp_path):
    path = unit(Kind.INVERSE, fmi)
    with zipfile.ZipFile(path) as archive:
        archive.extractall(tmp_path)
        names = archive.namelist()
    sources = tmp_path / "sources"
    shared = next(tmp_path.glob("binaries/*/*.so"))
    shared.unlink()
    flags = (
        "-std=c99",
        "-O2",
        "-shared",
        "-fPIC",
        "-ffp-contract=off",
        "-fno-math-errno",
        "-Wall",
        "-Wextra",
        "-Werror",
    )
    files = sorted(sources.glob("*.c"))
    subprocess.run(["cc", *flags, "-Wno-unused-parameter", "-o", shared, *files, "-lm"], check=True, cwd=sources)
    again = tmp_path / "again.fmu"
    with zipfile.ZipFile(again, "w") as archive:
        for name in names:
            archive.write(tmp_path / name, name)
    for one, two in zip(play(path, finger, Kind.INVERSE), play(again, finger, Kind.INVERSE), strict=True):
        assert np.array_equal(one, two)


def test_equal_scenarios_give_equal_units(finger, unit):
    content = unit(Kind.INVERSE, FmiVersion.V3).read_bytes()
    assert build_fmu(finger, Kind.INVERSE, FmiVersion.V3).content == content


def test_the_command_writes_a_unit_per_version(output):
    folder = output("export-fmu", "finger", "--kind", "plant").folder
    assert {p.name for p in folder.iterdir()} == {"tff_plant_fmi2.fmu", "tff_plant_fmi3.fmu"}


def test_a_unit_that_is_worse_than_none_is_refused_unless_forced(finger, tmp_path, capsys):
    """Moves within the transition of a reversal, where the capstan law jumps from branch to branch."""
    moves = WaypointReference(
        times_s=(0.0, 0.1, 0.2, 0.3, 0.4), tensions_N=(30.0, 31.0, 30.0, 31.0, 30.0), shape=Shape.SMOOTH
    )
    (tmp_path / "small.toml").write_text(scenario_to_toml(replace(finger, reference=moves)), encoding="utf-8")
    export = ["export-fmu", str(tmp_path / "small.toml"), "--fmi", "2.0", "--out", str(tmp_path / "units"), "--kind"]
    assert run([*export, Kind.CAPSTAN]) == 1
    assert "nothing to export: capstan: RMS error" in capsys.readouterr().err
    assert not (tmp_path / "units").exists()
    assert run([*export, Kind.CAPSTAN, "--force-export"]) == 0
    assert "worse than the reference applied directly" in capsys.readouterr().err
    assert run([*export, Kind.PLANT]) == 0
    assert len(list((tmp_path / "units").iterdir())) == 2


def test_a_kind_that_the_path_does_not_have_is_refused(examples):
    with pytest.raises(InputError, match="no table serves this drive and path"):
        build_fmu(load_scenario(examples / "finger_moving.toml"), Kind.TABLE)


@pytest.mark.parametrize("fmi", FmiVersion)
@pytest.mark.parametrize("kind", [Kind.INVERSE, Kind.PLANT])
def test_bad_start_values_and_bad_inputs_are_refused_and_logged(unit, fmi, kind):
    """An initial tension beyond the range or not a number is an error, an input that is not a number a warning."""
    from fmpy.fmi1 import FMICallException

    bad = [1e9, np.nan] if kind is Kind.PLANT else [1e4, np.nan]
    for start in bad:
        with pytest.raises(FMICallException):
            fmpy.simulate_fmu(
                str(unit(kind, fmi)),
                stop_time=0.01,
                step_size=0.001,
                start_values={"initial_tension": start},
                logger=take_message,
            )
    name, answer = NAMES[kind]
    lost = np.array(
        [(0.0, 30.0), (0.004, 30.0), (0.005, np.nan), (0.02, np.nan)], dtype=[("time", float), (name, float)]
    )
    SAID.clear()
    result = fmpy.simulate_fmu(
        str(unit(kind, fmi)),
        stop_time=0.02,
        step_size=0.001,
        output_interval=0.001,
        input=lost,
        output=[answer],
        logger=take_message,
    )
    assert np.all(np.isfinite(result[answer]))
    assert any("held" in str(part) for message in SAID for part in message)


@pytest.mark.parametrize("wrong", [np.nan, -0.1, 2.5])
def test_a_coefficient_that_means_nothing_is_refused_and_the_old_one_read_back(unit, wrong, tmp_path):
    from fmpy import extract, read_model_description
    from fmpy.fmi2 import FMU2Slave, fmi2CallbackFunctions, fmi2OK, fmi2Warning

    path = unit(Kind.INVERSE, FmiVersion.V2)
    described = read_model_description(str(path))
    at = {variable.name: [variable.valueReference] for variable in described.modelVariables}
    slave = FMU2Slave(
        guid=described.guid,
        unzipDirectory=extract(str(path), str(tmp_path)),
        modelIdentifier=described.coSimulation.modelIdentifier,
    )
    slave.instantiate(callbacks=fmi2CallbackFunctions())  # no logger
    slave.setupExperiment(startTime=0.0)
    slave.enterInitializationMode()
    slave.exitInitializationMode()
    answers = []
    for mu in (0.25, wrong):
        slave.setReal(at["mu"], [mu])
        slave.setReal(at["reference"], [31.0])
        answers.append(slave.fmi2DoStep(slave.component, 0.0, 0.001, 0))
    assert answers == [fmi2OK, fmi2Warning]
    assert slave.getReal(at["mu"]) == [0.25]
    assert slave.getInteger(at["status"]) == [1]
    slave.freeInstance()


@pytest.mark.parametrize("fmi", FmiVersion)
def test_two_units_can_be_linked_into_one_program(unit, fmi, tmp_path):
    objects = []
    for kind in (Kind.INVERSE, Kind.PLANT):
        folder = tmp_path / kind
        with zipfile.ZipFile(unit(kind, fmi)) as archive:
            archive.extractall(folder)
        for source in sorted((folder / "sources").glob("fmi*.c")):
            target = tmp_path / f"{kind}_{source.stem}.o"
            flags = ("-std=c99", "-O1", "-DTENDONFF_STATIC", "-Wno-unused-parameter")
            subprocess.run(["cc", *flags, "-c", source, "-o", target], check=True, cwd=folder / "sources")
            objects.append(target)
    symbols = [
        {line.split()[2] for line in run_nm(target).splitlines() if len(line.split()) == 3 and line.split()[1] == "T"}
        for target in objects
    ]
    assert all(symbols)
    assert not symbols[0] & symbols[1]


def run_nm(file):
    if shutil.which("nm") is None:
        pytest.skip("nm is not installed")
    return subprocess.run(["nm", file], capture_output=True, text=True, check=True).stdout


@pytest.mark.parametrize("kind", [Kind.INVERSE, Kind.PLANT])
def test_a_unit_takes_the_joint_angles_of_a_moving_path(examples, kind, tmp_path, record_property):
    from fmpy.validation import validate_fmu

    finger = load_scenario(examples / "finger_moving.toml")
    problem, fmi = Problem.of(finger), FmiVersion.V2 if kind is Kind.INVERSE else FmiVersion.V3
    build_fmu(finger, kind, fmi).write(tmp_path)
    (path,) = tmp_path.glob("*.fmu")
    assert validate_fmu(str(path)) == []
    step, time = finger.run.step_s, problem.reference.time_s[: ROWS + 1]
    angles = problem.chain.motion.at(time)
    given = problem.reference.tension_N[: ROWS + 1]
    name, answer = NAMES[kind]
    joints = [f"joint_{joint}" for joint in finger.joints]
    rows = list(zip(time, given, *angles.T, strict=True))
    signal = np.array(rows, dtype=[(column, float) for column in ("time", name, *joints)])
    out = fmpy.simulate_fmu(
        str(path),
        stop_time=ROWS * step,
        step_size=step,
        output_interval=step,
        input=signal,
        output=[name, answer, *joints],
    )
    used = np.column_stack([out[joint] for joint in joints])[1:]
    motion = replace(problem.chain.motion, time_s=step * np.arange(ROWS), angle_rad=used)
    chain, start = replace(problem.chain, motion=motion), float(given[0])
    if kind is Kind.INVERSE:
        force = invert(chain, out[name][1:], step, initial_tension_N=start).force_N
        expected = problem.limits.apply(force, step, start)
    else:
        expected = simulate(chain, out[name][1:], step, initial_tension_N=start).output_tension_N
    error = float(np.abs(out[answer][1:] - expected).max())
    record_property("figure", f"FMU {kind} with joints, FMI {fmi}, against Python: {error:.2g} N")
    assert np.ptp(used) > 0.5
    assert error <= 1e-9
