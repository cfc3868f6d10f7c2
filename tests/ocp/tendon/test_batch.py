import os
import threading
import time
from concurrent.futures import Executor, ProcessPoolExecutor, ThreadPoolExecutor

import numpy as np
import pytest

from tendonff.models.errors import ParameterError
from tendonff.models.fidelity import Level
from tendonff.models.parameters import Transmission
from tendonff.models.tendon.chain import Chain
from tendonff.ocp.errors import SolveError
from tendonff.ocp.tendon.batch import Done, SimulationJob, run_jobs, run_simulation, simulate_batch
from tendonff.ocp.tendon.simulate import Simulation, simulate


def jobs_of(generic: Transmission, count: int = 6) -> list[SimulationJob]:
    time_s = np.arange(0.0, 0.3, 1e-3)
    return [
        SimulationJob(
            chain=Chain.of(generic, Level.PRESLIDING, 1 + k), force_N=30 + (5 + k) * np.sin(20 * time_s), step_s=1e-3
        )
        for k in range(count)
    ]


def check(results: list[Done[Simulation]], jobs: list[SimulationJob]) -> None:
    """In order, equal to what `simulate` gives, with the one bad job reported and the others kept."""
    assert [result.index for result in results] == list(range(len(jobs)))
    for k, (result, job) in enumerate(zip(results, jobs, strict=True)):
        if k == 2:
            assert result.value is None
            assert isinstance(result.error, ParameterError)
            with pytest.raises(SolveError, match=r"job 3 failed: force_N must be finite, got nan at t = 0\.005 s"):
                result.require()
        else:
            plain = simulate(job.chain, job.force_N, job.step_s)
            assert np.array_equal(result.require().tension_N, plain.tension_N)


def with_one_bad(generic: Transmission) -> list[SimulationJob]:
    jobs = jobs_of(generic)
    jobs[2].force_N[5] = np.nan
    return jobs


@pytest.mark.parametrize("make", [lambda: None, lambda: ThreadPoolExecutor(3), lambda: ProcessPoolExecutor(2)])
def test_results_come_in_order_and_one_bad_job_does_not_lose_the_others(generic: Transmission, make: object) -> None:
    jobs = with_one_bad(generic)
    seen: list[tuple[int, int]] = []
    executor: Executor | None = make()  # type: ignore[operator]
    results = simulate_batch(jobs, executor=executor, progress=lambda done, total: seen.append((done, total)))
    check(results, jobs)
    assert seen == [(k, 6) for k in range(1, 7)]
    if executor is not None:
        assert executor.submit(os.getpid).result() > 0  # still open
        executor.shutdown()


def test_results_do_not_wait_in_the_order_of_the_jobs() -> None:
    """The first job ends last; progress counts the others meanwhile."""
    release = threading.Event()

    def job(k: int) -> int:
        if k == 0:
            release.wait(10)
        return 10 * k

    def progress(done: int, total: int) -> None:
        if done == total - 1:
            release.set()

    with ThreadPoolExecutor(2) as executor:
        results = run_jobs(job, range(5), executor=executor, progress=progress)
    assert [result.require() for result in results] == [0, 10, 20, 30, 40]


def test_an_interrupt_cancels_what_has_not_begun() -> None:
    begun: list[int] = []

    def job(k: int) -> None:
        begun.append(k)
        time.sleep(0.01)

    def interrupted(_done: int, _total: int) -> None:
        raise KeyboardInterrupt

    with ThreadPoolExecutor(1) as executor, pytest.raises(KeyboardInterrupt):
        run_jobs(job, range(200), executor=executor, progress=interrupted)
    assert len(begun) < 20


def test_no_jobs_give_no_results() -> None:
    assert simulate_batch([]) == []


def test_compiled_steps_leave_the_interpreter_to_other_threads(generic: Transmission) -> None:
    """While one thread simulates, this one runs on: so threads are enough for a batch."""
    chain = Chain.of(generic, Level.PRESLIDING, 100)
    job = SimulationJob(chain=chain, force_N=30 + 10 * np.sin(np.arange(30_000) * 1e-2), step_s=1e-3)
    ticks = 0
    with ThreadPoolExecutor(1) as executor:
        run_simulation(SimulationJob(chain=chain, force_N=job.force_N[:2], step_s=1e-3))
        future = executor.submit(run_simulation, job)
        while not future.done():
            time.sleep(1e-3)
            ticks += 1
        assert future.result().outcome == "done"
    assert ticks > 20


@pytest.mark.nightly
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
@pytest.mark.filterwarnings("ignore::ResourceWarning")
def test_a_dask_cluster_serves_as_executor(generic: Transmission) -> None:
    distributed = pytest.importorskip(
        "distributed", reason='needs Dask: pip install "tendonff[distributed]"', exc_type=ImportError
    )
    jobs = with_one_bad(generic)
    with (
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None, host="127.0.0.1"
        ) as cluster,
        distributed.Client(cluster) as client,
    ):
        check(simulate_batch(jobs, executor=client.get_executor()), jobs)
