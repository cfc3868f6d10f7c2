"""One record in every format that loggers write is read as the same numbers."""

import sys
import tracemalloc
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from tendonff.compensator.cli import run
from tendonff.compensator.files.formats.registry import READERS
from tendonff.compensator.files.tables import read_table
from tendonff.compensator.files.text import InputError
from tendonff.compensator.identification.identify import identify
from tendonff.compensator.identification.measured.reading import read_measurement
from tendonff.compensator.reporting.page import file_hash
from tendonff.compensator.scenario.measurement import Measurement
from tendonff.compensator.scenarios import load_scenario
from tendonff.ocp.fits.static import StaticParameter, output_from_input

NAMES = ("time_s", "input_tension_N", "output_tension_N", "input_position_m")
ROWS = 400


def record():
    """Numbers with few digits, which text keeps."""
    time = np.arange(ROWS) * 0.004
    force = np.round(40 + 20 * np.sin(3 * time), 3)
    return dict(zip(NAMES, (time, force, np.round(0.8 * force, 3), np.round(1e-3 * force, 6)), strict=True))


def write_csv(path, data):
    np.savetxt(
        path, np.column_stack(list(data.values())), fmt="%.9g", delimiter=",", header=",".join(data), comments=""
    )


def write_german(path, data):
    rows = [";".join(f"{x:.9g}".replace(".", ",") for x in row) for row in zip(*data.values(), strict=True)]
    path.write_bytes("\r\n".join(["Prüfstand Nr. 3", ";".join(data), *rows]).encode("cp1252"))


def write_utf16(path, data):
    write_csv(path, data)
    path.write_text(path.read_text(), encoding="utf-16")


def write_bare(path, data):
    np.savetxt(path, np.column_stack(list(data.values())), fmt="%.9g")


def write_npz(path, data):
    np.savez(path, **data)


def write_h5(path, data):
    h5py = pytest.importorskip("h5py")
    with h5py.File(path, "w") as file:
        for name, values in data.items():
            file[f"run/cells/{name}"] = values
        file["run/comment"] = "loose cable"


def write_matlab73(path, data):
    h5py = pytest.importorskip("h5py")
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, values in data.items():
            file[f"log/{name}"] = values[None, :]
        file["#refs#/a"] = np.zeros(900)
    with path.open("r+b") as raw:
        raw.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM")


def write_mf4(path, data):
    asammdf = pytest.importorskip("asammdf")
    with asammdf.MDF() as file:
        for name in NAMES[1:]:
            file.append(asammdf.Signal(data[name], timestamps=data["time_s"], name=name))
        file.save(path, overwrite=True)


def write_bag(path, data, plugin, topics=("/rig/cells", "/rig/motor"), ballast=0):
    """Cells in a Wrench (x: input, y: output), the position of a motor in a JointState, and a topic nobody wants."""
    pytest.importorskip("rosbags")
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    types = store.types
    stamp, header = types["builtin_interfaces/msg/Time"], types["std_msgs/msg/Header"]
    vector, wrench = types["geometry_msgs/msg/Vector3"], types["geometry_msgs/msg/Wrench"]
    stamped, joints = types["geometry_msgs/msg/WrenchStamped"], types["sensor_msgs/msg/JointState"]
    blob = types["std_msgs/msg/ByteMultiArray"]
    layout = types["std_msgs/msg/MultiArrayLayout"](dim=[], data_offset=0)
    with Writer(path, version=9, storage_plugin=StoragePlugin[plugin]) as bag:
        cells = bag.add_connection(topics[0], stamped.__msgtype__, typestore=store)
        motor = bag.add_connection(topics[1], joints.__msgtype__, typestore=store)
        noise = bag.add_connection("/camera", blob.__msgtype__, typestore=store)
        for time, near, far, position in zip(*data.values(), strict=True):
            ns = 1_700_000_000 * 10**9 + round(time * 1e9)
            head = header(stamp=stamp(sec=ns // 10**9, nanosec=ns % 10**9), frame_id="")
            force = wrench(force=vector(x=near, y=far, z=0.0), torque=vector(x=0.0, y=0.0, z=0.0))
            message = stamped(header=head, wrench=force)
            bag.write(cells, ns, store.serialize_cdr(message, stamped.__msgtype__))
            state = joints(
                header=head,
                name=["thumb", "index"],
                position=np.array([7.0, position]),
                velocity=np.zeros(0),
                effort=np.zeros(0),
            )
            bag.write(motor, ns, store.serialize_cdr(state, joints.__msgtype__))
            if ballast:
                waste = blob(layout=layout, data=np.zeros(ballast, dtype=np.uint8))
                bag.write(noise, ns, store.serialize_cdr(waste, blob.__msgtype__))


BAG = Measurement(
    input_column="/rig/cells.wrench.force.x",
    output_column="/rig/cells.wrench.force.y",
    input_position_column="/rig/motor.position[index]",
)
FORMATS = {
    "german.csv": (write_german, Measurement()),
    "wide.csv": (write_utf16, Measurement()),
    "bare.txt": (write_bare, Measurement(columns=NAMES)),
    "a.npz": (write_npz, Measurement()),
    "a.h5": (write_h5, Measurement()),
    "a.mat": (write_matlab73, Measurement()),
    "a.mf4": (write_mf4, Measurement()),
    "sqlite": (lambda path, data: write_bag(path, data, "SQLITE3"), BAG),
    "mcap": (lambda path, data: write_bag(path, data, "MCAP"), BAG),
}


@pytest.mark.parametrize("name", FORMATS)
def test_a_record_is_read_the_same_from_every_format(name, tmp_path):
    write, how = FORMATS[name]
    write_csv(tmp_path / "plain.csv", record())
    write(tmp_path / name, record())
    plain = read_measurement(tmp_path / "plain.csv", Measurement())
    found = read_measurement(tmp_path / name, how)
    assert len(found.time_s) == ROWS
    for channel in ("time_s", "input_N", "output_N", "input_m"):
        np.testing.assert_allclose(getattr(found, channel), getattr(plain, channel), rtol=1e-12, atol=1e-12)


@pytest.fixture(scope="module")
def rubbed():
    """A record whose output is the play of its input, mu theta 0.5 and 0.4."""
    data = record()
    time = data["time_s"]
    force = np.round(40 + 20 * np.sin(9 * time) + 9 * np.sin(23 * time), 3)
    values = {StaticParameter.PULL: 0.5, StaticParameter.RELEASE: 0.4}
    output = np.round(output_from_input(values, force, 30.0).prediction_N, 4)
    return dict(zip(NAMES, (time, force, output, data["input_position_m"]), strict=True))


def estimates(path, how, examples):
    scenario = load_scenario(examples / "finger.toml")
    found = identify(replace(scenario, measurement=how), [path], static_only=True)
    return [(e.name, e.value, e.interval) for e in found.estimates if e.interval is not None]


@pytest.mark.compiler
@pytest.mark.nightly
def test_a_record_gives_the_same_estimates_from_every_format(rubbed, tmp_path, examples):
    write_csv(tmp_path / "plain.csv", rubbed)
    wanted = estimates(tmp_path / "plain.csv", Measurement(), examples)
    assert {name: value for name, value, _ in wanted}["mu_theta"] == pytest.approx(0.5, abs=0.01)
    for name, (write, how) in FORMATS.items():
        write(tmp_path / name, rubbed)
        for (key, value, interval), found in zip(wanted, estimates(tmp_path / name, how, examples), strict=True):
            assert found[0] == key, name
            assert (found[1], *found[2]) == pytest.approx((value, *interval), rel=1e-6), (name, key)


@pytest.mark.compiler
def test_a_bag_is_given_to_the_command_as_its_folder(rubbed, tmp_path, examples):
    write_bag(tmp_path / "bag", rubbed, "MCAP")
    named = ["--input-column", BAG.input_column, "--output-column", BAG.output_column]
    given = ["--data", str(tmp_path / "bag"), *named, "--static", "--out", str(tmp_path / "fit")]
    assert run(["identify", str(examples / "finger.toml"), *given]) == 0
    first = file_hash(tmp_path / "bag")
    (tmp_path / "bag" / "metadata.yaml").write_text("else", encoding="utf-8")
    assert file_hash(tmp_path / "bag") != first


@pytest.mark.parametrize("bracket", ["[N]", "(N)", " [N]"])
def test_a_column_is_found_without_its_unit_where_one_alone_is_called_so(bracket, tmp_path):
    data = record()
    named = dict(zip(("time_s", f"near{bracket}", f"far{bracket}"), list(data.values())[:3], strict=True))
    pd.DataFrame(named).to_csv(tmp_path / "f.csv", index=False)
    how = Measurement(input_column="near", output_column="far")
    assert read_measurement(tmp_path / "f.csv", how).input_N == pytest.approx(data[NAMES[1]])
    pd.DataFrame(named | {"near [kN]": data[NAMES[1]]}).to_csv(tmp_path / "g.csv", index=False)
    with pytest.raises(InputError, match='column "near" is missing'):
        read_measurement(tmp_path / "g.csv", how)


def test_a_single_file_of_a_bag_is_read_without_its_folder(tmp_path):
    write_bag(tmp_path / "bag", record(), "MCAP")
    (file,) = (tmp_path / "bag").glob("*.mcap")
    alone = file.rename(tmp_path / "log.mcap")
    np.testing.assert_allclose(read_measurement(alone, BAG).input_N, record()["input_tension_N"], rtol=1e-12)


def test_topics_with_clocks_of_their_own_meet_on_that_of_the_input(tmp_path):
    """A motor at another rate: its position lies on the straight line between its own samples."""
    mdf = pytest.importorskip("asammdf")
    data, slow = record(), np.arange(0, 1.7, 0.01)
    with mdf.MDF() as file:
        for name in NAMES[1:3]:
            file.append(mdf.Signal(data[name], timestamps=data["time_s"], name=name))
        file.append(mdf.Signal(2e-3 * slow, timestamps=slow, name="input_position_m"))
        file.save(tmp_path / "a.mf4", overwrite=True)
    found = read_measurement(tmp_path / "a.mf4", Measurement())
    np.testing.assert_allclose(found.input_m, 2e-3 * found.time_s, atol=1e-15)


def test_a_bag_of_other_topics_lists_what_it_offers(tmp_path):
    write_bag(tmp_path / "bag", record(), "MCAP")
    with pytest.raises(InputError, match=r"/rig/cells\.wrench\.force\.[xyz]"):
        read_measurement(tmp_path / "bag", replace(BAG, input_column="/rig/cells.wrench.force.w"))


@pytest.mark.slow
def test_a_bag_is_read_message_by_message(tmp_path):
    """40 MB of another topic lie between the messages: little of it is ever held."""
    write_bag(tmp_path / "bag", record(), "MCAP", ballast=100_000)
    assert sum(f.stat().st_size for f in (tmp_path / "bag").iterdir()) > 4e7
    read_measurement(tmp_path / "bag", BAG)  # imports
    tracemalloc.start()
    try:
        read_measurement(tmp_path / "bag", BAG)
        _, most = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert most < 8e6


def test_elements_of_a_list_column_are_columns(tmp_path):
    import pandas as pd

    data = record()
    states = np.column_stack([data["input_tension_N"], data["output_tension_N"]])
    frame = pd.DataFrame({"timestamp": data["time_s"], "observation.state": list(states)})
    frame.to_parquet(tmp_path / "a.parquet")
    how = Measurement(
        time_column="timestamp", input_column="observation.state[0]", output_column="observation.state[1]"
    )
    np.testing.assert_array_equal(read_measurement(tmp_path / "a.parquet", how).output_N, data["output_tension_N"])


UNITS = {
    "Kraft [gf]": 9.80665e-3,
    "Kraft [kgf]": 9.80665,
    "Kraft [kN]": 1e3,
    "motor [mN m]": 1e-3 * 20 / 0.01,
    "motor [A]": 0.05 * 20 / 0.01,
    "motor [mA]": 5e-5 * 20 / 0.01,
}


@pytest.mark.parametrize("name", UNITS)
def test_a_unit_in_brackets_is_obeyed_for_a_column_that_is_named(name, tmp_path):
    """Torque constant 0.05 N m/A, gear 20, drum 10 mm: T = k i gear/r."""
    data = record()
    write_csv(tmp_path / "a.csv", {"time_s": data["time_s"], name: data[NAMES[1]], NAMES[2]: data[NAMES[2]]})
    how = Measurement(input_column=name, torque_constant_N_m_per_A=0.05, drum_radius_m=0.01, gear_ratio=20.0)
    found = read_measurement(tmp_path / "a.csv", how)
    np.testing.assert_allclose(found.input_N, UNITS[name] * data[NAMES[1]], rtol=1e-12)


@pytest.mark.parametrize(("unit", "scale"), [("deg", 180 / np.pi), ("rad", 1.0)])
def test_an_angle_of_the_motor_is_a_position_of_the_tendon(unit, scale, tmp_path):
    data = record()
    columns = {**dict(list(data.items())[:3]), f"angle [{unit}]": scale * data["input_position_m"] * 20 / 0.01}
    write_csv(tmp_path / "a.csv", columns)
    how = Measurement(input_position_column=f"angle [{unit}]", drum_radius_m=0.01, gear_ratio=20.0)
    np.testing.assert_allclose(read_measurement(tmp_path / "a.csv", how).input_m, data["input_position_m"], rtol=1e-7)


def test_a_speed_of_the_motor_is_integrated(tmp_path):
    """Constant 60 rpm on a drum of 10 mm: 2 pi 10 mm a second."""
    data = record()
    columns = {**dict(list(data.items())[:3]), "speed [rpm]": np.full(ROWS, 60.0)}
    write_csv(tmp_path / "a.csv", columns)
    how = Measurement(input_position_column="speed [rpm]", drum_radius_m=0.01)
    found = read_measurement(tmp_path / "a.csv", how)
    np.testing.assert_allclose(found.input_m, 2 * np.pi * 0.01 * found.time_s, rtol=1e-9, atol=1e-12)


def test_names_with_blanks_do_not_hide_the_separator(tmp_path):
    rows = [f"{0.01 * k:.2f}\t{30 + k % 9}\t{25 + k % 7}" for k in range(60)]
    (tmp_path / "a.txt").write_text("\n".join(["time s\tforce at motor N\tforce at tip N", *rows]))
    table = read_table(tmp_path / "a.txt")
    assert list(table.columns) == ["time s", "force at motor N", "force at tip N"]


def test_an_unknown_binary_file_gets_the_list_of_what_is_read(tmp_path):
    (tmp_path / "log.bin").write_bytes(b"\x00\x01\x02\xff" * 100)
    with pytest.raises(InputError) as refused:
        read_table(tmp_path / "log.bin")
    for reader in READERS:
        assert reader.name in str(refused.value)


def test_a_missing_package_is_named_with_its_extra(tmp_path, monkeypatch):
    (tmp_path / "a.h5").write_bytes(b"\x89HDF\r\n\x1a\n")
    monkeypatch.setitem(sys.modules, "h5py", None)
    with pytest.raises(InputError, match=r'h5py \(pip install "tendonff\[logs\]"\)'):
        read_table(tmp_path / "a.h5")
