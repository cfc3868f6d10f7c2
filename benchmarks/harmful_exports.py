"""Count modules that `export-c` hands out and that are worse than no compensation, judged apart from the package.

Run: python benchmarks/harmful_exports.py [--count 117] [--seed 1] [--rows rows.jsonl]

The scenarios of `self_tests.py`. The exported C of every module follows the scenario's reference; its force drives
the plant of `independent_plant.py` with the scenario's level, once with the scenario's number of masses and once with
40. A stream counts against the reference delayed by its stated lag, no compensation never is. Goes on where it was
killed if it is given a file for its rows.
"""

import argparse
import json
import subprocess
import sys
import tempfile
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
from independent_plant import MASSES, Array, Plant
from self_tests import a_scenario

import tendonff as tf
from tendonff.compensator.compensators.score import Score, is_worse, score
from tendonff.compensator.files.reading import InputError
from tendonff.models.errors import ParameterError
from tendonff.ocp.errors import SolveError

FOLLOWERS = ("inverse", "table", "capstan", "stream")
FLAGS = ("-std=c99", "-O2", "-w", "-ffp-contract=off", "-fno-math-errno")


def forces(exported: object, reference: Array) -> dict[str, Array]:
    """Force of each exported module at the rows of the reference."""
    names = [name for name in (*FOLLOWERS, "profile") if f"tff_{name}.c" in exported.files]
    steps = {name: f"tff_{name}_step(&a_{name}{'' if name == 'profile' else ', r'})" for name in names}
    starts = "".join(f"    tff_{name}_init(&a_{name}{'' if name == 'profile' else ', start'});\n" for name in names)
    driver = "#include <stdio.h>\n" + "".join(f'#include "tff_{name}.h"\n' for name in names)
    driver += "".join(f"static tff_{name} a_{name};\n" for name in names)
    driver += f'int main(void)\n{{\n    double r, start;\n    if (scanf("%lf", &start) != 1) return 1;\n{starts}'
    driver += '    while (scanf("%lf", &r) == 1) {\n'
    driver += "".join(f'        printf("%.17g ", (double){call});\n' for call in steps.values())
    driver += '        printf("\\n");\n    }\n    return 0;\n}\n'
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch) / "c"
        exported.write(folder)
        (folder / "driver.c").write_text(driver)
        sources = [str(folder / "driver.c"), *sorted(str(p) for p in folder.glob("tff_*.c"))]
        subprocess.run(["cc", *FLAGS, *sources, "-lm", "-o", str(folder / "driver")], check=True)
        given = "\n".join(f"{value!r}" for value in map(float, (reference[0], *reference)))
        said = subprocess.run([str(folder / "driver")], input=given, capture_output=True, text=True, check=True).stdout
    return dict(zip(names, np.array([list(map(float, line.split())) for line in said.splitlines()]).T, strict=True))


def plant_of(scenario: tf.Scenario, masses: int) -> Plant:
    """The independent plant of a scenario's level."""
    t = scenario.transmission
    tendon, friction = t.tendon, t.friction
    if scenario.run.level is tf.Level.ELASTIC:
        tendon = replace(tendon, relaxing_stiffness_N_per_m=1e-9)
    if scenario.run.level is not tf.Level.PRESLIDING:
        friction = replace(friction, soft_bristle_stiffness_N_per_m=friction.bristle_stiffness_N_per_m)
    return Plant(transmission=replace(t, tendon=tendon, friction=friction), masses=masses)


def replayed(scenario: tf.Scenario, plant: Plant, force: Array, wanted: Array, first: int = 0) -> Score:
    """Error of a force on the plant, from a sample on."""
    return score(wanted[first:], plant.respond(force, scenario.run.step_s, float(wanted[0]))[first:, 1])


def row(seed: int, number: int) -> dict[str, object]:
    """Modules of a scenario left out, and errors of each exported module on both plants."""
    scenario = a_scenario(np.random.default_rng([seed, number]))
    try:
        exported = tf.export_c(scenario)
    except (InputError, ParameterError, SolveError) as error:
        return {"number": number, "refused": type(error).__name__, "said": str(error)[:200]}
    reference = tf.sample_reference(scenario).tension_N
    stream = json.loads(exported.files["design.json"])["stream"] or {"lag_s": 0.0}
    lag = round(stream["lag_s"] / scenario.run.step_s)
    ahead = max(0, -lag)  # samples that the caller passes ahead of time
    given = np.pad(reference, (0, ahead), mode="edge")
    found: dict[str, object] = {}
    plants = {"same": plant_of(scenario, scenario.transmission.path.segments), "fine": plant_of(scenario, MASSES)}
    nothing = {which: replayed(scenario, plant, reference, reference) for which, plant in plants.items()}
    scored = {each.module: each.score.rmse_percent_of_range for each in exported.judged if each.score is not None}
    for name, force in forces(exported, given).items():
        is_stream = name == "stream"
        rows = len(given if is_stream else reference)
        wanted = np.pad(given, (abs(lag) if is_stream else 0, 0), mode="edge")[:rows]
        first = ahead if is_stream else 0
        own = {which: replayed(scenario, plant, force[:rows], wanted, first) for which, plant in plants.items()}
        found[name] = {
            "scored": scored[name],
            **{which: each.rmse_percent_of_range for which, each in own.items()},
            **{f"harm_{which}": is_worse(each, nothing[which], reference) for which, each in own.items()},
        }
    return {
        "number": number,
        "level": scenario.run.level,
        "left_out": [each.module for each in exported.judged if each.fault],
        "none": {"scored": scored["none"], **{which: each.rmse_percent_of_range for which, each in nothing.items()}},
        "modules": found,
    }


def main() -> int:
    """Report; exit status 1 where an exported module does harm with the scenario's number of masses."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=117)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--rows", type=Path, help="file of what was found so far")
    options = parser.parse_args()
    rows = []
    if options.rows is not None and options.rows.exists():
        rows = [json.loads(line) for line in options.rows.read_text().splitlines()]
    while sum("modules" in each for each in rows) < options.count:
        rows.append(row(options.seed, len(rows)))
        if options.rows is not None:
            with options.rows.open("a") as file:
                file.write(json.dumps(rows[-1]) + "\n")
    legal = [each for each in rows if "modules" in each]
    print(f"{len(legal)} scenarios exported, refused: {dict(Counter(r['refused'] for r in rows if 'refused' in r))}")
    print(f"left out as worse than none: {dict(Counter(name for r in legal for name in r['left_out']))}")
    for which, masses in (("same", "the scenario's masses"), ("fine", f"{MASSES} masses")):
        harm = [(r, name, m) for r in legal for name, m in r["modules"].items() if m[f"harm_{which}"]]
        handed = sum(len(r["modules"]) for r in legal)
        print(f"{masses}: {len(harm)} of {handed} exported modules are worse than none on the independent plant")
        for r, name, m in harm:
            none = f"none {r['none']['scored']:.3g} and {r['none'][which]:.3g} %"
            print(f"  {r['number']} {r['level']} {name}: scored {m['scored']:.3g}, here {m[which]:.3g} %; {none}")
    return 1 if any(m["harm_same"] for r in legal for m in r["modules"].values()) else 0


if __name__ == "__main__":
    sys.exit(main())
