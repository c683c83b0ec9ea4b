"""One consistent in-memory ontology: triples of all documents, and the queries that recipes, maps and robots need."""

from __future__ import annotations

from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Any

from planlang.closure import grouped
from planlang.designators import label_iris, local_part
from planlang.diagnostics import Diagnostic, Span
from planlang.kept import kept
from planlang.ontology.checks import check
from planlang.ontology.classes import (
    Restriction,
    Taxonomy,
    Words,
    alias_edges,
    by_distance,
    conjuncts,
    disjuncts,
    edges,
    items,
    namesakes,
    restrictions_of,
    twin,
    unread_parts,
)
from planlang.ontology.documents import Document, Reading, is_bundled, read_all
from planlang.ontology.naming import LABELS, best_label, readable_names, same_names
from planlang.ontology.terms import ABSOLUTE, KNOWROB, OWL, RDF, RDFS, ROBOEARTH, BNode, Literal, Term, Triple, expand
from planlang.ontology.triples import Triples

_CLASS_KINDS = frozenset((OWL.Class, RDFS.Class))
_LANGUAGE = (OWL, RDF, RDFS)


def load(
    path: Path,
    *,
    folders: Sequence[Path] = (),
    builtin: bool = True,
    also: Sequence[Path] = (),
    content: bytes | None = None,
) -> Ontology:
    """Read a file in any syntax of OWL with its imports and, if ``builtin``, the bundled vocabulary.

    Imports are searched beside the file, in ``folders``, then among the bundled ontologies; never on the network.
    ``also``: files to read as if the first one imported them. ``content``: bytes of the first document, which then
    need not exist as a file; its folder is not searched. Raises BadInput with all errors if ``path`` or a file of
    ``also`` cannot be used; an unusable import is a warning.
    """
    ontology = load_apart(path, folders=folders, builtin=builtin, also=also, content=content)
    label_iris(readable_names(one.triples for one in ontology.readings if not is_bundled(one.document.path)))
    return ontology


def load_apart(
    path: Path,
    *,
    folders: Sequence[Path] = (),
    builtin: bool = True,
    also: Sequence[Path] = (),
    content: bytes | None = None,
) -> Ontology:
    """Read as :func:`load` does what others have uploaded: its labels name nothing in the process that serves them."""
    folders = tuple(map(Path, folders))
    return Ontology(read_all(Path(path), folders, builtin=builtin, also=also, content=content), folders)


class Ontology:
    """Statements of all documents in document order, the main document first.

    Methods accept classes, properties and individuals as IRI, prefixed name, or bare name of the vocabulary.
    """

    def __init__(
        self, readings: Sequence[Reading], folders: Sequence[Path] = (), same: Mapping[str, str] | None = None
    ) -> None:
        store = Triples.joined([reading.triples for reading in readings])
        names = same_names(store, readings[0].document.iri)
        self.same: Mapping[str, str] = {**(same or {}), **names}
        """Other names of individuals (``owl:sameAs``) -> the name under which all is stated here."""
        if names:
            readings = [replace(one, triples=one.triples.renamed(names)) for one in readings]
            store = Triples.joined([reading.triples for reading in readings])
        for other, name in self.same.items():
            if name in store.numbers:
                store.numbers.setdefault(other, store.numbers[name])
        self.store = store
        """Triples of all documents."""
        self.readings = tuple(readings)
        self.folders = tuple(folders)
        """Folders in which files are searched that are not beside the one that names them."""
        self.documents: tuple[Document, ...] = tuple(reading.document for reading in readings)
        self.kept: dict[object, Any] = {}
        """Results of functions (:func:`planlang.kept.kept`)."""
        self._main = self.store.ranges[0]
        self._type = self.store.number(RDF.type)
        self._class_kinds = frozenset(map(self.store.number, _CLASS_KINDS))
        defining = (RDF.type, RDFS.subClassOf, OWL.equivalentClass, RDFS.subPropertyOf)
        self._defining = frozenset(map(self.store.number, defining))
        of_reading = (diagnostic for reading in readings for diagnostic in reading.diagnostics)
        self.diagnostics: tuple[Diagnostic, ...] = (
            *of_reading,
            *check(self, (document.path for document in self.documents)),
        )
        self.unread: tuple[Diagnostic, ...] = tuple(one for reading in readings for one in reading.unread)
        """Errors about things with a shape of which the documents have no statements: ``diagnostics.unread``."""

    @property
    def iri(self) -> str | None:
        """Ontology IRI of the main document."""
        return self.documents[0].iri

    def alone(self) -> Ontology:
        """Make an ontology of the main document only."""
        return self.made_of(self.readings[:1])

    def renamed(self, names: Mapping[str, str]) -> Ontology:
        """Make a copy in which some IRIs of the main document are replaced (old -> new)."""
        main, *others = self.readings
        return self.made_of([replace(main, triples=main.triples.renamed(names)), *others])

    def extended(self, readings: Iterable[Reading]) -> Ontology:
        """Make an ontology that states more; the main document stays the first one."""
        return self.made_of([*self.readings, *readings])

    def made_of(self, readings: Sequence[Reading]) -> Ontology:
        """Make an ontology of other readings, with the folders and the names of individuals of this one."""
        return Ontology(readings, self.folders, self.same)

    def to_owlready(self) -> Any:
        """Convert to a ``World`` of owlready2 with the repaired statements of all documents, without owl:imports.

        Blank nodes keep their statements, not their labels. Raises ImportError without owlready2.
        """
        from planlang.ontology.owlready import world_of  # needs an extra, and few ontologies are converted

        return world_of((triple for triple in self.triples() if triple.predicate != OWL.imports), self.iri)

    # triples

    def triples(self, s: str | BNode | None = None, p: str | None = None, o: Term | None = None) -> Iterator[Triple]:
        """Yield the triples with this subject, predicate and object (None: any), in document order."""
        return map(self.store.triple, self._rows(s, p, o))

    def links(self, p: str) -> Iterator[tuple[str, str]]:
        """Yield subject and object (IRIs) of the triples with a property that link two named terms."""
        for one in self.triples(p=p):
            if isinstance(one.subject, str) and isinstance(one.object, str):
                yield one.subject, one.object

    def last(self, s: str | BNode, p: str) -> Triple | None:
        """Find the last triple with this subject and property; None if there is none."""
        predicate, predicates = self._number(p), self.store.predicates
        rows = () if predicate is None else [row for row in self._about(s) if predicates[row] == predicate]
        return self.store.triple(rows[-1]) if rows else None

    def _rows(self, s: str | BNode | None, p: str | None, o: Term | None) -> Iterator[int]:
        store, numbers = self.store, []
        for term in (s, p, o):
            number = None if term is None else self._number(term)
            if term is not None and number is None:
                return
            numbers.append(number)
        subject, predicate, value = numbers
        rows: Iterable[int] = range(len(store))
        if subject is not None:
            rows = store.about(subject)
        elif value is not None:
            rows = store.with_object(value)
        elif p is not None:
            rows = store.by(expand(p))
        for row in rows:
            if (predicate is None or store.predicates[row] == predicate) and (
                value is None or store.objects[row] == value
            ):
                yield row

    def _number(self, term: Term) -> int | None:
        if isinstance(term, str):
            return self.store.numbers.get(term if term.startswith(ABSOLUTE) else expand(term))
        return self.store.find(term)

    def _about(self, term: Term) -> Sequence[int]:
        """Rows with a term as subject."""
        number = self._number(term)
        return () if number is None else self.store.about(number)

    def said(self, s: str | BNode, *names: str) -> Iterator[Triple]:
        """Yield the triples about a subject whose property has one of these local names, in document order."""
        named, predicates = self._named(names), self.store.predicates
        if not named:
            return iter(())
        return map(self.store.triple, [row for row in self._about(s) if predicates[row] in named])

    def using(self, *names: str) -> Iterator[Triple]:
        """Yield the triples whose property has one of these local names, in document order."""
        return map(self.store.triple, self.store.by(*self.properties_named(*names)))

    def properties_named(self, *names: str) -> tuple[str, ...]:
        """IRIs of the properties in use that have one of these local names."""
        iris = (self.store.name(number) for number in self._named(names))
        return tuple(iri for iri in iris if iri is not None)

    @kept
    def _named(self, names: tuple[str, ...]) -> dict[int, None]:
        used = ((number, self.store.name(number) or "") for number in self.store.used)
        return {number: None for number, iri in used if local_part(iri) in names}

    def values(self, s: str | BNode, p: str) -> tuple[Term, ...]:
        """Values of a property for a subject, in document order, each once."""
        return self._values(s, (self._number(p),))

    def values_below(self, s: str | BNode, p: str) -> tuple[Term, ...]:
        """Values of a property and of its subproperties for a subject, in document order, each once."""
        return self._values(s, frozenset(map(self._number, self.subproperties(p))))

    def linked(self, s: str | BNode, *names: str) -> tuple[list[str], ...]:
        """Collect, for each local name of a property, the IRIs that a subject is linked to by it, each once."""
        return self.linked_from(s, *names)[0]

    def linked_from(self, s: str | BNode, *names: str) -> tuple[tuple[list[str], ...], Span | None]:
        """Collect as :meth:`linked` does, and find the position of the subject's definition (:meth:`span`).

        It walks the triples of the subject once, because recipes ask this of each of their ordering constraints.
        """
        indices = self._indices(names)
        linked: tuple[list[str], ...] = tuple([[] for _ in names])
        number, store = self._number(s), self.store
        if number is None:
            return linked, None
        predicates, objects, terms, rdf_type, definition = store.predicates, store.objects, store.terms, self._type, -1
        first, following = store.by_subject
        row = first[number]
        while row >= 0:
            predicate = predicates[row]
            if predicate == rdf_type:
                definition = row if definition < 0 else definition
            elif (index := indices.get(predicate)) is not None:
                value = terms[objects[row]]
                if isinstance(value, str) and value not in linked[index]:
                    linked[index].append(value)
            row = following[row]
        definition = definition if definition >= 0 else first[number]
        return linked, store.span(definition) if definition >= 0 else None

    @kept
    def _indices(self, names: tuple[str, ...]) -> dict[int, int]:
        """Number of each property with one of these local names -> index of that name."""
        return {number: index for index, name in enumerate(names) for number in self._named((name,))}

    def _values(self, s: str | BNode, predicates: Container[int | None]) -> tuple[Term, ...]:
        store, number = self.store, self._number(s)
        if number is None:
            return ()
        objects = [store.objects[row] for row in store.about(number) if store.predicates[row] in predicates]
        return tuple(map(store.term, dict.fromkeys(objects) if len(objects) > 1 else objects))

    def value(self, s: str | BNode, p: str) -> Term | None:
        """First value of a property, or None."""
        return next(iter(self.values(s, p)), None)

    def items(self, cell: Term) -> Iterator[Term]:
        """Yield the items of an RDF list; a cyclic list ends before its first repeated cell."""
        number = self._number(cell)
        return iter(()) if number is None else map(self.store.term, items(self.store, number))

    def iris(self, s: str | BNode, p: str) -> tuple[str, ...]:
        """IRIs among the values of a property, in document order, each once."""
        return tuple(value for value in self.values(s, p) if isinstance(value, str))

    # entities

    @kept
    def types(self, individual: str | BNode) -> tuple[str, ...]:
        """Named classes stated as types of an individual, except terms of RDF, RDFS and OWL."""
        stated = self._values(individual, (self._type,))
        return tuple(cls for cls in stated if isinstance(cls, str) and not cls.startswith(_LANGUAGE))

    def is_class(self, iri: str) -> bool:
        """Check whether an IRI is declared as a class, or is the subclass, superclass or equivalent of one."""
        return self._number_or_twin(iri) in self._classes

    @cached_property
    def _classes(self) -> frozenset[int | None]:
        store = self.store
        rows = store.by(RDFS.subClassOf, OWL.equivalentClass)
        related = set(map(store.subjects.__getitem__, rows)) | set(
            map(store.objects.__getitem__, store.by(RDFS.subClassOf))
        )
        return frozenset(related.union(self._of_types(self._class_kinds)))

    @kept
    def class_names(self) -> tuple[str, ...]:
        """All declared classes in document order."""
        names = map(self.store.name, self._of_types(self._class_kinds))
        return tuple(name for name in names if name is not None)

    def _of_types(self, types: Iterable[int]) -> dict[int, None]:
        """Subjects that have one of these types, in document order."""
        store = self.store
        rows = [row for cls in types for row in store.with_object(cls) if store.predicates[row] == self._type]
        return dict.fromkeys(map(store.subjects.__getitem__, sorted(rows)))

    def is_individual(self, iri: str) -> bool:
        """Check whether an IRI has a class or is declared as an individual; a class may be one too (punning)."""
        return bool(self.types(iri)) or OWL.NamedIndividual in self.values(iri, RDF.type)

    def is_property(self, iri: str) -> bool:
        """Check whether an IRI is declared as a property of any kind."""
        return any(
            isinstance(kind, str) and kind.startswith(_LANGUAGE) and kind.endswith("Property")
            for kind in self.values(iri, RDF.type)
        )

    def defined(self, iri: str) -> bool:
        """Check whether any document states a type, a superclass, an equivalent class or a superproperty of an IRI."""
        number, predicates = self._number_or_twin(iri), self.store.predicates
        return number is not None and any(predicates[row] in self._defining for row in self.store.about(number))

    def _number_or_twin(self, iri: str) -> int | None:
        """Number of an IRI; for a RoboEarth class without statements that of the equally named KnowRob class."""
        iri = iri if iri.startswith(ABSOLUTE) else expand(iri)
        number = self.store.numbers.get(iri)
        if iri.startswith(ROBOEARTH) and (number is None or self.store.first_about(number) < 0):
            other = twin(iri)
            return number if other is None else self.store.numbers.get(other)
        return number

    def individuals(self, cls: str) -> tuple[str, ...]:
        """Individuals of a class and of its subclasses, in document order."""
        classes = (self.store.find(name) for name in self.subclasses(cls))
        names = map(self.store.name, self._of_types(number for number in classes if number is not None))
        return tuple(name for name in names if name is not None)

    def unused(self) -> Iterator[str]:
        """Yield each entity that the main document gives a type and that no other subject refers to."""
        store, (first, following) = self.store, self.store.by_object
        subjects = store.subjects
        for number in dict.fromkeys(subjects[row] for row in store.by(RDF.type) if row in self._main):
            row = first[number]
            while row >= 0 and subjects[row] == number:
                row = following[row]
            name = store.name(number) if row < 0 else None
            if name is not None:
                yield name

    def main(self, iri: str) -> bool:
        """Check whether the main document states something about an IRI."""
        number = self._number(iri)
        return number is not None and self.store.first_about(number) in self._main

    def span(self, iri: str) -> Span | None:
        """Position of the definition of an IRI: its first type, else the first statement about it."""
        first = None
        for row in self._about(iri):
            if self.store.predicates[row] == self._type:
                return self.store.span(row)
            first = row if first is None else first
        return None if first is None else self.store.span(first)

    def label(self, iri: str) -> str | None:
        """Label of an IRI, preferably in English or without language tag, and rdfs:label before skos:prefLabel."""
        values = (value for prop in LABELS for value in self.values(iri, prop))
        return best_label(value for value in values if isinstance(value, Literal))

    # hierarchies

    @cached_property
    def taxonomy(self) -> Taxonomy:
        """Class hierarchy of all documents."""
        mentioned = (term for term in self.store.terms if isinstance(term, str))
        stated = tuple(edges(self.store))
        undefined = [upper for upper in dict.fromkeys(upper for _, upper in stated) if not self.defined(upper)]
        repaired = namesakes(undefined, self.class_names()).items()
        return Taxonomy((*stated, *alias_edges(self.is_class, mentioned), *repaired))

    def ancestors(self, cls: str) -> tuple[str, ...]:
        """Class itself, then its superclasses, nearest first."""
        return self.taxonomy.ancestors(expand(cls))

    def parents(self, cls: str) -> tuple[str, ...]:
        """Direct named superclasses: stated, members of a stated intersection, or equivalent."""
        return self.taxonomy.parents(expand(cls))

    def subclasses(self, cls: str) -> tuple[str, ...]:
        """Class itself, then its subclasses, nearest first."""
        return self.taxonomy.descendants(expand(cls))

    def is_a(self, cls_or_individual: str, cls: str) -> bool:
        """Check whether a class is ``cls`` or a subclass of it, or an individual has such a class."""
        iri, upper = expand(cls_or_individual), expand(cls)
        return self.taxonomy.is_below(iri, upper) or any(
            self.taxonomy.is_below(kind, upper) for kind in self.types(iri)
        )

    def any_is_a(self, names: Iterable[str], classes: Iterable[str]) -> bool:
        """Check whether :meth:`is_a` holds for any of the names with any of the classes."""
        iris = tuple(map(expand, classes))
        return any(self.is_a(name, cls) for name in names for cls in iris)

    def subproperties(self, p: str) -> tuple[str, ...]:
        """Property itself, then its subproperties, nearest first."""
        return by_distance(expand(p), self._property_children)

    def superproperties(self, p: str) -> tuple[str, ...]:
        """Property itself, then its superproperties, nearest first."""
        return by_distance(expand(p), self._property_parents)

    @cached_property
    def _property_edges(self) -> list[tuple[str, str]]:
        edges = list(self.links(RDFS.subPropertyOf))
        for one, other in self.links(OWL.equivalentProperty):
            edges += [(one, other), (other, one)]
        return edges

    @cached_property
    def _property_children(self) -> dict[str, list[str]]:
        return grouped((upper, lower) for lower, upper in self._property_edges)

    @cached_property
    def _property_parents(self) -> dict[str, list[str]]:
        return grouped(self._property_edges)

    # class expressions

    @kept
    def restrictions(self, cls: str | BNode) -> tuple[Restriction, ...]:
        """Restrictions stated of a class itself, in source order; for a blank node those it consists of."""
        number = self._number(cls)
        return () if number is None else tuple(restrictions_of(self.store, self._class_vocabulary, number))

    def unread_parts(self, cls: str | BNode) -> list[tuple[BNode, Span]]:
        """List the anonymous superclasses of a class, or the anonymous members of a blank expression, that are no
        restrictions, such as unions and complements, each with the position of its first statement.
        """
        number = self._number(cls)
        if number is None:
            return []
        parts = ((part, self.store.term(part)) for part in unread_parts(self.store, self._class_vocabulary, number))
        spans = ((term, self.store.first_about(part)) for part, term in parts if isinstance(term, BNode))
        return [(term, self.store.span(row)) for term, row in spans if row >= 0]

    @cached_property
    def _class_vocabulary(self) -> Words:
        return Words.of(self.store)

    def members(self, expression: Term) -> tuple[Term, ...]:
        """Members of an intersection, flattened; the expression itself if it is none."""
        number = self.store.find(expression) if isinstance(expression, BNode) else None
        return (expression,) if number is None else tuple(map(self.store.term, conjuncts(self.store, number)))

    def alternatives(self, expression: Term) -> tuple[Term, ...]:
        """Members of a union in their order, flattened; empty if it is none."""
        number = self.store.find(expression) if isinstance(expression, (str, BNode)) else None
        return () if number is None else tuple(map(self.store.term, disjuncts(self.store, number)))

    def inherited_restrictions(self, cls: str, p: str | None = None) -> tuple[Restriction, ...]:
        """Restrictions of a class and its ancestors, nearest first; if ``p`` is given, on it and its subproperties."""
        properties = frozenset(self.subproperties(p)) if p is not None else None
        return tuple(
            restriction
            for ancestor in self.ancestors(cls)
            for restriction in self.restrictions(ancestor)
            if properties is None or restriction.property in properties
        )

    def valid_properties(self, action: str) -> tuple[str, ...]:
        """Properties that the vocabulary lists (``hasParameter``) for an action class or its ancestors.

        Their subproperties are included.
        """
        return self._with_subproperties(tuple(one for one in self.ancestors(action) if one in self._parameters))

    @kept
    def _with_subproperties(self, classes: tuple[str, ...]) -> tuple[str, ...]:
        listed = (prop for cls in classes for prop in self._parameters[cls])
        return tuple(dict.fromkeys(sub for prop in listed for sub in self.subproperties(prop)))

    @cached_property
    def _parameters(self) -> dict[str, list[str]]:
        """Properties that the vocabulary lists for each class."""
        return grouped(self.links(KNOWROB + "hasParameter"))
