import errno
import os
import shlex
import subprocess
import sys
from dataclasses import replace
from pathlib import Path as FilePath

import casadi as ca
import numpy as np
import pytest
from numpy.typing import NDArray

from tendonff.models.fidelity import Level
from tendonff.models.layout import ChainInputs
from tendonff.models.mechanism.chain import chain_equations
from tendonff.models.parameters import (
    Actuator,
    Friction,
    Load,
    Path,
    Tendon,
    Transmission,
)
from tendonff.models.tendon.chain import Chain
from tendonff.ocp.codegen import compiler, engine
from tendonff.ocp.codegen.engine import Engine
from tendonff.ocp.errors import CodeError
from tendonff.ocp.step import c_engine, casadi_engine
from tendonff.ocp.tendon.inverse import invert
from tendonff.ocp.tendon.simulate import Outcome, Simulation, Simulator, simulate

pytestmark = pytest.mark.compiler

Array = NDArray[np.float64]


def swing(amplitude_N: float, step_s: float = 1e-3, seconds: float = 1.5) -> Array:
    time = np.arange(0.0, seconds, step_s)
    return 30 + amplitude_N * np.sin(2 * np.pi * time) * np.minimum(time / 0.2, 1)


@pytest.mark.each_value
@pytest.mark.parametrize("level", Level)
@pytest.mark.parametrize("n", [1, 6, 7, 40])
def test_engines_agree_to_a_nanonewton(generic: Transmission, level: Level, n: int) -> None:
    chain = Chain.of(generic, level, n)
    runs = [simulate(chain, swing(25.0), 1e-3, record=True, engine=e) for e in (Engine.COMPILED, Engine.CASADI)]
    assert np.abs(runs[0].tension_N - runs[1].tension_N).max() < 1e-9
    assert np.abs(runs[0].near_position_m - runs[1].near_position_m).max() < 1e-12
    assert np.abs(runs[0].final.vector() - runs[1].final.vector()).max() < 1e-8
    assert runs[0].states is not None
    assert runs[1].states is not None
    assert runs[0].states == pytest.approx(runs[1].states, abs=1e-8)


@pytest.mark.parametrize("level", Level)
def test_engines_agree_where_the_compiled_law_is_printed_without_the_stribeck_effect(
    generic: Transmission, level: Level
) -> None:
    friction = replace(generic.friction, mu_static=0.2, mu_static_release=0.15)
    chain = Chain.of(replace(generic, friction=friction), level, 7)
    runs = [simulate(chain, swing(25.0), 1e-3, engine=e) for e in (Engine.COMPILED, Engine.CASADI)]
    assert np.abs(runs[0].tension_N - runs[1].tension_N).max() < 1e-9
    inverses = [invert(chain, swing(12.0), 1e-3, engine=e).force_N for e in (Engine.COMPILED, Engine.CASADI)]
    assert np.abs(inverses[0] - inverses[1]).max() < 1e-8


def test_engines_agree_where_steps_are_split_and_the_tendon_goes_slack(generic: Transmission) -> None:
    """Each by its own Newton iteration, and so in its own pieces: the answers stay within the error of the step."""
    friction = replace(generic.friction, mu_static=0.2, mu_static_release=0.15, bristle_stiffness_N_per_m=1e9)
    chain = Chain.of(replace(generic, friction=friction), Level.VISCOELASTIC, 3)
    force = swing(29.9, 0.005)
    runs = [simulate(chain, force, 0.005, engine=engine) for engine in (Engine.COMPILED, Engine.CASADI)]
    assert all(run.splits > 0 for run in runs)
    assert runs[0].outcome is runs[1].outcome is Outcome.SLACK
    assert np.sqrt(np.mean((runs[0].tension_N - runs[1].tension_N) ** 2)) < 1e-3 * np.ptp(force)


def test_engines_stay_close_where_a_line_search_fails_from_the_guess(generic: Transmission) -> None:
    """Sticking and slipping on a stiff bristle: each engine splits its own steps, few of them."""
    rig = replace(
        generic,
        tendon=replace(generic.tendon, damping_N_s_per_m=0.0, mass_kg=1.265e-4, stiffness_N_per_m=11848.4),
        friction=Friction(
            mu_dynamic=0.02814,
            mu_static=0.11257,
            stribeck_velocity_m_per_s=1.964e-4,
            viscous_N_s_per_m=9.2,
            bristle_stiffness_N_per_m=4.0058e7,
            soft_bristle_stiffness_N_per_m=2e4,
        ),
        path=replace(generic.path, total_angle_rad=np.pi),
        actuator=replace(generic.actuator, mass_kg=0.2, damping_N_s_per_m=5.0),
        load=replace(generic.load, mass_kg=0.02, stiffness_N_per_m=3000.0, damping_N_s_per_m=2.0),
    )
    time = np.arange(300) * 1e-3
    force = 30 + 29 * np.sin(2 * np.pi * 4 * time) * (1 - np.exp(-20 * time**2))
    chain = Chain.of(rig, Level.ELASTIC, 1)
    runs = [simulate(chain, force, 1e-3, engine=engine) for engine in (Engine.COMPILED, Engine.CASADI)]
    assert all(run.splits < len(force) / 50 for run in runs)
    assert np.sqrt(np.mean((runs[0].tension_N - runs[1].tension_N) ** 2)) < 0.01 * np.ptp(runs[0].tension_N)


@pytest.mark.parametrize("level", Level)
def test_the_optimisation_of_the_compiler_changes_no_bit(
    generic: Transmission, monkeypatch: pytest.MonkeyPatch, level: Level, shipped_flags: tuple[str, ...]
) -> None:
    """So that other tests may compile with less of it."""
    chain = Chain.of(generic, level, 5)
    force = 40 + 30 * np.sin(0.05 * np.arange(400))
    assert shipped_flags != compiler._FLAGS
    less = simulate(chain, force, 1e-3, engine=Engine.COMPILED)
    monkeypatch.setattr(compiler, "_FLAGS", shipped_flags)
    monkeypatch.setattr(c_engine, "_LIBRARIES", {})
    whole = simulate(chain, force, 1e-3, engine=Engine.COMPILED)
    assert np.array_equal(whole.tension_N, less.tension_N)
    assert np.ptp(whole.output_tension_N) > 20


def test_engines_agree_on_how_a_run_fails(generic: Transmission, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(casadi_engine, "MAX_SPLITS", 2)  # to give up takes CasADi seconds otherwise
    chain = Chain.of(generic, Level.PRESLIDING, 3)
    force = np.full(40, 30.0)
    force[30] = 1e200
    runs = [simulate(chain, force, 1e-3, engine=engine) for engine in (Engine.COMPILED, Engine.CASADI)]
    assert all(run.outcome is Outcome.FAILED for run in runs)
    assert [len(run.time_s) for run in runs] == [30, 30]
    assert all("simulation stopped at t = 0.03 s" in run.message for run in runs)


@pytest.mark.parametrize("engine", [Engine.COMPILED, Engine.CASADI])
def test_one_balance_that_is_not_a_number_is_not_overlooked(generic: Transmission, engine: Engine) -> None:
    """NaN at one mass, all others in balance."""
    chain = Chain.of(generic, Level.PRESLIDING, 4)
    state = chain.rest_state(30.0)
    state.friction[0, 1] = np.nan
    inputs = ChainInputs.of(3, near_force_N=30.0)
    rows = Simulator(chain, 1e-3, state, inputs[:1], engine).advance(inputs)
    assert len(rows.tension_N) == 0
    assert rows.worst_mass == 2
    assert np.isnan(rows.residual_N)


def test_engines_agree_with_motors_at_both_ends(generic: Transmission) -> None:
    chain = Chain.of(generic, Level.PRESLIDING, 4).with_end_stiffness(700.0, 900.0)
    time = np.arange(1, 500) * 1e-3
    inputs = ChainInputs(
        near_force_N=30 + 5 * np.sin(9 * time),
        near_rest_m=2e-3 * np.sin(5 * time),
        far_force_N=8 * np.sin(7 * time),
        far_rest_m=1e-3 * np.cos(4 * time),
    )
    rows = [
        Simulator(chain, 1e-3, chain.rest_state(30.0), inputs[:1], engine).advance(inputs)
        for engine in (Engine.COMPILED, Engine.CASADI)
    ]
    assert np.abs(rows[0].tension_N - rows[1].tension_N).max() < 1e-9
    assert np.abs(rows[0].ends_m - rows[1].ends_m).max() < 1e-12


@pytest.mark.parametrize("level", Level)
def test_the_inverses_of_both_engines_agree(generic: Transmission, level: Level) -> None:
    chain = Chain.of(generic, level)
    answers = [
        invert(chain, swing(12.0), 1e-3, record=True, engine=engine) for engine in (Engine.COMPILED, Engine.CASADI)
    ]
    assert answers[0].status is answers[1].status
    assert np.abs(answers[0].force_N - answers[1].force_N).max() < 1e-8
    assert np.abs(answers[0].least_tension_N - answers[1].least_tension_N).max() < 1e-9


def test_without_a_compiler_the_casadi_engine_takes_over(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("TENDONFF_ENGINE", raising=False)
    engine._has_compiler.cache_clear()
    for module in (compiler, engine):
        monkeypatch.setattr(module, "find_compiler", lambda: None)
    try:
        assert engine.resolve_engine(Engine.AUTO) is Engine.CASADI
        with pytest.raises(CodeError, match="no C compiler found"):
            compiler.load_library("int a;\n")
    finally:
        engine._has_compiler.cache_clear()


def test_a_missing_folder_to_compile_in_is_not_called_a_missing_compiler(monkeypatch: pytest.MonkeyPatch) -> None:
    def full() -> FilePath:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(compiler, "cache_folder", full)
    compiler._works.cache_clear()
    try:
        with pytest.raises(CodeError, match=r"\(No space left on device\); set TMPDIR or XDG_CACHE_HOME"):
            compiler.load_library("int a;\n")
    finally:
        compiler._works.cache_clear()


def fake_compiler(folder: FilePath, name: str = "cc") -> FilePath:
    """A name on the path behind which no tools are installed."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / name).write_text("#!/bin/sh\nexit 1\n", encoding="utf-8")
    (folder / name).chmod(0o755)
    return folder / name


def test_a_compiler_that_does_not_work_is_passed_over(monkeypatch: pytest.MonkeyPatch, tmp_path: FilePath) -> None:
    works = compiler.find_compiler()
    assert works is not None
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setenv("PATH", f"{fake_compiler(tmp_path / 'stub').parent}:{os.environ['PATH']}")
    found = compiler.find_compiler()
    assert found is not None
    assert found[0] != str(tmp_path / "stub" / "cc")


def test_a_packaged_compiler_stands_in_where_nothing_else_works(
    stand_in_ziglang: FilePath, monkeypatch: pytest.MonkeyPatch, tmp_path: FilePath
) -> None:
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setenv("PATH", str(fake_compiler(tmp_path / "stub").parent))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    found = compiler.find_compiler()
    assert found == (sys.executable, "-m", "ziglang", "cc", "-mcpu=baseline")
    assert compiler.load_library("int tff_answer(void) { return 42; }\n").tff_answer() == 42
    assert all(line.startswith("cc -mcpu=baseline ") for line in stand_in_ziglang.read_text().splitlines())


@pytest.mark.nightly  # installs twenty thousand files
def test_the_package_ziglang_stands_in_where_nothing_else_works(
    monkeypatch: pytest.MonkeyPatch, tmp_path: FilePath
) -> None:
    pytest.importorskip("ziglang")
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setenv("PATH", str(fake_compiler(tmp_path / "stub").parent))
    found = compiler.find_compiler()
    assert found == (sys.executable, "-m", "ziglang", "cc", "-mcpu=baseline")
    # What it compiles for others, as in an exported unit, runs on any processor of this kind.
    macros = subprocess.run([*found, "-dM", "-E", "-x", "c", os.devnull], capture_output=True, text=True, check=True)
    assert "__AVX" not in macros.stdout
    assert compiler.load_library("int tff_answer(void) { return 42; }\n").tff_answer() == 42


def test_cc_is_a_path_with_blanks_or_a_command_of_several_words_or_a_clear_error(
    monkeypatch: pytest.MonkeyPatch, tmp_path: FilePath
) -> None:
    works = compiler.find_compiler()
    assert works is not None
    (tmp_path / "my tools").mkdir()
    wrapper = tmp_path / "my tools" / "cc"
    wrapper.write_text(f'#!/bin/sh\nexec {shlex.join(works)} "$@"\n', encoding="utf-8")
    wrapper.chmod(0o755)
    monkeypatch.setenv("CC", str(wrapper))
    assert compiler.find_compiler() == (str(wrapper),)
    monkeypatch.setenv("CC", f"'{wrapper}' -O1")
    assert compiler.find_compiler() == (str(wrapper), "-O1")
    monkeypatch.setenv("CC", 'gcc "')
    with pytest.raises(CodeError, match="CC must be a command, got 'gcc \"'"):
        compiler.find_compiler()
    monkeypatch.setenv("CC", "no-such-compiler")
    with pytest.raises(CodeError, match="CC is 'no-such-compiler'"):
        compiler.load_library("int a;\n")


def test_the_environment_chooses_the_engine(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TENDONFF_ENGINE", "casadi")
    assert engine.resolve_engine(Engine.AUTO) is Engine.CASADI
    assert engine.resolve_engine(Engine.COMPILED) is Engine.COMPILED
    monkeypatch.setenv("TENDONFF_ENGINE", "foo")
    with pytest.raises(CodeError, match="TENDONFF_ENGINE must be one of auto, compiled, casadi, got 'foo'"):
        engine.resolve_engine(Engine.AUTO)


def random_rig(rng: np.random.Generator) -> tuple[Chain, Array, float]:
    """A scenario over wide ranges, some terms at their limits; force may jump, push, or let the tendon go slack."""

    def decade(low: float, high: float) -> float:
        return float(10 ** rng.uniform(low, high))

    def sometimes(value: float) -> float:
        return value if rng.random() < 0.5 else 0.0

    n = int(np.clip(decade(0.0, 2.01), 1, 100))
    mu = 0.0 if rng.random() < 0.05 else float(rng.uniform(0.0, 0.6))
    theta = 20 * np.pi if rng.random() < 0.1 else float(20 * np.pi * rng.random() ** 2)
    bristle = decade(3, 9)
    rig = Transmission(
        path=Path(total_angle_rad=theta, segments=n, radius_m=0.03),
        tendon=Tendon(
            mass_kg=decade(-4, -1),
            stiffness_N_per_m=decade(3.5, 6),
            relaxing_stiffness_N_per_m=sometimes(decade(3, 5)),
            relaxation_time_s=decade(-2.5, 0.5),
            damping_N_s_per_m=sometimes(decade(-1, 2)),
        ),
        friction=Friction(
            mu_dynamic=mu,
            mu_static=mu * (1.3 if rng.random() < 0.5 else 1.0),
            stribeck_velocity_m_per_s=decade(-3, -1.3),
            viscous_N_s_per_m=sometimes(decade(-1, 1)),
            bristle_stiffness_N_per_m=bristle,
            soft_bristle_stiffness_N_per_m=bristle,
            mu_dynamic_release=mu * float(rng.uniform(0.5, 1.5)),
            adhesion_N=sometimes(float(rng.uniform(0.0, 2.0))),
        ),
        actuator=Actuator(
            mass_kg=decade(-2, 0),
            damping_N_s_per_m=float(rng.uniform(0.0, 10.0)),
            force_min_N=0.0,
            force_max_N=500.0,
            force_rate_max_N_per_s=1e5,
        ),
        load=Load(
            mass_kg=decade(-3, 0), stiffness_N_per_m=decade(2.5, 4.5), damping_N_s_per_m=float(rng.uniform(0.0, 5.0))
        ),
    )
    phase, start = np.linspace(0.0, 1.0, 300), float(rng.uniform(5.0, 50.0))
    match rng.integers(4):
        case 0:
            shape = 1 + 0.8 * np.sin(2 * np.pi * rng.uniform(0.5, 5.0) * phase)
        case 1:
            shape = 1 + 1.5 * np.sin(4 * np.pi * phase)
        case 2:
            knots = np.sort(np.concatenate([[0.0, 1.0], rng.random(8)]))
            shape = np.interp(phase, knots, np.concatenate([[1.0], rng.uniform(0.0, 3.0, 9)]))
        case _:
            shape = np.where((10 * phase).astype(int) % 2 == 0, 1.0, rng.uniform(0.0, 3.0))
    level = Level.VISCOELASTIC if rng.random() < 0.7 else Level.ELASTIC
    return Chain.of(rig, level), start * shape, decade(-4, -2)


def unbalanced_rows(chain: Chain, run: Simulation, step_s: float) -> Array:
    """Rows at which the recorded states do not satisfy `chain_equations` under the BDF2 difference quotient."""
    assert run.states is not None
    n, piece, friction, link, x = chain.count, chain.elements.piece, chain.friction, chain.link, run.states
    equations = chain_equations(chain)
    rate_of = ca.Function("rate", [equations.state, equations.inputs], [equations.rate, equations.tension_N])
    inputs = np.zeros((4, len(x)))
    inputs[0] = run.force_N
    rate, tension = (np.asarray(m).T for m in rate_of(x.T, inputs))
    assert np.abs(tension - run.tension_N).max() <= 1e-10 * max(1.0, tension.max())

    weight = 2 * step_s / 3
    defect = np.abs(x[2:] - (4 * x[1:-1] - x[:-2]) / 3 - weight * rate[2:])
    now, v = x[2:], np.abs(x[2:, : n + 2])
    mass = np.concatenate([[chain.near.mass_kg], np.full(n, piece.mass_kg), [chain.far.mass_kg]])
    stretch = np.abs(x[2:, n + 2 : 2 * n + 3]).max(axis=1, keepdims=True)  # also of slack links, which round as much
    largest = (
        np.maximum(link.stiffness_N_per_m * chain.elements.ratio.max() * stretch, np.abs(run.force_N[2:, None])) + 1.0
    )
    momentum = mass * np.maximum(v, np.abs(x[1:-1, : n + 2])).max(axis=1, keepdims=True) / weight
    bound = np.empty_like(defect)
    bound[:, : n + 2] = (largest + momentum) * weight / mass
    speed = v.max(axis=1, keepdims=True)
    bound[:, n + 2 : 3 * n + 4] = np.abs(now[:, n + 2 : 3 * n + 4]) + weight * speed + 1e-6
    normal = np.maximum(tension[2:, :-1] + tension[2:, 1:] + 2 * piece.adhesion_N, 1e-9)
    mu = max(min(friction.slip_coefficients), 1e-12)
    f_s = np.abs(now[:, 3 * n + 4 : 4 * n + 4])
    swept = weight * friction.bristle_stiffness_N_per_m * v[:, 1:-1]
    bound[:, 3 * n + 4 : 4 * n + 4] = largest + f_s + swept * (1 + f_s / (normal * mu))
    bound[:, 4 * n + 4 :] = np.abs(now[:, -2:]) + weight * speed + 1e-6
    return np.flatnonzero((defect > 1e-9 * bound).any(axis=1))


@pytest.mark.parametrize("seed", [113])
def test_engines_agree_where_a_step_is_split_deeply(seed: int) -> None:
    """Into pieces down to 1/64 and 1/512 of the step, and longer ones after them; a tenth of the step agrees."""
    chain, force, step = random_rig(np.random.default_rng(seed))
    start = float(force[0])
    runs = [
        simulate(chain, force, step, initial_tension_N=start, engine=engine)
        for engine in (Engine.COMPILED, Engine.CASADI)
    ]
    assert runs[0].splits > 0
    assert np.sqrt(np.mean((runs[0].tension_N - runs[1].tension_N) ** 2)) < 0.01 * runs[0].tension_N.max()
    rows = np.arange(10 * (len(force) - 1) + 1) / 10
    fine = simulate(chain, np.interp(rows, np.arange(len(force)), force), step / 10, initial_tension_N=start)
    error = runs[0].output_tension_N - fine.output_tension_N[::10]
    assert np.sqrt(np.mean(error**2)) < 0.03 * fine.output_tension_N.max()


@pytest.mark.parametrize("block", range(8))
def test_random_scenarios_never_fail_silently(block: int) -> None:
    """200 of them: finite and in balance, row by row, except where a split step is made of smaller ones."""
    splits = slack = 0
    for seed in range(25 * block, 25 * block + 25):
        chain, force, step = random_rig(np.random.default_rng(seed))
        run = simulate(chain, force, step, initial_tension_N=float(force[0]), record=True)
        if run.outcome is Outcome.FAILED:
            assert "worst balance" in run.message
            assert " at t = " in run.message
            continue
        assert len(run.tension_N) == len(force)
        assert np.isfinite(run.states).all()
        assert run.tension_N.min() >= 0
        assert len(unbalanced_rows(chain, run, step)) <= run.splits, f"seed {seed}"
        splits += run.splits
        slack += run.outcome is Outcome.SLACK
    assert splits > 0
    assert slack > 0
