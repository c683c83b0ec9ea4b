"""Scripts: the behaviour of process modules in a test, so that plans run without a robot."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import field, fields
from typing import Any

from planlang.changes import Change, Output, Transformed
from planlang.designators import Action, Condition, Location, Object
from planlang.faults.steps import Fault, Raises
from planlang.geometry import Pose
from planlang.misuse import Usage
from planlang.records import dataclass
from planlang.state import Made, Matter, Portion, WorldState, apply
from planlang.state.matter import ON, PUDDLE, ROUNDING, Rules
from planlang.state.questions import Point, came_to_be, contains, is_baked

Base = tuple[float, float, float]
"""Pose of the base: x, y [m], yaw [rad]."""


HANDS = 2
"""Number of hands of a scripted robot."""
ROOM, NOWHERE = "room", Pose((0.0, 0.0, 0.0))
"""What a scripted world has of geometry: everything is in one room, and in the same place."""
AT_ALL = 2 * ROUNDING
"""Time for which a side has been heated at all [s]: no class has a baking time in a scripted world."""


class WithoutPlaces:
    """Implements :class:`planlang.state.Queries` for a scripted world, in which nothing is below or above another."""

    rules = Rules()

    def thing(self, name: str) -> Made:
        """Describe an object, whose name stands for its class."""
        return Made(name, PUDDLE, NOWHERE)

    def pose(self, state: WorldState, name: str) -> Pose:
        """Locate an object where all are."""
        return NOWHERE

    def under(self, state: WorldState, name: str) -> None:
        """Find nothing, as :meth:`below`, :meth:`rest` and :meth:`heated_by` do."""

    def below(self, state: WorldState, point: Point, but: str) -> tuple[None, float]:
        """Find nothing."""
        return None, 0.0

    def rest(self, state: WorldState, name: str) -> None:
        """Find nothing."""

    def heated_by(self, state: WorldState, name: str) -> None:
        """Find nothing."""


@dataclass
class Belief:
    """Belief state of the scripted robot, which is also the true state of its world; compared by value.

    Objects are named by the local name of their individual, or of their class. Rules of a script may read and change
    the belief; every change of held objects, places, facts or other effects makes a new revision.
    """

    holding: list[str] = field(default_factory=list)
    """Names of the objects that the robot holds."""
    at: dict[str, Any] = field(default_factory=dict)
    """Places of objects that are not held: the support on which they were put, or the person to whom they were handed;
    or any value set by the test, ``belief.at["bottle1"] = "table"``."""
    facts: dict[str, bool] = field(default_factory=dict)
    """Other conditions by their text, e.g. ``"open(fridge1)"``."""
    places: dict[str, Sequence[Base]] = field(default_factory=dict)
    """Base poses by the name of a location or of its reference object; three are generated for other locations."""
    base: Base = (0.0, 0.0, 0.0)
    around: str | None = None
    """The object between the open fingers, ready to be grasped."""
    lowered: dict[str, str] = field(default_factory=dict)
    """Places to which held objects were lowered, before the hand opens."""
    contents: dict[str, dict[str, float]] = field(default_factory=dict)
    """Substances in and on objects [ml]: ``belief.contents["bowl1"] = {"Milk": 200.0}``."""
    heated: dict[str, tuple[float, float]] = field(default_factory=dict)
    """Heating times of the two sides of objects [s]."""
    made: dict[str, list[str]] = field(default_factory=dict)
    """Created objects, each with the objects that it was made of."""
    gone: list[str] = field(default_factory=list)
    """Destroyed objects."""
    on: list[str] = field(default_factory=list)
    """Devices that are switched on."""

    def __post_init__(self) -> None:
        self._revision = 0
        self._last_state = self._state()
        self.made_up: dict[str, list[Base]] = {}
        """Generated base poses, by location."""

    def tables(self) -> dict[str, Any]:
        """Return what changes in a run, by name, to be stored; the places that the script states are left out."""
        changing = {field.name: getattr(self, field.name) for field in fields(self) if field.name != "places"}
        return {**changing, "made_up": self.made_up}

    def restore(self, tables: Mapping[str, Any], revision: int) -> None:
        """Restore an earlier belief from its :meth:`tables`; a rule's own references to the held objects stay valid."""
        self.holding[:] = tables["holding"]
        for name in self.tables().keys() - {"holding"}:
            setattr(self, name, tables[name])
        self._last_state, self._revision = self._state(), revision

    @property
    def revision(self) -> int:
        """Number of changes."""
        state = self._state()
        if state != self._last_state:
            self._last_state = state
            self._revision += 1
        return self._revision

    def holds(self, condition: Condition) -> bool:
        """Evaluate a condition: a fact if there is one, otherwise by the state of the objects.

        ``holding(x)`` always depends on the held objects. ``baked`` compares the heating time of the side that was
        heated less; without seconds, it holds if both sides were heated.
        """
        if str(condition) in self.facts and condition.predicate != "holding":
            return self.facts[str(condition)]
        arguments: list[Any] = [getattr(what, "name", what) for what in condition.arguments or ("",)]
        first, *others = arguments
        state, queries = self._world(), WithoutPlaces()
        match condition.predicate:
            case "hand_free":
                return len(self.holding) < HANDS
            case "holding":
                return first in self.holding and all(what in self.holding for what in others)
            case "located" if others:
                place = self.at.get(others[0])
                return place is not None and place in (first, *names_of(condition.arguments[0]))
            case "contains":
                return contains(state, first, others[0], queries, *others[1:])
            case "baked":
                return is_baked(state, first, queries, others[0] if others else AT_ALL)
            case "switched_on":
                return state.matter.is_on(first)
            case "destroyed":
                return first in state.matter.gone
            case "created":
                return bool(came_to_be(state, first, queries))
            case "transformed_into":
                return first in state.matter.went_into(others[0])
        return False

    def destroy(self, *things: str) -> None:
        """Remove objects from the world."""
        self.happens(Transformed(tuple((thing, 0.0) for thing in things), (), (), None), *things)

    def create(self, thing: str, *of: str) -> None:
        """Create an object from others, which are destroyed."""
        self.happens(Transformed(tuple((one, 0.0) for one in of), (), (Output(thing, thing, None),), ROOM), *of)

    def happens(self, change: Change, *things: str) -> None:
        """Apply a change as the simulator does, but without poses; ``things`` are those that it needs to be there."""
        after = apply(change, self._world(ROOM, *things), WithoutPlaces())[0].matter
        self.contents = {
            name: {one.type: one.amount for one in content.values()} for name, content in after.contents.items()
        }
        self.made = {name: list(origins) for name, origins in after.origins.items()}
        self.gone[:], self.on[:] = after.gone, filter(after.is_on, after.states)
        for thing in filter(after.gone.__contains__, things):
            self.drop(thing)

    def _world(self, *things: str) -> WorldState:
        """What objects contain and were made of, and which devices are on, as the simulator has it.

        Of objects, created ones are there, and ``things``.
        """
        contents = {
            name: {type: Portion(type, amount) for type, amount in content.items()}
            for name, content in self.contents.items()
        }
        origins = {name: tuple(origins) for name, origins in self.made.items()}
        states, gone = dict.fromkeys(self.on, ON), dict.fromkeys(self.gone)
        matter = Matter(contents, self.heated, states, origins=origins, gone=gone)
        there = (*things, *(name for name in self.made if name not in gone))
        return WorldState({}, dict.fromkeys(there, NOWHERE), matter=matter)

    def hold(self, what: str | None) -> None:
        """Hold an object, which then has no place."""
        if what is not None and what not in self.holding:
            self.holding.append(what)
            self.at.pop(what, None)

    def drop(self, what: str | None = None) -> None:
        """Release an object, or all; its place is the one to which it was lowered, if any."""
        for held in [held for held in self.holding if what in (None, held)]:
            self.holding.remove(held)
            if held in self.lowered:
                self.at[held] = self.lowered.pop(held)

    def places_of(self, location: Location) -> Sequence[Base]:
        """Base poses for a location, best first."""
        for name in (location.name, *names_of(location), str(location)):
            if name is not None and name in self.places:
                return self.places[name]
        generated = self.made_up
        if str(location) not in generated:
            x = 10.0 * (len(generated) + 1)
            generated[str(location)] = [(x, 0.0, 0.0), (x + 1, 0.0, 0.0), (x + 2, 0.0, 0.0)]
        return generated[str(location)]

    def put(self, what: str, place: str) -> None:
        """Put an object somewhere; a held one is there when it is released."""
        (self.lowered if what in self.holding else self.at)[what] = place

    def _state(self) -> tuple[object, ...]:
        changed = self.contents, self.heated, self.made, self.gone, self.on
        return tuple(self.holding), repr(self.at), repr(self.facts), repr(changed)


_ON = Usage("script.on", {"step": '"Reaching"'}, {"after": "1.5", "times": "2"})


def names_of(location: object) -> Iterator[str]:
    """Yield the names of the reference objects of a location, nearest first, without negated relations."""
    relations = location.relations if isinstance(location, Location) else ()
    for reference in (one for relation in relations if not relation.negated for one in relation.references):
        if reference.name is not None:
            yield reference.name
        if isinstance(reference, Location):
            yield from names_of(reference)


Does = Callable[[Belief, Action], Any]
"""A side effect; may be async. A result other than None is the result of the action."""


@dataclass(frozen=True)
class Rule:
    """Behaviour of a step, or of a class of actions, while the rule applies; see :meth:`Script.on`."""

    step: str
    fails: Raises | None = None
    returns: Any = None
    does: Does | None = None
    after: float | None = None
    times: int | None = None
    since: float = 0.0
    until: float = math.inf

    def __str__(self) -> str:
        what = "" if self.fails is None else f" fails with {getattr(self.fails, '__name__', repr(self.fails))}"
        times = "" if self.times is None else f", {self.times} times"
        span = "" if (self.since, self.until) == (0.0, math.inf) else f", from {self.since:g} s until {self.until:g} s"
        return f"{self.step}{what}{times}{span}"


@dataclass
class Script:
    """Behaviour of the robot in a test.

    Without a rule an action succeeds after :attr:`takes` seconds and has the effects that the vocabulary declares for
    its class: the base arrives, a gripper that closes around an object holds it, one that opens releases it, and an
    object that is put down or handed over is at its place or recipient. Each run starts with a new belief in the
    initial state described here.
    """

    takes: float = 1.0
    """Duration of an action without a rule [s]."""
    ancestors: Mapping[str, Sequence[str]] = field(default_factory=dict)
    """Superclasses of action classes, nearest first, in addition to those in the plan and in the vocabulary."""
    classes: list[str] = field(default_factory=list)
    """Action classes that the robot can perform in addition to those of the vocabulary."""
    rules: list[Rule] = field(default_factory=list)
    faults: list[Fault] = field(default_factory=list)
    _initial_changes: list[Callable[[Belief], object]] = field(default_factory=list)

    def on(
        self,
        step: str,
        *,
        fails: Raises | None = None,
        returns: Any = None,
        does: Does | None = None,
        after: float | None = None,
        times: int | None = None,
        since: float = 0.0,
        until: float = math.inf,
    ) -> Script:
        """Add a rule: ``script.on("Reaching", fails=ManipulationPoseUnreachable, times=2, after=1.5)``.

        ``step`` is the name of the step in the plan, or the class of the action. After ``after`` seconds it fails with
        ``fails`` (a class, a function that makes the failure, or an example), or succeeds with ``returns``;
        ``does(belief, action)`` is called just before. The rule applies at most ``times`` times, to actions that begin
        at plan time ``since`` to ``until`` [s]. The first rule that applies counts. The robot can perform the action
        classes named by rules; see :meth:`performs`.
        """
        if after is not None:
            _ON.seconds("after", after)
        if times is not None:
            times = _ON.whole("times", times, 0, "times")
        self.rules.append(Rule(step, fails, returns, does, after, times, since, until))
        return self

    def performs(self, *classes: str) -> Script:
        """Add a process module for each of these action classes."""
        self.classes.extend(classes)
        return self

    def fault(
        self, step: str, raises: Raises, *, attempt: int | None = 1, after: float | None = None, at: float | None = None
    ) -> Script:
        """Make any step of the plan fail, not only actions; see :class:`planlang.testing.Fault`."""
        self.faults.append(Fault(step, raises, None if at is not None else attempt, after, at))
        return self

    def holding(self, *things: str | Object) -> Script:
        """Set objects that the robot holds initially."""
        names = [thing if isinstance(thing, str) else thing.name for thing in things]
        self._initial_changes.append(lambda belief: belief.holding.extend(names))
        return self

    def at(self, **places: Any) -> Script:
        """Set initial places of objects."""
        self._initial_changes.append(lambda belief: belief.at.update(places))
        return self

    def fact(self, condition: str, holds: bool = True) -> Script:
        """Set the initial value of a condition, by its text: ``script.fact("open(fridge1)")``."""
        self._initial_changes.append(lambda belief: belief.facts.update({condition: holds}))
        return self

    def places(self, location: str | Object, *bases: Base) -> Script:
        """Set the base poses for a location, given by its name or its reference object.

        Without poses, the location cannot be reached.
        """
        name = location if isinstance(location, str) else location.name
        self._initial_changes.append(lambda belief: belief.places.update({name: bases}))
        return self

    def belief(self) -> Belief:
        """Make a new belief in the initial state."""
        belief = Belief()
        for change in self._initial_changes:
            change(belief)
        return belief
