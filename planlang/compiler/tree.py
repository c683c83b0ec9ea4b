"""The plan tree, between recipes and source, and the values that its nodes pass to each other."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

from planlang.recipe.model import Constraint, Name, Part, Place, Thing
from planlang.records import dataclass
from planlang.recoveries import Strategy


@dataclass(frozen=True, slots=True)
class PlaceUse:
    """A place in a plan function, with the function's arguments for the things that the place refers to."""

    place: Place
    arguments: tuple[Thing, ...]


@dataclass(frozen=True, slots=True)
class Resting:
    """The place on a thing, or the place itself if the caller passes a place for the thing."""

    support: Thing


@dataclass(frozen=True, slots=True)
class Described:
    """A situation of a class (IRI, or local name of the vocabulary) with properties in snake case."""

    type: str
    properties: tuple[tuple[str, tuple[Value, ...]], ...]


@dataclass(frozen=True, slots=True)
class StepResult:
    """Result of an earlier step (IRI), or ``otherwise`` if the result is of the wrong kind."""

    producer: str
    otherwise: Thing | PlaceUse | Part | Constraint | Name | str | int | float | bool


@dataclass(frozen=True, slots=True)
class LatestProduct:
    """Latest result of states under a name, or ``otherwise`` if it is of the wrong kind."""

    name: str
    otherwise: Thing | PlaceUse | Part | Constraint | Name | str | int | float | bool


Value = Thing | PlaceUse | Part | Constraint | Described | StepResult | LatestProduct | Name | str | int | float | bool
"""Filler of a property of an action in a plan."""


@dataclass(frozen=True, slots=True)
class ActionTerm:
    """An action designator: the step's own class (IRI, or local name of the vocabulary) and properties in snake case.

    A property may have several fillers.
    """

    type: str
    properties: tuple[tuple[str, tuple[Value, ...]], ...]


@dataclass(frozen=True, slots=True)
class Perform:
    """Perform a primitive or abstract action; ``name`` is the step's class, ``label`` its description.

    ``step`` is the IRI of the step, by which others refer to its result. ``once`` if it must not be repeated, because
    its effects are unknown.
    """

    name: str
    action: ActionTerm
    label: str | None = None
    step: str = ""
    once: bool = False
    times: int = 1
    """Number of performances, each about another thing."""


@dataclass(frozen=True, slots=True)
class FunctionCall:
    """Call the plan function of a recipe (IRI) with things for some of its parameters."""

    recipe: str
    arguments: tuple[tuple[Thing, Thing | PlaceUse | StepResult | LatestProduct], ...]
    """Pairs (parameter of the called function, argument)."""


@dataclass(frozen=True, slots=True)
class Call:
    """Perform a step that has a recipe, or several as alternatives; ``label`` is its description, as in Perform."""

    name: str
    action: ActionTerm
    calls: tuple[FunctionCall, ...]
    step: str = ""
    label: str | None = None
    times: int = 1


@dataclass(frozen=True, slots=True)
class Condition:
    """A condition over things of the function that the executive can evaluate."""

    predicate: str
    things: tuple[Thing, ...]


@dataclass(frozen=True, slots=True)
class Achieve:
    """Run the body unless the condition holds; afterwards the condition must hold."""

    condition: Condition
    body: Node


@dataclass(frozen=True, slots=True)
class Recover:
    """One recovery: failure class, strategy and its object, number of attempts, and the failure to raise after them.

    ``within`` is the time since the start of the body after which nothing more is attempted [s]. ``again`` names the
    branch that the strategy runs again (:class:`Again`).
    """

    failure: str
    strategy: Strategy
    about: Thing | None
    attempts: int
    otherwise: str | None
    again: str | None = None
    within: float | None = None


@dataclass(frozen=True, slots=True)
class Again:
    """Run the body; recoveries of later nodes run it again by this name."""

    name: str
    body: Node


@dataclass(frozen=True, slots=True)
class Handle:
    """Run the body with recoveries."""

    body: Node
    recoveries: tuple[Recover, ...]


@dataclass(frozen=True, slots=True)
class Hold:
    """Run the body while holding resources (roles), which are granted all at once; ``name`` is that of the step.

    ``in_turns``: the body has a :class:`Turn`.
    """

    name: str
    roles: tuple[str, ...]
    body: Node
    in_turns: bool = False


@dataclass(frozen=True, slots=True)
class Turn:
    """Where another step that waits for the resources of a :class:`Hold` around may go first.

    ``again`` names the branch that takes again what the other step has put down meanwhile (:class:`Again`).
    """

    again: str | None = None


@dataclass(frozen=True, slots=True)
class Scope:
    """Run the body with the base at ``place``, able to reach all of ``reaching``; ``motion`` is the step's class."""

    name: str
    motion: str
    place: PlaceUse | StepResult
    reaching: tuple[PlaceUse | Thing | Resting, ...]
    attempts: int
    body: Series
    label: str | None = None


@dataclass(frozen=True, slots=True)
class Parallel:
    """Named branches that run in parallel."""

    branches: tuple[tuple[str, Node], ...]


@dataclass(frozen=True, slots=True)
class Alternatives:
    """Named branches, each tried if those before it failed; ``name``, ``step``, ``label`` as in Perform."""

    name: str
    branches: tuple[tuple[str, Node], ...]
    step: str = ""
    label: str | None = None


@dataclass(frozen=True, slots=True)
class PartialOrder:
    """Named branches and the transitive reduction of their order, as pairs (before, after) of names."""

    branches: tuple[tuple[str, Node], ...]
    orderings: tuple[tuple[str, str], ...]


@dataclass(frozen=True, slots=True)
class Series:
    """Nodes in sequence."""

    nodes: tuple[Node, ...]


@dataclass(frozen=True, slots=True)
class Event:
    """The beginning or the end of a step that overlaps others.

    ``moment`` is "begins" or "ends", or "is ready to begin" or "is ready to end" for steps that do so together.
    """

    step: str
    moment: str


@dataclass(frozen=True, slots=True)
class Gate:
    """Run the body after certain events, count as ended after further ones, and signal events of its own."""

    name: str
    opens: tuple[Event | tuple[Event, ...], ...]
    """Before the body, in order: an own event to signal, or events of others to wait for."""
    body: Node
    closes: tuple[Event | tuple[Event, ...], ...]
    """After the body, likewise."""
    overlaps: str = ""
    """Overlaps of the step, in words."""


@dataclass(frozen=True, slots=True)
class Case:
    """Transition for an outcome of a state; ``is_failure`` if the outcome is the name of a failure class."""

    state: str
    outcome: str
    target: str
    is_failure: bool = False


@dataclass(frozen=True, slots=True)
class State:
    """A state: its body, and the outcome that it returns.

    With ``checks`` the outcome is "false" if the body's result is False, else "true". If the result is one of
    ``outcomes``, it is the outcome. Otherwise it is "done". ``keeps`` are names under which other states find the
    result.
    """

    name: str
    body: Node
    checks: bool = False
    outcomes: tuple[str, ...] = ()
    keeps: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Machine:
    """States and the transitions between them."""

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
    | Turn
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
    """All functions of a plan, callees before their callers, the task last."""

    functions: tuple[Function, ...]
    devices: tuple[tuple[str, Thing], ...] = ()
    """Pairs (IRI of a place, the device that all its uses reach it with)."""
    classes: tuple[tuple[str, tuple[str, ...]], ...] = ()
    """Action classes outside the bundled vocabulary with their direct superclasses; superclasses come first."""


def inside(node: Node) -> tuple[Node, ...]:
    """Direct children of a node, in textual order."""
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


class DataFlow:
    """Results that each node of a function's body produces and uses. Nodes are distinguished by identity."""

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
        """Steps (IRIs) inside a node whose results are used outside it."""
        if self._is_plain:
            return ()
        used = self._used[id(node)]
        return tuple(step for step in self._made[id(node)] if self._total[step] > used[step])

    def needed(self, node: Node, made_by: Node) -> bool:
        """True if a node uses the result of a step inside another one."""
        if self._is_plain:
            return False
        return any(self._used[id(node)][step] for step in self._made[id(made_by)])

    def events(self, series: Series) -> tuple[Event, ...]:
        """Events that occur in a series, but not only in one nested series."""
        return tuple(self._home.get(id(series), ()))

    def _walk(self, node: Node, total: Counter[Event]) -> None:
        produced: dict[str, None] = {}
        used: Counter[str] = Counter(_passed(node))
        events: Counter[Event] = Counter(_events(node) if isinstance(node, Gate) else ())
        if isinstance(node, (Perform, Call, Alternatives)):
            produced[node.step] = None
        for inner in inside(node):
            self._walk(inner, total)
            produced.update(self._made[id(inner)])
            used.update(self._used[id(inner)])
            events.update(self._events[id(inner)])
        self._made[id(node)], self._used[id(node)], self._events[id(node)] = produced, used, events
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


def uses_latest_products(body: Node) -> bool:
    """True if a node, or one inside it, uses results of earlier states of a machine."""
    return any(isinstance(value, LatestProduct) for node in _all(body) for value in _values(node))


def uses_of_classes(tree: PlanTree) -> Counter[str]:
    """Count the uses of each action class, not counting its own declaration; uses that rule out an inline one count
    twice.
    """
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
    """Yield the classes of described situations."""
    if isinstance(value, Described):
        yield value.type
        yield from (one for _, fillers in value.properties for inner in fillers for one in _situations(inner))


def uses_of_places(body: Node) -> Counter[str]:
    """Count how often a function refers to each place (IRI)."""
    uses: Counter[str] = Counter()
    for node in _all(body):
        for value in _values(node):
            uses.update(_places(value))
        for where in node.reaching if isinstance(node, Scope) else ():
            if isinstance(where, PlaceUse):
                uses.update(_places(where))
    return uses


def _places(value: Value) -> Iterator[str]:
    """Yield the places (IRIs) that a value refers to, directly or through other places."""
    match value:
        case PlaceUse(place):
            yield from (one.iri for one in place.places())
        case StepResult(_, otherwise) | LatestProduct(_, otherwise):
            yield from _places(otherwise)
        case Described(_, properties):
            yield from (place for _, fillers in properties for inner in fillers for place in _places(inner))


def uses_of_recoveries(body: Node) -> Counter[tuple[Recover, ...]]:
    """Count how often a function handles failures with the same recoveries."""
    return Counter(node.recoveries for node in _all(body) if isinstance(node, Handle))


def uses_of_features(body: Node) -> Counter[Part]:
    """Count how often a function refers to each feature; constraints with the same two features count once."""
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
    return (value.producer for value in _values(node) if isinstance(value, StepResult))


def _values(node: Node) -> Iterator[Value]:
    """Yield the values that a node itself passes to actions, calls and places."""
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
