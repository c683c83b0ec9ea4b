"""The model of a recipe, the same for all dialects.

A recipe consists of steps and four kinds of statements about them, which refer to steps by IRI:

* ``orderings``: one step ends before another begins. This covers the interval relations "before" and "meets", because
  a plan does not measure the gap between steps.
* ``overlaps``: any other relation of two intervals. It constrains when the steps begin and end relative to each other
  (:meth:`Overlap.endpoints`), so they have to run in parallel, and one waits for events of the other. One of the two
  may be the recipe itself: a step that starts it begins no later than any other step, and one that finishes it ends no
  earlier. An order of steps that follows from overlaps is also among the orderings, with reason OVERLAP.
* ``flows``: one step makes or finds what another one uses. Every flow that orders its steps is also an ordering with
  reason DATA_FLOW, so ``orderings`` is complete; the flow adds which resource is passed.
* ``machine``: the steps are states, connected by transitions for the different ways in which a step can end. Then
  ``orderings`` and ``overlaps`` are empty, every state is a step, and a state may be visited any number of times.

A step is a class of actions, or an individual of one: ``iri`` names the step, ``action_class`` is its class. Two steps
of a recipe may be individuals of the same class. Use ``action_class`` for lookups in the taxonomy.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import field
from enum import Enum
from typing import Any, NamedTuple

from planlang.designators import local_name
from planlang.diagnostics import Span
from planlang.kept import kept
from planlang.motion_constraints import ConstraintKind, Speed
from planlang.ontology.documents import Syntax
from planlang.records import dataclass


class _Named:
    """Something that has an IRI."""

    __slots__ = ()
    iri: str

    @property
    def name(self) -> str:
        """Its local name."""
        return local_name(self.iri)


class _Action(_Named):
    """A task or a step: a class of actions, or an individual of one."""

    __slots__ = ()
    cls: str | None
    parameters: tuple[Parameter, ...]

    @property
    def action_class(self) -> str:
        """Class of actions (IRI) that the action is, or is an individual of."""
        return self.cls or self.iri

    def fillers(self, property_name: str) -> tuple[Filler, ...]:
        """Fillers of a property of the action itself, in the order of the file."""
        return tuple(parameter.filler for parameter in self.parameters if parameter.property == property_name)


@dataclass(frozen=True, slots=True)
class Dialect:
    """A way of writing recipes: a short name, and a description of the statements in such a recipe."""

    name: str
    parts: str


INTERSECTION = Dialect("D1", "a class below an intersection of restrictions on subAction and orderingConstraints")
FLAT = Dialect("D1f", "a class below such restrictions, each stated by itself")
EQUIVALENT = Dialect("D1e", "a class equivalent to an intersection of such restrictions")
SUB_EVENTS = Dialect("D2", "a class with restrictions on subEvents in the place of subAction")
FINITE_STATE = Dialect("D3", "a class with states and stateTransitions between them")
ACTION_TABLE = Dialect("D4", "individuals chained by nextAction")
WORKFLOW = Dialect("D5", "individuals that a workflow has by hasStep, related as intervals")


class Kind(Enum):
    """How the robot treats a thing."""

    OBJECT = "object"
    PERSON = "person"
    DEVICE = "device"
    PLACE = "place"
    """A place, or a thing that stands for one; only for parameters of a plan."""
    NUMBER = "number"
    """A number, such as a duration; only for slots."""


class Absence(Enum):
    """Meaning of an empty slot; the values are the OWL properties that declare slots."""

    ERROR = "mustState"
    PARAMETER = "requires"
    """The filler is a parameter of the plan."""
    CONSTRAINED = "requiresIfConstrained"
    """The filler becomes a parameter of the plan if a motion constraint refers to it."""
    EXPECTED = "expects"
    """The action works without a filler, but a recipe should state one."""
    ALLOWED = "accepts"


@dataclass(frozen=True, slots=True)
class Slot:
    """A property (local name) of actions, the kinds of its fillers, and the meaning of a missing filler."""

    property: str
    kinds: tuple[Kind, ...]
    absence: Absence
    is_shared: bool = False
    """True if a step without a filler takes all fillers of the step around it."""


@dataclass(frozen=True, slots=True)
class Thing:
    """An object, a person or a device: the individual ``iri``, or any instance of its class if ``iri`` is None.

    ``type`` is the nearest class of the vocabulary (local name), ``stated`` the class that the recipe names (IRI). With
    ``owner``, the name of an action, the thing is a parameter: the caller provides the filler of ``slot``.
    """

    kind: Kind
    type: str
    iri: str | None = None
    stated: str = ""
    owner: str | None = None
    slot: Slot | None = None
    where: tuple[tuple[str, Thing], ...] = ()
    """Relations (keys of :data:`planlang.relations.RELATIONS`) in which an instance of the class has to stand to things
    when it is chosen."""

    @property
    def name(self) -> str:
        """Local name of the individual, or of the class if anonymous; for a parameter the path of its slot."""
        if self.slot is not None:
            return f"{self.owner}.{self.slot.property}"
        return local_name(self.iri or self.stated or self.type)


@dataclass(frozen=True, slots=True)
class Place(_Named):
    """A location designator: poses that stand in ``relations`` to things and other places.

    ``relations`` holds pairs (key of :data:`planlang.relations.RELATIONS`, references) in the order of the file.
    Without relations it is a named posture of the robot, or one ``pose`` in the map: x, y, z [m] and heading [rad].
    """

    iri: str
    relations: tuple[tuple[str, tuple[Thing | Place, ...]], ...] = ()
    label: str | None = None
    pose: tuple[float, float, float, float] | None = None

    @property
    def is_posture(self) -> bool:
        """True for a named posture of the robot or a fixed pose, which refer to nothing."""
        return not self.relations

    def references(self) -> Iterator[Thing | Place]:
        """Yield what the relations refer to, in their order."""
        for _, references in self.relations:
            yield from references

    def places(self) -> Iterator[Place]:
        """Yield the place itself and all places that it refers to, also through other places."""
        yield self
        for reference in self.references():
            if isinstance(reference, Place):
                yield from reference.places()

    def things(self) -> Iterator[Thing]:
        """Yield all things that the place refers to, also through other places; may repeat a thing."""
        for reference in self.references():
            if isinstance(reference, Thing):
                yield reference
            else:
                yield from reference.things()

    def changeable(self) -> tuple[Thing, ...]:
        """Things that a plan can replace by others: all that the place refers to except devices, each once."""
        return tuple(dict.fromkeys(thing for thing in self.things() if thing.kind is not Kind.DEVICE))


@dataclass(frozen=True, slots=True)
class Name(_Named):
    """A filler that is neither a thing nor a place, for example a policy."""

    iri: str


@dataclass(frozen=True, slots=True)
class Part:
    """A part of a thing, or with an empty path the thing itself.

    ``path`` holds the classes of the nested parts, outermost first: local names of the vocabulary, else IRIs; an
    individual has its IRI. ``held_by`` is the device that holds the thing, if that identifies it.
    """

    of: Thing
    path: tuple[str, ...] = ()
    held_by: Thing | None = None

    @property
    def name(self) -> str:
        """Local name of the part itself."""
        return local_name(self.path[-1]) if self.path else self.of.name


@dataclass(frozen=True, slots=True)
class Constraint(_Named):
    """A constraint of a motion: the class ``iri`` of constraints, or an individual.

    ``template`` is the class (IRI) that states its features, itself or an ancestor; ``label`` describes that class.
    Limits are lengths [m] or cosines, depending on ``kind``; None means unlimited.
    """

    iri: str
    template: str
    kind: ConstraintKind
    tool: Part
    world: Part
    lower: float | None = None
    upper: float | None = None
    weight: float = 1.0
    speed: Speed | None = None
    frame: str | None = None
    label: str | None = None


Filler = Thing | Place | Part | Constraint | Name | str | int | float | bool


@dataclass(frozen=True, slots=True)
class Parameter:
    """A property of an action and its filler. ``property`` is a local name of the vocabulary, else an IRI.

    ``is_inherited`` if the action itself states no filler: it comes from the action around it, or is a parameter.
    """

    property: str
    filler: Filler
    span: Span | None = None
    is_inherited: bool = False
    number: int = 1
    """Number of different things of the class, for each of which the action is performed once."""


@dataclass(frozen=True, slots=True)
class Description:
    """Any situation of a class (``type``, an IRI) with these parameters.

    If ``type`` is an individual, it is that situation itself.
    """

    type: str
    parameters: tuple[Parameter, ...] = ()

    @property
    def name(self) -> str:
        """Local name of the class or individual."""
        return local_name(self.type)


@dataclass(frozen=True, slots=True)
class Step(_Action):
    """One sub-action of a recipe.

    ``action`` is the nearest class of the vocabulary (local name); ``recipes`` are the classes or individuals (IRIs)
    whose recipes perform the step, more than one if they are alternatives; ``primitive`` is the class (IRI) listed as
    a primitive. A step that has neither is abstract. ``cls`` is the class of a step that is an individual, None for
    one that is a class itself. ``condition`` describes what a checking step evaluates to true or false. ``is_choice``
    marks a union of alternatives: then each of ``recipes`` has one step.
    """

    iri: str
    action: str
    parameters: tuple[Parameter, ...] = ()
    recipes: tuple[str, ...] = ()
    primitive: str | None = None
    label: str | None = None
    span: Span | None = None
    cls: str | None = None
    condition: Description | None = None
    is_choice: bool = False

    @property
    def times(self) -> int:
        """Number of performances, each about another thing."""
        return max((one.number for one in self.parameters if not one.is_inherited), default=1)

    @property
    def is_abstract(self) -> bool:
        """True if nothing performs the step."""
        return not self.recipes and self.primitive is None


class Reason(Enum):
    """The reason why one step comes before another."""

    CONSTRAINT = "ordering constraint"
    DATA_FLOW = "data flow"
    OVERLAP = "overlap"


class Ordering(NamedTuple):
    """``before`` comes before ``after``; both are IRIs of steps. ``iri`` names the constraint."""

    before: str
    after: str
    iri: str | None = None
    reason: Reason = Reason.CONSTRAINT
    span: Span | None = None


class Allen(Enum):
    """Relations of two overlapping intervals, after J. F. Allen (1983); for an inverse, exchange the two intervals."""

    OVERLAPS = "overlaps"
    DURING = "during"
    STARTS = "starts"
    FINISHES = "finishes"
    EQUALS = "equals"


class Point(NamedTuple):
    """The beginning or the end of a step (IRI)."""

    step: str
    is_end: bool


_ENDPOINTS = {
    Allen.OVERLAPS: "b1<b2 b2<e1 e1<e2",
    Allen.DURING: "b2<b1 e1<e2",
    Allen.STARTS: "b1=b2 e1<e2",
    Allen.FINISHES: "b2<b1 e1=e2",
    Allen.EQUALS: "b1=b2 e1=e2",
}
"""Each relation as constraints on the beginnings and ends (b, e) of the first and the second interval."""


@dataclass(frozen=True, slots=True)
class Overlap:
    """``first`` stands in ``relation`` to ``second``: two different IRIs of steps, or of the recipe itself."""

    first: str
    relation: Allen
    second: str
    span: Span | None = None

    def endpoints(self) -> Iterator[tuple[Point, bool, Point]]:
        """Yield the relation as constraints on points: (point, True if strictly before or False if together, other
        point).

        In a plan the later point happens only after the earlier one has. Two points that coincide happen only when both
        can: steps begin together, and neither counts as ended before the other.
        """
        ends = {"b1": Point(self.first, False), "e1": Point(self.first, True)}
        ends |= {"b2": Point(self.second, False), "e2": Point(self.second, True)}
        for one in _ENDPOINTS[self.relation].split():
            yield ends[one[:2]], one[2] == "<", ends[one[3:]]


@dataclass(frozen=True, slots=True)
class Flow:
    """``producer`` makes or finds what ``consumer`` uses; both are IRIs of steps.

    ``resource`` is the individual or class (IRI) that is passed, None if unstated. ``consumes`` is the property of the
    consumer that it fills (local name of the vocabulary, else an IRI; also among the consumer's parameters), None if no
    property fits: then the flow only orders. ``iri`` names the constraint that states it.
    """

    producer: str
    consumer: str
    resource: str | None = None
    consumes: str | None = None
    iri: str | None = None
    span: Span | None = None


class Ending(Enum):
    """How a state ended, as far as transitions distinguish it.

    DONE: its step was performed. TRUE and FALSE: result of the step's ``condition``. FAILED: its step failed.
    OTHER: the step returned the name of the outcome.
    """

    DONE = "completed"
    TRUE = "condition true"
    FALSE = "condition false"
    FAILED = "failed"
    OTHER = "other"


@dataclass(frozen=True, slots=True)
class Transition:
    """A change from one state (IRI of a step) to another if the first ends with ``outcome`` (IRI), meaning ``ending``.

    Without outcome (None, ending DONE) the transition is taken whenever the step succeeded.
    """

    source: str
    target: str
    ending: Ending = Ending.DONE
    outcome: str | None = None
    iri: str | None = None
    span: Span | None = None


@dataclass(frozen=True, slots=True)
class StateMachine:
    """States (IRIs of the recipe's steps) and transitions, in the order of the file.

    The machine begins in ``start`` and is done after the step of one of ``ends`` has been performed.
    """

    start: str
    ends: tuple[str, ...]
    transitions: tuple[Transition, ...]


@dataclass(frozen=True, slots=True)
class Recipe(_Action):
    """A task: its steps in the order of the file, and the stated and implied relations among them.

    ``iri`` is the class of the task, or an individual; then ``cls`` is its class.
    """

    iri: str
    action: str
    steps: tuple[Step, ...]
    orderings: tuple[Ordering, ...] = ()
    parameters: tuple[Parameter, ...] = ()
    label: str | None = None
    span: Span | None = None
    dialect: Dialect = INTERSECTION
    overlaps: tuple[Overlap, ...] = ()
    flows: tuple[Flow, ...] = ()
    machine: StateMachine | None = None
    cls: str | None = None
    phases: tuple[str, ...] = ()
    """Processes (IRIs) to which steps are related in time, but which nothing performs."""
    within: str | None = None
    """Recipe (IRI) with the choice that this recipe is one alternative of; then its only step is that alternative.

    For choices within choices it is the outermost recipe, the only one of them that the file states.
    """
    syntax: Syntax | None = field(default=None, repr=False, compare=False)
    """Syntax of its file, in which advice is written."""
    kept: dict[object, Any] = field(default_factory=dict, init=False, repr=False, compare=False)
    """Results of functions (:func:`planlang.kept.kept`)."""

    def step(self, iri: str) -> Step:
        """Step with this IRI. Raises KeyError if there is none."""
        return _steps_of(self)[iri]


@kept
def _steps_of(recipe: Recipe) -> dict[str, Step]:
    return {step.iri: step for step in reversed(recipe.steps)}


@dataclass(frozen=True, slots=True)
class Source:
    """File that a recipe was read from: its name without folders, and the SHA-256 of its bytes."""

    file: str
    sha256: str


@dataclass(frozen=True, slots=True)
class RecipeSet:
    """A task and the recipes below it, the task first, then in order of first use."""

    task: str
    recipes: Mapping[str, Recipe]
    source: Source

    @property
    def main(self) -> Recipe:
        """The recipe of the task itself."""
        return self.recipes[self.task]
