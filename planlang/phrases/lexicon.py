"""Vocabulary of phrases: relations, grasps, bounds, and nouns for classes and for things of a map."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import field, replace

from planlang.designators import GRASPS, Device, Object, Person, is_called, local_name
from planlang.ontology import Literal, Ontology, expand, shorten
from planlang.ontology.terms import RDFS
from planlang.records import dataclass
from planlang.relations import RELATIONS
from planlang.relations.looking import SeenFrom
from planlang.spelling import similar

GRASP_FORMS: dict[str, tuple[str, ...]] = {
    "side": ("from the side", "with a side grasp"),
    "tilted": ("at a tilt", "with a tilted grasp"),
    "top": ("from the top", "from above", "with a top grasp"),
}
"""Forms of each grasp in :data:`planlang.designators.GRASPS`."""

ENDS = ("and", "but", "with", "from", "at", "called")
"""Words that cannot be part of a noun, because they start whatever may follow one."""

ARTICLES = ("the", "a", "an", "any")
"""Words before a noun, which cannot be part of one."""

LIMITS = {"at most": "within", "up to": "within", "at least": "beyond", "more than": "beyond", "less than": "within"}
"""Words before a length -> the bound of the relation."""

LONGEST, DEEPEST = 20_000, 20
"""Limits for the length of a phrase [characters] and for nested places."""

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

    ``things`` maps names to things; ``classes`` maps words to the one class, or labelled thing, that they mean.
    """

    things: Mapping[str, Object] = field(default_factory=dict)
    classes: Mapping[str, Object] = field(default_factory=dict)
    present: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    """Ambiguous last words -> the words of the classes: "bottle" for drinking and wine bottles."""
    _written: Mapping[Object, str] = field(default_factory=dict)
    _there: frozenset[str] = frozenset()
    """Classes of the things, superclasses included."""

    @staticmethod
    def of(ontology: Ontology, things: Mapping[str, Object] | None = None, substances: Iterable[str] = ()) -> Lexicon:
        """Make the lexicon of an ontology's classes and a map's things: by name, label and ``alsoCalled``.

        Classes of other namespaces than planlang's count if a thing, or one of the ``substances``, is of them.
        """
        things = dict(things or {})
        persons = {*ontology.subclasses("Person"), *ontology.subclasses("Person-Individual")}
        used = dict.fromkeys((*(thing.type for thing in things.values()), *map(shorten, substances)))
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
        """Make a lexicon of classes, given by local name with their kind of designator.

        ``called`` has further words for classes by name, and for things by IRI. ``there`` are the classes of the
        things, superclasses included; ambiguous words mean one of these first. The last words of such a class, "bottle"
        of "drinking bottle", mean it too, unless they name another such class.
        """
        things, called = dict(things or {}), called or {}
        used = dict.fromkeys(thing.type for thing in things.values())
        own: dict[str, Object] = {}
        _add(own, ((_whole(name), kinds[name](name)) for name in kinds), used)
        heads = {name: local_name(name).partition("-")[0] for name in kinds}  # Bed-PieceOfFurniture is a bed
        _add(own, ((_whole(head), kinds[name](name)) for name, head in heads.items()), used)
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

    def with_things(self, things: Mapping[str, Object]) -> Lexicon:
        """Make a lexicon of the same classes with other things."""
        return replace(self, things=things)

    def meaning(self, words: str, *, named: bool) -> Object | tuple[str, ...]:
        """Look up a noun; if it is ambiguous, return the words of all candidates, and () if it is unknown.

        ``named``: it has no article, so the thing of that name takes precedence over the class.
        """
        said = plain(words)
        thing, cls = self.thing(words), self.classes.get(said) or self.classes.get(_whole(words))
        if (found := (thing or cls) if named else (cls or thing)) is not None:
            return found
        return self.present.get(said, ())

    def thing(self, name: str) -> Object | None:
        """Find a thing by its name, IRI, or local name; None if there is none."""
        known = self.things.get(name)
        iris = ((one.iri, one) for one in self.things.values()) if known is None else ()
        return known or next((one for iri, one in iris if iri is not None and is_called(iri, name)), None)

    def wording(self, what: Object) -> str | None:
        """Return the shortest words that mean exactly this designator; None if there are none."""
        return self._written.get(what)

    def similar(self, words: str) -> str | None:
        """Find the known noun most similar to unknown words; nouns for things of the map come first."""
        there = (name for name, what in self.classes.items() if what.type in self._there)
        is_thing = words[-1:].isdigit()  # bottle7 is a thing's name, and no class was meant
        for known in ((*there, *self.present, *self.things), () if is_thing and self.things else self.classes):
            names = {plain(name): name for name in known}
            if alike := similar(plain(words), names, least=0.7):
                return names[alike[0]]
        return None

    def known(self) -> Iterable[str]:
        """Nouns to suggest: the things of the map or, without a map, the classes."""
        return self.things or self.classes


def _add(classes: dict[str, Object], worded: Iterable[tuple[str, Object]], used: Collection[str]) -> None:
    """Add words with one meaning, or one in use on the map, unless they are taken."""
    meant: dict[str, dict[Object, None]] = {}
    for words, what in worded:
        meant.setdefault(words, {})[what] = None
    for words, whats in meant.items():
        chosen = [what for what in whats if what.type in used] if len(whats) > 1 else [*whats]
        if words and words not in classes and len(chosen) == 1 and _speakable(words):
            classes[words] = chosen[0]


def _whole(name: str) -> str:
    """Convert DrinkingBottle to "drinking bottle"."""
    return " ".join(_PIECES.findall(local_name(name))).lower()


def _speakable(words: str) -> bool:
    parts = words.split()
    return all(_WORD.fullmatch(part) and part not in (*ENDS, *ARTICLES) for part in parts)


def forms(*arities: int) -> dict[str, str]:
    """Map each form to the name of its relation; only of relations to so many things, if any are given."""
    every = ((name, one) for name, one in RELATIONS.items() if not arities or one.arity in arities)
    return {form: name for name, one in every for form in one.forms}


def opposites() -> dict[str, str]:
    """Map the forms of complements to the relation: "blocking" to ``clear_of``."""
    return {
        form.removeprefix("not "): name
        for name, relation in RELATIONS.items()
        for form in relation.forms
        if form.startswith("not ")
    }


def viewpoints() -> tuple[str, ...]:
    """Forms of viewpoints, such as "seen from", which may follow another relation without "and"."""
    return tuple(form for form, name in forms().items() if isinstance(RELATIONS[name], SeenFrom))


def pattern(forms: tuple[str, ...]) -> str:
    """Make a regular expression for any of the forms, longest first, with any whitespace between words."""
    ordered = sorted(forms, key=lambda form: (-len(form), form))
    return "|".join(r"\s+".join(map(re.escape, form.split())) for form in ordered)


def plain(text: str) -> str:
    """Convert to lower case with single spaces."""
    return " ".join(text.lower().split())
