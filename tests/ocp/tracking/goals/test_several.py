"""Several references at once give what each gives alone."""

from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import numpy as np
import pytest

from tendonff.models.chain import Chain
from tendonff.models.errors import ParameterError
from tendonff.models.fidelity import Level
from tendonff.models.parameters import Transmission
from tendonff.ocp.tracking.goals.several import track_batch
from tendonff.ocp.tracking.limits import ForceLimits
from tendonff.ocp.tracking.problem import TrackOptions
from tendonff.ocp.tracking.track import track

STEP = 5e-3
LIMITS = ForceLimits(minimum_N=0.0, maximum_N=300.0, rate_N_per_s=300.0)
QUICK = TrackOptions(restarts=0)


def swing(height: float, rows: int) -> np.ndarray:
    return 30 + height * np.sin(2 * np.pi * np.arange(rows) * STEP) ** 2


@pytest.mark.parametrize("is_other_process", [False, True])
def test_each_reference_gets_the_profile_that_it_gets_alone(generic: Transmission, is_other_process: bool) -> None:
    chain, references, told = Chain.of(generic, Level.PRESLIDING), [swing(8.0, 121), swing(5.0, 101)], []
    pool = ProcessPoolExecutor(1, mp_context=get_context("spawn")) if is_other_process else None
    found = track_batch(
        chain, references, STEP, LIMITS, QUICK, executor=pool, progress=lambda done, total: told.append((done, total))
    )
    if pool is not None:
        pool.shutdown()
    for reference, each in zip(references, found, strict=True):
        alone = track(chain, reference, STEP, LIMITS, QUICK)
        assert np.abs(each.require().force_N - alone.force_N).max() < 1e-6
        assert alone.iterations > 0
    assert told == [(1, 2), (2, 2)]


def test_a_reference_that_is_not_usable_fails_alone(generic: Transmission) -> None:
    chain = Chain.of(generic, Level.PRESLIDING)
    good, bad = track_batch(chain, [swing(0.1, 41), swing(0.1, 41) * np.nan], STEP, LIMITS, QUICK)
    assert good.error is None
    assert isinstance(bad.error, ParameterError)
