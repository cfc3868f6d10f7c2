"""Cost of reading and writing CSV files, beside numpy and pandas, in one run.

    python benchmarks/files.py

Prints microseconds per row (best of three) and the ratio to our own; every number that we write reads back exactly.
"""

import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd

from tendonff.compensator.files.reading import read_csv
from tendonff.compensator.files.writing import write_csv


def best_of_three(work: Callable[[], object]) -> float:
    times = []
    for _ in range(3):
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    return min(times)


def main() -> None:
    rows = 50_000
    rng = np.random.default_rng(0)
    with tempfile.TemporaryDirectory() as scratch:
        file = Path(scratch) / "x.csv"
        for columns in (10, 44):
            table = rng.normal(size=(rows, columns))
            named = {f"c{k}": table[:, k] for k in range(columns)}
            frame = pd.DataFrame(named)
            ways: dict[str, Callable[[], object]] = {
                "tendonff": lambda named=named: write_csv(file, named),
                "numpy.savetxt, %.17g": lambda table=table: np.savetxt(file, table, delimiter=",", fmt="%.17g"),
                "pandas.to_csv": lambda frame=frame: frame.to_csv(file, index=False),
            }
            costs = {name: best_of_three(way) for name, way in ways.items()}
            for name, cost in costs.items():
                ratio = cost / costs["tendonff"]
                print(f"write {columns:3d} columns  {name:22s} {1e6 * cost / rows:6.2f} us/row  {ratio:5.1f} x")
        write_csv(file, {"time_s": np.arange(rows) * 1e-3, "force_N": rng.normal(size=rows)})
        ours = best_of_three(lambda: read_csv(file, ["time_s", "force_N"]))
        plain = best_of_three(lambda: pd.read_csv(file))
        print(f"read, checked      tendonff               {1e6 * ours / rows:6.2f} us/row    1.0 x")
        print(f"read, unchecked    pandas.read_csv        {1e6 * plain / rows:6.2f} us/row  {plain / ours:5.1f} x")


if __name__ == "__main__":
    main()
