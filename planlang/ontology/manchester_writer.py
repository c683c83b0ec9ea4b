"""Writes graphs in Manchester syntax, as frames sorted independently of the triples' order, or in file order."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import field
from functools import partial

from planlang.ontology.canonical import ANNOTATION, AXIOM, CannotSay, Graph, Names, Sorting
from planlang.ontology.expression_text import FORMS, Expressions, Words
from planlang.ontology.terms import LANGUAGES, OWL, RDF, RDFS, BNode, Literal, Term, Triple
from planlang.records import dataclass


def manchester(
    triples: Iterable[Triple], prefixes: Mapping[str, str], *, order: Sorting = Sorting.TERMS
) -> tuple[str, list[Triple]]:
    """Write a graph; also return the triples that Manchester syntax cannot express.

    Equal graphs give equal texts if sorted. In the order of the file, unused prefixes are kept, too. Undeclared
    entities get a frame, which declares them.
    """
    graph = Graph(triples, order=order)
    return _Writer(graph, prefixes, order=order).text(), list(graph.rest())


class _Writer:
    def __init__(self, graph: Graph, prefixes: Mapping[str, str], *, order: Sorting) -> None:
        self._graph = graph
        self._order = order
        self._declared = prefixes if order is Sorting.FILE else None
        self._ontology = graph.header
        own = self._ontology.subject if self._ontology is not None else None
        self._names = Names(prefixes, own if isinstance(own, str) else None)
        self._words = Words(self._names)
        self._expressions = Expressions(graph)
        self._frames: dict[tuple[str, str | BNode], Frame] = {}
        self._pairs: list[str] = []

    def text(self) -> str:
        header = self._header()
        subjects = self._graph.subjects()
        for subject in subjects:
            if isinstance(subject, str) and (self._ontology is None or subject != self._ontology.subject):
                self._entity(subject)
        found = [self._axiom(node) for node in subjects if isinstance(node, BNode)]
        for subject in subjects:
            if isinstance(subject, BNode) and (self._ontology is None or subject != self._ontology.subject):
                self._blank_node(subject)
        keys = list(self._frames) if self._order is Sorting.FILE else sorted(self._frames, key=self._place)
        frames = [self._frames[key].text(order=self._order) for key in keys]
        several = [text for text in (*found, *self._pairs) if text]
        several = several if self._order is Sorting.FILE else sorted(several)
        prefixes = "".join(f"Prefix: {name}: <{space}>\n" for name, space in self._names.used(self._declared))
        parts = [prefixes, header, *frames, *several]
        return "\n".join(part for part in parts if part)

    def _place(self, key: tuple[str, str | BNode]) -> tuple[int, bool, str]:
        word, subject = key
        return list(FRAMES.values()).index(word), isinstance(subject, BNode), str(subject)

    # the ontology

    def _header(self) -> str:
        if self._ontology is None:
            return ""
        subject = self._ontology.subject
        line, written = "Ontology:", [self._ontology]
        versions = self._graph.about(subject, OWL.versionIRI)
        if isinstance(subject, str):
            line += f" <{subject}>"
            if len(versions) == 1 and isinstance(versions[0].object, str):
                line += f" <{versions[0].object}>"
                written += versions
        self._graph.write(*written)
        lines = [line]
        for triple in self._graph.about(subject, OWL.imports):
            if isinstance(triple.object, str):
                lines += self._graph.attempt(triple, partial(_import, triple))
        notes = [
            note
            for triple in self._graph.about(subject)
            if triple.predicate not in (RDF.type, OWL.imports, OWL.versionIRI)
            for note in self._graph.attempt(triple, partial(self._annotation, triple))
        ]
        if notes:
            lines.append(section("Annotations", notes))
        return "\n".join(lines) + "\n"

    # annotations

    def _annotation(self, triple: Triple, kind: str = ANNOTATION) -> list[str]:
        """Write ``property value``, once for each nested annotation of it, or once without."""
        words = f"{self._words.name(triple.predicate)} {self._words.term(triple.object)}"
        return [note + words for note in self._notes(triple, kind)] or [words]

    def _notes(self, triple: Triple, kind: str = AXIOM) -> list[str]:
        """Write ``Annotations: ...`` for each node that annotates a triple."""
        return [self._noted(annotations) for annotations in self._graph.annotations(triple, kind)]

    def _noted(self, notes: list[Triple]) -> str:
        """Write ``Annotations: ...`` and a space; empty without annotations."""
        texts = [text for note in notes for text in self._annotation(note)]
        return f"Annotations: {', '.join(texts)} " if texts else ""

    def _annotated(self, triple: Triple, item: str) -> list[str]:
        """Repeat an item for each node that annotates it; once without any."""
        return [note + item for note in self._notes(triple)] or [item]

    # named entities

    def _frame(self, word: str, subject: str | BNode) -> Frame:
        key = (word, subject)
        if key not in self._frames:
            self._frames[key] = Frame(word, [self._words.term(subject)])
        return self._frames[key]

    def _entity(self, subject: str) -> None:
        try:
            self._words.name(subject)
        except CannotSay:
            return
        triples = self._graph.about(subject)
        if not any(t.predicate == RDF.type and t.object in FRAMES for t in triples):  # a frame would declare it
            for triple in triples:
                if triple.predicate in PAIRS:
                    self._pairs += self._graph.attempt(triple, partial(self._pair, subject, triple))
            triples = [triple for triple in triples if triple not in self._graph.written]
            if not triples:
                return
        words = self._words_of(subject, triples)
        for triple in triples:
            word = (
                FRAMES.get(triple.object) if triple.predicate == RDF.type and isinstance(triple.object, str) else None
            )
            if word is not None:
                frame = self._frame(word, subject)
                name = self._words.term(triple.subject)
                frame.heads = self._graph.attempt(triple, partial(self._annotated, triple, name)) or frame.heads
        for word in words:
            self._frame(word, subject)
        for triple in triples:
            if triple not in self._graph.written:
                self._statement(triple, words)

    def _words_of(self, subject: str | BNode, triples: list[Triple]) -> tuple[str, ...]:
        """Choose the kinds of frames of a subject: from its declarations, else from the statements about it."""
        if isinstance(subject, BNode):
            return ("Individual",)
        declared = {FRAMES[t.object] for t in triples if t.predicate == RDF.type and t.object in FRAMES}
        needed: set[str] = set(declared)
        for triple in triples:
            if triple.predicate == RDF.type:
                if triple.object in CHARACTERISTICS:
                    places: tuple[str, ...] = PROPERTIES
                else:
                    places = () if triple.object in FRAMES or self._is_language(triple.object) else ("Individual",)
            elif triple.predicate in SECTIONS:
                places = SECTIONS[triple.predicate][1]
            elif triple.predicate in LISTS:
                places = (LISTS[triple.predicate][1],)
            else:
                places = ("Class",) if triple.predicate in FORMS else ()
            if places and not needed.intersection(places):
                needed.add(places[0])
        return tuple(word for word in FRAMES.values() if word in (needed or {"Individual"}))

    @staticmethod
    def _is_language(term: Term) -> bool:
        return isinstance(term, str) and term.startswith(LANGUAGES) and term not in (OWL.Thing, OWL.Nothing)

    def _statement(self, triple: Triple, words: tuple[str, ...]) -> None:
        """Write a triple into a section of one of the subject's frames."""
        predicate = triple.predicate
        if predicate == RDF.type:
            if triple.object in CHARACTERISTICS:
                name = CHARACTERISTICS[str(triple.object)]
                self._put(triple, words, PROPERTIES, "Characteristics", lambda: self._annotated(triple, name))
            elif not self._is_language(triple.object):
                self._put(triple, words, ("Individual",), "Types", lambda: self._expression(triple))
        elif predicate in SECTIONS:
            name, places = SECTIONS[predicate]
            self._put(triple, words, places, name, lambda: self._expression(triple))
        elif predicate in LISTS:
            name, place, between = LISTS[predicate]
            least = 2 if between == " o " else 1
            self._put(
                triple,
                words,
                (place,),
                name,
                lambda: self._annotated(triple, self._members(triple, between, at_least=least)),
            )
        elif predicate in FORMS:
            self._put(triple, words, ("Class",), "EquivalentTo", lambda: self._direct(triple))
        elif not predicate.startswith(LANGUAGES) or predicate in ANNOTATING:
            self._value(triple, words)

    def _value(self, triple: Triple, words: tuple[str, ...]) -> None:
        """Write a fact of an individual, or an annotation; both state the same triple."""
        is_fact = "Individual" in words and triple.predicate not in ANNOTATING
        if is_fact and not self._graph.has(triple.predicate, RDF.type, OWL.AnnotationProperty):
            self._put(triple, words, ("Individual",), "Facts", lambda: self._fact(triple))
        else:
            self._put(triple, words, words, "Annotations", lambda: self._annotation(triple, AXIOM))

    def _put(
        self,
        triple: Triple,
        words: tuple[str, ...],
        places: tuple[str, ...],
        section: str,
        write: Callable[[], list[str]],
    ) -> None:
        word = next((word for word in words if word in places), None)
        if word is None:
            return
        if texts := self._graph.attempt(triple, write):
            self._frame(word, triple.subject).sections.setdefault(section, []).extend(texts)

    def _expression(self, triple: Triple) -> list[str]:
        return self._annotated(triple, self._plain(triple))

    def _plain(self, triple: Triple) -> str:
        """Write the name or expression that is a triple's object."""
        if isinstance(triple.object, BNode) and triple.predicate in (OWL.sameAs, OWL.differentFrom):
            return self._words.term(triple.object)
        if isinstance(triple.object, Literal):
            raise CannotSay("a value where a name belongs")
        return self._words.text(self._expressions.of(triple))

    def _direct(self, triple: Triple) -> list[str]:
        """Write ``owl:intersectionOf`` and the like that are stated of a named class, as in OWL 1."""
        return self._annotated(triple, self._words.text(self._expressions.about(triple.subject, triple)))

    def _members(self, triple: Triple, between: str, *, at_least: int) -> str:
        items = self._items(triple, at_least)
        return between.join(self._words.text(self._expressions.of(item)) for item in items)

    def _items(self, triple: Triple, at_least: int) -> list[Triple]:
        items = self._graph.items(triple)
        if len(items) < at_least or any(isinstance(item.object, Literal) for item in items):
            raise CannotSay("too few items, or values among them")
        return items

    def _fact(self, triple: Triple) -> list[str]:
        fact = f"{self._words.name(triple.predicate)} {self._words.term(triple.object)}"
        return self._annotated(triple, fact)

    # blank nodes

    def _axiom(self, node: BNode) -> str | None:
        """Write an axiom about several entities, or about two whose first is an expression; None if it is neither.

        A negative fact is written into the frame of its individual instead.
        """
        graph = self._graph
        if graph.has(node, RDF.type, OWL.NegativePropertyAssertion):
            self._negative(node)
            return None
        for kind, word in SEVERAL.items():
            for typed in graph.about(node, RDF.type):
                if typed.object == OWL + kind:
                    return next(iter(graph.attempt(typed, partial(self._several, typed, word))), None)
        triples = [triple for triple in graph.about(node) if triple.predicate in PAIRS]
        if not triples or graph.uses(node):
            return None
        return "\n".join(graph.attempt(triples[0], partial(self._pair, node, triples[0])))

    def _several(self, typed: Triple, word: str) -> list[str]:
        members = [t for t in self._graph.about(typed.subject) if t.predicate in (OWL.members, OWL.distinctMembers)]
        if len(members) != 1:
            raise CannotSay("no members, or several lists of them")
        names = self._individuals if word == "DifferentIndividuals" else self._members
        items = names(members[0], ", ", at_least=2)
        notes = [t for t in self._graph.about(typed.subject) if t not in (typed, members[0])]
        self._graph.write(members[0], *notes)
        return [f"{word}: {self._noted(notes)}{items}\n"]

    def _individuals(self, triple: Triple, between: str, *, at_least: int) -> str:
        return between.join(self._words.term(item.object) for item in self._items(triple, at_least))

    def _pair(self, subject: str | BNode, triple: Triple) -> list[str]:
        """Write an axiom that relates two entities; the first is a name or an expression."""
        if isinstance(subject, str):
            first = self._words.name(subject)
        elif triple.predicate in (OWL.sameAs, OWL.differentFrom):
            raise CannotSay("an individual has a frame")
        else:
            first = self._words.text(self._expressions.about(subject, triple))
        item = self._plain(triple)
        notes = self._notes(triple) or [""]
        return [f"{PAIRS[triple.predicate]}: {note}{first}, {item}\n" for note in notes]

    def _negative(self, node: BNode) -> None:
        graph = self._graph
        triples = graph.about(node)

        def write() -> list[str]:
            prop = graph.one(node, OWL.assertionProperty)
            targets = [t for name in ("targetIndividual", "targetValue") for t in graph.about(node, OWL + name)]
            if prop is None or not isinstance(prop.object, str) or len(targets) != 1:
                raise CannotSay("an incomplete negative fact")
            core = (RDF.type, OWL.sourceIndividual, prop.predicate, targets[0].predicate)
            notes = [t for t in triples if t.predicate not in core]
            graph.write(*triples)
            words = f"not {self._words.name(prop.object)} {self._words.term(targets[0].object)}"
            return [self._noted(notes) + words]

        sources = graph.about(node, OWL.sourceIndividual)
        if len(sources) == 1 and not isinstance(sources[0].object, Literal):
            subject = sources[0].object
            if texts := graph.attempt(sources[0], write):
                self._frame("Individual", subject).sections.setdefault("Facts", []).extend(texts)

    def _blank_node(self, node: BNode) -> None:
        for triple in self._graph.about(node):
            if triple not in self._graph.written:
                self._statement(triple, ("Individual",))


def _import(triple: Triple) -> list[str]:
    address = triple.object
    if not isinstance(address, str) or set(address) & set(' <>"{}|^`\\\n\r\t'):
        raise CannotSay("an import whose address is no valid IRI")
    return [f"    Import: <{address}>"]


WIDTH = 120
"""Greatest length of a line with several items."""

FRAMES = {
    OWL.AnnotationProperty: "AnnotationProperty",
    RDFS.Datatype: "Datatype",
    OWL.ObjectProperty: "ObjectProperty",
    OWL.DatatypeProperty: "DataProperty",
    OWL.Class: "Class",
    OWL.NamedIndividual: "Individual",
}
"""Kind of entity -> keyword of its frame, in the order of the written file."""

PROPERTIES = ("ObjectProperty", "DataProperty", "AnnotationProperty")
SECTIONS: dict[str, tuple[str, tuple[str, ...]]] = {
    OWL.equivalentClass: ("EquivalentTo", ("Class", "Datatype")),
    RDFS.subClassOf: ("SubClassOf", ("Class",)),
    OWL.disjointWith: ("DisjointWith", ("Class",)),
    RDFS.subPropertyOf: ("SubPropertyOf", PROPERTIES),
    OWL.equivalentProperty: ("EquivalentTo", ("ObjectProperty", "DataProperty")),
    OWL.propertyDisjointWith: ("DisjointWith", ("ObjectProperty", "DataProperty")),
    OWL.inverseOf: ("InverseOf", ("ObjectProperty",)),
    RDFS.domain: ("Domain", PROPERTIES),
    RDFS.range: ("Range", PROPERTIES),
    OWL.sameAs: ("SameAs", ("Individual",)),
    OWL.differentFrom: ("DifferentFrom", ("Individual",)),
}
"""Property -> its section, and the frames that can have it; the value is an expression or a name."""

LISTS: dict[str, tuple[str, str, str]] = {
    OWL.disjointUnionOf: ("DisjointUnionOf", "Class", ", "),
    OWL.hasKey: ("HasKey", "Class", " "),
    OWL.propertyChainAxiom: ("SubPropertyChain", "ObjectProperty", " o "),
}
"""Property -> its section, its frame, and the separator of the items of its list."""

CHARACTERISTICS = {
    f"{OWL}{name}Property": name
    for name in ("Functional", "InverseFunctional", "Reflexive", "Irreflexive", "Symmetric", "Asymmetric", "Transitive")
}
ORDER = ("Annotations", "Types", "Facts", "Characteristics", "SubClassOf", "EquivalentTo", "DisjointWith",
         "DisjointUnionOf", "HasKey", "SubPropertyOf", "SubPropertyChain", "InverseOf", "Domain", "Range", "SameAs",
         "DifferentFrom")  # fmt: skip
"""Sections in the order of a frame."""

SINGLE = ("DisjointUnionOf", "HasKey", "SubPropertyChain")
"""Sections with a single item each; EquivalentTo of a Datatype is another."""

SEVERAL = {
    "AllDisjointClasses": "DisjointClasses",
    "AllDisjointProperties": "DisjointProperties",
    "AllDifferent": "DifferentIndividuals",
}
PAIRS = {
    OWL.sameAs: "SameIndividual",
    OWL.differentFrom: "DifferentIndividuals",
    OWL.equivalentClass: "EquivalentClasses",
    OWL.disjointWith: "DisjointClasses",
    OWL.equivalentProperty: "EquivalentProperties",
    OWL.propertyDisjointWith: "DisjointProperties",
}
ANNOTATING = frozenset(
    (*(RDFS + name for name in ("label", "comment", "seeAlso", "isDefinedBy")),
     *(OWL + name for name in ("versionInfo", "deprecated", "priorVersion", "backwardCompatibleWith",
                               "incompatibleWith")))
)  # fmt: skip


@dataclass(slots=True)
class Frame:
    """Frame: its headings, and the items of its sections.

    An annotated item is written in a section of its own: the W3C Note allows it among others, but some readers do not.
    """

    word: str
    heads: list[str]
    sections: dict[str, list[str]] = field(default_factory=dict)

    def text(self, *, order: Sorting) -> str:
        lines = [f"{self.word}: {head}" for head in self.heads]
        for name in ORDER:
            items = self.sections.get(name, [])
            items = items if order is Sorting.FILE else sorted(items, key=lambda item: (" " in item, item))
            if items:
                single = name in SINGLE or (self.word, name) == ("Datatype", "EquivalentTo")
                alone = [item for item in items if single or item.startswith("Annotations: ")]
                together = [item for item in items if item not in alone]
                lines += [section(name, group) for group in (together, *([item] for item in alone)) if group]
        return "\n".join(lines) + "\n"


def section(name: str, items: list[str]) -> str:
    """Write a section on one line if it fits or has one item, else with a line for each item."""
    line = f"    {name}: {', '.join(items)}"
    if not items[1:] or (len(line) <= WIDTH and "\n" not in line):
        return line
    return f"    {name}:\n        " + ",\n        ".join(items)
