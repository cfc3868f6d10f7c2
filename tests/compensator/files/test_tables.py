"""Files as loggers write them: one table, whatever the separator, the packing and the clock."""

import gzip

import numpy as np
import pandas as pd
import pytest
from scipy.io import savemat

from tendonff.compensator.files.quantities import FORCE_UNITS, TIME_UNITS, TIME_WORDS, Quantity, read_quantities
from tendonff.compensator.files.reading import InputError
from tendonff.compensator.identification.measured.reading import DataIssue, read_measurement
from tendonff.compensator.scenario.measurement import Measurement

TIME = np.arange(0, 2, 0.01)
TABLE = np.column_stack([TIME, 40 + 15 * np.sin(3 * TIME), 30 + 8 * np.sin(3 * TIME - 0.3)])
NAMES = ("time_s", "input_tension_N", "output_tension_N")
HOW = Measurement()


def text(separator=",", decimal=".", head=(), units=None, times=None):
    rows = [separator.join(NAMES)]
    if units:
        rows.append(separator.join(units))
    for k, row in enumerate(TABLE.tolist()):
        cells = [f"{v:.9g}".replace(".", decimal) for v in row]
        if times is not None:
            cells[0] = times[k]
        rows.append(separator.join(cells))
    return "\n".join([*head, *rows]) + "\n"


def check(found):
    np.testing.assert_allclose(found.time_s, TIME, atol=1e-9)
    np.testing.assert_allclose(found.input_N, TABLE[:, 1], rtol=1e-8)
    np.testing.assert_allclose(found.output_N, TABLE[:, 2], rtol=1e-8)


@pytest.mark.parametrize(
    "content",
    [
        text(";"),
        text(";", decimal=","),
        text("\t"),
        text("\t", decimal=","),
        text(" "),
        text("|"),
        text(head=("# logger 7", "% run 3", "// N")),
        "sep=;\n" + text(";"),
    ],
)
def test_separators_decimal_commas_and_comment_lines_do_not_matter(tmp_path, content):
    (tmp_path / "a.csv").write_text(content)
    found = read_measurement(tmp_path / "a.csv", HOW)
    check(found)
    assert found.findings == ()


def test_a_row_of_units_is_obeyed_and_reported(tmp_path):
    rows = text(units=("ms", "kN", "N")).splitlines()
    (tmp_path / "a.csv").write_text("\n".join(rows) + "\n")
    found = read_measurement(tmp_path / "a.csv", HOW)
    np.testing.assert_allclose(found.time_s, TIME * 1e-3, atol=1e-12)
    np.testing.assert_allclose(found.input_N, TABLE[:, 1] * 1e3, rtol=1e-8)
    [finding] = [f for f in found.findings if f.issue is DataIssue.UNITS]
    assert "time_s [ms] x 0.001" in finding.text
    assert "input_tension_N [kN] x 1000" in finding.text


def test_a_factor_that_was_given_overrides_the_row_of_units(tmp_path):
    (tmp_path / "a.csv").write_text(text(units=("s", "kN", "kN")))
    found = read_measurement(tmp_path / "a.csv", Measurement(input_scale=2.0))
    np.testing.assert_allclose(found.input_N, 2 * TABLE[:, 1], rtol=1e-8)
    np.testing.assert_allclose(found.output_N, 1e3 * TABLE[:, 2], rtol=1e-8)


@pytest.mark.parametrize("zone", ["", "Z", "+02:00"])
def test_iso_time_stamps_become_seconds(tmp_path, zone):
    start = pd.Timestamp("2024-03-01T23:59:59.5")
    times = [f"{(start + pd.Timedelta(seconds=float(t))).isoformat()}{zone}" for t in TIME]
    (tmp_path / "a.csv").write_text(text(times=times))
    found = read_measurement(tmp_path / "a.csv", HOW)
    check(found)
    assert [f.issue for f in found.findings] == [DataIssue.DATES]


@pytest.mark.parametrize("as_struct", [False, True])
def test_matlab_vectors_are_found_among_others_and_in_structs(tmp_path, as_struct):
    vectors = dict(zip(NAMES, TABLE.T, strict=True))
    savemat(tmp_path / "a.mat", {"log": vectors} if as_struct else {**vectors, "note": "run 3", "gain": 4.0})
    check(read_measurement(tmp_path / "a.mat", HOW))


def test_a_damaged_spreadsheet_is_one_message_or_the_missing_package_is_named(tmp_path):
    (tmp_path / "a.xlsx").write_bytes(b"PK")
    with pytest.raises(InputError, match=r"openpyxl|what can be read"):
        read_measurement(tmp_path / "a.xlsx", HOW)


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("a.csv", b"\x00\x01\x02binary\x00"),
        ("a.csv", b"\xff\xfe\x00\xd8"),
        ("a.csv.gz", b"not packed"),
        ("a.mat", b"nothing"),
        ("a.parquet", b"nothing"),
    ],
)
def test_anything_else_is_one_message_that_shows_the_way(tmp_path, name, content):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError, match=r"what can be read: text with a header|pip install pyarrow"):
        read_measurement(tmp_path / name, HOW)


def test_a_file_without_a_header_is_told_to_name_its_columns(tmp_path):
    (tmp_path / "a.csv").write_text("\n".join(text().splitlines()[1:]))
    with pytest.raises(InputError, match="first line must name the columns"):
        read_measurement(tmp_path / "a.csv", HOW)


def written(path):
    """The table as a file of the kind that its name tells."""
    frame = pd.DataFrame(TABLE, columns=NAMES)
    if path.suffix == ".parquet":
        pytest.importorskip("pyarrow")
        frame.to_parquet(path)
    elif path.suffix == ".xlsx":
        pytest.importorskip("openpyxl")
        frame.to_excel(path, index=False)
    elif path.suffix == ".mat":
        savemat(path, dict(zip(NAMES, TABLE.T, strict=True)))
    else:
        with gzip.open(path, "wt") as stream:
            stream.write(text(";", decimal=","))
    return path


KINDS = ["a.xlsx", "a.parquet", "a.mat", "a.csv.gz"]


@pytest.mark.parametrize("name", KINDS)
def test_packed_tables_are_read_as_measurements(tmp_path, name):
    check(read_measurement(written(tmp_path / name), HOW))


@pytest.mark.parametrize("name", KINDS)
def test_the_same_reader_serves_references_and_forces(tmp_path, name):
    """Strictly there: every cell a number, time rising."""
    wanted = [
        Quantity(name="time_s", words=TIME_WORDS, units=TIME_UNITS, option="{}"),
        Quantity(name="input_tension_N", words=("tension",), units=FORCE_UNITS, option="{}"),
    ]
    found = read_quantities(written(tmp_path / name), wanted).values  # noqa: PD011 - no frame
    np.testing.assert_allclose(found["time_s"], TIME, atol=1e-9)
    np.testing.assert_allclose(found["input_tension_N"], TABLE[:, 1], rtol=1e-8)


@pytest.mark.parametrize("name", ["a.xlsx", "a.parquet"])
def test_units_below_the_header_of_a_spreadsheet_are_obeyed(tmp_path, name):
    pytest.importorskip("openpyxl" if name == "a.xlsx" else "pyarrow")
    frame = pd.DataFrame([["ms", "kN", "N"], *TABLE.tolist()], columns=NAMES).astype(str)
    if name == "a.xlsx":
        frame.to_excel(tmp_path / name, index=False)
    else:
        frame.to_parquet(tmp_path / name)
    found = read_measurement(tmp_path / name, HOW)
    np.testing.assert_allclose(found.time_s, 1e-3 * TIME, atol=1e-12)
    np.testing.assert_allclose(found.input_N, 1e3 * TABLE[:, 1], rtol=1e-8)
