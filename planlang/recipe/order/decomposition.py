"""Series-parallel decomposition of an order: what is one after another, what side by side, and what is neither.

Works on the transitive reduction. Two nodes are one after another when the first has no other successor and the second
no other predecessor; they are side by side when both have the same predecessors and the same successors. Either two
stand in the same relation to everything else, so that they can be made one node. Of a series-parallel order one node
is left in the end, after a number of operations linear in nodes and edges (compare J. Valdes, R. E. Tarjan,
E. L. Lawler, "The recognition of series parallel digraphs", 1982). What is left of any other order is split by
connected components and by series cuts into parts; those that are neither are prime.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import networkx as nx


@dataclass(frozen=True, slots=True)
class Serial:
    """Parts one after another: all of one come before all of the next."""

    parts: tuple[Part, ...]


@dataclass(frozen=True, slots=True)
class Parallel:
    """Parts side by side, by their first leaves: nothing orders one with another."""

    parts: tuple[Part, ...]


@dataclass(frozen=True, slots=True)
class Prime:
    """Parts, by their first leaves, whose order has neither form; ``orderings`` are pairs of their numbers."""

    parts: tuple[Part, ...]
    orderings: tuple[tuple[int, int], ...]


Part = Serial | Parallel | Prime | int
"""A leaf is a node, told by its number in the order of the graph's nodes."""


def decomposed(small: nx.DiGraph, deepest: int | None = None) -> Part | None:
    """Return the decomposition of a transitively reduced graph; None if it has no nodes.

    A part of a Serial is never a Serial, one of a Parallel never a Parallel. Orders that are not series-parallel are
    split in ``deepest`` levels at most, each in linear time; what is below counts as prime.
    """
    if not small:
        return None
    work = _Contraction(small)
    work.contract()
    return work.part(work.split(deepest))


_SERIES, _PARALLEL, _PRIME, _LEAF = range(4)
_MASK = (1 << 64) - 1


def _key(number: int) -> int:
    """64 bits that stand for a number in signatures of sets (the mixer of splitmix64)."""
    z = (number + 1) * 0x9E3779B97F4A7C15 & _MASK
    z = (z ^ z >> 30) * 0xBF58476D1CE4E5B9 & _MASK
    z = (z ^ z >> 27) * 0x94D049BB133111EB & _MASK
    return z ^ z >> 31


class _Contraction:
    """The graph while nodes of it are made one. Nodes are numbers; ``tree`` says what each has been made of.

    ``sign`` of a node is the exclusive or of the keys of its predecessors, and of its successors: nodes of equal signs
    are compared, so that finding two with the same neighbours does not take a search.
    """

    def __init__(self, small: nx.DiGraph) -> None:
        number = {node: index for index, node in enumerate(small.nodes)}
        self.after: dict[int, dict[int, None]] = {
            index: {number[other]: None for other in small.successors(node)} for node, index in number.items()
        }
        self.before: dict[int, dict[int, None]] = {
            index: {number[other]: None for other in small.predecessors(node)} for node, index in number.items()
        }
        self._kinds: list[int] = [_LEAF] * len(number)
        self._children: list[tuple[int, ...]] = [()] * len(number)
        self._edges: dict[int, tuple[tuple[int, int], ...]] = {}
        self._trees = list(range(len(number)))

    def contract(self) -> None:
        """Make one of what is one after another or side by side until no two nodes are."""
        size = len(self._trees)
        keys = [_key(index) for index in range(size)]
        into, out = [0] * size, [0] * size
        for index in range(size):
            for other in self.after[index]:
                out[index] ^= keys[other]
                into[other] ^= keys[index]
        seen: dict[tuple[int, int], int] = {}
        waiting = list(range(size - 1, -1, -1))

        def rename(old: int, new: int) -> None:
            """Neighbours of ``old`` become neighbours of ``new``, on the one side on which new has none."""
            change = keys[old] ^ keys[new]
            for links, turned, signs in ((self.after, self.before, into), (self.before, self.after, out)):
                for other in links[old]:
                    if other != new:
                        del turned[other][old]
                        turned[other][new] = None
                        links[new][other] = None
                        signs[other] ^= change
                        waiting.append(other)

        def chain(first: int, second: int) -> None:
            del self.after[first][second], self.before[second][first]
            keep, drop = (second, first) if len(self.before[first]) <= len(self.after[second]) else (first, second)
            rename(drop, keep)
            self._trees[keep] = self._grow(_SERIES, (self._trees[first], self._trees[second]))
            into[keep], out[keep] = into[first], out[second]
            self._drop(drop)
            waiting.append(keep)

        def join(first: int, second: int) -> None:
            for links, turned, signs in ((self.after, self.before, into), (self.before, self.after, out)):
                for other in links[second]:
                    del turned[other][second]
                    signs[other] ^= keys[second]
                    waiting.append(other)
            self._trees[first] = self._grow(_PARALLEL, (self._trees[first], self._trees[second]))
            self._drop(second)
            waiting.append(first)

        while waiting:
            node = waiting.pop()
            if node not in self.after:
                continue
            if len(self.after[node]) == 1 and len(self.before[later := next(iter(self.after[node]))]) == 1:
                chain(node, later)
            elif len(self.before[node]) == 1 and len(self.after[earlier := next(iter(self.before[node]))]) == 1:
                chain(earlier, node)
            else:
                sign = into[node], out[node]
                twin = seen.get(sign, node)
                if twin != node and twin in self.after and self._are_alike(node, twin):
                    join(twin, node)
                else:
                    seen[sign] = node

    def split(self, deepest: int | None) -> int:
        """Return the tree of all nodes that are left."""
        root = self._grow(_PRIME, ())
        waiting: list[tuple[int, list[int], int]] = [(root, list(self.after), 0)]
        while waiting:
            tree, nodes, depth = waiting.pop()
            if len(nodes) == 1:
                old = self._trees[nodes[0]]
                self._kinds[tree], self._children[tree] = self._kinds[old], self._children[old]
                if self._kinds[old] == _LEAF:
                    self._children[tree] = (old,)
                continue
            is_split = deepest is None or depth < deepest
            kind, groups = _PARALLEL, self._components(nodes) if is_split else [nodes]
            if len(groups) == 1 and is_split:
                kind, groups = _SERIES, self._series(nodes)
            if len(groups) == 1:
                kind, groups = _PRIME, [[node] for node in nodes]
                place = {node: index for index, node in enumerate(nodes)}
                self._edges[tree] = tuple((place[a], place[b]) for a in nodes for b in self.after[a] if b in place)
            children = [self._grow(_PRIME, ()) for _ in groups]
            self._kinds[tree], self._children[tree] = kind, tuple(children)
            waiting += [(child, group, depth + 1) for child, group in zip(children, groups, strict=True)]
        return root

    def part(self, root: int) -> Part:
        """Return a tree of numbers as parts, without series in series and parallels in parallels."""
        made: dict[int, tuple[int, Part]] = {}
        """The number of a tree's first leaf, and its part, by tree."""
        waiting = [root]
        while waiting:
            tree = waiting[-1]
            kind = self._kinds[tree]
            if kind == _LEAF:
                leaf = self._children[tree][0] if self._children[tree] else tree
                made[tree] = (leaf, leaf)
                waiting.pop()
                continue
            children = self._flat(tree)
            missing = [child for child in children if child not in made]
            if missing:
                waiting += missing
                continue
            waiting.pop()
            made[tree] = self._made(tree, kind, [made[child] for child in children])
        return made[root][1]

    def _made(self, tree: int, kind: int, found: list[tuple[int, Part]]) -> tuple[int, Part]:
        first = min(number for number, _ in found)
        if kind == _SERIES:
            return first, Serial(tuple(part for _, part in found))
        by_leaf = sorted(range(len(found)), key=lambda index: found[index][0])
        parts = tuple(found[index][1] for index in by_leaf)
        if kind == _PARALLEL:
            return first, Parallel(parts)
        place = {index: number for number, index in enumerate(by_leaf)}
        return first, Prime(parts, tuple(sorted((place[a], place[b]) for a, b in self._edges[tree])))

    def _flat(self, tree: int) -> list[int]:
        """Return the children of a tree; those of its own kind, series or parallel, replaced by their children."""
        kind = self._kinds[tree]
        found: list[int] = []
        waiting = list(reversed(self._children[tree]))
        while waiting:
            child = waiting.pop()
            if kind != _PRIME and self._kinds[child] == kind:
                waiting += reversed(self._children[child])
            else:
                found.append(child)
        return found

    def _grow(self, kind: int, children: tuple[int, ...]) -> int:
        self._kinds.append(kind)
        self._children.append(children)
        return len(self._kinds) - 1

    def _drop(self, node: int) -> None:
        del self.after[node], self.before[node]

    def _are_alike(self, one: int, other: int) -> bool:
        return (
            self.before[one].keys() == self.before[other].keys() and self.after[one].keys() == self.after[other].keys()
        )

    def _components(self, nodes: Sequence[int]) -> list[list[int]]:
        """Return the connected components, by their first nodes."""
        left = dict.fromkeys(nodes)
        groups = []
        for start in nodes:
            if start not in left:
                continue
            del left[start]
            group = [start]
            for node in group:
                for other in (*self.after[node], *self.before[node]):
                    if other in left:
                        del left[other]
                        group.append(other)
            groups.append(sorted(group))
        return groups

    def _series(self, nodes: Iterable[int]) -> list[list[int]]:
        """Return the longest series of groups such that all of one come before all of the next.

        Everything up to a place in a linear extension comes before everything after it when the edges that cross the
        place lead from each last node before it to each first node after it, and from and to no others.
        """
        inside = dict.fromkeys(nodes)
        after = {node: [other for other in self.after[node] if other in inside] for node in inside}
        missing = dict.fromkeys(inside, 0)
        for others in after.values():
            for other in others:
                missing[other] += 1
        indegree = dict(missing)
        order = [node for node in inside if not missing[node]]
        crossing = from_last = to_first = last = 0
        first = len(order)
        is_last: set[int] = set()
        groups: list[list[int]] = [[]]
        for node in order:
            groups[-1].append(node)
            first -= 1
            to_first -= indegree[node]
            crossing += len(after[node]) - indegree[node]
            for earlier in self.before[node]:
                if earlier in is_last:
                    is_last.remove(earlier)
                    last -= 1
                    from_last -= len(after[earlier])
            is_last.add(node)
            last += 1
            from_last += len(after[node])
            for other in after[node]:
                missing[other] -= 1
                if not missing[other]:
                    order.append(other)
                    first += 1
                    to_first += indegree[other]
            if crossing and crossing == from_last == to_first == last * first:
                groups.append([])
        return [sorted(group) for group in groups]
