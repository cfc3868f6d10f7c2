"""`tendonff export-fmu`: the exported C as a co-simulation unit for FMI 2.0 and 3.0, sources included."""

import hashlib
import io
import os
import platform
import re
import sys
import tempfile
import zipfile
from dataclasses import dataclass, field
from importlib.resources import files
from pathlib import Path

from tendonff._version import __version__
from tendonff.compensator.adapt.setup import check_tuning
from tendonff.compensator.compensators.base import CModule, Problem
from tendonff.compensator.compensators.table import BuiltTable, accepted_range, table_of
from tendonff.compensator.export.judgement import Judged, chosen, judge, profiles_of
from tendonff.compensator.export.kinds import FmiVersion, Kind
from tendonff.compensator.export.modules import ADAPTIVE, PLANT, c_modules, check_prefix
from tendonff.compensator.export.text.c_text import c_sources, harmless, table_context
from tendonff.compensator.export.text.parameters import parameters_of
from tendonff.compensator.files.reading import InputError
from tendonff.compensator.files.writing import atomic_file
from tendonff.compensator.scenario.scenario import Scenario, scenario_hash
from tendonff.models.chain import Chain
from tendonff.models.fidelity import Level
from tendonff.models.parameters.drive import Drive
from tendonff.ocp.adaptation.tuning import Sensor
from tendonff.ocp.codegen.compiler import Target, cross_compile, find_compiler, run_compiler
from tendonff.ocp.codegen.precision import Precision
from tendonff.ocp.codegen.templates import environment
from tendonff.ocp.errors import CodeError
from tendonff.ocp.step.joints import Joints

_TEMPLATES = environment("tendonff.compensator.export", "templates/fmu")
_ELSEWHERE = (  # target, folder in FMI 2.0 (empty: it has no name for it) and 3.0
    (Target(triple="x86_64-windows-gnu", suffix=".dll"), "win64", "x86_64-windows"),
    (Target(triple="x86_64-macos", suffix=".dylib"), "darwin64", "x86_64-darwin"),
    (Target(triple="aarch64-macos", suffix=".dylib"), "", "aarch64-darwin"),
)
_MACHINES = {"x86_64": "x86_64", "AMD64": "x86_64", "aarch64": "aarch64", "arm64": "aarch64"}


@dataclass(frozen=True, slots=True, kw_only=True)
class _Variable:
    """Line of the model description."""

    name: str
    text: str
    unit: str
    start: str
    is_parameter: bool = field(default=False, repr=False)  # the token is made of the rest
    low: float | None = None  # what is accepted; None where nothing is refused
    high: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Fmu:
    """A unit, ready to be written.

    Attributes
    ----------
    name : str
        File name.
    content : bytes
        The archive.
    has_binary : bool
        Whether it holds a binary for this machine; the sources are always there.
    judged : tuple of Judged
        Its error on the scenario's reference, after no compensation; empty for a plant.
    warnings : tuple of str
        What the user should know.
    """

    name: str
    content: bytes
    has_binary: bool
    judged: tuple[Judged, ...]
    warnings: tuple[str, ...]

    def write(self, folder: str | os.PathLike[str]) -> None:
        """Write the unit under its name, whole or not at all; makes the folder."""
        with atomic_file(Path(folder) / self.name) as partial:
            partial.write_bytes(self.content)


def build_fmu(
    scenario: Scenario,
    kind: Kind = Kind.INVERSE,
    fmi: FmiVersion = FmiVersion.V2,
    *,
    prefix: str = "tff",
    level: Level | None = None,
    everywhere: bool = False,
    force_export: bool = False,
) -> Fmu:
    """Wrap the exported C of a scenario.

    What follows a reference is simulated on the scenario's first; one whose error is above that of no compensation is
    refused by SolveError. InputError if the scenario has no unit of this kind, CodeError if a compiler refuses the
    sources, or is missing.

    Parameters
    ----------
    prefix : str, optional
        Prefix of the C names.
    level : Level, optional
        Fidelity level; default: the scenario's own.
    everywhere : bool, optional
        Binaries for Windows and macOS too, built here by ziglang; what is run here are those of this machine alone.
    force_export : bool, optional
        Make a unit all the same that is worse than no compensation.

    Examples
    --------
    >>> import tendonff as tf
    >>> scenario = tf.load_scenario("examples/finger.toml")
    >>> unit = tf.export_fmu(scenario, tf.FmuKind.INVERSE)  # doctest: +SKIP
    >>> unit.write("fmu")  # doctest: +SKIP
    """
    check_prefix(prefix)
    if kind is Kind.ADAPTIVE and scenario.adaptation is None:
        raise InputError(f"{scenario.source.name}: table [adaptation] is missing; --kind adaptive needs its sensor")
    check_tuning(scenario)
    problem = Problem.of(scenario, level=level)
    module = next((module for module in c_modules(scenario) if module.name == kind.value), None)
    if module is None:
        raise InputError(f"{scenario.source.name}: no {kind} serves this drive and path; use --kind inverse")
    identifier = f"{prefix}_{kind}"
    path = ("path",) if problem.chain.moving else ()
    compiled = [f"{prefix}_{name}.c" for name in ("parameters", "limits", *path, kind)]
    wrapper = "fmi2.c" if fmi is FmiVersion.V2 else "fmi3.c"
    built = table_of(problem) if kind is Kind.TABLE else None
    judged, warnings = _judged(problem, built, module, force_export=force_export)
    further = {} if built is None else table_context(built, Precision.DOUBLE)
    sources = c_sources(scenario, problem, (module,), Precision.DOUBLE, prefix, further)
    headers = files("tendonff.compensator.export").joinpath("templates", "fmu", "headers")
    for name in fmi.headers:
        sources[name] = headers.joinpath(name).read_text(encoding="utf-8")
    compiled.append(wrapper)
    context = _context(scenario, problem, kind, prefix, identifier, compiled)
    context["token"] = _token(sources, context, fmi)
    sources["model.h"] = _render("model.h.j2", context)
    declared = sources[fmi.headers[1]]
    implemented = set(re.findall(r"\b(fmi[23]\w+)\(", _render(f"{wrapper}.j2", context | {"stubs": ""})))
    sources[wrapper] = _render(f"{wrapper}.j2", context | {"stubs": stubs(declared, implemented)})
    members = {f"sources/{name}": text.encode() for name, text in sources.items()}
    members["modelDescription.xml"] = _render(f"modelDescription{fmi.value[0]}.xml.j2", context).encode()
    if fmi is FmiVersion.V3:
        members["sources/buildDescription.xml"] = _render("buildDescription.xml.j2", context).encode()
    libraries = _libraries(sources, compiled, fmi, everywhere=everywhere)
    members |= {f"binaries/{place}/{identifier}{suffix}": content for (place, suffix), content in libraries.items()}
    return Fmu(
        name=f"{identifier}_fmi{fmi.value[0]}.fmu",
        content=_archive(members),
        has_binary=any(suffix == ".so" for _, suffix in libraries),
        judged=judged,
        warnings=warnings,
    )


def _judged(
    problem: Problem, built: BuiltTable | None, module: CModule, *, force_export: bool
) -> tuple[tuple[Judged, ...], tuple[str, ...]]:
    """Error of the unit, as judged by `export-c`; the adaptive one counts as the inverse that it tunes."""
    if module == PLANT:
        return (), ()
    name = "inverse" if module == ADAPTIVE else module.name
    judged = judge(problem, profiles_of(problem, built, names=(name,)))
    return judged, chosen(judged, (module,), force_export=force_export)[1]


def stubs(header: str, implemented: set[str]) -> str:
    """Definitions that refuse, for every function in the text of a header that a wrapper does not implement."""
    code = re.sub(r"/\*.*?\*/", "", header, flags=re.DOTALL)
    found = re.findall(r"typedef\s+(fmi[23]Status)\s+(fmi[23]\w+)TYPE\s*\(([^;]*?)\)\s*;", code)
    lines = []
    for status, name, arguments in found:
        if name in implemented:
            continue
        named = [_named(" ".join(a.split()), k) for k, a in enumerate(arguments.split(","))]
        lines.append(f"{status} {name}({', '.join(named)})\n{{\n    return {status[:4]}Error;\n}}\n")
    return "\n".join(lines)


def _named(argument: str, index: int) -> str:
    """An argument with a name, which a definition needs and a typedef may leave out."""
    bare = re.sub(r"\b(const|struct|unsigned)\b", "", argument)
    words = re.findall(r"\w+", bare)
    if argument == "void" or len(words) > 1:
        return argument
    return re.sub(r"(\[\])?$", rf" a{index}\1", argument, count=1)


def _context(
    scenario: Scenario, problem: Problem, kind: Kind, prefix: str, identifier: str, compiled: list[str]
) -> dict[str, object]:
    reference, level = problem.reference, problem.level
    rest = problem.chain.rest_state(reference.initial_tension_N)
    initial = repr(reference.initial_tension_N)
    low, high = accepted_range(problem)
    parameters = {parameter.name: parameter for parameter in parameters_of(problem)}
    given = _Variable(name="reference", text="wanted output tension", unit="N", start=initial, low=low, high=high)
    force = _Variable(name="force", text="force of the actuator, within its limits", unit="N", start=initial)
    servo = scenario.transmission.actuator.drive is Drive.POSITION
    if servo:
        force = _Variable(name="command", text="position of the servo relative to the start", unit="m", start="0.0")
    extras, outputs = list[_Variable](), [force]
    mu = repr(scenario.transmission.friction.mu_dynamic)
    if kind is Kind.ADAPTIVE and scenario.adaptation is not None:
        outputs.append(_Variable(name="mu", text="present estimate of mu_dynamic", unit="", start=mu))
        sensor = scenario.adaptation.sensor
        first = initial if sensor is Sensor.OUTPUT_TENSION else "0.0"
        words = f"last measurement: {sensor.words}"
        extras.append(_Variable(name="measured", text=words, unit=sensor.unit, start=first))
    elif kind is Kind.INVERSE:
        extras.append(
            _Variable(
                name="mu",
                text="mu_dynamic",
                unit="",
                start=mu,
                is_parameter=True,
                low=parameters["mu_pull"].low,
                high=parameters["mu_pull"].high,
            )
        )
    elif kind is Kind.PLANT:
        given = force if servo else _Variable(name="force", text="force of the actuator", unit="N", start=initial)
        near, far = repr(rest.near_position_m), repr(rest.far_position_m)
        outputs = [
            _Variable(name="tension", text="output tension", unit="N", start=initial),
            _Variable(name="actuator_position", text="positive towards the actuator", unit="m", start=near),
            _Variable(name="load_position", text="positive towards the actuator", unit="m", start=far),
        ]
    joints = [] if problem.chain.motion is None else _joint_inputs(problem.chain)
    name = harmless(scenario.name)
    return {
        "prefix": prefix,
        "guard": prefix.upper(),
        "kind": kind,
        "identifier": identifier,
        "compiled": compiled,
        "description": f"{kind} of the tendon chain, level {level}: {name}",
        "version": __version__,
        "input": given,
        "outputs": outputs,
        **({"servo": True} if servo else {}),
        "extras": [*extras, *joints],
        "joint_at": len(extras) if joints else -1,
        "taken": " or ".join(v.name for v in (given, *extras, *joints)),
        "initial": initial,
        "initial_range": (low, high),
        "step": repr(scenario.run.step_s),
        "stop": repr(float(reference.time_s[-1])),
        "provenance": f' * Scenario "{name}", hash {scenario_hash(scenario)}, level {level}; tendonff {__version__}.',
    }


def _joint_inputs(chain: Chain) -> list[_Variable]:
    joints = Joints.of(chain)
    rows = zip(joints.names, joints.start_rad, joints.least_rad, joints.most_rad, strict=True)
    return [
        _Variable(name=f"joint_{name}", text=f"angle of the joint {name}", unit="rad", start=repr(start), low=a, high=b)
        for name, start, a, b in rows
    ]


def _token(sources: dict[str, str], context: dict[str, object], fmi: FmiVersion) -> str:
    """Identifier that changes with anything that the unit holds."""
    parts = [
        fmi.value,
        repr(sorted((k, str(v)) for k, v in context.items() if (k != "extras" or v) and (k, v) != ("joint_at", -1))),
        *(sources[k] for k in sorted(sources)),
    ]
    digest = hashlib.sha256("\0".join(parts).encode()).hexdigest()
    return f"{{{digest[:8]}-{digest[8:12]}-{digest[12:16]}-{digest[16:20]}-{digest[20:32]}}}"


def _render(template: str, context: dict[str, object]) -> str:
    return _TEMPLATES.get_template(template).render(context)


def _platform(fmi: FmiVersion) -> str:
    machine = _MACHINES[platform.machine()]
    return "linux64" if fmi is FmiVersion.V2 and machine == "x86_64" else f"{machine}-linux"


def _libraries(
    sources: dict[str, str], compiled: list[str], fmi: FmiVersion, *, everywhere: bool
) -> dict[tuple[str, str], bytes]:
    """Shared libraries by folder and suffix: of this machine where it is Linux with a compiler, of others if asked."""
    compiler, made = find_compiler(), {}
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        for name, text in sources.items():
            (folder / name).write_text(text, encoding="utf-8")
        if compiler is not None and sys.platform.startswith("linux") and platform.machine() in _MACHINES:
            arguments = [
                *("-std=c99", "-O2", "-shared", "-fPIC", "-ffp-contract=off", "-fno-math-errno"),
                *("-Wno-unused-parameter", "-s", "-Wl,--build-id=none", "-o", "unit.so", *compiled, "-lm"),
            ]
            if complaint := run_compiler(compiler, arguments, folder):
                raise CodeError(f"the unit's sources: {complaint}")
            made[_platform(fmi), ".so"] = (folder / "unit.so").read_bytes()
        for target, *places in _ELSEWHERE if everywhere else ():
            if place := places[0 if fmi is FmiVersion.V2 else 1]:
                made[place, target.suffix] = cross_compile(target, compiled, folder)
    return made


def _archive(members: dict[str, bytes]) -> bytes:
    """A zip archive without dates: equal members give equal bytes."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        for name in sorted(members):
            info = zipfile.ZipInfo(name, date_time=(1980, 1, 1, 0, 0, 0))
            info.compress_type = zipfile.ZIP_DEFLATED
            info.external_attr = 0o644 << 16
            archive.writestr(info, members[name])
    return stream.getvalue()
