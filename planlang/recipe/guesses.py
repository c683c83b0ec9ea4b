"""Guesses which known name a misspelt one means."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from difflib import SequenceMatcher

from planlang.designators import local_name
from planlang.diagnostics import Rename
from planlang.kept import kept
from planlang.ontology import Ontology, expand
from planlang.ontology.terms import RDF, RDFS, Literal
from planlang.recipe.fillers import is_vocabulary_class
from planlang.spelling import Spellings

SURE = 0.85
"""Minimum similarity (difflib) to correct a name unasked, if no other name is as similar: one letter in seven."""

_BETWEEN_WORDS = re.compile(r"[_\-]+|(?<=[a-z0-9])(?=[A-Z])")

LIKE = 0.7
"""Minimum similarity (difflib) of names, without their common endings, for a suggestion."""


def guess(
    written: str, names: Iterable[str], *, least: float = 0.6, telling: Callable[[str], str] = local_name
) -> Rename | None:
    """Find the name (IRI) most similar to ``written`` (IRI); see :class:`Known`."""
    return Known(names, telling).guess(written, least)


class Known:
    """Known names (IRIs), indexed by their local parts to guess which of them many misspelt names mean.

    ``telling`` extracts the part of an IRI to compare, for names that share an uninformative ending.
    """

    def __init__(self, names: Iterable[str], telling: Callable[[str], str] = local_name) -> None:
        self._telling = telling
        self._names = dict.fromkeys(names)
        self._by_part: dict[str, str] = {}
        for name in self._names:
            self._by_part.setdefault(telling(name), name)
        self._parts = Spellings(self._by_part)

    def guess(self, written: str, least: float = 0.6) -> Rename | None:
        """Find another name most similar to ``written`` (IRI); None below the similarity ``least``.

        The result is sure if it is the only nearly equal name, and differs in more than a number: ``cup1`` is no
        misspelling of ``cup2``.
        """
        if written in self._names:
            return Known((name for name in self._names if name != written), self._telling).guess(written, least)
        short = self._telling(written)
        similar_parts = self._parts.similar(short, n=2, least=least)
        if not similar_parts:
            return None
        near = [name for name in similar_parts if SequenceMatcher(None, name, short).ratio() >= SURE]
        is_sure = len(near) == 1 and digits_of(near[0]) == digits_of(short)
        return Rename(written, self._by_part[similar_parts[0]], is_sure=is_sure)


@kept
def classes_of_vocabulary(ontology: Ontology) -> Known:
    """Classes of the bundled vocabulary, for guesses."""
    return Known(filter(is_vocabulary_class, ontology.class_names()))


def class_called(ontology: Ontology, written: str) -> Rename | None:
    """Find the class of the vocabulary that everyday words for it call as a name (IRI) does, ``ChestOfDrawers``."""
    found = _classes_by_words(ontology).get(_BETWEEN_WORDS.sub(" ", local_name(written)).lower())
    return None if found is None or found == written else Rename(written, found, is_sure=False)


@kept
def _classes_by_words(ontology: Ontology) -> dict[str, str]:
    """Labels and everyday words of the vocabulary's classes, in small letters -> the first class with them."""
    classes: dict[str, str] = {}
    for triple in (*ontology.triples(p=expand("alsoCalled")), *ontology.triples(p=RDFS.label)):
        cls, words = triple.subject, triple.object
        if isinstance(cls, str) and isinstance(words, Literal) and is_vocabulary_class(cls):
            classes.setdefault(words.value.lower(), cls)
    return classes


@kept
def classes_of_actions(ontology: Ontology) -> Known:
    """Classes of actions, for guesses."""
    return Known(ontology.subclasses(expand("Action")))


def classes_beside(ontology: Ontology, iri: str) -> list[str]:
    """Classes of actions in the namespace of an IRI."""
    namespace = iri.removesuffix(local_name(iri))
    return [cls for cls in ontology.subclasses(expand("Action")) if cls.startswith(namespace)]


def nearest_action(ontology: Ontology, iri: str) -> Rename | None:
    """Guess the class of actions that an undefined name means, preferably one of the same namespace."""
    return Known(classes_beside(ontology, iri)).guess(iri) or classes_of_actions(ontology).guess(iri)


@kept
def names_of_file(ontology: Ontology) -> Known:
    """Names that the main document gives a type, for guesses."""
    subjects = (triple.subject for triple in ontology.triples(p=RDF.type))
    return Known(name for name in subjects if isinstance(name, str) and ontology.main(name))


def without_number(iri: str) -> str:
    """Local name without the number of a copy: ``Waiting`` for ``Waiting2``."""
    name = local_name(iri)
    return name.rstrip("0123456789").rstrip("_-") or name


def digits_of(name: str) -> str:
    """All digits of a name."""
    return "".join(filter(str.isdecimal, name))
