"""The recipe model: what a recipe says, whatever dialect it was written in."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from enum import Enum

from planlang.designators import local_name
from planlang.diagnostics import Span


class Kind(Enum):
    """What a thing is for the robot."""

    OBJECT = "object"
    PERSON = "person"
    DEVICE = "device"


@dataclass(frozen=True, slots=True)
class Thing:
    """An object, a person or a device: the individual ``iri``, or any of its class when ``iri`` is None.

    ``type`` is the nearest class of the vocabulary (local name), ``stated`` the class that the recipe wrote (IRI).
    """

    kind: Kind
    type: str
    iri: str | None = None
    stated: str = ""

    @property
    def name(self) -> str:
        """Local name of the individual, or of the class when anonymous."""
        return local_name(self.iri or self.stated or self.type)


@dataclass(frozen=True, slots=True)
class Place:
    """A location designator: poses that stand in ``relations`` to things and other places.

    Without relations it is a named posture of the robot. ``relations`` holds pairs (key of
    :data:`planlang.designators.RELATIONS`, reference) in the order of the file.
    """

    iri: str
    relations: tuple[tuple[str, Thing | Place], ...] = ()
    label: str | None = None

    @property
    def name(self) -> str:
        """Local name of the designator."""
        return local_name(self.iri)

    @property
    def is_posture(self) -> bool:
        """True for a named posture of the robot's own."""
        return not self.relations

    def things(self) -> Iterator[Thing]:
        """All things that the place refers to, also through other places; may repeat."""
        for _, reference in self.relations:
            if isinstance(reference, Thing):
                yield reference
            else:
                yield from reference.things()


@dataclass(frozen=True, slots=True)
class Name:
    """A filler that is neither thing nor place, e.g. a policy."""

    iri: str


Filler = Thing | Place | Name | str | int | float | bool


@dataclass(frozen=True, slots=True)
class Parameter:
    """A property of an action and what fills it. ``property`` is a local name of the vocabulary, else an IRI."""

    property: str
    filler: Filler
    span: Span | None = None


@dataclass(frozen=True, slots=True)
class Step:
    """One sub-action of a recipe.

    ``action`` is the nearest class of the vocabulary (local name); ``recipes`` are the classes (IRIs) whose recipes
    perform the step, more than one if they are alternatives; ``primitive`` is the class (IRI) listed as a
    primitive. A step that has neither is abstract.
    """

    iri: str
    action: str
    parameters: tuple[Parameter, ...] = ()
    recipes: tuple[str, ...] = ()
    primitive: str | None = None
    label: str | None = None
    span: Span | None = None

    @property
    def name(self) -> str:
        """Local name of the step's class."""
        return local_name(self.iri)

    def fillers(self, property_name: str) -> tuple[Filler, ...]:
        """What fills a property, in the order of the file."""
        return tuple(parameter.filler for parameter in self.parameters if parameter.property == property_name)

    @property
    def is_abstract(self) -> bool:
        """True if nothing performs the step."""
        return not self.recipes and self.primitive is None


class Reason(Enum):
    """Why one step comes before another."""

    CONSTRAINT = "ordering constraint"
    DATA_FLOW = "data flow"
    SCOPE = "location scope"


@dataclass(frozen=True, slots=True)
class Ordering:
    """``before`` comes before ``after``; both are IRIs of step classes. ``iri`` names the constraint."""

    before: str
    after: str
    iri: str | None = None
    reason: Reason = Reason.CONSTRAINT
    span: Span | None = None


@dataclass(frozen=True, slots=True)
class Recipe:
    """A task: its steps in the order of the file, and the orderings that the file states or implies."""

    iri: str
    action: str
    steps: tuple[Step, ...]
    orderings: tuple[Ordering, ...] = ()
    parameters: tuple[Parameter, ...] = ()
    label: str | None = None
    span: Span | None = None
    dialect: str = "D1"

    @property
    def name(self) -> str:
        """Local name of the task's class."""
        return local_name(self.iri)

    def step(self, iri: str) -> Step:
        """The step of a class; KeyError if it is no step."""
        for step in self.steps:
            if step.iri == iri:
                return step
        raise KeyError(iri)

    def fillers(self, property_name: str) -> tuple[Filler, ...]:
        """What fills a property of the task itself."""
        return tuple(parameter.filler for parameter in self.parameters if parameter.property == property_name)


@dataclass(frozen=True, slots=True)
class Source:
    """The file a recipe was read from: its name without folders, and the sha256 of its bytes."""

    file: str
    sha256: str


@dataclass(frozen=True, slots=True)
class RecipeSet:
    """A task and the recipes below it, the task first, then in the order in which they are first used."""

    task: str
    recipes: Mapping[str, Recipe]
    source: Source

    @property
    def main(self) -> Recipe:
        """The recipe of the task itself."""
        return self.recipes[self.task]
