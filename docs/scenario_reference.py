"""The reference of scenario files, made from the classes behind their tables: key, unit, default and meaning.

`python docs/scenario_reference.py` writes `docs/scenario_keys.csv`, which code hosts show as a table.
"""

import csv
import dataclasses
import inspect
import io
import pathlib
import re
from collections.abc import Iterator, Mapping
from enum import StrEnum

import griffe

from tendonff.compensator.scenario.driven.observer_table import ObserverTable
from tendonff.compensator.scenario.driven.reference import JointCsv, JointSine, JointWaypoints
from tendonff.compensator.scenario.driven.settings import JointAdaptation
from tendonff.compensator.scenario.experiment import Experiment
from tendonff.compensator.scenario.joints import ConstantJoint, CsvJoint, SineJoint, WaypointJoint
from tendonff.compensator.scenario.measurement import Measurement
from tendonff.compensator.scenario.reference import CsvReference, SineReference, WaypointReference
from tendonff.compensator.scenario.settings import Adaptation, Compare, Feedback, Run, Stream
from tendonff.models.joint.parameters import Arm, DrivenJoint, JointDrive, JointTendon
from tendonff.models.parameters import Actuator, Friction, Load, Path, Tendon
from tendonff.models.parameters.drive import Motor, Rope
from tendonff.models.parameters.uncertainty import Uncertainty
from tendonff.models.path import Section
from tendonff.ocp.tracking.options import TrackOptions

MARKER = "<!-- tables of a scenario -->"


@dataclasses.dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """A table of the file.

    Attributes
    ----------
    title : str
        How it is written in the file.
    classes : tuple of type
        Whose fields are its keys; a key that several have is shown once.
    readers : str
        Commands that read it.
    note : str
        What the classes do not say.
    unwritten : tuple of str
        Fields that are no keys of it.
    filled : mapping of str to str
        Values of required fields that the reader fills in.
    """

    title: str
    classes: tuple[type, ...]
    readers: str
    note: str = ""
    unwritten: tuple[str, ...] = ()
    filled: Mapping[str, str] = dataclasses.field(default_factory=dict)


EVERY = "every command"
TABLES = (
    Table(
        title="[path]",
        classes=(Path,),
        readers=EVERY,
        note="`total_angle_rad` is left out where `[[path.sections]]` are given: it is their sum.",
        unwritten=("sections",),
    ),
    Table(
        title="[[path.sections]]",
        classes=(Section,),
        readers=EVERY,
        note="One for each arc or straight, from the actuator to the output.",
    ),
    Table(
        title="[tendon]",
        classes=(Tendon,),
        readers=EVERY,
        filled={"relaxation_time_s": "needed with `relaxing_stiffness_N_per_m` > 0"},
    ),
    Table(
        title="[tendon], of a rope",
        classes=(Rope,),
        readers=EVERY,
        note="In place of `stiffness_N_per_m`, and of `mass_kg` where the density is given.",
    ),
    Table(
        title="[friction]",
        classes=(Friction,),
        readers=EVERY,
        filled={"mu_static": "`mu_dynamic`", "stribeck_velocity_m_per_s": "needed with `mu_static`"},
    ),
    Table(title="[actuator]", classes=(Actuator,), readers=EVERY, unwritten=("motor",)),
    Table(
        title="[actuator.motor]",
        classes=(Motor,),
        readers=EVERY,
        note="In place of `mass_kg`, `force_max_N` and `speed_max_m_per_s` of `[actuator]`.",
    ),
    Table(
        title="[load]",
        classes=(Load,),
        readers=EVERY,
        note='`kind = "spring"` (default) or `"joint"`, which needs neither mass nor spring.',
    ),
    Table(
        title='[reference], kind = "sine"', classes=(SineReference,), readers="all but `identify`, `experiment`, `path`"
    ),
    Table(title='[reference], kind = "waypoints"', classes=(WaypointReference,), readers="as above"),
    Table(title='[reference], kind = "csv"', classes=(CsvReference,), readers="as above"),
    Table(
        title="[joints.NAME]",
        classes=(ConstantJoint, SineJoint, WaypointJoint, CsvJoint),
        readers="all that follow a reference",
        note='`kind = "constant"`, `"sine"`, `"waypoints"` or `"csv"`, each with its own keys of these.',
    ),
    Table(title="[run]", classes=(Run,), readers=EVERY),
    Table(
        title="[robust]",
        classes=(Uncertainty,),
        readers="`design`, `compare`, `table`, `sweep`, `explore`",
        note="`[robust.spread]` takes the dotted key of any number: see above.",
        unwritten=("spread",),
    ),
    Table(title="[optimal]", classes=(TrackOptions,), readers="`design`, and what designs within another command"),
    Table(title="[stream]", classes=(Stream,), readers="`design`, `export-c`, `tf.Runtime`"),
    Table(title="[compare]", classes=(Compare,), readers="`compare`"),
    Table(title="[adaptation]", classes=(Adaptation,), readers="`adapt`, `export-c`, `export-fmu`"),
    Table(
        title="[feedback]",
        classes=(Feedback,),
        readers="`design`, `export-c`, `tf.Runtime`",
        note="Gains follow from the mechanism, its uncertainty in `[robust]`, and these keys.",
    ),
    Table(title="[experiment]", classes=(Experiment,), readers="`experiment`"),
    Table(title="[measurement]", classes=(Measurement,), readers="`identify`, `experiment --measured`"),
    Table(
        title='[joints.NAME], kind = "driven"',
        classes=(DrivenJoint,),
        readers="`design`, `simulate` of a joint",
    ),
    Table(
        title="[[tendons]]",
        classes=(JointTendon, Arm),
        readers="as above",
        note="Two of them; `[tendons.path]`, `[tendons.tendon]` and `[tendons.friction]` after one replace the common "
        "tables.",
        unwritten=("path", "tendon", "friction", "arms", "joint"),
    ),
    Table(title="[drive]", classes=(JointDrive,), readers="as above"),
    Table(
        title="[observer] of a joint",
        classes=(ObserverTable,),
        readers="`tf.Observer`",
        note="Written by `identify` where something else loads the joint.",
    ),
    Table(
        title="[adaptation] of a joint",
        classes=(JointAdaptation,),
        readers="`adapt`, `export-c`, `tf.Runtime`",
    ),
    Table(
        title="[reference] of a joint",
        classes=(JointSine, JointWaypoints, JointCsv),
        readers="as above",
        note='`kind = "sine"`, `"waypoints"` or `"csv"`, each with its own keys of these.',
    ),
)


def on_page_markdown(markdown: str, **_: object) -> str:
    """Replace the marker of a page by the tables.

    Parameters
    ----------
    markdown : str
    """
    return markdown.replace(MARKER, "\n".join(map(section, TABLES))) if MARKER in markdown else markdown


def section(table: Table) -> str:
    """A heading, who reads the table, and its keys.

    Parameters
    ----------
    table : Table
    """
    lines = [f"### `{table.title}`", "", f"Read by {table.readers}. {table.note}".strip(), ""]
    lines += ["| key, unit | meaning | default |", "|---|---|---|"]
    for key, unit, default, meaning in rows(table):
        broken = key.replace("_", "_<wbr>")  # a long key may take two lines on a phone
        lines.append(f"| <code>{broken}</code>{f'<br>{unit}' if unit else ''} | {meaning} | {default} |")
    return "\n".join([*lines, ""])


def rows(table: Table) -> Iterator[tuple[str, str, str, str]]:
    """Key, unit, default and meaning, in the order of the classes.

    Parameters
    ----------
    table : Table
    """
    seen: set[str] = set(table.unwritten)
    for cls in table.classes:
        meanings = described(cls)
        for field in dataclasses.fields(cls):
            if field.name in seen:
                continue
            seen.add(field.name)
            meaning = meanings[field.name]
            unit, text = split(meaning)
            if list(meanings.values()).count(meaning) > 1 and unit and (own := unit_of(field.name)) and own != unit:
                unit, text = own, " ".join(meaning.split())
            yield field.name, unit, table.filled.get(field.name) or shown_default(field), text


def described(cls: type) -> dict[str, str]:
    """Docstrings of a record's fields, its bases' included; several fields may share one.

    Parameters
    ----------
    cls : type
    """
    found: dict[str, str] = {}
    for each in reversed(cls.__mro__):
        for part in griffe.Docstring(inspect.cleandoc(each.__doc__ or "")).parse("numpy", warnings=False):
            if part.kind.value in ("parameters", "attributes"):
                texts = {name.strip(): entry.description for entry in part.value for name in entry.name.split(",")}
                found |= {name: text for name, text in texts.items() if not text.startswith("As in `")}
    return found


def as_csv() -> str:
    """All keys as text: table, key, unit, default, meaning."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(("table", "key", "unit", "default", "meaning"))
    writer.writerows((table.title, *row) for table in TABLES for row in rows(table))
    return text.getvalue()


def unit_of(key: str) -> str:
    """Unit at the end of a key, such as N m/rad of stiffness_N_m_per_rad; empty for none."""
    found = _SUFFIX.search(key)
    return "" if found is None else found[0].strip("_").replace("_per_", "/").replace("_", " ")


_SUFFIX = re.compile(r"(_(N|m|s|rad|kg|Pa|Hz|A)\d?)+(_per(_(N|m|s|rad|kg|A)\d?)+)?$")
_UNIT = re.compile(r" ?\[(?!\d+\])([^\[\]]*)\](?!\()")


def split(meaning: str) -> tuple[str, str]:
    """The first unit in brackets, and the text without it, as one line of a table.

    Parameters
    ----------
    meaning : str
    """
    text = " ".join(meaning.split()).replace("|", r"\|")
    found = _UNIT.search(text)
    if found is None:
        return "", text
    return found[1], text[: found.start()] + text[found.end() :]


def shown_default(field: "dataclasses.Field[object]") -> str:
    """The default as a file would have it; empty for none, and for what is left out.

    Parameters
    ----------
    field : Field
    """
    if field.default is dataclasses.MISSING and field.default_factory is dataclasses.MISSING:
        return "required"
    value = field.default
    if value is None or value is dataclasses.MISSING or value == ():
        return ""
    if isinstance(value, StrEnum):
        return f'`"{value.value}"`'
    if isinstance(value, tuple):
        return f"`[{', '.join(_text(each) for each in value)}]`"
    return f"`{_text(value)}`"


def _text(value: object) -> str:
    if isinstance(value, str):
        return f'"{value}"'
    return str(value).lower() if isinstance(value, bool) else f"{value:g}" if isinstance(value, float) else str(value)


if __name__ == "__main__":
    pathlib.Path(__file__).with_name("scenario_keys.csv").write_text(as_csv(), encoding="utf-8")
