"""Convert orders, overlaps and transitions to constructs of the plan language.

An order becomes sequences, parallel branches, and explicit partial orders for the rest. Overlapping steps run in
parallel: the relations between their beginnings and ends (:meth:`planlang.recipe.model.Overlap.endpoints`) become
gates: a step begins, or counts as ended, only after the events that it waits for; two steps that begin or end together
signal that they are ready and wait for each other. States and transitions become a state machine.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from dataclasses import field, replace
from keyword import iskeyword
from typing import TypeVar

from planlang.closure import grouped, reached
from planlang.compiler.expressions import Names
from planlang.compiler.tree import Case, Event, Gate, Handle, Machine, Node, Parallel, PartialOrder, Series, State
from planlang.designators import local_name, snake_case
from planlang.failures import ObjectNotFound, PlanFailure
from planlang.recipe.model import Ending, Recipe, Step, Transition
from planlang.recipe.order import Precedence
from planlang.records import dataclass

MOST_NESTED = 3
"""Maximum depth of nested constructs, for readability: deeper ones become one equivalent partial order.

The body of a branch at the third level is indented by 16 columns.
"""

MOST_ROUNDS = 50
"""Maximum number of rounds that merge modules of an order: a round finds all modules of a level, and levels deeper than
``MOST_NESTED`` are flattened anyway. Bounds the time for an order of 10,000 steps in 5,000 levels."""

LONGEST_NAME = 50
"""Maximum length of the name of a branch, made of its first and last step, so that a call fits beside it."""

_N = TypeVar("_N", bound=Hashable)


@dataclass(frozen=True, slots=True)
class SerialPart:
    """Parts in sequence: all nodes of one come before all nodes of the next."""

    parts: tuple[Part, ...]


@dataclass(frozen=True, slots=True)
class ParallelPart:
    """Unordered parts, sorted by their first leaves."""

    parts: tuple[Part, ...]


@dataclass(frozen=True, slots=True)
class PrimePart:
    """Parts in an order of neither form, sorted by their first leaves; ``orderings`` are pairs of their indices."""

    parts: tuple[Part, ...]
    orderings: tuple[tuple[int, int], ...]


Part = SerialPart | ParallelPart | PrimePart | int
"""A leaf is the index of a node."""


def decomposed(order: Precedence[_N], deepest: int = MOST_NESTED + 1) -> Part | None:
    """Decompose an order into serial, parallel and prime parts, ``deepest`` levels deep; None if it is empty.

    Parts of a SerialPart are no SerialParts, those of a ParallelPart no ParallelParts. Deeper levels become one
    PrimePart of leaves. This is the modular decomposition of an order (R. H. Möhring, F. J. Radermacher, 1984), except
    that within a prime part only modules of series-parallel form are found.
    """
    if not order.nodes:
        return None
    number = {node: index for index, node in enumerate(order.nodes)}

    def part(inside: int, deepest: int) -> Part:
        leaves = [number[node] for node in order.members(inside)]
        if len(leaves) == 1:
            return leaves[0]
        is_parallel = len(groups := list(_components(order, inside))) > 1
        is_serial = not is_parallel and len(groups := _series(order, inside)) > 1
        if not is_parallel and not is_serial:
            groups = _modules(order, inside)
        if not deepest and len(groups) < len(leaves):
            groups, is_parallel, is_serial = list(map(order.bit, order.members(inside))), False, False
        if not is_serial:
            groups.sort(key=lambda group: min(number[node] for node in order.members(group)))
        parts = tuple(part(group, deepest - 1) for group in groups)
        if is_serial or is_parallel:
            return SerialPart(parts) if is_serial else ParallelPart(parts)
        group_of = {node: index for index, group in enumerate(groups) for node in order.members(group)}
        pairs = {
            (group_of[one], group_of[other]) for one in group_of for other in order.covers(one) if other in group_of
        }
        return PrimePart(parts, tuple(sorted(pair for pair in pairs if pair[0] != pair[1])))

    return part(sum(map(order.bit, order.nodes)), deepest)


def _components(order: Precedence[_N], inside: int) -> Iterator[int]:
    """Yield the connected components of the order, as bits."""
    while inside:
        group = waiting = inside & -inside
        while waiting:
            node = next(order.members(waiting))
            new = (order.later(node) | order.earlier(node)) & inside & ~group
            group |= new
            waiting = (waiting & waiting - 1) | new
        yield group
        inside &= ~group


def _series(order: Precedence[_N], inside: int) -> list[int]:
    """Split nodes into the longest sequence of sets (as bits) such that all of one come before all of the next.

    A linear extension can be cut where exactly the nodes before the cut come before every node after it.
    """
    # The nodes are walked backwards. ``before_all`` holds what comes before every node walked so far, ``remaining``
    # what was not walked yet: a cut is where the two are equal.
    #
    #     a --> c      after d: before all {a, b}, remaining {a, b, c}: no cut
    #        X         after c: before all {a, b}, remaining {a, b}: a cut, {c, d} is the last group
    #     b --> d      after b: before all {}, remaining {a}; after a: both {}: {a, b} is the first group
    #
    # Every linear extension has these cuts, because in each of them all of one group come before all of the next.
    groups: list[int] = []
    before_all, tail, remaining = inside, 0, inside
    for node in reversed(list(order.members(inside))):
        before_all &= order.earlier(node)
        tail |= order.bit(node)
        remaining ^= order.bit(node)
        if before_all == remaining:
            groups.append(tail)
            tail = 0
    return groups[::-1]


def _modules(order: Precedence[_N], inside: int) -> list[int]:
    """Find modules of series-parallel form (as bits): sets whose nodes have the same order to every other node.

    Two nodes are merged, and the first represents both, if the same nodes come before and after both, or if one
    directly follows the other and nothing else is ordered between them.
    """
    # A group is stood for by its first node, and later rounds see that node only. Both merges keep that right:
    #
    #     twins   a -> { x, y } -> b      the same nodes are before and behind x and y, which are parallel: what holds
    #                                     between x and any other node holds for y, so that one can stand for both
    #     chain   a -> x -> y -> b        behind x are y and what is behind y, before y are x and what is before x: no
    #                                     other node can tell them apart
    #
    # Parallel and serial parts are built up from the inside by repeating this; an N (a < c, b < c, b < d) offers
    # neither, and remains as a prime part.
    groups = {node: order.bit(node) for node in order.members(inside)}
    for _ in range(MOST_ROUNDS):
        before = len(groups)
        mask = sum(map(order.bit, groups))
        # keyed by hash, because with 10,000 nodes each set takes 1 KB
        groups_with: dict[int, list[_N]] = {}
        for node in list(groups):
            neighbours = order.earlier(node) & mask, order.later(node) & mask
            twins = groups_with.setdefault(hash(neighbours), [])
            same = next(
                (one for one in twins if (order.earlier(one) & mask, order.later(one) & mask) == neighbours), None
            )
            if same is None:
                twins.append(node)
            else:
                groups[same] |= groups.pop(node)
        mask = sum(map(order.bit, groups))
        for node in reversed(list(groups)):  # backwards, so that a chain collapses in a single round
            following = order.later(node) & mask
            if not following:
                continue
            after = next(order.members(following))
            is_only_one_after = following == order.later(after) & mask | order.bit(after)
            if is_only_one_after and order.earlier(after) & mask == order.earlier(node) & mask | order.bit(node):
                groups[node] |= groups.pop(after)
        if len(groups) == before:
            break
    return list(groups.values())


class BranchNames:
    """Names of branches and states as in the recipe, with a number if they are equal in snake case.

    The functions and parameters that are named after them in snake case are therefore unique, too.
    """

    def __init__(self) -> None:
        self._names = Names()

    def claim(self, wanted: str) -> str:
        """Make a name unique."""
        key = f"branch_{snake_case(wanted)}"
        return wanted + self._names.claim(key).removeprefix(key)


def _is_keyword(name: str) -> bool:
    """True for a valid keyword argument of ``par``."""
    return name.isidentifier() and not iskeyword(name) and name not in ("name", "limit")


def arranged_by(order: Precedence[_N], nodes: Sequence[Node], names: Sequence[str]) -> Series:
    """Arrange nodes by an order with as many elements; ``names`` are the preferred names of branches.

    The constructs allow exactly the executions that the order allows.
    """
    part = decomposed(order)
    if part is None:
        return Series(())
    branch_names = BranchNames()
    own = list(map(branch_names.claim, names))

    def called(part: Part) -> str:
        """Name of a branch: that of its step, or made of the names of its first and last steps."""
        if isinstance(part, int):
            return own[part]
        leaves = _leaves(part)
        first, last = own[leaves[0]], own[leaves[-1]]
        if isinstance(part, SerialPart):
            name = f"{first}_then_{last}" if len(leaves) == 2 else f"{first}_to_{last}"
        else:
            name = f"{first}_and_{last}" if len(leaves) == 2 else f"{first}_and_others"
        return branch_names.claim(name if len(name) <= LONGEST_NAME else f"{first}_and_more")

    def made(part: Part) -> Node:
        if isinstance(part, int):
            return nodes[part]
        if isinstance(part, SerialPart):
            return Series(tuple(map(made, part.parts)))
        if isinstance(part, ParallelPart):
            branches = tuple((called(inner), made(inner)) for inner in part.parts)
            return Parallel(branches) if all(map(_is_keyword, dict(branches))) else PartialOrder(branches, ())
        keys = [called(inner) for inner in part.parts]
        orderings = tuple((keys[one], keys[other]) for one, other in part.orderings)
        return PartialOrder(tuple(zip(keys, map(made, part.parts), strict=True)), orderings)

    whole = made(part)
    return whole if isinstance(whole, Series) else Series((whole,))


def _leaves(part: Part) -> list[int]:
    """Leaves of a part, in the order of its parts."""
    return [part] if isinstance(part, int) else [leaf for inner in part.parts for leaf in _leaves(inner)]


BEGINS, ENDS = _MOMENTS = "begins", "ends"
READY_TO_BEGIN, READY_TO_END = "is ready to begin", "is ready to end"

_READY = {BEGINS: READY_TO_BEGIN, ENDS: READY_TO_END}


@dataclass(slots=True)
class _Point:
    """The beginning or the end of a step: events to wait for, and events that happen together with it."""

    waits: dict[Event, None] = field(default_factory=dict)
    together: dict[Event, None] = field(default_factory=dict)


class Overlaps:
    """Builds the gates of overlapping steps of a recipe; ``order`` is that of its steps (IRIs)."""

    def __init__(self, recipe: Recipe, order: Precedence[str]) -> None:
        self._points: dict[tuple[str, str], _Point] = {}
        self._signalled: set[Event] = set()
        self._in_words: dict[str, str] = {}
        """Step (IRI) -> its stated overlaps, in words."""
        known = {step.iri for step in recipe.steps}
        for overlap in recipe.overlaps:
            text = f"{overlap.relation.value} {local_name(overlap.second)}"
            self._in_words[overlap.first] = ", ".join(filter(None, (self._in_words.get(overlap.first), text)))
            for (one, ends), is_strict, (other, others_end) in overlap.endpoints():
                here, there = (one, _MOMENTS[ends]), (other, _MOMENTS[others_end])
                if {one, other} <= known:
                    self._relate(here, there, order, is_strict=is_strict)
                elif {one, other} <= {recipe.iri, *known} and not is_strict:
                    self._with_recipe(recipe, here, there, order)

    def gated(self, step: str, node: Node) -> Node:
        """Put a node between the gates of its step; nodes of steps without overlaps stay as they are."""
        if not self._points and not self._signalled:
            return node
        opens, closes = self._gates(step, BEGINS), self._gates(step, ENDS)
        return Gate(local_name(step), opens, node, closes, self._in_words.get(step, "")) if opens or closes else node

    def _gates(self, step: str, moment: str) -> tuple[Event | tuple[Event, ...], ...]:
        """Gates at one end of a step: wait for others, meet the steps that are ready, then signal."""
        point = self._points.get((step, moment), _Point())
        gates: list[Event | tuple[Event, ...]] = []
        if point.waits:
            gates.append(tuple(point.waits))
        if point.together:
            gates += [Event(step, _READY[moment]), tuple(point.together)]
        if Event(step, moment) in self._signalled:
            gates.append(Event(step, moment))
        return tuple(gates)

    def _relate(
        self, one: tuple[str, str], other: tuple[str, str], order: Precedence[str], *, is_strict: bool = True
    ) -> None:
        if one[0] == other[0] or order.ordered(one[0], other[0]):
            return
        if not is_strict:
            for mine, theirs in ((one, other), (other, one)):
                self._point(mine).together[Event(theirs[0], _READY[theirs[1]])] = None
        else:
            event = Event(*one)
            self._signalled.add(event)
            self._point(other).waits[event] = None

    def _with_recipe(
        self, recipe: Recipe, one: tuple[str, str], other: tuple[str, str], order: Precedence[str]
    ) -> None:
        """Gate a step that begins with the recipe before all others, and one that ends with it after all others."""
        step, moment = one if other[0] == recipe.iri else other
        for another in recipe.steps:
            if another.iri == step or order.ordered(step, another.iri):
                continue
            if moment == BEGINS and not order.earlier(another.iri):
                self._relate((step, BEGINS), (another.iri, BEGINS), order)
            elif moment == ENDS and not order.later(another.iri):
                self._relate((another.iri, ENDS), (step, ENDS), order)

    def _point(self, point: tuple[str, str]) -> _Point:
        return self._points.setdefault(point, _Point())


DONE, TRUE, FALSE = "done", "true", "false"

NOT_SEEN = ObjectNotFound.__name__
"""Failure of a step that checks whether something is visible, if it is not."""


def machine(
    recipe: Recipe, node_of: Callable[[Step], Node], kept: Callable[[Step], tuple[str, ...]] = lambda step: ()
) -> Machine:
    """Build the state machine of a finite-state recipe; ``node_of`` builds the node of a state's step.

    ``kept`` gives the names under which other states find the result of a state.
    """
    assert recipe.machine is not None
    steps = {step.iri: step for step in recipe.steps}
    state_names = BranchNames()
    names = {iri: state_names.claim(step.name) for iri, step in steps.items()}
    ends = [end for end in recipe.machine.ends if end in steps]
    leaving: dict[str, list[Transition]] = {iri: [] for iri in steps}
    for transition in recipe.machine.transitions:
        if transition.source in steps and transition.target in steps:
            leaving[transition.source].append(transition)
    states, cases = [], []
    for iri, step in steps.items():
        if iri in ends:
            leaves = [transition for transition in leaving[iri] if transition.ending is Ending.FAILED]
            states.append(State(names[iri], node_of(step)))
        else:
            leaves = leaving[iri]
            states.append(replace(_state(names[iri], node_of(step), leaves), keeps=kept(step)))
        cases += _cases(names, iri, leaves)
    entered = _entered(names[recipe.machine.start], cases)
    final = tuple(names[end] for end in ends if names[end] in entered)
    return Machine(tuple(states), tuple(cases), names[recipe.machine.start], final)


def _state(name: str, body: Node, leaving: list[Transition]) -> State:
    endings = {transition.ending for transition in leaving}
    if endings & {Ending.TRUE, Ending.FALSE}:
        return State(name, _not_cured(body) if Ending.FALSE in endings else body, checks=True)
    others = dict.fromkeys(
        local_name(transition.outcome or "") for transition in leaving if transition.ending is Ending.OTHER
    )
    return State(name, body, outcomes=tuple(others))


def _not_cured(body: Node) -> Node:
    """Remove recoveries from failed perception, which the machine handles by a transition."""
    if not isinstance(body, Handle):
        return body
    remaining = tuple(recovery for recovery in body.recoveries if recovery.failure != NOT_SEEN)
    return Handle(body.body, remaining) if remaining else body.body


def _cases(names: Mapping[str, str], state: str, leaving: list[Transition]) -> list[Case]:
    """Build a case for each outcome of a state; a transition for any outcome covers those without their own."""
    endings = {transition.ending for transition in leaving}
    checks = bool(endings & {Ending.TRUE, Ending.FALSE})
    targets: dict[tuple[str, bool], str] = {}
    for transition in leaving:
        target = names[transition.target]
        match transition.ending:
            case Ending.TRUE:
                targets.setdefault((TRUE, False), target)
            case Ending.FALSE:
                targets.setdefault((FALSE, False), target)
                targets.setdefault((NOT_SEEN, True), target)
            case Ending.OTHER:
                targets.setdefault((local_name(transition.outcome or ""), False), target)
            case Ending.FAILED:
                targets.setdefault((PlanFailure.__name__, True), target)
            case _ if not checks:
                targets.setdefault((DONE, False), target)
    for transition in leaving:
        if checks and transition.ending is Ending.DONE:
            for outcome in (TRUE, FALSE):
                targets.setdefault((outcome, False), names[transition.target])
    by_kind = sorted(targets.items(), key=lambda item: (item[0][1], item[0][0] == PlanFailure.__name__))
    return [Case(names[state], outcome, target, is_failure) for (outcome, is_failure), target in by_kind]


def _entered(start: str, cases: list[Case]) -> set[str]:
    after = grouped((case.state, case.target) for case in cases)
    return {*reached((start,), lambda state: after.get(state, ()))}
