"""Files that may come from somebody else: never quoted where a scenario names them, and bounded in what they cost."""

import gzip
import os
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.io import savemat

from tendonff.compensator.files import text as text_module
from tendonff.compensator.files.dialect import MOST_COLUMNS
from tendonff.compensator.files.formats import mdf
from tendonff.compensator.files.reading import InputError, read_csv, read_text
from tendonff.compensator.files.tables import read_table
from tendonff.compensator.scenario.sampled.first_look import first_look
from tendonff.compensator.scenario.scenario import Scenario, parse_scenario

PRIVATE = "hunter"


def naming(examples: Path, file: Path, keys: str = "") -> Scenario:
    """The finger with a file as its reference."""
    text = (examples / "finger.toml").read_text(encoding="utf-8")
    start, end = text.index("[reference]"), text.index("[run]")
    reference = f'[reference]\nkind = "csv"\nfile = "{file.name}"\n{keys}\n'
    return parse_scenario(f"{text[:start]}{reference}{text[end:]}", file.parent / "x.toml")


@pytest.mark.parametrize(
    ("content", "keys"),
    [
        (f"root:{PRIVATE}:0:0\nbin:x:1:1\n", ""),
        (f"user,{PRIVATE}\na,b\n", ""),
        (f"tension {PRIVATE},time_s\n1,0\n2,1\n", ""),
        (f"tension_N,tension {PRIVATE}\n1,0\n2,1\n", ""),
        (f"tension [{PRIVATE}],time_s\n1,0\n2,1\n", ""),
        (f"time_s,tension_N\n0,1\n1,{PRIVATE}\n", ""),
        (f"time_s,password\n0,{PRIVATE}\n1,x\n", 'tension_column = "password"'),
        (f"time_s,password {PRIVATE}\n0,1\n1,2\n", 'tension_column = "password"'),
        (f"time_s,tension_N\ns,{PRIVATE}\n0,1\n1,2\n", ""),
        (f"time_s,{PRIVATE} [N],force [N],kraft [N]\n0,1,1,1\n1,2,1,1\n", ""),
        ("77,123\n78,124\n", ""),
    ],
)
def test_a_file_that_a_scenario_names_is_refused_without_its_content(
    examples: Path, tmp_path: Path, content: str, keys: str
) -> None:
    (tmp_path / "r.csv").write_text(content, encoding="utf-8")
    with pytest.raises(InputError, match=r"r\.csv") as refused:
        first_look(naming(examples, tmp_path / "r.csv", keys))
    assert PRIVATE not in str(refused.value)
    assert "77" not in str(refused.value)


@pytest.mark.parametrize("name", ["r.xlsx", "r.xls", "r.parquet", "r.mat", "r.npz", "r.h5", "r.mf4", "r.db3", "r.mcap"])
def test_a_damaged_file_that_a_scenario_names_is_refused_without_its_content(
    examples: Path, tmp_path: Path, name: str
) -> None:
    (tmp_path / name).write_bytes(PRIVATE.encode() * 300)
    with pytest.raises(InputError, match=r"cannot be read|need the package") as refused:
        first_look(naming(examples, tmp_path / name))
    assert PRIVATE not in str(refused.value)


def test_a_file_of_the_command_line_is_quoted_as_before(tmp_path: Path) -> None:
    (tmp_path / "f.csv").write_text("time_s,force_N\n0,1\n1,x\n", encoding="utf-8")
    with pytest.raises(InputError, match='force_N must be a number, got "x"'):
        read_csv(tmp_path / "f.csv", ("time_s", "force_N"))


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="there are no FIFOs here")
@pytest.mark.parametrize("name", ["f.csv", "f.csv.gz", "f.mat", "f.parquet"])
def test_pipes_and_devices_are_refused_instead_of_waited_for(tmp_path: Path, name: str) -> None:
    os.mkfifo(tmp_path / name)
    with pytest.raises(InputError, match=f"{name} is a pipe or a device, not a file; write what it gives"):
        read_table(tmp_path / name)
    with pytest.raises(InputError, match="is a pipe or a device"):
        read_text(tmp_path / name)
    with pytest.raises(InputError, match="/dev/zero is a pipe or a device"):
        read_csv(Path("/dev/zero"), ("time_s",))


def packed(path: Path) -> None:
    """A table of a thousand rows."""
    frame = pd.DataFrame({"time_s": np.arange(1000.0), "force_N": np.zeros(1000)})
    match path.suffix:
        case ".gz":
            path.write_bytes(gzip.compress(frame.to_csv(index=False).encode()))
        case ".mat":
            savemat(path, {"time_s": frame["time_s"], "force_N": frame["force_N"]}, do_compression=True)
        case ".parquet":
            frame.to_parquet(path)
        case ".npz":
            np.savez_compressed(path, **{name: frame[name] for name in frame})
        case ".h5":
            import h5py

            with h5py.File(path, "w") as file:
                for name in frame:
                    file.create_dataset(name, data=frame[name], compression="gzip")
        case ".mf4":
            from asammdf import MDF, Signal

            with MDF() as file:
                file.append(Signal(frame["force_N"].to_numpy(), timestamps=frame["time_s"].to_numpy(), name="force_N"))
                file.save(path, overwrite=True, compression=2)
        case _:
            frame.to_excel(path, index=False)


@pytest.mark.parametrize(
    ("suffix", "needs"),
    [
        (".csv.gz", "pandas"),
        (".h5", "h5py"),
        (".mat", "scipy"),
        pytest.param(".mf4", "asammdf", marks=pytest.mark.nightly),
        (".npz", "numpy"),
        (".parquet", "pyarrow"),
        (".xlsx", "openpyxl"),
    ],
)
def test_what_unpacks_to_too_much_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, suffix: str, needs: str
) -> None:
    pytest.importorskip(needs)
    path = tmp_path / f"f{suffix}"
    packed(path)
    assert len(read_csv(path, ("time_s", "force_N"))["time_s"]) == 1000
    monkeypatch.setattr(text_module, "MOST_BYTES", 8000)
    names = ("time_s", "force_N")
    for read in (lambda: read_csv(path, names), lambda: read_table(path, names)):
        with pytest.raises(InputError, match=rf"{re.escape(path.name)} unpacks to more than 0 MB; give the part"):
            read()


def test_a_struct_of_matlab_is_refused_before_it_is_unpacked(tmp_path: Path) -> None:
    path, names = tmp_path / "s.mat", ("time_s", "force_N")
    savemat(path, {"log": {name: np.zeros(15_000_000) for name in names}}, do_compression=True)
    assert path.stat().st_size < 1_000_000
    with pytest.raises(InputError, match=r"s\.mat unpacks to more than 200 MB"):
        read_table(path, names)


def test_long_texts_of_a_parquet_dictionary_are_not_repeated(tmp_path: Path) -> None:
    pa = pytest.importorskip("pyarrow")
    parquet = pytest.importorskip("pyarrow.parquet")
    rows = 20_000
    remarks = pa.DictionaryArray.from_arrays(np.zeros(rows, dtype=np.int32), ["x" * 20_000])
    parquet.write_table(pa.table({"time_s": np.arange(float(rows)), "remark": remarks}), tmp_path / "f.parquet")
    before = pa.default_memory_pool().max_memory()
    table = read_table(tmp_path / "f.parquet", ("time_s",))
    assert len(table.numbers("time_s")) == rows
    assert pa.default_memory_pool().max_memory() < max(before, 20_000_000)


def test_numbers_in_other_files_are_refused(tmp_path: Path) -> None:
    h5py = pytest.importorskip("h5py")
    (tmp_path / "secret.bin").write_bytes(bytes(800))
    with h5py.File(tmp_path / "f.h5", "w") as file:
        file.create_dataset("time_s", data=np.arange(100.0))
        file.create_dataset("force_N", (100,), dtype="f8", external=[(str(tmp_path / "secret.bin"), 0, 800)])
    with pytest.raises(InputError, match=r"f\.h5: force_N keeps its numbers in other files"):
        read_table(tmp_path / "f.h5", ("time_s", "force_N"))


def test_a_reader_that_dies_is_reported(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("asammdf")
    path = tmp_path / "f.mf4"
    packed(path)
    monkeypatch.setattr(mdf, "_CHILD", "import os; os.abort()")
    with pytest.raises(InputError, match=r"f\.mf4 is damaged: it ends asammdf itself"):
        read_table(path, ("time_s",))
    monkeypatch.setattr(mdf, "_CHILD", "import time; time.sleep(60)")
    monkeypatch.setattr(mdf, "LONGEST_S", 0.5)
    with pytest.raises(InputError, match=r"f\.mf4 is not read within 0 s"):
        read_table(path, ("time_s",))


def test_a_quote_that_is_left_open_costs_its_row(tmp_path: Path) -> None:
    rows = "".join(f"{k},{k}\n" for k in range(1, 50_000))
    (tmp_path / "f.csv.gz").write_bytes(gzip.compress(f'time_s,force_N\n0,"0\n{rows}'.encode()))
    assert len(read_table(tmp_path / "f.csv.gz", ("time_s",)).numbers("time_s")) == 49_999
    assert len(read_csv(tmp_path / "f.csv.gz", ("time_s", "force_N"))["time_s"]) == 50_000


@pytest.mark.parametrize("mark", [",", ";", "\t", " "])
def test_very_many_columns_are_refused(tmp_path: Path, mark: str) -> None:
    names = mark.join(f"c{k}" for k in range(MOST_COLUMNS + 2))
    (tmp_path / "f.csv").write_text(f"{names}\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"f\.csv has more than 5000 columns"):
        read_csv(tmp_path / "f.csv", ("c1",))
    rows = mark.join(["time_s", "x"]) + f"\n0{mark}1\n" * 300 + f"0{mark * 1_000_000}\n"
    (tmp_path / "g.csv").write_text(rows, encoding="utf-8")
    assert len(read_table(tmp_path / "g.csv").numbers("time_s")) >= 300


@pytest.mark.parametrize("form", ["{key} = 1", "[{key}]", "[[{key}]]", "x = {{ {key} = 1 }}"])
@pytest.mark.parametrize("part", ["a", '"a b"', "'a'", "a "])
def test_a_key_of_very_many_parts_is_refused_before_it_is_parsed(form: str, part: str) -> None:
    with pytest.raises(InputError, match=r"a key has more than 50 parts"):
        parse_scenario(form.format(key=".".join([part] * 200_000)))


@pytest.mark.parametrize("text", ["a" * 1_000_000, "." * 1_000_000, '"' * 1_000_000, "0.5, " * 200_000, "a-" * 500_000])
def test_long_texts_are_looked_through_once(text: str) -> None:
    """A search that began anew at every character would not end."""
    with pytest.raises(InputError):
        parse_scenario(f"x = {text}")
