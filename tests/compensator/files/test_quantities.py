"""The same numbers, written in the ways of spreadsheets and loggers, are read as the same numbers, or asked about."""

from pathlib import Path

import pytest

from tendonff.compensator.files.quantities import (
    FORCE_UNITS,
    TIME_UNITS,
    TIME_WORDS,
    Quantities,
    Quantity,
    read_quantities,
)
from tendonff.compensator.files.reading import InputError


def read(folder: Path, text: str, time: str | None = None, force: str | None = None) -> Quantities:
    path = folder / "log.csv"
    path.write_text(text, encoding="utf-8")
    option = '{}_column = "{{}}"'
    return read_quantities(
        path,
        [
            Quantity(name="time_s", words=TIME_WORDS, units=TIME_UNITS, option=option.format("time"), column=time),
            Quantity(
                name="force_N", words=("force", "kraft"), units=FORCE_UNITS, option=option.format("force"), column=force
            ),
        ],
        starts_at_zero=True,
    )


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("time_s,force_N\n0,1.5\n0.01,250\n", ()),
        ("force_N, remark, time_s\n1.5, a, 0\n250, b, 0.01\n", ()),
        ("time_s;force_N\n0;1,5\n0,01;250\n", ("semicolons", "decimal commas")),
        ("time_s;force_N\n0;1.5\n0.01;250\n", ("semicolons",)),
        ("time_s\tforce_N\n0\t1.5\n1e-2\t250\n", ("tabs",)),
        ("time_s  force_N\n0   1.5\n0.01   250\n", ("spaces",)),
        ("# bench 3\n\n# time_s,force_N\n0,1.5\n0.01,250\n", ()),
        ("time_s,force_N\n# moved by hand\n0,1.5\n\n".rstrip() + "\n# and again\n0.01,250\n", ()),
        ("time_s,force_N\ns,N\n0,1.5\n0.01,250\n", ()),
        ("Logger;3\nDate;2026-01-01\nt [ms];force [N]\n0;1,5\n10;250\n", ("2 lines above", "time in ms")),
        ("time_ms,force_N\n0,1.5\n10,250\n", ("time in ms",)),
        ("Zeit,Kraft\nms,kN\n0,0.0015\n10,0.25\n", ("time in ms", "force in kN")),
    ],
)
def test_every_usual_way_of_writing_gives_the_same_numbers_and_is_named(
    tmp_path: Path, text: str, said: tuple[str, ...]
) -> None:
    found = read(tmp_path, text)
    assert found.values["time_s"] == pytest.approx([0.0, 0.01], rel=1e-15)
    assert found.values["force_N"] == pytest.approx([1.5, 250.0], rel=1e-15)
    assert len(found.notes) == (1 if said else 0)
    for words in said:
        assert words in found.notes[0]


def test_a_decimal_comma_that_shows_only_late_is_read(tmp_path: Path) -> None:
    rows = "".join(f"{k};{k + 1}\n" for k in range(300))
    found = read(tmp_path, f"time_s;force_N\n{rows}300,5;7,25\n")
    assert found.values["time_s"][-1] == 300.5
    assert found.values["force_N"][-1] == 7.25


def test_columns_that_the_user_names_are_read_in_the_unit_that_they_state(tmp_path: Path) -> None:
    found = read(tmp_path, "clock [ms],cell 2\n0,1.5\n10,250\n", "clock [ms]", "cell 2")
    assert found.values["time_s"] == pytest.approx([0.0, 0.01])
    assert found.values["force_N"].tolist() == [1.5, 250.0]
    assert found.notes == ('log.csv: column "clock [ms]" read in ms, column "cell 2" read in N',)


@pytest.mark.parametrize(
    ("text", "columns", "message"),
    [
        (
            "t,force_N\n0,1\n1,2\n",
            (None, None),
            r'is it "t"\? If it is in s, say so with time_column = "t", .* "t \[ms\]"',
        ),
        ("time_s,force,kraft\n0,1,2\n", (None, None), r'"force", "kraft" could be meant: choose with force_column'),
        ("time [h],force_N\n0,1\n", (None, None), r'"time \[h\]" has the unit h, which is none of s, ms, us'),
        ("time_s,force_N\nms,N\n0,1\n", (None, None), r'"time_s" has the unit ms below its name; rename it'),
        ("time_s,cell [V]\n0,1\n", (None, "cell [V]"), r'"cell \[V\]" has the unit V, which is none of N, kN'),
        ("time_s,force_N\n0,1\n", ("clock", None), r'column "clock" is missing'),
        ("time_s,a\n0,1\n", (None, None), r'"force_N" is missing; known: time_s, a .say which by force_column = '),
        ("time_s,force_N\n0,1\n", (None, "time_s"), r'column "time_s" stands for two quantities'),
        ("time_s;force_N\n0;1,5\n1;2.5\n", (None, None), r'row 3: force_N must be a number, got "2\.5"'),
    ],
)
def test_what_the_file_does_not_tell_is_asked_about(
    tmp_path: Path, text: str, columns: tuple[str | None, str | None], message: str
) -> None:
    with pytest.raises(InputError, match=message):
        read(tmp_path, text, *columns)
