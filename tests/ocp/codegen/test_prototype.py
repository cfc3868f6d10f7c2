"""Calls of generated C: every argument by the name and type of its prototype."""

import ctypes

import numpy as np
import pytest

from tendonff.ocp.codegen.compiler import load_library
from tendonff.ocp.codegen.prototype import CFunction
from tendonff.ocp.errors import CodeError

pytestmark = pytest.mark.compiler

SOURCE = """
typedef struct { double gain; } tff_scale;
static double twice(double x) { return 2.0 * x; }
double tff_scaled(const tff_scale *scale, const double *from,
    double *to, int rows, long skip, double offset)
{
    int k;
    for (k = (int)skip; k < rows; k++) {
        to[k] = twice(from[k]) * scale->gain + offset;
    }
    return offset;
}
int tff_none(void) { return 7; }
"""


class Scale(ctypes.Structure):
    _fields_ = (("gain", ctypes.c_double),)


@pytest.fixture(scope="module")
def scaled():
    return CFunction(load_library(SOURCE), SOURCE, "tff_scaled")


@pytest.fixture
def given():
    return {
        "scale": ctypes.byref(Scale(3.0)),
        "from": np.arange(3.0),
        "to": np.zeros(3),
        "rows": 3,
        "skip": 1,
        "offset": 0.5,
    }


def test_arguments_are_called_by_their_names_whatever_the_order(scaled, given):
    assert scaled.arguments == ("scale", "from", "to", "rows", "skip", "offset")
    assert scaled(**dict(reversed(given.items()))) == 0.5
    assert given["to"].tolist() == [0.0, 6.5, 12.5]
    assert CFunction(load_library(SOURCE), SOURCE, "tff_none")() == 7


@pytest.mark.parametrize(
    ("name", "wrong"),
    [
        ("from", np.arange(3)),  # whole numbers read as reals
        ("to", np.zeros((3, 2))[:, 0]),  # a column, not contiguous
        ("rows", 3.0),
        ("offset", np.zeros(1)),
        ("from", None),
    ],
)
def test_what_c_would_misread_is_refused(scaled, given, name, wrong):
    with pytest.raises(ctypes.ArgumentError):
        scaled(**{**given, name: wrong})


def test_arguments_that_are_missing_or_unknown_are_named(scaled, given):
    del given["skip"]
    with pytest.raises(TypeError, match=r"tff_scaled takes scale, from.*missing or unknown: gain, skip"):
        scaled(**given, gain=1.0)


def test_a_function_that_is_not_there_is_refused_by_name():
    with pytest.raises(CodeError, match="generated C has no function tff_absent"):
        CFunction(load_library(SOURCE), SOURCE, "tff_absent")
