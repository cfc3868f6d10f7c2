"""What the files of one exported folder have in common stands once, and is linked once."""

import itertools
import re
from collections import defaultdict
from pathlib import Path

import pytest

from tendonff import export_c
from tendonff.compensator.scenario.scenario import Scenario
from tendonff.compensator.scenarios import load_scenario
from tendonff.ocp.codegen.precision import Precision

pytestmark = pytest.mark.compiler

MOST_TWICE = 0.08
MOST_TOGETHER = 0.7  # of plant and observer linked apart
CALLS = {
    "plant": "tff_plant_init(&plant, 1.0f); (void)tff_plant_step(&plant, 1.0f);",
    "observer": "tff_observer_init_at(&observer, 1.0f, 1.0f); (void)tff_observer_step_dt(&observer, 1e-3f, 1, 0);",
}


def lines_of(source):
    """Lines of code of a file, without comments and with its own name folded."""
    module = source.stem.partition("_")[2]
    code = re.sub(r"/\*.*?\*/", "", source.read_text(), flags=re.DOTALL)
    folded = code.replace(module, "module").replace(module.upper(), "MODULE")
    return [line for line in (" ".join(text.split()) for text in folded.splitlines()) if len(line) >= 12]


USUAL = (("finger", Precision.DOUBLE), ("finger", Precision.FLOAT), ("finger_adaptive", Precision.FLOAT))
EXAMPLES = sorted(path.stem for path in (Path(__file__).parents[2] / "examples").glob("*.toml"))
EVERY = [
    pytest.param(*case, marks=() if case in USUAL else pytest.mark.nightly)
    for case in itertools.product(EXAMPLES, Precision)
]


@pytest.mark.parametrize(("example", "precision"), EVERY)
def test_few_lines_of_an_exported_folder_stand_in_two_of_its_files(
    exported, examples, tmp_path, example, precision, record_property
):
    scenario = load_scenario(examples / f"{example}.toml")
    if isinstance(scenario, Scenario):
        folder = exported(precision, example)
    else:
        folder = tmp_path
        export_c(scenario, precision=precision).write(folder)
    sources = [path for path in folder.glob("tff_*.c") if not path.stem.endswith("_test")]
    lines = {source.name: lines_of(source) for source in sources}
    where = defaultdict(set)
    for name, found in lines.items():
        for line in found:
            where[line].add(name)
    total = sum(map(len, lines.values()))
    twice = sum(len(where[line]) > 1 for found in lines.values() for line in found)
    record_property(
        "figure", f"{example}, {precision}: {100 * twice / total:.1f} % of {total} lines of C stand in two files"
    )
    assert total > 300
    assert twice <= MOST_TWICE * total


def test_plant_and_observer_share_the_solver_where_both_are_linked(toolbox, exported, tmp_path, record_property):
    toolbox.need("arm-none-eabi-gcc")
    source, board = exported(Precision.FLOAT), toolbox.m4f

    def size(*modules):
        program = tmp_path / f"{'_'.join(('none', *modules))}.c"
        heads = "".join(f'#include "tff_{m}.h"\nstatic tff_{m} {m};\n' for m in modules)
        calls = " ".join(CALLS[m] for m in modules)
        program.write_text(
            f"{heads}void _exit(int x) {{ (void)x; for (;;) {{ }} }}\nint main(void) {{ {calls} return 0; }}\n"
        )
        shared = [source / f"tff_{m}.c" for m in ("parameters", "limits", "state", "chain", *modules)]
        toolbox.run(
            *("arm-none-eabi-gcc", *board.flags, "-std=c99", "-Os", "-ffp-contract=off", "-fno-math-errno"),
            *("-ffunction-sections", "-fdata-sections", "-Wl,--gc-sections", "-nostartfiles", "-Wl,-emain"),
            *("--specs=nano.specs", "--specs=nosys.specs", "-I", source, program, *shared, "-lm"),
            *("-o", program.with_suffix(".elf")),
        )
        said = toolbox.run("arm-none-eabi-size", program.with_suffix(".elf")).stdout.splitlines()[1].split()
        return int(said[0]) + int(said[1])

    bare = size()
    plant, observer, both = (size(*m) - bare for m in (("plant",), ("observer",), ("plant", "observer")))
    share = both / (plant + observer)
    record_property(
        "figure", f"M4F, -Os: plant {plant}, observer {observer}, linked together {both} bytes: {share:.2f}"
    )
    assert both <= MOST_TOGETHER * (plant + observer)
