"""CPU of a slider's move in `tendonff explore`: the fast curves again, for another friction coefficient.

python benchmarks/explore.py
"""

import time
from dataclasses import replace
from pathlib import Path

from tendonff.compensator.scenarios import load_scenario
from tendonff.compensator.studies.explore.run import Explorer

EXAMPLES = Path(__file__).resolve().parents[1] / "examples"
SCENARIOS = ("finger", "bowden", "exosuit", "finger_moving")


def main() -> None:
    print("| scenario | a move | largest of five |\n|---|---:|---:|")
    for name in SCENARIOS:
        explorer, taken = Explorer(load_scenario(EXAMPLES / f"{name}.toml")), []
        explorer.at(explorer.start)  # compiles
        for k in range(1, 6):
            began = time.process_time()
            explorer.at(replace(explorer.start, mu=explorer.start.mu * (1 + 0.02 * k)))
            taken.append(time.process_time() - began)
        print(f"| {name} | {sorted(taken)[2]:.2f} s | {max(taken):.2f} s |", flush=True)


if __name__ == "__main__":
    main()
