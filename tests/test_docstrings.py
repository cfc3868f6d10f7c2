"""Docstrings of public names: examples that run, fields that are explained."""

import ast
import dataclasses
import doctest
import functools
import inspect
import operator
import os
import re
import sys
import typing
from pathlib import Path

import pytest

import tendonff as tf

ROOT = Path(__file__).resolve().parents[1]
COMPILED = {"suggest"}  # minutes without a compiler
FUNCTIONS = [
    pytest.param(name, marks=pytest.mark.compiler if name in COMPILED else ())
    for name in tf.__all__
    if inspect.isfunction(getattr(tf, name))
]
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


@functools.cache
def annotated(module: str) -> dict[str, object]:
    """Names that a module imports for its annotations alone."""
    found: dict[str, object] = {}
    for block in ast.parse(inspect.getsource(sys.modules[module])).body:
        if isinstance(block, ast.If) and ast.unparse(block.test) == "TYPE_CHECKING":
            exec(compile(ast.Module(block.body, []), module, "exec"), vars(sys.modules[module]) | {}, found)  # noqa: S102
    return found


def records() -> set[type]:
    """Records among the public names, in what public functions take and return, and in fields of such records."""
    found: set[type] = set()
    public = {name: getattr(tf, name) for name in tf.__all__}  # annotations name them without importing them
    todo: list[object] = list(public.values())
    while todo:
        each = todo.pop()
        todo += typing.get_args(each)
        if inspect.isfunction(each):
            todo += typing.get_type_hints(each, localns=annotated(each.__module__) | public).values()
        if inspect.isclass(each) and each.__module__.startswith("tendonff.") and each not in found:
            found.add(each)
            if dataclasses.is_dataclass(each):
                bases = [base.__module__ for base in each.__mro__ if base.__module__.startswith("tendonff.")]
                hints = typing.get_type_hints(each, localns=functools.reduce(operator.or_, map(annotated, bases)))
                todo += [hints[field.name] for field in dataclasses.fields(each) if field.name[0] != "_"]
    return {each for each in found if dataclasses.is_dataclass(each)}


def test_help_explains_every_field_of_every_public_record() -> None:
    unexplained = [
        f"{record.__qualname__}.{field.name}"
        for record in records()
        for field in dataclasses.fields(record)
        if field.name[0] != "_"
        and not re.search(
            rf"^ *(?:\w+, )*{field.name}\b[^\n]*\n +\S|^ *(?:\w+, )*{field.name}, ",
            "\n".join(each.__doc__ or "" for each in record.__mro__),  # what it inherits stands in its base
            re.MULTILINE,
        )
    ]
    assert unexplained == []
    assert len(records()) > 100
