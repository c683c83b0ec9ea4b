"""Writes graphs in functional syntax, an axiom a line, sorted independently of the triples' order, or in file order."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from functools import partial

from planlang.ontology.canonical import ANNOTATION, AXIOM, CannotSay, Graph, Sorting
from planlang.ontology.canonical import Names as Prefixes
from planlang.ontology.expression_text import Expressions, Words
from planlang.ontology.expressions import Expression
from planlang.ontology.manchester_writer import ANNOTATING, CHARACTERISTICS, LANGUAGES
from planlang.ontology.structures import ENTITIES, EXPRESSIONS, fits
from planlang.ontology.terms import OWL, RDF, RDFS, BNode, Literal, Term, Triple

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


def functional(
    triples: Iterable[Triple], prefixes: Mapping[str, str], *, order: Sorting = Sorting.TERMS
) -> tuple[str, list[Triple]]:
    """Write a graph; also return the triples that functional syntax cannot express.

    Equal graphs give equal texts if sorted. In the order of the file, unused prefixes are kept, too.
    """
    graph = Graph(triples, order=order)
    return _Writer(graph, prefixes, order=order).text(), list(graph.rest())


class _FunctionalWords(Words):
    """Writes names, values and expressions as words with parentheses."""

    def name(self, iri: str) -> str:
        found = self._names.split(iri)
        return f"{found[0]}:{found[1]}" if found is not None else self.full(iri)

    def literal(self, literal: Literal) -> str:
        quoted = self.quoted(literal)
        return f"{quoted}^^{self.name(literal.datatype)}" if literal.datatype else quoted

    def text(self, expression: Expression, *, inside: bool = False) -> str:
        kind, parts = expression.kind, [self.text(part) for part in expression.parts]
        if kind == "name":
            assert expression.term is not None
            return self.term(expression.term)
        if kind == "facets":
            parts += [f"{self.name(name)} {self.literal(value)}" for name, value in expression.facets]
        elif kind in ("min", "max", "exactly"):
            parts.insert(0, str(expression.number))
        words = (_EXPRESSION_WORDS.get((kind, data)) for data in (expression.data, False))
        given = expression.parts[:1] if kind == "facets" else expression.parts
        for word in words:  # what a property of data has as a class is written as of an object: the triples are equal
            if word is not None and (kind == "facets" or fits(word, given)):
                return f"{word}({' '.join(parts)})"
        raise CannotSay(f"an expression {kind} of such parts")


class _Writer:
    def __init__(self, graph: Graph, prefixes: Mapping[str, str], *, order: Sorting) -> None:
        self._graph = graph
        self._order = order
        self._declared = prefixes if order is Sorting.FILE else None
        self._header = graph.header
        own = self._header.subject if self._header is not None else None
        self._names = Prefixes(prefixes, own if isinstance(own, str) else None)
        self._words = _FunctionalWords(self._names)
        self._data = frozenset(one.subject for one in graph.triples if one.object == OWL.DatatypeProperty)
        self._notes = frozenset(one.subject for one in graph.triples if one.object == OWL.AnnotationProperty)
        self._expressions = Expressions(graph, self._data)

    def text(self) -> str:
        head = self._head()
        unwritten = (triple for triple in self._in_order() if triple not in self._graph.written)
        stated = [
            (triple.span, text)
            for triple in unwritten
            for text in self._graph.attempt(triple, partial(self._statement, triple))
        ]
        if self._order is Sorting.FILE:
            stated.sort(key=lambda one: one[0])
        axioms = [text for _, text in stated]
        if self._order is Sorting.TERMS:
            axioms.sort(key=lambda text: (not text.startswith("Decl"), text))
        prefixes = [f"Prefix({name}:=<{space}>)\n" for name, space in self._names.used(self._declared)]
        standard = {prefix.partition(":=")[0] for prefix in prefixes}
        prefixes += [
            f"Prefix({name}:=<{space}>)\n"
            for name, space in zip(("owl", "rdf", "rdfs", "xsd"), (OWL, RDF, RDFS, LANGUAGES[3]), strict=True)
            if f"Prefix({name}" not in standard
        ]
        lines = "".join(f"{axiom}\n" for axiom in axioms)
        return f"{''.join(sorted(prefixes))}\n{head}\n{lines})\n"

    def _in_order(self) -> Iterator[Triple]:
        """Yield all triples; what is said of blank nodes, which may annotate axioms, after the axioms."""
        axioms = (RDF.type, *_PAIRS, *_LISTS)
        yield from (one for one in self._graph.triples if isinstance(one.subject, str) or one.predicate in axioms)
        yield from self._graph.triples

    def _head(self) -> str:
        graph = self._graph
        if self._header is None:
            return "Ontology("
        subject, lines = self._header.subject, ["Ontology("]
        graph.write(self._header)
        if isinstance(subject, str):
            lines[0] += self._words.full(subject)
            versions = graph.about(subject, OWL.versionIRI)
            if len(versions) == 1 and isinstance(versions[0].object, str):
                lines[0] += f" {self._words.full(versions[0].object)}"
                graph.write(*versions)
        for triple in sorted(graph.about(subject), key=lambda one: one.predicate != OWL.imports):  # imports come first
            if triple.predicate == OWL.imports and isinstance(triple.object, str):
                lines += graph.attempt(triple, partial(self._import, triple.object))
            elif triple.predicate not in (RDF.type, OWL.versionIRI, OWL.imports):
                lines += graph.attempt(triple, partial(self._annotation, triple))
        return "\n".join(lines)

    def _import(self, iri: str) -> list[str]:
        return [f"Import({self._words.full(iri)})"]

    # annotations

    def _annotation(self, triple: Triple, kind: str = ANNOTATION) -> list[str]:
        """Write ``Annotation(property value)``, once for each annotation of it, or once without."""
        words = f"{self._words.name(triple.predicate)} {self._words.term(triple.object)})"
        return [f"Annotation({note}{words}" for note in self._noted(triple, kind) or [""]]

    def _noted(self, triple: Triple, kind: str = AXIOM) -> list[str]:
        """Write the annotations of a triple, for each node that has some, with a space at the end."""
        return [self._all(notes) for notes in self._graph.annotations(triple, kind)]

    def _all(self, notes: Iterable[Triple]) -> str:
        return "".join(f"{text} " for note in notes for text in self._annotation(note))

    def _axiom(self, triple: Triple, word: str, parts: str) -> list[str]:
        return [f"{word}({note}{parts})" for note in self._noted(triple) or [""]]

    # axioms

    def _statement(self, triple: Triple) -> list[str]:
        """Write the axiom that a triple states. Raises CannotSay if it is a part of one, or states none."""
        subject, predicate, value = triple.subject, triple.predicate, triple.object
        if predicate == RDF.type:
            return self._type(triple)
        if predicate in _LISTS:
            return self._list(triple)
        if predicate in _PAIRS:
            return self._pair(triple)
        if predicate.startswith(LANGUAGES) and predicate not in ANNOTATING:
            raise CannotSay("a part of an expression")
        names = f"{self._words.name(predicate)} {self._words.term(subject)} {self._words.term(value)}"
        if predicate in self._notes or predicate in ANNOTATING:
            return self._axiom(triple, "AnnotationAssertion", names)
        if isinstance(value, Literal):
            word = "DataPropertyAssertion" if predicate in self._data else "AnnotationAssertion"
        else:
            word = "ObjectPropertyAssertion"
        return self._axiom(triple, word, names)

    def _type(self, triple: Triple) -> list[str]:
        subject, kind = triple.subject, triple.object
        if isinstance(kind, str) and isinstance(subject, str) and kind in _KINDS:
            return self._axiom(triple, "Declaration", f"{_KINDS[kind]}({self._words.name(subject)})")
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
        return self._axiom(
            triple, "ClassAssertion", f"{self._object(triple, 'ClassAssertion', 0)} {self._words.term(subject)}"
        )

    def _object(self, triple: Triple, word: str, place: int = 1) -> str:
        """Write the object of a triple, which is a part of an axiom at a place. Raises CannotSay if it cannot be."""
        return self._part(self._expressions.of(triple), word, place)

    def _subject(self, triple: Triple, word: str) -> str:
        """Write the subject of an axiom: a name, or an expression that nothing else uses."""
        if isinstance(triple.subject, str):
            return self._words.name(triple.subject)
        if self._graph.uses(triple.subject):
            raise CannotSay("an expression that is used twice")
        return self._part(self._expressions.about(triple.subject, triple), word, 0)

    def _part(self, expression: Expression, word: str, place: int) -> str:
        if not fits(word, [expression], place):
            raise CannotSay(f"a part that {word} cannot have")
        return self._words.text(expression)

    def _of(self, *terms: Term) -> str:
        """Kind of properties among which these are, for the word of an axiom."""
        if any(term in self._data for term in terms):
            return "Data"
        return "Annotation" if any(term in self._notes or term in ANNOTATING for term in terms) else "Object"

    def _pair(self, triple: Triple) -> list[str]:
        subject, predicate, value = triple.subject, triple.predicate, triple.object
        if isinstance(value, Literal):
            raise CannotSay("a value where a name belongs")
        word = _PAIRS[predicate].format(self._of(subject, value) if predicate != RDFS.range else self._of(subject))
        if predicate in (OWL.sameAs, OWL.differentFrom):
            return self._axiom(triple, word, f"{self._words.term(subject)} {self._words.term(value)}")
        if predicate == OWL.equivalentClass and self._graph.has(subject, RDF.type, RDFS.Datatype):
            word = "DatatypeDefinition"
        if word.startswith(("AnnotationProperty", "SubAnnotation")) and not isinstance(value, str):
            raise CannotSay("an expression of an annotation property")
        if word in ("EquivalentAnnotationProperties", "DisjointAnnotationProperties"):
            word = word.replace("Annotation", "Object")
        if predicate == OWL.inverseOf and not isinstance(subject, str):
            raise CannotSay("an inverse, which is no axiom")
        first = self._subject(triple, word)
        return self._axiom(triple, word, f"{first} {self._object(triple, word)}")

    def _list(self, triple: Triple) -> list[str]:
        word, is_chain = _LISTS[triple.predicate], triple.predicate == OWL.propertyChainAxiom
        subject = self._subject(triple, word)
        members = self._members(triple, "ObjectPropertyChain" if is_chain else word, 2 if is_chain else 1)
        texts = [text for text, _ in members]
        if is_chain:
            return self._axiom(triple, word, f"ObjectPropertyChain({' '.join(texts)}) {subject}")
        if triple.predicate == OWL.hasKey:
            data = [text for text, term in members if term in self._data]
            others = [text for text, term in members if term not in self._data]
            if [term in self._data for _, term in members] != sorted(term in self._data for _, term in members):
                raise CannotSay("a key whose properties of data are not last")
            texts = [f"({' '.join(others)})", f"({' '.join(data)})"]
        return self._axiom(triple, word, f"{subject} {' '.join(texts)}")

    def _members(self, triple: Triple, word: str, least: int) -> list[tuple[str, Term]]:
        items = self._graph.items(triple)
        if len(items) < least or any(isinstance(item.object, Literal) for item in items):
            raise CannotSay("too few items, or values among them")
        return [(self._object(item, word, -1), item.object) for item in items]

    def _several(self, typed: Triple, word: str) -> list[str]:
        graph, node = self._graph, typed.subject
        members = [one for one in graph.about(node) if one.predicate in (OWL.members, OWL.distinctMembers)]
        if len(members) != 1 or not isinstance(node, BNode):
            raise CannotSay("no members, or several lists of them")
        if word == "DifferentIndividuals":
            items = [item.object for item in graph.items(members[0])]
            if any(isinstance(item, Literal) for item in items):
                raise CannotSay("values among individuals")
            written = [(self._words.term(item), item) for item in items]
        else:
            word = word.format(self._of(*(item.object for item in graph.items(members[0]))))
            written = self._members(members[0], word, 2)
        if len(written) < 2:
            raise CannotSay("too few items")
        notes = [one for one in graph.about(node) if one not in (typed, members[0])]
        texts = f"{self._all(notes)}{' '.join(text for text, _ in written)}"
        graph.write(members[0], *notes)
        return [f"{word}({texts})"]

    def _denial(self, typed: Triple) -> list[str]:
        graph, node = self._graph, typed.subject
        core = {name: graph.one(node, OWL + name) for name in ("sourceIndividual", "assertionProperty")}
        targets = [one for name in ("targetIndividual", "targetValue") for one in graph.about(node, OWL + name)]
        source, prop = core.values()
        if source is None or prop is None or len(targets) != 1 or isinstance(source.object, Literal):
            raise CannotSay("an incomplete negative fact")
        of = "Data" if targets[0].predicate == OWL.targetValue else "Object"
        notes = [one for one in graph.about(node) if one not in (typed, source, prop, targets[0])]
        terms = f"{self._words.term(source.object)} {self._words.term(targets[0].object)}"
        word = f"Negative{of}PropertyAssertion"
        text = f"{word}({self._all(notes)}{self._object(prop, word, 0)} {terms})"
        graph.write(source, targets[0], *notes)
        return [text]
