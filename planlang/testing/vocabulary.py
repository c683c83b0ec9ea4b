"""What the scripted robot knows of actions, by the ontology: what performs and needs them, and what they change."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache

from planlang.action_conditions import Pattern, declared
from planlang.designators import Action, Device, Location, Object, Posture, snake_case
from planlang.effects import effects_of
from planlang.files import bundled
from planlang.object_changes import state_word
from planlang.ontology import Ontology, expand, load, shorten
from planlang.recipe.actions import read_primitives
from planlang.records import dataclass
from planlang.testing.script import Belief, names_of

_OF_THE_HAND = ("in_center_of", "in_front_of")
"""Relations of places where a hand handles a thing; nothing is put there."""


@dataclass(frozen=True, slots=True)
class ActionChange:
    """What actions of some classes change. Properties of patterns are roles (``object_acted_on``)."""

    brought: tuple[tuple[Pattern, tuple[str, ...]], ...]
    """What comes about, each with the predicates that have to hold before."""
    ended: tuple[Pattern, ...]
    switched: str | None
    """What devices are afterwards: "on", "off"."""


class ActionVocabulary:
    """The classes of actions of an ontology."""

    def __init__(self, ontology: Ontology) -> None:
        self.ontology = ontology
        self.declared = declared(ontology)
        self._primitives = {shorten(action): one for action, one in read_primitives(ontology).items()}
        self._letting_go = frozenset(map(shorten, self.declared.ending("holding")))
        self._facts = frozenset(goal.predicate for goal in self.declared.goals.values()) - {"holding"}
        """Predicates that the belief has no other place for."""
        self._changes: dict[tuple[str, ...], ActionChange] = {}

    def modules(self) -> dict[str, tuple[str, ...]]:
        """Return the names of process modules, each with the classes of actions that it performs."""
        found: dict[str, tuple[str, ...]] = {}
        for action, primitive in self._primitives.items():
            found[primitive.module] = (*found.get(primitive.module, ()), action)
        return found

    def ancestors(self, cls: str) -> tuple[str, ...]:
        """Return a class itself and what is above it, nearest first; names of the vocabulary."""
        return tuple(map(shorten, self.ontology.ancestors(expand(cls))))

    def roles(self, classes: tuple[str, ...]) -> tuple[str, ...]:
        """Return the parts of a robot (base, head, torso, arm, gripper) that an action needs, by its nearest class."""
        return next((self._primitives[cls].resources for cls in classes if cls in self._primitives), ())

    def releases(self, classes: tuple[str, ...]) -> bool:
        """Return True if actions of these classes let go of something."""
        return not self._letting_go.isdisjoint(classes)

    def change(self, belief: Belief, action: Action, classes: tuple[str, ...]) -> None:
        """Apply the effects of an action that has succeeded."""
        change = self._change(classes)
        for pattern, given in change.brought:
            self._bring(belief, action, pattern, given)
        for pattern in change.ended:
            if pattern.predicate == "holding":
                for what in _things(action, pattern) or (None,):
                    belief.drop(what)
            elif pattern.predicate in self._facts:
                belief.facts |= {f"{pattern.predicate}({what})": False for what in _things(action, pattern)}
        for pattern, given in change.brought:
            if pattern.predicate == "holding":
                for what in _things(action, pattern) or ((belief.around,) if "reached" in given else ()):
                    belief.hold(what)
        for what in _names(action.get("object_acted_on")) if change.switched is not None else ():
            belief.on[:] = [one for one in belief.on if one != what] + [what] * (change.switched == "on")

    def _bring(self, belief: Belief, action: Action, pattern: Pattern, given: tuple[str, ...]) -> None:
        """Let something come about, except that something is held: what is held before may end first."""
        match pattern:
            case Pattern(predicate="near"):
                x, y, yaw = (action.get(key) for key in ("x", "y", "yaw"))
                if isinstance(x, float) and isinstance(y, float) and isinstance(yaw, float):
                    belief.base = (x, y, yaw)
            case Pattern(predicate="reached", properties=(goal,)):
                belief.around = _inside_hand(action.get(goal))
            case Pattern(predicate="located", properties=(where, _)):
                filler = action.get(where)
                for what in _things(action, pattern) or tuple(belief.holding):
                    place = _place(filler, what)
                    if place is not None and (what in belief.holding or "holding" not in given):
                        belief.put(what, place)
            case Pattern(predicate=predicate) if predicate in self._facts:
                belief.facts |= {f"{predicate}({what})": True for what in _things(action, pattern)}

    def _change(self, classes: tuple[str, ...]) -> ActionChange:
        if classes not in self._changes:
            iris = tuple(dict.fromkeys(map(expand, classes)))
            effects = [one for cls in iris for one in self.declared.effects.get(cls, ())]
            states = map(state_word, effects_of(self.ontology, iris[0], iris).states)
            self._changes[classes] = ActionChange(
                tuple((_of_roles(pattern), tuple(one.predicate for one in given)) for pattern, given in effects),
                tuple(_of_roles(pattern) for cls in iris for pattern in self.declared.ends.get(cls, ())),
                next((state for state in states if state in ("on", "off")), None),
            )
        return self._changes[classes]


def _of_roles(pattern: Pattern) -> Pattern:
    return Pattern(pattern.predicate, tuple(map(snake_case, pattern.properties)))


def _things(action: Action, pattern: Pattern) -> tuple[str, ...]:
    """Return the names of the things that a condition is about: the fillers of its last property."""
    return tuple(name for role in pattern.properties[-1:] for name in _names(action.get(role)))


def _names(filler: object) -> Iterator[str]:
    """Yield the names of things; a part of the robot is none."""
    for one in filler if isinstance(filler, tuple) else (filler,):
        if isinstance(one, Object) and not isinstance(one, Device):
            yield one.name


def _inside_hand(location: object) -> str | None:
    """Return what the hand is around when it has reached a location: what that is in the centre of."""
    if isinstance(location, Object):
        return location.name
    relations = location.relations if isinstance(location, Location) else ()
    return next((relation.reference.name for relation in relations if relation.name == "in_center_of"), None)


def _place(filler: object, what: str) -> str | None:
    """Return the name of the place where a thing is put at a location; None if that is no place, or the thing's own."""
    if isinstance(filler, Object):
        return filler.name if filler.name != what else None
    if not isinstance(filler, Location):
        return None if filler is None else str(filler)
    named = [name for relation in filler.relations if relation.name not in _OF_THE_HAND
             for name in names_of(Location((relation,))) if name != what]  # fmt: skip
    return named[0] if named else filler.name if not isinstance(filler, Posture) else None


@cache
def bundled_vocabulary() -> ActionVocabulary:
    """Return the vocabulary that comes with planlang."""
    return ActionVocabulary(load(bundled("ontologies") / "primitives.omn"))
