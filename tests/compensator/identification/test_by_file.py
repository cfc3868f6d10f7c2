"""What several files say about each other."""

from types import SimpleNamespace

import pytest

from tendonff.compensator.identification.fitting.uncertainty import ByFile, between_files
from tendonff.compensator.identification.parameters import Parameter

VALUES = {**dict.fromkeys(Parameter, 1.0), Parameter.MU: 0.2}


def said_of(mus):
    """Files an hour apart whose coefficient is known to 0.0001."""
    errors = {"mu_dynamic": 1e-4}
    files = [ByFile(file=f"{k}.csv", values={"mu_dynamic": mu}, errors=errors) for k, mu in enumerate(mus)]
    records = [SimpleNamespace(name=f.file, started_s=1.6e9 + 3600.0 * k) for k, f in enumerate(files)]
    return between_files(files, VALUES, records)


def test_a_trend_over_the_time_of_day_is_told_with_its_slope():
    """0.002 an hour is 0.99 % of the mean, 0.203; its error is that of four values, 1e-4/sqrt(5)."""
    rows, said = said_of([0.2, 0.202, 0.204, 0.206])
    assert [row.started_s for row in rows] == [1.6e9, 1.6e9 + 3600, 1.6e9 + 7200, 1.6e9 + 10800]
    [drift] = [line for line in said if "drifts" in line]
    assert drift.startswith("mu_dynamic drifts by +0.99 % an hour over these files (standard error 0.022 %)")


def test_scatter_without_a_trend_is_no_drift():
    _, said = said_of([0.2, 0.212, 0.212, 0.2])
    assert [line.split(":")[0] for line in said] == ["mu_dynamic differs between files beyond its errors"]


def test_files_that_agree_say_nothing():
    assert said_of([0.2, 0.20001, 0.2, 0.19999])[1] == []


@pytest.mark.parametrize("count", [0, 1, 2])
def test_few_files_have_no_scatter(count):
    assert not any("differs" in line for line in said_of([0.2, 0.3][:count])[1])
