"""Writes graphs in functional syntax, an axiom a line, sorted independently of the triples' order, or in file order.

:func:`document_of` finds the axioms as words with their parts, which OWL/XML has, too.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import partial
from typing import NamedTuple

from planlang.ontology.canonical import ANNOTATION, AXIOM, CannotSay, Graph, Sorting
from planlang.ontology.canonical import Names as Prefixes
from planlang.ontology.expression_text import Expressions, Words
from planlang.ontology.expressions import Expression
from planlang.ontology.manchester_writer import ANNOTATING, CHARACTERISTICS
from planlang.ontology.structures import ENTITIES, EXPRESSIONS, fits
from planlang.ontology.terms import LANGUAGES, OWL, RDF, RDFS, XSD, BNode, Literal, Term, Triple
from planlang.records import dataclass

_KINDS = {iri: word for word, iri in ENTITIES.items()}
_EXPRESSION_WORDS = {(form.kind, form.data): word for word, form in EXPRESSIONS.items()}
_PAIRS = {
    RDFS.subClassOf: "SubClassOf",
    OWL.equivalentClass: "EquivalentClasses",
    OWL.disjointWith: "DisjointClasses",
    OWL.sameAs: "SameIndividual",
    OWL.differentFrom: "DifferentIndividuals",
    OWL.inverseOf: "InverseObjectProperties",
    RDFS.subPropertyOf: "Sub{}PropertyOf",
    OWL.equivalentProperty: "Equivalent{}Properties",
    OWL.propertyDisjointWith: "Disjoint{}Properties",
    RDFS.domain: "{}PropertyDomain",
    RDFS.range: "{}PropertyRange",
}
"""Property -> word of the axiom; {} is the kind of property."""
_LISTS = {OWL.disjointUnionOf: "DisjointUnion", OWL.hasKey: "HasKey", OWL.propertyChainAxiom: "SubObjectPropertyOf"}
_SEVERAL = {
    OWL.AllDisjointClasses: "DisjointClasses",
    OWL.AllDisjointProperties: "Disjoint{}Properties",
    OWL.AllDifferent: "DifferentIndividuals",
}


class Word(NamedTuple):
    """A word with its parts, the annotations first; a number that it counts comes before the parts that it is of."""

    word: str
    parts: tuple[Term | Word, ...]


@dataclass(frozen=True, slots=True)
class Document:
    """An ontology: names and namespaces of prefixes, the IRI and its version if there are any, and the axioms."""

    prefixes: list[tuple[str, str]]
    names: list[str]
    header: list[Word]
    """Imports and annotations of the ontology."""
    axioms: list[Word]
    lost: list[Triple]
    """Triples that the words of OWL 2 cannot express."""
    words: AxiomWords


def document_of(triples: Iterable[Triple], prefixes: Mapping[str, str], *, order: Sorting = Sorting.TERMS) -> Document:
    """Find the axioms that a graph states, sorted by their text in functional syntax or as in the file."""
    return _Reader(Graph(triples, order=order), prefixes, order=order).document()


def functional(
    triples: Iterable[Triple], prefixes: Mapping[str, str], *, order: Sorting = Sorting.TERMS
) -> tuple[str, list[Triple]]:
    """Write a graph; also return the triples that functional syntax cannot express.

    Equal graphs give equal texts if sorted. In the order of the file, unused prefixes are kept, too.
    """
    document = document_of(triples, prefixes, order=order)
    write = document.words.written
    lines = [f"Prefix({name}:=<{space}>)" for name, space in document.prefixes]
    lines += ["", f"Ontology({' '.join(map(document.words.full, document.names))}"]
    lines += [write(word) for word in (*document.header, *document.axioms)]
    return "\n".join([*lines, ")", ""]), document.lost


class AxiomWords(Words):
    """Writes names, values and words with their parts in parentheses."""

    def name(self, iri: str) -> str:
        found = self._names.split(iri)
        return f"{found[0]}:{found[1]}" if found is not None else self.full(iri)

    def literal(self, literal: Literal) -> str:
        quoted = self.quoted(literal)
        return f"{quoted}^^{self.name(literal.datatype)}" if literal.datatype else quoted

    def written(self, part: Term | Word) -> str:
        """Write a part. Raises CannotSay for characters that functional syntax cannot have."""
        match part:
            case Word("Import", (str(iri),)):
                return f"Import({self.full(iri)})"
            case Word(word, (Literal(number), *parts)) if word.endswith("Cardinality"):
                return f"{word}({' '.join([number, *map(self.written, parts)])})"
            case Word(word, parts):
                return f"{word}({' '.join(map(self.written, parts))})"
            case _:
                return self.term(part)


def _part(expression: Expression) -> Term | Word:
    """Make a name or a word of an expression. Raises CannotSay if there is no word for it."""
    kind, parts = expression.kind, [_part(part) for part in expression.parts]
    if kind == "name":
        assert expression.term is not None
        return expression.term
    if kind == "facets":
        parts += [one for facet in expression.facets for one in facet]
    elif kind in ("min", "max", "exactly"):
        parts.insert(0, Literal(str(expression.number), XSD.nonNegativeInteger))
    words = (_EXPRESSION_WORDS.get((kind, data)) for data in (expression.data, False))
    given = expression.parts[:1] if kind == "facets" else expression.parts
    for word in words:  # what a property of data has as a class is written as of an object: the triples are equal
        if word is not None and (kind == "facets" or fits(word, given)):
            return Word(word, tuple(parts))
    raise CannotSay(f"an expression {kind} of such parts")


class _Reader:
    def __init__(self, graph: Graph, prefixes: Mapping[str, str], *, order: Sorting) -> None:
        self._graph = graph
        self._order = order
        self._declared = prefixes if order is Sorting.FILE else None
        self._header = graph.header
        own = self._header.subject if self._header is not None else None
        self._names = Prefixes(prefixes, own if isinstance(own, str) else None)
        self._words = AxiomWords(self._names)
        self._data = frozenset(one.subject for one in graph.triples if one.object == OWL.DatatypeProperty)
        self._notes = frozenset(one.subject for one in graph.triples if one.object == OWL.AnnotationProperty)
        self._expressions = Expressions(graph, self._data)

    def document(self) -> Document:
        names, header = self._head()
        unwritten = (triple for triple in self._in_order() if triple not in self._graph.written)
        stated = [
            (triple.span, word)
            for triple in unwritten
            for word in self._graph.attempt(triple, partial(self._sayable, partial(self._statement, triple)))
        ]
        if self._order is Sorting.FILE:
            stated.sort(key=lambda one: one[0])
        axioms = [word for _, word in stated]
        if self._order is Sorting.TERMS:
            axioms.sort(key=lambda word: (word.word != "Declaration", self._words.written(word)))
        standard = zip(("owl", "rdf", "rdfs", "xsd"), LANGUAGES, strict=True)
        prefixes = {**dict(standard), **dict(self._names.used(self._declared))}
        ordered = sorted(prefixes.items(), key=lambda one: f"{one[0]}:")
        return Document(ordered, names, header, axioms, list(self._graph.rest()), self._words)

    def _sayable(self, words: Callable[[], list[Word]]) -> list[Word]:
        """Make words. Raises CannotSay if they have a name or a value that cannot be written."""
        made = words()
        for word in made:
            self._words.written(word)
        return made

    def _in_order(self) -> Iterator[Triple]:
        """Yield all triples; what is said of blank nodes, which may annotate axioms, after the axioms."""
        axioms = (RDF.type, *_PAIRS, *_LISTS)
        yield from (one for one in self._graph.triples if isinstance(one.subject, str) or one.predicate in axioms)
        yield from self._graph.triples

    def _head(self) -> tuple[list[str], list[Word]]:
        """Make the IRI of the ontology and its version, as far as there are any, and its imports and annotations."""
        graph, names = self._graph, list[str]()
        if self._header is None:
            return names, []
        subject = self._header.subject
        graph.write(self._header)
        if isinstance(subject, str):
            self._words.full(subject)
            names.append(subject)
            versions = graph.about(subject, OWL.versionIRI)
            if len(versions) == 1 and isinstance(versions[0].object, str):
                self._words.full(versions[0].object)
                names.append(versions[0].object)
                graph.write(*versions)
        words: list[Word] = []
        for triple in sorted(graph.about(subject), key=lambda one: one.predicate != OWL.imports):  # imports come first
            if triple.predicate == OWL.imports and isinstance(triple.object, str):
                made = partial(list[Word], [Word("Import", (triple.object,))])
            elif triple.predicate not in (RDF.type, OWL.versionIRI, OWL.imports):
                made = partial(self._annotation, triple)
            else:
                continue
            words += graph.attempt(triple, partial(self._sayable, made))
        return names, words

    # annotations

    def _annotation(self, triple: Triple, kind: str = ANNOTATION) -> list[Word]:
        """Make an annotation, once for each node of annotations of it, or once without."""
        parts = (triple.predicate, triple.object)
        return [Word("Annotation", (*notes, *parts)) for notes in self._noted(triple, kind) or [[]]]

    def _noted(self, triple: Triple, kind: str = AXIOM) -> list[list[Word]]:
        """Make the annotations of a triple, for each node that has some."""
        return [self._all(notes) for notes in self._graph.annotations(triple, kind)]

    def _all(self, notes: Iterable[Triple]) -> list[Word]:
        return [word for note in notes for word in self._annotation(note)]

    def _axiom(self, triple: Triple, word: str, *parts: Term | Word) -> list[Word]:
        return [Word(word, (*notes, *parts)) for notes in self._noted(triple) or [[]]]

    # axioms

    def _statement(self, triple: Triple) -> list[Word]:
        """Make the axiom that a triple states. Raises CannotSay if it is a part of one, or states none."""
        subject, predicate, value = triple.subject, triple.predicate, triple.object
        if predicate == RDF.type:
            return self._type(triple)
        if predicate in _LISTS:
            return self._list(triple)
        if predicate in _PAIRS:
            return self._pair(triple)
        if predicate.startswith(LANGUAGES) and predicate not in ANNOTATING:
            raise CannotSay("a part of an expression")
        if predicate in self._notes or predicate in ANNOTATING:
            return self._axiom(triple, "AnnotationAssertion", predicate, subject, value)
        if isinstance(value, Literal):
            word = "DataPropertyAssertion" if predicate in self._data else "AnnotationAssertion"
        else:
            word = "ObjectPropertyAssertion"
        return self._axiom(triple, word, predicate, subject, value)

    def _type(self, triple: Triple) -> list[Word]:
        subject, kind = triple.subject, triple.object
        if isinstance(kind, str) and isinstance(subject, str) and kind in _KINDS:
            return self._axiom(triple, "Declaration", Word(_KINDS[kind], (subject,)))
        if isinstance(kind, str) and kind in CHARACTERISTICS:
            is_data = subject in self._data and kind == OWL.FunctionalProperty
            word = f"{CHARACTERISTICS[kind]}{'Data' if is_data else 'Object'}Property"
            return self._axiom(triple, word, self._subject(triple, word))
        if isinstance(kind, str) and kind in _SEVERAL:
            return self._several(triple, _SEVERAL[kind])
        if kind == OWL.NegativePropertyAssertion:
            return self._denial(triple)
        is_language = isinstance(kind, str) and kind.startswith(LANGUAGES) and kind not in (OWL.Thing, OWL.Nothing)
        if is_language or isinstance(kind, Literal):
            raise CannotSay("a word of the language")
        return self._axiom(triple, "ClassAssertion", self._object(triple, "ClassAssertion", 0), subject)

    def _object(self, triple: Triple, word: str, place: int = 1) -> Term | Word:
        """Make the object of a triple, which is a part of an axiom at a place. Raises CannotSay if it cannot be."""
        return self._part(self._expressions.of(triple), word, place)

    def _subject(self, triple: Triple, word: str) -> Term | Word:
        """Make the subject of an axiom: a name, or an expression that nothing else uses."""
        if isinstance(triple.subject, str):
            return triple.subject
        if self._graph.uses(triple.subject):
            raise CannotSay("an expression that is used twice")
        return self._part(self._expressions.about(triple.subject, triple), word, 0)

    @staticmethod
    def _part(expression: Expression, word: str, place: int) -> Term | Word:
        if not fits(word, [expression], place):
            raise CannotSay(f"a part that {word} cannot have")
        return _part(expression)

    def _of(self, *terms: Term) -> str:
        """Kind of properties among which these are, for the word of an axiom."""
        if any(term in self._data for term in terms):
            return "Data"
        return "Annotation" if any(term in self._notes or term in ANNOTATING for term in terms) else "Object"

    def _pair(self, triple: Triple) -> list[Word]:
        subject, predicate, value = triple.subject, triple.predicate, triple.object
        if isinstance(value, Literal):
            raise CannotSay("a value where a name belongs")
        word = _PAIRS[predicate].format(self._of(subject, value) if predicate != RDFS.range else self._of(subject))
        if predicate in (OWL.sameAs, OWL.differentFrom):
            return self._axiom(triple, word, subject, value)
        if predicate == OWL.equivalentClass and self._graph.has(subject, RDF.type, RDFS.Datatype):
            word = "DatatypeDefinition"
        if word.startswith(("AnnotationProperty", "SubAnnotation")) and not isinstance(value, str):
            raise CannotSay("an expression of an annotation property")
        if word in ("EquivalentAnnotationProperties", "DisjointAnnotationProperties"):
            word = word.replace("Annotation", "Object")
        if predicate == OWL.inverseOf and not isinstance(subject, str):
            raise CannotSay("an inverse, which is no axiom")
        first = self._subject(triple, word)
        return self._axiom(triple, word, first, self._object(triple, word))

    def _list(self, triple: Triple) -> list[Word]:
        word, is_chain = _LISTS[triple.predicate], triple.predicate == OWL.propertyChainAxiom
        subject = self._subject(triple, word)
        members = self._members(triple, "ObjectPropertyChain" if is_chain else word, 2 if is_chain else 1)
        if is_chain:
            return self._axiom(triple, word, Word("ObjectPropertyChain", tuple(part for part, _ in members)), subject)
        if triple.predicate == OWL.hasKey:  # the properties of objects, then those of data, each in parentheses
            if [term in self._data for _, term in members] != sorted(term in self._data for _, term in members):
                raise CannotSay("a key whose properties of data are not last")
            groups = (tuple(part for part, term in members if (term in self._data) is data) for data in (False, True))
            return self._axiom(triple, word, subject, *(Word("", group) for group in groups))
        return self._axiom(triple, word, subject, *(part for part, _ in members))

    def _members(self, triple: Triple, word: str, least: int) -> list[tuple[Term | Word, Term]]:
        items = self._graph.items(triple)
        if len(items) < least or any(isinstance(item.object, Literal) for item in items):
            raise CannotSay("too few items, or values among them")
        return [(self._object(item, word, -1), item.object) for item in items]

    def _several(self, typed: Triple, word: str) -> list[Word]:
        graph, node = self._graph, typed.subject
        members = [one for one in graph.about(node) if one.predicate in (OWL.members, OWL.distinctMembers)]
        if len(members) != 1 or not isinstance(node, BNode):
            raise CannotSay("no members, or several lists of them")
        if word == "DifferentIndividuals":
            parts: Sequence[Term | Word] = [item.object for item in graph.items(members[0])]
            if any(isinstance(part, Literal) for part in parts):
                raise CannotSay("values among individuals")
        else:
            word = word.format(self._of(*(item.object for item in graph.items(members[0]))))
            parts = [part for part, _ in self._members(members[0], word, 2)]
        if len(parts) < 2:
            raise CannotSay("too few items")
        notes = [one for one in graph.about(node) if one not in (typed, members[0])]
        made = Word(word, (*self._all(notes), *parts))
        graph.write(members[0], *notes)
        return [made]

    def _denial(self, typed: Triple) -> list[Word]:
        graph, node = self._graph, typed.subject
        core = {name: graph.one(node, OWL + name) for name in ("sourceIndividual", "assertionProperty")}
        targets = [one for name in ("targetIndividual", "targetValue") for one in graph.about(node, OWL + name)]
        source, prop = core.values()
        if source is None or prop is None or len(targets) != 1 or isinstance(source.object, Literal):
            raise CannotSay("an incomplete negative fact")
        of = "Data" if targets[0].predicate == OWL.targetValue else "Object"
        notes = [one for one in graph.about(node) if one not in (typed, source, prop, targets[0])]
        word = f"Negative{of}PropertyAssertion"
        parts = (self._object(prop, word, 0), source.object, targets[0].object)
        made = Word(word, (*self._all(notes), *parts))
        graph.write(source, targets[0], *notes)
        return [made]
