"""The text of exported C: templates, their values, and the files rendered from them."""

import json
import math
import re
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import asdict
from importlib.resources import files
from types import MappingProxyType
from typing import Any

import numpy as np

from tendonff._version import __version__
from tendonff.compensator.compensators.base import CModule, Problem
from tendonff.compensator.compensators.lookup_table import LookupTable
from tendonff.compensator.compensators.stream import RE_ENTRY_S, RE_ENTRY_SHARE, SLACK, StreamDesign
from tendonff.compensator.compensators.table import BuiltTable, accepted_range
from tendonff.compensator.compensators.tuning import Certified, certified
from tendonff.compensator.export.adaptive import adaptive_code, bounds_code, tuned_part
from tendonff.compensator.export.joint_jumps import FACTOR as JUMP_FACTOR
from tendonff.compensator.export.joint_jumps import largest_starts_rad
from tendonff.compensator.export.modules import (
    ADAPTIVE,
    ADAPTIVE_MODULES,
    BOUNDS,
    FOLDER_FILES,
    OBSERVER,
    PLANT,
    STREAM,
    accepted_steps,
)
from tendonff.compensator.export.observer import ObserverDesign, observer_code
from tendonff.compensator.export.text.parameters import parameter_context, settable_inverse
from tendonff.compensator.export.text.table_index import share_index
from tendonff.compensator.scenario.scenario import Scenario, scenario_hash
from tendonff.models.capstan import Branch, CapstanLaw
from tendonff.models.capstan.spread_bounds import PLAYS, play_exponents
from tendonff.models.fidelity import Level
from tendonff.models.parameters import Transmission
from tendonff.models.tendon.chain import Chain
from tendonff.models.tendon.friction import equivalent_exponent
from tendonff.ocp.codegen.precision import Precision
from tendonff.ocp.codegen.printer import literal
from tendonff.ocp.codegen.templates import environment
from tendonff.ocp.step.joints import Joints
from tendonff.ocp.step.scheme import BDF2_CARRY, BDF2_WEIGHT
from tendonff.ocp.step.target import chain_code, plant_limits
from tendonff.ocp.step.target_joints import contact_code

# What carries the C into other tools: template, and the module without which there is no such file ("follower": any
# that follows a reference without joint angles), by the path below the exported folder.
_PACKAGES = {
    "{p}_parameters.a2l": ("c/parameters.a2l.j2", ""),
    "zephyr/module.yml": ("packages/zephyr_module.yml.j2", ""),
    "zephyr/CMakeLists.txt": ("packages/zephyr_cmake.txt.j2", ""),
    "zephyr/Kconfig": ("packages/zephyr_kconfig.j2", ""),
    "library.json": ("packages/library.json.j2", ""),
    "library.properties": ("packages/library.properties.j2", ""),
    "structured_text/{p}_capstan.st": ("packages/capstan.st.j2", "capstan"),
    "structured_text/{p}_table.st": ("packages/table.st.j2", "table"),
    "ros2/{p}_controller/package.xml": ("packages/ros2_package.xml.j2", "follower"),
    "ros2/{p}_controller/CMakeLists.txt": ("packages/ros2_cmake.txt.j2", "follower"),
    "ros2/{p}_controller/{p}_controller.xml": ("packages/ros2_plugin.xml.j2", "follower"),
    "ros2/{p}_controller/{p}_controller.cpp": ("packages/ros2_controller.cpp.j2", "follower"),
}
_TEMPLATES = environment("tendonff.compensator.export")
_TEMPLATES.filters["st"] = lambda value: literal(float(value), Precision.DOUBLE)


_DRIVEN = {"episodes": 6, "episode_rows": 100}
"""Of the drive at random in the self test."""


def c_sources(
    scenario: Scenario,
    problem: Problem,
    modules: Sequence[CModule],
    precision: Precision,
    prefix: str,
    further: Mapping[str, Any] = MappingProxyType({}),
) -> dict[str, str]:
    """Sources and headers of some modules and of what they share, by file name.

    The templates of these modules may need further things: table, profile.
    """
    chain, step, actuator = problem.chain, problem.reference.step_s, problem.transmission.actuator
    context = _context(scenario, problem, modules, precision, prefix, further)
    names = [module.name for module in modules]
    code: dict[str, dict[str, object]] = {}
    bounds: Certified | None = further.get("bounds")
    if bounds is None and BOUNDS in modules:
        bounds = certified(problem)
    servo, shared = actuator.servo_stiffness_N_per_m or 0.0, shared_sources(problem, names)
    settings = scenario.adaptation if ADAPTIVE.name in names else None
    inverts = bool({"inverse", ADAPTIVE.name} & set(names))
    forward = chain.with_end_stiffness(servo, chain.far.stiffness_N_per_m)
    if "state" in shared:
        made = chain_code(
            chain,
            step,
            prefix,
            precision,
            inverse=inverts,
            forward=forward if "chain" in shared else None,
            tuned=None if settings is None else tuned_part(problem, settings),
        )
        code["state"] = {
            name: getattr(made, name)
            for name in ("record", "values", "links", "solver", "rest", "contact", "touch", "touch_all")
        }
        code["state"]["count_of_rows"] = made.count
        code["state"]["inverts"] = inverts
        code["state"]["solves"] = "chain" in shared
        if made.inverse is not None:
            code["inversion"] = {"laws": made.inverse.laws, "body": made.inverse.body}
            code["inverse"] = settable_inverse(problem, made.inverse, precision, prefix) | {"kinds": made.kinds}
        if made.plant is not None:
            code["chain"] = asdict(made.plant) | {"tuned": settings is not None}
            code["plant"] = code["observer"] = {"inputs": made.plant.inputs}
        if settings is not None:
            code[ADAPTIVE.name] = adaptive_code(problem, settings, precision, prefix, made)
    if bounds is not None:
        code[BOUNDS.name] = bounds_code(bounds)
    if "observer" in names:
        design: ObserverDesign = further.get("observed") or ObserverDesign(problem=problem)
        code["observer"] = code.get("observer", {}) | observer_code(design)
    inversion = ("inversion",) if inverts else ()
    headers = (
        "types",
        *shared,
        *inversion,
        *(header for module in modules for header in (*module.headers, module.name)),
    )
    texts = {f"{prefix}_{name}.h": _render(f"{name}.h.j2", context | code.get(name, {})) for name in headers}
    for name in (*shared, *names):
        texts[f"{prefix}_{name}.c"] = _render(f"{name}.c.j2", context | code.get(name, {}))
    return texts


def shared_sources(problem: Problem, names: Collection[str]) -> tuple[str, ...]:
    """Sources that modules of these names share, without prefix: parameters, limits, path, state, the forward chain."""
    runs = PLANT.name in names or (OBSERVER.name in names and CapstanLaw.of(problem.transmission).plays is None)
    runs = runs or ADAPTIVE.name in names
    path = ("path",) if problem.chain.moving else ()
    state = ("state",) if runs or {"inverse", STREAM.name} & set(names) else ()
    return ("parameters", "limits", *path, *state, *(("chain",) if runs else ()))


def folder_files(
    scenario: Scenario,
    problem: Problem,
    modules: Sequence[CModule],
    precision: Precision,
    prefix: str,
    further: Mapping[str, Any],
) -> dict[str, str]:
    """Files of an exported folder beside the sources of its modules, by file name; arguments as of `c_sources`."""
    context = _context(scenario, problem, modules, precision, prefix, further)
    found = {name: _TEMPLATES.select_template([f"c/{name}.j2", f"library/{name}.j2"]) for name in FOLDER_FILES}
    return {name: template.render(context) for name, template in found.items()} | _packages(modules, context)


def drive_text(
    scenario: Scenario,
    problem: Problem,
    modules: Sequence[CModule],
    precision: Precision,
    prefix: str,
    further: Mapping[str, Any],
) -> str:
    """Calls of all modules at random, for the self test and for the host; arguments as of `c_sources`."""
    tension, motion, step = problem.reference.tension_N, problem.chain.motion, problem.reference.step_s
    angles = np.zeros((2, 0)) if motion is None else motion.at(np.arange(len(tension), dtype=np.float64) * step)
    low, high = float(tension.min()), float(tension.max())
    values = {
        "drive_low_N": low,
        "drive_span_N": max(high - low, 1e-3 * high),
        "drive_usual_N": float(np.abs(np.diff(tension)).max(initial=0.0)),
        "drive_usual_rad": np.abs(np.diff(angles, axis=0)).max(axis=0),
    }
    return _render("drive.c.j2", _context(scenario, problem, modules, precision, prefix, further) | values | _DRIVEN)


def package_files(
    scenario: Scenario, problem: Problem, modules: Sequence[CModule], precision: Precision, prefix: str
) -> dict[str, str]:
    """Files that carry some modules into other tools, by their path below the exported folder."""
    return _packages(modules, _context(scenario, problem, modules, precision, prefix, {}))


def _packages(modules: Sequence[CModule], context: Mapping[str, Any]) -> dict[str, str]:
    # Structured Text has the law with one dead band.
    there = {"", *(m.name for m in modules if m.name != "capstan" or context["plays"] is None)}
    there |= {"follower"} if context["follower"] else set()
    context = {**context, "follower": "control"} if context["beside"] else context  # what a controller for ROS 2 calls
    prefix = context["prefix"]
    return _written(
        {path.format(p=prefix): text for path, (text, needs) in _PACKAGES.items() if needs in there}, context
    )


def _written(templates: Mapping[str, str], context: Mapping[str, Any]) -> dict[str, str]:
    return {path: _TEMPLATES.get_template(template).render(context) for path, template in templates.items()}


def table_header(scenario: Scenario, built: BuiltTable, level: Level, prefix: str = "tff") -> str:
    """The C header of a table alone, in double."""
    context = _naming(scenario, level, Precision.DOUBLE, prefix) | table_context(built, Precision.DOUBLE)
    return _render("table_data.h.j2", context)


def _render(template: str, context: dict[str, object]) -> str:
    return _TEMPLATES.get_template(f"c/{template}").render(context)


def _naming(scenario: Scenario, level: Level, precision: Precision, prefix: str) -> dict[str, object]:
    def within(precision: Precision) -> Callable[[float], str]:
        return lambda value: literal(max(-1e30, min(float(value), 1e30)), precision)

    def in_lines(text: Callable[[Any], str]) -> Callable[[Iterable[Any]], str]:
        return lambda values: _wrapped([text(v) for v in values])

    def exact_real(value: float) -> str:
        if math.isfinite(value):
            return literal(float(value), precision)
        return f"({prefix}_real)NAN" if math.isnan(value) else f"{'-' if value < 0 else ''}({prefix}_real)INFINITY"

    name = harmless(scenario.name)
    lines = (
        f'Scenario "{name}", hash {scenario_hash(scenario)}, level {level}.',
        f"Written by tendonff {__version__} export-c --precision {precision} --prefix {prefix}.",
        "The licence of tendonff does not cover what it writes: this file is yours.",
    )
    return {
        "prefix": prefix,
        "guard": prefix.upper(),
        "real": "float" if precision is Precision.FLOAT else "double",
        "num": within(precision),
        "exact": within(Precision.DOUBLE),
        "exact_real": exact_real,
        "rows": lambda table: ",\n".join(map(in_lines(within(precision)), table)),
        "exact_rows": in_lines(lambda v: "(double)NAN" if math.isnan(v) else literal(float(v), Precision.DOUBLE)),
        "any_rows": in_lines(exact_real),
        "integers": in_lines("{}u".format),
        "provenance": "\n".join(f" * {line}" for line in lines),
        "level": level,
        "version": __version__,
        "scenario_name": name,
        "scenario_hash": scenario_hash(scenario),
    }


def provenance_of(scenario: Scenario, level: Level, precision: Precision, prefix: str) -> str:
    """Lines of the comment on top of every file."""
    return str(_naming(scenario, level, precision, prefix)["provenance"])


def harmless(name: str) -> str:
    """A name in one line that neither opens nor ends a comment of C or of Structured Text, nor hides characters."""
    shown = "".join(character if character.isprintable() else " " for character in name)
    apart = re.sub(r"(?<=[/(])(?=\*)|(?<=\*)(?=[/)])|(?<=\?)(?=\?)", " ", shown)
    return " ".join(apart.split())


def _wrapped(items: list[str]) -> str:
    """Comma-separated numbers in lines of at most 116 characters."""
    lines, line = [], ""
    for item in items:
        if line and len(line) + len(item) + 2 > 112:
            lines.append(line)
            line = ""
        line += ("" if not line else ", ") + item
    return ",\n".join(f"    {text}" for text in [*lines, line])


def table_context(built: BuiltTable, precision: Precision) -> dict[str, object]:
    """Values for the templates of a table."""
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
    problem: Problem,
    modules: Sequence[CModule],
    precision: Precision,
    prefix: str,
    further: Mapping[str, Any],
) -> dict[str, object]:
    """Values for every template, and the given ones."""
    transmission, reference, step = problem.transmission, problem.reference, problem.reference.step_s
    actuator, law = transmission.actuator, CapstanLaw.of(transmission)
    chain = problem.chain
    count, reals, size = chain.count, chain.layout.size, 4 if precision is Precision.FLOAT else 8
    accepted = accepted_range(problem)
    design: StreamDesign | None = further.get("stream")
    ramp = None if design is None else design.ramp
    names = [module.name for module in modules]
    others = (STREAM, PLANT, OBSERVER, *ADAPTIVE_MODULES)
    followers = [m for m in modules if not m.plays_back and m not in others]  # of a reference, without delay
    output = max(size, 4) + 8 + 3 * size
    entry = _padded(5 * size + 4, size)
    past = 2 * count + 3 if precision is Precision.FLOAT else 0
    joints = Joints.of(chain) if chain.moving else None  # else all masses are alike and nothing moves
    moving = joints is not None and bool(joints.names)
    path = {
        settable: 0 if joints is None else _path_bytes(chain, joints, prefix, precision, settable=settable)
        for settable in (False, True)
    }
    past += count + 2 if past and joints else 0
    servo = actuator.servo_stiffness_N_per_m  # None for a force drive
    past += (2 if joints else 1) if servo else 0
    free = 5 if chain.friction.weakening_speed_m_per_s is not None else 3
    free = 1 if joints else free
    state = {
        "inverse": _padded(
            output + _chain_bytes(chain, size, path[True]) + ((6 if ramp else 5) + free + past) * size + entry, size
        ),
        "capstan": _padded(output + (5 if law.plays is None else 4 + 3 * PLAYS) * size + entry, size),
        "table": _padded(output + 4 * size + entry + 4, size),
        "plant": _padded(_chain_bytes(chain, size, path[False]) + (2 if servo else 1) * size + 12, size),
        "observer": _observer_bytes(chain, law, size, path[False]),
        "profile": _padded(output + 4, size),
        "bounds": _padded(4 * size + 4, size),
    }
    if design is not None and "stream" in names:
        line = design.line + (5 if precision is Precision.FLOAT else 4) + (2 * (design.ahead + 1) + 2 if ramp else 0)
        places = _padded(4, size) + 8 if ramp else 4
        line += len(joints.names) if joints is not None else 0  # angles of the last call
        state["stream"] = _padded(output + state["inverse"] + line * size + entry + places, size)
    return _naming(scenario, problem.level, precision, prefix) | {
        "tested": [],  # modules with a self test of their own
        "beside": [],  # modules that no compensator has
        "joints": joints,
        "shared": shared_sources(problem, names),
        "joint_parameter": f", const {prefix}_real joint_rad[]" if moving else "",
        "arguments": ", joint_rad" if moving else "",
        "carry": BDF2_CARRY,
        "weight": BDF2_WEIGHT,
        "rated": [] if joints is None else _rated(joints),
        "joint_jumps_rad": largest_starts_rad(chain, step),
        "jump_factor": f"{JUMP_FACTOR:g}",
        "friction_shares": tuple(
            _friction_shares(chain, math.exp(e)) for e in (law.pull_exponent, -law.release_exponent)
        ),
        "title": f"{prefix}: feedforward force for a tendon",
        "count": count,
        "reals": reals,
        "step": step,
        "step_s": repr(step),
        "reference_min": accepted[0],
        "reference_max": accepted[1],
        "force_min": actuator.force_min_N,
        "force_max": actuator.force_max_N,
        "change_max": actuator.force_rate_max_N_per_s * step,
        "pull_ratio": math.exp(law.pull_exponent),
        "release_ratio": math.exp(-law.release_exponent),
        "adhesion": law.adhesion_N,
        "load_exponent": law.load_exponent,
        "load_reference": law.reference_tension_N,
        "plays": _plays(law, transmission, precision),
        "re_entry": max(1, round(RE_ENTRY_S / step)),
        "re_entry_share": RE_ENTRY_SHARE,
        "steps": accepted_steps(step),
        **_start_context(chain),
        "servo": servo,
        "actuation": "command" if servo else "force",
        **parameter_context(problem),
        **{name: f"{name}f" if precision is Precision.FLOAT else name for name in ("exp", "log", "pow")},
        "modules": modules,
        "names": names,
        "followers": followers,
        "adaptive": None,
        "ramp": ramp,
        "ramp_slack": SLACK,
        "follower": "inverse" if "inverse" in names else next(iter(m.name for m in followers), ""),
        "initial": reference.initial_tension_N,
        "amplitude": 0.25 * min(reference.initial_tension_N, max(reference.range_N, 1e-3)),
        "example_rows": max(20, min(4000, round(2.0 / step))),
        "limits": plant_limits(precision),
        "state_bytes": state,
        **further,
    }


def _plays(law: CapstanLaw, transmission: Transmission, precision: Precision) -> dict[str, object] | None:
    """Plays of a law with spread bounds: their own wrap angles, whatever the coefficients are set to."""
    if law.plays is None:
        return None
    friction, least = transmission.friction, 1e-9  # a coefficient of 0 may be set to another
    mu_pull, mu_release = max(friction.mu_dynamic, least), max(friction.release_dynamic, least)
    angles = {
        "pull_rad": -play_exponents(-max(law.pull_exponent, least), law.pull_spread) / mu_pull,
        "release_rad": play_exponents(max(law.release_exponent, least), law.release_spread) / mu_release,
    }
    rows = {name: _wrapped([literal(float(v), precision) for v in angle]) for name, angle in angles.items()}
    return rows | {"count": PLAYS, "mu_pull": friction.mu_dynamic, "mu_release": friction.release_dynamic}


def _start_context(chain: Chain) -> dict[str, object]:
    """Where a start in motion finds the states that friction and tension decide."""
    layout = chain.layout
    rest = chain.rest_state(0.0).vector()
    stretched = [layout.part(name).start for name in ("e", *layout.link_states)]
    return {
        "knows_friction": layout.friction_states == ("f_s",) and not np.any(rest[: layout.part("q_a").start]),
        "friction_at": layout.part(layout.friction_states[0]).start if layout.friction_states else 0,
        "link_parts": stretched,
        "near_at": layout.part("q_a").start,
        "drive": chain.drive,
        "rest_per_N": chain.rest_state(1.0).near_position_m,
        "dry_at": layout.part("v").stop,
    }


def table_bytes(table: LookupTable, precision: Precision) -> int:
    """Constant data of a table: forces, shares and the index of the shares [bytes]."""
    size, total = 4 if precision is Precision.FLOAT else 8, 0
    for branch in Branch:
        share = table.branch(branch).share
        index = len(share_index(share, precision).cell) * (1 if len(share) <= 256 else 2)
        total += size * (table.branch(branch).force_N.size + len(share)) + index
    return total


def measured(precision: Precision) -> dict[str, object]:
    """Instructions, code and stack of the example, as `tests/target` measured them."""
    text = files("tendonff.compensator.export").joinpath("measured.json").read_text(encoding="utf-8")
    content: dict[str, dict[str, object]] = json.loads(text)
    return content[precision]


def _path_bytes(chain: Chain, joints: Joints, prefix: str, precision: Precision, *, settable: bool) -> int:
    """Where the path stands, and friction of its bends, in the state of a module [bytes]."""
    size = 4 if precision is Precision.FLOAT else 8
    bends = len(joints.bends)
    path = _padded(
        (2 * len(joints.names) + 3 * bends + (3 if size == 4 else 2) * len(joints.links) + 1) * size + 4, size
    )
    contact = contact_code(chain, joints, f"{prefix}_inverse", precision, settable=settable)
    return path + (bends * len(contact.own) + (2 if settable else 0)) * size


def _observer_bytes(chain: Chain, law: CapstanLaw, size: int, path: int) -> int:
    """State of the observer [bytes]."""
    common = _padded(3 * size + 8, size) + _padded(5 * size + 4, size) + 3 * size
    if law.plays is not None:
        return _padded(common + PLAYS * size + 4, size)
    far = 0 if chain.far_joint is not None else 3 * size + 4
    return _padded(common + _chain_bytes(chain, size, path) + far + 8, size)


def _chain_bytes(chain: Chain, size: int, path: int) -> int:
    """State of a chain, with its path [bytes]."""
    return _padded(path + 2 * chain.layout.size * size + 4, size)


def _rated(joints: Joints) -> list[bool]:
    """Whether the speed of each joint matters: where it changes lengths, or moves the far end."""
    lengths = np.array([link.gained_m for link in joints.links if link.moves] + [joints.far_m], dtype=np.float64)
    return [bool(np.any(own)) for own in lengths.T]


def _friction_shares(chain: Chain, ratio: float) -> list[float]:
    """Share of each mass in the friction along a path that slips with this ratio of tensions, at joint angle zero."""
    pull, _ = chain.friction.slip_coefficients
    exponent = equivalent_exponent(np.minimum(np.broadcast_to(np.asarray(pull, float), (chain.count,)), 1 - 1e-12))
    held = exponent if exponent.sum() > 0 else np.ones(chain.count)
    beyond = (
        np.append(np.cumsum(held[::-1])[::-1], 0.0) / held.sum()
    )  # of all friction, from the near side of each mass on
    levels = np.expm1(math.log(ratio) * beyond) if ratio != 1 else beyond
    return [float(share) for share in -np.diff(levels) / levels[0]]


def _padded(size: int, alignment: int) -> int:
    """Size with the gap behind it [bytes]."""
    return -(-size // alignment) * alignment
