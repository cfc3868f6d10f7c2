import ctypes
import math
import shutil
import subprocess
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tendonff.compensator.scenarios import load_scenario
from tendonff.models.fidelity import Level
from tendonff.models.tendon.chain import Chain
from tendonff.ocp.codegen import compiler
from tendonff.ocp.codegen.partial_evaluation import PartialEvaluator
from tendonff.ocp.codegen.precision import Precision
from tendonff.ocp.codegen.printer import Law, literal
from tendonff.ocp.errors import CodeError
from tendonff.ocp.joint.laws import link_back, path_mass_back
from tendonff.ocp.step.laws import ElementLaws

pytestmark = pytest.mark.compiler

FINGER = load_scenario(Path(__file__).parents[3] / "examples" / "finger.toml").transmission
ELEMENTS = ElementLaws.of(Chain.of(FINGER, Level.PRESLIDING))
LAWS = (
    *(*ELEMENTS.simulation(), *ELEMENTS.inverse(), ELEMENTS.path_mass_inverse(drop=True), *ELEMENTS.tangent()),
    *(link_back(ELEMENTS), path_mass_back(ELEMENTS)),  # in two parts
)
MUS = [f"friction_mu_{kind}_{way}" for kind in ("dynamic", "static") for way in ("pull", "release")]
RANGES = {
    **dict.fromkeys(("f_near", "f_far", "f", "f_c", "force", "start"), (1.0, 80.0)),
    **dict.fromkeys(("v", "v_base", "rate"), (-0.2, 0.2)),
    **dict.fromkeys(("e_base", "z_base", "q_base", "x_c"), (-0.01, 0.01)),
    **dict.fromkeys(("f_s_base",), (-10.0, 10.0)),
    **dict.fromkeys(("link_stiffness_N_per_m", "link_relaxing_stiffness_N_per_m", "end_stiffness_N_per_m"), (1e3, 1e5)),
    **dict.fromkeys(MUS, (0.01, 0.2)),
    **dict.fromkeys(("pull",), (-1.0, 1.0)),
    "gain": (1.0, 100.0),
    "friction_bristle_stiffness_N_per_m": (1e3, 1e7),
    "H": (1e-4, 1e-2),
    "friction_stribeck_velocity_m_per_s": (1e-3, 1e-1),
}


@given(value=st.floats(allow_nan=False, allow_infinity=False))
def test_literals_read_back_as_the_same_number(value: float) -> None:
    text = literal(value, Precision.DOUBLE)
    assert float(text) == value
    assert any(mark in text for mark in ".e")


@given(value=st.floats(width=32, allow_nan=False, allow_infinity=False))
def test_float_literals_read_back_as_the_same_float(value: float) -> None:
    text = literal(value, Precision.FLOAT)
    assert text.endswith("f")
    assert np.float32(text[:-1]) == np.float32(value)


def wrapped(law: Law, precision: Precision) -> str:
    """The law in C with a visible entry that takes arrays; in two parts where it has held arguments."""
    real = precision.value
    printer = PartialEvaluator(prefix="c", precision=precision, parameters={}, reorder=precision is Precision.FLOAT)
    *early, printed = printer.parts([law])
    texts = {symbol.name(): f"in[{k}]" for k, symbol in enumerate(law.inputs)}
    lines = []
    for part in early:
        texts |= {name: name for name in part.outputs}
        arguments = [*map(texts.get, part.inputs), *(f"&{name}" for name in part.outputs)]
        lines += [f"{real} {', '.join(part.outputs)};", f"c_{part.name}({', '.join(arguments)});"]
    arguments = [*map(texts.get, printed.inputs), *(f"&out[{k}]" for k in range(len(law.outputs)))]
    lines.append(f"c_{law.name}({', '.join(arguments)});")
    entry = f"void call_{law.name}(const {real} *in, {real} *out) {{ {' '.join(lines)} }}\n"
    return "".join(part.code for part in (*early, printed)) + entry


def samples(law: Law, count: int = 200) -> np.ndarray:
    rng = np.random.default_rng(len(law.name))
    bounds = [RANGES.get(symbol.name(), (0.1, 2.0)) for symbol in law.inputs]
    return np.array([[rng.uniform(*bound) for bound in bounds] for _ in range(count)])


@pytest.fixture(scope="module", params=list(Precision))
def library(request: pytest.FixtureRequest) -> tuple[ctypes.CDLL, Precision]:
    precision: Precision = request.param
    source = "#include <math.h>\n" + "\n".join(wrapped(law, precision) for law in LAWS)
    return compiler.load_library(source), precision


@pytest.mark.parametrize("law", LAWS, ids=lambda law: law.name)
def test_printed_c_computes_what_casadi_computes(library: tuple[ctypes.CDLL, Precision], law: Law) -> None:
    """On both signs of every motion, to rounding of the type."""
    code, precision = library
    dtype, digits = (np.float64, 1e-12) if precision is Precision.DOUBLE else (np.float32, 2e-3)
    function = law.function()
    for values in samples(law):
        given_values = values.astype(dtype)
        out = np.zeros(len(law.outputs), dtype=dtype)
        getattr(code, f"call_{law.name}")(ctypes.c_void_p(given_values.ctypes.data), ctypes.c_void_p(out.ctypes.data))
        expected = [float(x) for x in function.call([float(x) for x in given_values])]
        scale = max(1.0, *map(abs, expected)) if precision is Precision.FLOAT else 0.0
        for found, wanted in zip(out, expected, strict=True):
            assert found == pytest.approx(wanted, rel=digits, abs=max(1e-13, 1e-4 * scale))


@pytest.mark.parametrize("precision", Precision)
def test_printed_c_compiles_without_warnings(tmp_path: Path, precision: Precision) -> None:
    compiler = shutil.which("gcc") or shutil.which("clang") or shutil.which("cc")
    if compiler is None:
        pytest.skip("no C compiler")
    (tmp_path / "laws.c").write_text("#include <math.h>\n" + "\n".join(wrapped(law, precision) for law in LAWS))
    flags = ["-std=c99", "-pedantic", "-Wall", "-Wextra", "-Wdouble-promotion", "-Wfloat-conversion", "-Werror"]
    run = subprocess.run(
        [compiler, *flags, "-Wno-missing-prototypes", "-c", "laws.c", "-o", "laws.o"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert run.returncode == 0, run.stderr


def test_an_operation_without_a_spelling_is_refused_by_name() -> None:
    x = ca.SX.sym("x")
    with pytest.raises(CodeError, match=r"odd: CasADi operation \d+ has no C spelling"):
        wrapped(Law(name="odd", comment="none", inputs=(x,), outputs={"y": ca.erf(x)}), Precision.DOUBLE)


def test_every_operation_that_is_spelled_computes() -> None:
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    outputs = {
        "a": ca.fmin(x, y) + ca.fmax(x, y) * ca.sign(x - y),
        "b": ca.if_else(ca.logic_and(x > 0, y != 1), ca.sqrt(ca.fabs(x)), ca.exp(-x)),
        "c": ca.if_else(ca.logic_or(x <= y, ca.logic_not(y == 2)), 2 * x, x**2) + ca.tanh(y) - ca.log(1 + y * y),
        "d": 1 / (1 + x * x) - (-x),
    }
    law = Law(name="operations", comment="every operation", inputs=(x, y), outputs=outputs)
    code = compiler.load_library("#include <math.h>\n" + wrapped(law, Precision.DOUBLE))
    for pair in [(-1.5, 2.0), (1.5, 1.0), (0.0, 0.0), (3.0, 2.0), (2.0, 3.0), (-2.0, -2.0)]:
        values, out = np.array(pair), np.zeros(4)
        code.call_operations(ctypes.c_void_p(values.ctypes.data), ctypes.c_void_p(out.ctypes.data))
        assert out == pytest.approx([float(v) for v in law.function()(*pair)], rel=1e-14)


def test_refused_c_is_reported_with_the_compilers_words(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    compiler.find_compiler()  # its probe goes into the usual cache
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    with pytest.raises(CodeError, match=r"generated C: .* failed with status \d+"):
        compiler.load_library("this is not C\n")
    assert [path for path in (tmp_path / "tendonff").iterdir() if path.name != "zig"] == []  # a compiler's own cache


def test_a_library_is_compiled_once(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    compiler.find_compiler()  # its probe goes into the usual cache
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    source = "double tff_answer(void) { return 42.0; }\n"
    compiler.load_library(source)
    built = list((tmp_path / "tendonff").glob("*.so"))
    assert len(built) == 1
    made = built[0].stat().st_mtime_ns
    library = compiler.load_library(source)
    library.tff_answer.restype = ctypes.c_double
    assert library.tff_answer() == 42.0
    assert built[0].stat().st_mtime_ns == made
    assert math.isclose(library.tff_answer(), 42.0)


def folded(expression: ca.SX, **parameters: float) -> str:
    """C of a law whose value is an expression of x and p."""
    symbols = {s.name(): s for s in ca.symvar(expression)}
    law = Law(name="risky", comment="none", inputs=tuple(symbols.values()), outputs={"y": expression})
    known = {name: (value,) for name, value in parameters.items()}
    return PartialEvaluator(prefix="c", precision=Precision.DOUBLE, parameters=known).fold(law).code


X, P = ca.SX.sym("x"), ca.SX.sym("p")


@pytest.mark.parametrize(
    "risk", [1 / P, ca.log(P), ca.exp(1e3 + P), P ** ca.SX(-1.5), 1 / P - ca.exp(1e3 + P)], ids=str
)
def test_a_branch_that_is_not_taken_may_divide_by_zero(risk: ca.SX) -> None:
    """The guard of a law decides beforehand, as it would at run time."""
    guarded = ca.if_else(P > 0, risk, 3) * X
    (line,) = [text for text in folded(guarded, p=0.0).splitlines() if "3" in text]
    assert "* x" in line or "x *" in line


@pytest.mark.parametrize("risk", [1 / P, ca.log(P), ca.exp(1e3 + P), 1 / P - ca.exp(1e3 + P)], ids=str)
def test_a_number_that_c_cannot_spell_is_refused_with_the_name_of_its_law(risk: ca.SX) -> None:
    with pytest.raises(CodeError, match=r"risky: a number of these parameters is (-?inf|nan): .* divided by zero"):
        folded(risk + X, p=0.0)
