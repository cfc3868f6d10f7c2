#!/usr/bin/env python3
"""Run tests as other machines would: processors, math libraries and compilers that round differently.

    python tests/environments.py                         every environment, the tests that are cheap and sensitive
    python tests/environments.py older no-compiler       these environments
    python tests/environments.py clang -- tests          any tests, here the whole suite
    python tests/environments.py --list

Linux on x86-64; elsewhere only the compilers differ. Exit status 0 when the tests pass in all of them.
"""

import argparse
import os
import subprocess
import sys
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy._core._multiarray_umath as umath

ROOT = Path(__file__).resolve().parents[1]


def dispatched() -> str:
    """Features for which numpy has code of its own, and that this processor has."""
    return " ".join(f for f in umath.__cpu_dispatch__ if umath.__cpu_features__.get(f))


LIBM = {"GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX512F,-AVX2,-FMA,-FMA4"}  # math library without wide registers
NUMPY = {"NPY_DISABLE_CPU_FEATURES": dispatched()}
BLAS = {"OPENBLAS_CORETYPE": "Prescott"}
ENVIRONMENTS: Mapping[str, Mapping[str, str]] = {
    "libm": LIBM,
    "numpy": NUMPY,
    "blas": BLAS,
    "clang": {"CC": "clang"},
    "march": {"CC": "cc -march=native"},
    "another-machine": LIBM | NUMPY | BLAS | {"CC": "clang -march=native"},  # all at once
    "no-compiler": {"CC": "no-compiler"},
}
GOLDEN = ("tests/golden", "-k")

# Cheap and sensitive ones: tables, simulations, exact inverses with their exported code, a fit. They take 43 s of one
# core in all; every golden test takes 250 s in one environment, and far more without a compiler.
OF_CI: Mapping[str, str] = {
    "another-machine": "table_gives or simulate_gives or export_c_gives and (surgical or finger-double or finger-float)"
    " or identify_gives and synthetic",
    "no-compiler": "simulate_gives",
}


def run_tests(name: str, tests: Sequence[str]) -> tuple[int, str]:
    """Exit status and output of pytest in an environment."""
    environment = {k: v for k, v in os.environ.items() if k not in {"CC", "PYTEST_ADDOPTS"}} | ENVIRONMENTS[name]
    command = [sys.executable, "-m", "pytest", "-n", "0", "-q", "-rs", "--durations=3", *tests]
    run = subprocess.run(
        command, cwd=ROOT, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False
    )
    return run.returncode, run.stdout


def main() -> int:
    """Run the tests in every chosen environment, as many at a time as there are processors."""
    arguments = sys.argv[1:]
    given: Sequence[str] = ()
    if "--" in arguments:
        place = arguments.index("--")
        arguments, given = arguments[:place], arguments[place + 1 :]
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", metavar="NAME", choices=[[], *ENVIRONMENTS])
    parser.add_argument("--ci", action="store_true", help="those that continuous integration runs")
    parser.add_argument("--list", action="store_true", help="print the environments and their variables")
    chosen = parser.parse_args(arguments)
    names = chosen.names or tuple(OF_CI if chosen.ci else ENVIRONMENTS)
    if chosen.list:
        for name in names:
            print(name, *(f"{k}={v}" for k, v in ENVIRONMENTS[name].items()))
        return 0
    most = OF_CI["another-machine"]
    tests = {name: given or (*GOLDEN, OF_CI.get(name, most)) for name in names}
    status = 0
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        for name, (code, said) in zip(names, pool.map(lambda n: run_tests(n, tests[n]), names), strict=True):
            print(f"== {name}: {'passed' if code == 0 else 'FAILED'}\n{said if code else said[-1500:]}", flush=True)
            status = status or code
    return status


if __name__ == "__main__":
    sys.exit(main())
