"""The words of phrases: forms of relations, grasps and bounds, and nouns, which mean a class or a thing of a map."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import field

from planlang.designators import GRASPS, Device, Object, Person, local_name
from planlang.ontology import Literal, Ontology, expand, shorten
from planlang.ontology.terms import RDFS
from planlang.records import dataclass
from planlang.relations import RELATIONS, Sense
from planlang.spelling import similar

GRASP_FORMS: dict[str, tuple[str, ...]] = {
    "side": ("from the side", "with a side grasp"),
    "tilted": ("at a tilt", "with a tilted grasp"),
    "top": ("from the top", "from above", "with a top grasp"),
}
"""Grasp -> its forms; all of :data:`planlang.designators.GRASPS`."""

ENDS = ("and", "but", "with", "from", "at", "called")
"""Words that no noun contains: after a noun something else begins with them."""

ARTICLES = ("the", "a", "an", "any")
"""Words that stand before a noun and in none."""

LIMITS = {"at most": "within", "up to": "within", "at least": "beyond", "more than": "beyond", "less than": "within"}
"""Words before the greatest or the least length -> the bound of the relation."""

LONGEST, DEEPEST = 20_000, 20
"""Characters of a phrase, and places within each other, that are read at most."""

assert GRASP_FORMS.keys() == set(GRASPS)

KINDS: dict[str, type[Object]] = {"thing": Object, "person": Person, "device": Device}
"""Nouns before a class in brackets: "the person <Visitor>"."""

SIDES, PARTS = ("right", "left"), ("arm", "hand", "gripper")
DEVICES: dict[str, Device] = {
    **{f"{side} {part}": Device(f"{side.capitalize()}{part.capitalize()}") for side in SIDES for part in PARTS},
    **{part: Device(part.capitalize()) for part in PARTS},
}
"""Names of arms and hands by side: words -> device."""

_PIECES = re.compile(r"[A-Z]+(?=[A-Z][a-z])|[A-Z]?[a-z]+|[A-Z]+|\d+")
_WORD = re.compile(r"[^\W\d](?:[\w.:-]*\w)?")


@dataclass(frozen=True, slots=True)
class Lexicon:
    """Meanings of nouns.

    ``things`` are keyed by name, ``classes`` by words, each of which means one class, or a thing by its label.
    """

    things: Mapping[str, Object] = field(default_factory=dict)
    classes: Mapping[str, Object] = field(default_factory=dict)
    present: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    """Last words of several classes of things -> words of those classes: "bottle" for drinking and wine bottles."""
    _written: Mapping[Object, str] = field(default_factory=dict)
    _there: frozenset[str] = frozenset()
    """Classes, above those of things too, that things belong to."""

    @staticmethod
    def of(ontology: Ontology, things: Mapping[str, Object] | None = None) -> Lexicon:
        """Return all classes of an ontology and the things of a map, by name, label, and what they are also called."""
        things = dict(things or {})
        persons = {*ontology.subclasses("Person"), *ontology.subclasses("Person-Individual")}
        used = dict.fromkeys(thing.type for thing in things.values())
        names = dict.fromkeys((*used, *(shorten(name) for name in ontology.class_names())))
        people = {shorten(person) for person in persons}
        kinds = {name: Person if name in people else Object for name in names if ":" not in name or name in used}
        called: dict[str, list[str]] = {}
        for triple in (*ontology.triples(p=expand("alsoCalled")), *ontology.triples(p=RDFS.label)):
            if isinstance(triple.object, Literal) and isinstance(triple.subject, str):
                words = triple.object.value if triple.predicate == RDFS.label else _whole(triple.object.value)
                called.setdefault(shorten(triple.subject), []).append(plain(words))
        there = {shorten(cls) for name in used for cls in ontology.ancestors(name)}
        return Lexicon.from_classes(kinds, things, called, there)

    @staticmethod
    def from_classes(
        kinds: Mapping[str, type[Object]],
        things: Mapping[str, Object] | None = None,
        called: Mapping[str, Sequence[str]] | None = None,
        there: Collection[str] = (),
    ) -> Lexicon:
        """Return the nouns of classes by local name, each with its kind of designator; those of things count more.

        ``called`` are further words for classes, and for things by their IRIs; ``there`` are the classes, above those
        of things too, that things belong to. Words of no such class may be the last words of one.
        """
        things, called = dict(things or {}), called or {}
        used = dict.fromkeys(thing.type for thing in things.values())
        own: dict[str, Object] = {}
        for wording in (_whole, _head):
            _add(own, ((wording(name), kinds[name](name)) for name in kinds), used)
        classes = dict(own)
        _add(classes, ((words, thing) for thing in things.values() for words in called.get(thing.iri or "", ())), used)
        _add(classes, ((words, kinds[name](name)) for name in kinds for words in called.get(name, ())), used)
        tails: dict[str, dict[Object, str]] = {}
        for words, what in sorted(classes.items(), key=lambda item: (len(item[0]), item[0])):
            parts = words.split()
            for start in range(1, len(parts)) if what.type in used else ():
                tails.setdefault(" ".join(parts[start:]), {}).setdefault(what, words)
        present: dict[str, tuple[str, ...]] = {}
        for tail, meant in tails.items():
            if tail in classes and classes[tail].type in (*there, *used):
                continue
            if len(meant) == 1:
                classes[tail] = next(iter(meant))
            elif tail not in classes:
                present[tail] = tuple(meant.values())
        written: dict[Object, str] = {}
        for words, what in sorted(own.items(), key=lambda item: (len(item[0]), item[0])):
            if classes[words] == what:
                written.setdefault(what, words)
        for name, thing in sorted(things.items(), reverse=True):
            if _WORD.fullmatch(name) and plain(name) not in (*ENDS, *ARTICLES):
                written[thing] = name
        return Lexicon(things, classes, present, written, frozenset((*there, *used)))

    def meaning(self, words: str, *, named: bool) -> Object | tuple[str, ...]:
        """Return what a noun means; the words of all that it could mean if that is not exactly one.

        ``named``: without article, so that the thing of that name goes before the class.
        """
        said = plain(words)
        thing, cls = self.things.get(words), self.classes.get(said)
        if (found := (thing or cls) if named else (cls or thing)) is not None:
            return found
        return self.present.get(said, ())

    def wording(self, what: Object) -> str | None:
        """Return the words that mean exactly this designator, the shortest there are; None if no words do."""
        return self._written.get(what)

    def similar(self, words: str) -> str | None:
        """Return the known noun that looks most like words that are none: of a map rather one for something in it."""
        there = (name for name, what in self.classes.items() if what.type in self._there)
        is_thing = words[-1:].isdigit()  # bottle7 is a thing's name, and no class was meant
        for known in ((*there, *self.present, *self.things), () if is_thing and self.things else self.classes):
            names = {plain(name): name for name in known}
            if alike := similar(plain(words), names, least=0.7):
                return names[alike[0]]
        return None

    def known(self) -> Iterable[str]:
        """Return what to tell somebody who looks for nouns: the things of the map, or else the classes."""
        return self.things or self.classes


def _add(classes: dict[str, Object], worded: Iterable[tuple[str, Object]], used: Collection[str]) -> None:
    """Add words that mean one class or thing, or one of those in use, unless they mean something already."""
    meant: dict[str, dict[Object, None]] = {}
    for words, what in worded:
        meant.setdefault(words, {})[what] = None
    for words, whats in meant.items():
        chosen = [what for what in whats if what.type in used] if len(whats) > 1 else [*whats]
        if words and words not in classes and len(chosen) == 1 and _speakable(words):
            classes[words] = chosen[0]


def _whole(name: str) -> str:
    """Return "drinking bottle" for DrinkingBottle."""
    return " ".join(_PIECES.findall(local_name(name))).lower()


def _head(name: str) -> str:
    """Return "bed" for Bed-PieceOfFurniture."""
    return _whole(local_name(name).partition("-")[0])


def _speakable(words: str) -> bool:
    parts = words.split()
    return all(_WORD.fullmatch(part) and part not in (*ENDS, *ARTICLES) for part in parts)


def forms() -> dict[str, str]:
    """Return how relations are said: each form with the name of its relation."""
    return {form: name for name, relation in RELATIONS.items() for form in relation.forms}


def opposites() -> dict[str, str]:
    """Return what says the opposite of a relation, "blocking" of what is not clear of something, with its name."""
    return {
        form.removeprefix("not "): name
        for name, relation in RELATIONS.items()
        for form in relation.forms
        if form.startswith("not ")
    }


def viewpoints() -> tuple[str, ...]:
    """Return what says from where something is seen, which also stands behind another relation without "and"."""
    return tuple(form for form, name in forms().items() if RELATIONS[name].sense("thing") is Sense.VIEWPOINT)


def pattern(forms: tuple[str, ...]) -> str:
    """Return a regular expression for any of the forms, the longest first, with any space between the words."""
    ordered = sorted(forms, key=lambda form: (-len(form), form))
    return "|".join(r"\s+".join(map(re.escape, form.split())) for form in ordered)


def plain(text: str) -> str:
    """Return lower case, one space between words."""
    return " ".join(text.lower().split())
