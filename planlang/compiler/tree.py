"""The plan tree, what a recipe is lowered to and the source is written from, and what its nodes pass on."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

from planlang.recipe.model import Constraint, Name, Part, Place, Thing
from planlang.records import dataclass
from planlang.recoveries import Strategy


@dataclass(frozen=True, slots=True)
class PlaceUse:
    """A place as a function uses it: the place, and the function's own things that stand for those it names."""

    place: Place
    arguments: tuple[Thing, ...]


@dataclass(frozen=True, slots=True)
class Resting:
    """The place on a thing, or the place that the thing stands for if the plan's caller gives one instead."""

    support: Thing


@dataclass(frozen=True, slots=True)
class Described:
    """A situation of a class (IRI, local name if of the vocabulary) in which properties are filled, in snake case."""

    type: str
    properties: tuple[tuple[str, tuple[Value, ...]], ...]


@dataclass(frozen=True, slots=True)
class Passed:
    """The result of an earlier step (IRI), or ``otherwise`` if that is not of the right kind."""

    producer: str
    otherwise: Thing | PlaceUse | Part | Constraint | Name | str | int | float | bool


@dataclass(frozen=True, slots=True)
class Kept:
    """The last value that states have made under a name, or ``otherwise`` if it is not of the right kind."""

    name: str
    otherwise: Thing | PlaceUse | Part | Constraint | Name | str | int | float | bool


Value = Thing | PlaceUse | Part | Constraint | Described | Passed | Kept | Name | str | int | float | bool
"""A filler of a property of an action in a plan."""


@dataclass(frozen=True, slots=True)
class ActionTerm:
    """An action designator: the step's own class (IRI, local name if of the vocabulary), properties in snake case.

    A property may have several fillers.
    """

    type: str
    properties: tuple[tuple[str, tuple[Value, ...]], ...]


@dataclass(frozen=True, slots=True)
class Perform:
    """Perform a primitive or abstract action; ``name`` is the step's class, ``label`` its description.

    ``step`` is the IRI of the step, by which others refer to its result. ``once``: it must not be repeated, as nothing
    is known of what it changes.
    """

    name: str
    action: ActionTerm
    label: str | None = None
    step: str = ""
    once: bool = False


@dataclass(frozen=True, slots=True)
class FunctionCall:
    """Call the plan function of a recipe (IRI) with things for some of its parameters."""

    recipe: str
    arguments: tuple[tuple[Thing, Thing | PlaceUse | Passed | Kept], ...]
    """Pairs (parameter of the called function, what the caller passes)."""


@dataclass(frozen=True, slots=True)
class Call:
    """Perform a step that has a recipe, or several as alternatives; ``label`` is its description, as in Perform."""

    name: str
    action: ActionTerm
    calls: tuple[FunctionCall, ...]
    step: str = ""
    label: str | None = None


@dataclass(frozen=True, slots=True)
class Condition:
    """A condition that the executive can look up, over things of the function."""

    predicate: str
    things: tuple[Thing, ...]


@dataclass(frozen=True, slots=True)
class Achieve:
    """Run the body unless the condition holds; after it the condition must hold."""

    condition: Condition
    body: Node


@dataclass(frozen=True, slots=True)
class Recover:
    """One recovery: failure class, strategy and what it is about, how often, and what to raise then.

    ``again`` names what the strategy runs again (:class:`Again`).
    """

    failure: str
    strategy: Strategy
    about: Thing | None
    attempts: int
    otherwise: str | None
    again: str | None = None


@dataclass(frozen=True, slots=True)
class Again:
    """Run the body, which recoveries of later nodes run again by this name."""

    name: str
    body: Node


@dataclass(frozen=True, slots=True)
class Handle:
    """Run the body with recoveries."""

    body: Node
    recoveries: tuple[Recover, ...]


@dataclass(frozen=True, slots=True)
class Hold:
    """Run the body while holding resources (roles), which are granted all at once; ``name`` is the step's."""

    name: str
    roles: tuple[str, ...]
    body: Node


@dataclass(frozen=True, slots=True)
class Scope:
    """Run the body where the base is at ``place`` and can reach all of ``reaching``; ``motion`` is the step's class."""

    name: str
    motion: str
    place: PlaceUse | Passed
    reaching: tuple[PlaceUse | Thing | Resting, ...]
    attempts: int
    body: Series
    label: str | None = None


@dataclass(frozen=True, slots=True)
class Parallel:
    """Named branches side by side: nothing orders one with another."""

    branches: tuple[tuple[str, Node], ...]


@dataclass(frozen=True, slots=True)
class Alternatives:
    """Named branches, of which each is tried if those before it failed; ``name``, ``step``, ``label`` as in Perform."""

    name: str
    branches: tuple[tuple[str, Node], ...]
    step: str = ""
    label: str | None = None


@dataclass(frozen=True, slots=True)
class PartialOrder:
    """Named branches and the pairs (before, after) of names that order them, none of which follows from others."""

    branches: tuple[tuple[str, Node], ...]
    orderings: tuple[tuple[str, str], ...]


@dataclass(frozen=True, slots=True)
class Series:
    """Nodes one after another."""

    nodes: tuple[Node, ...]


@dataclass(frozen=True, slots=True)
class Event:
    """The beginning or the end of a step that overlaps others, as these see it.

    ``moment`` is one of "begins", "ends", or for those that happen together "is ready to begin", "is ready to end".
    """

    step: str
    moment: str


@dataclass(frozen=True, slots=True)
class Gate:
    """Run the body when events have happened, and count as ended when further ones have; signal its own."""

    name: str
    opens: tuple[Event | tuple[Event, ...], ...]
    """Before the body, in order: an event of its own to signal, or events of others to wait for."""
    body: Node
    closes: tuple[Event | tuple[Event, ...], ...]
    """After the body, likewise."""
    overlaps: str = ""
    """The overlaps of the step with others, in words."""


@dataclass(frozen=True, slots=True)
class Case:
    """A change from a state to the next for an outcome; ``is_failure`` if that is the name of a failure class."""

    state: str
    outcome: str
    target: str
    is_failure: bool = False


@dataclass(frozen=True, slots=True)
class State:
    """A state: what is done in it, and what it returns to say how that ended.

    With ``checks`` that is "true", or "false" if the body's result is False. Of ``outcomes`` the one that the body's
    result names. Else "done". ``keeps`` are names under which other states find the body's result.
    """

    name: str
    body: Node
    checks: bool = False
    outcomes: tuple[str, ...] = ()
    keeps: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Machine:
    """States that follow each other by how they end."""

    states: tuple[State, ...]
    cases: tuple[Case, ...]
    start: str
    ends: tuple[str, ...]


Node = (
    Perform
    | Call
    | Achieve
    | Handle
    | Again
    | Hold
    | Scope
    | Parallel
    | Alternatives
    | PartialOrder
    | Series
    | Gate
    | Machine
)


@dataclass(frozen=True, slots=True)
class Function:
    """A plan function: one recipe."""

    iri: str
    label: str | None
    parameters: tuple[Thing, ...]
    body: Series


@dataclass(frozen=True, slots=True)
class PlanTree:
    """All functions of a plan, called ones before their callers, the task last."""

    functions: tuple[Function, ...]
    devices: tuple[tuple[str, Thing], ...] = ()
    """Pairs (IRI of a place, the one device that all its uses reach it with)."""
    classes: tuple[tuple[str, tuple[str, ...]], ...] = ()
    """Classes of actions that the bundled vocabulary does not know, with those directly above, which come first."""


def inside(node: Node) -> tuple[Node, ...]:
    """Return the nodes directly inside of a node, in textual order."""
    match node:
        case Series(nodes):
            return nodes
        case Parallel(branches) | PartialOrder(branches, _) | Alternatives(_, branches):
            return tuple(branch for _, branch in branches)
        case Machine(states):
            return tuple(state.body for state in states)
        case Achieve() | Handle() | Again() | Hold() | Scope() | Gate():
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
        if isinstance(node, (Perform, Call, Alternatives)):
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


def uses_of_classes(tree: PlanTree) -> Counter[str]:
    """Count the uses of each class of actions, outside of its own statement, in which it can be stated, too."""
    uses: Counter[str] = Counter()
    for node in (node for function in tree.functions for node in _all(function.body)):
        if isinstance(node, Perform | Call):
            uses[node.action.type] += 1
        if isinstance(node, Scope):
            uses[node.motion] += 1
        for value in _values(node):
            uses.update(dict.fromkeys(_situations(value), 2))
    for _, above in tree.classes:
        uses.update(dict.fromkeys(above, 2))
    return uses


def _situations(value: Value) -> Iterator[str]:
    """Yield the classes of what a value describes."""
    if isinstance(value, Described):
        yield value.type
        yield from (one for _, fillers in value.properties for inner in fillers for one in _situations(inner))


def uses_of_places(body: Node) -> Counter[str]:
    """Count how often a function names each place (IRI)."""
    uses: Counter[str] = Counter()
    for node in _all(body):
        for value in _values(node):
            uses.update(_places(value))
        for where in node.reaching if isinstance(node, Scope) else ():
            if isinstance(where, PlaceUse):
                uses.update(_places(where))
    return uses


def _places(value: Value) -> Iterator[str]:
    """Yield the places (IRIs) that a value names, with those by which they are described."""
    match value:
        case PlaceUse(place):
            waiting = [place]
            while waiting:
                place = waiting.pop()
                yield place.iri
                waiting += [reference for _, reference in place.relations if isinstance(reference, Place)]
        case Passed(_, otherwise) | Kept(_, otherwise):
            yield from _places(otherwise)
        case Described(_, properties):
            yield from (place for _, fillers in properties for inner in fillers for place in _places(inner))


def uses_of_recoveries(body: Node) -> Counter[tuple[Recover, ...]]:
    """Count how often a function handles failures with the same recoveries."""
    return Counter(node.recoveries for node in _all(body) if isinstance(node, Handle))


def uses_of_features(body: Node) -> Counter[Part]:
    """Count how often a function names each feature; constraints that relate the same two are stated once."""
    related: dict[tuple[str, Part, Part], None] = {}
    uses: Counter[Part] = Counter()
    for value in (value for node in _all(body) for value in _values(node)):
        if isinstance(value, Constraint):
            related[value.template, value.tool, value.world] = None
        elif isinstance(value, Part):
            uses[value] += 1
    uses.update(part for _, tool, world in related for part in (tool, world))
    return uses


def _passed(node: Node) -> Iterator[str]:
    """Yield the steps whose results a node itself uses."""
    return (value.producer for value in _values(node) if isinstance(value, Passed))


def _values(node: Node) -> Iterator[Value]:
    """Yield the values that a node itself hands to actions, calls and places."""
    if isinstance(node, (Perform, Call)):
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
