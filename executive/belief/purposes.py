"""What a step is for, as far as its declared effects tell: which things it need not act on any more."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import NamedTuple

from planlang.action_conditions import Pattern, declared
from planlang.designators import Action, Condition, Location, Object, Relation, resting_on, snake_case
from planlang.failures import DesignatorFailure
from planlang.ontology import Ontology, expand

HOLDING, LOCATED = "holding", "located"
DECIDED = frozenset({HOLDING, LOCATED, "open", "closed"})
"""Conditions that can be decided for each thing of a class."""


class Aim(NamedTuple):
    """A condition that a step brings about, about what fills its properties."""

    predicate: str
    parts: tuple[Object | Location, ...]


class Purpose(NamedTuple):
    """What a step brings about that concerns one of its designators."""

    aims: tuple[Aim, ...]
    text: str
    """The aims, with a gap for the designator: steps of the same text want the same of different things."""
    passes: bool
    """True if later steps end what it brings about, as a thing that is held is put down again."""


class Purposes:
    """Reads the purposes of actions from declared effects, and decides by the belief which things have reached them."""

    def __init__(
        self,
        ontology: Ontology,
        ancestors: Callable[[str], Sequence[str]],
        decide: Callable[[Condition], bool],
        individuals: Callable[[Object], Sequence[Object]],
    ) -> None:
        """Read the effects that an ontology declares.

        ``ancestors`` maps an action class to itself and its superclasses, ``individuals`` a designator to designators
        of all things of its class; ``decide`` decides a condition.
        """
        self._declared, self._ancestors = declared(ontology), ancestors
        self._decide, self._individuals = decide, individuals
        self._known: dict[tuple[Action, Object], Purpose | None] = {}

    def of(self, action: Action | None, what: Object) -> Purpose | None:
        """Read what an action is for, as far as it concerns a designator; None if its effects do not tell."""
        if action is None:
            return None
        if (action, what) not in self._known:
            self._known[action, what] = self._read(action, what)
        return self._known[action, what]

    def _read(self, action: Action, what: Object) -> Purpose | None:
        filled = (_filled(pattern, action) for pattern in self._patterns(action))
        aims = tuple(dict.fromkeys(aim for aim in filled if aim is not None and what in aim.parts))
        if not aims or any(what in part.things() for aim in aims for part in aim.parts if isinstance(part, Location)):
            return None
        gaps = (", ".join("" if part == what else str(part) for part in aim.parts) for aim in aims)
        text = " and ".join(f"{aim.predicate}({gap})" for aim, gap in zip(aims, gaps, strict=True))
        return Purpose(aims, text, all(aim.predicate == HOLDING for aim in aims))

    def reached(self, purpose: Purpose | None, what: Object, thing: Object) -> bool:
        """Check whether all aims of a purpose hold already if a designator means an individual ``thing``."""
        return purpose is not None and all(self._holds(aim, what, thing) for aim in purpose.aims)

    def is_at(self, where: Location, thing: Object) -> bool:
        """Check whether a thing is at a location by itself, in no hand; of what that names by class, any will do."""
        if self._decides(HOLDING, thing):
            return False
        if any(one.iri is None for one in where.objects()):
            ways = [self._individually(relation) for relation in where.relations]
            return all(any(self._decides(LOCATED, Location((one,)), thing) for one in way) for way in ways)
        return self._decides(LOCATED, where, thing)

    def _individually(self, relation: Relation) -> Iterator[Relation]:
        """Yield a relation to each individual of the class that it refers to, or the relation as it is."""
        match relation.references:
            case (Object(iri=None) as what,):
                yield from (replace(relation, references=(one,)) for one in self._individuals(what))
            case _:
                yield relation

    def _patterns(self, action: Action) -> Iterator[Pattern]:
        """Yield the conditions that an action brings about whatever was before, if they can be decided."""
        for cls in self._ancestors(action.type):
            for pattern, given in self._declared.effects.get(expand(cls), ()):
                if not given and pattern.predicate in DECIDED:
                    yield pattern

    def _holds(self, aim: Aim, what: Object, thing: Object) -> bool:
        place, *others = (thing if part == what else part for part in aim.parts)
        if aim.predicate != LOCATED:
            return self._decides(aim.predicate, place)
        (moved,) = others
        is_one = isinstance(moved, Object) and (moved == thing or moved.iri is not None)
        moved_things = (moved,) if is_one or not isinstance(moved, Object) else self._individuals(moved)
        where = resting_on(place)
        return any(self.is_at(where, one) for one in moved_things if isinstance(one, Object))

    def _decides(self, predicate: str, *about: Object | Location) -> bool:
        with suppress(DesignatorFailure):
            return self._decide(Condition(predicate, about))
        return False


def _filled(pattern: Pattern, action: Action) -> Aim | None:
    """Fill a condition with what an action states; None if that is missing, or is no thing and no place."""
    parts = tuple(action.get(snake_case(name)) for name in pattern.properties)
    described = tuple(part for part in parts if isinstance(part, (Object, Location)))
    return Aim(pattern.predicate, described) if described and len(described) == len(parts) else None
