import math
import re
import tomllib
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from random_examples import tried_on

import tendonff as tf
from tendonff.compensator.files.reading import InputError
from tendonff.compensator.files.writing import write_text
from tendonff.compensator.scenario.doubts import largest_tension, scenario_doubts, scenario_notes
from tendonff.compensator.scenario.reference import CsvReference, SineReference
from tendonff.compensator.scenario.scenario import Scenario, parse_scenario, scenario_hash, scenario_to_toml
from tendonff.compensator.scenario.settings import Run
from tendonff.compensator.scenario.tables import descriptions
from tendonff.compensator.scenarios import load_scenario, parse_any
from tendonff.models.fidelity import Level
from tendonff.models.parameters import Friction
from tendonff.models.parameters.uncertainty import Objective, Uncertainty
from tendonff.ocp.tracking.limits import ForceLimits

ROOT = Path(__file__).resolve().parents[3]
EXAMPLES = sorted(path for path in (ROOT / "examples").glob("*.toml") if isinstance(load_scenario(path), Scenario))
TEXT = (ROOT / "examples" / "finger.toml").read_text(encoding="utf-8")
FILE = Path("finger.toml")


def parse(text: str) -> Scenario:
    return parse_scenario(text, FILE)


def line(key: str, text: str = TEXT) -> str:
    """The first line that sets a key, with its end."""
    found = re.search(rf"^{key} = .*\n", text, flags=re.MULTILINE)
    assert found
    return found.group()


def test_there_are_examples_of_every_kind_of_reference() -> None:
    assert len(EXAMPLES) >= 4
    assert len({type(load_scenario(path).reference) for path in EXAMPLES}) == 3


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_an_example_that_is_written_reads_back_as_the_same_scenario(path: Path) -> None:
    scenario = load_scenario(path)
    again = parse_scenario(scenario_to_toml(scenario), path)
    assert again == scenario
    assert scenario_hash(again) == scenario_hash(scenario)


def test_every_value_ends_up_under_its_own_name() -> None:
    scenario, raw = parse(TEXT), tomllib.loads(TEXT)
    for table in ("path", "tendon", "friction", "actuator", "load"):
        for key, value in raw[table].items():
            assert getattr(getattr(scenario.transmission, table), key) == value
    assert scenario.name == raw["name"]
    assert scenario.run == Run(step_s=raw["run"]["step_s"], level=Level(raw["run"]["level"]))
    assert isinstance(scenario.reference, SineReference)
    assert scenario.reference.frequencies_Hz == tuple(raw["reference"]["frequencies_Hz"])


def test_whole_numbers_are_accepted_where_numbers_are_wanted() -> None:
    whole, real = (parse(TEXT.replace(line("force_max_N"), f"force_max_N = {value}\n")) for value in ("210", "210.0"))
    assert whole == real


def test_optional_tables_and_keys_default_to_nothing_special() -> None:
    scenario = parse(TEXT)
    assert scenario.robust == Uncertainty()
    assert scenario.robust.is_certain
    assert scenario.transmission.friction.release_dynamic == scenario.transmission.friction.mu_dynamic
    robust = parse(f'{TEXT}\n[robust]\nmu = 0.2\nobjective = "mean"\n').robust
    assert robust == Uncertainty(mu=0.2, objective=Objective.MEAN)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (line("mu_dynamic"), "mu_dynamc = 0.2\n", '[friction]: unknown key "mu_dynamc", did you mean "mu_dynamic"?'),
        (line("mass_kg"), "mass = 1.0\n", '[tendon]: unknown key "mass", did you mean "mass_kg"?'),
        (
            line("mu_dynamic"),
            "mu_dynamic = -0.1\n",
            "[friction]: mu_dynamic must be a finite number >= 0, got -0.1; use",
        ),
        (line("mu_dynamic"), "mu_dynamic = nan\n", "[friction]: mu_dynamic must be a finite number >= 0, got nan; use"),
        (
            line("mu_static"),
            "mu_static = 0.1\n",
            "[friction]: mu_dynamic = 0.2 is above mu_static = 0.1: change both, or delete mu_static for no Stribeck",
        ),
        (line("mu_dynamic"), "", '[friction]: key "mu_dynamic" is missing (Coefficients when pulling'),
        (line("mu_dynamic"), 'mu_dynamic = "0.2"\n', '[friction]: mu_dynamic must be a number, got "0.2" (text)'),
        (line("mu_dynamic"), "mu_dynamic = true\n", "[friction]: mu_dynamic must be a number, got true (true/false)"),
        (line("mu_dynamic"), "mu_dynamic = 2026-01-01\n", "[friction]: mu_dynamic must be a number, got 2026-01-01"),
        (line("segments"), "segments = 6.0\n", "[path]: segments must be a whole number, got 6.0"),
        (line("segments"), "segments = 0\n", "[path]: segments must be a whole number from 1 to"),
        (
            line("kind"),
            'kind = "sin"\n',
            '[reference]: kind must be one of "sine", "waypoints", "csv", got "sin" (text)',
        ),
        (line("kind"), "", '[reference]: key "kind" is missing; it is one of "sine", "waypoints", "csv"'),
        (line("amplitudes_N"), "amplitudes_N = [1, true]\n", "[reference]: amplitudes_N[1] must be a number, got true"),
        (
            line("amplitudes_N"),
            "amplitudes_N = 12\n",
            "[reference]: amplitudes_N must be a list, each a number, got 12",
        ),
        (line("amplitudes_N"), "amplitudes_N = [1.0]\n", "[reference]: amplitudes_N must be as many as frequencies_Hz"),
        (
            line("frequencies_Hz"),
            "frequencies_Hz = [1.0, 0.0]\n",
            "[reference]: frequencies_Hz[1] must be a finite num",
        ),
        (
            line("initial_tension_N"),
            "initial_tension_N = -1\n",
            "[reference]: initial_tension_N must be a finite number >= 0",
        ),
        (line("step_s"), "step_s = 0\n", "[run]: step_s must be a finite number > 0, got 0"),
        (
            line("level"),
            'level = "soft"\n',
            '[run]: level must be "elastic" or "viscoelastic" or "presliding", got "soft"',
        ),
        (line("schema"), "schema = \n", ": not valid TOML: Invalid value (at line 4, column 10)"),
        (line("name"), "name = 3\n", ': name must be text in quotes ("..."), got 3'),
        (line("schema"), "", ': key "schema" is missing; write schema = 1 in the first line'),
        (line("schema"), "schema = 2\n", ": schema must be 1, got 2; this version reads no other"),
        (line("schema"), 'schema = 1\nnme = ""\n', ': unknown key "nme", did you mean "name"?'),
        ("[friction]", "[frction]", ": unknown table [frction], did you mean friction?"),
        ("[friction]", "[friction.coulomb]", '[friction]: unknown key "coulomb"; known: mu_dynamic, mu_static'),
        ("[load]", "[run]\n[load]", ": not valid TOML: Cannot declare ('run',) twice (at line"),
        (
            "[load]",
            "[load]\nmass_kg = 1.0",
            ": not valid TOML: Cannot overwrite a value (at line 36, column 15); mass_kg stands here a second time",
        ),
        ("[run]", "[robust]\nmu = 1.5\n[run]", "[robust]: mu must be a finite number >= 0 and < 1, got 1.5; 0.2 means"),
        ("[run]", "[robust]\nmue = 0.5\n[run]", '[robust]: unknown key "mue", did you mean "mu"?'),
    ],
)
def test_a_bad_scenario_is_refused_with_table_key_and_value(old: str, new: str, message: str) -> None:
    assert old in TEXT
    with pytest.raises(InputError) as caught:
        parse(TEXT.replace(old, new, 1))
    assert str(caught.value).startswith(f"finger.toml{' ' if message.startswith('[') else ''}{message}")


def test_every_missing_key_of_the_file_is_named_in_one_message() -> None:
    text = TEXT
    for key in ("mu_dynamic", "segments", "stiffness_N_per_m", "duration_s"):
        text = text.replace(line(key), "")
    with pytest.raises(InputError) as caught:
        parse(text)
    assert str(caught.value) == (
        "finger.toml: missing: [path] segments; [tendon] stiffness_N_per_m; [friction] mu_dynamic; "
        "[reference] duration_s; elastic_modulus_Pa, length_m and diameter_m may stand for stiffness_N_per_m; "
        '"tendonff new" writes a file that explains every key'
    )


def test_a_file_without_tables_is_told_all_that_belongs_into_them() -> None:
    with pytest.raises(InputError) as caught:
        parse("schema = 1")
    for table in ("path", "tendon", "friction", "actuator", "load", "reference", "run"):
        assert f"[{table}]" in str(caught.value)
    assert "radius_m" not in str(caught.value)


MODULUS = "elastic_modulus_Pa = 110e9\nlength_m = 0.8\ndiameter_m = 1e-3\n"


def test_modulus_section_length_and_density_stand_for_stiffness_and_mass() -> None:
    """EA/L and rho A L with A = pi d^2/4."""
    text = TEXT.replace(line("stiffness_N_per_m"), MODULUS).replace(line("mass_kg"), "density_kg_per_m3 = 970\n", 1)
    tendon = parse(text).transmission.tendon
    assert tendon.stiffness_N_per_m == pytest.approx(110e9 * math.pi * 0.25e-6 / 0.8)
    assert tendon.mass_kg == pytest.approx(970 * math.pi * 0.25e-6 * 0.8)
    section = text.replace("diameter_m = 1e-3", f"cross_section_m2 = {math.pi * 0.25e-6!r}")
    assert parse(section).transmission.tendon == tendon
    with pytest.raises(InputError, match=r"\[tendon\]: elastic_modulus_Pa needs cross_section_m2 or diameter_m, one"):
        parse(text.replace("diameter_m = 1e-3\n", ""))
    with pytest.raises(InputError, match=r"\[tendon\]: unknown key \"diametr_m\", did you mean \"diameter_m\""):
        parse(text.replace("diameter_m", "diametr_m"))


@pytest.mark.parametrize(
    ("mu", "message"),
    [
        ("0.3", "mu_dynamic = 0.3 is above mu_static = 0.2: change both, or delete mu_static"),
        ("-0.2", "mu_dynamic must be a finite number >= 0, got -0.2"),
        ('"0.2"', 'mu_dynamic must be a number, got "0.2" (text)'),
    ],
)
@pytest.mark.parametrize("stated", [True, False])
def test_the_first_edit_of_a_file_is_answered_by_the_coefficient_itself(mu: str, message: str, stated: bool) -> None:
    """Without a Stribeck velocity, as the templates are; none is asked for."""
    text = TEXT.replace(line("stribeck_velocity_m_per_s"), "").replace(line("mu_dynamic"), f"mu_dynamic = {mu}\n")
    text = text if stated else text.replace(line("mu_static"), "")
    if not stated and "above" in message:
        assert parse(text).transmission.friction.mu_static == float(mu)
        return
    with pytest.raises(InputError, match=re.escape(f"[friction]: {message}")):
        parse(text)


@pytest.mark.parametrize(
    "path", sorted((ROOT / "compensator" / "scenario").rglob("*.toml")), ids=lambda path: path.stem
)
def test_a_template_leaves_mu_static_out(path: Path) -> None:
    assert not re.search(r"^mu_static = ", path.read_text(encoding="utf-8"), flags=re.MULTILINE)


def test_a_key_without_effect_may_be_left_out() -> None:
    assert line("mu_static").split()[2] == line("mu_dynamic").split()[2]
    bare = TEXT
    for key in ("stribeck_velocity_m_per_s", "radius_m"):
        bare = bare.replace(line(key), "")
    assert parse(bare).transmission.path.radius_m is None
    with pytest.raises(InputError, match='key "stribeck_velocity_m_per_s" is missing'):
        parse(bare.replace(line("mu_static"), "mu_static = 0.9\n"))
    assert parse(bare.replace(line("mu_static"), "")) == parse(bare)
    still = TEXT.replace(line("relaxation_time_s"), "")
    with pytest.raises(InputError, match='key "relaxation_time_s" is missing'):
        parse(still)
    parse(still.replace(line("relaxing_stiffness_N_per_m"), "relaxing_stiffness_N_per_m = 0.0\n"))


MOTOR = """
[actuator.motor]
drum_radius_m = 0.02
gear_ratio = 25.0
inertia_kg_m2 = 2e-6
torque_max_N_m = 0.2
speed_max_rad_per_s = 900.0
"""


def with_motor(motor: str, *, beside: tuple[str, ...] = ()) -> str:
    """The scenario with a motor instead of what follows from it, but for keys `beside`."""
    head, actuator, tail = re.split(r"(?s)(\[actuator\]\n.*?\n)(?=\n\[load\])", TEXT)
    for key in {"mass_kg", "force_max_N"} - set(beside):
        actuator = actuator.replace(line(key, actuator), "")
    return f"{head}{actuator}{motor}{tail}"


@pytest.mark.parametrize("key", ["mass_kg", "force_max_N", "speed_max_m_per_s"])
def test_a_motor_beside_what_follows_from_it_is_refused_with_both_names(key: str) -> None:
    text = with_motor(MOTOR, beside=(key,))
    if key == "speed_max_m_per_s":
        text = text.replace("\n[actuator.motor]", "speed_max_m_per_s = 0.3\n\n[actuator.motor]")
    with pytest.raises(
        InputError, match=rf"\[actuator\]: two sources for one quantity: {key} = .*, and .* from \[actuator.motor\];"
    ):
        parse(text)


@pytest.mark.parametrize(
    ("instead", "key", "named"),
    [
        ("damping_N_s_per_m", "stiffness_N_per_m", "elastic_modulus_Pa, length_m and diameter_m"),
        ("stiffness_N_per_m", "mass_kg", "density_kg_per_m3, length_m and diameter_m"),
    ],
)
def test_a_data_sheet_beside_what_follows_from_it_is_refused_with_both_names(
    instead: str, key: str, named: str
) -> None:
    rope = MODULUS if key == "stiffness_N_per_m" else f"{MODULUS}density_kg_per_m3 = 970\n"
    text = TEXT.replace(line(instead), f"{rope}{line(instead) if key == 'stiffness_N_per_m' else ''}", 1)
    with pytest.raises(InputError, match=rf"\[tendon\]: two sources for one quantity: {key} = .* from {named};"):
        parse(text)


def test_a_motor_stands_for_mass_and_largest_force_of_the_actuator() -> None:
    """J n^2/r^2 = 2e-6 25^2/0.02^2 and torque n/r = 0.2 25/0.02."""
    text = with_motor(MOTOR)
    scenario = parse(text)
    actuator = scenario.transmission.actuator
    assert actuator.mass_kg == pytest.approx(3.125)
    assert actuator.force_max_N == pytest.approx(250.0)
    assert actuator.motor is not None
    assert actuator.motor.speed_max_m_per_s == pytest.approx(0.72)
    again = parse(scenario_to_toml(scenario))
    assert again.transmission == scenario.transmission
    with pytest.raises(
        InputError, match=r'\[actuator.motor\]: unknown key "drum_radius", did you mean "drum_radius_m"'
    ):
        parse(text.replace("drum_radius_m", "drum_radius"))
    with pytest.raises(InputError, match=r"\[actuator.motor\]: gear_efficiency belongs to \[actuator\]"):
        parse(text.replace("gear_ratio", "gear_efficiency = 0.9\ngear_ratio"))
    with pytest.raises(InputError, match=r"\[actuator.motor\]: gear_ratio must be a finite number > 0, got 0"):
        parse(text.replace("gear_ratio = 25.0", "gear_ratio = 0"))


@pytest.mark.parametrize(
    ("motor", "name", "force_N", "asked"),
    [
        (MOTOR, "torque_max_N_m * gear_ratio/drum_radius_m", 250.0, ""),
        (
            f"{MOTOR}stall_torque_N_m = 0.1\nno_load_speed_rad_per_s = 1000.0\n",
            "stall_torque_N_m * gear_ratio/drum_radius_m",
            125.0,
            "[actuator.motor] stall_torque_N_m = 0.1 is below torque_max_N_m = 0.2",
        ),
        (
            MOTOR.replace("0.02", "20"),
            "torque_max_N_m * gear_ratio/drum_radius_m",
            0.25,
            "[actuator.motor] drum_radius_m = 20: millimetres?",
        ),
    ],
)
def test_the_largest_force_is_named_by_the_key_that_limits_it(
    motor: str, name: str, force_N: float, asked: str
) -> None:
    """With a force_max_N added, as the message once advised, the motor's torque would no longer count."""
    text = with_motor(motor)
    scenario = parse(text)
    transmission = scenario.transmission
    actuator = replace(transmission.actuator, coulomb_N=1.0)
    assert (actuator.largest_force_name, actuator.largest_force_N) == (name, pytest.approx(force_N))
    assert ForceLimits.of(actuator).maximum_name == name
    assert asked in "; ".join([*map(str, scenario_doubts(scenario)), *scenario_notes(transmission)])
    assert largest_tension(replace(transmission, actuator=actuator)) >= 0
    assert parse(TEXT).transmission.actuator.largest_force_name == "force_max_N"


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "mass_kg = 0.002",
            "mass_kg = 0,002",
            r"\(at line 13, column \d+\); a decimal point, not a comma: mass_kg = 0\.002",
        ),
        ("mass_kg = 0.002", "mass_kg = 2 g", "a number alone, the key says its unit: mass_kg = 2"),
        ("mass_kg = 0.002", "mass_kg = .002", r"a digit before the point: mass_kg = 0\.002"),
        ('"presliding"', "presliding", 'text stands in quotes: level = "presliding"'),
        ('"presliding"', '"pre-sliding"', 'got "pre-sliding" \\(text\\), did you mean "presliding"\\?'),
        ('"presliding"', '"nonsense"', r'got "nonsense" \(text\)$'),
    ],
)
def test_usual_slips_are_answered_with_what_to_write(old: str, new: str, message: str) -> None:
    assert old in TEXT
    with pytest.raises(InputError, match=message):
        parse(TEXT.replace(old, new, 1))


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ("times_s = [0, 1]\ntensions_N = [1]", "times_s must be as many as tensions_N"),
        ("times_s = [0, 1, 1]\ntensions_N = [1, 2, 3]", "times_s must increase, got 1.0 after 1.0"),
        ("times_s = [0.5, 1]\ntensions_N = [1, 2]", "times_s must start at 0, got 0.5"),
        (
            "times_s = [0, 1]\ntensions_N = [1, -1]",
            r"tensions_N\[1\] must be a finite number >= 0, got -1.0; a tendon cannot",
        ),
    ],
)
def test_bad_waypoints_are_refused(keys: str, message: str) -> None:
    text = re.sub(
        r"(?s)\[reference\].*?\[run\]", f'[reference]\nkind = "waypoints"\nshape = "linear"\n{keys}\n[run]', TEXT
    )
    with pytest.raises(InputError, match=message):
        parse(text)


def test_every_key_of_the_friction_is_described_by_its_class() -> None:
    assert set(descriptions(Friction)) == set(Friction.__dataclass_fields__)


def test_a_scenario_written_elsewhere_still_finds_its_reference_file(tmp_path: Path, examples: Path) -> None:
    scenario = load_scenario(examples / "surgical.toml")
    write_text(tmp_path / "fit" / "fitted.toml", scenario_to_toml(scenario, folder=tmp_path / "fit"))
    again = load_scenario(tmp_path / "fit" / "fitted.toml")
    assert isinstance(scenario.reference, CsvReference)
    assert again.reference_file().resolve() == scenario.reference_file().resolve()


def test_the_hash_sees_values_and_reference_samples_but_not_comments(tmp_path: Path) -> None:
    scenario = parse(TEXT)
    assert scenario_hash(parse(TEXT.replace("# tau", "# time"))) == scenario_hash(scenario)
    assert scenario_hash(replace(scenario, robust=Uncertainty(seed=1))) != scenario_hash(scenario)
    csv = replace(scenario, source=tmp_path / "x.toml", reference=CsvReference(file="w.csv"))
    write_text(tmp_path / "w.csv", "time_s,tension_N\n0,1\n1,2\n")
    before = scenario_hash(csv)
    write_text(tmp_path / "w.csv", "time_s,tension_N\n0,1\n1,3\n")
    assert scenario_hash(csv) != before


def test_a_named_file_that_is_missing_is_refused_with_who_names_it(tmp_path: Path, examples: Path) -> None:
    for name, text in (
        ("of.toml", 'schema = 1\nbase = "nothere.toml"\n'),
        ("t.toml", _with_file((examples / "finger.toml").read_text("utf-8"))),
        ("j.toml", _with_file((examples / "hand_joint.toml").read_text("utf-8"))),
    ):
        (tmp_path / name).write_text(text, "utf-8")
        with pytest.raises(InputError, match=r"(of\.toml: base|\[reference\]: file) names nothere.*not in /"):
            tf.design(load_scenario(tmp_path / name))


def _with_file(text: str) -> str:
    head, _, rest = text.partition("[reference]")
    quantity = 'quantity = "joint_angle"\n' if "[drive]" in text else ""
    return f'{head}[reference]\n{quantity}kind = "csv"\nfile = "nothere.csv"\n[{rest.partition(chr(10) + "[")[2]}'


def test_a_sensor_of_another_kind_of_scenario_is_refused_on_reading(examples: Path) -> None:
    for name, sensor, other in (
        ("finger", "joint_angle", "output_tension"),
        ("hand_joint", "output_tension", "joint_angle"),
    ):
        text = (examples / f"{name}.toml").read_text("utf-8").partition("[feedback]")[0]
        with pytest.raises(InputError, match=f'sensor = "{other}", got "{sensor}"'):
            parse_any(f'{text}\n[feedback]\nsensor = "{sensor}"\n', examples / f"{name}.toml")


def test_what_is_no_readable_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such file"):
        load_scenario(tmp_path / "absent.toml")
    with pytest.raises(InputError, match="is a folder"):
        load_scenario(tmp_path)
    (tmp_path / "x.toml").write_bytes(b"\x80\x81")
    with pytest.raises(InputError, match="not UTF-8"):
        load_scenario(tmp_path / "x.toml")


VALUES = st.sampled_from(
    [
        "nan",
        "inf",
        "-1",
        "0",
        "1e400",
        "9" * 400,
        "9" * 5000,
        '""',
        '"x"',
        "[]",
        "[[]]",
        "{}",
        "true",
        "1979-05-27",
        "=",
        "",
    ]
)


@tried_on(150)
@given(key=st.sampled_from(re.findall(r"^\w+(?= = )", TEXT, flags=re.MULTILINE)), value=VALUES, data=st.data())
def test_any_value_of_any_key_gives_a_scenario_or_one_message(key: str, value: str, data: st.DataObject) -> None:
    places = [found.span() for found in re.finditer(rf"^{key} = .*$", TEXT, flags=re.MULTILINE)]
    start, end = data.draw(st.sampled_from(places))
    check(f"{TEXT[:start]}{key} = {value}{TEXT[end:]}")


@tried_on(150)
@given(text=st.text(max_size=40), at=st.integers(0, len(TEXT)), drop=st.integers(0, 40))
def test_any_damage_to_the_text_gives_a_scenario_or_one_message(text: str, at: int, drop: int) -> None:
    check(TEXT[:at] + text + TEXT[at + drop :])


def check(text: str) -> None:
    try:
        scenario = parse(text)
    except InputError as error:
        assert str(error).startswith("finger.toml")
        assert len(str(error).splitlines()) == 1
        assert len(str(error)) < 900
    else:
        assert parse(scenario_to_toml(scenario)) == scenario


def test_nesting_without_end_is_refused() -> None:
    with pytest.raises(InputError, match=r"finger\.toml"):
        parse("a = " + "[" * 100_000)


def test_scenarios_of_a_tension_share_a_base_that_may_have_one_itself(examples, tmp_path):
    """Keys of the nearest file win; a table of another kind is taken whole."""
    (tmp_path / "sheath.toml").write_text((examples / "exosuit.toml").read_text("utf-8"), "utf-8")
    (tmp_path / "left.toml").write_text(
        'schema = 1\nname = "left"\nbase = "sheath.toml"\n[friction]\nmu_dynamic = 0.11\n[actuator.motor]\n'
        "gear_ratio = 9.0\n",
        "utf-8",
    )
    (tmp_path / "worn.toml").write_text('schema = 1\nbase = "left.toml"\n[friction]\nadhesion_N = 2.5\n', "utf-8")
    shared, left, worn = (load_scenario(tmp_path / f"{name}.toml") for name in ("sheath", "left", "worn"))
    friction = worn.transmission.friction
    assert (friction.mu_dynamic, friction.adhesion_N) == (0.11, 2.5)
    assert friction.viscous_N_s_per_m == shared.transmission.friction.viscous_N_s_per_m
    motor = worn.transmission.actuator.motor
    assert (motor.gear_ratio, motor.drum_radius_m) == (9.0, shared.transmission.actuator.motor.drum_radius_m)
    assert [file.name for file in worn.inputs] == ["left.toml", "sheath.toml"]
    assert load_scenario(tmp_path / "left.toml").digest() != worn.digest()
    assert parse_scenario(worn.to_toml(), tmp_path / "whole.toml").transmission == worn.transmission
    (tmp_path / "sheath.toml").write_text('schema = 1\nbase = "worn.toml"\n', "utf-8")
    with pytest.raises(InputError, match=r"leads back to worn\.toml"):
        load_scenario(tmp_path / "worn.toml")
    assert left.name == "left"
