import casadi as ca
import numpy as np
import pytest

from tendonff.models.errors import ParameterError
from tendonff.models.path import JointMotion, Section, TabulatedSection
from tendonff.models.path_table import PathTable

JOINTS = ("a", "b", "c")
NODES = (np.linspace(-0.4, 1.2, 9), np.linspace(0.0, 1.0, 7), np.linspace(-1.0, 0.5, 6))


def cubic(*q: np.ndarray) -> np.ndarray:
    """A product of cubics, which a spline with a continuous third derivative next to its ends repeats."""
    found = 1.0
    for k, each in enumerate(q):
        found = found * (0.3 + each - 0.5 * each**2 + (0.2 + k) * each**3)
    return np.asarray(found)


def table(axes: int) -> PathTable:
    grids = NODES[:axes]
    return PathTable.through(JOINTS[:axes], grids, cubic(*np.meshgrid(*grids, indexing="ij")))


def inside(axes: int, rows: int = 40) -> np.ndarray:
    low, high = ([grid[end] for grid in NODES[:axes]] for end in (0, -1))
    return np.random.default_rng(0).uniform(low, high, (rows, axes))


@pytest.mark.parametrize("axes", [1, 2, 3])
def test_a_table_of_cubics_is_exact_between_its_nodes(axes: int) -> None:
    q = inside(axes)
    assert table(axes).at(dict(zip(JOINTS, q.T, strict=False))) == pytest.approx(cubic(*q.T), abs=1e-12)


@pytest.mark.parametrize("axes", [1, 2, 3])
def test_numpy_and_casadi_agree_in_value_and_slope_inside_and_beyond(axes: int) -> None:
    q = inside(axes) + np.random.default_rng(1).normal(0.0, 0.5, (40, axes))
    known, symbols = table(axes), ca.SX.sym("q", axes)
    value = known.symbolic(dict(zip(JOINTS, ca.vertsplit(symbols), strict=False)))
    function = ca.Function("f", [symbols], [value, ca.jacobian(value, symbols)])
    slopes = known.slopes_at(dict(zip(JOINTS, q.T, strict=False)))
    within = ((q >= known.low_rad) & (q <= known.high_rad)).all(axis=1)
    for row, (angle, mine) in enumerate(zip(q, known.at(dict(zip(JOINTS, q.T, strict=False))), strict=True)):
        found, slope = (np.array(each).ravel() for each in function(angle))
        assert found == pytest.approx([mine], abs=1e-12)
        if within[row]:
            assert slope == pytest.approx([each[row] for each in slopes.values()], abs=1e-11)


def test_a_table_goes_on_straight_beyond_its_range_and_says_by_how_much() -> None:
    known = table(1)
    end, slope = float(known.at({"a": 1.2})), float(known.slopes_at({"a": 1.2})["a"])
    assert float(known.at({"a": 1.5})) == pytest.approx(end + 0.3 * slope)
    assert known.beyond({"a": np.array([0.0, 1.5])}) == {"a": pytest.approx(0.3)}
    assert known.beyond({"a": np.array([0.0, 1.2])}) == {}


def test_nodes_at_unequal_steps_are_refused_by_the_name_of_their_joint() -> None:
    with pytest.raises(ParameterError, match='nodes of "mcp" that increase by equal steps'):
        PathTable.through(("mcp",), [[0.0, 0.1, 0.2, 0.35, 0.4]], np.zeros(5))


def test_a_section_with_tables_bends_and_gains_as_they_say() -> None:
    known = table(2)
    section = TabulatedSection.tabulated(Section(name="wrap", angle_rad=0.0), known, known.shifted(2.0))
    q = {"a": np.array([0.3, -0.2]), "b": np.array([0.1, 0.8])}
    assert section.joints == ("a", "b")
    assert section.angle_at(q) == pytest.approx(np.maximum(known.at(q), 0.0))
    assert section.gained_at(q) + (section.length_m or 0.0) == pytest.approx(known.at(q) + 2.0)
    motion = JointMotion(names=("a", "b"), time_s=np.zeros(1), angle_rad=np.array([[0.3, 0.1]]))
    assert section.largest_angle_rad(motion) == pytest.approx(float(known.at({"a": 0.3, "b": 0.1})))
