"""Compile generated C with the system's compiler, once, and load it; compile for other systems.

The package ziglang, where it is installed, carries clang and the headers of each system.
"""

import atexit
import ctypes
import functools
import hashlib
import importlib.util
import os
import platform
import shlex
import shutil
import stat
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from tendonff.ocp.codegen.leftovers import remove_leftovers, temporary_name
from tendonff.ocp.errors import CodeError

INSTALL = 'pip install "tendonff[compiler]"'
"""Command that installs the package ziglang."""

_PACKAGED = ("-m", "ziglang", "cc")
_FLAGS = ("-O3", "-std=c99", "-shared", "-fPIC", "-fno-math-errno", "-fno-trapping-math", "-ffp-contract=off")

# GCC 12 forgets to leave wide registers clean before a call of exp where it knows what a function of the same file
# does to registers; a call then takes ten times as long.
_GCC_FLAGS = ("-fno-ipa-ra",)


@functools.cache
def _machine_flags() -> tuple[str, ...]:
    """Registers for four numbers, where this processor has them; nothing is contracted, so results stay the same."""
    try:
        known = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace")
    except OSError:
        return ()
    return ("-mavx2",) if platform.machine() == "x86_64" and " avx2 " in known else ()


def _candidates() -> list[tuple[str, ...]]:
    """Commands that may be C compilers: the environment variable CC, else the usual names."""
    if wanted := os.environ.get("CC", "").strip():
        if path := shutil.which(wanted):  # also one with blanks in its path
            return [(path,)]
        try:
            words = shlex.split(wanted, posix=os.name != "nt")
        except ValueError as error:
            raise CodeError(f"the environment variable CC must be a command, got {wanted!r} ({error})") from None
        path = shutil.which(words[0]) if words else None
        return [(path, *words[1:])] if path else []
    found: list[tuple[str, ...]] = [(path,) for name in ("cc", "gcc", "clang") if (path := shutil.which(name))]
    if has_cross_compiler():  # without a target it writes for this machine alone
        found.append((sys.executable, *_PACKAGED, "-mcpu=baseline"))
    return found


def find_compiler() -> tuple[str, ...] | None:
    """Command of the first C compiler that works: CC from the environment, else cc, gcc, clang, the package ziglang.

    Raises
    ------
    CodeError
        If CC cannot be read as a command.
    """
    return next((command for command in _candidates() if _works(command)), None)


def why_no_compiler() -> str:
    """Why `find_compiler` found none, and the way out."""
    try:
        cache_folder()
    except OSError as error:
        return f"C cannot be compiled here ({error.strerror}); set TMPDIR or XDG_CACHE_HOME to a folder to write to"
    wanted = os.environ.get("CC", "").strip()
    if wanted:
        return f"no C compiler found that works (CC is {wanted!r}); set CC to one that does, or unset it"
    looked = "looked for cc, gcc, clang and the package ziglang"
    return f"no C compiler found that works ({looked}); `{INSTALL}` brings one, as a wheel"


@functools.cache
def _works(compiler: tuple[str, ...]) -> bool:
    """Whether it makes a library that loads: a name on the path may stand for tools that are not installed."""
    try:
        ctypes.CDLL(str(_built("int tff_probe(void) { return 1; }\n", compiler)))
    except (CodeError, OSError):
        return False
    return True


def run_compiler(compiler: tuple[str, ...], arguments: Sequence[str], folder: Path | None = None) -> str | None:
    """Run the C compiler of `find_compiler`; None where it succeeds, else its messages."""
    environment = dict(os.environ)
    if compiler[1:3] == _PACKAGED[:2]:  # it would leave its caches where it runs
        for name in ("ZIG_GLOBAL_CACHE_DIR", "ZIG_LOCAL_CACHE_DIR"):
            environment.setdefault(name, str(cache_folder() / "zig"))
    run = subprocess.run(
        [*compiler, *arguments], cwd=folder, env=environment, capture_output=True, text=True, check=False
    )
    if run.returncode == 0:
        return None
    return f"{' '.join(compiler)} failed with status {run.returncode}: {run.stderr[:500]}"


def cache_folder() -> Path:
    """Folder of compiled libraries: the user's own, or one of this process, slower but not wrong.

    A library is run as it is found, so a folder that others may write to is none to trust.
    """
    try:
        base = os.environ.get("XDG_CACHE_HOME")
        folder = (Path(base) if base else Path.home() / ".cache") / "tendonff"
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        return folder if _is_private(folder) and _is_writable(folder) else _folder_of_this_process()
    except (OSError, RuntimeError):  # RuntimeError: there is no home
        return _folder_of_this_process()


def _is_private(folder: Path) -> bool:
    """Whether it is the user's, and not writable by others."""
    if os.name != "posix":
        return True
    found = folder.stat()
    return found.st_uid == os.getuid() and not found.st_mode & (stat.S_IWGRP | stat.S_IWOTH)


@functools.cache
def _is_writable(folder: Path) -> bool:
    try:
        with tempfile.TemporaryFile(dir=folder):
            return True
    except OSError:
        return False


@functools.cache
def _folder_of_this_process() -> Path:
    folder = tempfile.mkdtemp(prefix="tendonff-")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return Path(folder)


@functools.cache
def _compiler_version(compiler: tuple[str, ...]) -> str:
    return subprocess.run([*compiler, "--version"], capture_output=True, text=True, check=False).stdout


def load_library(source: str) -> ctypes.CDLL:
    """Compile C99 into a shared library, or take it from the cache, and load it.

    Raises
    ------
    CodeError
        If no compiler works or it refuses the source.
    """
    compiler = find_compiler()
    if compiler is None:
        raise CodeError(f"this runs as compiled C alone; {why_no_compiler()}")
    return ctypes.CDLL(str(_built(source, compiler)))


def _built(source: str, compiler: tuple[str, ...]) -> Path:
    """Shared library of C source, compiled unless the cache has it."""
    version = _compiler_version(compiler)
    flags = (*_FLAGS, *_machine_flags(), *(() if "clang" in version else _GCC_FLAGS))
    key = "\0".join([source, *compiler, version, sys.platform, platform.machine(), *flags])
    library = cache_folder() / f"{hashlib.sha256(key.encode()).hexdigest()[:32]}.so"
    if not _is_whole(library):
        remove_leftovers(library.parent)
        scratch = library.parent / temporary_name(library.stem)
        scratch.mkdir()
        try:
            c_file, built, seal = scratch / "generated.c", scratch / library.name, scratch / "seal"
            c_file.write_text(source, encoding="utf-8")
            if complaint := run_compiler(compiler, [*flags, "-o", str(built), str(c_file), "-lm"]):
                raise CodeError(f"generated C: {complaint}")
            seal.write_text(_digest(built), encoding="ascii")
            built.replace(library)  # atomic: a second process sees all of it or nothing
            seal.replace(_seal_of(library))
        finally:
            shutil.rmtree(scratch, ignore_errors=True)
    return library


def _seal_of(library: Path) -> Path:
    return library.with_suffix(".sha256")


def _digest(file: Path) -> str:
    return hashlib.sha256(file.read_bytes()).hexdigest()


def _is_whole(library: Path) -> bool:
    """Whether a library is what the compiler wrote: a torn one would end the process when it is loaded."""
    try:
        return _seal_of(library).read_text(encoding="ascii") == _digest(library)
    except (OSError, ValueError):
        return False


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
        raise CodeError(f"binaries for other systems need ziglang, which is not installed; {INSTALL}")
    name = f"cross{target.suffix}"
    arguments = [
        *("-target", target.triple, "-std=c99", "-O2", "-g0", "-shared", "-fPIC", "-mcpu=baseline", "-s"),
        *("-ffp-contract=off", "-fno-math-errno", "-Wno-unused-parameter", "-o", name, *sources, "-lm"),
    ]
    if complaint := run_compiler((sys.executable, *_PACKAGED), arguments, folder):
        raise CodeError(f"the sources for {target.triple}: {complaint}")
    return (folder / name).read_bytes()
