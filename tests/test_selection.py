"""The ordinary run meets every value of crossed parameters, and leaves out only what is marked."""

import pytest

pytest_plugins = ["pytester"]

TESTS = """
import pytest

@pytest.mark.each_value
@pytest.mark.parametrize("a", [1, 2, 3])
@pytest.mark.parametrize(("b", "c"), [(1, 2), (3, 4)])
def test_crossed(a, b, c):
    print("met", a, b, c)

@pytest.mark.parametrize("d", [1, pytest.param(2, marks=pytest.mark.nightly)])
def test_plain(d):
    print("met", d)
"""


@pytest.fixture
def suite(pytester: pytest.Pytester, request: pytest.FixtureRequest) -> pytest.Pytester:
    """Small suite with the hooks of this one."""
    hooks = (request.config.rootpath / "tests" / "conftest.py").read_text(encoding="utf-8")
    pytester.makeconftest(hooks.replace("parents[1]", "parent"))
    pytester.makeini(
        f"[pytest]\nmarkers =\n  each_value\n  nightly\n  compiler\npythonpath = {request.config.rootpath / 'tests'}"
    )
    pytester.makepyfile(TESTS)
    return pytester


def test_every_value_is_met_with_as_few_combinations_as_the_longest_list(suite: pytest.Pytester) -> None:
    run = suite.inline_run("-p", "no:xdist")
    names = [
        report.nodeid.split("::")[1] for report in run.getreports("pytest_runtest_logreport") if report.when == "call"
    ]
    crossed = [name for name in names if name.startswith("test_crossed")]
    assert len(crossed) == 3
    assert {part for name in crossed for part in (name[-2], name.split("[")[1][:3])} == {"1", "2", "3", "1-2", "3-4"}
    assert "test_plain[2]" not in names


@pytest.mark.parametrize("arguments", [["--every-combination"], ["test_x.py::test_crossed", "test_x.py::test_plain"]])
def test_every_combination_runs_when_asked_for_or_named(suite: pytest.Pytester, arguments: list[str]) -> None:
    suite.makepyfile(test_x=TESTS)
    chosen = arguments if "::" in arguments[0] else [*arguments, "test_x.py"]
    suite.inline_run("-p", "no:xdist", *chosen).assertoutcome(passed=8)
