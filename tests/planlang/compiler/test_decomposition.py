"""Series-parallel decomposition: what it says is the order, and series-parallel orders are recognised."""

import random

import networkx as nx
import pytest
from hypothesis import given
from hypothesis import strategies as st

from planlang.compiler.structure import ParallelPart, Part, PrimePart, SerialPart, decomposed
from planlang.recipe.order import Precedence, order_graph

Order = tuple[list[int], set[tuple[int, int]]]


def ordered(graph: nx.DiGraph) -> Precedence[int]:
    return Precedence(graph.nodes, graph.edges)


def order_of(part: Part) -> Order:
    """Leaves and all pairs of them that a part puts in order."""
    if isinstance(part, int):
        return [part], set()
    found = [order_of(inner) for inner in part.parts]
    numbers = range(len(found))
    if isinstance(part, SerialPart):
        between = [(a, b) for a in numbers for b in numbers if a < b]
    elif isinstance(part, PrimePart):
        between = list(nx.transitive_closure_dag(order_graph(numbers, part.orderings)).edges)
    else:
        between = []
    pairs = {pair for _, inside in found for pair in inside}
    pairs |= {(x, y) for a, b in between for x in found[a][0] for y in found[b][0]}
    return [leaf for leaves, _ in found for leaf in leaves], pairs


def has_prime(part: Part) -> bool:
    return not isinstance(part, int) and (isinstance(part, PrimePart) or any(map(has_prime, part.parts)))


def series_parallel(rng: random.Random, leaves: list[int]) -> Order:
    """A random series-parallel order."""
    if len(leaves) == 1:
        return leaves, set()
    cut = rng.randint(1, len(leaves) - 1)
    (first, one), (second, other) = series_parallel(rng, leaves[:cut]), series_parallel(rng, leaves[cut:])
    across = {(a, b) for a in first for b in second} if rng.random() < 0.5 else set()
    return leaves, one | other | across


@st.composite
def any_orders(draw: st.DrawFn) -> nx.DiGraph:
    size = draw(st.integers(1, 12))
    hidden = draw(st.permutations(range(size)))
    pairs = [(a, b) for index, a in enumerate(hidden) for b in hidden[index + 1 :]]
    return order_graph(range(size), draw(st.lists(st.sampled_from(pairs), unique=True)) if pairs else [])


@given(any_orders())
def test_decomposition_says_exactly_the_order(graph: nx.DiGraph) -> None:
    part = decomposed(ordered(graph), 20)
    assert part is not None
    leaves, pairs = order_of(part)
    assert sorted(leaves) == list(graph.nodes)
    assert pairs == set(nx.transitive_closure_dag(graph).edges)


@given(st.integers(0, 2**32), st.integers(1, 40))
def test_series_parallel_orders_have_no_prime_part(seed: int, size: int) -> None:
    rng = random.Random(seed)
    leaves = list(range(size))
    rng.shuffle(leaves)
    _, pairs = series_parallel(rng, leaves)
    part = decomposed(Precedence(range(size), pairs), 40)
    assert part is not None
    assert not has_prime(part)
    assert order_of(part)[1] == pairs


def test_an_n_is_prime() -> None:
    part = decomposed(Precedence(range(4), [(0, 2), (1, 2), (1, 3)]))
    assert part == PrimePart((0, 1, 2, 3), ((0, 2), (1, 2), (1, 3)))


def test_a_prime_part_stands_inside_of_series_and_parallel() -> None:
    n = [(1, 3), (2, 3), (2, 4)]
    graph = order_graph(range(7), [*n, (3, 5), (4, 5), (0, 1), (0, 2)])
    part = decomposed(ordered(graph), 20)
    assert part == ParallelPart((SerialPart((0, PrimePart((1, 2, 3, 4), ((0, 2), (1, 2), (1, 3))), 5)), 6))


@pytest.mark.parametrize("size", [1, 2, 3000])
def test_chains_and_antichains_are_one_part(size: int) -> None:
    chain = decomposed(Precedence(range(size), [(node, node + 1) for node in range(size - 1)]))
    free = decomposed(Precedence(range(size), []))
    assert chain == (0 if size == 1 else SerialPart(tuple(range(size))))
    assert free == (0 if size == 1 else ParallelPart(tuple(range(size))))


def test_nothing_has_no_decomposition() -> None:
    assert decomposed(Precedence((), ())) is None


@given(any_orders(), st.integers(0, 3))
def test_splitting_no_deeper_says_the_same_order(graph: nx.DiGraph, deepest: int) -> None:
    part = decomposed(ordered(graph), deepest)
    assert part is not None
    leaves, pairs = order_of(part)
    assert sorted(leaves) == list(graph.nodes)
    assert pairs == set(nx.transitive_closure_dag(graph).edges)
