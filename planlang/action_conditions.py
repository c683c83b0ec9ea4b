"""Preconditions and effects of action classes, as ontologies declare them (see primitives.omn)."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import field

from planlang.designators import local_name
from planlang.kept import kept
from planlang.ontology import Literal, Ontology, Term
from planlang.records import dataclass

Named = Callable[[str], Iterable[str]]
"""Maps a property of an action to the names of the things and places that fill it."""


@dataclass(frozen=True, slots=True)
class Condition:
    """A predicate that holds for things, given by name; an empty set means any thing."""

    predicate: str
    about: frozenset[str]

    def matches(self, other: Condition) -> bool:
        """Check whether the two conditions can be the same: one predicate, and a thing in common."""
        return self.predicate == other.predicate and (
            not self.about or not other.about or not self.about.isdisjoint(other.about)
        )

    def __str__(self) -> str:
        things = min(map(local_name, self.about), default="")
        return f"{self.predicate}({things})" if things else self.predicate


@dataclass(frozen=True, slots=True)
class Pattern:
    """A condition for every action of a class: a predicate applied to properties of the action (local names)."""

    predicate: str
    properties: tuple[str, ...]

    @classmethod
    def of(cls, text: str) -> Pattern:
        """Parse ``predicate(property, ...)``."""
        predicate, _, inside = text.partition("(")
        return cls(predicate.strip(), tuple(part.strip() for part in inside.rstrip(") ").split(",") if part.strip()))

    def filled(self, fillers: Named) -> Condition:
        """Apply the predicate to the fillers of its first property."""
        return Condition(self.predicate, frozenset(fillers(self.properties[0]) if self.properties else ()))


@dataclass(frozen=True, slots=True)
class Effect:
    """A condition that becomes true if all of ``given`` hold."""

    condition: Condition
    given: tuple[Condition, ...]


@dataclass(frozen=True, slots=True)
class Declared:
    """Conditions that an ontology declares, by action class (IRI)."""

    needs: dict[str, list[Pattern]] = field(default_factory=dict)
    goals: dict[str, Pattern] = field(default_factory=dict)
    """Purpose of the actions of a class; reaching it is one of their effects."""
    effects: dict[str, list[tuple[Pattern, tuple[Pattern, ...]]]] = field(default_factory=dict)
    """Conditions that become true, each with its own preconditions."""
    ends: dict[str, list[Pattern]] = field(default_factory=dict)

    def needed(self, classes: Iterable[str], fillers: Named) -> list[Condition]:
        """Return the preconditions of an action of these classes."""
        return [one.filled(fillers) for cls in classes for one in self.needs.get(cls, ())]

    def brought(self, classes: Iterable[str], fillers: Named) -> list[Effect]:
        """Return the effects of an action of these classes."""
        found = (one for cls in classes for one in self.effects.get(cls, ()))
        return [Effect(one.filled(fillers), tuple(other.filled(fillers) for other in given)) for one, given in found]

    def ended(self, classes: Iterable[str], fillers: Named) -> list[Condition]:
        """Return the conditions that an action of these classes ends."""
        return [one.filled(fillers) for cls in classes for one in self.ends.get(cls, ())]

    def ending(self, predicate: str) -> Mapping[str, tuple[str, ...]]:
        """Map each class of actions that ends a predicate to the properties that the predicate applies to."""
        found = ((cls, [one for one in ended if one.predicate == predicate]) for cls, ended in self.ends.items())
        return {cls: tuple(name for one in ended for name in one.properties) for cls, ended in found if ended}


@kept
def declared(ontology: Ontology) -> Declared:
    """Return the declared conditions; an ontology is read once."""
    found = Declared()
    for actions, one in _stated(ontology, "Precondition"):
        for action in actions:
            found.needs.setdefault(action, []).extend(_patterns(ontology, one, "condition"))
    for actions, one in _stated(ontology, "Effect"):
        conditions, given, ends = (_patterns(ontology, one, name) for name in ("condition", "given", "ends"))
        for action in actions:
            found.effects.setdefault(action, []).extend((condition, given) for condition in conditions)
            found.ends.setdefault(action, []).extend(ends)
    for actions, one in _stated(ontology, "Goal"):
        goals = _patterns(ontology, one, "condition")
        found.goals.update((action, goal) for action in actions for goal in goals)
    for action, goal in found.goals.items():
        found.effects.setdefault(action, []).append((goal, ()))
    return found


def texts(ontology: Ontology, subject: str, property_name: str) -> tuple[str, ...]:
    """Return the values of a property as text; see :func:`text_of`."""
    return tuple(map(text_of, ontology.values(subject, property_name)))


def text_of(term: Term) -> str:
    """Return the text of a literal, the local name of an IRI, or "" for a blank node."""
    if isinstance(term, Literal):
        return term.value
    return local_name(term) if isinstance(term, str) else ""


def _stated(ontology: Ontology, kind: str) -> Iterator[tuple[tuple[str, ...], str]]:
    """Yield the individuals of a class, each with the action classes that it applies to."""
    return ((ontology.iris(one, "ofAction"), one) for one in ontology.individuals(kind))


def _patterns(ontology: Ontology, individual: str, property_name: str) -> tuple[Pattern, ...]:
    return tuple(map(Pattern.of, texts(ontology, individual, property_name)))
