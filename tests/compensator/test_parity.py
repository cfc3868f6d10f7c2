"""Every work takes every kind of scenario, or refuses it with a reason and a way out."""

import inspect
import re
import tomllib
from pathlib import Path

import pytest

import tendonff as tf
from tendonff.compensator import works
from tendonff.compensator.cli import run
from tendonff.compensator.compensators.every import compensator_of, problem_of
from tendonff.compensator.files.reading import InputError
from tendonff.compensator.scenario.kind import Kind
from tendonff.models.parameters.numbers import with_numbers

RIGS = {
    "tension": Kind.TENSION,
    "loop": Kind.JOINT,
    "pair": Kind.JOINT,
    "spring": Kind.JOINT,
    "finger": Kind.FINGER,
    "underactuated": Kind.FINGER,
}
"""What there is, and the kind of scenario that it is to the program."""

MOST_REFUSED = 6
"""Refusals: each reason of a whole work, and each reason of an option; they may only become fewer."""

COMMANDS = {
    "explore": ["explore"],
    "experiment": ["experiment"],
    "watch": ["watch", "--data", "log.csv"],
    "adapt": ["adapt"],
    "table": ["table"],
}
"""A command that asks for each work that some kind refuses."""

OPTIONS = {
    ("identify", "tension_columns"): ["identify", "--data", "log.csv", "--tension-column", "a_N=1"],
    ("identify", "actuator_force_column"): ["identify", "--data", "log.csv", "--actuator-force-column", "a"],
    ("identify", "explain"): ["identify", "--data", "log.csv", "--explain", "input"],
    ("identify", "static_only"): ["identify", "--data", "log.csv", "--static"],
    ("identify", "gear_ratio"): ["identify", "--data", "log.csv", "--gear-ratio", "5"],
    ("identify", "drum_radius_m"): ["identify", "--data", "log.csv", "--drum-radius", "0.01"],
}
"""A command with each option that some kind lacks; those of Python alone are not here."""


@pytest.fixture(scope="module")
def files(examples: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """A scenario file of every rig."""
    folder = tmp_path_factory.mktemp("rigs")
    assert run(["new", str(folder / "underactuated.toml"), "--for", "underactuated"]) == 0
    loop = (examples / "hand_joint.toml").read_text(encoding="utf-8")
    head, first, _ = loop.split("[[tendons]]")
    drive = loop[loop.index("[drive]") :]
    return {
        "tension": examples / "finger.toml",
        "loop": examples / "hand_joint.toml",
        "pair": examples / "instrument_pair.toml",
        "spring": _spring(folder / "spring.toml", head, first, drive),
        "finger": examples / "three_joint_finger.toml",
        "underactuated": folder / "underactuated.toml",
    }


def _spring(path: Path, head: str, tendon: str, drive: str) -> Path:
    """One tendon and a spring that keeps it taut."""
    text = head.replace("[joints.knuckle]", "[joints.knuckle]\nstiffness_N_m_per_rad = 0.1\nrest_rad = -1.5")
    lines = (text + "[[tendons]]" + tendon.split("[drive]", maxsplit=1)[0] + drive).splitlines()
    kept = [line for line in lines if not line.startswith(("pretension_N", "homing_rad", 'kind = "loop"'))]
    text = "\n".join(kept).replace("[drive]", '[drive]\nkind = "pair"\nleast_tension_N = 0.5')
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize("rig", RIGS)
def test_the_one_reader_knows_what_a_file_describes(files, rig):
    assert tf.load_scenario(files[rig]).kind is RIGS[rig]


@pytest.mark.parametrize("work", works.WORKS)
def test_every_work_takes_or_refuses_every_kind_and_lacks_options_of_its_own_alone(files, work):
    entry = works.WORKS[work]
    assert {*entry.by, *entry.refused} == set(Kind)
    assert not {*entry.by} & {*entry.refused}
    for rig, kind in RIGS.items():
        if kind in entry.by:
            found = works.function_of(work, tf.load_scenario(files[rig])).func
            taken = set(inspect.signature(found).parameters)
            lacking = {name for name, why in entry.options.items() if kind in why}
            assert {name for name in entry.options if name in taken} - MEASURED == {*entry.options} - lacking - MEASURED


MEASURED = {
    *("tension_columns", "actuator_force_column", "explain", "tare_s", "gear_ratio", "drum_radius_m", "static_only"),
}
"""Options of `identify` that come in one record, [measurement] or the request of any fit."""


def test_refusals_only_become_fewer():
    """A reason for which a work, or options of it, are refused counts once, for however many kinds it holds."""
    refused = {(work, why) for work, entry in works.WORKS.items() for why in entry.refused.values()}
    refused |= {(w, why) for w, entry in works.WORKS.items() for of in entry.options.values() for why in of.values()}
    assert len(refused) <= MOST_REFUSED


REFUSED = [(COMMANDS[work], kind, why) for work in COMMANDS for kind, why in works.WORKS[work].refused.items()]
REFUSED += [
    (OPTIONS[work, name], kind, reason)
    for work in works.WORKS
    for name, why in works.WORKS[work].options.items()
    if (work, name) in OPTIONS
    for kind, reason in why.items()
]


@pytest.mark.parametrize(("command", "kind", "why"), REFUSED)
def test_what_is_refused_says_why_and_writes_nothing(files, tmp_path, monkeypatch, capsys, command, kind, why):
    monkeypatch.chdir(tmp_path)
    rig = next(name for name, each in RIGS.items() if each is kind)
    assert run([command[0], str(files[rig]), *command[1:]]) == 2
    assert why in capsys.readouterr().err
    assert not any(tmp_path.iterdir())


def test_options_of_python_are_refused_with_the_same_reasons(files):
    joint = tf.load_scenario(files["loop"])
    with pytest.raises(InputError, match="no compensator of this scenario; linear, stretch, static,"):
        tf.design(joint, compensators=tf.COMPENSATORS)
    with pytest.raises(InputError, match="must include linear and inverse, linear is missing"):
        tf.design(joint, compensators=("static", "inverse"))
    with pytest.raises(InputError, match="give one kind at a time"):
        tf.export_c(tf.load_scenario(files["tension"]), further=(joint,))


class Cautious(tf.Compensator):
    """Exact inverse for a fifth less friction: one class for every kind of scenario."""

    kinds = tuple(Kind)
    name = "cautious"
    label = "inverse for less friction"

    def profile(self, problem, *, progress=None):
        return problem.inverse_of(with_numbers(problem.system, {"mu": 0.8}))


@pytest.mark.compiler
@pytest.mark.parametrize("rig", ["tension", "loop", "finger"])
def test_one_class_is_a_compensator_of_every_kind(files, rig):
    """Less friction in the design costs more than none of the exact inverse's error, and less than no compensation."""
    problem = problem_of(tf.load_scenario(files[rig]))
    plain = {"tension": "none"}.get(rig, "linear")
    exact, bare = (compensator_of(problem, name) for name in ("inverse", plain))
    errors = [problem.score(problem.answer(each)).rmse for each in (exact, Cautious(), bare)]
    assert 2 * errors[0] < errors[1] < 0.6 * errors[2]


ROOT = Path(works.__file__).parent
SOURCES = {str(path.relative_to(ROOT)): path.read_text(encoding="utf-8") for path in ROOT.rglob("*.py")}

LOOKED_UP = {
    "works.py",  # the one table
    "scenario/kind.py",
    "compensators/every.py",  # compensators state the kinds that they are for
    "compensators/motors/task.py",  # a problem is of its scenario's kind
}
"""Files that may look something up by the kind of a scenario."""


def test_a_kind_is_asked_for_in_the_one_table_alone():
    classes = r"(Any)?(Joint|Finger|Motor)?(Scenario|Problem|Task|Design|Compensator)"
    asking = re.compile(
        rf"isinstance\([^)]*\b{classes}\b|(?<!compensator\.)\b(scenario|task|problem|posed|design|loaded)\.kind\b|"
        r"\bKind\.(TENSION|JOINT|FINGER):"
    )
    asked = {file for file, text in SOURCES.items() if asking.search(text)}
    assert asked - LOOKED_UP == set()


def test_a_function_of_the_table_stands_in_the_room_that_asks_for_it_or_below():
    """Names in the table are no way around the layers."""
    contract = tomllib.loads((ROOT.parent.resolve().parent / "pyproject.toml").read_text(encoding="utf-8"))
    contracts = contract["tool"]["importlinter"]["contracts"]
    [rooms] = [each["layers"] for each in contracts if each.get("containers") == ["tendonff.compensator"]]
    row = {room: k for k, line in enumerate(rooms) for room in line.split(" | ")}
    asked = 0
    for file, text in SOURCES.items():
        own = row[file.split("/")[0].removesuffix(".py")] if file != "__init__.py" else 0
        for work in re.findall(r'function_of\("(\w+)"', text):
            asked += 1
            assert all(row[named.split(".")[0]] >= own for named in works.WORKS[work].by.values()), (file, work)
    assert asked > len(works.WORKS) / 2


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16"])
def test_a_mark_of_the_encoding_changes_nothing(files, tmp_path, encoding):
    for rig in ("tension", "loop", "finger"):
        text = files[rig].read_text(encoding="utf-8")
        (tmp_path / "s.toml").write_text(text, encoding=encoding)
        assert tf.load_scenario(tmp_path / "s.toml").kind is RIGS[rig]


@pytest.mark.parametrize("work", ["design", "simulate", "compare", "table"])
def test_a_key_of_thousands_of_parts_is_refused_at_once(tmp_path, capsys, work):
    (tmp_path / "deep.toml").write_text("joints" + ".a" * 20_000 + " = 1\n", encoding="utf-8")
    more = ["--force", "f.csv", "--out", str(tmp_path / "o.csv")] if work == "simulate" else []
    assert run([work, str(tmp_path / "deep.toml"), *more]) == 2
    assert "more than 50 parts" in capsys.readouterr().err
