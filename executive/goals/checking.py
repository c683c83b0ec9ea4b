"""Checks of goals: whether the world of a map can decide them, and what it has instead."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from executive.maps import SemanticMap
from executive.maps.articulation import DEVICES
from planlang.designators import Location, Object, Relation
from planlang.diagnostics import Diagnostic, Span, error
from planlang.goals import CLOSED, OFF, ON, OPEN, At, Goal, HeldBy, Holds, InState
from planlang.relations import RELATIONS
from planlang.relations.looking import SeenFrom
from planlang.relations.reaching import In
from planlang.spelling import guess
from sim import Scene
from sim.bodies import FLOOR
from sim.scene import BodyShape

MOST_NAMED = 20
"""Most names that a message lists."""


def decidable(goal: Goal, semantic_map: SemanticMap, scene: Scene) -> bool:
    """Check whether the world of a map can decide a goal."""
    return not any(Check(semantic_map, scene, Span("")).problems(goal))


def name_of(what: Object, semantic_map: SemanticMap) -> str | None:
    """Find the name of the body that a designator with an IRI means; None for a class."""
    if what.iri is None:
        return None
    thing = semantic_map.find(what.iri)
    return what.iri if thing is None else thing.name


def decided_of(name: str, *, of_base: bool) -> bool:
    """Check whether the state of a world decides a relation of a thing, or of the base: it needs no search."""
    kind = RELATIONS[name]
    if isinstance(kind, SeenFrom):
        return True
    if of_base:
        return isinstance(kind, In) or (kind.of_base is not None and name not in ("in_reach_of", "visible_from"))
    return kind.of_thing is not None


def leaves_of(scene: Scene, name: str) -> tuple[str, ...]:
    """List the doors, drawers and lids that a body is, is a part of, or has."""
    found = (joint for joint in scene.joints if not joint.is_knob)
    return tuple(one.leaf for one in found if name in (*one.bodies, one.holder, *one.frame[:1]))


class Check:
    """Finds what of a goal the world of a map cannot decide."""

    def __init__(self, semantic_map: SemanticMap, scene: Scene, span: Span) -> None:
        self._map, self._scene, self._span = semantic_map, scene, span

    def problems(self, goal: Goal) -> Iterator[Diagnostic]:
        """Yield the problems of a goal."""
        fact = goal.fact
        if goal.subject is not None:
            yield from self._absent(goal.subject)
        if goal.subject is None and not isinstance(fact, At):
            yield self._wrong("of the robot, a goal says where it is", "for example: robot in kitchen1")
        match fact:
            case At(location):
                yield from self._location(location, of_base=goal.subject is None)
            case HeldBy(Object() as holder):
                yield from self._holder(holder)
            case InState(state) if goal.subject is not None:
                yield from self._state(goal.subject, state)
            case Holds(Object() as substance) if substance.iri is not None and self._body(substance) is not None:
                thing, owner = self._body(substance), name_of(goal.subject, self._map) if goal.subject else None
                is_person = owner in self._names() and self._scene.body(str(owner)).shape is BodyShape.PERSON
                advice = f"{thing} held by {owner}" if is_person else f"{thing} in {owner or '...'}"
                yield self._wrong(f"{thing} is a thing, not a substance", f"write: {advice}")

    def _wrong(self, message: str, help: str | None = None) -> Diagnostic:
        return error("P012", message, self._span, help)

    def _body(self, what: Object) -> str | None:
        name = name_of(what, self._map)
        return name if name in self._names() else None

    def _names(self) -> list[str]:
        return [body.name for body in self._scene.bodies]

    def _absent(self, what: Object) -> Iterator[Diagnostic]:
        """Yield an error for a named thing that is nowhere."""
        name = name_of(what, self._map)
        if name is not None and name not in (*self._names(), FLOOR):
            yield error("P008", f"{name} is in no place of the map", self._span, guess(name, self._names()) or None)

    def _holder(self, holder: Object) -> Iterator[Diagnostic]:
        people = [body.name for body in self._scene.bodies if body.shape is BodyShape.PERSON]
        name = name_of(holder, self._map)
        of_class = [one for one in people if self._is_a(one, holder.type)]
        if name in people or (name is None and of_class):
            return
        who = name or f"the {holder.type}"
        yield self._wrong(f"{who} holds nothing", f"a thing is held by: {', '.join(('robot', *people))}")

    def _state(self, what: Object, state: str) -> Iterator[Diagnostic]:
        """Yield an error for a thing that cannot be open or closed, on or off."""
        name = self._body(what)
        if state in (OPEN, CLOSED):
            able = [one for one in self._names() if leaves_of(self._scene, one)]
            kind = "has no door, drawer or lid"
        elif state in (ON, OFF):
            able = [body.name for body in self._scene.bodies if self._is_device(body.name)]
            kind = "is no device"
        else:
            return
        of_class = name is None and any(self._is_a(one, what.type) for one in able)
        if name in able or of_class:
            return
        listed = ", ".join(able[:MOST_NAMED]) + (
            f" and {len(able) - MOST_NAMED} more" if len(able) > MOST_NAMED else ""
        )
        yield self._wrong(f"{name or what.type} {kind}", f"there are: {listed}" if able else "there is none")

    def _is_device(self, name: str) -> bool:
        body = self._scene.body(name)
        has_control = any(name == control.device for control in self._scene.controls)
        return body.is_on or has_control or any(self._is_a(name, cls) for cls in DEVICES)

    def _is_a(self, name: str, cls: str) -> bool:
        return self._map.ontology.is_a(self._scene.body(name).type, cls)

    def _location(self, location: Location, *, of_base: bool) -> Iterator[Diagnostic]:
        for relation in location.relations:
            yield from self._relation(relation, of_base=of_base)

    def _relation(self, relation: Relation, *, of_base: bool) -> Iterator[Diagnostic]:
        words = RELATIONS[relation.name].forms[0]
        if not decided_of(relation.name, of_base=of_base):
            known = (one.forms[0] for name, one in RELATIONS.items() if decided_of(name, of_base=of_base))
            whose = "the robot" if of_base else "a thing"
            yield self._wrong(
                f"{words!r} of {whose} is nothing that a world decides", f"it decides: {', '.join(known)}"
            )
            return
        for what in relation.references:
            if isinstance(what, Location):
                yield self._wrong(f"a place is no thing: {words!r} names one in a goal", "name a thing, or a class")
                continue
            yield from self._absent(what)
            if what.iri is None and not any(self._is_a(one, what.type) for one in self._names()):
                yield error("P008", f"the map has no {what.type}", self._span, f"it has {_listed(self._names())}")


def _listed(names: Sequence[str]) -> str:
    return ", ".join(names[:MOST_NAMED]) + (f" and {len(names) - MOST_NAMED} more" if len(names) > MOST_NAMED else "")
