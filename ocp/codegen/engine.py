"""Engines that advance the chain: compiled C, or CasADi's own evaluation."""

import functools
import os
from enum import StrEnum

from tendonff.ocp.codegen.compiler import find_compiler
from tendonff.ocp.errors import CodeError


class Engine(StrEnum):
    """Engine that advances the chain; all give the same results to 1e-9 N on ordinary runs.

    Where the tendon sticks and slips on stiff bristles, or a step must be split, they may part ways.
    """

    # compiled C where a C compiler works, CasADi elsewhere. The environment variable TENDONFF_ENGINE decides first
    AUTO = "auto"
    COMPILED = "compiled"  # generated C, compiled once and cached
    CASADI = "casadi"  # CasADi's own evaluation, no compiler needed


def resolve_engine(engine: Engine) -> Engine:
    """Turn AUTO into what works here, COMPILED or CASADI.

    Raises
    ------
    CodeError
        If the environment variable names no engine.
    """
    if engine is not Engine.AUTO:
        return engine
    if wanted := os.environ.get("TENDONFF_ENGINE"):
        try:
            chosen = Engine(wanted)
        except ValueError:
            names = ", ".join(engine.value for engine in Engine)
            raise CodeError(
                f"the environment variable TENDONFF_ENGINE must be one of {names}, got {wanted!r}"
            ) from None
        if chosen is not Engine.AUTO:
            return chosen
    return Engine.COMPILED if _has_compiler() else Engine.CASADI


@functools.cache
def _has_compiler() -> bool:
    return find_compiler() is not None
