"""One consistent in-memory ontology: triples of all documents, and the questions that recipes, maps and robots ask."""

from __future__ import annotations

from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from io import BytesIO
from pathlib import Path
from typing import Any

from planlang.designators import local_name
from planlang.diagnostics import Diagnostic, Span
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
    namesakes,
    restrictions_of,
    twin,
)
from planlang.ontology.documents import Document, Reading, read_all
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
    """Read a file in RDF/XML, Turtle or Manchester syntax with its imports and, unless told otherwise, our vocabulary.

    Imports are looked for beside the file, in ``folders``, then among the bundled ontologies; never in the network.
    ``also``: files that are read as if the first one imported them. ``content``: what the first one says, which then
    need not be a file, and beside which nothing is looked for. Raises BadInput with all errors found if one of the
    files cannot be used.
    """
    folders = tuple(map(Path, folders))
    return Ontology(read_all(Path(path), folders, builtin=builtin, also=also, content=content))


class Ontology:
    """The statements of all documents, in document order, the main document first.

    Classes, properties and individuals are given by IRI, prefixed name, or bare name of the vocabulary. ``store`` holds
    the triples of all documents.
    """

    def __init__(self, readings: Sequence[Reading]) -> None:
        self._readings = tuple(readings)
        self.documents: tuple[Document, ...] = tuple(reading.document for reading in readings)
        self.store = Triples.joined([reading.triples for reading in readings])
        self.kept: dict[object, Any] = {}
        """Values that users of the ontology compute and cache for its lifetime, under keys of their own."""
        self._main = self.store.ranges[0]
        self._restrictions: dict[int, tuple[Restriction, ...]] = {}
        self._kind = self.store.number(RDF.type)
        self._class_kinds = frozenset(map(self.store.number, _CLASS_KINDS))
        defining = (RDF.type, RDFS.subClassOf, OWL.equivalentClass, RDFS.subPropertyOf)
        self._defining = frozenset(map(self.store.number, defining))
        self._listed: dict[tuple[str, ...], tuple[str, ...]] = {}
        self._kinds: dict[tuple[str, ...], dict[int, int]] = {}
        self._words: dict[tuple[str, ...], dict[int, None]] = {}
        self._types: dict[int, tuple[str, ...]] = {}
        found = [diagnostic for reading in readings for diagnostic in reading.diagnostics]
        self.diagnostics: tuple[Diagnostic, ...] = (
            *found,
            *check(self, (document.path for document in self.documents)),
        )

    @property
    def iri(self) -> str | None:
        """The name that the main document gives itself."""
        return self.documents[0].iri

    def alone(self) -> Ontology:
        """Return what the main document states, without any other."""
        return Ontology(self._readings[:1])

    def renamed(self, names: Mapping[str, str]) -> Ontology:
        """Return a copy in which some names (IRIs) of the main document are replaced."""
        main, *others = self._readings
        return Ontology([replace(main, triples=main.triples.renamed(names)), *others])

    def to_owlready(self) -> Any:
        """Return a ``World`` of owlready2 with the repaired statements of all documents; nothing is imported again.

        Nameless nodes keep their statements, not their labels. Raises ImportError without owlready2.
        """
        from owlready2 import World  # needs an extra

        from planlang.ontology.nested_writers import ntriples

        statements = (triple for triple in self.triples() if triple.predicate != OWL.imports)
        world = World()
        world.get_ontology(self.iri or "http://planlang/").load(fileobj=BytesIO(ntriples(statements).encode()))
        return world

    # triples

    def triples(self, s: str | BNode | None = None, p: str | None = None, o: Term | None = None) -> Iterator[Triple]:
        """Yield the triples with this subject, predicate and object (None: any), in document order."""
        return map(self.store.triple, self._rows(s, p, o))

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
        """Return the rows that have a term as their subject."""
        number = self._number(term)
        return () if number is None else self.store.about(number)

    def said(self, s: str | BNode, *names: str) -> Iterator[Triple]:
        """Yield the triples of a subject whose properties have one of these local names, in document order."""
        named, predicates = self._named(names), self.store.predicates
        if not named:
            return iter(())
        return map(self.store.triple, [row for row in self._about(s) if predicates[row] in named])

    def using(self, *names: str) -> Iterator[Triple]:
        """Return the triples whose property has one of these local names, in document order."""
        return map(self.store.triple, self.store.by(*self.properties_named(*names)))

    def properties_named(self, *names: str) -> tuple[str, ...]:
        """Return the properties that any triple uses and whose local names are among these."""
        found = (self.store.name(number) for number in self._named(names))
        return tuple(name for name in found if name is not None)

    def _named(self, names: tuple[str, ...]) -> dict[int, None]:
        found = self._words.get(names)
        if found is None:
            used = ((number, self.store.name(number) or "") for number in self.store.used)
            found = self._words[names] = {number: None for number, name in used if local_name(name) in names}
        return found

    def values(self, s: str | BNode, p: str, *, subproperties: bool = False) -> tuple[Term, ...]:
        """Return the values of a property for a subject, in document order, each once."""
        if not subproperties:
            return self._values(s, (self._number(p),))
        return self._values(s, frozenset(map(self._number, self.subproperties(p))))

    def linked(self, s: str | BNode, *names: str) -> tuple[list[str], ...]:
        """Return, for each of these local names, the IRIs that properties of that name link a subject to, each once."""
        return self.linked_from(s, *names)[0]

    def linked_from(self, s: str | BNode, *names: str) -> tuple[tuple[list[str], ...], Span | None]:
        """Return the result of :meth:`linked` and the position of the subject's definition (:meth:`span`)."""
        kinds = self._kinds.get(names)
        if kinds is None:
            kinds = self._kinds[names] = {
                kind: place for place, name in enumerate(names) for kind in self._named((name,))
            }
        found: tuple[list[str], ...] = tuple([[] for _ in names])
        number, store = self._number(s), self.store
        if number is None:
            return found, None
        predicates, objects, terms, typing, defining = store.predicates, store.objects, store.terms, self._kind, -1
        first, following = store.by_subject
        row = first[number]
        while row >= 0:
            predicate = predicates[row]
            if predicate == typing:
                defining = row if defining < 0 else defining
            elif (place := kinds.get(predicate)) is not None:
                value = terms[objects[row]]
                if isinstance(value, str) and value not in found[place]:
                    found[place].append(value)
            row = following[row]
        where = defining if defining >= 0 else first[number]
        return found, store.span(where) if where >= 0 else None

    def _values(self, s: str | BNode, wanted: Container[int | None]) -> tuple[Term, ...]:
        store, number = self.store, self._number(s)
        if number is None:
            return ()
        found = [store.objects[row] for row in store.about(number) if store.predicates[row] in wanted]
        return tuple(map(store.term, dict.fromkeys(found) if len(found) > 1 else found))

    def value(self, s: str | BNode, p: str, *, subproperties: bool = False) -> Term | None:
        """Return the first value of a property, or None."""
        return next(iter(self.values(s, p, subproperties=subproperties)), None)

    def iris(self, s: str | BNode, p: str) -> tuple[str, ...]:
        """Return the IRIs among the values of a property, in document order, each once."""
        return tuple(value for value in self.values(s, p) if isinstance(value, str))

    # what there is

    def types(self, individual: str | BNode) -> tuple[str, ...]:
        """Return the named classes that an individual is stated to be of, without those of OWL itself."""
        number = self._number(individual)
        if number is None:
            return ()
        found = self._types.get(number)
        if found is None:
            stated = self._values(individual, (self._kind,))
            found = tuple(cls for cls in stated if isinstance(cls, str) and not cls.startswith(_LANGUAGE))
            self._types[number] = found
        return found

    def is_class(self, iri: str) -> bool:
        """Return True if it is declared a class, or stated to be below, above or the same as one."""
        return self._number_of_thing(iri) in self._classes

    @cached_property
    def _classes(self) -> frozenset[int | None]:
        store = self.store
        rows = store.by(RDFS.subClassOf, OWL.equivalentClass)
        found = set(map(store.subjects.__getitem__, rows)) | set(
            map(store.objects.__getitem__, store.by(RDFS.subClassOf))
        )
        return frozenset(found.union(self._of_kinds(self._class_kinds)))

    def class_names(self) -> tuple[str, ...]:
        """Return all classes that are declared, in document order."""
        return self._class_names

    @cached_property
    def _class_names(self) -> tuple[str, ...]:
        names = map(self.store.name, self._of_kinds(self._class_kinds))
        return tuple(name for name in names if name is not None)

    def _of_kinds(self, kinds: Iterable[int]) -> dict[int, None]:
        """Return the subjects that have one of these types, in document order."""
        store = self.store
        rows = [row for kind in kinds for row in store.with_object(kind) if store.predicates[row] == self._kind]
        return dict.fromkeys(map(store.subjects.__getitem__, sorted(rows)))

    def is_individual(self, iri: str) -> bool:
        """Return True if it has a class, or is declared an individual. A class may be one too."""
        return bool(self.types(iri)) or OWL.NamedIndividual in self.values(iri, RDF.type)

    def is_property(self, iri: str) -> bool:
        """Return True if it is declared a property of any kind."""
        return any(
            isinstance(kind, str) and kind.startswith(_LANGUAGE) and kind.endswith("Property")
            for kind in self.values(iri, RDF.type)
        )

    def defined(self, iri: str) -> bool:
        """Return True if any document declares it, gives it a class, or places it below one."""
        number, predicates = self._number_of_thing(iri), self.store.predicates
        return number is not None and any(predicates[row] in self._defining for row in self.store.about(number))

    def _number_of_thing(self, iri: str) -> int | None:
        """Return its number; of one of RoboEarth's about which no document says anything that of KnowRob's class."""
        iri = iri if iri.startswith(ABSOLUTE) else expand(iri)
        number = self.store.numbers.get(iri)
        if iri.startswith(ROBOEARTH) and (number is None or self.store.first_about(number) < 0):
            other = twin(iri)
            return number if other is None else self.store.numbers.get(other)
        return number

    def individuals(self, cls: str) -> tuple[str, ...]:
        """Return the individuals of a class and of its subclasses, in document order."""
        wanted = (self.store.find(name) for name in self.subclasses(cls))
        names = map(self.store.name, self._of_kinds(number for number in wanted if number is not None))
        return tuple(name for name in names if name is not None)

    def unused(self) -> Iterator[str]:
        """Yield what the main document gives a type and no document mentions otherwise; each once."""
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
        """Return True if the main document states something about it."""
        number = self._number(iri)
        return number is not None and self.store.first_about(number) in self._main

    def span(self, iri: str) -> Span | None:
        """Return the position of its definition: its first type, else the first statement about it."""
        first = None
        for row in self._about(iri):
            if self.store.predicates[row] == self._kind:
                return self.store.span(row)
            first = row if first is None else first
        return None if first is None else self.store.span(first)

    def label(self, iri: str) -> str | None:
        """Return its label: one in English or without language before others."""
        labels = [value for value in self.values(iri, RDFS.label) if isinstance(value, Literal)]
        labels.sort(key=lambda label: not (label.language or "en").startswith("en"))
        return labels[0].value.strip() if labels else None

    # hierarchies

    @cached_property
    def taxonomy(self) -> Taxonomy:
        """The class hierarchy."""
        mentioned = (term for term in self.store.terms if isinstance(term, str))
        stated = tuple(edges(self.store))
        undefined = [upper for upper in dict.fromkeys(upper for _, upper in stated) if not self.defined(upper)]
        same = namesakes(undefined, self.class_names()).items()
        return Taxonomy((*stated, *alias_edges(self.is_class, mentioned), *same))

    def ancestors(self, cls: str) -> tuple[str, ...]:
        """Return the class itself, then its superclasses, nearest first."""
        return self.taxonomy.ancestors(expand(cls))

    def parents(self, cls: str) -> tuple[str, ...]:
        """Return the named classes directly above: stated, members of a stated intersection, or equivalent."""
        return self.taxonomy.parents(expand(cls))

    def subclasses(self, cls: str) -> tuple[str, ...]:
        """Return the class itself, then its subclasses, nearest first."""
        return self.taxonomy.descendants(expand(cls))

    def is_a(self, cls_or_individual: str, cls: str) -> bool:
        """Return True for a class below ``cls`` or the same, and for an individual of such a class."""
        iri, wanted = expand(cls_or_individual), expand(cls)
        return self.taxonomy.is_below(iri, wanted) or any(
            self.taxonomy.is_below(kind, wanted) for kind in self.types(iri)
        )

    def any_is_a(self, names: Iterable[str], classes: Iterable[str]) -> bool:
        """Return True if one of several classes or individuals is of one of some classes; see :meth:`is_a`."""
        wanted = tuple(map(expand, classes))
        return any(self.is_a(name, cls) for name in names for cls in wanted)

    def subproperties(self, p: str) -> tuple[str, ...]:
        """Return the property itself, then those below it, nearest first."""
        return by_distance(expand(p), self._property_children)

    def superproperties(self, p: str) -> tuple[str, ...]:
        """Return the property itself, then those above it, nearest first."""
        return by_distance(expand(p), self._property_parents)

    @cached_property
    def _property_edges(self) -> list[tuple[str, str]]:
        same = OWL.equivalentProperty
        stated = [(t, t.subject, t.object) for p in (RDFS.subPropertyOf, same) for t in self.triples(p=p)]
        named = [(t, one, two) for t, one, two in stated if isinstance(one, str) and isinstance(two, str)]
        found = [[(one, two), (two, one)] if t.predicate == same else [(one, two)] for t, one, two in named]
        return [edge for edges in found for edge in edges]

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
        """Return the restrictions that a class states itself, in source order; for a nameless one its parts."""
        number = self._number(cls)
        if number is None:
            return ()
        found = self._restrictions.get(number)
        if found is None:
            found = self._restrictions[number] = tuple(restrictions_of(self.store, self._class_words, number))
        return found

    @cached_property
    def _class_words(self) -> Words:
        return Words.of(self.store)

    def members(self, expression: Term) -> tuple[Term, ...]:
        """Return the members of an intersection, flattened; of anything else the expression itself."""
        number = self.store.find(expression) if isinstance(expression, BNode) else None
        return (expression,) if number is None else tuple(map(self.store.term, conjuncts(self.store, number)))

    def alternatives(self, expression: Term) -> tuple[Term, ...]:
        """Return the members of a union in their order, flattened; nothing for anything else."""
        number = self.store.find(expression) if isinstance(expression, (str, BNode)) else None
        return () if number is None else tuple(map(self.store.term, disjuncts(self.store, number)))

    def inherited_restrictions(self, cls: str, p: str | None = None) -> tuple[Restriction, ...]:
        """Return the restrictions of a class and its ancestors, nearest first; only of ``p`` and below, if given."""
        wanted = frozenset(self.subproperties(p)) if p is not None else None
        return tuple(
            restriction
            for ancestor in self.ancestors(cls)
            for restriction in self.restrictions(ancestor)
            if wanted is None or restriction.property in wanted
        )

    def valid_properties(self, action: str) -> tuple[str, ...]:
        """Return IRIs of properties that the vocabulary lists (``hasParameter``) for an action class or an ancestor.

        Sub-properties of those are valid too.
        """
        listing = tuple(ancestor for ancestor in self.ancestors(action) if ancestor in self._parameters)
        found = self._listed.get(listing)
        if found is None:
            stated = (value for ancestor in listing for value in self._parameters[ancestor])
            every = (name for value in stated for name in self.subproperties(value))
            found = self._listed[listing] = tuple(dict.fromkeys(every))
        return found

    @cached_property
    def _parameters(self) -> dict[str, list[str]]:
        """The properties that the vocabulary lists for each class."""
        found: dict[str, list[str]] = {}
        for triple in self.triples(p=KNOWROB + "hasParameter"):
            if isinstance(triple.subject, str) and isinstance(triple.object, str):
                found.setdefault(triple.subject, []).append(triple.object)
        return found
