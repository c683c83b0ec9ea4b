"""One consistent in-memory ontology: triples of all documents, and the questions that recipes, maps and robots ask."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from planlang.diagnostics import Diagnostic, Span
from planlang.ontology.checks import checked
from planlang.ontology.classes import Restriction, alias_edges, conjuncts, edges, restrictions_of, twin
from planlang.ontology.documents import Document, Reading, read_all
from planlang.ontology.taxonomy import Taxonomy, order_walk
from planlang.ontology.terms import (
    CLASS,
    EQUIVALENT_CLASS,
    KNOWROB,
    LABEL,
    NAMED_INDIVIDUAL,
    OWL,
    RDF,
    RDFS,
    SUBCLASS_OF,
    SUBPROPERTY_OF,
    TYPE,
    BNode,
    Literal,
    Term,
    Triple,
    expand,
)

_CLASS_KINDS = frozenset((CLASS, RDFS + "Class"))
_LANGUAGE = (OWL, RDF, RDFS)


def load(path: Path, *, folders: Sequence[Path] = (), builtin: bool = True) -> Ontology:
    """Read a file in RDF/XML, Turtle or Manchester syntax with its imports and, unless told otherwise, our vocabulary.

    Imports are looked for beside the file, in ``folders``, then among the bundled ontologies; never in the network.
    Raises BadInput with all errors found if the file cannot be used.
    """
    return Ontology(read_all(Path(path), tuple(map(Path, folders)), builtin=builtin))


@dataclass(frozen=True, slots=True)
class _Index:
    by_subject: dict[str | BNode, list[Triple]]
    by_predicate: dict[str, list[Triple]]
    by_object: dict[str | BNode, list[Triple]]


class Ontology:
    """What the documents say together, in document order, the main document first.

    Classes, properties and individuals are given by IRI, prefixed name, or bare name of the vocabulary.
    """

    def __init__(self, readings: Sequence[Reading]) -> None:
        self.documents: tuple[Document, ...] = tuple(reading.document for reading in readings)
        self._triples: tuple[Triple, ...] = tuple(triple for reading in readings for triple in reading.triples)
        self._restrictions: dict[str | BNode, tuple[Restriction, ...]] = {}
        self._main_subjects = frozenset(triple.subject for triple in readings[0].triples)
        found = [diagnostic for reading in readings for diagnostic in reading.diagnostics]
        self.diagnostics: tuple[Diagnostic, ...] = (*found, *checked(self, readings))

    @property
    def iri(self) -> str | None:
        """The name that the main document gives itself."""
        return self.documents[0].iri

    # triples

    @cached_property
    def _index(self) -> _Index:
        index = _Index({}, {}, {})
        for triple in self._triples:
            index.by_subject.setdefault(triple.subject, []).append(triple)
            index.by_predicate.setdefault(triple.predicate, []).append(triple)
            if not isinstance(triple.object, Literal):
                index.by_object.setdefault(triple.object, []).append(triple)
        return index

    def triples(self, s: str | BNode | None = None, p: str | None = None, o: Term | None = None) -> Iterator[Triple]:
        """The triples with this subject, predicate and object (None: any), in document order."""
        s, p = _name(s), expand(p) if p is not None else None
        candidates: Sequence[Triple] = self._triples
        if s is not None:
            candidates = self._index.by_subject.get(s, ())
        elif o is not None and not isinstance(o, Literal):
            candidates = self._index.by_object.get(o, ())
        elif p is not None:
            candidates = self._index.by_predicate.get(p, ())
        for triple in candidates:
            fits = (s is None or triple.subject == s) and (p is None or triple.predicate == p)
            if fits and (o is None or triple.object == o):
                yield triple

    def values(self, s: str | BNode, p: str, *, subproperties: bool = False) -> tuple[Term, ...]:
        """What the property has as values for a subject, in document order, each once."""
        subject, wanted = _name(s), frozenset(self.subproperties(p) if subproperties else (expand(p),))
        assert subject is not None
        found = (t.object for t in self._index.by_subject.get(subject, ()) if t.predicate in wanted)
        return tuple(dict.fromkeys(found))

    def value(self, s: str | BNode, p: str, *, subproperties: bool = False) -> Term | None:
        """The first value of a property, or None."""
        return next(iter(self.values(s, p, subproperties=subproperties)), None)

    # what there is

    def types(self, individual: str | BNode) -> tuple[str, ...]:
        """The named classes that an individual is said to be of, without those of OWL itself."""
        return tuple(
            cls for cls in self.values(individual, TYPE) if isinstance(cls, str) and not cls.startswith(_LANGUAGE)
        )

    def is_class(self, iri: str) -> bool:
        """True if it is declared a class, or stated to be below, above or the same as one."""
        iri = self._twin_or_itself(expand(iri))
        if any(
            triple.predicate in (SUBCLASS_OF, EQUIVALENT_CLASS)
            or (triple.predicate == TYPE and triple.object in _CLASS_KINDS)
            for triple in self._index.by_subject.get(iri, ())
        ):
            return True
        return any(triple.predicate == SUBCLASS_OF for triple in self._index.by_object.get(iri, ()))

    def class_names(self) -> tuple[str, ...]:
        """All classes that are declared, in document order."""
        found = (t.subject for t in self._index.by_predicate.get(TYPE, ()) if t.object in _CLASS_KINDS)
        return tuple(dict.fromkeys(name for name in found if isinstance(name, str)))

    def is_individual(self, iri: str) -> bool:
        """True if it has a class, or is declared an individual. A class may be one too."""
        return bool(self.types(iri)) or NAMED_INDIVIDUAL in self.values(iri, TYPE)

    def is_property(self, iri: str) -> bool:
        """True if it is declared a property of any kind."""
        return any(
            isinstance(kind, str) and kind.startswith(_LANGUAGE) and kind.endswith("Property")
            for kind in self.values(iri, TYPE)
        )

    def defined(self, iri: str) -> bool:
        """True if any document says what it is: declares it, gives it a class, or places it below one."""
        iri = self._twin_or_itself(expand(iri))
        return any(
            triple.predicate in (TYPE, SUBCLASS_OF, EQUIVALENT_CLASS, SUBPROPERTY_OF)
            for triple in self._index.by_subject.get(iri, ())
        )

    def _twin_or_itself(self, iri: str) -> str:
        """KnowRob's class for one of RoboEarth's about which no document says anything."""
        return iri if iri in self._index.by_subject else twin(iri) or iri

    def individuals(self, cls: str) -> tuple[str, ...]:
        """The individuals of a class and of its subclasses, in document order."""
        wanted = frozenset(self.subclasses(cls))
        return tuple(
            dict.fromkeys(
                triple.subject
                for triple in self._index.by_predicate.get(TYPE, ())
                if isinstance(triple.subject, str) and triple.object in wanted
            )
        )

    def main(self, iri: str) -> bool:
        """True if the main document says something about it."""
        return expand(iri) in self._main_subjects

    def span(self, iri: str) -> Span | None:
        """Where it is defined: its first type, else the first statement about it."""
        statements = self._index.by_subject.get(expand(iri), ())
        typed = next((triple.span for triple in statements if triple.predicate == TYPE), None)
        return typed or next((triple.span for triple in statements), None)

    def label(self, iri: str) -> str | None:
        """Its label: one in English or without language before others."""
        labels = [value for value in self.values(iri, LABEL) if isinstance(value, Literal)]
        labels.sort(key=lambda label: not (label.language or "en").startswith("en"))
        return labels[0].value.strip() if labels else None

    # hierarchies

    @cached_property
    def taxonomy(self) -> Taxonomy:
        """The class hierarchy, with the owlready2 world that holds it."""
        mentioned = (name for t in self._triples for name in (t.subject, t.object) if isinstance(name, str))
        return Taxonomy((*edges(self), *alias_edges(self, mentioned)))

    def ancestors(self, cls: str) -> tuple[str, ...]:
        """The class itself, then its superclasses, nearest first."""
        return self.taxonomy.ancestors(expand(cls))

    def parents(self, cls: str) -> tuple[str, ...]:
        """The named classes directly above: stated, members of a stated intersection, or equivalent."""
        return self.taxonomy.parents(expand(cls))

    def subclasses(self, cls: str) -> tuple[str, ...]:
        """The class itself, then its subclasses, nearest first."""
        return self.taxonomy.descendants(expand(cls))

    def is_a(self, cls_or_individual: str, cls: str) -> bool:
        """True for a class below ``cls`` or the same, and for an individual of such a class."""
        iri, wanted = expand(cls_or_individual), expand(cls)
        return self.taxonomy.is_below(iri, wanted) or any(
            self.taxonomy.is_below(kind, wanted) for kind in self.types(iri)
        )

    def subproperties(self, p: str) -> tuple[str, ...]:
        """The property itself, then those below it, nearest first."""
        return tuple(order_walk(expand(p), self._property_children))

    def superproperties(self, p: str) -> tuple[str, ...]:
        """The property itself, then those above it, nearest first."""
        return tuple(order_walk(expand(p), self._property_parents))

    @cached_property
    def _property_edges(self) -> list[tuple[str, str]]:
        found = [
            (t.subject, t.object)
            for t in self._index.by_predicate.get(SUBPROPERTY_OF, ())
            if isinstance(t.subject, str) and isinstance(t.object, str)
        ]
        for t in self._index.by_predicate.get(OWL + "equivalentProperty", ()):
            if isinstance(t.subject, str) and isinstance(t.object, str):
                found += [(t.subject, t.object), (t.object, t.subject)]
        return found

    @cached_property
    def _property_children(self) -> dict[str, list[str]]:
        children: dict[str, list[str]] = {}
        for lower, upper in self._property_edges:
            children.setdefault(upper, []).append(lower)
        return children

    @cached_property
    def _property_parents(self) -> dict[str, list[str]]:
        parents: dict[str, list[str]] = {}
        for lower, upper in self._property_edges:
            parents.setdefault(lower, []).append(upper)
        return parents

    # class expressions

    def restrictions(self, cls: str | BNode) -> tuple[Restriction, ...]:
        """The restrictions that a class states itself, in source order; of a nameless one those that it consists of."""
        name = _name(cls)
        assert name is not None
        found = self._restrictions.get(name)
        if found is None:
            found = self._restrictions[name] = tuple(restrictions_of(self, name))
        return found

    def members(self, expression: Term) -> tuple[Term, ...]:
        """The members of an intersection, nested ones opened; of anything else the expression itself."""
        return tuple(conjuncts(self, expression))

    def inherited_restrictions(self, cls: str, p: str | None = None) -> tuple[Restriction, ...]:
        """The restrictions of a class and its ancestors, nearest first; of ``p`` and what is below it, if given."""
        wanted = frozenset(self.subproperties(p)) if p is not None else None
        return tuple(
            restriction
            for ancestor in self.ancestors(cls)
            for restriction in self.restrictions(ancestor)
            if wanted is None or restriction.property in wanted
        )

    def valid_properties(self, action: str) -> tuple[str, ...]:
        """IRIs of the properties that the vocabulary lists (``hasParameter``) for an action class or an ancestor.

        Sub-properties of those are valid too.
        """
        found: dict[str, None] = {}
        for ancestor in self.ancestors(action):
            for value in self.values(ancestor, KNOWROB + "hasParameter"):
                if isinstance(value, str):
                    found |= dict.fromkeys(self.subproperties(value))
        return tuple(found)


def _name(term: str | BNode | None) -> str | BNode | None:
    return expand(term) if isinstance(term, str) else term
