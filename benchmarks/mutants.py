"""Count the mutants of the exported C that the shipped self test kills.

Run: python benchmarks/mutants.py examples/finger.toml [--precision float] [--count 90] [--first 0]

Safety mutants (limits, rate, clamps, guards, status bits, data) are listed below and must all die. Random mutants
change one operator or constant of a module; one that survives counts as observable where its outputs on a random
sequence of calls, jumps, holds and bad inputs differ from the original's by more than rounding: by more than those of
the original do, compiled with products and sums rounded in one, and at least 1e-8. They are drawn from all
modules of the scenario: those of examples/finger_adaptive.toml and of one whose joints move are all there are. Of a
joint between tendons (examples/hand_joint_adaptive.toml) the random ones alone are drawn.
"""

import argparse
import hashlib
import math
import random
import re
import shutil
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

import numpy as np

import tendonff as tf
from benchmarks.safety_mutants import LIVE, RESTS, SWAPS
from tendonff.compensator.compensators.motors.finger import FingerTask
from tendonff.compensator.export.c_project import export_project
from tendonff.compensator.export.joint.text import accepted_rad
from tendonff.compensator.scenario.driven.finger import FingerScenario
from tendonff.compensator.scenario.driven.joint import JointScenario, sample_joint

FLAGS = ("-std=c99", "-O1", "-w", "-ffp-contract=off", "-fno-math-errno")
CONTRACTED = ("-std=c99", "-O2", "-w", "-ffp-contract=fast", "-march=native")
MOST_ROUNDING = 1e-6
DRIVER, JOINT_DRIVER, FINGER_DRIVER = (
    Path(__file__).with_name(name) for name in ("mutants.c", "mutants_joint.c", "mutants_finger.c")
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Mutant:
    """Change of a file."""

    file: str
    what: str
    text: str


FACTORS = (
    ("FORCE_MAX_N", 10),
    ("FORCE_MAX_N", 0.5),
    ("CHANGE_MAX_N", 10),
    ("CHANGE_MAX_N", 0.5),
    ("REFERENCE_MAX_N", 10),
    ("REFERENCE_MAX_N", 0.5),
    ("REFERENCE_MIN_N", 0.1),
    ("STEP_S", 10),
)
ARRAYS = ("pull_ratio", "release_ratio", "pull_share", "release_share", "pull_cell")
LITERAL = re.compile(r"(?<![\w.])(\d+\.\d+)(?![\w.])")
NUMBER = re.compile(r"-?\d[\d.e+-]*[fu]?")


def safety(files: dict[str, str], precision: str) -> Iterator[Mutant]:
    """Mutants that can hurt a person or break the rig."""
    for end, what, before, after in (*SWAPS, *LIVE, *RESTS):
        if f"tff_{end}" not in files:
            continue  # the scenario has no such module
        text = files[f"tff_{end}"]
        old, new = (LITERAL.sub(r"\1f", part) if precision == "float" else part for part in (before, after))
        if old not in text:
            raise SystemExit(f"{what}: tff_{end} does not hold {old!r}; bring the list up to date")
        yield Mutant(file=f"tff_{end}", what=what, text=text.replace(old, new, 1))
    for name, factor in FACTORS:
        pattern = rf"(#define TFF_{name} )(\S+)"
        text, found = re.subn(pattern, rf"\g<1>((tff_real){factor} * \g<2>)", files["tff_types.h"], count=1)
        if not found:
            raise SystemExit(f"tff_types.h does not define TFF_{name}; bring the list up to date")
        yield Mutant(file="tff_types.h", what=f"{name} times {factor:g}", text=text)
    text = files["tff_limits.c"]
    for found in re.finditer("TFF_(FORCE|RATE)_LIMITED", text):
        changed = text[: found.start()] + "TFF_OK" + text[found.end() :]
        yield Mutant(file="tff_limits.c", what=f"{found[0]} at {found.start()} not set", text=changed)
    yield from _torn_data(files)


def _torn_data(files: dict[str, str]) -> Iterator[Mutant]:
    """Samples and table entries that are not what was designed."""
    text = files["tff_profile.c"]
    start, end = text.index("= {") + 3, text.index("};")
    numbers = list(NUMBER.finditer(text, start, end))
    for k in (0, len(numbers) // 2, len(numbers) - 1):
        found = numbers[k]
        changed = f"{text[: found.start()]}(tff_real)0.5 * {found[0]}{text[found.end() :]}"
        yield Mutant(file="tff_profile.c", what=f"profile sample {k} halved", text=changed)
    halved = NUMBER.sub(lambda found: f"(tff_real)0.5 * {found[0]}", text[start:end])
    yield Mutant(file="tff_profile.c", what="every profile sample halved", text=text[:start] + halved + text[end:])
    text = files["tff_table_data.h"]
    for array in ARRAYS:
        start = text.index("{", text.index(f"tff_table_{array}["))
        found = list(NUMBER.finditer(text, start, text.index("}", start)))[3]
        changed = f"{text[: found.start()]}1 + {text[found.start() :]}"
        yield Mutant(file="tff_table_data.h", what=f"one entry of {array}", text=changed)


OPERATORS = {
    " + ": " - ", " - ": " + ", " * ": " / ", " / ": " * ", " < ": " <= ", " <= ": " < ", " > ": " >= ", " >= ": " > ",
    " && ": " || ", " || ": " && ", " == ": " != ", " != ": " == ",
}  # fmt: skip


def random_mutants(files: dict[str, str], count: int, seed: int, first: int = 0) -> Iterator[Mutant]:
    """Single changes of operators and constants in the code of the modules, comments apart, in random order."""
    chosen = random.Random(seed)  # noqa: S311 - nothing secret
    places = []
    for name, text in files.items():
        if not re.fullmatch(r"tff_(?!profile).*\.c|tff_(?:core|inversion|state)\.h", name):
            continue
        bare = re.sub(r"/\*.*?\*/|#include[^\n]*", lambda m: " " * len(m[0]), text, flags=re.DOTALL)
        for operator in OPERATORS:
            places += [(name, m.start(), operator) for m in re.finditer(re.escape(operator), bare)]
        places += [(name, m.start(), m[0]) for m in re.finditer(r"(?<![\w.\[])\d+\.\d[\d.e+-]*f?", bare)]
    chosen.shuffle(places)
    for name, place, old in places[first : first + count]:
        text = files[name]
        new = OPERATORS.get(old) or f"(tff_real)1.01 * {old}" if float_of(old) != 0 else "(tff_real)0.01"
        line = text[:place].count("\n") + 1
        yield Mutant(
            file=name,
            what=f"{name}:{line} {old.strip()} -> {new.strip()}",
            text=text[:place] + new + text[place + len(old) :],
        )


def float_of(text: str) -> float:
    """The number, or 1 for an operator."""
    try:
        return float(text.rstrip("f"))
    except ValueError:
        return 1.0


def build(
    folder: Path, main: str, target: str, defines: tuple[str, ...] = (), flags: tuple[str, ...] = FLAGS
) -> Path | None:
    """Compile; None where the compiler refuses. A file that is as before, headers included, keeps its object."""
    headers = b"".join(path.read_bytes() for path in sorted(folder.glob("*.h")))
    objects = []
    for source in [folder / main, *(p for p in sorted(folder.glob("tff_*.c")) if not p.name.endswith("_test.c"))]:
        key = hashlib.sha256(b"\0".join([repr((defines, flags)).encode(), headers, source.read_bytes()])).hexdigest()
        made = folder / f"{key}.o"
        if not made.exists():
            command = ["cc", *flags, *defines, "-I", str(folder), "-c", str(source), "-o", str(made)]
            if subprocess.run(command, capture_output=True, check=False).returncode != 0:
                return None
        objects.append(str(made))
    done = subprocess.run(["cc", *objects, "-lm", "-o", str(folder / target)], capture_output=True, check=False)
    return folder / target if done.returncode == 0 else None


def passes(program: Path) -> bool:
    """Whether the self test passes."""
    try:
        return subprocess.run([str(program)], capture_output=True, timeout=20, check=False).returncode == 0
    except subprocess.TimeoutExpired:
        return False


def answers(program: Path) -> str:
    """Output of the driver; nothing where it does not end."""
    try:
        return subprocess.run([str(program)], capture_output=True, text=True, timeout=120, check=False).stdout
    except subprocess.TimeoutExpired:
        return ""


def difference(one: str, two: str) -> float:
    """Largest difference of two outputs, relative to 1 and each; infinite where one ends or is NaN, 0 if bit-equal."""
    apart = 0.0
    for x, y in zip(one.splitlines(), two.splitlines(), strict=False):
        if x != y:
            pairs = [(float(a), float(b)) for a, b in zip(x.split(), y.split(), strict=False)]
            differ = [
                0.0 if a == b or (math.isnan(a) and math.isnan(b)) else abs(a - b) / (1 + abs(a)) for a, b in pairs
            ]
            apart = max(apart, *(math.inf if math.isnan(each) else each for each in differ))
    return math.inf if len(one.split()) != len(two.split()) else apart


def rounding(folder: Path, defines: tuple[str, ...], expected: str) -> float:
    """By how much the original differs when it rounds otherwise; 0 where that changes a status or needs more words."""
    apart = difference(expected, answers(build(folder, "driver.c", "rounded", defines, CONTRACTED)))
    return 2 * apart if apart < MOST_ROUNDING else 0.0


class Fate(StrEnum):
    """Fate of a mutant."""

    DEAD = "dead"  # the self test fails
    ALIVE = "alive"
    ROUNDED = "differ by rounding"  # by at most the bound
    EQUAL = "give the same bits"
    UNBUILT = "do not compile"


@dataclass(kw_only=True)
class Bench:
    """Exported files in a folder, in which one is replaced at a time."""

    folder: Path
    files: dict[str, str]
    defines: tuple[str, ...]
    expected: str  # output of the driver
    relative: float
    apart: float = 0.0  # largest difference of the last mutant that lived

    def judge(self, mutant: Mutant) -> Fate:
        """Build, test and, if it lives, drive a mutant."""
        (self.folder / mutant.file).write_text(mutant.text)
        try:
            tested = build(self.folder, "self_test.c", "self_test")
            if tested is None:
                return Fate.UNBUILT
            if not passes(tested):
                return Fate.DEAD
            program = build(self.folder, "driver.c", "driver", self.defines)
            self.apart = math.inf if program is None else difference(self.expected, answers(program))
            if self.apart > self.relative:
                return Fate.ALIVE
            return Fate.ROUNDED if self.apart > 0 else Fate.EQUAL
        finally:
            (self.folder / mutant.file).write_text(self.files[mutant.file])


def subject(
    scenario: tf.Scenario | JointScenario | FingerScenario, options: argparse.Namespace
) -> tuple[Path, dict[str, str], tuple[str, ...]]:
    """Driver, exported files and what the driver has to know."""
    precision = tf.Precision(options.precision)
    if isinstance(scenario, FingerScenario):
        fingers = tf.export_c(scenario, precision=precision, force_export=True)
        return FINGER_DRIVER, dict(fingers.files), _of_finger(FingerTask.of(scenario))
    if isinstance(scenario, JointScenario):
        joints = tf.export_c(scenario, precision=precision, force_export=True)
        angle = sample_joint(scenario).angle_rad
        low, high = accepted_rad(scenario, sample_joint(scenario))
        values = zip(("LOW", "HIGH", "START"), (low, high, float(angle[0])), strict=True)
        more = ("-DADAPTIVE",) if "tff_joint_adaptive.c" in joints.files else ()
        return JOINT_DRIVER, dict(joints.files), (*(f"-D{n}={float(v)!r}" for n, v in values), *more)
    tension = tf.sample_reference(scenario).tension_N
    profile = tension if options.random_only else None
    exported = export_project(scenario, precision=precision, profile_N=profile, force_export=True)
    span = (float(tension.min()), float(tension.max()), float(tension[0]))
    defines = tuple(f"-D{n}={v!r}" for n, v in zip(("LOW", "HIGH", "START"), span, strict=True))
    defines += (f"-DJOINTS={len(scenario.joints)}",)
    defines += tuple(f"-DWITH_{Path(name).stem[4:].upper()}" for name in exported.files if name.endswith(".c"))
    return DRIVER, dict(exported.files), defines


def _of_finger(task: FingerTask) -> tuple[str, ...]:
    """Definitions of a finger for its driver."""
    angle, wanted = task.wanted_rad, task.scenario.wanted
    problem = task.problem(task.finger)
    beyond = 0.05 * np.ptp(angle, axis=0)
    load = problem.tension_N.max() * problem.scale_m()[:wanted]
    rows = {"LEAST": angle.min(axis=0) - beyond, "MOST": angle.max(axis=0) + beyond, "START": angle[0], "LOAD": load}
    texts = {name: ", ".join(repr(float(value)) for value in row) for name, row in rows.items()}
    return f"-DCOUNT={wanted}", *(f"-D{name}={{{text}}}" for name, text in texts.items())


def main() -> int:
    """Report the survivors; exit status 1 where a safety mutant lives."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scenario")
    parser.add_argument("--precision", choices=("double", "float"), default="double")
    parser.add_argument("--count", type=int, default=90)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--random-only", action="store_true", help="leave out the safety mutants")
    parser.add_argument("--only", default="", help="mutants whose name holds this")
    parser.add_argument("--first", type=int, default=0, help="random mutants to pass over, of the same seed")
    options = parser.parse_args()
    scenario = tf.load_scenario(options.scenario)
    driver, files, defines = subject(scenario, options)
    relative = 1e-4 if options.precision == "float" else 1e-8
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch) / "code"
        folder.mkdir()
        for name, text in files.items():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            (folder / name).write_text(text)
        shutil.copyfile(driver, folder / "driver.c")
        original = build(folder, "self_test.c", "self_test")
        if original is None or not passes(original):
            raise SystemExit("the original does not pass its own self test")
        expected = answers(build(folder, "driver.c", "driver", defines))
        relative = max(relative, rounding(folder, defines, expected))

        bench = Bench(folder=folder, files=files, defines=defines, expected=expected, relative=relative)
        alive = []
        listed = [] if "tff_path.c" in files or driver is not DRIVER else list(safety(files, options.precision))
        listed = [m for m in listed if options.only in m.what and not options.random_only]
        if not getattr(getattr(scenario, "adaptation", None), "integral_gain_per_s", 0.0):
            listed = [m for m in listed if "integra" not in m.what]  # the same without integral action
        alive = [mutant.what for mutant in listed if bench.judge(mutant) is not Fate.DEAD]
        print(f"safety mutants: {len(listed) - len(alive)} of {len(listed)} die; alive: {alive or 'none'}")
        fates = dict[str, Counter[Fate]]()
        for mutant in random_mutants(files, options.count, options.seed, options.first):
            if options.only in mutant.what:
                fate = bench.judge(mutant)
                fates.setdefault(mutant.file, Counter())[fate] += 1
                if fate is not Fate.DEAD:
                    print(f"  {fate}: {mutant.what} ({bench.apart:.2g})", flush=True)
        for name, of_file in (*sorted(fates.items()), ("random mutants", sum(fates.values(), Counter()))):
            print(f"{name}: {', '.join(f'{of_file[fate]} {fate}' for fate in Fate)}")
    return 1 if alive else 0


if __name__ == "__main__":
    sys.exit(main())
