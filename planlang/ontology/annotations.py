"""Annotated axioms and other statements about statements, which are no statements of their own.

OWL annotates an axiom by a node that repeats its triple (``owl:annotatedSource``, ``owl:annotatedProperty``,
``owl:annotatedTarget``), often with a copy of its expressions. RDF describes statements by words of its own, and OWL
writes negative assertions in this way.
"""

from __future__ import annotations

from operator import itemgetter

from planlang.diagnostics import Diagnostic, note, warning
from planlang.ontology.terms import OWL, RDF
from planlang.ontology.triples import Triples, counted

MOST_REPORTED = 20
"""Diagnostics of a kind about one file."""

_AXIOM = (OWL.annotatedSource, OWL.annotatedProperty, OWL.annotatedTarget)
_REIFIED = (RDF.subject, RDF.predicate, RDF.object)
"""Words of RDF, which OWL 1.1 used for axioms, too."""
_NEGATIVE = (OWL.sourceIndividual, OWL.assertionProperty, OWL.targetIndividual, OWL.targetValue)


def without_annotations(triples: Triples) -> list[Diagnostic]:
    """Remove the statements about statements from the triples of one file, with their copies of expressions.

    An annotated axiom that is not stated besides is stated, as editors do. A statement that RDF describes is not, nor
    is a negative assertion, which is reported.
    """
    every = (*_AXIOM, *_REIFIED, *_NEGATIVE)
    number_of = {number: word for word in every if (number := triples.numbers.get(word)) is not None}
    if not number_of:
        return []
    told: dict[int, dict[str, int]] = {}
    """Node of a statement about a statement -> word -> row of its first use."""
    for row, predicate in enumerate(triples.predicates):
        if predicate in number_of:
            told.setdefault(triples.subjects[row], {}).setdefault(number_of[predicate], row)
    graph = _Graph(triples)
    removed = _removed(triples, told, frozenset(number_of))
    stated: dict[int, tuple[int, int, int]] = {}
    notes: list[Diagnostic] = []
    axioms = {triples.subjects[row] for row in graph.objects.get(triples.numbers.get(OWL.Axiom, -1), ())}
    for node, rows in told.items():
        words = _AXIOM if OWL.annotatedTarget in rows else _REIFIED
        if node in axioms and all(word in rows for word in words):
            row = rows[words[2]]
            source, predicate, target = (triples.objects[rows[word]] for word in words)
            if source not in told and triples.name(predicate) is not None and graph.add(source, predicate, target):
                stated[row] = (source, predicate, target)
                message = "an axiom is stated only by its annotation; it is read as stated"
                notes.append(note("O044", message, triples.span(row), "state the axiom besides, as editors do"))
    kept = {target for _, _, target in stated.values()}
    _remove_orphans(graph, removed, kept)
    negative = [rows[OWL.assertionProperty] for rows in told.values() if OWL.assertionProperty in rows]
    warnings = [
        warning("O045", "a negative assertion states what is not so; it is ignored", triples.span(row), "remove it")
        for row in negative
    ]
    triples.change(removed, stated)
    bounded = (counted(found[:MOST_REPORTED], len(found) - MOST_REPORTED) for found in (notes, warnings))
    return [one for found in bounded for one in found]


def _removed(triples: Triples, told: dict[int, dict[str, int]], words: frozenset[int]) -> set[int]:
    """Rows of the nodes: of a blank node all, of a named one those with a word of statements about statements."""
    return {
        row
        for row, subject in enumerate(triples.subjects)
        if subject in told and (triples.is_node(subject) or triples.predicates[row] in words)
    }


class _Graph:
    """Rows by subject and by object, without the indexes of the store, after which it may not be changed."""

    def __init__(self, triples: Triples) -> None:
        self.triples = triples
        self.about: dict[int, list[int]] = {}
        self.objects: dict[int, list[int]] = {}
        self._said: dict[tuple[int, int], set[tuple[object, ...]]] = {}
        """Subject and property -> what its values mean."""
        for row, (subject, value) in enumerate(zip(triples.subjects, triples.objects, strict=True)):
            self.about.setdefault(subject, []).append(row)
            self.objects.setdefault(value, []).append(row)

    def add(self, subject: int, predicate: int, value: int) -> bool:
        """Add a triple, unless one says the same already; True if none does."""
        values = self._said.get((subject, predicate))
        if values is None:
            same = (row for row in self.about.get(subject, ()) if self.triples.predicates[row] == predicate)
            values = self._said[subject, predicate] = {self._text(self.triples.objects[row]) for row in same}
        text = self._text(value)
        is_new = text not in values
        values.add(text)
        return is_new

    def _text(self, node: int) -> tuple[object, ...]:
        """What a term means: its number, or the statements about a blank node and those that it refers to."""
        if not self.triples.is_node(node):
            return (node,)
        places = {node: 0}
        waiting, words = [node], list[object]()
        while waiting:
            rows = self.about.get(waiting.pop(0), ())
            found: list[tuple[int, int, int]] = []
            for row in rows:
                predicate, value = self.triples.predicates[row], self.triples.objects[row]
                found.append((predicate, -1 if self.triples.is_node(value) else value, value))
            for predicate, named, value in sorted(found, key=itemgetter(0, 1)):
                if named < 0 and value not in places:
                    places[value] = len(places)
                    waiting.append(value)
                words += (predicate, named, places[value] if named < 0 else -1)
            words.append(None)
        return tuple(words)


def _remove_orphans(graph: _Graph, removed: set[int], kept: set[int]) -> None:
    """Add the rows of blank nodes that only removed rows refer to."""
    triples = graph.triples
    waiting = [triples.objects[row] for row in sorted(removed)]
    done: set[int] = set()
    while waiting:
        node = waiting.pop()
        if node in done or node in kept or not triples.is_node(node):
            continue
        if any(row not in removed for row in graph.objects.get(node, ())):
            continue
        done.add(node)
        own = [row for row in graph.about.get(node, ()) if row not in removed]
        removed.update(own)
        waiting += [triples.objects[row] for row in own]
