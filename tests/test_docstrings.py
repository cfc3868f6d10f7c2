"""Docstrings of public names: examples that run."""

import doctest
import inspect
import os
from pathlib import Path

import pytest

import tendonff as tf

ROOT = Path(__file__).resolve().parents[1]
FUNCTIONS = [name for name in tf.__all__ if inspect.isfunction(getattr(tf, name))]
SLOW = doctest.register_optionflag("SKIP")  # an example that takes longer; all run where TENDONFF_ALL_EXAMPLES is set


@pytest.mark.parametrize("name", FUNCTIONS)
def test_the_example_of_every_public_function_runs(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    text = inspect.getdoc(getattr(tf, name))
    assert text is not None
    assert "\nExamples\n--------\n" in text
    test = doctest.DocTestParser().get_doctest(text, {}, name, None, 0)
    assert test.examples
    if os.environ.get("TENDONFF_ALL_EXAMPLES"):
        for each in test.examples:
            each.options.pop(SLOW, None)
    monkeypatch.chdir(ROOT)
    said: list[str] = []
    assert doctest.DocTestRunner(verbose=False).run(test, out=said.append).failed == 0, "".join(said)
