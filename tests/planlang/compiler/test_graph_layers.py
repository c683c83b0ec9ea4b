"""The layered layout: every arrow leads down, nothing overlaps, few lines cross."""

from __future__ import annotations

from itertools import combinations

import networkx as nx
import pytest
from hypothesis import given
from hypothesis import strategies as st

from planlang.compiler.drawing.layers import layered

SIZE = (60.0, 20.0)

graphs = st.integers(1, 12).flatmap(
    lambda number: st.tuples(
        st.lists(st.tuples(st.floats(5, 200), st.floats(5, 90)), min_size=number, max_size=number),
        st.lists(
            st.tuples(st.integers(0, number - 1), st.integers(0, number - 1)).filter(lambda edge: edge[0] < edge[1]),
            unique=True,
        ),
    )
)


@given(graphs)
def test_no_box_overlaps_another_and_all_are_inside(
    drawn: tuple[list[tuple[float, float]], list[tuple[int, int]]],
) -> None:
    sizes, edges = drawn
    found = layered(sizes, edges)
    boxes = [(x, y, x + w, y + h) for (x, y), (w, h) in zip(found.corners, sizes, strict=True)]
    for a, b in combinations(boxes, 2):
        assert a[2] < b[0] or b[2] < a[0] or a[3] < b[1] or b[3] < a[1], "two boxes overlap"
    slack = 1e-6
    assert all(a[0] >= -slack and a[1] >= -slack for a in boxes)
    assert all(a[2] <= found.width + slack and a[3] <= found.height + slack for a in boxes)


@given(graphs)
def test_arrows_lead_down_from_box_to_box(drawn: tuple[list[tuple[float, float]], list[tuple[int, int]]]) -> None:
    sizes, edges = drawn
    found = layered(sizes, edges)
    for (before, after), points in zip(edges, found.routes, strict=True):
        assert [y for _, y in points] == sorted(y for _, y in points)
        (x, y), (w, h) = found.corners[before], sizes[before]
        assert x <= points[0][0] <= x + w
        assert points[0][1] == pytest.approx(y + h)
        (x, y), (w, _) = found.corners[after], sizes[after]
        assert x <= points[-1][0] <= x + w
        assert points[-1][1] == pytest.approx(y)


def test_a_rank_is_the_longest_path_to_it() -> None:
    corners = layered([SIZE] * 4, [(0, 1), (1, 2), (0, 2), (3, 2)]).corners
    assert corners[0][1] == corners[3][1] < corners[1][1] < corners[2][1]


def test_a_chain_is_one_column() -> None:
    corners = layered([SIZE] * 4, [(0, 1), (1, 2), (2, 3)]).corners
    assert len({x for x, _ in corners}) == 1


def test_barycentres_untangle_two_pairs() -> None:
    corners = layered([SIZE] * 4, [(0, 3), (1, 2)]).corners
    assert (corners[0][0] < corners[1][0]) == (corners[3][0] < corners[2][0])


def test_what_nothing_orders_stands_beside_the_rest() -> None:
    corners = layered([SIZE] * 3, [(0, 1)]).corners
    assert corners[2][0] > corners[1][0] + SIZE[0]
    assert corners[2][1] == corners[0][1]


def test_a_cycle_has_no_layers() -> None:
    with pytest.raises(nx.NetworkXUnfeasible, match="cycle"):
        layered([SIZE] * 2, [(0, 1), (1, 0)])
