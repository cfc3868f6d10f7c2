"""MuJoCo with what it has for tendons: a `frictionloss` that does not depend on the tension.

A slide carries the actuator's force to a spring through a fixed tendon with a constant friction loss, the
capstan's at the mean tension of the case.
"""

import mujoco
import numpy as np

from benchmarks.yardstick.adapters.formulas import driven_ends, outputs_of, total_exponent
from benchmarks.yardstick.case import Array, Case

SPRING_N_PER_M, MASS_KG, STEP_S = 3000.0, 0.02, 5e-4
_MODEL = """
<mujoco><option timestep="{step}" gravity="0 0 0" integrator="implicitfast" iterations="50" tolerance="1e-12"/>
<worldbody><body><joint name="slide" type="slide" axis="1 0 0" stiffness="{spring}" damping="{damping}"/>
<geom type="sphere" size="0.01" mass="{mass}" contype="0" conaffinity="0"/></body></worldbody>
<tendon><fixed name="tendon" frictionloss="{loss}" solreffriction="0.001 1" solimpfriction="0.999 0.9999 0.001">
<joint joint="slide" coef="1"/></fixed></tendon></mujoco>"""


def _load(**numbers: float) -> tuple[mujoco.MjModel, mujoco.MjData]:
    model = mujoco.MjModel.from_xml_string(_MODEL.format(**numbers))
    return model, mujoco.MjData(model)


def answer(case: Case) -> dict[str, Array] | None:
    """Outputs of a case; None where a rigid tendon has no say."""
    if case.kind == "slider":
        return _slider(case)
    if (
        (driven := driven_ends(case)) is None
        or np.isnan(driven[0]).any()
        or not np.isnan(case.drive("far", "travel_m")).all()
    ):
        return None
    near = driven[0]
    loss = float(np.mean(near) * -np.expm1(-np.mean(total_exponent(case))))
    model, data = _load(step=STEP_S, spring=SPRING_N_PER_M, damping=2.0, mass=MASS_KG, loss=loss)
    data.qpos[0] = case.raw["start_N"] / SPRING_N_PER_M
    far, substeps = [], round(case.raw["row_s"] / STEP_S)
    for force in near:
        data.qfrc_applied[0] = force
        mujoco.mj_step(model, data, substeps)
        far.append(SPRING_N_PER_M * data.qpos[0])
    return outputs_of(case, near, np.array(far))


def _slider(case: Case) -> dict[str, Array]:
    raw, found = case.raw, []
    loss = 2 * raw["tension_N"] * np.tanh(raw["mu_static"] * raw["angle_rad"] / 2)
    for speed in raw["speeds_m_per_s"]:
        model, data = _load(
            step=1e-4, spring=0.0, damping=raw["viscous_N_s_per_m"], mass=raw["mass_kg"], loss=float(loss)
        )
        across = []
        for k in range(5000):
            data.qfrc_applied[0] = 2 * raw["spring_N_per_m"] * (speed * k * 1e-4 - data.qpos[0])
            mujoco.mj_step(model, data)
            across.append(float(data.qfrc_applied[0]))
        late = across[-1000:]
        found.append(float(np.ptp(late) > 0.02 * np.mean(np.abs(late))))
    return {"unstable": np.array(found)}
