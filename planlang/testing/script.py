"""Scripts: what process modules do in a test, so that plans run without a robot."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import field
from typing import Any

from planlang.designators import Action, Condition, Location, Object
from planlang.misuse import Usage
from planlang.records import dataclass
from planlang.testing.faults import Fault, Raises

Base = tuple[float, float, float]
"""Pose of the base: x, y [m], yaw [rad]."""


@dataclass(eq=False)
class Belief:
    """The belief of the scripted robot, which in a script is also the truth.

    Things are called by the local name of their individual, or of their class. Steps of a script read and change
    it; a change of what is held, where things are or what is true makes a new revision.
    """

    holding: list[str] = field(default_factory=list)
    """Names of what the robot holds."""
    at: dict[str, Any] = field(default_factory=dict)
    """Places of things that are not held: the name of what they were put down on, or of whom they were handed to; or
    whatever the test writes, ``belief.at["bottle1"] = "table"``."""
    facts: dict[str, bool] = field(default_factory=dict)
    """Other conditions by their text, e.g. ``"open(fridge1)"``."""
    places: dict[str, Sequence[Base]] = field(default_factory=dict)
    """Places for the base by the name of a location, or of the thing that it is about; without, three are made up."""
    base: Base = (0.0, 0.0, 0.0)
    around: str | None = None
    """The thing between the open fingers, ready to be grasped."""
    lowered: dict[str, str] = field(default_factory=dict)
    """Names of the places to which things that are held were lowered."""
    contents: dict[str, dict[str, float]] = field(default_factory=dict)
    """Substances in things, and on them [ml]: ``belief.contents["bowl1"] = {"Milk": 200.0}``."""
    heated: dict[str, tuple[float, float]] = field(default_factory=dict)
    """Time that both sides of things were over heat [s]."""
    made: dict[str, list[str]] = field(default_factory=dict)
    """Things that came into being, with all that went into them."""
    gone: list[str] = field(default_factory=list)
    """Things that were destroyed."""
    on: list[str] = field(default_factory=list)
    """Devices that are on."""

    def __post_init__(self) -> None:
        self._revision = 0
        self._seen = self._state()
        self.made_up: dict[str, list[Base]] = {}
        """Places that were made up, by location."""

    def restore(
        self,
        *,
        holding: list[str],
        at: dict[str, Any],
        facts: dict[str, bool],
        base: Base,
        around: str | None,
        lowered: dict[str, str],
        revision: int,
        made_up: dict[str, list[Base]],
        contents: dict[str, dict[str, float]],
        heated: dict[str, tuple[float, float]],
        made: dict[str, list[str]],
        gone: list[str],
        on: list[str],
    ) -> None:
        """Restore an earlier belief."""
        self.contents, self.heated, self.made, self.gone, self.on = contents, heated, made, gone, on
        self.holding[:] = holding
        self.at, self.facts, self.base, self.around, self.made_up = at, facts, base, around, made_up
        self.lowered = lowered
        self._seen, self._revision = self._state(), revision

    @property
    def revision(self) -> int:
        """Counts changes."""
        state = self._state()
        if state != self._seen:
            self._seen = state
            self._revision += 1
        return self._revision

    def holds(self, condition: Condition) -> bool:
        """Return True if a condition holds: by the facts, if they have it, else by what the belief says of things.

        ``holding(x)`` is decided by what is held.
        Without seconds, things are baked that were over heat at all, on both sides.
        """
        if str(condition) in self.facts and condition.predicate != "holding":
            return self.facts[str(condition)]
        arguments: list[Any] = [getattr(what, "name", what) for what in condition.arguments or ("",)]
        first, *others = arguments
        match condition.predicate:
            case "holding":
                return first in self.holding and all(what in self.holding for what in others)
            case "located" if others:
                place = self.at.get(others[0])
                return place is not None and place in (first, *names_of(condition.arguments[0]))
            case "contains":
                amount = self.contents.get(first, {}).get(others[0], 0.0)
                return amount >= others[1] if len(others) > 1 else amount > 0
            case "baked":
                least = min(self.heated.get(first, (0.0, 0.0)))
                return least >= others[0] if others else least > 0
            case "switched_on":
                return first in self.on
            case "destroyed":
                return first in self.gone
            case "created":
                return first in self.made and first not in self.gone
            case "transformed_into":
                return self._went_into(first, others[0])
        return False

    def _went_into(self, what: str, result: str) -> bool:
        parts, known = [result], {result}
        for part in parts:  # grows while it is walked
            parts += [one for one in self.made.get(part, ()) if one not in known]
            known.update(parts)
        return what != result and what in known

    def destroy(self, *things: str) -> None:
        """Let things be there no more."""
        self.gone.extend(thing for thing in things if thing not in self.gone)
        for thing in things:
            self.drop(thing)

    def create(self, thing: str, *of: str) -> None:
        """Let a thing come into being of others, which are destroyed."""
        self.destroy(*of)
        self.made[thing] = list(of)
        self.gone[:] = [one for one in self.gone if one != thing]

    def hold(self, what: str | None) -> None:
        """Hold something: it is at no place any more."""
        if what is not None and what not in self.holding:
            self.holding.append(what)
            self.at.pop(what, None)

    def drop(self, what: str | None = None) -> None:
        """Let something go, or everything; what was lowered before is where it was lowered to."""
        for held in [held for held in self.holding if what in (None, held)]:
            self.holding.remove(held)
            if held in self.lowered:
                self.at[held] = self.lowered.pop(held)

    def places_of(self, location: Location) -> Sequence[Base]:
        """Return the base poses for a location, best first."""
        for name in (location.name, *names_of(location), str(location)):
            if name is not None and name in self.places:
                return self.places[name]
        known = self.made_up
        if str(location) not in known:
            x = 10.0 * (len(known) + 1)
            known[str(location)] = [(x, 0.0, 0.0), (x + 1, 0.0, 0.0), (x + 2, 0.0, 0.0)]
        return known[str(location)]

    def put(self, what: str, place: str) -> None:
        """Put something somewhere; what is held is there as soon as it is let go."""
        (self.lowered if what in self.holding else self.at)[what] = place

    def _state(self) -> tuple[object, ...]:
        changed = self.contents, self.heated, self.made, self.gone, self.on
        return tuple(self.holding), repr(self.at), repr(self.facts), repr(changed)


_ON = Usage("script.on", {"step": '"Reaching"'}, {"after": "1.5", "times": "2"})


def names_of(location: object) -> Iterator[str]:
    """Yield the names of things that a location is about, nearest first; not of those where it is not."""
    for relation in location.relations if isinstance(location, Location) else ():
        if relation.reference.name is not None and not relation.negated:
            yield relation.reference.name
        if isinstance(relation.reference, Location) and not relation.negated:
            yield from names_of(relation.reference)


Does = Callable[[Belief, Action], Any]
"""A side effect; may be async, and what it returns other than None is the action's result."""


@dataclass(frozen=True)
class Rule:
    """The behaviour of a step or class of actions, as long as the rule applies."""

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
    """The behaviour of the robot of a test.

    Without a rule an action succeeds after :attr:`takes` seconds and has the effect of its class on the belief, as
    the vocabulary declares it: the base arrives, a gripper that closes around something holds it, one that opens lets
    it go, what is put down or handed over is at its place or recipient. A script is a description: each run begins with
    its belief as it was described here.
    """

    takes: float = 1.0
    """Duration of an action without a rule about it [s]."""
    ancestors: Mapping[str, Sequence[str]] = field(default_factory=dict)
    """Superclasses of classes of actions, nearest first, besides those that the plan states or the vocabulary knows."""
    classes: list[str] = field(default_factory=list)
    """Classes of actions that can be performed besides those of every robot."""
    rules: list[Rule] = field(default_factory=list)
    faults: list[Fault] = field(default_factory=list)
    _beginning: list[Callable[[Belief], object]] = field(default_factory=list)

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
        """Set what performing does: ``script.on("Reaching", fails=ManipulationPoseUnreachable, times=2, after=1.5)``.

        ``step`` is the name of the step in the plan or the class of the action. ``after`` seconds it fails with
        ``fails`` (a class, a function that makes the failure, or an example), or succeeds with ``returns``.
        ``does(belief, action)`` is called just before that. A rule applies ``times`` times, to what begins at plan
        time ``since`` up to ``until`` [s]. Of several rules the first that applies counts. A class of actions that a
        rule names can be performed; see :meth:`performs`.
        """
        if after is not None:
            _ON.seconds("after", after)
        if times is not None:
            times = _ON.whole("times", times, 0, "times")
        self.rules.append(Rule(step, fails, returns, does, after, times, since, until))
        return self

    def performs(self, *classes: str) -> Script:
        """Give the robot process modules for more classes of actions; each has its own."""
        self.classes.extend(classes)
        return self

    def fault(
        self, step: str, raises: Raises, *, attempt: int | None = 1, after: float | None = None, at: float | None = None
    ) -> Script:
        """Let any step of the plan fail, performed or not; see :class:`planlang.testing.Fault`."""
        self.faults.append(Fault(step, raises, None if at is not None else attempt, after, at))
        return self

    def holding(self, *things: str | Object) -> Script:
        """Let the robot hold things at the beginning."""
        names = [thing if isinstance(thing, str) else thing.name for thing in things]
        self._beginning.append(lambda belief: belief.holding.extend(names))
        return self

    def at(self, **places: Any) -> Script:
        """Put things somewhere at the beginning."""
        self._beginning.append(lambda belief: belief.at.update(places))
        return self

    def fact(self, condition: str, holds: bool = True) -> Script:
        """Let a condition hold, or not, at the beginning, by its text: ``script.fact("open(fridge1)")``."""
        self._beginning.append(lambda belief: belief.facts.update({condition: holds}))
        return self

    def places(self, location: str | Object, *bases: Base) -> Script:
        """Set the base poses for a location, given by its name or the thing that it is about; none is nowhere."""
        name = location if isinstance(location, str) else location.name
        self._beginning.append(lambda belief: belief.places.update({name: bases}))
        return self

    def belief(self) -> Belief:
        """Return the belief at the beginning, made anew."""
        belief = Belief()
        for change in self._beginning:
            change(belief)
        return belief
