"""Things that differ in nothing stand for each other in goals: which of them each named thing is, at the end."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence

from planlang.designators import Location, Object
from planlang.goals import At, Exists, Goal, HeldBy, Holds, InState
from planlang.graphs import assigned
from sim.likeness import is_like
from sim.scene import BodyShape
from sim.truth import Truth

ANOTHER = 1e-3
"""Cost of letting another thing stand for one, in goals that do not hold: without a gain it is the thing itself."""


class Interchange:
    """Things that may stand for those that goals name. Make it before the plan runs.

    What was so of the other thing already is nothing that the plan has brought about, and does not count.
    """

    def __init__(
        self,
        goals: Iterable[Goal],
        truth: Truth,
        name_of: Callable[[Object], str | None],
        unmet: Callable[[Goal, str], str | None],
    ) -> None:
        """``unmet`` says why a goal does not hold if a thing stands for the one that it names; None if it does."""
        self._unmet, self._truth = unmet, truth
        self._about: dict[str, list[Goal]] = {}
        goals = [one for one in goals if one.subject is not None]
        for goal in goals:
            if goal.subject is not None and (name := name_of(goal.subject)) is not None:
                self._about.setdefault(name, []).append(goal)
        fixed = {name for goal in goals for what in _references(goal) if (name := name_of(what)) is not None}
        self._like = {
            name: [one for one in _like(truth, name) if one not in fixed]
            for name, about in self._about.items()
            if name not in fixed and not all(map(_is_negated, about))
        }
        self._before = {
            (goal.text, one)
            for name, others in self._like.items()
            for one in others
            for goal in self._about[name]
            if unmet(goal, one) is None
        }

    def chosen(self) -> Mapping[str, str]:
        """Find the things that stand for named ones: those of which most of the goals hold, none for two."""
        if not any(self._like.values()):
            return {}
        found = zip(self._like, assigned([self._costs(name) for name in self._like]), strict=True)
        return {name: one for name, one in found if one is not None and one != name}

    def _costs(self, name: str) -> dict[str, float]:
        """Map what may stand for a thing to the number of its goals that do not hold then."""
        there = self._truth.names()
        others = (one for one in self._like[name] if one in there)
        return {name: self._unmet_by(name, name)} | {one: self._unmet_by(name, one) + ANOTHER for one in others}

    def _unmet_by(self, name: str, one: str) -> float:
        before = () if one == name else self._before
        return sum(self._unmet(goal, one) is not None or (goal.text, one) in before for goal in self._about[name])


def _like(truth: Truth, name: str) -> list[str]:
    """List the other things that differ from a thing in nothing, with the same in them at first.

    Furniture and people are told by their places.
    """
    bodies = {body.name: body for body in truth.scene.bodies}
    body = bodies.get(name)
    if body is None or not body.movable or body.shape not in (BodyShape.BOX, BodyShape.CYLINDER):
        return []
    others = ((one, other) for one, other in bodies.items() if one != name and other.movable)
    return [one for one, other in others if is_like(body, other) and other.content == body.content]


def _references(goal: Goal) -> Sequence[Object]:
    """List the things to which a goal refers beside its subject."""
    fact = goal.fact
    if isinstance(fact, At):
        return [what for one in fact.location.relations for what in one.references if isinstance(what, Object)]
    if isinstance(fact, HeldBy):
        return [] if fact.holder is None else [fact.holder]
    where = getattr(fact, "where", None)
    return [where] if isinstance(where, Object) else []


def _is_negated(goal: Goal) -> bool:
    """Check whether a goal only says what shall not be so: that is meant of the thing itself."""
    match goal.fact:
        case At(Location() as location):
            return all(one.negated for one in location.relations)
        case HeldBy(negated=negated) | InState(negated=negated) | Holds(negated=negated):
            return negated
        case Exists():
            return True
    return False
