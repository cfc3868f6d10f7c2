"""Effects that other numbers stand in for are taken up where the law without them is excluded at 95 %."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from tendonff.compensator.identification.motors.alternatives import with_alternatives
from tendonff.compensator.identification.parameters import Parameter as N
from tendonff.ocp.fits.least_squares import Residuals, Solution

BLOCKS = 40
START = {N.MU: 0.3, N.TENSION: 12.0, N.STIFFNESS: 1e4}


def fitted(values: dict[N, float], gain: float) -> Solution:
    """A fit whose likelihood is better by `gain` than that of cost 1."""
    ones = np.ones(BLOCKS)
    residuals = Residuals(values=ones, slopes=np.zeros((BLOCKS, len(values))), blocks=np.arange(BLOCKS))
    size = len(values)
    return Solution(
        values={str(n): v for n, v in values.items()},
        covariance=1e-6 * np.eye(size),
        degrees=BLOCKS - size,
        residuals=residuals,
        cost=math.exp(-2 * gain / BLOCKS),
        at_bound=(),
    )


@pytest.mark.parametrize(("gain", "taken"), [(1.8, False), (2.5, True)])
def test_an_effect_is_taken_up_where_the_law_without_it_is_excluded(monkeypatch, gain, taken):
    """At a gain of 2.5 the law without it is excluded at 95 %: chi-squared of one number is 5.0, its quantile 3.84."""
    monkeypatch.setattr(
        "tendonff.compensator.identification.motors.alternatives.covariance_of", lambda _, found: found.covariance
    )
    mechanism = SimpleNamespace()
    monkeypatch.setattr(N, "of", lambda *_: 1.0)

    def fit(values, *, most, tolerance=1e-3):
        return fitted(values, gain if N.ADHESION in values else 0.0)

    law = SimpleNamespace(fit=fit, mechanism=mechanism)
    found, tried, alternatives = with_alternatives(law, fitted(START, 0.0), (), lambda _: None)
    assert (N.ADHESION in found.values) == taken
    assert (N.ADHESION, pytest.approx(gain), taken) in tried
    assert (N.ADHESION in alternatives) != taken
