"""CPU of whole commands, beside a process that imports casadi, scipy and matplotlib and draws three plain figures.

    python benchmarks/commands.py              design finger, design finger_fast, compare exosuit
    python benchmarks/commands.py exosuit      those whose name contains the word

Every command runs once to compile what it needs, and then as often as `_RUNS` says, in turn with the plain process; the
least CPU of each counts, children included. The plain process is 1.0.
"""

import os
import subprocess
import sys
import tempfile
from pathlib import Path

EXAMPLES = Path(__file__).resolve().parents[1] / "examples"
_RUNS = 2
_PLAIN = """
import casadi, numpy, scipy.optimize, scipy.signal, scipy.stats, scipy.interpolate, matplotlib
matplotlib.use("svg")
from matplotlib import pyplot
for k in range(3):
    figure, axes = pyplot.subplots()
    axes.plot(numpy.sin(numpy.arange(1000.0)), label="sine")
    axes.set(xlabel="time", ylabel="value", title="plain")
    axes.legend()
    figure.savefig(f"plain{k}.svg")
"""
COMMANDS = {
    "design finger": ["design", str(EXAMPLES / "finger.toml"), "--out", "out"],
    "design finger_fast": ["design", str(EXAMPLES / "finger_fast.toml"), "--out", "out"],
    "compare exosuit": ["compare", str(EXAMPLES / "exosuit.toml"), "--out", "out"],
}
_ENTRY = "from tendonff.compensator.cli import main; main()"


def cpu_s(arguments: list[str], folder: str) -> float:
    """CPU of a process and its children [s]."""
    before = os.times()
    subprocess.run([sys.executable, *arguments], cwd=folder, check=True, stdout=subprocess.DEVNULL)
    after = os.times()
    return after.children_user + after.children_system - before.children_user - before.children_system


def main() -> None:
    wanted = sys.argv[1] if len(sys.argv) > 1 else ""
    plain = ["-c", _PLAIN]
    with tempfile.TemporaryDirectory() as folder:
        cpu_s(plain, folder)
        print("| command | CPU | plain process | ratio |\n|---|---:|---:|---:|")
        for name, arguments in COMMANDS.items():
            if wanted not in name:
                continue
            command = ["-c", _ENTRY, *arguments]
            cpu_s(command, folder)
            pairs = [(cpu_s(command, folder), cpu_s(plain, folder)) for _ in range(_RUNS)]
            taken, beside = (min(column) for column in zip(*pairs, strict=True))
            print(f"| {name} | {taken:.2f} s | {beside:.2f} s | {taken / beside:.2f} |", flush=True)


if __name__ == "__main__":
    main()
