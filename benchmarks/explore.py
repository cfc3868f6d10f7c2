"""CPU of a slider's move in `tendonff explore`: the fast curves again, for another friction coefficient.

python benchmarks/explore.py
"""

import time
from pathlib import Path

from tendonff.compensator.scenarios import load_scenario
from tendonff.compensator.studies.explore.run import Explorer

EXAMPLES = Path(__file__).resolve().parents[1] / "examples"
SCENARIOS = ("finger", "bowden", "exosuit", "finger_moving")


def main() -> None:
    print("| scenario | a move | largest of five |\n|---|---:|---:|")
    for name in SCENARIOS:
        explorer, taken = Explorer(load_scenario(EXAMPLES / f"{name}.toml")), []
        start = {knob.key: knob.value for knob in explorer.knobs}
        explorer.explore(start, design_knows=True, curves=explorer.fast)  # compiles
        for k in range(1, 6):
            began = time.process_time()
            moved = start | {"mu": start["mu"] * (1 + 0.02 * k)}
            explorer.explore(moved, design_knows=True, curves=explorer.fast)
            taken.append(time.process_time() - began)
        print(f"| {name} | {sorted(taken)[2]:.2f} s | {max(taken):.2f} s |", flush=True)


if __name__ == "__main__":
    main()
