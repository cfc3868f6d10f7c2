"""What the C of a table looks up instead of searching."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tendonff.compensator.compensators.lookup_table import halves
from tendonff.compensator.export.golden import to_and_fro
from tendonff.compensator.export.text.table_index import rounded, share_index
from tendonff.ocp.codegen.precision import Precision

gaps = st.lists(st.floats(1e-4, 1.0), min_size=1, max_size=60)


def real(precision):
    return np.float32 if precision is Precision.FLOAT else np.float64


@given(gaps=gaps, places=st.lists(st.floats(0, 1), max_size=20), precision=st.sampled_from(Precision))
def test_the_index_leads_to_the_cell_of_any_share_in_the_rounds_it_states(gaps, places, precision):
    """At nodes, beside them and between them, in the controller's own arithmetic."""
    nodes = rounded(np.concatenate([[0.0], np.cumsum(gaps)]), precision)
    index, kind = share_index(nodes, precision), real(precision)
    inner = [np.nextafter(kind(node), kind(side)) for node in nodes[1:] for side in (0, 9e9)]
    shares = [*inner, *(kind(nodes[-1] * place) for place in places), *map(kind, nodes)]
    for share in np.minimum(np.array(shares, dtype=kind), kind(nodes[-1])):
        cell = index.cell[int(share * kind(index.bins_per_share))]
        for _ in range(index.rounds):
            if share < nodes[cell]:
                cell -= 1
        assert cell == min(int(np.searchsorted(nodes, share, side="right")) - 1, nodes.size - 2)


def test_nodes_that_halve_their_distance_need_one_round_and_a_cluster_more():
    halving = np.concatenate([[0.0], 2.0 ** np.arange(-7, 1)])
    assert share_index(halving, Precision.DOUBLE).rounds == 1
    cluster = np.array([0.0, 1e-4, 2e-4, 3e-4, 1.0])
    assert share_index(cluster, Precision.DOUBLE).rounds == 3


@pytest.mark.parametrize("nodes", [2, 3, 4, 20, 33, 34, 69])
def test_the_written_out_bisection_finds_every_cell_and_leaves_none(nodes):
    for wanted in range(nodes - 1):
        low = 0
        for half in halves(nodes):
            assert low + half <= nodes - 2
            if wanted >= low + half:
                low += half
        assert low == wanted
    assert len(halves(nodes)) == int(np.ceil(np.log2(nodes - 1)))


def test_the_golden_course_turns_round_at_many_depths_within_its_range():
    course = 30 + 10 * np.sin(np.linspace(0, 5, 400))
    way = to_and_fro(course)
    steps = np.diff(np.concatenate([course[-1:], way]))
    turns = np.flatnonzero(np.diff(np.sign(steps)))
    legs = np.abs(np.diff(way[turns]))
    assert course.min() <= way.min() <= way.max() <= course.max()
    assert len(turns) >= 10
    assert legs.max() > 10 * legs.min()
    assert to_and_fro(np.full(5, 30.0)).size == 0
