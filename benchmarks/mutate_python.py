"""Count the mutants of models/ and ocp/ that the project's own tests kill.

Run: python benchmarks/mutate_python.py [--count 40] [--minutes 30] [--seed 1] [--only models/tendon/friction.py]

A mutant changes one operator, comparison, constant or truth value of the code (decorators apart), in a copy of the
repository, and is tried with the tests that name its file first, then with those of its folder. One that does not
differ from the original, as a tolerance or a cache, lives too. Reports the share that dies with its 95 % interval.
"""

import argparse
import ast
import math
import os
import random
import re
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
SECONDS = 300
OPERATORS: dict[type, str] = {
    ast.Add: "-", ast.Sub: "+", ast.Mult: "/", ast.Div: "*", ast.Lt: "<=", ast.LtE: "<", ast.Gt: ">=", ast.GtE: ">",
    ast.Eq: "!=", ast.NotEq: "==", ast.And: "or", ast.Or: "and",
}  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class Mutant:
    """Change of a file."""

    file: str
    line: int
    what: str
    text: str


def mutants(file: str) -> Iterator[Mutant]:
    """Every single change of a file."""
    text = (ROOT / file).read_text(encoding="utf-8")
    starts = [0]
    for line in text.splitlines(keepends=True):
        starts.append(starts[-1] + len(line.encode()))
    raw = text.encode()

    def at(node: ast.AST, *, end: bool = False) -> int:
        line, column = (node.end_lineno, node.end_col_offset) if end else (node.lineno, node.col_offset)
        return starts[line - 1] + column

    def change(node: ast.AST, first: int, last: int, new: str) -> Mutant:
        old = raw[first:last].decode().strip()
        changed = (
            raw[:first] + f" {new} ".encode() + raw[last:] if old in OLD else raw[:first] + new.encode() + raw[last:]
        )
        return Mutant(file=file, line=node.lineno, what=f"{old} -> {new}", text=changed.decode())

    tree = ast.parse(text)
    passive = {
        id(part) for node in ast.walk(tree) for each in getattr(node, "decorator_list", ()) for part in ast.walk(each)
    }
    for node in ast.walk(tree):
        if id(node) in passive:
            continue
        if isinstance(node, ast.BinOp) and type(node.op) in OPERATORS:
            yield from _between(change, raw, node, at(node.left, end=True), at(node.right), OPERATORS[type(node.op)])
        elif isinstance(node, ast.Compare) and len(node.ops) == 1 and type(node.ops[0]) in OPERATORS:
            where = at(node.left, end=True), at(node.comparators[0])
            yield from _between(change, raw, node, *where, OPERATORS[type(node.ops[0])])
        elif isinstance(node, ast.BoolOp):
            where = at(node.values[0], end=True), at(node.values[1])
            yield from _between(change, raw, node, *where, OPERATORS[type(node.op)])
        elif isinstance(node, ast.Constant) and type(node.value) in (bool, int, float):
            value = node.value
            new = str(not value) if isinstance(value, bool) else repr(value + 1 if value in (0, 1) else value * 1.5)
            if isinstance(value, int) and not isinstance(value, bool):
                new = str(value + 1)
            yield change(node, at(node), at(node, end=True), new)


OLD = {"+", "-", "*", "/", "<", "<=", ">", ">=", "==", "!=", "and", "or"}


def _between(change, raw: bytes, node: ast.AST, first: int, last: int, new: str) -> Iterator[Mutant]:
    """The operator between two operands; brackets that stand there too are left alone."""
    gap = raw[first:last].decode()
    old = gap.strip(" ()\n")
    if old in OLD:
        place = first + gap.encode().index(old.encode())
        yield change(node, place, place + len(old), new)


def tests_of(file: str) -> list[list[str]]:
    """Tests that name the file, then those of its folder and of its dependents."""
    part = Path(file)
    named = re.compile(rf"\b{part.parent.as_posix().replace('/', '.')}\.{part.stem}\b")
    every = sorted((ROOT / "tests" / part.parts[0]).rglob("test_*.py"))
    if part.parts[0] == "models":
        every += sorted((ROOT / "tests" / "ocp" / "tendon").glob("test_*.py"))
    every.sort(key=lambda test: test.stem != f"test_{part.stem}")
    own = [str(test.relative_to(ROOT)) for test in every if named.search(test.read_text(encoding="utf-8"))]
    folder = Path("tests") / part.parent
    near = [str(folder)] if (ROOT / folder).is_dir() else []
    wide = ["tests/ocp/tendon/test_simulate.py", "tests/ocp/tendon/test_inverse.py", "tests/test_theory.py"]
    return [tests for tests in (own, [*near, *wide]) if tests]


def survives(copy: Path, mutant: Mutant) -> bool | None:
    """Whether all tests pass; None where they take too long, be it the mutant or the machine."""
    original = (copy / mutant.file).read_text(encoding="utf-8")
    (copy / mutant.file).write_text(mutant.text, encoding="utf-8")
    try:
        environment = {**os.environ, "PYTHONDONTWRITEBYTECODE": "1", "PYTHONPATH": str(copy)}
        for chosen in tests_of(mutant.file):
            command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", *chosen]
            done = subprocess.run(command, cwd=copy, env=environment, capture_output=True, timeout=SECONDS, check=False)
            if done.returncode != 0:
                return False
        return True
    except subprocess.TimeoutExpired:
        return None
    finally:
        (copy / mutant.file).write_text(original, encoding="utf-8")


def interval(hits: int, tried: int) -> tuple[float, float]:
    """Wilson's 95 % interval of a share."""
    z2 = 1.96**2
    middle = (hits + z2 / 2) / (tried + z2)
    half = math.sqrt(z2 * (hits * (tried - hits) / tried + z2 / 4)) / (tried + z2)
    return middle - half, middle + half


def main() -> int:
    """Print the score and the survivors."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=40)
    parser.add_argument("--minutes", type=float, default=1e9, help="no further mutant after so long")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", default="")
    options = parser.parse_args()
    files = [options.only] if options.only else [
        str(path.relative_to(ROOT)) for layer in ("models", "ocp") for path in sorted((ROOT / layer).rglob("*.py"))
    ]  # fmt: skip
    every = [mutant for file in files for mutant in mutants(file)]
    chosen = random.Random(options.seed).sample(every, min(options.count, len(every)))  # noqa: S311 - nothing secret
    alive = []
    with tempfile.TemporaryDirectory() as scratch:
        copy = Path(scratch) / "copy"
        shutil.copytree(
            ROOT, copy, symlinks=True, ignore=shutil.ignore_patterns(".git", "__pycache__", ".venv", "site")
        )
        ends, tried = time.monotonic() + 60 * options.minutes, 0
        for mutant in chosen:
            if time.monotonic() > ends:
                break
            lives = survives(copy, mutant)
            tried += lives is not None
            if lives is None:
                print(f"too long: {mutant.file}:{mutant.line} {mutant.what}", flush=True)
            elif lives:
                alive.append(mutant)
                print(f"alive ({tried} tried): {mutant.file}:{mutant.line} {mutant.what}", flush=True)
    low, high = interval(tried - len(alive), tried)
    share = f"{100 * low:.0f} to {100 * high:.0f} %, Wilson 95 %"
    print(f"{tried - len(alive)} of {tried} die ({share}), of {len(every)} in all")
    return 0


if __name__ == "__main__":
    sys.exit(main())
