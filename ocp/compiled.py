"""Compile generated C with the system's compiler, once, and load it."""

import atexit
import ctypes
import functools
import hashlib
import importlib.util
import os
import platform
import shlex
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Protocol

import jinja2

from tendonff.ocp.ccode import Precision, c_function, literal
from tendonff.ocp.elements import Law, inverse_laws, simulation_laws
from tendonff.ocp.errors import CodeError
from tendonff.ocp.scheme import (
    BDF2_CARRY,
    BDF2_WEIGHT,
    EASY_CONTRACTION,
    EASY_GOAL,
    EASY_MOVES,
    MAX_HALVINGS,
    MAX_ITERATIONS,
    MAX_PIECES,
    MAX_SPLITS,
    RESIDUAL_ROUNDING,
    RESIDUAL_TOLERANCE_N,
)


class Engine(StrEnum):
    """What advances the chain; all take the same decisions and give the same results to 1e-9 N.

    Where the tendon sticks and slips on stiff bristles, rounding decides what comes next, for any engine.

    Attributes
    ----------
    AUTO
        Compiled C where a C compiler works, CasADi elsewhere. The environment variable TENDONFF_ENGINE decides first.
    COMPILED
        Generated C, compiled once and cached.
    CASADI
        CasADi's own evaluation, no compiler needed.
    """

    AUTO = "auto"
    COMPILED = "compiled"
    CASADI = "casadi"


_TEMPLATES = jinja2.Environment(  # noqa: S701 - C, not HTML
    loader=jinja2.PackageLoader("tendonff.ocp"),
    undefined=jinja2.StrictUndefined,
    keep_trailing_newline=True,
    trim_blocks=True,
)
_PACKAGED = ("-m", "ziglang", "cc")
_FLAGS = ("-O3", "-std=c99", "-shared", "-fPIC", "-fno-math-errno", "-fno-trapping-math", "-ffp-contract=off")


class LawCalls(Protocol):
    """How generated code calls a law."""

    def __call__(self, law: str, arguments: Mapping[str, str], end: str = "") -> str:
        """C text of a call.

        Parameters
        ----------
        law : str
            Name of a law in `elements`.
        arguments : mapping of str to str
            C text of each input that belongs to the state, and of each output, by the law's own names.
        end : str, optional
            "near" or "far" for the laws of an end mass.
        """
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """Bounds of the loops of a generated step, and the balance that counts as solved.

    Parameters
    ----------
    iterations, halvings, splits : int
        Newton iterations, halvings of one, and halvings of the step.
    rounding : float
        Relative addition to the tolerance: rounding of the largest link force [-].
    tolerance_N : float
        Balance that counts as solved [N].
    """

    iterations: int = MAX_ITERATIONS
    halvings: int = MAX_HALVINGS
    splits: int = MAX_SPLITS
    rounding: float = RESIDUAL_ROUNDING
    tolerance_N: float = RESIDUAL_TOLERANCE_N


@functools.cache
def _law_table() -> dict[str, Law]:
    return {law.name: law for law in (*simulation_laws(), *inverse_laws())}


def struct_calls(prefix: str) -> LawCalls:
    """Calls of laws whose parameters are fields of `<prefix>_chain *s`, with the weight in `H`.

    Parameters
    ----------
    prefix : str
    """

    def call(law: str, arguments: Mapping[str, str], end: str = "") -> str:
        known = _law_table()[law]

        def argument(name: str) -> str:
            if name in arguments:
                return arguments[name]
            return "H" if name == "H" else f"s->{end}{'_' if end else ''}{name}"

        inputs = [argument(symbol.name()) for symbol in known.inputs]
        return f"{prefix}_{law}({', '.join([*inputs, *(arguments[name] for name in known.outputs)])})"

    return call


def render_template(
    name: str,
    prefix: str,
    precision: Precision,
    *,
    calls: LawCalls | None = None,
    limits: Limits | None = None,
    compliances: tuple[float, float] | None = None,
    masses_kg: tuple[float, float, float] | None = None,
) -> str:
    """One of the C templates with its real type, prefix and literals filled in.

    Parameters
    ----------
    name : str
        File name in `ocp/templates`.
    prefix : str
        Prefix of every C name.
    precision : Precision
    calls : LawCalls, optional
        How laws are called where their parameters are folded in (`specialise`); default: parameters in a record.
    limits : Limits, optional
        Bounds of the loops; default: those of the scheme.
    compliances : tuple of float, optional
        Compliance of the load's spring and lasting compliance of a link [m/N], for an inverse that keeps the load's
        position and the elongations relative to them.
    masses_kg : tuple of float, optional
        Near end, one mass on the path, far end, where they are folded in.
    """

    def number(value: float) -> str:
        return literal(value, precision)

    single, exported = precision is Precision.FLOAT, calls is not None
    limits = limits or Limits()
    return _TEMPLATES.get_template(name).render(
        prefix=prefix,
        exported=exported,
        call=calls or struct_calls(prefix),
        H="c->H" if exported else "H",
        masses=("s->near_mass", "s->mass", "s->far_mass") if masses_kg is None else tuple(map(number, masses_kg)),
        shifted=compliances is not None,
        load_compliance="" if compliances is None else number(compliances[0]),
        link_compliance="" if compliances is None else number(compliances[1]),
        real="float" if single else "double",
        fabs="fabsf" if single else "fabs",
        zero=number(0.0),
        half=number(0.5),
        one=number(1.0),
        minus_one=number(-1.0),
        bdf2_carry=number(BDF2_CARRY),
        bdf2_weight=number(BDF2_WEIGHT),
        tolerance=number(limits.tolerance_N) if exported else "s->tolerance_N",
        rounding=number(limits.rounding),
        max_iterations=limits.iterations,
        max_halvings=limits.halvings,
        max_splits=limits.splits,
        easy=number(EASY_CONTRACTION),
        easy_moves=EASY_MOVES,
        goal=number(EASY_GOAL),
        max_pieces=MAX_PIECES,
    )


def print_laws(laws: tuple[Law, ...], prefix: str, precision: Precision) -> str:
    """The laws as static C functions named `<prefix>_<law>`.

    Parameters
    ----------
    laws : tuple of Law
    prefix : str
    precision : Precision
    """
    real = "float" if precision is Precision.FLOAT else "double"
    return "\n".join(
        c_function(f"{prefix}_{law.name}", law.comment, law.inputs, law.outputs, precision, real).code for law in laws
    )


@functools.cache
def _machine_flags() -> tuple[str, ...]:
    """Registers for four numbers, where this processor has them; nothing is contracted, so results stay the same."""
    try:
        known = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace")
    except OSError:
        return ()
    return ("-mavx2",) if platform.machine() == "x86_64" and " avx2 " in known else ()


def _candidates() -> list[tuple[str, ...]]:
    """Commands that may be C compilers: what the environment variable CC says, or else whatever is there."""
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
    if importlib.util.find_spec("ziglang") is not None:  # clang; without a target it writes for this machine alone
        found.append((sys.executable, *_PACKAGED, "-mcpu=baseline"))
    return found


def find_compiler() -> tuple[str, ...] | None:
    """Command of the first C compiler that works: CC from the environment, else cc, gcc, clang, the package ziglang.

    Returns
    -------
    tuple of str or None
        None where there is none.

    Raises
    ------
    CodeError
        If CC cannot be read as a command.
    """
    return next((command for command in _candidates() if _works(command)), None)


@functools.cache
def _works(compiler: tuple[str, ...]) -> bool:
    """Whether it makes a library that loads: a name on the path may stand for tools that are not installed."""
    try:
        ctypes.CDLL(str(_built("int tff_probe(void) { return 1; }\n", compiler)))
    except (CodeError, OSError):
        return False
    return True


def run_compiler(compiler: tuple[str, ...], arguments: Sequence[str], folder: Path | None = None) -> str | None:
    """Run the C compiler; None where it succeeds, else what it said.

    Parameters
    ----------
    compiler : tuple of str
        From `find_compiler`.
    arguments : sequence of str
    folder : Path, optional
        Where it runs.
    """
    environment = dict(os.environ)
    if compiler[1:3] == _PACKAGED[:2]:  # it would leave its caches where it runs
        for name in ("ZIG_GLOBAL_CACHE_DIR", "ZIG_LOCAL_CACHE_DIR"):
            environment.setdefault(name, str(_cache_folder() / "zig"))
    run = subprocess.run(
        [*compiler, *arguments], cwd=folder, env=environment, capture_output=True, text=True, check=False
    )
    if run.returncode == 0:
        return None
    return f"{' '.join(compiler)} failed with status {run.returncode}: {run.stderr[:500]}"


def _cache_folder() -> Path:
    base = os.environ.get("XDG_CACHE_HOME")
    folder = (Path(base) if base else Path.home() / ".cache") / "tendonff"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        return folder
    except OSError:  # no writable home: a folder of this process is slower, not wrong
        return _folder_of_this_process()


@functools.cache
def _folder_of_this_process() -> Path:
    folder = tempfile.mkdtemp(prefix="tendonff-")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return Path(folder)


@functools.cache
def _compiler_version(compiler: tuple[str, ...]) -> str:
    return subprocess.run([*compiler, "--version"], capture_output=True, text=True, check=False).stdout


def load_library(source: str) -> ctypes.CDLL:
    """Compile C source into a shared library, or take it from the cache, and load it.

    Parameters
    ----------
    source : str
        C99.

    Raises
    ------
    CodeError
        If no compiler works or it refuses the source.
    """
    compiler = find_compiler()
    if compiler is None:
        wanted = os.environ.get("CC", "").strip()
        where = f"CC is {wanted!r}" if wanted else "looked for cc, gcc, clang and the package ziglang"
        raise CodeError(f"no C compiler found that works ({where}); pip install ziglang, or use the CasADi engine")
    return ctypes.CDLL(str(_built(source, compiler)))


def _built(source: str, compiler: tuple[str, ...]) -> Path:
    """Shared library of C source, compiled unless the cache has it."""
    flags = (*_FLAGS, *_machine_flags())
    key = "\0".join([source, *compiler, _compiler_version(compiler), sys.platform, platform.machine(), *flags])
    library = _cache_folder() / f"{hashlib.sha256(key.encode()).hexdigest()[:32]}.so"
    if not library.exists():
        with tempfile.TemporaryDirectory(dir=library.parent) as scratch:
            c_file, built = Path(scratch) / "generated.c", Path(scratch) / library.name
            c_file.write_text(source, encoding="utf-8")
            if complaint := run_compiler(compiler, [*flags, "-o", str(built), str(c_file), "-lm"]):
                raise CodeError(f"generated C: {complaint}")
            built.replace(library)  # atomic: a second process sees all of it or nothing
    return library


@functools.cache
def resolve_engine(engine: Engine) -> Engine:
    """Turn AUTO into what works here.

    Parameters
    ----------
    engine : Engine

    Returns
    -------
    Engine
        COMPILED or CASADI.
    """
    if engine is not Engine.AUTO:
        return engine
    if wanted := os.environ.get("TENDONFF_ENGINE"):
        return Engine(wanted)
    return Engine.CASADI if find_compiler() is None else Engine.COMPILED
