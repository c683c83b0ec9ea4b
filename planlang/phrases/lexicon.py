"""The words of phrases: forms of relations, grasps and bounds, and nouns, which mean a class or a thing of a map."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from difflib import get_close_matches

from planlang.designators import GRASPS, Device, Object, Person, local_name
from planlang.ontology import Ontology, shorten
from planlang.relations import RELATIONS, Sense

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

    ``things`` are keyed by name, ``classes`` by words, each of which means one class.
    """

    things: Mapping[str, Object] = field(default_factory=dict)
    classes: Mapping[str, Object] = field(default_factory=dict)
    present: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    """Last words of classes of things -> words of those classes: "bottle" for a drinking bottle."""
    _written: Mapping[Object, str] = field(default_factory=dict)

    @staticmethod
    def of(ontology: Ontology, things: Mapping[str, Object] | None = None) -> Lexicon:
        """Return all classes of an ontology and the things of a map, by name."""
        things = dict(things or {})
        persons = {*ontology.subclasses("Person"), *ontology.subclasses("Person-Individual")}
        used = [thing.type for thing in things.values()]
        names = dict.fromkeys((*used, *(shorten(name) for name in ontology.class_names())))
        people = {shorten(person) for person in persons}
        kinds = {name: Person if name in people else Object for name in names if ":" not in name}
        return Lexicon.from_classes(kinds, things)

    @staticmethod
    def from_classes(kinds: Mapping[str, type[Object]], things: Mapping[str, Object] | None = None) -> Lexicon:
        """Return the nouns of classes by local name, each with its kind of designator; those of things count more."""
        things = dict(things or {})
        classes: dict[str, Object] = {}
        used = dict.fromkeys(thing.type for thing in things.values())
        for wording in (_whole, _head):
            meant: dict[str, list[str]] = {}
            for name in kinds:
                meant.setdefault(wording(name), []).append(name)
            for words, names in meant.items():
                chosen = [name for name in names if name in used] if len(names) > 1 else names
                if words and words not in classes and len(chosen) == 1 and _speakable(words):
                    classes[words] = kinds[chosen[0]](chosen[0])
        written: dict[Object, str] = {}
        for words, what in sorted(classes.items(), key=lambda item: (len(item[0]), item[0])):
            written.setdefault(what, words)
        present: dict[str, tuple[str, ...]] = {}
        for name in used:
            words = written.get(kinds.get(name, Object)(name), "")
            for start in range(1, len(words.split())):
                tail = " ".join(words.split()[start:])
                if tail not in classes:
                    present[tail] = (*present.get(tail, ()), words)
        for name, thing in sorted(things.items(), reverse=True):
            if _WORD.fullmatch(name) and plain(name) not in (*ENDS, *ARTICLES):
                written[thing] = name
        return Lexicon(things, classes, present, written)

    def meaning(self, words: str, *, named: bool) -> Object | tuple[str, ...]:
        """Return what a noun means; the words of all that it could mean if that is not exactly one.

        ``named``: without article, so that the thing of that name goes before the class.
        """
        said = plain(words)
        thing, cls = self.things.get(words), self.classes.get(said)
        if (found := (thing or cls) if named else (cls or thing)) is not None:
            return found
        several = self.present.get(said, ())
        return self.classes[several[0]] if len(several) == 1 else several

    def wording(self, what: Object) -> str | None:
        """Return the words that mean exactly this designator, the shortest there are; None if no words do."""
        return self._written.get(what)

    def similar(self, words: str) -> str | None:
        """Return the known noun that looks most like words that are none."""
        names = {plain(name): name for name in (*self.classes, *self.present, *self.things)}
        close = get_close_matches(plain(words), list(names), n=1, cutoff=0.7)
        return names[close[0]] if close else None

    def known(self) -> Iterable[str]:
        """Return what to tell somebody who looks for nouns: the things of the map, or else the classes."""
        return self.things or self.classes


def _whole(name: str) -> str:
    """ "drinking bottle" of DrinkingBottle."""
    return " ".join(_PIECES.findall(local_name(name))).lower()


def _head(name: str) -> str:
    """ "bed" of Bed-PieceOfFurniture."""
    return _whole(name.partition("-")[0])


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
