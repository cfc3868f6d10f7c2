"""Exported code run on this machine: what single precision really loses is measured, not estimated."""

import ctypes
import math
import re
import tempfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from tendonff.compensator.compensators.profile import FloatArray
from tendonff.ocp.codegen.compiler import find_compiler, load_library, run_compiler
from tendonff.ocp.codegen.precision import Precision
from tendonff.ocp.errors import CodeError

_FLAGS = ("-std=c99", "-O0", "-shared", "-fPIC", "-ffp-contract=off", "-fno-math-errno")
_CONTRACTED = ("-std=c99", "-O2", "-shared", "-fPIC", "-ffp-contract=fast", "-fno-math-errno")  # where it optimises
_NATIVE = "-march=native"  # with products and sums in one, where the processor can; not every compiler knows the word
_INCLUDE = re.compile(r'^#include "([^"]+)"$', re.MULTILINE)
_DRIVER = """
void run_{module}(long n, double start, const {prefix}_real *given, const {prefix}_real *joint, {prefix}_real *answer,
                  const {prefix}_real *friction)
{{
    {prefix}_{module} self;
    long k;
    (void)joint;
    (void)friction;
    {prefix}_{module}_init(&self, ({prefix}_real)start);
{use}    for (k = 0; k < n; k++) {{
        answer[k] = {prefix}_{module}_step(&self, {given}{more});
    }}
}}
"""

_USE = """    if (friction[0] >= 0) {{
        {prefix}_parameters given;
        {prefix}_parameters_init(&given);
        given.mu_release = friction[0];
        given.adhesion = friction[1];
        (void){prefix}_{module}_use(&self, &given);
    }}
"""

_MORE = {"observer": ", ({0}_real)NAN"}  # further arguments of a step: no position was measured


class HostCode:
    """Exported sources with a driver around them, compiled and loaded.

    Attributes
    ----------
    real : type
        Real type of the sources, as numpy names it.
    """

    def __init__(self, library: ctypes.CDLL, precision: Precision) -> None:
        self._library = library
        self.real: type[np.floating[Any]] = np.float32 if precision is Precision.FLOAT else np.float64

    def function(self, name: str, *arguments: Any, result: Any = None) -> Callable[..., Any]:
        """A function of the driver, with the types of its arguments: those of ctypes, `reals` for an array."""
        found: Any = self._library[name]  # an own object, which no other caller's types change
        found.argtypes, found.restype = arguments, result
        return found  # type: ignore[no-any-return]

    @property
    def reals(self) -> Any:
        """Type of an argument that is a contiguous array of the real type."""
        return np.ctypeslib.ndpointer(dtype=self.real, flags="C_CONTIGUOUS")

    def array(self, values: FloatArray) -> Any:
        """Values as such an array."""
        return np.ascontiguousarray(values, dtype=self.real)


def compile_on_host(
    sources: Mapping[str, str], driver: str, precision: Precision, *, keep: bool = False, contracted: bool = False
) -> HostCode | None:
    """Exported sources, texts by file name, and a driver; None without a C compiler, CodeError if it refuses.

    What is to be kept is compiled once, and fast; what runs once takes longer to compile than to run. Contracted, it
    rounds products and sums in one where this processor can.
    """
    compiler = find_compiler()
    if compiler is None:
        return None
    if keep:
        return HostCode(load_library(_in_one(sources, driver)), precision)
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as scratch:
        folder = Path(scratch)
        for name, text in {**sources, "driver.c": driver}.items():
            (folder / name).write_text(text, encoding="utf-8")
        compiled = ["driver.c", *(name for name in sources if name.endswith(".c"))]
        files = ["-o", "code.so", *compiled, "-lm"]
        tries = ((*_CONTRACTED, _NATIVE), _CONTRACTED) if contracted else (_FLAGS,)
        complaint: str | None = None
        for flags in tries:
            complaint = run_compiler(compiler, [*flags, *files], folder)
            if complaint is None:
                break
        if complaint:
            raise CodeError(f"the exported sources: {complaint}")
        return HostCode(ctypes.CDLL(str(folder / "code.so")), precision)


def _in_one(sources: Mapping[str, str], driver: str) -> str:
    """Sources and driver as one text: each header where it is first included."""
    seen: set[str] = set()

    def header(match: re.Match[str]) -> str:
        name = match[1]
        if name not in sources:
            return match[0]
        if name in seen:
            return ""
        seen.add(name)
        return _INCLUDE.sub(header, sources[name])

    parts = [text for name, text in sources.items() if name.endswith(".c")]
    return "\n".join(_INCLUDE.sub(header, text) for text in [*parts, driver])


def run_on_host(
    sources: Mapping[str, str],
    prefix: str,
    precision: Precision,
    runs: Sequence[Mapping[str, FloatArray]],
    joints_rad: Sequence[FloatArray] = (),
    friction: Mapping[int, tuple[float, float]] = MappingProxyType({}),
    *,
    contracted: bool = False,
) -> list[dict[str, FloatArray]] | None:
    """Answer of each module to each of its inputs, from rest at the first sample; None where there is no C compiler.

    Sources are texts by file name; CodeError if the compiler refuses them. A run has inputs by name of the module, of
    shape (n,), or (n, m) where a step takes m of them, and joint angles of shape (n, joints).
    `friction` has the release coefficient and the adhesion [N] of runs, by number, in which the scenario's is replaced.
    Contracted, products and sums are rounded in one where this processor can.
    """
    modules = sorted({module for inputs in runs for module in inputs})
    moved = [joint for joint in joints_rad if joint.size]
    given_joints = f", &joint[{moved[0].shape[1]} * k]" if moved else ""
    driver = "#include <math.h>\n" + "".join(f'#include "{prefix}_{module}.h"\n' for module in modules)
    set_in = {module for run in friction for module in runs[run]}
    columns = {module: values[0].size for inputs in runs for module, values in inputs.items()}
    driver += "".join(
        _DRIVER.format(
            module=module,
            prefix=prefix,
            use=_USE.format(module=module, prefix=prefix) if module in set_in else "",
            given=", ".join(f"given[({columns[module]} * k) + {j}]" for j in range(columns[module])),
            more=(_MORE.get(module, "").format(prefix) if columns[module] == 1 else "") + given_joints,
        )
        for module in modules
    )
    found = compile_on_host(sources, driver, precision, contracted=contracted)
    if found is None:
        return None
    code = found

    def answer(
        module: str, values: FloatArray, joint_rad: FloatArray, start: float, set_to: tuple[float, float]
    ) -> FloatArray:
        call = code.function(f"run_{module}", ctypes.c_long, ctypes.c_double, *(code.reals,) * 4)
        answered = np.empty(len(values), dtype=code.real)
        call(len(values), start, code.array(values), code.array(joint_rad), answered, code.array(np.array(set_to)))
        return answered.astype(np.float64)

    answers = []
    every = joints_rad or [np.empty(0)] * len(runs)
    for number, (inputs, joint) in enumerate(zip(runs, every, strict=True)):
        set_to = friction.get(number, (math.nan, math.nan))
        # the plant takes forces or commands, and starts under the tension that the others start from
        starts = {module: float(inputs.get("inverse", values).flat[0]) for module, values in inputs.items()}
        answers.append(
            {module: answer(module, values, joint, starts[module], set_to) for module, values in inputs.items()}
        )
    return answers
