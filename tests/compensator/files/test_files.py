import json
import os
from contextlib import nullcontext
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from random_examples import tried_on

from tendonff.compensator.files.reading import InputError, read_csv
from tendonff.compensator.files.writing import (
    atomic_directory,
    atomic_file,
    open_csv,
    write_csv,
    write_json,
    write_text,
)

FORCE = ("time_s", "force_N")


def force_file(folder: Path, text: str) -> Path:
    path = folder / "force.csv"
    path.write_text(text, encoding="utf-8", newline="")
    return path


def listing(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


# --- reading


def test_columns_are_found_by_name_in_any_order_and_others_are_ignored(tmp_path: Path) -> None:
    path = force_file(tmp_path, "force_N,remark,time_s\n1.5,start,0\n2.5,nan,0.1\n")
    columns = read_csv(path, FORCE)
    assert columns["time_s"].tolist() == [0.0, 0.1]
    assert columns["force_N"].tolist() == [1.5, 2.5]


@pytest.mark.parametrize("ending", ["\n", "\r\n"])
@pytest.mark.parametrize("mark", ["", "\ufeff"])
def test_spreadsheet_line_ends_byte_order_marks_and_blanks_around_names_are_accepted(
    tmp_path: Path, ending: str, mark: str
) -> None:
    path = force_file(tmp_path, mark + ending.join(["time_s, force_N", "0, 1", "1, 2", "", ""]))
    assert read_csv(path, FORCE)["force_N"].tolist() == [1.0, 2.0]


def test_numbers_read_back_as_the_same_doubles(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    values = np.concatenate([rng.normal(size=2000) * 10.0 ** rng.integers(-300, 300, 2000), [0.1, 5e-324, 1.7e308]])
    write_csv(tmp_path / "x.csv", {"time_s": np.arange(len(values)), "force_N": values})
    assert np.array_equal(read_csv(tmp_path / "x.csv", FORCE)["force_N"], values)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", r"force\.csv is empty; the first line must name the columns"),
        ("\n\n", r"force\.csv is empty"),
        ("time_s,force_N\n", r"force\.csv has a header but no rows"),
        ("0,1\n1,2\n", r"force\.csv row 1: the first line must name the columns, got numbers"),
        ("time_s,forceN\n0,1\n", r'force\.csv: column "force_N" is missing, did you mean "forceN"\?'),
        (
            "time_s,force_N\n0,0,1,5\n0,1,2,5\n",
            r"row 2: expected 2 cells, got 4; for decimal commas separate the columns by semicolons",
        ),
        ("time_s;force_N\n0;1,5\n1;2.5\n", r'row 3: force_N must be a number, got "2\.5"'),
        ("# from the bench\n\ntime_s;force_N\ns;N\n0;1\n1;x\n", r'row 6: force_N must be a number, got "x"'),
        ("time_s,force_N,force_N\n0,1,2\n", r'column "force_N" appears 2 times'),
        ("time_s,force_N\n0,1\n1,x\n", r'force\.csv row 3: force_N must be a number, got "x"'),
        ("time_s,force_N\n0,1\n1,nan\n", r"force\.csv row 3: force_N must be a finite number, got nan"),
        ("time_s,force_N\n0,1\n1,1e999\n", r"force\.csv row 3: force_N must be a finite number, got 1e999"),
        ("time_s,force_N\n0,1\n1,\n", r"force\.csv row 3: force_N is empty"),
        ("time_s,force_N\n0,1\n\n2,3\n", r"force\.csv row 3 is empty"),
        ("time_s,force_N\n0,1\n1\n", r"force\.csv row 3: expected 2 cells, got 1"),
        ("time_s,force_N\n0,1\n1,2,3\n", r"force\.csv row 3: expected 2 cells, got 3"),
        ("time_s,force_N\n0,1,2\n1,2,3\n", r"force\.csv row 2: expected 2 cells, got 3"),
        ("time_s,force_N\n0,1\n0.016,2\n0.016,3\n", r"force\.csv row 4: time_s must increase, got 0.016 after 0.016"),
        ("time_s,force_N\n0,1\n2,2\n1,3\n", r"force\.csv row 4: time_s must increase, got 1 after 2"),
        ("time_s,force_N\n0.5,1\n2,2\n", r"force\.csv row 2: time_s must start at 0, got 0.5; subtract the first time"),
    ],
)
def test_a_bad_file_is_refused_with_its_row_column_and_value(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        read_csv(force_file(tmp_path, text), FORCE, starts_at_zero=True)


def test_what_is_no_readable_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such file"):
        read_csv(tmp_path / "absent.csv", FORCE)
    with pytest.raises(InputError, match="is a folder"):
        read_csv(tmp_path, FORCE)
    (tmp_path / "binary.csv").write_bytes(b"\x7fELF\x00\x01\xff\xfe\n")
    with pytest.raises(InputError, match=r"nor of a known format; what can be read: .*\.parquet.*MDF4.*ROS 2 bag"):
        read_csv(tmp_path / "binary.csv", FORCE)


@tried_on(150)
@given(
    body=st.one_of(
        st.binary(max_size=60),
        st.text(alphabet="0123456789.,-+eE\n\r\t \"';nainf_timefoc", max_size=80).map(str.encode),
        st.lists(st.lists(st.floats(), min_size=1, max_size=3), max_size=5).map(
            lambda rows: "\n".join(",".join(map(str, row)) for row in rows).encode()
        ),
    ),
    header=st.sampled_from([b"", b"time_s,force_N\n", b"time_s,force_N,x\r\n", b"\xef\xbb\xbftime_s,force_N\n"]),
)
def test_any_bytes_give_columns_or_one_message(
    tmp_path_factory: pytest.TempPathFactory, body: bytes, header: bytes
) -> None:
    path = tmp_path_factory.getbasetemp() / "fuzz.csv"
    path.write_bytes(header + body)
    try:
        columns = read_csv(path, FORCE)
    except InputError as error:
        assert "fuzz.csv" in str(error)
        assert "\n" not in str(error).strip()
    else:
        assert all(np.isfinite(values).all() for values in columns.values())
        assert (np.diff(columns["time_s"]) > 0).all()


# --- writing


def test_a_stream_of_blocks_is_the_same_file_as_one_write(tmp_path: Path) -> None:
    table = np.random.default_rng(0).normal(size=(1000, 3))
    write_csv(tmp_path / "whole.csv", {name: table[:, k] for k, name in enumerate("abc")})
    with open_csv(tmp_path / "parts.csv", "abc") as out:
        for start in range(0, 1000, 37):
            out.write(table[start : start + 37])
    assert (tmp_path / "parts.csv").read_bytes() == (tmp_path / "whole.csv").read_bytes()


class StopError(Exception):
    """Stands for whatever ends a run early."""


@pytest.mark.parametrize("stop", [StopError, KeyboardInterrupt])
def test_an_interrupted_file_leaves_what_was_there(tmp_path: Path, stop: type[BaseException]) -> None:
    write_text(tmp_path / "x.csv", "old")
    for name in ("x.csv", "new.csv", "deep/er/new.csv"):
        with pytest.raises(stop), atomic_file(tmp_path / name) as partial:
            partial.write_text("half", encoding="utf-8")
            raise stop
    assert listing(tmp_path) == ["x.csv"]
    assert (tmp_path / "x.csv").read_text(encoding="utf-8") == "old"


@pytest.mark.parametrize("stop", [StopError, KeyboardInterrupt])
def test_an_interrupted_folder_leaves_what_was_there(tmp_path: Path, stop: type[BaseException]) -> None:
    with atomic_directory(tmp_path / "out") as out:
        write_text(out / "summary.json", "old")
    for name in ("out", "other", "deep/other"):
        with pytest.raises(stop), atomic_directory(tmp_path / name) as out:
            write_text(out / "summary.json", "half")
            raise stop
    assert listing(tmp_path) == ["out"]
    assert (tmp_path / "out" / "summary.json").read_text(encoding="utf-8") == "old"


def test_a_second_run_replaces_its_own_files_and_keeps_the_users(tmp_path: Path) -> None:
    for content in ("one", "two"):
        with atomic_directory(tmp_path / "out") as out:
            write_text(out / "summary.json", content)
            write_text(out / "figures" / "a.txt", content)
        write_text(tmp_path / "out" / "notes.txt", "mine")
    assert listing(tmp_path) == ["out"]
    assert listing(tmp_path / "out") == ["figures", "notes.txt", "summary.json"]
    assert (tmp_path / "out" / "figures" / "a.txt").read_text(encoding="utf-8") == "two"


def test_a_clash_of_file_and_folder_is_refused_before_anything_moves(tmp_path: Path) -> None:
    write_text(tmp_path / "out" / "b", "a file")
    write_text(tmp_path / "out" / "a", "old")
    with (
        pytest.raises(InputError, match="is a file, and the result is a folder"),
        atomic_directory(tmp_path / "out") as out,
    ):
        write_text(out / "a", "new")
        write_text(out / "b" / "c", "new")
    assert (tmp_path / "out" / "a").read_text(encoding="utf-8") == "old"
    assert listing(tmp_path) == ["out"]


def test_a_page_that_another_program_wrote_is_kept(tmp_path: Path) -> None:
    """A report of an earlier run is replaced; beside a foreign one nothing is written at all."""
    ours = '<head><meta name="generator" content="tendonff">'
    for old, new in (("<p>a thesis", "<p>a thesis"), (f"{ours} old", f"{ours} new")):
        write_text(tmp_path / "out" / "report.html", old)
        with (
            pytest.raises(InputError, match="no page of tendonff and is kept") if old == new else nullcontext(),
            atomic_directory(tmp_path / "out") as out,
        ):
            write_text(out / "profile.csv", new)
            write_text(out / "report.html", f"{ours} new")
        assert (tmp_path / "out" / "report.html").read_text(encoding="utf-8") == new
        assert (tmp_path / "out" / "profile.csv").exists() == (old != new)
    assert listing(tmp_path) == ["out"]


def test_impossible_targets_are_refused_before_any_work(tmp_path: Path) -> None:
    write_text(tmp_path / "file", "x")
    with pytest.raises(InputError, match="is a file; name a folder"), atomic_directory(tmp_path / "file"):
        pytest.fail("the work was begun")
    with pytest.raises(InputError, match="is a folder; name a file"), atomic_file(tmp_path):
        pytest.fail("the work was begun")
    with pytest.raises(InputError, match="cannot be created"), atomic_file(tmp_path / "file" / "below"):
        pytest.fail("the work was begun")


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no named pipes")
def test_what_is_no_regular_file_is_written_to_and_not_replaced(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    reader = os.open(tmp_path / "pipe", os.O_RDONLY | os.O_NONBLOCK)
    try:
        write_text(tmp_path / "pipe", "through")
        assert (tmp_path / "pipe").is_fifo()
        assert os.read(reader, 100) == b"through"
    finally:
        os.close(reader)


def test_json_takes_numpy_and_refuses_what_is_not_a_number(tmp_path: Path) -> None:
    write_json(tmp_path / "x.json", {"a": np.float64(1.5), "b": np.arange(3), "c": np.bool_(True), "d": Path("p")})
    assert json.loads((tmp_path / "x.json").read_text(encoding="utf-8")) == {
        "a": 1.5,
        "b": [0, 1, 2],
        "c": True,
        "d": "p",
    }
    with pytest.raises(ValueError, match="not JSON compliant"):
        write_json(tmp_path / "y.json", {"a": float("nan")})
    assert listing(tmp_path) == ["x.json"]
