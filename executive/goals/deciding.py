"""Deciding goals in the true world, once it has come to rest after the plan."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np

from executive.goals.checking import leaves_of, name_of
from executive.goals.interchanging import Interchange
from executive.goals.true_bodies import TrueBodies
from executive.maps import SemanticMap
from planlang.designators import Location, Object, Relation, local_name
from planlang.geometry import Pose
from planlang.geometry.areas import Facing
from planlang.goals import CLOSED, EMPTY, OFF, ON, OPEN, At, Exists, Fact, Goal, HeldBy, Holds, InState, RestsAt
from planlang.object_changes import state_word
from planlang.records import dataclass
from planlang.relations import RELATIONS
from planlang.relations.demands import Conjunct, InZone, Rest, Viewer
from planlang.relations.looking import SeenFrom
from planlang.relations.reaching import In
from planlang.state import matter
from sim.bodies import FLOOR
from sim.scene import BodyShape
from sim.tolerances import AMOUNT, LONGEST_UNREST, SECONDS_AT_REST, SHUT_SHARE, deviation
from sim.truth import ROBOT, Truth, at_rest_on, held_by, is_centred_in, is_closed, is_toppled, opened

MOST_NAMED = 3
"""Most things for which a verdict says why they do not count."""


@dataclass(frozen=True, slots=True)
class Predicate:
    """A goal of a program: a function of the true world, which returns whether the goal holds."""

    function: Callable[[Truth], object]

    def __str__(self) -> str:
        return str(getattr(self.function, "__qualname__", self.function))


@dataclass(frozen=True, slots=True)
class Verdict:
    """Whether a goal holds in the true world."""

    goal: str
    holds: bool
    reason: str = ""
    """What is so instead; "" if the goal holds."""
    declared: bool = False
    """True if the recipe declares the goal."""
    instead: tuple[str, str] | None = None
    """Thing of which the goal holds, and the one that is named, from which it differs in nothing; None for itself."""

    def __str__(self) -> str:
        of = "" if self.instead is None else " of {}, which is like {}".format(*self.instead)
        return f"goal {self.goal}: {f'holds{of}' if self.holds else f'does not hold: {self.reason}'}"

    def as_json(self) -> dict[str, Any]:
        """The verdict as JSON."""
        verdict = {"goal": self.goal, "holds": self.holds, "reason": self.reason or None, "declared": self.declared}
        return verdict if self.instead is None else {**verdict, "of": self.instead[0]}


class _World:
    """The true world of a run and what is needed to ask about it."""

    def __init__(self, truth: Truth, semantic_map: SemanticMap, radius: float) -> None:
        self.truth, self.map, self.radius = truth, semantic_map, radius
        self.bodies = TrueBodies(truth, semantic_map)
        self.start: Mapping[str, Pose] = dict(truth.poses())


class Judge:
    """Decides goals in the true world of a run; make it before the plan runs."""

    def __init__(
        self,
        goals: Iterable[Goal | Predicate],
        truth: Truth,
        semantic_map: SemanticMap,
        radius: float = 0.0,
        declared: Iterable[Goal] = (),
    ) -> None:
        """``semantic_map`` says what bodies are; ``radius`` is that of the robot's base [m].

        ``declared`` are further goals, of the recipe.
        """
        self._stated, self._declared = tuple(goals), tuple(declared)
        self._world = _World(truth, semantic_map, radius)
        phrases = [one for one in self._stated if not isinstance(one, Predicate)]
        self._interchange = Interchange(
            [*phrases, *self._declared], truth, lambda what: name_of(what, semantic_map), self._unmet
        )

    def _unmet(self, goal: Goal, of: str | None) -> str | None:
        return _Decision(goal, self._world, of).unmet()

    def verdicts(self) -> tuple[Verdict, ...]:
        """Let the world come to rest, and decide the goals."""
        if not (self._stated or self._declared):
            return ()
        come_to_rest(self._world.truth)
        others = self._interchange.chosen()
        declared = (replace(self._verdict(goal, others), declared=True) for goal in self._declared)
        return (*(self._verdict(goal, others) for goal in self._stated), *declared)

    def _verdict(self, goal: Goal | Predicate, others: Mapping[str, str]) -> Verdict:
        if isinstance(goal, Predicate):
            return _of_predicate(goal, self._world.truth)
        name = None if goal.subject is None else name_of(goal.subject, self._world.map)
        other = None if name is None else others.get(name)
        unmet = self._unmet(goal, other)
        instead = None if unmet is not None or name is None or other is None else (other, name)
        return Verdict(goal.text, unmet is None, unmet or "", instead=instead)


def come_to_rest(world: Any) -> None:
    """Let time go on until nothing has moved for a while, or for as long as things may take; robots on routes may."""
    rate, still = world.rate, 0
    movers = {mover.body for mover in world.scene.movers}
    for _ in range(round(LONGEST_UNREST * rate)):
        before, joints = world.poses(), [world.joint(one.leaf) for one in world.scene.joints]
        world.step()
        after = world.poses()
        is_still = before.keys() == after.keys() and all(
            after[name] is pose or after[name] == pose for name, pose in before.items() if name not in movers
        )
        is_still = is_still and joints == [world.joint(one.leaf) for one in world.scene.joints]
        still = still + 1 if is_still else 0
        if still >= round(SECONDS_AT_REST * rate):
            return


def whereabouts(truth: Truth, name: str) -> str:
    """Say where a thing is, as a predicate: "is on the floor", "is held by robot"."""
    if name not in truth.names():
        return "does not exist any more"
    if (holder := held_by(truth, name)) is not None:
        return f"is held by {'the robot' if holder == ROBOT else holder}"
    if (support := at_rest_on(truth, name)) is None:
        return "is not at rest"
    if support == FLOOR:
        return "is on the floor"
    if truth.scene.body(support).shape is BodyShape.ROOM:
        return f"is on the floor of {support}"
    return f"is {'in' if is_centred_in(truth, name, support) else 'on'} {support}"


def _of_predicate(goal: Predicate, truth: Truth) -> Verdict:
    try:
        holds = bool(goal.function(truth))
    except Exception as problem:
        return Verdict(str(goal), False, f"it raised {type(problem).__name__}: {problem}")
    return Verdict(str(goal), holds, "" if holds else "it is false in the world")


class _Decision:
    """Decides one goal."""

    def __init__(self, goal: Goal, world: _World, of: str | None = None) -> None:
        """``of`` names a thing that stands for the one that the goal names."""
        self._goal, self._world, self._truth, self._of = goal, world, world.truth, of

    def unmet(self) -> str | None:
        """Say why the goal does not hold; None if it does."""
        goal = self._goal
        if goal.subject is None:
            return self._of_robot(goal.fact)
        name = self._of or name_of(goal.subject, self._world.map)
        if name is not None:
            return self._of_thing(name, goal.fact)
        return self._of_class(goal.subject, goal.fact)

    # Subjects

    def _of_class(self, what: Object, fact: Fact) -> str | None:
        number, found = self._goal.number, self._bodies_of(what)
        if isinstance(fact, Exists):
            reasons: dict[str, str | None] = dict.fromkeys(found)
            least, most = (0, 0) if fact.negated else (number.least, number.most)
        else:
            reasons = {name: self._of_thing(name, fact) for name in found}
            least, most = number.least, number.most
        good = [name for name, why in reasons.items() if why is None]
        others = [f"{name} {why.removeprefix(f'{name} ')}" for name, why in reasons.items() if why is not None]
        listed = "; ".join(others[:MOST_NAMED]) + ("; ..." if len(others) > MOST_NAMED else "")
        if number.every and not isinstance(fact, Exists):
            return listed if others else None
        if least <= len(good) and (most is None or len(good) <= most):
            return None
        cls = local_name(what.type)
        if not found:
            return f"there is no {cls}"
        count = f"it holds of {len(good)} {cls}" + (f" ({', '.join(good)})" if good else "")
        return f"{count}, not of {_number(least, most)}" + (f": {listed}" if listed and len(good) < least else "")

    def _bodies_of(self, what: Object) -> list[str]:
        """List the bodies that a designator means, in the order of the scene."""
        name = name_of(what, self._world.map)
        if name is not None:
            return [name]
        is_a = self._world.map.ontology.is_a
        return [one for one in self._truth.names() if is_a(self._truth.scene.body(one).type, what.type)]

    def _of_thing(self, name: str, fact: Fact) -> str | None:
        """Say why a fact is not so of a thing; None if it is."""
        if isinstance(fact, Exists):
            is_there = name in self._truth.names()
            return None if is_there != fact.negated else f"{name} {'exists' if is_there else 'does not exist'}"
        if name not in self._truth.names():
            return f"{name} does not exist any more"
        match fact:
            case HeldBy(holder, negated):
                by = held_by(self._truth, name)
                wanted = {ROBOT} if holder is None else set(self._bodies_of(holder))
                return None if (by in wanted) != negated else f"{name} {whereabouts(self._truth, name)}"
            case At(location):
                return self._at(name, location)
            case RestsAt(where):
                reasons = [self._rests(name, one, inside=True) for one in self._bodies_of(where)]
                reasons += [self._rests(name, one, inside=False) for one in self._bodies_of(where)]
                worst = next((one for one in reasons if one), "")
                return None if None in reasons else f"{name} {whereabouts(self._truth, name)}{worst}"
            case InState(state, negated):
                is_so, why = self._in_state(name, state)
                return None if is_so != negated else f"{name} {why}"
            case Holds():
                return self._contents(name, fact)
        raise AssertionError(fact)

    def _of_robot(self, fact: Fact) -> str | None:
        assert isinstance(fact, At), "of the robot, goals say where it is"
        x, y, yaw = self._truth.configuration().base
        base = np.array([[x, y, yaw]])
        for relation in fact.location.relations:
            kind = RELATIONS[relation.name]
            if isinstance(kind, SeenFrom):
                continue
            is_so = any(
                self._stands_in(x, y, terms) if isinstance(kind, In) else self._base_is(base, relation, terms)
                for terms in self._bound(relation)
            )
            if is_so == relation.negated:
                return f"the robot is at {x:.2f}, {y:.2f}{self._in_room(x, y)}"
        return None

    # Where things are

    def _at(self, name: str, location: Location) -> str | None:
        """Say why a thing is not at a location; None if it is."""
        here = f"{name} {whereabouts(self._truth, name)}"
        relations = [one for one in location.relations if not isinstance(RELATIONS[one.name], SeenFrom)]
        is_placed = any(isinstance(self._demand(one, name, self._bound(one)[0]), Rest) for one in relations)
        for relation in relations:
            why = [self._not_so(name, relation, bodies, is_placed) for bodies in self._bound(relation)]
            is_so = any(one is None for one in why)
            if is_so == relation.negated:
                return here if is_so or why[0] is None else f"{here}{why[0]}"
        return None

    def _bound(self, relation: Relation) -> list[tuple[str, ...]]:
        """List the bodies that a relation may be to: those of a class are all meant."""
        each = [self._bodies_of(one) for one in relation.references if isinstance(one, Object)]
        return list(product(*each)) or [()]

    def _conjunct(self, relation: Relation, bodies: tuple[str, ...]) -> Conjunct:
        return Conjunct(relation.name, bodies, relation.within, relation.beyond, viewer=self._viewer())

    def _viewer(self) -> Viewer:
        """Position of whose left and right is meant: what the goal names, else the robot."""
        fact = self._goal.fact
        for relation in fact.location.relations if isinstance(fact, At) else ():
            if isinstance(RELATIONS[relation.name], SeenFrom):
                block = self._world.bodies.block(self._bound(relation)[0][0])
                return block.x, block.y
        x, y, _ = self._truth.configuration().base
        return x, y

    def _demand(self, relation: Relation, name: str, bodies: tuple[str, ...]) -> Any:
        """What a relation to bodies demands of a thing; None without bodies."""
        if not bodies:
            return None
        radius = max(self._truth.scene.body(name).size[:2]) / 2
        if bodies == (FLOOR,):
            return Rest(FLOOR)
        return RELATIONS[relation.name].thing(self._conjunct(relation, bodies), self._world.bodies, radius)

    def _not_so(self, name: str, relation: Relation, bodies: tuple[str, ...], is_placed: bool) -> str | None:
        """Say what of a relation, whatever its negation, is not so, as the end of a sentence; None if it is so."""
        truth, demand = self._truth, self._demand(relation, name, bodies)
        match demand:
            case None:
                return ""
            case Rest(body, inside):
                return self._rests(name, body, inside=inside)
            case InZone(person):
                return None if truth.person(person).contains(truth.pose(name).position) else ""
        support = at_rest_on(truth, name)
        supports = RELATIONS[relation.name].supports(self._conjunct(relation, bodies), self._world.bodies)
        if not is_placed and supports and support not in supports:
            return f", not on {' or '.join(supports)} as {' and '.join(bodies)} is"
        if support is None:
            return ""
        block = self._world.bodies.block(name)
        if demand.of_thing(block).score(np.array([truth.pose(name).position[:2]]))[0] > 0:
            return None
        return f", {self._world.bodies.block(bodies[0]).distance(block.outline()).min():.2f} m from {bodies[0]}"

    def _rests(self, name: str, body: str, *, inside: bool) -> str | None:
        truth = self._truth
        if inside:
            if at_rest_on(truth, name) is not None and is_centred_in(truth, name, body):
                return None
            return ""
        support = at_rest_on(truth, name)
        is_there = support == body or (body == FLOOR and support is not None and self._is_room(support))
        if is_there and is_toppled(truth, name, self._world.start.get(name)):
            return ", toppled"
        return None if is_there else ""

    def _is_room(self, name: str) -> bool:
        return name != FLOOR and self._truth.scene.body(name).shape is BodyShape.ROOM

    def _base_is(self, base: Any, relation: Relation, bodies: tuple[str, ...]) -> bool:
        if not bodies:
            return False
        kind = RELATIONS[relation.name]
        demand: Any = kind.base(self._conjunct(relation, bodies), self._world.bodies, self._world.radius)
        points = base if isinstance(demand, Facing) else base[:, :2]
        return bool(demand.score(points)[0] > 0)

    def _stands_in(self, x: float, y: float, bodies: tuple[str, ...]) -> bool:
        return any(self._world.bodies.block(one).distance(np.array([[x, y]]))[0] <= 0 for one in bodies)

    def _in_room(self, x: float, y: float) -> str:
        rooms = [body.name for body in self._truth.scene.bodies if body.shape is BodyShape.ROOM]
        inside = [one for one in rooms if self._stands_in(x, y, (one,))]
        return f" in {inside[0]}" if inside else ""

    # States and contents

    def _in_state(self, name: str, state: str) -> tuple[bool, str]:
        """Decide whether a thing is in a state, and say what is so, as a predicate."""
        truth = self._truth
        if state in (OPEN, CLOSED):
            leaves = leaves_of(truth.scene, name)
            shares = {leaf: opened(truth, leaf) for leaf in leaves}
            said = ", ".join(f"{leaf} by {share:.0%}" for leaf, share in shares.items() if not is_closed(truth, leaf))
            why = f"is open: {said}" if said and leaves != (name,) else f"is open by {shares[name]:.0%}" if said else ""
            if state == CLOSED:
                return bool(leaves) and not said, why or "is closed"
            wide = {joint.leaf: joint.first_open / joint.upper - SHUT_SHARE for joint in truth.scene.joints}
            return any(share >= wide[leaf] for leaf, share in shares.items()), why or "is closed"
        condition = truth.condition(name)
        if state in (ON, OFF):
            is_on = condition == matter.ON
            return is_on == (state == ON), f"is {ON if is_on else OFF}"
        if state == EMPTY:
            amount = sum(truth.contents(name).values())
            within = [one for one in truth.names() if one != name and self._is_movable_in(one, name)]
            why = f"holds {amount:.0f} ml" if amount > AMOUNT else f"has {', '.join(within)} in it"
            return amount <= AMOUNT and not within, why if amount > AMOUNT or within else "is empty"
        is_so = condition is not None and local_name(condition) == local_name(state)
        return is_so, f"is {state_word(condition)}" if condition else f"is not known to be {local_name(state)}"

    def _is_movable_in(self, name: str, other: str) -> bool:
        return self._truth.scene.body(name).movable and is_centred_in(self._truth, name, other)

    def _contents(self, name: str, fact: Holds) -> str | None:
        """Say why a vessel does not contain what it should; None if it does."""
        is_a = self._world.map.ontology.is_a
        contents, what = self._truth.contents(name), fact.substance
        amount = sum(ml for cls, ml in contents.items() if what is None or is_a(cls, what.type))
        least, most = fact.least, fact.most
        is_so = amount > 0 if (least, most) == (0.0, None) else amount >= least - deviation(least)
        is_so = is_so and (most is None or amount <= most + deviation(most))
        if is_so != fact.negated:
            return None
        listed = ", ".join(f"{ml:.0f} ml of {local_name(cls)}" for cls, ml in contents.items())
        return f"{name} holds {listed or 'nothing'}"


def _number(least: int, most: int | None) -> str:
    if most is None:
        return f"at least {least}"
    return str(least) if least == most else f"at most {most}"
