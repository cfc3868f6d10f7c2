"""The pictures of the MuJoCo finger: `python -m examples.mujoco_finger.figures [FOLDER]`."""

import sys
from pathlib import Path

import mujoco
import numpy as np
from matplotlib.figure import Figure

from examples.mujoco_finger.rig import JOINTS, MODEL, RADII_M, Controller, Run, pushed, run
from tendonff.compensator.reporting.colours import BLUE, GREY, INK, ORANGE, VERMILION
from tendonff.compensator.reporting.plots import LINE_STYLES, figure_style, legend_below, new_figure, save_figure

LOOKS = {Controller.PLAIN: (GREY, ":"), Controller.AT_REST: (ORANGE, "--"), Controller.MEASURED: (BLUE, "-")}
POSES = 6


def courses(runs: dict[Controller, Run]) -> Figure:
    """Tensions at the insertion, actuator forces and joint angles."""
    with figure_style():
        figure, axes = new_figure(3, 1, share_x=True, height_in=5.6, height_ratios=(3, 2, 2))
        tension, force, joints = axes[:, 0]
        for controller, (color, style) in LOOKS.items():
            found = runs[controller]
            label = f"{controller}: {found.error_percent:.2g} %"
            tension.plot(found.time_s, found.tension_N, color=color, linestyle=style, label=label)
            force.plot(found.time_s, found.force_N, color=color, linestyle=style)
        last = runs[Controller.MEASURED]
        tension.plot(last.time_s, last.wanted_N, color=INK, linewidth=0.8, label="wanted")
        for k, name in enumerate(JOINTS):
            joints.plot(last.time_s, last.joint_rad[:, k], color=VERMILION, linestyle=LINE_STYLES[k], label=name)
        tension.set(ylabel="at the insertion [N]", title="Tension at the insertion; RMS error in % of range")
        force.set(ylabel="actuator [N]")
        joints.set(xlabel="time [s]", ylabel="joints [rad]")
        joints.legend(loc="lower right", bbox_to_anchor=(1, 1), borderpad=0, ncols=2)
        legend_below(figure, tension, columns=2)
    return figure


def strip(found: Run) -> Figure:
    """The finger at instants of a run, as MuJoCo has it: bones, pulleys and the tendon's way."""
    model = mujoco.MjModel.from_xml_path(str(MODEL))
    data = mujoco.MjData(model)
    rows = np.linspace(0, len(found.time_s) - 1, POSES + 1).astype(int)[1:]
    turn = np.linspace(0, 2 * np.pi, 60)
    with figure_style():
        figure, axes = new_figure(1, POSES, height_in=1.25)
        for panel, row in zip(axes[0], rows.tolist(), strict=True):
            data.qpos[:] = found.joint_rad[row]
            mujoco.mj_forward(model, data)
            for k in range(model.ngeom):
                place, along = data.geom_xpos[k], data.geom_xmat[k].reshape(3, 3)[:, 2]
                if model.geom_type[k] == mujoco.mjtGeom.mjGEOM_CAPSULE:
                    ends = place + np.outer((-1, 1), along) * model.geom_size[k, 1]
                    width = 2 * 500 * model.geom_size[k, 0]
                    panel.plot(*ends[:, [0, 2]].T, color="0.85", linewidth=width, solid_capstyle="round")
            pulleys = data.geom_xpos[model.geom_type == mujoco.mjtGeom.mjGEOM_CYLINDER]
            for (x, _, z), radius in zip(pulleys, RADII_M, strict=True):
                panel.plot(x + radius * np.cos(turn), z + radius * np.sin(turn), color=GREY, linewidth=0.8)
            way = np.array(data.wrap_xpos).reshape(-1, 3)[: int(data.ten_wrapnum[0])]
            panel.plot(way[:, 0], way[:, 2], color=BLUE, linewidth=1.2)
            panel.set(xlim=(-0.062, 0.058), ylim=(-0.062, 0.018), aspect="equal")
            panel.set_title(f"{found.time_s[row]:.2f} s, {found.tension_N[row]:.0f} N")
            panel.axis("off")
    return figure


def main() -> None:
    """Run the finger under each controller, print the errors and write the pictures."""
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent
    runs = {controller: run(controller) for controller in Controller}
    for controller, found in runs.items():
        print(f"{controller}: RMS error {found.error_percent:.2g} % of range")
    print(f"torques from outside: up to {np.abs([pushed(t) for t in runs[Controller.PLAIN].time_s]).max():.2g} N m")
    save_figure(courses(runs), folder / "courses", formats=("svg",))
    save_figure(strip(runs[Controller.MEASURED]), folder / "strip", formats=("png",))


if __name__ == "__main__":
    main()
