"""Exported folders, compilers and the emulated controllers."""

import functools
import re
import shutil
import subprocess
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from tendonff.compensator.export.c_project import export_project
from tendonff.compensator.scenario.sampled.sampling import sample_reference
from tendonff.compensator.scenario.scenario import Scenario
from tendonff.compensator.scenarios import load_scenario
from tendonff.models.tendon.chain import Chain
from tendonff.ocp.codegen.precision import Precision
from tendonff.ocp.tendon.inverse import invert

HERE = Path(__file__).parent
MODULES = ("parameters", "limits", "state", "chain", "inverse", "capstan", "table", "plant", "observer")
KINDS = ("inverse", "capstan", "table", "plant", "observer")
_SHOWN = re.compile("[0-9a-f]{8}|[0-9a-f]{16}")
HOST_FLAGS = ("-std=c99", "-O2", "-ffp-contract=off", "-fno-math-errno")


@dataclass(frozen=True, slots=True, kw_only=True)
class Board:
    """An emulated controller."""

    name: str
    precision: Precision
    machine: str
    flags: tuple[str, ...]

    @property
    def compiler(self) -> tuple[str, ...]:
        """Command that compiles a module as on the controller."""
        plain = ("-std=c99", "-O2", "-ffp-contract=off", "-fno-math-errno", "-fstack-usage")
        return ("arm-none-eabi-gcc", *self.flags, *plain, "-ffunction-sections", "-fdata-sections")


M4F = Board(
    name="Cortex-M4F float",
    precision=Precision.FLOAT,
    machine="mps2-an386",
    flags=("-mcpu=cortex-m4", "-mfpu=fpv4-sp-d16", "-mfloat-abi=hard", "-mthumb"),
)
M7 = Board(
    name="Cortex-M7 double",
    precision=Precision.DOUBLE,
    machine="mps2-an500",
    flags=("-mcpu=cortex-m7", "-mfpu=fpv5-d16", "-mfloat-abi=hard", "-mthumb"),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Answers:
    """What one run of bench.c said."""

    hashes: tuple[str, ...]
    shown: np.ndarray  # (rows, modules)
    counts: dict[str, tuple[int, int, float]]  # least, most and mean instructions of a call


def need(*tools: str) -> None:
    """Skip where a tool is missing."""
    for tool in tools:
        if shutil.which(tool) is None:
            pytest.skip(f"{tool} is not installed")


def run(*command: str | Path, **options: object) -> subprocess.CompletedProcess[str]:
    """Run a command and show what it said if it fails."""
    done = subprocess.run([str(c) for c in command], capture_output=True, text=True, check=False, **options)  # type: ignore[call-overload]
    assert done.returncode == 0, f"{' '.join(map(str, command))}\n{done.stdout[-3000:]}\n{done.stderr[-3000:]}"
    return done


@functools.cache
def compiled(compiler: tuple[str, ...], source: Path) -> Path:
    """Object of an exported source, made once, beside its folder; the use of the stack stands beside it."""
    kept = Path(tempfile.mkdtemp(prefix="objects-", dir=source.parent.parent))
    target = kept / f"{source.stem}.o"
    run(*compiler, "-c", source, "-o", target)
    return target


@pytest.fixture(scope="session")
def toolbox(tmp_path_factory: pytest.TempPathFactory) -> object:
    """The helpers of this folder, for its tests."""

    @functools.cache
    def counter() -> Path:
        need("gcc")
        library = tmp_path_factory.mktemp("counter") / "libcount.so"
        run("gcc", "-O2", "-shared", "-fPIC", "-o", library, HERE / "count.c")
        return library

    class Toolbox:
        need, run = staticmethod(need), staticmethod(run)
        here, modules, kinds, m4f, m7 = HERE, MODULES, KINDS, M4F, M7
        host_flags = HOST_FLAGS
        write_reference = staticmethod(write_reference)
        answers = staticmethod(answers)
        on_board = staticmethod(functools.partial(on_board, counter))
        on_host = staticmethod(on_host)
        torn_table = staticmethod(torn_table)
        code_size = staticmethod(code_size)

    return Toolbox()


@pytest.fixture(scope="session")
def exported(tmp_path_factory: pytest.TempPathFactory, examples: Path) -> Callable[..., Path]:
    """Folder of the exported C of an example, made once."""
    made: dict[tuple[str, Precision, int | None], Path] = {}

    def folder(precision: Precision, example: str = "finger", segments: int | None = None) -> Path:
        key = (example, precision, segments)
        if key not in made:
            scenario = load_scenario(examples / f"{example}.toml")
            if segments is not None:
                path = replace(scenario.transmission.path, segments=segments)
                scenario = replace(scenario, transmission=replace(scenario.transmission, path=path))
            made[key] = tmp_path_factory.mktemp(f"{example}_{precision}")
            export_project(scenario, precision=precision, profile_N=_profile(scenario)).write(made[key])
        return made[key]

    return folder


def _profile(scenario: Scenario) -> np.ndarray:
    """A profile that costs nothing to find."""
    reference = sample_reference(scenario)
    chain = Chain.of(scenario.transmission, scenario.run.level)
    start = reference.initial_tension_N
    return invert(chain, reference.tension_N, reference.step_s, initial_tension_N=start).force_N


@pytest.fixture(scope="session")
def course(examples: Path) -> Callable[[str], np.ndarray]:
    """Reference of an example, sampled."""
    return lambda example: sample_reference(load_scenario(examples / f"{example}.toml")).tension_N


def write_reference(folder: Path, reference: np.ndarray, precision: Precision) -> None:
    """Write reference.h for bench.c."""
    suffix = "f" if precision is Precision.FLOAT else ""
    numbers = ",\n".join("(tff_real)NAN" if np.isnan(v) else f"{float(v):.17e}{suffix}" for v in reference)
    head = f"#include <math.h>\n#define ROWS {len(reference)}\n"
    (folder / "reference.h").write_text(f"{head}static const tff_real reference[ROWS] = {{\n{numbers}\n}};\n")


def torn_table(source: Path, folder: Path, precision: Precision) -> Path:
    """The table under the worst of conditions: reversals at every depth of a transition, and limits that bind.

    Returns a folder with the table's C and a reference.h.
    """
    made = folder / "torn"
    made.mkdir()
    for name in (
        "tff_types.h",
        "tff_parameters.h",
        "tff_parameters.c",
        "tff_limits.h",
        "tff_limits.c",
        "tff_table.h",
        "tff_table.c",
        "tff_table_data.h",
    ):
        shutil.copy(source / name, made)
    header = (made / "tff_table.h").read_text()
    low, high = (float(re.search(rf"TABLE_{end}_N ([-+.e\d]+)", header)[1]) for end in ("MIN", "MAX"))  # type: ignore[index]
    middle, span = 0.5 * (low + high), high - low
    limits = {"FORCE_MIN_N": 0.7 * middle, "FORCE_MAX_N": 1.4 * middle, "CHANGE_MAX_N": 0.002 * span}
    text = (made / "tff_types.h").read_text()
    for name, value in limits.items():
        text, found = re.subn(rf"(define TFF_{name} ).*", rf"\g<1>((tff_real){value!r})", text)
        assert found == 1, name
    (made / "tff_types.h").write_text(text)
    noise, turns = np.random.default_rng(7), [middle]
    while len(turns) < 2000:  # legs of all lengths, there and back, each in one to three samples
        leg = span * 10.0 ** noise.uniform(-4, 0) * (-1) ** len(turns)
        turns.append(float(np.clip(turns[-1] + leg, low + 1e-3 * span, high - 1e-3 * span)))
    legs = [np.linspace(a, b, 1 + noise.integers(1, 4))[1:] for a, b in pairwise(turns)]
    write_reference(made, np.concatenate([[middle], *legs, [middle, low, np.nan, 2 * high]]), precision)
    return made


def answers(text: str, precision: Precision, kinds: tuple[str, ...] = KINDS) -> Answers:
    """Read what bench.c, or a bench of one module, and the counter wrote."""
    lines = [line.split() for line in text.splitlines()]
    kind = np.float32 if precision is Precision.FLOAT else np.float64
    width = 8 if precision is Precision.FLOAT else 16
    rows = [
        [bytes.fromhex(word[-width:])[::-1] for word in words]
        for words in lines
        if words and all(map(_SHOWN.fullmatch, words))
    ]
    shown = np.array([[np.frombuffer(b, dtype=kind)[0] for b in row] for row in rows], dtype=np.float64)
    hashes = next(tuple(words[1:]) for words in lines if words[:1] == ["hash"])
    found = {int(words[1]): words[2:] for words in lines if words[:1] == ["count"]}
    counts = {
        name: (int(found[k + 1][1]), int(found[k + 1][2]), float(found[k + 1][3]))
        for k, name in enumerate(kinds)
        if k + 1 in found
    }
    return Answers(hashes=hashes, shown=shown, counts=counts)


def on_host(source: Path, folder: Path, precision: Precision, kinds: tuple[str, ...] = KINDS) -> Answers:
    """Run bench.c (the bench of one module for one alone) on this machine."""
    need("gcc")
    bench = _bench(folder, kinds)
    objects = _objects(("gcc", *HOST_FLAGS), source, kinds)
    run("gcc", *HOST_FLAGS, "-DHOST", "-I", folder, "-I", source, *bench, *objects, "-lm", "-o", folder / "host")
    return answers(run(folder / "host").stderr, precision, kinds)


def _bench(folder: Path, kinds: tuple[str, ...]) -> list[str | Path]:
    """Source and options of a bench: bench.c for all modules, of one alone its own bench or bench_one.c."""
    own = HERE / ("bench.c" if kinds == KINDS else f"bench_{kinds[0]}.c")
    (folder / "module.h").write_text(f'#include "tff_{kinds[0]}.h"\n')
    return [f"-DMODULE={kinds[0]}", own if own.exists() else HERE / "bench_one.c"]


def _objects(compiler: tuple[str, ...], source: Path, kinds: tuple[str, ...]) -> list[Path]:
    """Compiled modules: all, or one alone and what it needs."""
    more = {"stream": "inverse", "plant": "chain", "observer": "chain", "adaptive": "chain"}.get(kinds[0])
    needed = ("parameters", "limits", "path", "state", *((more,) if more else ()))
    modules = MODULES if kinds == KINDS else (*needed, *kinds)
    return [compiled(compiler, made) for name in modules if (made := source / f"tff_{name}.c").exists()]


def on_board(
    counter: Callable[[], Path], board: Board, source: Path, folder: Path, kinds: tuple[str, ...] = KINDS
) -> tuple[Answers, Path]:
    """Run bench.c (the bench of one module for one alone) on an emulated controller; returns the image too."""
    need("arm-none-eabi-gcc", "qemu-system-arm")
    image = folder / "bench.elf"
    run(
        *("arm-none-eabi-gcc", *board.flags, "-std=gnu11", "-O2", "-ffp-contract=off", "-fno-math-errno"),
        *("-ffunction-sections", "-fdata-sections", "-Wl,--gc-sections", "-nostartfiles"),
        *("--specs=nano.specs", "--specs=nosys.specs", "-I", folder, "-I", source, "-T", HERE / "mps2.ld"),
        *(HERE / "startup.c", *_bench(folder, kinds), *_objects(board.compiler, source, kinds), "-lm", "-o", image),
    )
    symbols = {
        words[2]: words[0]
        for line in run("arm-none-eabi-nm", image).stdout.splitlines()
        if len(words := line.split()) == 3
    }
    plugin = f"{counter()},begin=0x{symbols['mark_begin']},end=0x{symbols['mark_end']},kinds={len(kinds) + 1}"
    done = run(
        *("qemu-system-arm", "-M", board.machine, "-nographic", "-monitor", "none", "-serial", "none"),
        *("-semihosting-config", "enable=on,target=native", "-plugin", plugin, "-kernel", image),
        timeout=100,
    )
    return answers(done.stderr + done.stdout, board.precision, kinds), image


def code_size(board: Board, source: Path) -> tuple[dict[str, int], dict[str, int]]:
    """Bytes of code and constants of each module but the profile, and the stack of two step functions."""
    sizes, stack = {}, {}
    for name in MODULES:
        target = compiled(board.compiler, source / f"tff_{name}.c")
        sizes[name] = int(run("arm-none-eabi-size", target).stdout.splitlines()[1].split()[0])
        for line in target.with_suffix(".su").read_text().splitlines():
            where, size, _ = line.split("\t")
            stack[where.split(":")[-1]] = int(size)
    inner = [size for name, size in stack.items() if name.startswith("tff_inverse_after")]  # where it is not inlined
    inverse = stack["tff_inverse_step"] + max(inner, default=0) + stack["tff_output_set"]
    inner = ("advance", "step", "solve", "evaluate")  # where they are not inlined
    plant = stack["tff_plant_step"] + sum(stack.get(f"tff_chain_{name}", 0) for name in inner)
    return sizes, {"inverse": inverse, "plant": plant}


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """These tests share an expensive fixture: keep them on one worker where the scheduler can."""
    for item in items:
        if item.path.is_relative_to(HERE):
            item.add_marker(pytest.mark.xdist_group("target"))
