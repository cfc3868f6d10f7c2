"""The chain of tendonff at one of its levels, with the values of the case and nothing else."""

import numpy as np

import tendonff as tf
from benchmarks.yardstick.case import Array, Case, Phase, Section
from tendonff.models.joint.parameters import Arm, DriveKind, DrivenJoint, JointDrive, JointTendon
from tendonff.models.layout import ChainInputs, ChainState
from tendonff.models.path import JointMotion
from tendonff.models.path import Section as PathSection
from tendonff.ocp.tendon.simulate import Simulator

MASSES, LOOP_MASSES, SUBSTEPS, SLICES = 30, 20, 2, 9
STIFF_BRISTLE_N_PER_M, HELD_N_PER_M, LOAD_N_PER_M = 1e8, 1e7, 3000.0
LEVELS = tuple(str(level) for level in tf.Level)


def answer(case: Case, level: str) -> dict[str, Array]:
    """Outputs of a case."""
    return {"tendon": _tendon, "loop": _loop, "slider": _slider}[case.kind](case, tf.Level(level))


def _parts(case: Case) -> tuple[tf.Tendon, tf.Friction]:
    """Tendon and friction; the soft bristle is the stiff one unless the case states one."""
    raw = case.raw
    tendon = tf.Tendon(
        mass_kg=1e-4,
        stiffness_N_per_m=raw["stiffness_N_per_m"],
        relaxing_stiffness_N_per_m=raw.get("relaxing_stiffness_N_per_m", 0.0),
        relaxation_time_s=raw.get("relaxation_time_s", 1.0),
        damping_N_s_per_m=0.5,
    )
    guide = next((s for s in case.path if s.bearing is None), Section(angle_rad=1.0, length_m=1.0))
    friction = tf.Friction(
        mu_dynamic=guide.mu,
        mu_static=guide.mu,
        mu_dynamic_release=guide.mu_release,
        mu_static_release=guide.mu_release,
        stribeck_velocity_m_per_s=0.01,
        viscous_N_s_per_m=0.0,
        bristle_stiffness_N_per_m=STIFF_BRISTLE_N_PER_M,
        soft_bristle_stiffness_N_per_m=raw.get("bristle_N_per_m", STIFF_BRISTLE_N_PER_M),
        adhesion_N=raw.get("adhesion_N", 0.0),
    )
    return tendon, friction


def _bend(part: Section, k: int, q: Array) -> tuple[list[PathSection], dict[str, Array]]:
    """A bend in slices that straighten one after another from its far side, and the angle that each slice gains.

    A slice is an arc with a joint of its own, then a straight that takes its share of the bend's change of length.
    """
    sections, gained = [], {}
    size = (part.angle_rad + part.angle_per_rad * q.max()) / SLICES
    for n in range(SLICES):
        angle = np.clip(part.angle_rad + part.angle_per_rad * np.append(q, 0.0) - n * size, 0.0, size)
        half, name = part.length_m / SLICES / 2, f"slice {n} of part {k}"
        gained[name] = angle[:-1] - angle[-1]
        sections += [
            PathSection(name=name, angle_rad=float(angle[-1]), length_m=half, joint=name, angle_per_rad=1.0),
            PathSection(
                name=f"straight behind {name}",
                angle_rad=0.0,
                length_m=half,
                joint="joint",
                length_per_rad_m=part.length_per_rad_m / SLICES,
            ),
        ]
    return sections, gained


def _path(case: Case) -> tuple[tf.Path, list[int], JointMotion | None]:
    """The case's sections, the last of each of its parts, and what its joint does; mu is that of all guides."""
    sections: list[PathSection] = []
    last, joints = [], {}
    times = np.arange(0.0, case.time_s[-1] + 5e-4, 1e-3)
    if "joint" in case.raw:
        joints["joint"] = np.interp(times, case.raw["joint"]["time_s"], case.raw["joint"]["values"])
    for k, s in enumerate(case.path):
        if s.joint:
            bend, gained = _bend(s, k, joints["joint"])
            sections += bend
            joints |= gained
        else:
            pulley = {"kind": "pulley", "bearing_exponent": s.exponents[0]} if s.bearing is not None else {}
            sections.append(PathSection(name=f"part {k}", angle_rad=s.angle_rad, length_m=s.length_m, **pulley))
        last.append(len(sections) - 1)
    motion = None
    if joints:
        motion = JointMotion(names=tuple(joints), time_s=times, angle_rad=np.column_stack([*joints.values()]))
    path = tf.Path(total_angle_rad=sum(s.angle_rad for s in sections), segments=MASSES, sections=tuple(sections))
    return path, last, motion


def _chain(case: Case, level: tf.Level) -> tf.Chain:
    tendon, friction = _parts(case)
    path, _, motion = _path(case)
    return tf.Chain.of(
        tf.Transmission(
            path=path,
            tendon=tendon,
            friction=friction,
            actuator=tf.Actuator(
                mass_kg=0.002,
                damping_N_s_per_m=1.0,
                force_min_N=0.0,
                force_max_N=1e3,
                force_rate_max_N_per_s=1e9,
            ),
            load=tf.Load(
                mass_kg=0.002,
                stiffness_N_per_m=case.raw.get("far_spring_N_per_m", LOAD_N_PER_M),
                damping_N_s_per_m=1.0,
            ),
            motion=motion,
        ),
        level,
    )


def _tendon(case: Case, level: tf.Level) -> dict[str, Array]:
    chain, start = _chain(case, level), case.raw["start_N"]
    state, step = chain.rest_state(start), case.raw["row_s"] / SUBSTEPS
    fine = np.arange(1, (len(case.time_s) - 1) * SUBSTEPS + 1) * step
    rows = [np.concatenate([np.full(chain.count + 1, start), [state.near_position_m, state.far_position_m]])]
    done, last = 0, np.full(chain.count + 1, start)
    for phase in case.phases:
        t = fine[done : int(np.searchsorted(fine, phase.time_s[-1] + 1e-9))]
        now = chain.with_end_stiffness(*(_hold(case, phase.ends[end], chain, end) for end in ("near", "far")))
        inputs, first = (
            ChainInputs.of(len(times), **_inputs(phase, times, now, state, last))
            for times in (t, np.array([t[0] - step]))
        )
        simulator = Simulator(now, step, state, first)
        found = simulator.advance(inputs)
        if len(found.tension_N) < len(t):
            raise RuntimeError(f"{case.key}: the step after {t[len(found.tension_N)]:g} s did not converge")
        rows += list(np.hstack([found.tension_N, found.ends_m])[SUBSTEPS - 1 :: SUBSTEPS])
        state, last, done = simulator.state, found.tension_N[-1], done + len(t)
    table = np.array(rows)
    tension, ends = table[:, :-2], table[:, -2:] - table[0, -2:]
    _, last, _ = _path(case)
    behind = np.searchsorted(chain.elements.path.section_of, last, side="right")
    return {
        "near_tension_N": tension[:, 0],
        "far_tension_N": tension[:, -1],
        "near_travel_m": ends[:, 0],
        "joint_torque_N_m": tension[:, behind] * [s.arm_m for s in case.path],
    }


def _hold(case: Case, end: dict[str, object], chain: tf.Chain, name: str) -> float:
    """Spring of an end: none under a tension, the case's or a stiff one where held or led, else that of a load."""
    if "tension_N" in end:
        return 0.0
    held: float = case.raw.get("hold_N_per_m", HELD_N_PER_M)
    return held if end else (chain.far.stiffness_N_per_m if name == "far" else LOAD_N_PER_M)


def _inputs(phase: Phase, t: Array, chain: tf.Chain, state: ChainState, tension: Array) -> dict[str, Array | float]:
    """Inputs of the ends: forces, or rest positions of springs that carry the tension at the phase's start."""
    found: dict[str, Array | float] = {}
    ends = phase.ends
    for name, sign, at, carried in (
        ("near", 1, state.near_position_m, tension[0]),
        ("far", -1, state.far_position_m, tension[-1]),
    ):
        spring = getattr(chain, name).stiffness_N_per_m
        if "tension_N" in ends[name]:
            found[f"{name}_force_N"] = np.interp(t, phase.time_s, ends[name]["tension_N"])
            continue
        led = np.interp(t, phase.time_s, ends[name]["travel_m"]) if "travel_m" in ends[name] else 0.0
        found[f"{name}_rest_m"] = at + sign * carried / spring + led
    return found


def _loop(case: Case, level: tf.Level) -> dict[str, Array]:
    raw, name = case.raw, "joint"
    friction = tf.Friction(
        mu_dynamic=raw["exponent"] / 2,
        mu_static=raw["exponent"] / 2,
        stribeck_velocity_m_per_s=0.01,
        viscous_N_s_per_m=0.0,
        bristle_stiffness_N_per_m=STIFF_BRISTLE_N_PER_M,
        soft_bristle_stiffness_N_per_m=STIFF_BRISTLE_N_PER_M,
    )
    tendon = tf.Tendon(
        mass_kg=1e-4,
        stiffness_N_per_m=raw["stiffness_N_per_m"],
        relaxing_stiffness_N_per_m=0.0,
        relaxation_time_s=1.0,
        damping_N_s_per_m=0.5,
    )
    both = tuple(
        JointTendon(
            name=side,
            path=tf.Path(total_angle_rad=2.0, segments=LOOP_MASSES),
            tendon=tendon,
            friction=friction,
            arms=(Arm(joint=name, moment_arm_m=sign * raw["radius_m"]),),
        )
        for side, sign in (("flexor", 1), ("extensor", -1))
    )
    mechanism = tf.Mechanism(
        joints=(DrivenJoint(name=name, inertia_kg_m2=2e-7, stiffness_N_m_per_rad=raw["joint_stiffness_N_m_per_rad"]),),
        tendons=both,
        drive=JointDrive(kind=DriveKind.LOOP, drum_radius_m=(raw["radius_m"],), pretension_N=raw["pretension_N"]),
    )
    motion = JointMotion(names=(name,), time_s=np.array([0.0, 1.0]), angle_rad=np.array([[0.0], [2.0]]))
    problem = tf.system_of(mechanism, level, motion)
    fine = np.interp(
        np.arange((len(case.time_s) - 1) * SUBSTEPS + 1) * raw["row_s"] / SUBSTEPS,
        raw["motor"]["time_s"],
        raw["motor"]["values"],
    )
    found = tf.simulate(problem, fine, raw["row_s"] / SUBSTEPS).require()
    drum = found.drum_N[::SUBSTEPS]
    return {"joint_rad": found.angle_rad[::SUBSTEPS], "drive_N": drum[:, 0] - drum[:, 1]}


def _slider(case: Case, level: tf.Level) -> dict[str, Array]:
    """Single mass; both ends are led at the speed. Steady sliding is disturbed by its start from rest."""
    raw, found = case.raw, []
    tendon = tf.Tendon(
        mass_kg=raw["mass_kg"],
        stiffness_N_per_m=raw["spring_N_per_m"] / 2,  # one mass cuts it into two halves, each twice as stiff
        relaxing_stiffness_N_per_m=0.0,
        relaxation_time_s=1.0,
        damping_N_s_per_m=0.0,
    )
    friction = tf.Friction(
        mu_dynamic=raw["mu_dynamic"],
        mu_static=raw["mu_static"],
        stribeck_velocity_m_per_s=raw["stribeck_velocity_m_per_s"],
        viscous_N_s_per_m=raw["viscous_N_s_per_m"],
        bristle_stiffness_N_per_m=raw["bristle_N_per_m"],
        soft_bristle_stiffness_N_per_m=raw["bristle_N_per_m"],
    )
    chain = tf.Chain.of(
        tf.Transmission(
            path=tf.Path(total_angle_rad=raw["angle_rad"], segments=1),
            tendon=tendon,
            friction=friction,
            actuator=tf.Actuator(
                mass_kg=1e-3, damping_N_s_per_m=0.0, force_min_N=0.0, force_max_N=1e3, force_rate_max_N_per_s=1e9
            ),
            load=tf.Load(mass_kg=1e-3, stiffness_N_per_m=1.0, damping_N_s_per_m=0.0),
        ),
        level,
    ).with_end_stiffness(HELD_N_PER_M, HELD_N_PER_M)
    step, start = 2e-5, raw["tension_N"]
    t = np.arange(1, 12501) * step
    for V in raw["speeds_m_per_s"]:
        state = chain.rest_state(start)
        rest = [
            at + sign * start / HELD_N_PER_M for at, sign in ((state.near_position_m, 1), (state.far_position_m, -1))
        ]
        inputs = ChainInputs.of(len(t), near_rest_m=rest[0] + V * t, far_rest_m=rest[1] + V * t)
        first = ChainInputs.of(1, near_rest_m=rest[0], far_rest_m=rest[1])
        rows = Simulator(chain, step, state, first).advance(inputs)
        across = rows.tension_N[:, 0] - rows.tension_N[:, 1]
        late = across[-len(across) // 5 :]
        found.append(float(np.ptp(late) > 0.02 * np.mean(np.abs(late))))
    return {"unstable": np.array(found)}
