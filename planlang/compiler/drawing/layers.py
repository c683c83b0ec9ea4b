"""Layered layout of an acyclic graph: ranks by longest path, order within a rank by barycentre.

After K. Sugiyama, S. Tagawa, M. Toda, "Methods for visual understanding of hierarchical system structures" (1981).
Boxes are rectangles of any size; all lengths are in pixels, x to the right, y down.
"""

from __future__ import annotations

from bisect import bisect_right, insort
from collections.abc import Sequence
from dataclasses import field
from graphlib import TopologicalSorter
from itertools import pairwise

from planlang.closure import grouped
from planlang.records import dataclass

SWEEPS = 12
"""Number of sweeps down and up; Sugiyama et al. find that further sweeps rarely improve a drawing."""

MOST_BENDS = 5000
"""Maximum number of bends of arrows that cross ranks; with more, long arrows are straight, because sweeps would take
seconds."""

GAP, RANK_GAP = 28, 34
"""Distances between boxes side by side, and between ranks."""

Point = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Layers:
    """A layout: the top left corner of each box, the points of each edge, and the size of the whole.

    An edge starts at the bottom of its first box and ends at the top of its second. Between its points 1 and 2, 3 and
    4, ... it changes ranks, and is best drawn as a curve; the other parts are vertical.
    """

    corners: tuple[Point, ...]
    routes: tuple[tuple[Point, ...], ...]
    width: float
    height: float


@dataclass(slots=True)
class _Item:
    """A box, or a bend of an edge that crosses a rank."""

    width: float
    height: float
    rank: int
    above: list[int] = field(default_factory=list)
    below: list[int] = field(default_factory=list)
    x: float = 0.0
    """The x coordinate of the centre."""


def layered(sizes: Sequence[tuple[float, float]], edges: Sequence[tuple[int, int]]) -> Layers:
    """Lay out boxes of the given sizes (width, height); edges are pairs of indices.

    Boxes without edges are put to the right, in columns. Raises graphlib.CycleError if the edges have a cycle.
    """
    linked = {index for edge in edges for index in edge}
    above: dict[int, list[int]] = {index: [] for index in range(len(sizes))}
    for before, after in edges:
        above[after].append(before)
    ranks: dict[int, int] = {}
    for index in TopologicalSorter(above).static_order():
        ranks[index] = max((ranks[before] + 1 for before in above[index]), default=0)
    items = [_Item(width, height, ranks[index]) for index, (width, height) in enumerate(sizes)]
    chains = _chains(items, edges)
    for chain in chains:
        for upper, lower in pairwise(chain):
            if items[lower].rank == items[upper].rank + 1:
                items[upper].below.append(lower)
                items[lower].above.append(upper)
    layers: list[list[int]] = [[] for _ in range(max((ranks[index] for index in linked), default=-1) + 1)]
    for index, item in enumerate(items):
        if index in linked or index >= len(sizes):
            layers[item.rank].append(index)
    layers = _ordered(items, layers)
    _place(items, layers)
    tops: list[float] = []
    bottoms: list[float] = []
    for layer in layers:
        tops.append(bottoms[-1] + RANK_GAP if bottoms else 0.0)
        bottoms.append(tops[-1] + max(items[index].height for index in layer))
    height = bottoms[-1] if bottoms else 0.0
    width = max((item.x + item.width / 2 for layer in layers for item in (items[i] for i in layer)), default=0.0)
    corners = {index: (items[index].x - items[index].width / 2, tops[ranks[index]]) for index in linked}
    isolated = [index for index in range(len(sizes)) if index not in linked]
    corners |= _columns(sizes, isolated, width + (2 * GAP if linked else 0.0), height)
    right = max((x + sizes[index][0] for index, (x, _) in corners.items()), default=0.0)
    low = max((y + sizes[index][1] for index, (_, y) in corners.items()), default=0.0)
    routes = _routes(items, chains, tops, bottoms)
    return Layers(tuple(corners[index] for index in range(len(sizes))), routes, max(width, right), max(height, low))


def _chains(items: list[_Item], edges: Sequence[tuple[int, int]]) -> list[list[int]]:
    """List for each edge the items on its way; bends are appended to ``items``."""
    has_bends = sum(items[after].rank - items[before].rank - 1 for before, after in edges) <= MOST_BENDS
    chains = []
    for before, after in edges:
        chain = [before]
        for rank in range(items[before].rank + 1, items[after].rank) if has_bends else ():
            chain.append(len(items))
            items.append(_Item(8.0, 0.0, rank))
        chains.append([*chain, after])
    return chains


def _ordered(items: list[_Item], layers: list[list[int]]) -> list[list[int]]:
    """Sort the layers by barycentres, alternating down and up, and keep the arrangement with the fewest crossings."""
    best, fewest = layers, _crossings(items, layers)
    current = layers
    for sweep in range(SWEEPS):
        if not fewest:
            break
        down = sweep % 2 == 0
        position = {index: place for layer in current for place, index in enumerate(layer)}
        new: list[list[int]] = []
        for layer in current if down else current[::-1]:
            keys = {}
            for index in layer:
                neighbours = items[index].above if down else items[index].below
                centre = sum(position[other] for other in neighbours) / len(neighbours) if neighbours else None
                keys[index] = position[index] if centre is None else centre
            layer = sorted(layer, key=keys.__getitem__)
            position.update((index, place) for place, index in enumerate(layer))
            new.append(layer)
        current = new if down else new[::-1]
        crossings = _crossings(items, current)
        if crossings < fewest:
            best, fewest = current, crossings
    return best


def _crossings(items: list[_Item], layers: list[list[int]]) -> int:
    """Count the crossing edges between neighbouring layers: inversions of the positions of their lower ends."""
    total = 0
    for upper, lower in pairwise(layers):
        position = {index: place for place, index in enumerate(lower)}
        seen: list[int] = []
        for index in upper:
            ends = sorted(position[other] for other in items[index].below)
            total += sum(len(seen) - bisect_right(seen, place) for place in ends)
            for place in ends:
                insort(seen, place)
    return total


def _place(items: list[_Item], layers: list[list[int]]) -> None:
    """Move each item towards its neighbours' centres, keeping the order of its layer; the left edge is x = 0."""
    for layer in layers:
        x = 0.0
        for index in layer:
            items[index].x = x + items[index].width / 2
            x += items[index].width + GAP
    for sweep in range(SWEEPS):
        down = sweep % 2 == 0
        for layer in layers if down else layers[::-1]:
            targets = []
            for index in layer:
                neighbours = items[index].above if down else items[index].below
                xs = [items[other].x for other in neighbours]
                targets.append(sum(xs) / len(xs) if xs else items[index].x)
            steps = [(items[a].width + items[b].width) / 2 + GAP for a, b in pairwise(layer)]
            for index, x in zip(layer, _separated(targets, steps), strict=True):
                items[index].x = x
    left = min((items[index].x - items[index].width / 2 for layer in layers for index in layer), default=0.0)
    for layer in layers:
        for index in layer:
            items[index].x -= left


def _separated(wanted: Sequence[float], steps: Sequence[float]) -> list[float]:
    """Find the positions nearest to the ``wanted`` ones (least squares), each at least a step after the previous one.

    After subtracting the steps this is isotonic regression, solved by pooling adjacent violators.
    """
    offsets = [0.0]
    for step in steps:
        offsets.append(offsets[-1] + step)
    pools: list[tuple[float, int]] = []
    for value, offset in zip(wanted, offsets, strict=False):
        mean, size = value - offset, 1
        while pools and pools[-1][0] > mean:
            other, number = pools.pop()
            mean, size = (mean * size + other * number) / (size + number), size + number
        pools.append((mean, size))
    flat = [mean for mean, size in pools for _ in range(size)]
    return [value + offset for value, offset in zip(flat, offsets, strict=False)]


def _columns(sizes: Sequence[tuple[float, float]], boxes: Sequence[int], x: float, height: float) -> dict[int, Point]:
    """Put isolated boxes in columns from ``x`` on, as high as the rest, or about as high as wide."""
    area = sum((sizes[index][0] + GAP) * (sizes[index][1] + GAP) for index in boxes)
    limit = max(height, area**0.5)
    corners: dict[int, Point] = {}
    y = column = 0.0
    for index in boxes:
        if y > 0 and y + sizes[index][1] > limit:
            x, y, column = x + column + GAP, 0.0, 0.0
        corners[index] = (x, y)
        y += sizes[index][1] + GAP
        column = max(column, sizes[index][0])
    return corners


def _routes(
    items: list[_Item], chains: list[list[int]], tops: list[float], bottoms: list[float]
) -> tuple[tuple[Point, ...], ...]:
    starts, ends = _ports(items, chains, 0, 1), _ports(items, chains, -1, -2)
    routes = []
    for number, chain in enumerate(chains):
        first, last = items[chain[0]], items[chain[-1]]
        points = [(starts[number], tops[first.rank] + first.height), (starts[number], bottoms[first.rank])]
        for index in chain[1:-1]:
            bend = items[index]
            points += [(bend.x, tops[bend.rank]), (bend.x, bottoms[bend.rank])]
        points.append((ends[number], tops[last.rank]))
        routes.append(tuple(points))
    return tuple(routes)


def _ports(items: list[_Item], chains: list[list[int]], here: int, beside: int) -> dict[int, float]:
    """Positions of the ends ``here`` (indices in their chains) of edges: side by side, sorted by what is ``beside``."""
    at = grouped((chain[here], number) for number, chain in enumerate(chains))
    ports: dict[int, float] = {}
    for index, numbers in at.items():
        numbers.sort(key=lambda number: items[chains[number][beside]].x)
        spacing = min(22.0, items[index].width * 0.7 / len(numbers))
        for position, number in enumerate(numbers):
            ports[number] = items[index].x + (position - (len(numbers) - 1) / 2) * spacing
    return ports
