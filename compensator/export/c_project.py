"""`tendonff export-c`: a folder of C99 that needs nothing but a compiler."""

import json
import math
import re
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from importlib.metadata import version
from importlib.resources import files
from pathlib import Path

import jinja2
import numpy as np

from tendonff.compensator.export.golden import golden_vectors
from tendonff.compensator.files.reading import InputError
from tendonff.compensator.files.writing import write_text
from tendonff.compensator.scenario.sampling import Reference, largest_tension, sample_reference
from tendonff.compensator.scenario.scenario import Scenario, scenario_hash
from tendonff.compensator.tables.build import BuiltTable
from tendonff.compensator.tables.index import share_index
from tendonff.compensator.tables.run import covered_range, scenario_table
from tendonff.compensator.tables.table import FloatArray, Table
from tendonff.models.capstan import Branch, CapstanLaw
from tendonff.models.chain import Chain
from tendonff.models.fidelity import Level
from tendonff.ocp.codegen.precision import Precision
from tendonff.ocp.codegen.printer import literal
from tendonff.ocp.step.target import controller_limits, inverse_code, plant_code
from tendonff.ocp.tracking.limits import ForceLimits
from tendonff.ocp.tracking.track import track

SOURCES = ("limits", "inverse", "capstan", "table", "profile", "plant")
_HEADERS = ("types", "limits", "inverse", "capstan", "table_data", "table", "profile", "plant")
_MODULES = ("inverse", "capstan", "table", "profile", "plant")
_KEYWORDS = frozenset(
    re.findall(
        r"\w+",
        """
        auto break case char const continue default do double else enum extern float for goto if inline int
        long register restrict return short signed sizeof static struct switch typedef union unsigned void
        volatile while main nan class new delete this template public private try catch throw bool true false
        """,
    )
)
_TEMPLATES = jinja2.Environment(  # noqa: S701 - C has no markup to escape
    loader=jinja2.PackageLoader("tendonff.compensator.export", "templates/c"),
    undefined=jinja2.StrictUndefined,
    keep_trailing_newline=True,
    trim_blocks=True,
    lstrip_blocks=True,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Exported:
    """What an export holds, before it is written.

    Parameters
    ----------
    files : dict of str to str
        Text by file name.
    reference : Reference
    built : BuiltTable
    profile_N : ndarray, shape (n,)
        The profile that is played [N].
    """

    files: dict[str, str]
    reference: Reference
    built: BuiltTable
    profile_N: FloatArray


def check_prefix(prefix: str) -> str:
    """A prefix that every C and C++ compiler takes, or an error that says what is wrong.

    Parameters
    ----------
    prefix : str
    """
    good = prefix.isascii() and prefix.isidentifier() and not prefix.startswith("_") and len(prefix) <= 24
    if not good or prefix.endswith("_") or "__" in prefix or prefix.lower() in _KEYWORDS:
        raise InputError(
            f'--prefix must be a C identifier of at most 24 letters, digits and single underscores, got "{prefix}"; '
            'the default is "tff"'
        )
    return prefix


def optimal_profile(scenario: Scenario, chain: Chain, reference: Reference) -> FloatArray:
    """The optimal-control answer for the scenario's reference, shape (n,) [N].

    Parameters
    ----------
    scenario : Scenario
    chain : Chain
    reference : Reference
    """
    limits = ForceLimits.of(scenario.transmission.actuator)
    start = reference.initial_tension_N
    return track(chain, reference.tension_N, reference.step_s, limits, initial_tension_N=start).force_N


def export_project(
    scenario: Scenario,
    *,
    precision: Precision = Precision.DOUBLE,
    prefix: str = "tff",
    level: Level | None = None,
    profile_N: FloatArray | None = None,
) -> Exported:
    """Print the whole folder.

    Parameters
    ----------
    scenario : Scenario
    precision : Precision, optional
        Real type of all arithmetic.
    prefix : str, optional
        Prefix of every C name and file.
    level : Level, optional
        Fidelity level of inverse, table and plant; default: the scenario's own.
    profile_N : ndarray, optional
        Profile to play [N]; default: the optimal one.

    Raises
    ------
    InputError
        If the prefix is no C identifier or the reference cannot be delivered.
    SolveError
        If the profile cannot be found.
    """
    check_prefix(prefix)
    level = level or scenario.run.level
    reference = sample_reference(scenario)
    chain = Chain.of(scenario.transmission, level)
    built = scenario_table(scenario, reference, level=level)
    profile = optimal_profile(scenario, chain, reference) if profile_N is None else profile_N
    context = _context(scenario, level, precision, prefix, reference, built, profile)
    golden = golden_vectors(scenario, chain, built.table, reference, precision)
    code = {
        "inverse": inverse_code(chain, scenario.run.step_s, f"{prefix}_inverse", precision),
        "plant": plant_code(chain, scenario.run.step_s, f"{prefix}_chain", precision),
    }
    texts: dict[str, str] = {}
    for name in _HEADERS:
        texts[f"{prefix}_{name}.h"] = _render(f"{name}.h.j2", context)
    for name in SOURCES:
        parts = asdict(code[name]) if name in code else {}
        texts[f"{prefix}_{name}.c"] = _render(f"{name}.c.j2", context | parts)
    texts["self_test.c"] = _render("self_test.c.j2", context | {"golden": golden, "stride": golden.stride})
    for name in ("example_main.c", "Makefile", "CMakeLists.txt", "README.md"):
        texts[name] = _render(f"{name}.j2", context)
    texts["design.json"] = _design_json(scenario, level, precision, prefix, built, profile)
    return Exported(files=texts, reference=reference, built=built, profile_N=profile)


def write_project(exported: Exported, folder: Path) -> None:
    """Write every file of an export.

    Parameters
    ----------
    exported : Exported
    folder : Path
    """
    for name, text in exported.files.items():
        write_text(folder / name, text)


def table_header(scenario: Scenario, built: BuiltTable, level: Level, prefix: str = "tff") -> str:
    """The C header of a table alone, in double.

    Parameters
    ----------
    scenario : Scenario
    built : BuiltTable
    level : Level
    prefix : str, optional
    """
    context = _naming(scenario, level, Precision.DOUBLE, prefix) | _table_context(built, Precision.DOUBLE)
    return _render("table_data.h.j2", context)


def _render(template: str, context: dict[str, object]) -> str:
    return _TEMPLATES.get_template(template).render(context)


def _naming(scenario: Scenario, level: Level, precision: Precision, prefix: str) -> dict[str, object]:
    def number(value: float) -> str:
        return literal(max(-1e30, min(float(value), 1e30)), precision)

    def rows(table: Iterable[Iterable[float]]) -> str:
        return ",\n".join(_wrapped([number(v) for v in row]) for row in table)

    def exact_rows(values: Iterable[float]) -> str:
        return _wrapped([literal(float(v), Precision.DOUBLE) for v in values])

    def integers(values: Iterable[int]) -> str:
        return _wrapped([f"{v}u" for v in values])

    name = " ".join(scenario.name.replace("*/", "* /").split())
    lines = (
        f'Scenario "{name}", hash {scenario_hash(scenario)}, level {level}.',
        f"Written by tendonff {version('tendonff')} export-c --precision {precision} --prefix {prefix}.",
    )
    return {
        "prefix": prefix,
        "guard": prefix.upper(),
        "real": "float" if precision is Precision.FLOAT else "double",
        "num": number,
        "rows": rows,
        "exact_rows": exact_rows,
        "integers": integers,
        "provenance": "\n".join(f" * {line}" for line in lines),
        "level": level,
        "version": version("tendonff"),
        "scenario_name": name,
        "scenario_hash": scenario_hash(scenario),
    }


def _wrapped(items: list[str]) -> str:
    """Comma-separated numbers in lines of at most 116 characters."""
    lines, line = [], ""
    for item in items:
        if line and len(line) + len(item) + 2 > 112:
            lines.append(line)
            line = ""
        line += ("" if not line else ", ") + item
    return ",\n".join(f"    {text}" for text in [*lines, line])


def _table_context(built: BuiltTable, precision: Precision) -> dict[str, object]:
    table = built.table
    notes = (
        f"Interpolation error at most {built.error_N:.3g} N (bound {built.bound_N:.3g} N); made for a reference that",
        f"moves at {built.rate_N_per_s:.4g} N/s. Bilinear in the reference and in the share.",
    )
    return {
        "table": table,
        "pull_ratios": table.ratio(Branch.PULL),
        "release_ratios": table.ratio(Branch.RELEASE),
        "pull_index": share_index(table.pull.share, precision),
        "release_index": share_index(table.release.share, precision),
        "table_notes": "\n".join(f" * {note}" for note in notes),
    }


def _context(
    scenario: Scenario,
    level: Level,
    precision: Precision,
    prefix: str,
    reference: Reference,
    built: BuiltTable,
    profile: FloatArray,
) -> dict[str, object]:
    transmission, step = scenario.transmission, scenario.run.step_s
    actuator, law = transmission.actuator, CapstanLaw.of(transmission)
    chain = Chain.of(transmission, level)
    count, reals, size = chain.count, chain.layout.size, 4 if precision is Precision.FLOAT else 8
    low, _ = covered_range(scenario, reference)
    output = max(size, 4) + 8
    past = 2 * count + 2 if precision is Precision.FLOAT else 0
    state = {
        "inverse": _padded(output + (2 * reals + 2 + past) * size + 4, size),
        "capstan": output + 2 * size,
        "table": _padded(output + 4 * size + 4, size),
        "plant": _padded((2 * reals + 2) * size + 16, size),
        "profile": _padded(output + 4, size),
    }
    return (
        _naming(scenario, level, precision, prefix)
        | _table_context(built, precision)
        | {
            "title": f"{prefix}: feedforward force for a tendon",
            "count": count,
            "reals": reals,
            "step": step,
            "step_s": repr(step),
            "reference_min": min(low, 0.01 * float(np.min(reference.tension_N))),
            "reference_max": max(largest_tension(transmission), float(np.max(reference.tension_N))),
            "force_min": actuator.force_min_N,
            "force_max": actuator.force_max_N,
            "change_max": actuator.force_rate_max_N_per_s * step,
            "pull_ratio": math.exp(law.pull_exponent),
            "release_ratio": math.exp(-law.release_exponent),
            "adhesion": law.adhesion_N,
            "profile": profile,
            "modules": _MODULES,
            "sources": SOURCES,
            "initial": reference.initial_tension_N,
            "amplitude": 0.25 * min(reference.initial_tension_N, max(reference.range_N, 1e-3)),
            "example_rows": max(20, min(4000, round(2.0 / step))),
            "tolerance": "0.02" if precision is Precision.FLOAT else "1e-9",
            "limits": controller_limits(precision),
            "state_bytes": state,
            "table_bytes": _table_bytes(built.table, precision),
            "profile_bytes": size * len(profile),
            "measured": measured(precision),
        }
    )


def _padded(size: int, alignment: int) -> int:
    return -(-size // alignment) * alignment


def _table_bytes(table: Table, precision: Precision) -> int:
    """Constant data of a table: forces, shares and the index of the shares."""
    size, total = 4 if precision is Precision.FLOAT else 8, 0
    for branch in Branch:
        share = table.branch(branch).share
        index = len(share_index(share, precision).cell) * (1 if len(share) <= 256 else 2)
        total += size * (table.branch(branch).force_N.size + len(share)) + index
    return total


def measured(precision: Precision) -> dict[str, object]:
    """Instructions, code and stack of the example, as `tests/target` measured them.

    Parameters
    ----------
    precision : Precision
    """
    text = files("tendonff.compensator.export").joinpath("measured.json").read_text(encoding="utf-8")
    content: dict[str, dict[str, object]] = json.loads(text)
    return content[precision]


def _design_json(
    scenario: Scenario, level: Level, precision: Precision, prefix: str, built: BuiltTable, profile: FloatArray
) -> str:
    transmission = scenario.transmission
    law = CapstanLaw.of(transmission)
    content = {
        "schema": 1,
        "scenario": scenario.name,
        "scenario_hash": scenario_hash(scenario),
        "tendonff": version("tendonff"),
        "level": level,
        "precision": precision,
        "prefix": prefix,
        "step_s": scenario.run.step_s,
        "parameters": asdict(transmission),
        "capstan": {
            "pull_ratio": math.exp(law.pull_exponent),
            "release_ratio": math.exp(-law.release_exponent),
            "adhesion_N": law.adhesion_N,
        },
        "table": {
            "nodes": built.table.nodes,
            "bound_N": built.bound_N,
            "interpolation_error_N": built.error_N,
            "rate_N_per_s": built.rate_N_per_s,
        },
        "profile": {"samples": len(profile), "least_N": float(np.min(profile)), "most_N": float(np.max(profile))},
        "files": {
            f"{prefix}_{name}": text
            for name, text in {
                "inverse": "exact inverse of the chain",
                "capstan": "static capstan law",
                "table": "compensation table",
                "profile": "optimal profile",
                "plant": "the chain itself",
            }.items()
        },
    }
    return json.dumps(content, indent=2, allow_nan=False, ensure_ascii=False) + "\n"
