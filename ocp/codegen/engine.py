"""What advances the chain: compiled C, or CasADi's own evaluation."""

import functools
import os
from enum import StrEnum

from tendonff.ocp.codegen.compiler import find_compiler


class Engine(StrEnum):
    """What advances the chain; all take the same decisions and give the same results to 1e-9 N.

    Where the tendon sticks and slips on stiff bristles, rounding decides what comes next, for any engine.

    Attributes
    ----------
    AUTO
        Compiled C where a C compiler works, CasADi elsewhere. The environment variable TENDONFF_ENGINE decides first.
    COMPILED
        Generated C, compiled once and cached.
    CASADI
        CasADi's own evaluation, no compiler needed.
    """

    AUTO = "auto"
    COMPILED = "compiled"
    CASADI = "casadi"


@functools.cache
def resolve_engine(engine: Engine) -> Engine:
    """Turn AUTO into what works here.

    Parameters
    ----------
    engine : Engine

    Returns
    -------
    Engine
        COMPILED or CASADI.
    """
    if engine is not Engine.AUTO:
        return engine
    if wanted := os.environ.get("TENDONFF_ENGINE"):
        return Engine(wanted)
    return Engine.CASADI if find_compiler() is None else Engine.COMPILED
