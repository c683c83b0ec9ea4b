"""Knowledge of the scripted robot about actions, from the ontology: modules, required resources, and effects."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache

from planlang.action_conditions import Pattern, declared
from planlang.changes import Switched
from planlang.designators import Action, Device, Location, Object, Posture, snake_case
from planlang.effects import effects_of
from planlang.files import bundled
from planlang.ontology import Ontology, expand, load, shorten
from planlang.recipe.actions import read_primitives
from planlang.records import dataclass
from planlang.state.matter import OFF, ON
from planlang.testing.script import Belief, names_of

_OF_THE_HAND = ("in_center_of", "in_front_of")
"""Relations of poses of the hand. An object that the hand moves is not there; one that is put down may be."""


@dataclass(frozen=True, slots=True)
class ActionChange:
    """Effects of an action, by its classes. The properties of patterns are roles (``object_acted_on``)."""

    achieved: tuple[tuple[Pattern, tuple[str, ...]], ...]
    """Conditions that the action achieves, with the predicates that must hold before."""
    ended: tuple[Pattern, ...]
    switched: str | None
    """State of devices afterwards, such as DeviceStateOn."""


class ActionVocabulary:
    """The classes of actions of an ontology."""

    def __init__(self, ontology: Ontology) -> None:
        self.ontology = ontology
        self.declared = declared(ontology)
        self._primitives = {shorten(action): primitive for action, primitive in read_primitives(ontology).items()}
        self._releasing = frozenset(map(shorten, self.declared.ending("holding")))
        self._facts = frozenset(goal.predicate for goal in self.declared.goals.values()) - {"holding"}
        """Predicates that the belief stores as facts only."""
        self._changes: dict[tuple[str, ...], ActionChange] = {}

    def modules(self) -> dict[str, tuple[str, ...]]:
        """Map the names of process modules to the action classes that they perform."""
        modules: dict[str, tuple[str, ...]] = {}
        for action, primitive in self._primitives.items():
            modules[primitive.module] = (*modules.get(primitive.module, ()), action)
        return modules

    def ancestors(self, cls: str) -> tuple[str, ...]:
        """The class itself and its superclasses, nearest first, by their names in the vocabulary."""
        return tuple(map(shorten, self.ontology.ancestors(expand(cls))))

    def roles(self, classes: tuple[str, ...]) -> tuple[str, ...]:
        """Parts of the robot (base, head, torso, arm, gripper) that an action needs, by its nearest class."""
        return next((self._primitives[cls].resources for cls in classes if cls in self._primitives), ())

    def releases(self, classes: tuple[str, ...]) -> bool:
        """Check whether actions of these classes release an object."""
        return not self._releasing.isdisjoint(classes)

    def change(self, belief: Belief, action: Action, classes: tuple[str, ...], about: str | None = None) -> None:
        """Apply the effects of an action that has succeeded.

        A step that names nothing lets go only of what it is ``about``, if an action around says that.
        """
        change = self._change(classes)
        for pattern, given in change.achieved:
            self._achieve(belief, action, pattern, given)
        for pattern in change.ended:
            if pattern.predicate == "holding":
                for what in _things(action, pattern) or (about,):
                    belief.drop(what)
            elif pattern.predicate in self._facts:
                belief.facts |= {f"{pattern.predicate}({what})": False for what in _things(action, pattern)}
        for pattern, given in change.achieved:
            if pattern.predicate == "holding":
                for what in _things(action, pattern) or ((belief.around,) if "reached" in given else ()):
                    belief.hold(what)
        if change.switched is not None:
            for what in _names(action.get("object_acted_on")):
                belief.happens(Switched(what, change.switched))

    def _achieve(self, belief: Belief, action: Action, pattern: Pattern, given: tuple[str, ...]) -> None:
        """Apply an achieved condition, except "holding", as an object held before has to be released first."""
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
                    place = _place(filler, what, of_hand="holding" in given)
                    if place is not None and (what in belief.holding or "holding" not in given):
                        belief.put(what, place)
            case Pattern(predicate=predicate) if predicate in self._facts:
                belief.facts |= {f"{predicate}({what})": True for what in _things(action, pattern)}

    def _change(self, classes: tuple[str, ...]) -> ActionChange:
        if classes not in self._changes:
            iris = tuple(dict.fromkeys(map(expand, classes)))
            effects = [effect for cls in iris for effect in self.declared.effects.get(cls, ())]
            states = map(shorten, effects_of(self.ontology, iris[0], iris).states)
            self._changes[classes] = ActionChange(
                tuple((_with_roles(pattern), tuple(need.predicate for need in given)) for pattern, given in effects),
                tuple(_with_roles(pattern) for cls in iris for pattern in self.declared.ends.get(cls, ())),
                next((state for state in states if state in (ON, OFF)), None),
            )
        return self._changes[classes]


def _with_roles(pattern: Pattern) -> Pattern:
    return Pattern(pattern.predicate, tuple(map(snake_case, pattern.properties)))


def _things(action: Action, pattern: Pattern) -> tuple[str, ...]:
    """Names of the objects of a condition: the fillers of its last property."""
    return tuple(name for role in pattern.properties[-1:] for name in _names(action.get(role)))


def _names(filler: object) -> Iterator[str]:
    """Yield the names of objects, without parts of the robot."""
    for item in filler if isinstance(filler, tuple) else (filler,):
        if isinstance(item, Object) and not isinstance(item, Device):
            yield item.name


def _inside_hand(location: object) -> str | None:
    """Object between the fingers when the hand has reached a location: the one whose centre that is."""
    if isinstance(location, Object):
        return location.name
    relations = location.relations if isinstance(location, Location) else ()
    return next((relation.references[0].name for relation in relations if relation.name == "in_center_of"), None)


def _place(filler: object, what: str, *, of_hand: bool) -> str | None:
    """Name of the place where an object is put; None for a pose ``of_hand``, or if only the object itself is named."""
    if isinstance(filler, Object):
        return filler.name if filler.name != what else None
    if not isinstance(filler, Location):
        return None if filler is None else str(filler)
    supports = [relation for relation in filler.relations if relation.name not in _OF_THE_HAND]
    others = () if of_hand else filler.relations
    names = (name for relation in (*supports, *others) for name in names_of(Location((relation,))) if name != what)
    return next(names, filler.name if not isinstance(filler, Posture) else None)


@cache
def bundled_vocabulary() -> ActionVocabulary:
    """The vocabulary bundled with planlang."""
    return ActionVocabulary(load(bundled("ontologies") / "primitives.omn"))
