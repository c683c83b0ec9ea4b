"""The plan tree: what a recipe is lowered to and what the source is written from."""

from __future__ import annotations

from dataclasses import dataclass

from planlang.language.strategies import Strategy
from planlang.recipe.model import Name, Place, Thing


@dataclass(frozen=True, slots=True)
class PlaceUse:
    """A place as a function uses it: the place, and the function's own things that stand for those it names."""

    place: Place
    arguments: tuple[Thing, ...]


@dataclass(frozen=True, slots=True)
class Described:
    """A situation of a class (IRI, local name if of the vocabulary) in which properties are filled, in snake case."""

    type: str
    properties: tuple[tuple[str, tuple[Value, ...]], ...]


@dataclass(frozen=True, slots=True)
class Passed:
    """The result of an earlier step (IRI), or ``otherwise`` if that is not of the right kind."""

    producer: str
    otherwise: Thing | PlaceUse | Name | str | int | float | bool


@dataclass(frozen=True, slots=True)
class Kept:
    """The last value that states have made under a name, or ``otherwise`` if it is not of the right kind."""

    name: str
    otherwise: Thing | PlaceUse | Name | str | int | float | bool


Value = Thing | PlaceUse | Described | Passed | Kept | Name | str | int | float | bool
"""A filler of a property of an action in a plan."""


@dataclass(frozen=True, slots=True)
class ActionTerm:
    """An action designator: class (local name of the vocabulary) and properties in snake case.

    A property may have several fillers.
    """

    type: str
    properties: tuple[tuple[str, tuple[Value, ...]], ...]


@dataclass(frozen=True, slots=True)
class Perform:
    """Perform a primitive or abstract action; ``name`` is the step's class, ``label`` what it says in words.

    ``step`` is the IRI of the step, by which others refer to its result.
    """

    name: str
    action: ActionTerm
    label: str | None = None
    step: str = ""


@dataclass(frozen=True, slots=True)
class FunctionCall:
    """Call the plan function of a recipe (IRI) with things for some of its parameters."""

    recipe: str
    arguments: tuple[tuple[Thing, Thing | Passed | Kept], ...]
    """Pairs (parameter of the called function, thing of the caller)."""


@dataclass(frozen=True, slots=True)
class Call:
    """Perform a step that has a recipe, or several as alternatives.

    ``action`` is None where only the recipe may perform the step, because a process module for its class would
    perform less than the recipe says.
    """

    name: str
    action: ActionTerm | None
    calls: tuple[FunctionCall, ...]
    step: str = ""


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
    """One recovery: failure class, strategy and what it is about, how often, and what to raise then."""

    failure: str
    strategy: Strategy
    about: Thing | None
    attempts: int
    otherwise: str | None


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
    """Run the body where the base is at ``place`` and can reach all of ``reaching``."""

    name: str
    place: PlaceUse | Passed
    reaching: tuple[PlaceUse | Thing, ...]
    attempts: int
    body: Series
    label: str | None = None


@dataclass(frozen=True, slots=True)
class Parallel:
    """Named branches side by side: nothing orders one with another."""

    branches: tuple[tuple[str, Node], ...]


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

    ``moment`` says which: "begins", "ends", or for those that happen together "is ready to begin", "is ready to end".
    """

    step: str
    moment: str


@dataclass(frozen=True, slots=True)
class Gate:
    """Run the body when events have happened, and count as ended when further ones have; tell others of its own."""

    name: str
    opens: tuple[Event | tuple[Event, ...], ...]
    """Before the body, in order: an event of its own to tell, or events of others to wait for."""
    body: Node
    closes: tuple[Event | tuple[Event, ...], ...]
    """After the body, likewise."""
    said: str = ""
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


Node = Perform | Call | Achieve | Handle | Hold | Scope | Parallel | PartialOrder | Series | Gate | Machine


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
