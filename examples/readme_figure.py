"""The figure of the README: what arrives at the fingertip, with and without compensation.

python examples/readme_figure.py docs/finger.png
"""

import sys
from dataclasses import asdict
from pathlib import Path

from tendonff.compensator.compensators.registry import compensator
from tendonff.compensator.design.run import Design, design
from tendonff.compensator.reporting.plots import INK, figure_style, new_figure, save_figure
from tendonff.compensator.scenario.scenario import load_scenario

SHOWN = {"none": "the wish itself as force", "inverse": "the force that tendonff finds"}


def draw(result: Design, target: Path) -> None:
    """Draw force and tension for a design.

    Parameters
    ----------
    result : Design
    target : Path
        PNG file.
    """
    time = result.reference.time_s
    with figure_style():
        figure, axes = new_figure(1, 2, height_in=2.9)
        applied, arrived = axes[0]
        for name, label in SHOWN.items():
            style = asdict(compensator(name).style)
            applied.plot(time, result.profiles[name].force_N, label=label, **style)
            arrived.plot(time, result.on_proof(name).output_N, linewidth=2.6, **style)
        arrived.plot(time, result.reference.tension_N, color=INK, linewidth=0.8, label="wanted")
        applied.set(xlabel="time [s]", ylabel="actuator force [N]", title="What you apply")
        arrived.set(xlabel="time [s]", ylabel="tension at the fingertip [N]", title="What arrives (black: wanted)")
        figure.legend(*applied.get_legend_handles_labels(), loc="outside lower center", ncols=2)
    save_figure(figure, target.with_suffix(""), formats=("png",))


if __name__ == "__main__":
    draw(design(load_scenario(Path(__file__).with_name("finger.toml"))), Path(sys.argv[1]))
