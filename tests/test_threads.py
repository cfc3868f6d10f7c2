"""CasADi is not safe in threads: what needs it takes turns, in any thread, and compiled steps do not wait."""

import inspect
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import casadi as ca
import numpy as np
import pytest

import tendonff as tf
from tendonff.models.cached import cached_property
from tendonff.models.mechanism.chain import chain_equations
from tendonff.models.parameters import Transmission
from tendonff.models.turns import TURN, in_turn, out_of_turn
from tendonff.ocp.codegen.engine import Engine

WITHOUT_CASADI = {"load_scenario", "read_centreline", "sample_reference", "simulate_batch"}
FUNCTIONS = sorted(name for name in tf.__all__ if inspect.isfunction(getattr(tf, name)))


def chain_of(generic: Transmission, masses: int = 3) -> tf.Chain:
    return tf.Chain.of(generic, tf.Level.PRESLIDING, masses)


def ends_within(seconds: float, work: Callable[[], object]) -> bool:
    thread = threading.Thread(target=work, daemon=True)
    thread.start()
    thread.join(seconds)
    return not thread.is_alive()


@pytest.mark.parametrize("name", FUNCTIONS)
def test_every_public_function_that_needs_casadi_takes_its_turn(name: str) -> None:
    assert hasattr(getattr(tf, name), "__wrapped__") == (name not in WITHOUT_CASADI)


def test_equations_wait_for_the_thread_whose_turn_it_is(generic: Transmission) -> None:
    done = threading.Event()

    def build() -> None:
        with TURN:
            chain_equations(chain_of(generic))
        done.set()

    with TURN:
        assert not ends_within(0.05, build)
        with out_of_turn():
            assert done.wait(20)


@pytest.mark.compiler
def test_a_compiled_run_lets_others_take_their_turn(generic: Transmission) -> None:
    force = 30 + 10 * np.sin(np.arange(24_000) * 1e-2)
    tf.simulate(chain_of(generic), force[:2], 1e-3)
    with ThreadPoolExecutor(1) as executor:
        long = executor.submit(tf.simulate, chain_of(generic, 100), force, 1e-3)
        time.sleep(0.05)
        with TURN:
            meanwhile = not long.done()
        assert meanwhile
        assert long.result().outcome == "done"


def test_a_batch_in_turn_does_not_wait_for_itself(generic: Transmission) -> None:
    job = tf.SimulationJob(chain=chain_of(generic), force_N=np.full(5, 30.0), step_s=1e-3)

    def batch() -> None:
        with TURN:
            tf.simulate_batch([job, job])

    assert ends_within(60, batch)


def test_an_error_of_a_thread_holds_no_expressions() -> None:
    """They would be dropped by whoever drops the error, out of turn."""

    @in_turn
    def fails() -> None:
        expression = ca.SX.sym("x")
        raise ValueError(str(expression))

    with ThreadPoolExecutor(1) as executor:
        error = executor.submit(fails).exception()
    assert error is not None
    step = error.__traceback__
    while step is not None:
        assert not any(isinstance(value, ca.SX) for value in step.tb_frame.f_locals.values())
        step = step.tb_next


_STRESS = """
import sys, threading, time
import numpy as np
import tendonff as tf
from tendonff.models.mechanism.chain import chain_equations
from tendonff.models.turns import TURN
from tendonff.ocp.codegen.engine import Engine
from tendonff.ocp.step import c_engine

scenario = tf.load_scenario(sys.argv[1])
engine, end = Engine(sys.argv[2]), time.monotonic() + float(sys.argv[3])
reference = tf.sample_reference(scenario)
counts, failures = [0] * 3, []

def run(k):
    try:
        while time.monotonic() < end or not counts[k]:
            chain = tf.Chain.of(scenario.transmission, tf.Level.PRESLIDING, 3 + k)
            force = reference.tension_N[:70] + k
            tf.simulate(chain, force, 1e-3, engine=engine)
            with TURN:
                equations = chain_equations(chain)
                del equations
                c_engine._LIBRARIES.clear()  # the code is made anew
            job = tf.SimulationJob(chain=chain, force_N=force, step_s=1e-3, engine=engine)
            bad = tf.SimulationJob(chain=chain, force_N=force * np.nan, step_s=1e-3, engine=engine)
            good, failed = tf.simulate_batch([job, bad])
            assert good.error is None and failed.error is not None
            counts[k] += 1
    except BaseException as error:
        failures.append(error)

threads = [threading.Thread(target=run, args=(k,)) for k in range(len(counts))]
for thread in threads:
    thread.start()
for thread in threads:
    thread.join()
sys.exit(repr(failures) if failures else 0)
"""


@pytest.mark.parametrize("seconds", [0.5, pytest.param(60, marks=pytest.mark.nightly)])
@pytest.mark.parametrize("engine", [Engine.CASADI, pytest.param(Engine.COMPILED, marks=pytest.mark.compiler)])
def test_threads_that_simulate_build_and_fail_at_once_do_not_end_the_process(
    examples: object, engine: Engine, seconds: float
) -> None:
    command = [
        sys.executable,
        "-X",
        "faulthandler",
        "-c",
        _STRESS,
        f"{examples}/finger.toml",
        engine.value,
        str(seconds),
    ]
    done = subprocess.run(command, capture_output=True, text=True, timeout=seconds + 300, check=False)
    assert done.returncode == 0, done.stderr


def test_a_value_that_is_computed_once_keeps_no_lock_that_a_turn_could_wait_for() -> None:
    """Python 3.11 locks a cached property: one thread in its turn waited for it, the one that had it for its turn."""
    inside, other_done = threading.Event(), threading.Event()

    class Slow:
        def __init__(self, wait: threading.Event | None) -> None:
            self.wait = wait

        @cached_property
        def value(self) -> int:
            if self.wait is not None:
                inside.set()
                with out_of_turn():
                    assert self.wait.wait(10)
            return 7

    @in_turn
    def read(slow: Slow) -> int:
        return slow.value

    with ThreadPoolExecutor(2) as executor:
        first = executor.submit(read, Slow(other_done))
        assert inside.wait(10)
        second = executor.submit(read, Slow(None))
        second.add_done_callback(lambda _: other_done.set())
        assert (first.result(20), second.result(20)) == (7, 7)
