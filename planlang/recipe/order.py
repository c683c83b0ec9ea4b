"""The order of a recipe's steps: its partial order or its shortest cycle, and the orders that overlaps imply.

Overlaps are decided on the beginnings and ends of steps. Each step is two points, its beginning before its end. Every
relation is a set of ``<`` and ``=`` between points (:meth:`planlang.recipe.model.Overlap.endpoints`), an order is
"end < beginning", and no step begins before the recipe or ends after it. The statements are consistent exactly if no
cycle of this graph contains a ``<`` (P. van Beek, 1992, for relations without "or").

Location scopes add orders. A step belongs to the last base motion before it. If it is unordered with the next one, it
is put before that one if it has a location or an object, and stays outside otherwise. A scope is one unit: steps
outside come before or after all of it, which may add orders; they are returned, so that a note can report them.
"""

from __future__ import annotations

import heapq
from bisect import bisect_left
from collections.abc import Hashable, Iterable, Iterator, Sequence
from functools import cached_property
from itertools import pairwise
from typing import Any, Generic, TypeVar

from planlang.closure import grouped, leads_to, reached
from planlang.kept import kept
from planlang.recipe import graphs as nx
from planlang.recipe.actions import Actions, Movers
from planlang.recipe.model import Ordering, Overlap, Place, Point, Recipe, RecipeSet, Thing
from planlang.records import dataclass

Node = TypeVar("Node", bound=Hashable)


class Precedence(Generic[Node]):
    """A strict partial order of nodes, in which the first of each pair comes before the second.

    Pairs with other nodes are ignored. Raises ValueError if the pairs have a cycle.

    The successors of each node are one set of bits: bit i stands for the i-th node of a fixed linear extension. The
    sets are filled from the last node to the first. An edge belongs to the reduction exactly if the edges kept so far,
    to nodes that come earlier in that extension, do not lead to its end: n + m unions and tests of n bits
    (A. Goralčíková, V. Koubek, "A reduct-and-closure algorithm for graphs", 1979). 10,000 nodes take 13 MB, while an
    explicit closure may have 50 million edges.
    """

    def __init__(self, nodes: Iterable[Node], pairs: Iterable[tuple[Node, Node]]) -> None:
        self.nodes: tuple[Node, ...] = tuple(nodes)
        """The nodes in the order of the graph."""
        number = {node: index for index, node in enumerate(self.nodes)}
        following: list[dict[int, None]] = [{} for _ in self.nodes]
        for first, second in pairs:
            before, after = number.get(first), number.get(second)
            if before is not None and after is not None:
                following[before][after] = None
        self.number_of_edges = sum(map(len, following))
        """Number of distinct pairs that the order was built from."""
        successors = [list(after) for after in following]
        extension = _linear_extension(successors)
        if len(extension) != len(self.nodes):
            raise ValueError("the pairs have a cycle, so they are not an order")
        self.extension: tuple[Node, ...] = tuple(self.nodes[index] for index in extension)
        """The linear extension that is closest to the given order of the nodes."""
        self._position = {node: position for position, node in enumerate(self.extension)}
        position_of = [0] * len(extension)
        for position, index in enumerate(extension):
            position_of[index] = position
        self._later = [0] * len(extension)
        self._covers: list[list[int]] = [[] for _ in extension]
        # Why one test of a bit decides about an edge u -> w: the edges of u are taken by the positions of their ends.
        #
        #     u ---> v ---> ... ---> w        an edge u -> w that others imply has such a path beside it,
        #      \_____________________^        and every linear extension puts v before w
        #
        # So u -> v was taken before, and what comes after v, w among it, is in ``descendants``. The other way round,
        # what is in there was reached by edges that are kept: then u -> w says nothing new. Nodes are taken from the
        # last one on, so that ``_later`` of v is complete when u asks for it.
        for position in range(len(extension) - 1, -1, -1):
            descendants = 0
            for after in sorted([position_of[other] for other in successors[extension[position]]]):
                if not descendants >> after & 1:
                    self._covers[position].append(after)
                    descendants |= self._later[after] | 1 << after
            self._later[position] = descendants

    def extended(self, pairs: Iterable[tuple[Node, Node]], weak: Iterable[tuple[Node, Node]] = ()) -> Precedence[Node]:
        """Copy of this order with further pairs; ``weak`` ones are left out if they contradict those before them."""
        pairs_so_far = [*self.reduction(), *pairs]
        follows = grouped(pairs_so_far)
        for before, after in weak:
            if not leads_to(follows, after, before):
                pairs_so_far.append((before, after))
                follows.setdefault(before, []).append(after)
        return Precedence(self.nodes, pairs_so_far)

    def before(self, first: Node, second: Node) -> bool:
        """True if the first node comes before the second in every linear extension."""
        return bool(self._later[self._position[first]] >> self._position[second] & 1)

    def ordered(self, first: Node, second: Node) -> bool:
        """True if one of two nodes comes before the other."""
        return self.before(first, second) or self.before(second, first)

    def later(self, node: Node) -> int:
        """Bits of all nodes that come after a node."""
        return self._later[self._position[node]]

    def earlier(self, node: Node) -> int:
        """Bits of all nodes that come before a node."""
        return self._earlier[self._position[node]]

    def bit(self, node: Node) -> int:
        """Bit of a node."""
        return 1 << self._position[node]

    def members(self, bits: int) -> Iterator[Node]:
        """Yield the nodes whose bits are set, in the order of the linear extension."""
        while bits:
            lowest = bits & -bits
            yield self.extension[lowest.bit_length() - 1]
            bits ^= lowest

    def number_of_pairs(self) -> int:
        """Number of pairs (before, after): the edges of the transitive closure."""
        return sum(bits.bit_count() for bits in self._later)

    def size_of_reduction(self) -> int:
        """Number of edges of the transitive reduction."""
        return sum(map(len, self._covers))

    def covers(self, node: Node) -> Iterator[Node]:
        """Yield the nodes that come directly after a node, in the order of the linear extension."""
        return (self.extension[position] for position in self._covers[self._position[node]])

    def reduction(self) -> Iterator[tuple[Node, Node]]:
        """Yield the pairs of the transitive reduction, in the given order of the nodes."""
        rank = {node: index for index, node in enumerate(self.nodes)}
        for node in self.nodes:
            yield from ((node, other) for other in sorted(self.covers(node), key=rank.__getitem__))

    @cached_property
    def _earlier(self) -> list[int]:
        before: list[list[int]] = [[] for _ in self.extension]
        for position, after in enumerate(self._covers):
            for other in after:
                before[other].append(position)
        earlier = [0] * len(before)
        for position, covered in enumerate(before):
            for other in covered:
                earlier[position] |= earlier[other] | 1 << other
        return earlier


def _linear_extension(successors: list[list[int]]) -> list[int]:
    """Compute a linear extension, the lowest available number first; incomplete if there is a cycle."""
    unplaced_before = [0] * len(successors)
    for after in successors:
        for other in after:
            unplaced_before[other] += 1
    # A heap, not a queue: among the nodes that may come next the one that the file states first does, whatever order
    # the pairs come in, so that equal recipes give equal plans (A. B. Kahn, 1962, with the lowest number first).
    ready = [number for number, count in enumerate(unplaced_before) if not count]
    order: list[int] = []
    while ready:
        number = heapq.heappop(ready)
        order.append(number)
        for other in successors[number]:
            unplaced_before[other] -= 1
            if not unplaced_before[other]:
                heapq.heappush(ready, other)
    return order


def order_graph(nodes: Iterable[Node], orderings: Iterable[tuple[Node, Node]]) -> nx.DiGraph:
    """Build a graph of the nodes in the given order, with an edge before -> after for each ordering among them."""
    graph = nx.DiGraph()
    graph.add_nodes_from(nodes)
    graph.add_edges_from((before, after) for before, after in orderings if before in graph and after in graph)
    return graph


@kept
def recipe_order(recipe: Recipe) -> Precedence[str]:
    """Partial order of a recipe, computed once. Raises ValueError if it has a cycle."""
    pairs = ((ordering.before, ordering.after) for ordering in recipe.orderings)
    return Precedence((step.iri for step in recipe.steps), pairs)


@kept
def recipe_cycle(recipe: Recipe) -> tuple[str, ...] | None:
    """A shortest cycle among the orderings of a recipe, computed once; None if there is none."""
    try:
        recipe_order(recipe)
    except ValueError:
        pairs = ((ordering.before, ordering.after) for ordering in recipe.orderings)
        return shortest_cycle(order_graph((step.iri for step in recipe.steps), pairs))
    return None


def shortest_cycle(graph: nx.DiGraph) -> tuple[Node, ...] | None:
    """Find a shortest cycle, without repeating its first node; among equals the one through the earliest node.

    Breadth-first search from each node on a cycle, limited to the length of the best cycle so far. A searched node is
    removed, and so are the nodes that are then on no cycle. O(n * m) at worst, O(m) for one long cycle.
    """
    for node in graph.nodes:
        if graph.has_edge(node, node):
            return (node,)
    on_cycles = {node for part in nx.strongly_connected_components(graph) if len(part) > 1 for node in part}
    after = {node: {other: None for other in graph.successors(node) if other in on_cycles} for node in on_cycles}
    before = {node: {other: None for other in graph.predecessors(node) if other in on_cycles} for node in on_cycles}
    best: tuple[Node, ...] | None = None
    for node in graph.nodes:
        if node in after:
            cycle = _cycle_through(node, after, len(best) - 1 if best else len(after))
            best = cycle or best
            _take_out(node, after, before)
    return best


Links = dict[Node, dict[Node, None]]


def _cycle_through(start: Node, after: Links[Node], longest: int) -> tuple[Node, ...] | None:
    """Shortest path of at most ``longest`` nodes from a node back to itself."""
    came_from: dict[Node, Node] = {}
    front = [start]
    for _ in range(longest):
        next_front: list[Node] = []
        for node in front:
            for other in after[node]:
                if other == start:
                    path = [node]
                    while path[-1] != start:
                        path.append(came_from[path[-1]])
                    return tuple(reversed(path))
                if other not in came_from:
                    came_from[other] = node
                    next_front.append(other)
        front = next_front
    return None


def _take_out(node: Node, after: Links[Node], before: Links[Node]) -> None:
    """Remove a node, and repeatedly all nodes left without a predecessor or a successor."""
    waiting = [node]
    while waiting:
        one = waiting.pop()
        if one not in after:
            continue
        for forward, backward in ((after, before), (before, after)):
            for other in forward.pop(one):
                if other in backward:
                    del backward[other][one]
                    if not backward[other]:
                        waiting.append(other)


class Intervals:
    """Graph of the beginnings and ends of a recipe's steps and of the recipe itself."""

    def __init__(self, recipe: Recipe) -> None:
        self._steps = [step.iri for step in recipe.steps]
        self._graph = nx.DiGraph()
        names = {recipe.iri, *self._steps, *recipe.phases}
        for name in (*self._steps, *recipe.phases, recipe.iri):
            self._add(Point(name, False), Point(name, True), None, is_strict=True)
        for name in self._steps:
            self._add(Point(recipe.iri, False), Point(name, False), None)
            self._add(Point(name, True), Point(recipe.iri, True), None)
        for ordering in recipe.orderings:
            if {ordering.before, ordering.after} <= names - {recipe.iri}:
                self._add(Point(ordering.before, True), Point(ordering.after, False), ordering, is_strict=True)
        for overlap in recipe.overlaps:
            for one, is_strict, other in overlap.endpoints() if {overlap.first, overlap.second} <= names else ():
                self._add(one, other, overlap, is_strict=is_strict)
                if not is_strict:
                    self._add(other, one, overlap)

    def contradiction(self) -> tuple[Ordering | Overlap, ...]:
        """Find statements that contradict each other, each once; none if all are consistent."""
        for component in nx.strongly_connected_components(self._graph):
            inside = self._graph.subgraph(component)
            strict = sorted((a, b) for a, b, is_strict in inside.edges(data="strict") if is_strict)
            cycles = [nx.shortest_path(inside, b, a) for a, b in strict]
            if cycles:
                cycle = min(cycles, key=len)
                pairs = zip(cycle, [*cycle[1:], cycle[0]], strict=True)
                reasons = (self._graph.edges[a, b]["because"] for a, b in pairs)
                return tuple(dict.fromkeys(reason for reason in reasons if reason is not None))
        return ()

    def implied(self) -> Iterator[tuple[str, str]]:
        """Yield all pairs (before, after) of steps, stated or implied, of which one ends before the other begins.

        Meaningless if there is a contradiction.
        """
        for first in self._steps:
            later = set(reached((Point(first, True),), self._graph.successors))
            yield from ((first, other) for other in self._steps if other != first and Point(other, False) in later)

    def _add(
        self, earlier: Point, later: Point, because: Ordering | Overlap | None, *, is_strict: bool = False
    ) -> None:
        edge = self._graph.get_edge_data(earlier, later)
        if edge is None or (is_strict and not edge["strict"]):
            self._graph.add_edge(earlier, later, strict=is_strict, because=because)


def implied_by_overlaps(recipe: Recipe) -> Iterable[tuple[str, str]]:
    """Orders of steps that only overlaps together with orderings imply; none if they contradict each other."""
    if not recipe.overlaps and not recipe.phases:
        return ()
    intervals = Intervals(recipe)
    if intervals.contradiction():
        return ()
    stated = recipe_order(recipe)
    return [pair for pair in intervals.implied() if not stated.before(*pair)]


@dataclass(frozen=True, slots=True)
class Unit:
    """One step, or a base motion (``base``) with the other steps of its location scope (``steps``)."""

    base: str | None
    steps: tuple[str, ...]

    def members(self) -> tuple[str, ...]:
        """All steps of the unit, the base motion first."""
        return (self.base, *self.steps) if self.base else self.steps


@dataclass(frozen=True, slots=True)
class Scoping:
    """Units, the partial order of their indices, and the orders that scopes add among steps.

    The stated orders and ``added`` together imply all orders of the scoped plan.
    """

    units: tuple[Unit, ...]
    order: Precedence[Any]
    added: tuple[tuple[str, str], ...]


def single_steps(stated: Precedence[str]) -> Scoping:
    """Scoping in which each step is a unit of its own."""
    return Scoping(tuple(Unit(None, (step,)) for step in stated.nodes), stated, ())


def scopes_of(actions: Actions, recipe: Recipe, recipes: RecipeSet, stated: Precedence[str]) -> Scoping:
    """Group the steps of a recipe into units; no scopes if a step has to run in parallel to a base motion."""
    movers = actions.movers(recipe, recipes)
    overlapping = {iri for overlap in recipe.overlaps for iri in (overlap.first, overlap.second)}
    return single_steps(stated) if overlapping & movers.opening else scoping(stated, movers, steps_with_target(recipe))


def added_by_scopes(actions: Actions, recipe: Recipe, recipes: RecipeSet) -> tuple[tuple[str, str], ...]:
    """Orders of steps (IRIs) that scopes add; none if base motions are unordered. Stated orders must be acyclic."""
    movers = actions.movers(recipe, recipes)
    if not movers.opening:
        return ()
    order = recipe_order(recipe)
    moving = [step for step in order.extension if step in movers.opening | movers.ending]
    if not all(order.before(first, second) for first, second in pairwise(moving)):
        return ()
    return scopes_of(actions, recipe, recipes, order).added


def steps_with_target(recipe: Recipe) -> frozenset[str]:
    """Steps that have a location or an object."""
    return frozenset(
        step.iri
        for step in recipe.steps
        if any(isinstance(parameter.filler, (Thing, Place)) for parameter in step.parameters)
    )


def scoping(stated: Precedence[str], movers: Movers, placed: frozenset[str]) -> Scoping:
    """Group the steps of an order in which the movers are totally ordered.

    ``placed`` are the steps that have a location or an object.
    """
    if not movers.opening:
        return single_steps(stated)
    is_moving = movers.opening | movers.ending
    moving = [step for step in stated.extension if step in is_moving]
    before_next = _put_before_next_motion(stated, moving, movers, placed)
    order = stated.extended(before_next)
    inside: dict[str, list[str]] = {}
    outside: set[str] = set()
    for step in stated.nodes:
        scope = _scope(order, moving, movers, step) if step not in is_moving else None
        if scope is None:
            outside.add(step)
        else:
            inside.setdefault(scope, []).append(step)
    units: list[Unit] = []
    for step in stated.nodes:
        if step in movers.opening:
            units.append(Unit(step, tuple(inside.get(step, ()))))
        elif step in outside:
            units.append(Unit(None, (step,)))
    unit_of = {member: index for index, unit in enumerate(units) for member in unit.members()}
    pairs = ((unit_of[a], unit_of[b]) for a, b in order.reduction())
    between = Precedence(range(len(units)), ((a, b) for a, b in pairs if a != b))
    return Scoping(tuple(units), between, _added(stated, order, units, between))


def _added(
    stated: Precedence[str], order: Precedence[str], units: Sequence[Unit], between: Precedence[int]
) -> tuple[tuple[str, str], ...]:
    """Orders between units that are not stated: from each last step of a unit to the first step of the next one."""
    rank = {step: number for number, step in enumerate(stated.nodes)}
    added = []
    lasts: dict[int, list[str]] = {}
    for first, second in between.reduction():
        if first not in lasts:
            members = units[first].members()
            own = sum(order.bit(step) for step in members)
            lasts[first] = [step for step in members if not order.later(step) & own]
        following = units[second].members()[0]
        added += [(step, following) for step in lasts[first] if not stated.before(step, following)]
    return tuple(sorted(added, key=lambda pair: (rank[pair[0]], rank[pair[1]])))


def _moves_before(order: Precedence[str], moving: Sequence[str], step: str) -> int:
    """Number of the totally ordered base motions that come before a step."""
    return bisect_left(moving, True, key=lambda base: not order.before(base, step))


def _put_before_next_motion(
    stated: Precedence[str], moving: Sequence[str], movers: Movers, placed: frozenset[str]
) -> list[tuple[str, str]]:
    added = []
    is_moving = frozenset(moving)
    for step in stated.nodes:
        if step not in placed or step in is_moving:
            continue
        number = _moves_before(stated, moving, step)
        if 0 < number < len(moving) and moving[number - 1] in movers.opening:  # in a scope that another motion ends
            following = moving[number]
            if not stated.before(step, following):
                added.append((step, following))
    return added


def _scope(order: Precedence[str], moving: Sequence[str], movers: Movers, step: str) -> str | None:
    number = _moves_before(order, moving, step)
    if not number or moving[number - 1] not in movers.opening:
        return None
    if number < len(moving) and not order.before(step, moving[number]):
        return None
    return moving[number - 1]


def callees_first(recipes: RecipeSet) -> list[Recipe]:
    """List all recipes, callees before their callers, the task last; recipes must not be recursive."""
    done: dict[str, Recipe] = {}
    waiting = [recipes.task]
    while waiting:
        recipe = recipes.recipes[waiting[-1]]
        below = [callee for step in recipe.steps for callee in step.recipes if callee not in done]
        if below and recipe.iri not in done:
            waiting += reversed(below)
        else:
            done.setdefault(recipe.iri, recipe)
            waiting.pop()
    return list(done.values())
