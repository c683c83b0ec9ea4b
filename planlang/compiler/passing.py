"""The values and events that each piece of a plan function has to hand on to the rest."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

from planlang.compiler.tree import (
    Achieve,
    Call,
    Event,
    Gate,
    Handle,
    Hold,
    Kept,
    Machine,
    Node,
    Parallel,
    PartialOrder,
    Passed,
    Perform,
    Scope,
    Series,
    Value,
)


def inside(node: Node) -> tuple[Node, ...]:
    """Return the nodes directly inside of a node, in textual order."""
    match node:
        case Series(nodes):
            return nodes
        case Parallel(branches) | PartialOrder(branches, _):
            return tuple(branch for _, branch in branches)
        case Machine(states):
            return tuple(state.body for state in states)
        case Achieve() | Handle() | Hold() | Scope() | Gate():
            return (node.body,)
    return ()


class Passing:
    """The values that each node of a function's body makes and uses. Nodes are distinguished by identity."""

    def __init__(self, body: Series) -> None:
        self._made: dict[int, dict[str, None]] = {}
        self._used: dict[int, Counter[str]] = {}
        self._events: dict[int, Counter[Event]] = {}
        self._home: dict[int, list[Event]] = {}
        self._settled: set[Event] = set()
        total: Counter[Event] = Counter()
        self._is_plain = True
        for node in _all(body):
            if isinstance(node, Gate):
                total.update(_events(node))
            if next(_passed(node), None) is not None:
                self._is_plain = False
        if total or not self._is_plain:
            self._walk(body, total)
        self._total = self._used.get(id(body), Counter())

    def leaving(self, node: Node) -> tuple[str, ...]:
        """Return the steps (IRIs) inside of a node whose results are used outside of it."""
        if self._is_plain:
            return ()
        used = self._used[id(node)]
        return tuple(step for step in self._made[id(node)] if self._total[step] > used[step])

    def needed(self, node: Node, made_by: Node) -> bool:
        """Return True if a node uses the result of a step inside of another."""
        if self._is_plain:
            return False
        return any(self._used[id(node)][step] for step in self._made[id(made_by)])

    def events(self, series: Series) -> tuple[Event, ...]:
        """Return the events that occur in a series, but not within one nested series alone."""
        return tuple(self._home.get(id(series), ()))

    def _walk(self, node: Node, total: Counter[Event]) -> None:
        made: dict[str, None] = {}
        used: Counter[str] = Counter(_passed(node))
        events: Counter[Event] = Counter(_events(node) if isinstance(node, Gate) else ())
        if isinstance(node, (Perform, Call)):
            made[node.step] = None
        for inner in inside(node):
            self._walk(inner, total)
            made.update(self._made[id(inner)])
            used.update(self._used[id(inner)])
            events.update(self._events[id(inner)])
        self._made[id(node)], self._used[id(node)], self._events[id(node)] = made, used, events
        if isinstance(node, Series):
            home = [event for event in events if events[event] == total[event] and event not in self._settled]
            self._settled.update(home)
            self._home[id(node)] = home


def _all(body: Node) -> Iterator[Node]:
    waiting: list[Node] = [body]
    while waiting:
        node = waiting.pop()
        yield node
        waiting += inside(node)


def uses_kept(body: Node) -> bool:
    """Return True if a node, or one inside of it, uses what the states of a machine have made."""
    return any(isinstance(value, Kept) for node in _all(body) for value in _values(node))


def _passed(node: Node) -> Iterator[str]:
    """Yield the steps whose results a node itself uses."""
    return (value.producer for value in _values(node) if isinstance(value, Passed))


def _values(node: Node) -> Iterator[Value]:
    """Yield the values that a node itself hands to actions, calls and places."""
    if isinstance(node, (Perform, Call)) and node.action is not None:
        for _, fillers in node.action.properties:
            yield from fillers
    if isinstance(node, Call):
        for call in node.calls:
            yield from (value for _, value in call.arguments)
    if isinstance(node, Scope):
        yield node.place


def _events(gate: Gate) -> Iterator[Event]:
    for entry in (*gate.opens, *gate.closes):
        if isinstance(entry, Event):
            yield entry
        else:
            yield from entry
