"""`tendonff export-c`: a folder of C99 that needs nothing but a compiler."""

import json
import math
import os
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from importlib.resources import files
from types import MappingProxyType

import jinja2
import numpy as np

from tendonff._version import __version__
from tendonff.compensator.compensators.base import CModule, FloatArray, Problem
from tendonff.compensator.compensators.lookup_table import LookupTable
from tendonff.compensator.compensators.motion import with_motion
from tendonff.compensator.compensators.registry import COMPENSATORS, compensator
from tendonff.compensator.compensators.table import table_of, table_range
from tendonff.compensator.compensators.table_build import BuiltTable
from tendonff.compensator.export.golden import golden_vectors
from tendonff.compensator.export.table_index import share_index
from tendonff.compensator.files.reading import InputError
from tendonff.compensator.files.writing import atomic_directory, write_text
from tendonff.compensator.scenario.sampling import largest_tension
from tendonff.compensator.scenario.scenario import Scenario, scenario_hash
from tendonff.models.capstan import Branch, CapstanLaw
from tendonff.models.drive import Drive
from tendonff.models.fidelity import Level
from tendonff.ocp.codegen.precision import Precision
from tendonff.ocp.codegen.printer import literal
from tendonff.ocp.step.target import controller_limits, inverse_code, plant_code

PLANT = CModule(name="plant", content="the chain itself")
"""What is exported beside the compensators, for tests."""

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
    built : BuiltTable
    profile_N : ndarray, shape (n,)
        The profile that is played back [N].
    warnings : tuple of str
        What the user should know.
    """

    files: dict[str, str]
    built: BuiltTable
    profile_N: FloatArray
    warnings: tuple[str, ...]

    def write(self, folder: str | os.PathLike[str]) -> None:
        """Write every file, all or nothing.

        Parameters
        ----------
        folder : str or path
            Made where it is missing.
        """
        with atomic_directory(folder) as partial:
            for name, text in self.files.items():
                write_text(partial / name, text)


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


def c_modules() -> tuple[CModule, ...]:
    """Modules of the compensators that can be exported, in the order of the registry, and of the plant."""
    return (*(c.c_module for c in COMPENSATORS if c.c_module is not None), PLANT)


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
        If there is no profile that may be exported; the message says why.
    """
    check_prefix(prefix)
    if scenario.transmission.actuator.drive is Drive.POSITION and precision is Precision.FLOAT:
        raise InputError(
            f'{scenario.source.name} [actuator]: drive = "position" is exported in double only: the command is a small '
            "difference of positions; use --precision double"
        )
    problem = Problem.of(scenario, level=level)
    warnings = problem.reference.warnings
    if profile_N is None:
        profile = with_motion(problem, "optimal", compensator("optimal").profile(problem).require())
        played = profile.force_N if profile.command_m is None else profile.command_m
        profile_N, warnings = played, (*warnings, *profile.warnings)
    if problem.reference.periodic:
        profile_N = profile_N[:-1]  # its last row is the first of the next period
    built = table_of(problem)
    further = {
        **_table_context(built, precision),
        "table_bytes": _table_bytes(built.table, precision),
        "profile": profile_N,
        "profile_loops": problem.reference.periodic,
        "profile_bytes": (4 if precision is Precision.FLOAT else 8) * len(profile_N),
        "golden": golden_vectors(problem, built.table, precision),
        "measured": measured(precision),
    }
    texts = c_sources(scenario, problem, c_modules(), precision, prefix, further)
    context = _context(scenario, problem, precision, prefix) | further
    for name in ("self_test.c", "example_main.c", "Makefile", "CMakeLists.txt", "README.md"):
        texts[name] = _render(f"{name}.j2", context)
    texts["design.json"] = _design_json(scenario, problem.level, precision, prefix, built, profile_N)
    return Exported(files=texts, built=built, profile_N=profile_N, warnings=warnings)


def _servo(problem: Problem) -> dict[str, float] | None:
    """Give of the servo, and travel at rest, per newton; None for a force drive."""
    stiffness = problem.transmission.actuator.servo_stiffness_N_per_m
    if stiffness is None:
        return None
    return {"give_m_per_N": 1 / stiffness, "rest_m_per_N": problem.chain.rest_state(1.0).near_position_m}


def c_sources(
    scenario: Scenario,
    problem: Problem,
    modules: Sequence[CModule],
    precision: Precision,
    prefix: str,
    further: Mapping[str, object] = MappingProxyType({}),
) -> dict[str, str]:
    """Sources and headers of some modules and of what they share, by file name.

    Parameters
    ----------
    scenario : Scenario
    problem : Problem
    modules : sequence of CModule
    precision : Precision
    prefix : str
    further : mapping, optional
        What the templates of these modules need beyond scenario and level: table, profile.
    """
    chain, step = problem.chain, problem.reference.step_s
    context = _context(scenario, problem, precision, prefix) | dict(further)
    names = [module.name for module in modules]
    code: dict[str, dict[str, object]] = {}
    if "inverse" in names:
        code["inverse"] = asdict(inverse_code(chain, step, f"{prefix}_inverse", precision))
    if "plant" in names:
        code["plant"] = asdict(plant_code(chain, step, f"{prefix}_chain", precision))
    headers = ("types", "limits", *(header for module in modules for header in (*module.headers, module.name)))
    texts = {f"{prefix}_{name}.h": _render(f"{name}.h.j2", context) for name in headers}
    for name in ("limits", *names):
        texts[f"{prefix}_{name}.c"] = _render(f"{name}.c.j2", context | code.get(name, {}))
    return texts


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
        f"Written by tendonff {__version__} export-c --precision {precision} --prefix {prefix}.",
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
        "version": __version__,
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


def _context(scenario: Scenario, problem: Problem, precision: Precision, prefix: str) -> dict[str, object]:
    """What every template may use."""
    transmission, reference, step = problem.transmission, problem.reference, problem.reference.step_s
    actuator, law = transmission.actuator, CapstanLaw.of(transmission)
    chain = problem.chain
    count, reals, size = chain.count, chain.layout.size, 4 if precision is Precision.FLOAT else 8
    low, _ = table_range(problem)
    modules = c_modules()
    output = max(size, 4) + 8
    servo = _servo(problem)
    past = 2 * count + 2 if precision is Precision.FLOAT else 0
    state = {
        "inverse": _padded(output + (2 * reals + (2 if servo is None else 3) + past) * size + 4, size),
        "capstan": output + 2 * size,
        "table": _padded(output + 4 * size + 4, size),
        "plant": _padded((2 * reals + 2) * size + 16, size),
        "profile": _padded(output + 4, size),
    }
    return _naming(scenario, problem.level, precision, prefix) | {
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
        "modules": modules,
        "followers": [m for m in modules if not m.plays_back and m != PLANT],  # of a reference
        "initial": reference.initial_tension_N,
        "amplitude": 0.25 * min(reference.initial_tension_N, max(reference.range_N, 1e-3)),
        "example_rows": max(20, min(4000, round(2.0 / step))),
        "tolerance": "0.02" if precision is Precision.FLOAT else "1e-9",
        "limits": controller_limits(precision),
        "state_bytes": state,
        "servo": servo,
    }


def _padded(size: int, alignment: int) -> int:
    return -(-size // alignment) * alignment


def _table_bytes(table: LookupTable, precision: Precision) -> int:
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
        "tendonff": __version__,
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
        "files": {f"{prefix}_{module.name}": module.content for module in c_modules()},
    }
    return json.dumps(content, indent=2, allow_nan=False, ensure_ascii=False) + "\n"
