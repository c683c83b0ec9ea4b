"""Misspelt names in a recipe's file: words of the recipe vocabulary, classes, individuals, outcomes.

Each is reported once, as an error. The recipe is then read with the corrected names, so that consequences of a typo
are not reported. A name is misspelt if nothing defines it and one typo makes it a known name; names that are merely
foreign are left alone. A name that the file itself declares outside the vocabularies may be intended: it is kept,
with a warning.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from difflib import get_close_matches
from functools import cached_property

from planlang.closure import grouped
from planlang.designators import local_name, local_part
from planlang.diagnostics import Diagnostic, Rename, Severity, Span, error, warning
from planlang.ontology import Ontology, shorten
from planlang.ontology.terms import KNOWROB, LANGUAGES, OWL, RDF, RDFS, VOCABULARIES, is_vocabulary
from planlang.recipe.checks import check
from planlang.recipe.fillers import action_properties
from planlang.recipe.guesses import SURE, digits_of
from planlang.recipe.readers import OUTPUTS
from planlang.recipe.readers.workflow import RELATIONS as INTERVALS
from planlang.recipe.readers.workflow import is_interval_relation
from planlang.recipe.statements import (
    CONSTRAINT_CLASSES,
    MEANINGS,
    REGISTERED_WORDS,
    WORDS,
    ending_of,
    is_word,
    words_of,
)
from planlang.relations import owl_properties

_NAMING = (
    RDF.type, RDFS.subClassOf, OWL.equivalentClass, RDF.first,
    *(OWL + name for name in ("someValuesFrom", "hasValue", "allValuesFrom", "onClass")),
)  # fmt: skip
"""Properties of OWL whose objects are names that should be defined."""

_OUTCOMES = {word: ending for ending, words in MEANINGS.items() for word in words}
_WORDS_OF_THEIR_OWN = frozenset({"falling"})
"""Words of outcomes that mean something else than the ending word that is one typo away."""
_SURE_OUTCOME = 0.9
"""Minimum similarity for outcomes, higher than ``SURE`` because they are inflected (``obtained``)."""


@check("R058")
def misspellings(ontology: Ontology) -> tuple[Diagnostic, ...]:
    """Report each misspelt name of the main document, with its correction, in the order of the file.

    It is an error, or a warning if the document declares the name.
    """
    names = _Names(ontology)
    diagnostics = [*_properties(ontology, names), *_things(ontology, names), *_outcomes(ontology)]
    return tuple(sorted(diagnostics, key=lambda one: one.span or Span("")))


def with_corrections(ontology: Ontology, diagnostics: Iterable[Diagnostic], *, guessing: bool = False) -> Ontology:
    """Correct misspelt names in the ontology: those with one plausible correction, or all if ``guessing``.

    Gives the same ontology if nothing changes.
    """
    errors = (one for one in diagnostics if one.severity is Severity.ERROR)
    renames = [one.suggestion for one in errors if isinstance(one.suggestion, Rename)]
    names = {one.written: one.meant for one in renames if one.is_sure or guessing}
    return ontology.renamed(names) if names else ontology


class _Names:
    """Names that a recipe may use, and the undefined ones among those that it does use."""

    def __init__(self, ontology: Ontology) -> None:
        self._ontology = ontology
        self._store = ontology.store
        self._main = ontology.store.ranges[0]

    @cached_property
    def own(self) -> tuple[str, ...]:
        """Namespaces in which the main document defines something, the one with the most names first."""
        defined = dict.fromkeys(self._store.subjects[row] for row in self._defining if row in self._main)
        spaces = Counter(map(_space, filter(None, map(self._store.name, defined))))
        return tuple(space for space, _ in spaces.most_common() if space not in LANGUAGES)

    @cached_property
    def _defined(self) -> frozenset[int]:
        return frozenset(map(self._store.subjects.__getitem__, self._defining))

    @cached_property
    def _defining(self) -> Sequence[int]:
        return self._store.by(RDF.type, RDFS.subClassOf, OWL.equivalentClass, RDFS.subPropertyOf)

    @cached_property
    def properties(self) -> dict[int, int]:
        """Properties that the main document uses, each with the row of its first use."""
        store, main = self._store, self._main
        restricted = {store.objects[row]: row for row in reversed(store.by(OWL.onProperty)) if row in main}
        stated = {number: rows[0] for number in store.used if (rows := store.by(store.name(number) or ""))}
        first_uses = restricted | {
            number: min(row, restricted.get(number, row)) for number, row in stated.items() if row in main
        }
        return dict(sorted(first_uses.items(), key=lambda one: one[1]))

    def is_known_property(self, number: int) -> bool:
        """True for a property about which any document states more than that it is a property."""
        name = self._store.name(number)
        if name is None or name.startswith(LANGUAGES) or is_vocabulary(shorten(name)) or _is_read(name):
            return True
        rows = list(self._store.about(number))
        return any(row not in self._main or self._store.name(self._store.predicates[row]) != RDF.type for row in rows)

    @cached_property
    def spaces_of_words(self) -> frozenset[str]:
        """Namespaces in which this file may have words of the recipe vocabulary."""
        names = (self._store.name(number) or "" for number in self.properties)
        return frozenset((*VOCABULARIES.values(), *self.own, *(_space(name) for name in names if _is_read(name))))

    @cached_property
    def undefined(self) -> dict[str, int]:
        """Names (IRIs) that the main document uses but nothing defines, each with the row of its first use."""
        store = self._store
        outputs = {store.objects[row] for row in store.by(*self._ontology.properties_named(*OUTPUTS))}
        naming = {store.numbers[name] for name in _NAMING if name in store.numbers}
        naming |= {number for number in self.properties if self._links(number)}
        words = (store.name(number) or "" for number in naming)
        used = frozenset[int]().union(*(map(store.objects.__getitem__, store.by(word)) for word in words))
        first_uses: dict[str, int] = {}
        for number in used - self._defined - outputs:
            name = store.name(number)
            is_other = name is not None and name != RDF.nil and not name.startswith(LANGUAGES)
            if name is not None and is_other and not self._ontology.defined(name):
                rows = (row for row in store.with_object(number) if store.predicates[row] in naming)
                row = next(rows)
                if row in self._main:
                    first_uses[name] = row
        return dict(sorted(first_uses.items(), key=lambda one: one[1]))

    def _links(self, number: int) -> bool:
        """True for an object property of the recipe vocabulary, whose objects are names."""
        name = self._store.name(number) or ""
        return not name.startswith(LANGUAGES) and (_is_read(name) or is_vocabulary(shorten(name)))

    def span(self, row: int) -> Span:
        return self._store.span(row)

    @cached_property
    def _known(self) -> dict[str, list[str]]:
        """Local name -> classes and individuals (IRIs) with this local name."""
        store = self._store
        outputs = (store.objects[row] for row in store.by(*self._ontology.properties_named(*OUTPUTS)))
        names = (store.name(number) or "" for number in dict.fromkeys((*sorted(self._defined), *outputs)))
        things = (name for name in names if not name.startswith(LANGUAGES) and not self._ontology.is_property(name))
        return grouped((local_name(name), name) for name in things if name)

    @cached_property
    def _neighbours(self) -> Neighbours:
        return Neighbours(self._known)

    def candidates(self, written: str) -> list[str]:
        """Candidates (IRIs) for an undefined name: the same name in another namespace, or a similar one in the same.

        Names that differ in the case of the first letter only, such as ``cup`` and its class ``Cup``, are not
        candidates for each other.
        """
        kinds = {self._store.numbers.get(RDF.type), self._store.numbers.get(RDFS.subClassOf)}
        is_kind = self._store.predicates[self.undefined[written]] in kinds
        space, short = _space(written), local_name(written)
        same = [name for name in self._known.get(short, ()) if self._are_mixed(space, _space(name))]
        near = (name for other in self._neighbours.of(short) for name in self._known[other])
        return same or [
            name
            for name in near
            if _space(name) == space
            and (local_name(name)[1:] != short[1:] or (is_kind and self._ontology.is_class(name)))
        ]

    def _are_mixed(self, written: str, meant: str) -> bool:
        """True for namespaces that are easily confused: the file's own and those of the vocabulary."""
        first, vocabulary = next(iter(self.own), None), VOCABULARIES.values()
        return (meant in vocabulary and (written == first or written in vocabulary)) or (
            written in vocabulary and meant == first
        )


def _properties(ontology: Ontology, names: _Names) -> Iterator[Diagnostic]:
    """Report properties that are one typo from a word of the recipe vocabulary or a property of KnowRob."""
    unknown = {number: row for number, row in names.properties.items() if not names.is_known_property(number)}
    if not unknown:
        return
    listed = {local_name(name): name for name in _vocabulary(ontology)}
    neighbours = Neighbours((*listed, *WORDS, *REGISTERED_WORDS, *owl_properties()))
    recipe_words = (*WORDS, *REGISTERED_WORDS, *owl_properties(), *map(local_name, action_properties(ontology)))
    for number, row in unknown.items():
        written = ontology.store.name(number) or ""
        space, short = _space(written), local_name(written)
        if space not in names.spaces_of_words:
            continue
        near = neighbours.of(short) or get_close_matches(short, recipe_words, n=2, cutoff=SURE)
        if not near and _relates_tasks(ontology, written):
            plain = short.lower().removeprefix("interval").removeprefix("temporally")
            before = short[: len(short) - len(plain)]
            near = [before + (word.capitalize() if before else word) for word in Neighbours(INTERVALS).of(plain)]
        if near:
            candidates = [_in_namespace(ontology, written, word, listed) for word in near]
            if space not in VOCABULARIES.values() and _is_declared(ontology, written):
                yield _unusual(written, candidates, names.span(row))
                continue
            message = f"unknown property `{short}`: its statements would be lost"
            yield _misspelt(written, candidates, names.span(row), message)


def _vocabulary(ontology: Ontology) -> Iterator[str]:
    """Yield the properties that the bundled vocabulary declares."""
    kinds = (OWL + kind for kind in ("ObjectProperty", "DatatypeProperty", "AnnotationProperty"))
    for kind in kinds:
        for triple in ontology.triples(p=RDF.type, o=kind):
            if isinstance(triple.subject, str) and is_vocabulary(shorten(triple.subject)):
                yield triple.subject


def _in_namespace(ontology: Ontology, written: str, word: str, listed: dict[str, str]) -> str:
    """Word in its intended namespace: the namespace of the written name if it uses the word, else KnowRob's."""
    space = _space(written)
    if space + word != written and space + word in ontology.properties_named(word):
        return space + word
    return listed.get(word) or (space if space in VOCABULARIES.values() else KNOWROB) + word


def _relates_tasks(ontology: Ontology, name: str) -> bool:
    """True for a property that links steps of workflows to each other."""
    steps = {
        term for triple in ontology.using("hasStep", "isStepOf", "stepOf") for term in (triple.subject, triple.object)
    }
    return bool(steps) and any(
        triple.subject in steps and triple.object in steps for triple in ontology.triples(p=name)
    )


def _is_read(name: str) -> bool:
    return is_word(name, *WORDS, *REGISTERED_WORDS, *OUTPUTS) or is_interval_relation(name)


def _things(ontology: Ontology, names: _Names) -> Iterator[Diagnostic]:
    """Report undefined names of classes and individuals if a similar name is defined."""
    outcomes = {triple.object for triple in ontology.using("causedBy")}
    for written, row in names.undefined.items():
        if written not in outcomes and not is_word(written, *CONSTRAINT_CLASSES):
            candidates = names.candidates(written)
            if candidates:
                short = local_name(written)
                shown = written if short in map(local_name, candidates) else short
                yield _misspelt(written, candidates, names.span(row), f"`{shown}` is not defined")


def _misspelt(written: str, candidates: list[str], span: Span, message: str) -> Diagnostic:
    renames = [Rename(written, name, is_sure=len(candidates) == 1) for name in candidates]
    advice = f"did you mean {' or '.join(map(str, renames))}?"
    return error("R058", message, span, advice, renames[0])


def _is_declared(ontology: Ontology, name: str) -> bool:
    """True if the main document states a type for a name, other than just a named individual."""
    return ontology.main(name) and any(kind != OWL.NamedIndividual for kind in ontology.values(name, RDF.type))


def _unusual(written: str, candidates: list[str], span: Span) -> Diagnostic:
    """Warn about a declared name that is one typo from a word of the vocabulary."""
    short = local_name(written)
    message = f"`{short}` is declared, but is one typo from a word of the vocabulary; it is kept"
    renames = [Rename(written, name) for name in candidates]
    advice = f"did you mean {' or '.join(map(str, renames))}? If not, give it a label"
    return warning("R058", message, span, advice, renames[0])


def _outcomes(ontology: Ontology) -> Iterator[Diagnostic]:
    """Report outcomes with a word that is one typo from a word for how a state ends."""
    seen: set[object] = set()
    for triple in ontology.using("causedBy"):
        outcome = triple.object
        if triple.span.file != str(ontology.documents[0].path) or outcome in seen:
            continue
        seen.add(outcome)
        if isinstance(outcome, str):
            yield from _outcome(ontology, outcome, triple.span)


def _outcome(ontology: Ontology, outcome: str, span: Span) -> Iterator[Diagnostic]:
    short = local_name(outcome)
    readings = [short]
    for word in words_of(outcome):
        if word.lower() not in (*_OUTCOMES, *_WORDS_OF_THEIR_OWN):
            near = Neighbours(_OUTCOMES).of(word.lower())
            near = near or get_close_matches(word.lower(), _OUTCOMES, n=len(_OUTCOMES), cutoff=_SURE_OUTCOME)
            meanings = {_OUTCOMES[one]: one for one in sorted(near, key=list(_OUTCOMES).index, reverse=True)}
            readings = [
                reading.replace(word, _cased(one, word), 1)
                for reading in readings
                for one in reversed(meanings.values())
            ] or readings
    if readings == [short]:
        return
    candidates = [_space(outcome) + reading for reading in readings]
    if not _is_declared(ontology, outcome):
        message = f"unknown outcome `{short}`: it would be read as {ending_of(outcome).value}"
        yield _misspelt(outcome, candidates, span, message)
    elif all(triple.predicate == RDF.type for triple in ontology.triples(s=outcome)):
        yield _unusual(outcome, candidates, span)


def _cased(word: str, like: str) -> str:
    return word.upper() if like.isupper() else word.capitalize() if like[0].isupper() else word


def _space(iri: str) -> str:
    return iri[: len(iri) - len(local_part(iri))]


SHORTEST = 4
"""Minimum length of a name for a typo: short words that differ in one letter, such as cup, cap and tap, are different
words."""

SHORTEST_REPLACED = 6
"""Minimum length of a word for a replaced letter to be a typo: place and plate, or basil and basin, are different."""

_PART = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+")


class Neighbours:
    """Index of names that are one typo apart: a letter missing, added or replaced, or two letters swapped.

    Names that differ in a digit, or in a part of one letter (``MoveToA``, ``MoveToB``), are names of different things,
    as are those with another letter in a short part (``TakeCup``, ``TakeCap``), or with a different first letter.
    """

    def __init__(self, names: Iterable[str]) -> None:
        self._shortened = grouped((variant, name) for name in dict.fromkeys(names) for variant in _variants(name))

    def of(self, written: str) -> list[str]:
        """Names one typo away from ``written``, sorted."""
        near = {name for variant in _variants(written) for name in self._shortened.get(variant, ())}
        return sorted(name for name in near if _is_typo(written, name))


def _variants(name: str) -> set[str]:
    return {name, *(name[:place] + name[place + 1 :] for place in range(len(name)))}


def _is_typo(written: str, name: str) -> bool:
    """True if one typo turns one name into the other, and the difference is hardly intended."""
    shorter, longer = sorted((written, name), key=len)
    if len(shorter) < SHORTEST or written == name or digits_of(written) != digits_of(name):
        return False
    start = next((place for place, (a, b) in enumerate(zip(shorter, longer, strict=False)) if a != b), len(shorter))
    a, b = shorter[start:], longer[start:]
    part = next((found[0] for found in _PART.finditer(longer) if found.start() <= start < found.end()), "--")
    if len(a) < len(b):
        return a == b[1:] and len(part) > 1
    is_exchanged = a[:2] == b[1::-1] and a[2:] == b[2:]
    if not start and a[0].lower() != b[0].lower():
        return is_exchanged
    return is_exchanged or (a[1:] == b[1:] and len(part) >= SHORTEST_REPLACED)
