"""Moving paths: energy over random closed cycles of joints and force, and what the number of masses decides.

    python benchmarks/moving.py                            1000 cycles, a few minutes
    TENDONFF_PATHS=10000 python benchmarks/moving.py

Each cycle has a path of its own: up to five sections, most of which joints move, some until they touch no more and then
back. Energy is that of masses, links and bristles; power comes in at the actuator, at a far end that a joint moves, and
through the joints: the tension times what the path gains, and what a link that is drawn out stores less at the same
elongation. What came in and is not stored is dissipated, and may never shrink. Columns: the largest fall of it on the
way and its end value, in % of all energy that was exchanged.
"""

import os
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tendonff.models.fidelity import Level
from tendonff.models.layout import ChainInputs
from tendonff.models.parameters import Actuator, Friction, Load, Path, Tendon, Transmission
from tendonff.models.path import JointMotion, Section
from tendonff.models.tendon.chain import Chain
from tendonff.ocp.tendon.inverse import invert
from tendonff.ocp.tendon.simulate import Simulator

Array = NDArray[np.float64]
SEGMENTS, STEP_S, PERIOD_S, START_N = 10, 2e-4, 0.8, 40.0


@dataclass(frozen=True, kw_only=True)
class Cycle:
    """A path, its joints and a force, all back at the end where they began."""

    rig: Transmission
    level: Level
    force_N: Array


def rounds(rng: np.random.Generator, time_s: Array, size: float, harmonics: int) -> Array:
    """A random course that begins and ends at rest at 0."""
    fade = np.sin(np.pi * time_s / time_s[-1]) ** 2
    waves = np.arange(1, harmonics + 1)[:, None] * 2 * np.pi * time_s / PERIOD_S
    weights = rng.normal(size=(2, harmonics, 1)) / np.arange(1, harmonics + 1)[:, None]
    course: Array = fade * (weights[0] * np.sin(waves) + weights[1] * np.cos(waves)).sum(axis=0)
    course *= size / np.abs(course).max()
    return course


def random_cycle(seed: int) -> Cycle:
    """A path with sections that bend, straighten, lose contact and bend again."""
    rng = np.random.default_rng(seed)
    time = np.arange(round(PERIOD_S / STEP_S) + 1) * STEP_S
    sections, angles = [], np.column_stack([rounds(rng, time, rng.uniform(0.3, 1.0), 3) for _ in range(2)])
    for k in range(int(rng.integers(2, 6))):
        moved = rng.uniform() < 0.7
        mu = rng.uniform(0.02, 0.3)
        sections.append(
            Section(
                name=f"s{k}",
                angle_rad=rng.uniform(0.1, 1.2),
                length_m=rng.uniform(0.02, 0.08),
                mu_dynamic=mu,
                mu_static=mu * rng.uniform(1, 1.5),
                joint=f"q{k % 2}" if moved else None,
                angle_per_rad=rng.choice([-1.0, 1.0]) * rng.uniform(0.5, 1.5) if moved else 0.0,
                length_per_rad_m=rng.uniform(-0.008, 0.008) if moved else 0.0,
            )
        )
    rig = Transmission(
        path=Path(total_angle_rad=sum(s.angle_rad for s in sections), segments=SEGMENTS, sections=tuple(sections)),
        tendon=Tendon(
            mass_kg=0.004,
            stiffness_N_per_m=2e4,
            relaxing_stiffness_N_per_m=6e3,
            relaxation_time_s=0.2,
            damping_N_s_per_m=2.0,
        ),
        friction=Friction(
            mu_dynamic=0.2,
            mu_static=0.24,
            mu_dynamic_release=0.15,
            stribeck_velocity_m_per_s=0.02,
            viscous_N_s_per_m=rng.uniform(0, 1.0),
            bristle_stiffness_N_per_m=1e5,
            soft_bristle_stiffness_N_per_m=2e4,
            adhesion_N=rng.uniform(0, 1.0),
        ),
        actuator=Actuator(
            mass_kg=0.15, damping_N_s_per_m=2.0, force_min_N=0.0, force_max_N=200.0, force_rate_max_N_per_s=1e5
        ),
        load=Load(mass_kg=0.05, stiffness_N_per_m=800.0, damping_N_s_per_m=2.0),
        motion=JointMotion(names=("q0", "q1"), time_s=time, angle_rad=angles),
    )
    if seed % 3 == 0:
        rig = replace(rig, load=replace(rig.load, joint="q0", moment_arm_m=rng.uniform(-0.002, 0.002)))
    return Cycle(
        rig=rig,
        level=Level.PRESLIDING if seed % 2 else Level.VISCOELASTIC,
        force_N=START_N + rounds(rng, time, rng.uniform(5, 20), 4),
    )


@dataclass(frozen=True, kw_only=True)
class Balance:
    """Energy of a cycle."""

    dissipated_J: Array
    exchanged_J: float
    least_tension_N: float
    lost_contact: bool

    @property
    def fall(self) -> float:
        """Largest fall of what was dissipated over what was exchanged."""
        return float((np.maximum.accumulate(self.dissipated_J) - self.dissipated_J).max() / self.exchanged_J)


def balance(cycle: Cycle) -> Balance:
    """Power that comes in, and what is stored, at every step."""
    chain = Chain.of(cycle.rig, cycle.level)
    n, layout, rows = chain.count, chain.layout, len(cycle.force_N)
    start = chain.rest_state(START_N)
    first = ChainInputs.of(1, near_force_N=cycle.force_N[0])
    simulator = Simulator(chain, STEP_S, start, first)
    run = simulator.advance(ChainInputs.of_force(cycle.force_N[1:]), record=True)
    assert run.states is not None
    assert len(run.tension_N) == rows - 1
    x = np.vstack([start.vector(), run.states])
    tension = np.vstack([np.full(n + 1, START_N), run.tension_N])
    v, e, f_s = (x[:, layout.part(name)] for name in ("v", "e", *layout.friction_states[:1]))
    z = x[:, layout.part(layout.link_states[0])]
    path = chain.path_at(np.arange(rows) * STEP_S)
    masses = np.concatenate([[chain.near.mass_kg], chain.of_masses()["piece_mass_kg"], [chain.far.mass_kg]])
    if chain.far_joint is not None:
        masses[-1] = 0.0
    numbers = chain.numbers()
    stiff, relaxing = numbers["link_stiffness_N_per_m"], numbers["link_relaxing_stiffness_N_per_m"]
    within = 0.5 * (stiff * e**2 + relaxing * (e - z) ** 2)  # of the whole; a link is shorter by its ratio
    whole = cycle.rig.friction.soft_bristle_stiffness_N_per_m
    if cycle.level is not Level.PRESLIDING:
        whole = cycle.rig.friction.bristle_stiffness_N_per_m
    sigma = whole * chain.elements.angle_share(path.angle_rad)
    bristles = np.where(f_s == 0, 0.0, 0.5 * f_s**2 / np.maximum(sigma, 1e-12)).sum(axis=1)
    spring = 0.5 * chain.far.stiffness_N_per_m * x[:, layout.part("q_l")][:, 0] ** 2
    stored = 0.5 * (v**2 @ masses) + (within * path.ratio).sum(axis=1) + bristles
    work = [
        _work(cycle.force_N, x[:, layout.part("q_a")][:, 0]),
        _work(tension, path.gained_m).sum(axis=1),
        _work(within, path.ratio).sum(axis=1),
    ]
    if chain.far_joint is None:
        stored = stored + spring
    else:
        work.append(-_work(tension[:, -1], path.far_m))
    increments = np.sum(work, axis=0)
    came = np.concatenate([[0.0], np.cumsum(increments)])
    return Balance(
        dissipated_J=came - (stored - stored[0]),
        exchanged_J=float(sum(np.abs(each).sum() for each in work)),
        least_tension_N=float(tension.min()),
        lost_contact=bool(((path.angle_rad == 0).any(axis=0) & (path.angle_rad > 0).any(axis=0)).any()),
    )


def _work(force: Array, along: Array) -> Array:
    work: Array = 0.5 * (force[1:] + force[:-1]) * np.diff(along, axis=0)
    return work


def convergence(rig: Transmission, counts: tuple[int, ...], finest: int, level: Level = Level.PRESLIDING) -> Array:
    """RMS distance of the exact inverse's force with N masses from that with many, in % of its range."""
    assert rig.motion is not None
    time = rig.motion.time_s
    reference = START_N + 10 * np.sin(2 * np.pi * time / PERIOD_S) * np.minimum(time / 0.1, 1)
    step = float(time[1] - time[0])
    forces = [invert(Chain.of(rig, level, n), reference, step).force_N for n in (*counts, finest)]
    off = [np.sqrt(np.mean((force - forces[-1]) ** 2)) for force in forces[:-1]]
    return 100 * np.array(off) / np.ptp(forces[-1])


def main() -> None:
    """Print the tables."""
    paths = int(os.environ.get("TENDONFF_PATHS", "1000"))
    falls, ends, lost, slack = [], [], 0, 0
    for seed in range(paths):
        found = balance(random_cycle(seed))
        if found.least_tension_N <= 0:
            slack += 1  # a link that pushes nothing forgets what it stored
            continue
        lost += found.lost_contact
        falls.append(found.fall)
        ends.append(found.dissipated_J[-1] / found.exchanged_J)
    print(f"{len(falls)} cycles ({lost} lose contact and touch again; {slack} more went slack)")
    print(f"largest fall of the dissipated energy {100 * max(falls):.2g} % of what was exchanged")
    print(f"dissipated at the end: least {100 * min(ends):.3g} %, median {100 * np.median(ends):.3g} %")
    counts = (5, 10, 20, 40, 80)
    print("\nmasses " + " ".join(f"{n:8d}" for n in counts) + "   order")
    for seed in (1, 4, 7, 10):
        errors = convergence(random_cycle(seed).rig, counts, 320)
        order = -np.polyfit(np.log(counts), np.log(errors), 1)[0]
        print(f"path {seed:2d}" + " ".join(f"{e:8.3g}" for e in errors) + f"   {order:.2f}")


if __name__ == "__main__":
    main()
