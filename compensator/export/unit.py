"""Co-simulation units for FMI 2.0 and 3.0: C with a model.h around it, wrapped and packed, sources included."""

import hashlib
import io
import os
import platform
import re
import sys
import tempfile
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib.resources import files
from pathlib import Path

from tendonff.compensator.export.kinds import FmiVersion
from tendonff.compensator.files.writing import atomic_file
from tendonff.ocp.codegen.compiler import Target, cross_compile, find_compiler, run_compiler
from tendonff.ocp.codegen.templates import environment
from tendonff.ocp.errors import CodeError

_TEMPLATES = environment("tendonff.compensator.export", "templates/fmu")
_ELSEWHERE = (  # target, folder in FMI 2.0 (empty: it has no name for it) and 3.0
    (Target(triple="x86_64-windows-gnu", suffix=".dll"), "win64", "x86_64-windows"),
    (Target(triple="x86_64-macos", suffix=".dylib"), "darwin64", "x86_64-darwin"),
    (Target(triple="aarch64-macos", suffix=".dylib"), "", "aarch64-darwin"),
)
_MACHINES = {"x86_64": "x86_64", "AMD64": "x86_64", "aarch64": "aarch64", "arm64": "aarch64"}


@dataclass(frozen=True, slots=True, kw_only=True)
class Variable:
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
    lines : tuple of str
        Its error on the scenario's reference in words; empty for a plant.
    warnings : tuple of str
        What the user should know.
    """

    name: str
    content: bytes
    has_binary: bool
    lines: tuple[str, ...]
    warnings: tuple[str, ...]

    def write(self, folder: str | os.PathLike[str]) -> None:
        """Write the unit under its name, whole or not at all; makes the folder."""
        with atomic_file(Path(folder) / self.name) as partial:
            partial.write_bytes(self.content)


def pack(
    sources: Mapping[str, str],
    context: Mapping[str, object],
    fmi: FmiVersion,
    *,
    model: str = "model",
    everywhere: bool = False,
    lines: tuple[str, ...] = (),
    warnings: tuple[str, ...] = (),
) -> Fmu:
    """Wrap sources, texts by file name.

    `context` holds the values of the templates, of which `model` is that of model.h, `identifier` the unit's name and
    `compiled` the names of the sources to compile.
    """
    identifier = str(context["identifier"])
    wrapper = "fmi2.c" if fmi is FmiVersion.V2 else "fmi3.c"
    known = dict(sources)
    headers = files("tendonff.compensator.export").joinpath("templates", "fmu", "headers")
    for name in fmi.headers:
        known[name] = headers.joinpath(name).read_text(encoding="utf-8")
    compiled = [*_names(context["compiled"]), wrapper]
    values = {**context, "compiled": compiled}
    values["token"] = _token(known, values, fmi)
    known["model.h"] = _render(f"{model}.h.j2", values)
    implemented = set(re.findall(r"\b(fmi[23]\w+)\(", _render(f"{wrapper}.j2", values | {"stubs": ""})))
    known[wrapper] = _render(f"{wrapper}.j2", values | {"stubs": stubs(known[fmi.headers[1]], implemented)})
    members = {f"sources/{name}": text.encode() for name, text in known.items()}
    members["modelDescription.xml"] = _render(f"modelDescription{fmi.value[0]}.xml.j2", values).encode()
    if fmi is FmiVersion.V3:
        members["sources/buildDescription.xml"] = _render("buildDescription.xml.j2", values).encode()
    libraries = _libraries(known, compiled, fmi, everywhere=everywhere)
    members |= {f"binaries/{place}/{identifier}{suffix}": content for (place, suffix), content in libraries.items()}
    return Fmu(
        name=f"{identifier}_fmi{fmi.value[0]}.fmu",
        content=_archive(members),
        has_binary=any(suffix == ".so" for _, suffix in libraries),
        lines=lines,
        warnings=warnings,
    )


def _names(value: object) -> list[str]:
    return [str(name) for name in value] if isinstance(value, list) else []


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
