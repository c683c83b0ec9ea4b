"""The plan tree: what a recipe is lowered to and what the source is written from."""

from __future__ import annotations

from dataclasses import dataclass

from planlang.recipe.model import Name, Place, Thing


@dataclass(frozen=True, slots=True)
class PlaceUse:
    """A place as a function uses it: the place, and the function's own things that stand for those it names."""

    place: Place
    arguments: tuple[Thing, ...]


Value = Thing | PlaceUse | Name | str | int | float | bool
"""What fills a property of an action in a plan."""


@dataclass(frozen=True, slots=True)
class ActionTerm:
    """An action designator: class (local name of the vocabulary) and properties in snake case.

    A property may have several fillers.
    """

    type: str
    properties: tuple[tuple[str, tuple[Value, ...]], ...]


@dataclass(frozen=True, slots=True)
class Perform:
    """Perform a primitive or abstract action; ``name`` is the step's class, ``label`` what it says in words."""

    name: str
    action: ActionTerm
    label: str | None = None


@dataclass(frozen=True, slots=True)
class FunctionCall:
    """Call the plan function of a recipe (IRI) with things for some of its parameters."""

    recipe: str
    arguments: tuple[tuple[Thing, Thing], ...]
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
    """One recovery: failure class, strategy function and what it is about, how often, and what to raise then."""

    failure: str
    strategy: str
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
    place: PlaceUse
    reaching: tuple[PlaceUse | Thing, ...]
    attempts: int
    body: Series
    label: str | None = None


@dataclass(frozen=True, slots=True)
class Unordered:
    """Steps that are not totally ordered: named branches and the (before, after) pairs that hold among them."""

    branches: tuple[tuple[str, Node], ...]
    orderings: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True, slots=True)
class Series:
    """Nodes one after another."""

    nodes: tuple[Node, ...]


Node = Perform | Call | Achieve | Handle | Hold | Scope | Unordered | Series


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
