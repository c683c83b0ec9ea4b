"""A graph to be written: what is said of each thing, in order, and what has been written of it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from planlang.ontology.terms import FIRST, NIL, OWL, RDF, REST, TYPE, BNode, Term, Triple
from planlang.ontology.writing.nodes import labelled

AXIOM = OWL + "Axiom"
ANNOTATION = OWL + "Annotation"
_SOURCE, _PROPERTY, _TARGET = (OWL + name for name in ("annotatedSource", "annotatedProperty", "annotatedTarget"))


class CannotSay(Exception):
    """The syntax has no words for a statement."""


class Graph:
    """Triples by subject, sorted, with labels that depend on the graph alone.

    ``written`` holds what has been written; what is not in it at the end is lost.
    """

    def __init__(self, triples: Iterable[Triple]) -> None:
        self.triples = labelled(triples)
        self.written: dict[Triple, None] = {}
        self._about: dict[str | BNode, list[Triple]] = {}
        self._with: dict[BNode, list[Triple]] = {}
        self._annotated: dict[tuple[Term, Term, Term], list[BNode]] = {}
        for triple in self.triples:
            self._about.setdefault(triple.subject, []).append(triple)
            if isinstance(triple.object, BNode) and triple.predicate not in (_SOURCE, _TARGET):
                self._with.setdefault(triple.object, []).append(triple)
        for subject in self._about:
            if isinstance(subject, BNode) and (self.has(subject, TYPE, AXIOM) or self.has(subject, TYPE, ANNOTATION)):
                sources, properties, targets = (self.about(subject, part) for part in (_SOURCE, _PROPERTY, _TARGET))
                if len(sources) == len(properties) == len(targets) == 1:
                    key = (sources[0].object, properties[0].object, targets[0].object)
                    self._annotated.setdefault(key, []).append(subject)

    def subjects(self) -> tuple[str | BNode, ...]:
        """Everything that something is said of, in order."""
        return tuple(self._about)

    def about(self, subject: str | BNode, predicate: str | None = None) -> list[Triple]:
        """What is said of a subject, by one property or all."""
        found = self._about.get(subject, [])
        return found if predicate is None else [triple for triple in found if triple.predicate == predicate]

    def uses(self, node: BNode) -> list[Triple]:
        """The triples that have a nameless node as their object, but for those that repeat one to annotate it."""
        return self._with.get(node, [])

    def has(self, subject: str | BNode, predicate: str, value: Term) -> bool:
        return any(triple.object == value for triple in self.about(subject, predicate))

    def one(self, subject: str | BNode, predicate: str) -> Triple | None:
        """The only triple of a subject with a property; None if there is none. Raises CannotSay if there are more."""
        found = self.about(subject, predicate)
        if len(found) > 1:
            raise CannotSay(f"two values of {predicate}")
        return found[0] if found else None

    def write(self, *triples: Triple) -> None:
        """Note that triples have been written."""
        self.written.update(dict.fromkeys(triples))

    def unwrite(self, number: int) -> None:
        """Forget what has been written but for the first so many triples."""
        while len(self.written) > number:
            self.written.popitem()

    def rest(self) -> Iterator[Triple]:
        """What has not been written."""
        return (triple for triple in self.triples if triple not in self.written)

    def items(self, triple: Triple) -> tuple[list[Term], list[Triple]]:
        """The items of the list that is a triple's object, and the triples of its cells. Raises CannotSay."""
        items: list[Term] = []
        used: list[Triple] = []
        cell, seen = triple.object, set[Term]()
        while cell != NIL:
            if not isinstance(cell, BNode) or cell in seen or len(self.uses(cell)) != 1:
                raise CannotSay("a list that has no end, or that is used twice")
            seen.add(cell)
            first, rest = self.one(cell, FIRST), self.one(cell, REST)
            if first is None or rest is None:
                raise CannotSay("a list with a cell that lacks its item or its end")
            used += (first, rest, *(t for t in self.about(cell, TYPE) if t.object == RDF + "List"))
            items.append(first.object)
            cell = rest.object
        return items, used

    def annotations(self, triple: Triple) -> list[BNode]:
        """The nodes that annotate a triple."""
        return self._annotated.get((triple.subject, triple.predicate, triple.object), [])

    def notes(self, node: BNode) -> tuple[list[Triple], list[Triple]]:
        """What an annotating node says, and the triples by which it does."""
        frame = (TYPE, _SOURCE, _PROPERTY, _TARGET)
        said = self.about(node)
        return [t for t in said if t.predicate not in frame], [t for t in said if t.predicate in frame]
