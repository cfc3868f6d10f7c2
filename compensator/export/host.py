"""Exported code run on this machine: what single precision really loses is measured, not estimated."""

import ctypes
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from tendonff.compensator.compensators.profile import FloatArray
from tendonff.ocp.codegen.compiler import find_compiler, run_compiler
from tendonff.ocp.codegen.precision import Precision
from tendonff.ocp.errors import CodeError

_FLAGS = ("-std=c99", "-O1", "-shared", "-fPIC", "-ffp-contract=off", "-fno-math-errno")
_DRIVER = """
void run_{module}(long n, double start, const {prefix}_real *given, const {prefix}_real *joint, {prefix}_real *answer)
{{
    {prefix}_{module} self;
    long k;
    (void)joint;
    {prefix}_{module}_init(&self, ({prefix}_real)start);
    for (k = 0; k < n; k++) {{
        answer[k] = {prefix}_{module}_step(&self, given[k]{joints});
    }}
}}
"""


def run_on_host(
    sources: Mapping[str, str],
    prefix: str,
    precision: Precision,
    runs: Sequence[Mapping[str, FloatArray]],
    joints_rad: Sequence[FloatArray] = (),
) -> list[dict[str, FloatArray]] | None:
    """Answer of each module to each of its inputs, from rest at the first sample; None where there is no C compiler.

    Sources are texts by file name; CodeError if the compiler refuses them. A run has inputs by name of the module, and
    joint angles of shape (n, joints).
    """
    compiler = find_compiler()
    if compiler is None:
        return None
    modules = sorted({module for inputs in runs for module in inputs})
    moved = [joint for joint in joints_rad if joint.size]
    given_joints = f", &joint[{moved[0].shape[1]} * k]" if moved else ""
    driver = "".join(f'#include "{prefix}_{module}.h"\n' for module in modules)
    driver += "".join(_DRIVER.format(module=module, prefix=prefix, joints=given_joints) for module in modules)
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as scratch:
        folder = Path(scratch)
        for name, text in {**sources, "driver.c": driver}.items():
            (folder / name).write_text(text, encoding="utf-8")
        compiled = [name for name in sources if name.endswith(".c")]
        if complaint := run_compiler(compiler, [*_FLAGS, "-o", "code.so", "driver.c", *compiled, "-lm"], folder):
            raise CodeError(f"the exported sources: {complaint}")
        code = ctypes.CDLL(str(folder / "code.so"))
    real = np.float32 if precision is Precision.FLOAT else np.float64

    def answer(module: str, values: FloatArray, joint_rad: FloatArray, start: float) -> FloatArray:
        given, joint = (np.ascontiguousarray(array, dtype=real) for array in (values, joint_rad))
        answered = np.empty_like(given)
        pointers = (ctypes.c_void_p(array.ctypes.data) for array in (given, joint, answered))
        getattr(code, f"run_{module}")(ctypes.c_long(len(given)), ctypes.c_double(start), *pointers)
        return answered.astype(np.float64)

    answers = []
    every = joints_rad or [np.empty(0)] * len(runs)
    for inputs, joint in zip(runs, every, strict=True):
        # the plant takes forces or commands, and starts under the tension that the others start from
        starts = {module: float(inputs.get("inverse", values)[0]) for module, values in inputs.items()}
        answers.append({module: answer(module, values, joint, starts[module]) for module, values in inputs.items()})
    return answers
