"""Shared libraries for other systems, by the package ziglang, which carries clang and the headers of each."""

import importlib.util
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from tendonff.ocp.codegen.compiler import run_compiler
from tendonff.ocp.errors import CodeError


@dataclass(frozen=True, slots=True, kw_only=True)
class Target:
    """A system that libraries can be made for."""

    triple: str  # as clang names it
    suffix: str  # of its shared libraries, with the dot


def has_cross_compiler() -> bool:
    """Whether ziglang is installed."""
    return importlib.util.find_spec("ziglang") is not None


def cross_compile(target: Target, sources: Sequence[str], folder: Path) -> bytes:
    """The shared library of some C sources in a folder, where their headers are too; equal sources give equal bytes.

    Raises
    ------
    CodeError
        If ziglang is not installed or refuses the sources.
    """
    if not has_cross_compiler():
        raise CodeError("binaries for other systems need ziglang, which is not installed; pip install ziglang")
    name = f"cross{target.suffix}"
    compiler = (sys.executable, "-m", "ziglang", "cc")
    arguments = [
        *("-target", target.triple, "-std=c99", "-O2", "-g0", "-shared", "-fPIC", "-mcpu=baseline", "-s"),
        *("-ffp-contract=off", "-fno-math-errno", "-Wno-unused-parameter", "-o", name, *sources, "-lm"),
    ]
    if complaint := run_compiler(compiler, arguments, folder):
        raise CodeError(f"the sources for {target.triple}: {complaint}")
    return (folder / name).read_bytes()
