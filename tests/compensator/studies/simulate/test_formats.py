"""Force files, references and measurements as loggers and spreadsheets write them: read, or asked about."""

import gzip
from dataclasses import replace
from io import BytesIO

import numpy as np
import pandas as pd
import pytest
from scipy.io import savemat

from tendonff.compensator.cli import run
from tendonff.compensator.files.text import InputError
from tendonff.compensator.identification.measured.reading import read_measurement
from tendonff.compensator.scenario.measurement import Measurement
from tendonff.compensator.scenario.reference import CsvReference
from tendonff.compensator.scenario.sampled.sampling import sample_reference
from tendonff.compensator.scenarios import load_scenario

pytestmark = pytest.mark.compiler
TIME, VALUE = np.arange(0, 0.101, 0.01), 30 + 5 * np.arange(11) / 10
USES = {"force": ("force",), "reference": ("tension",), "measurement": ("input_tension", "output_tension")}


def table(
    separator: str = ",",
    *,
    decimal: str = ".",
    head: str = "time_s,{}_N",
    time: float = 1.0,
    unit: float = 1.0,
    clock="",
):
    """Text with one column for each name that `head` gets, as a function of these names."""

    def write(names: tuple[str, ...]) -> str:
        def number(value: float) -> str:
            return f"{value:.6f}".replace(".", decimal)

        heads = [line.split(",") for line in head.split("\n")]
        lines = [separator.join([first, *(rest.replace("{}", name) for name in names)]) for first, rest in heads]
        for t, v in zip(TIME, VALUE, strict=True):
            stamp = f"{clock}{t:09.6f}" if clock else number(t * time)
            lines.append(separator.join([stamp, *(number(v * unit) for _ in names)]))
        return "\n".join(lines) + "\n"

    return write


PLAIN = table()


def changed(*pairs: tuple[str, str], of=PLAIN):
    """A table with some text replaced."""

    def write(names: tuple[str, ...]) -> str:
        text = of(names)
        for old, new in pairs:
            assert old in text
            text = text.replace(old, new)
        return text

    return write


def frame(names: tuple[str, ...]) -> pd.DataFrame:
    return pd.DataFrame({"time_s": TIME} | {f"{name}_N": VALUE for name in names})


def packed(write) -> bytes:
    stream = BytesIO()
    write(stream)
    return stream.getvalue()


READ = {
    "plain.csv": PLAIN,
    "semicolons and decimal commas.csv": table(";", decimal=","),
    "semicolons.csv": table(";"),
    "tabs.tsv": table("\t"),
    "tabs and decimal commas.txt": table("\t", decimal=","),
    "bars.csv": table("|"),
    "spaces.dat": table(" "),
    "remarks.csv": lambda names: "# bench 3\n% second try\n// third\n" + PLAIN(names),
    "header in a remark.csv": lambda names: "# " + PLAIN(names),
    "a line of units.csv": table(head="time_s,{}_N\ns,N"),
    "names without units above a line of units.csv": table(head="time,{}\nms,kN", time=1e3, unit=1e-3),
    "lines above the header.csv": lambda names: "Logger;3\nDate;2026-01-01\n" + table(";")(names),
    "milliseconds by header.csv": table(head="time_ms,{}_N", time=1e3),
    "milliseconds in brackets.csv": table(";", decimal=",", head="Time [ms],{}_N", time=1e3),
    "kilonewtons by header.csv": table(head="time_s,{} [kN]", unit=1e-3),
    "capital letters.csv": table(head="TIME_S,{}_N"),
    "dates.csv": table(head="timestamp,{}_N", clock="2026-03-01T12:00:"),
    "times of day.csv": table(";", decimal=",", head="time,{}_N", clock="12:00:"),
    "byte order mark.csv": lambda names: "\ufeff" + table(";")(names),
    "Windows line ends.csv": changed(("\n", "\r\n")),
    "quotes.csv": lambda names: "".join('"' + row.replace(",", '","') + '"\n' for row in PLAIN(names).splitlines()),
    "separators at the ends.csv": changed(("00\n", "00,\n")),
    "packed.csv.gz": lambda names: gzip.compress(table(";", decimal=",")(names).encode()),
    "spreadsheet.xlsx": lambda names: packed(lambda stream: frame(names).to_excel(stream, index=False)),
    "columns.parquet": lambda names: packed(lambda stream: frame(names).to_parquet(stream)),
    "vectors.mat": lambda names: packed(lambda stream: savemat(stream, dict(frame(names).items()))),
}
ASKED = {
    "no time.csv": (table(head="x,{}_N"), '"time_s" is missing'),
    "no value.csv": (table(head="time_s,y"), '_N" is missing'),
    "an empty file.csv": (lambda _: "", "is empty; the first line must name the columns"),
    "no header.csv": (lambda names: PLAIN(names).partition("\n")[2], "the first line must name the columns"),
    "numbers of another language.csv": (table(decimal=","), "for decimal commas separate the columns by semicolons"),
    "a column twice.csv": (
        changed((",", ",1.0,"), ("time_s,1.0", "time_s,x"), ("x", "time_s")),
        "more than once|2 times",
    ),
    "half a packed file.csv.gz": (lambda names: gzip.compress(PLAIN(names).encode())[:40], "cannot be unpacked"),
    "no spreadsheet.xlsx": (lambda _: b"nonsense", "what can be read: text with a header"),
    "half a character.csv": (lambda names: PLAIN(names).encode("utf-16")[:-1], "save it as UTF-8"),
}
REFUSED = {  # by force files and references: a measurement leaves such rows out and says so
    "text among the numbers.csv": (changed(("30.500000", "broken")), r"must be a number"),
    "no number.csv": (changed(("30.500000", "NaN")), "must be a finite number, got NaN"),
    "the header again.csv": (lambda names: PLAIN(names) + PLAIN(names), "is it the header again"),
    "time that falls.csv": (changed(("0.020000", "0.000500")), "must increase, got 0.0005 after 0.01"),
    "time that stands.csv": (changed(("0.020000", "0.010000")), "must increase"),
    "a row too long.csv": (changed(("30.500000\n", "30.500000,7\n")), "expected 2 cells, got 3"),
}


def written(folder, form, content, names=("force",)):
    data = content(names)
    path = folder / form
    path.write_bytes(data if isinstance(data, bytes) else data.encode())
    return path


def simulated(examples, path, out):
    return run(["simulate", str(examples / "finger.toml"), "--force", str(path), "--out", str(out)])


def reference(examples, path):
    scenario = load_scenario(examples / "finger.toml")
    return sample_reference(replace(scenario, reference=CsvReference(file=str(path))))


@pytest.fixture(scope="module")
def expected(examples, tmp_path_factory):
    folder = tmp_path_factory.mktemp("plain")
    assert simulated(examples, written(folder, "f.csv", PLAIN), folder / "o.csv") == 0
    return np.genfromtxt(folder / "o.csv", delimiter=",", skip_header=1)


@pytest.mark.parametrize("form", READ)
def test_every_form_is_read_as_force_reference_and_measurement(examples, tmp_path, expected, form):
    force = written(tmp_path, form, READ[form])
    assert simulated(examples, force, tmp_path / "o.csv") == 0
    output = np.genfromtxt(tmp_path / "o.csv", delimiter=",", skip_header=1)
    assert output == pytest.approx(expected, rel=1e-9, abs=1e-12)
    found = reference(examples, written(tmp_path, form, READ[form], USES["reference"]))
    assert found.tension_N[::10] == pytest.approx(VALUE, rel=1e-9)
    seen = read_measurement(written(tmp_path, form, READ[form], USES["measurement"]), Measurement())
    assert seen.time_s - seen.time_s[0] == pytest.approx(TIME, abs=1e-9)
    assert seen.output_N == pytest.approx(VALUE, rel=1e-9)


@pytest.mark.parametrize("form", ASKED | REFUSED)
def test_what_cannot_be_read_is_answered_with_one_message(examples, tmp_path, capsys, form):
    content, hint = (ASKED | REFUSED)[form]
    assert simulated(examples, written(tmp_path, form, content), tmp_path / "o.csv") == 2
    said = capsys.readouterr().err.strip()
    assert said.count("error:") == 1
    assert form in said
    assert not (tmp_path / "o.csv").exists()
    with pytest.raises(InputError, match=hint):
        reference(examples, written(tmp_path, form, content, USES["reference"]))
    if form in ASKED:
        with pytest.raises(InputError, match=hint):
            read_measurement(written(tmp_path, form, content, USES["measurement"]), Measurement())


def test_a_reference_of_one_row_is_refused(examples, tmp_path):
    with pytest.raises(InputError, match="has 1 row; a reference needs at least two"):
        reference(examples, written(tmp_path, "one.csv", lambda _: "time_s,tension_N\n0,30\n"))
