"""Run-time friction in the exported inverse, and the co-simulation units of a scenario with [adaptation]."""

import ctypes
import shutil
from dataclasses import replace

import numpy as np
import pytest

from tendonff.compensator.compensators.base import Problem
from tendonff.compensator.compensators.closed_form import Inverse
from tendonff.compensator.export.fmu import build_fmu
from tendonff.compensator.export.kinds import FmiVersion, Kind
from tendonff.compensator.export.text.c_text import c_sources
from tendonff.compensator.files.reading import InputError
from tendonff.compensator.scenarios import load_scenario
from tendonff.models.tendon.chain import Chain
from tendonff.ocp.codegen.compiler import load_library
from tendonff.ocp.codegen.precision import Precision
from tendonff.ocp.tendon.inverse import invert

ROWS = 1200
DRIVER = """
static tff_inverse it;
void play(long n, const tff_real *given, long change, double mu, tff_real *answer)
{
    long k;
    tff_inverse_init(&it, given[0]);
    for (k = 1; k < n; k++) {
        if (k == change) {
            tff_inverse_set_mu(&it, (tff_real)mu);
        }
        answer[k] = tff_inverse_step(&it, given[k]);
    }
}
double mu(void) { return (double)tff_inverse_mu(&it); }
"""


@pytest.fixture(scope="module")
def adaptive(examples):
    return load_scenario(examples / "finger_adaptive.toml")


@pytest.fixture(scope="module")
def play(adaptive):
    """Forces of the exported inverse for the reference, with another mu from a sample on."""
    made = {}

    def run(precision, change, mu):
        problem = Problem.of(adaptive)
        if precision not in made:
            texts = c_sources(adaptive, problem, (Inverse.c_module,), precision, "tff")
            names = ("parameters", "limits", "state", "inverse")
            order = ("types.h", *(f"{name}.h" for name in (*names, "inversion")), *(f"{name}.c" for name in names))
            lines = [line for name in order for line in texts[f"tff_{name}"].splitlines()]
            made[precision] = load_library("\n".join([x for x in lines if not x.startswith('#include "')] + [DRIVER]))
        kind = np.float32 if precision is Precision.FLOAT else np.float64
        given = np.ascontiguousarray(problem.reference.tension_N[:ROWS], dtype=kind)
        answer = np.full(ROWS, given[0], dtype=kind)
        arrays = (ctypes.c_void_p(a.ctypes.data) for a in (given, answer))
        first, last = arrays
        made[precision].play(ctypes.c_long(ROWS), first, ctypes.c_long(change), ctypes.c_double(mu), last)
        made[precision].mu.restype = ctypes.c_double
        return answer.astype(float), made[precision].mu()

    return run


def expected(scenario, mu):
    friction = replace(scenario.transmission.friction, mu_dynamic=mu, mu_static=mu)
    chain = Chain.of(replace(scenario.transmission, friction=friction), scenario.run.level)
    return invert(chain, Problem.of(scenario).reference.tension_N[:ROWS], scenario.run.step_s).force_N


@pytest.mark.compiler
@pytest.mark.parametrize(("precision", "tolerance"), [(Precision.DOUBLE, 1e-8), (Precision.FLOAT, 0.02)])
def test_the_inverse_takes_another_mu_at_run_time(adaptive, play, precision, tolerance):
    """Set before the first sample it is the inverse of that friction; not set it is the scenario's."""
    for change, mu in ((1, 0.26), (ROWS, 0.2)):
        forces, said = play(precision, change, mu)
        assert forces == pytest.approx(expected(adaptive, mu), abs=tolerance)
        assert said == pytest.approx(mu)


@pytest.mark.compiler
def test_a_mu_that_means_nothing_changes_nothing(play):
    forces, said = play(Precision.DOUBLE, 500, float("nan"))
    assert forces == pytest.approx(play(Precision.DOUBLE, ROWS, 0.2)[0], abs=0)
    assert said == 0.2


@pytest.mark.each_value
@pytest.mark.parametrize("fmi", FmiVersion)
@pytest.mark.parametrize("kind", [Kind.ADAPTIVE, Kind.INVERSE])
def test_the_units_are_valid(adaptive, tmp_path, kind, fmi):
    pytest.importorskip("fmpy", reason="fmpy is not installed")
    from fmpy import read_model_description
    from fmpy.validation import validate_fmu

    if shutil.which("cc") is None:
        pytest.skip("cc is not installed")
    path = tmp_path / "unit.fmu"
    path.write_bytes(build_fmu(adaptive, kind, fmi).content)
    assert validate_fmu(str(path)) == []
    variables = {v.name: (v.causality, v.variability) for v in read_model_description(str(path)).modelVariables}
    if kind is Kind.ADAPTIVE:
        assert variables["measured"] == ("input", "continuous")
        assert variables["mu"] == ("output", "continuous")
    else:
        assert variables["mu"] == ("parameter", "tunable")


@pytest.mark.compiler
@pytest.mark.parametrize("example", ["finger_adaptive", "finger_moving"])
def test_the_adaptive_unit_finds_the_friction_of_a_plant(adaptive, examples, tmp_path, example):
    """Measurements of a rig with 20 % more friction: what the tuner of Python says too."""
    fmpy = pytest.importorskip("fmpy", reason="fmpy is not installed")
    if shutil.which("cc") is None:
        pytest.skip("cc is not installed")
    from tendonff.compensator.compensators.tuning import tuned_chain, tuning_of
    from tendonff.ocp.adaptation.tuner import SelfTuner, SimulatedRig
    from tendonff.ocp.adaptation.tuning import Tunable

    scenario = replace(load_scenario(examples / f"{example}.toml"), adaptation=adaptive.adaptation)
    problem = Problem.of(scenario)
    tuning, start = tuning_of(problem, scenario.adaptation), problem.reference.initial_tension_N
    tuned, wanted = tuned_chain(problem, tuning), problem.reference.tension_N[1 : ROWS + 1]
    rig = SimulatedRig(tuned.with_factors({Tunable.MU: 1.2}), 1e-3, 1, start)
    run = SelfTuner(tuned, 1e-3, tuning, problem.limits, start).run(rig, wanted, np.zeros(ROWS))
    path = tmp_path / "unit.fmu"
    path.write_bytes(build_fmu(scenario, Kind.ADAPTIVE, FmiVersion.V2).content)
    columns = {"time": np.arange(ROWS) * 1e-3, "reference": wanted, "measured": run.measured}
    if (motion := problem.chain.motion) is not None:  # angles at the ends of the steps
        angles = motion.at(problem.reference.time_s[1 : ROWS + 1])
        columns |= {f"joint_{name}": angles[:, k] for k, name in enumerate(motion.names)}
    signal = np.array(list(zip(*columns.values(), strict=True)), dtype=[(name, float) for name in columns])
    out = fmpy.simulate_fmu(
        str(path),
        stop_time=ROWS * 1e-3,
        step_size=1e-3,
        output_interval=1e-3,
        input=signal,
        output=["force", "mu"],
        fmi_type="CoSimulation",
    )
    assert out["force"][1:] == pytest.approx(run.force_N, abs=1e-6)
    assert out["mu"][-1] == pytest.approx(0.24, rel=0.01)


def test_an_adaptive_unit_needs_the_table(finger):
    with pytest.raises(InputError, match=r"table \[adaptation\] is missing"):
        build_fmu(finger, Kind.ADAPTIVE, FmiVersion.V2)
