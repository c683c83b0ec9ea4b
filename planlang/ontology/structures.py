"""Axioms, expressions and entities as functional syntax and OWL/XML write them: a word with its parts.

Both syntaxes have the same words, such as ``SubClassOf`` and ``ObjectSomeValuesFrom``. A reader calls
:meth:`Structures.close` for each element, the innermost first; tables say what the parts of each word must be, and
which triples state it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import Any, NamedTuple

from planlang.diagnostics import BadInput, Diagnostic, Span, error, warning
from planlang.ontology.axioms import Annotation, Axioms, bounded
from planlang.ontology.expressions import Expression
from planlang.ontology.terms import OWL, PREFIXES, RDF, RDFS, XSD, BNode, Literal, resolve
from planlang.ontology.triples import counted
from planlang.records import dataclass
from planlang.spelling import guess

MOST_ERRORS = 20
"""Errors reported of one file."""
MOST_WARNINGS = 100
"""Warnings about one file that are shown; further ones are counted."""

ENTITIES = {
    "Class": OWL.Class,
    "Datatype": RDFS.Datatype,
    "ObjectProperty": OWL.ObjectProperty,
    "DataProperty": OWL.DatatypeProperty,
    "AnnotationProperty": OWL.AnnotationProperty,
    "NamedIndividual": OWL.NamedIndividual,
}


class Entity(NamedTuple):
    """Entity with the kind that a file states of it."""

    kind: str
    name: Expression


class Group(NamedTuple):
    """Parts that count as parts of the element around them: keys, facets."""

    parts: tuple[Any, ...]


class Axiom(NamedTuple):
    """Axiom, or another statement of the document, whose triples are stated."""

    word: str
    span: Span


class _Kind(NamedTuple):
    """Kind of a part: its words in messages, and a check."""

    text: str
    fits: Callable[[Expression], bool]


_JUNCTIONS = frozenset(("and", "or", "not", "one of"))
_PROPERTIES = frozenset(("name", "inverse"))
_KINDS = {
    "class": _Kind("a class", lambda one: _is_class(one)),
    "range": _Kind("a datatype", lambda one: _is_name(one) or one.is_range),
    "property": _Kind("a property", lambda one: one.kind in _PROPERTIES and _is_no_value(one)),
    "chain": _Kind("a property or a chain", lambda one: one.kind in (*_PROPERTIES, "chain") and _is_no_value(one)),
    "name": _Kind("a name", lambda one: _is_name(one)),
    "individual": _Kind("an individual", lambda one: one.kind == "name" and isinstance(one.term, (str, BNode))),
    "literal": _Kind('a "text"', lambda one: isinstance(one.term, Literal)),
    "value": _Kind("a name or a value", lambda one: one.kind == "name"),
    "number": _Kind("a whole number", lambda one: _is_number(one)),
}  # fmt: skip


def _is_name(one: Expression) -> bool:
    return one.kind == "name" and isinstance(one.term, str)


def _is_no_value(one: Expression) -> bool:
    return not isinstance(one.term, (Literal, BNode))


def _is_class(one: Expression) -> bool:
    if one.kind in _JUNCTIONS:
        return not one.data
    return one.kind not in ("inverse", "facets", "chain") and _is_no_value(one)


def _is_number(one: Expression) -> bool:
    return isinstance(one.term, Literal) and one.term.value.isdecimal() and len(one.term.value) < 10


class _Form(NamedTuple):
    """What a word of an expression means: the kind of its expression, and its parts."""

    kind: str
    parts: str
    data: bool = False


EXPRESSIONS = {
    "ObjectIntersectionOf": _Form("and", "class+"),
    "ObjectUnionOf": _Form("or", "class+"),
    "ObjectComplementOf": _Form("not", "class"),
    "ObjectOneOf": _Form("one of", "individual+"),
    "ObjectSomeValuesFrom": _Form("some", "property class"),
    "ObjectAllValuesFrom": _Form("only", "property class"),
    "ObjectHasValue": _Form("value", "property individual"),
    "ObjectHasSelf": _Form("Self", "property"),
    "ObjectMinCardinality": _Form("min", "number property class?"),
    "ObjectMaxCardinality": _Form("max", "number property class?"),
    "ObjectExactCardinality": _Form("exactly", "number property class?"),
    "DataSomeValuesFrom": _Form("some", "name+ range", data=True),
    "DataAllValuesFrom": _Form("only", "name+ range", data=True),
    "DataHasValue": _Form("value", "name literal", data=True),
    "DataMinCardinality": _Form("min", "number name range?", data=True),
    "DataMaxCardinality": _Form("max", "number name range?", data=True),
    "DataExactCardinality": _Form("exactly", "number name range?", data=True),
    "DataIntersectionOf": _Form("and", "range+", data=True),
    "DataUnionOf": _Form("or", "range+", data=True),
    "DataComplementOf": _Form("not", "range", data=True),
    "DataOneOf": _Form("one of", "literal+", data=True),
    "DatatypeRestriction": _Form("facets", "name value+", data=True),
    "ObjectInverseOf": _Form("inverse", "name"),
    "ObjectPropertyChain": _Form("chain", "property+"),
}
"""Word -> what it means, with the kinds of its parts; ``+``: one or more of a kind, ``?``: none or one."""

_State = Callable[[Axioms, list[Expression], Sequence[Annotation]], None]


def _pair(predicate: str, *, data: bool = False) -> _State:
    return lambda out, parts, notes: out.relate(parts[0], predicate, parts[1], notes, data=data)


def _all(predicate: str, kind: str | None = None) -> _State:
    return lambda out, parts, notes: out.relate_all(parts, predicate, kind, notes)


def _listed(predicate: str) -> _State:
    return lambda out, parts, notes: out.relate_to_list(parts[0], predicate, parts[1:], notes)


def _typed(kind: str) -> _State:
    def state(out: Axioms, parts: list[Expression], notes: Sequence[Annotation]) -> None:
        out.relate(parts[0], RDF.type, Expression("name", parts[0].span, kind), notes)

    return state


def _fact(out: Axioms, parts: list[Expression], notes: Sequence[Annotation]) -> None:
    prop, subject, value = parts
    if prop.kind == "inverse":
        prop, subject, value = prop.parts[0], value, subject
    assert isinstance(prop.term, str)
    out.relate(subject, prop.term, value, notes)


def _denied(out: Axioms, parts: list[Expression], notes: Sequence[Annotation]) -> None:
    prop, subject, value = parts
    out.deny(out.subject_of(subject), prop, value, notes)


def _sub_property(out: Axioms, parts: list[Expression], notes: Sequence[Annotation]) -> None:
    lower, upper = parts
    if lower.kind == "chain":
        out.relate_to_list(upper, OWL.propertyChainAxiom, lower.parts, notes)
    else:
        out.relate(lower, RDFS.subPropertyOf, upper, notes)


class _Rule(NamedTuple):
    parts: str
    state: _State


AXIOMS = {
    "SubClassOf": _Rule("class class", _pair(RDFS.subClassOf)),
    "EquivalentClasses": _Rule("class class+", _all(OWL.equivalentClass)),
    "DisjointClasses": _Rule("class class+", _all(OWL.disjointWith, OWL.AllDisjointClasses)),
    "DisjointUnion": _Rule("name class+", _listed(OWL.disjointUnionOf)),
    "SubObjectPropertyOf": _Rule("chain property", _sub_property),
    "EquivalentObjectProperties": _Rule("property property+", _all(OWL.equivalentProperty)),
    "DisjointObjectProperties": _Rule(
        "property property+", _all(OWL.propertyDisjointWith, OWL.AllDisjointProperties)
    ),
    "InverseObjectProperties": _Rule("property property", _pair(OWL.inverseOf)),
    "ObjectPropertyDomain": _Rule("property class", _pair(RDFS.domain)),
    "ObjectPropertyRange": _Rule("property class", _pair(RDFS.range)),
    **{
        f"{name}ObjectProperty": _Rule("property", _typed(f"{OWL}{name}Property"))
        for name in ("Functional", "InverseFunctional", "Reflexive", "Irreflexive", "Symmetric", "Asymmetric",
                     "Transitive")
    },
    "SubDataPropertyOf": _Rule("name name", _pair(RDFS.subPropertyOf)),
    "EquivalentDataProperties": _Rule("name name+", _all(OWL.equivalentProperty)),
    "DisjointDataProperties": _Rule("name name+", _all(OWL.propertyDisjointWith, OWL.AllDisjointProperties)),
    "DataPropertyDomain": _Rule("name class", _pair(RDFS.domain)),
    "DataPropertyRange": _Rule("name range", _pair(RDFS.range, data=True)),
    "FunctionalDataProperty": _Rule("name", _typed(OWL.FunctionalProperty)),
    "DatatypeDefinition": _Rule("name range", _pair(OWL.equivalentClass, data=True)),
    "HasKey": _Rule("class property+", _listed(OWL.hasKey)),
    "SameIndividual": _Rule("individual individual+", _all(OWL.sameAs)),
    "DifferentIndividuals": _Rule("individual individual+", _all(OWL.differentFrom, OWL.AllDifferent)),
    "ClassAssertion": _Rule("class individual", lambda out, parts, notes: _pair(RDF.type)(out, parts[::-1], notes)),
    "ObjectPropertyAssertion": _Rule("property individual individual", _fact),
    "NegativeObjectPropertyAssertion": _Rule("property individual individual", _denied),
    "DataPropertyAssertion": _Rule("name individual literal", _fact),
    "NegativeDataPropertyAssertion": _Rule("name individual literal", _denied),
    "AnnotationAssertion": _Rule("name individual value", _fact),
    "SubAnnotationPropertyOf": _Rule("name name", _pair(RDFS.subPropertyOf)),
    "AnnotationPropertyDomain": _Rule("name name", _pair(RDFS.domain)),
    "AnnotationPropertyRange": _Rule("name name", _pair(RDFS.range)),
}  # fmt: skip
"""Word of an axiom -> the kinds of its parts, and what states it."""

RULES = frozenset(("DLSafeRule", "DGRule", "DGAxiom"))
_IN_RULES = frozenset(
    ("Body", "Head", "Variable", "ClassAtom", "DataRangeAtom", "ObjectPropertyAtom", "DataPropertyAtom", "BuiltInAtom",
     "SameIndividualAtom", "DifferentIndividualsAtom", "SameAsAtom", "DifferentFromAtom", "DGNodes", "NodeAssertion",
     "DGEdges", "EdgeAssertion",
     "MainClasses", "Nodes", "Edges")
)  # fmt: skip
DOCUMENT = frozenset(("Declaration", "Import", *AXIOMS, *RULES))
"""Words that may be directly inside an ontology, besides Annotation."""
_WORDS = (*DOCUMENT, *EXPRESSIONS, *ENTITIES, "Annotation", "FacetRestriction", *_IN_RULES)

BROKEN = Expression("broken", Span(""))
"""Stands for a part with a reported error; what contains it is not stated."""


@dataclass
class Names:
    """Prefixes and base of a file. ``declared`` is how a prefix is declared, with {} for its name."""

    base: str
    declared: str
    prefixes: dict[str, str]

    @staticmethod
    def of(base: str, declared: str) -> Names:
        """Names of a file that declares no prefix yet; OWL 2 declares four itself."""
        return Names(base, declared, {"rdf": RDF, "rdfs": RDFS, "owl": OWL, "xsd": XSD})

    def full(self, iri: str) -> str:
        """Resolve a full or relative IRI."""
        return resolve(self.base, iri)


class Structures:
    """States the axioms of one file; keeps its errors in ``problems``, and what it ignores in ``warnings``.

    ``shown`` writes a word with its parts for advice, as the syntax of the file does.
    """

    def __init__(self, file: str, label: str, names: Names, shown: Callable[[str, Sequence[str]], str]) -> None:
        self.out = Axioms(file, label, frozenset(), frozenset())
        self.names = names
        self.problems: list[Diagnostic] = []
        self._warnings: list[Diagnostic] = []
        self._not_shown = 0
        self._shown = shown
        self._unknown: set[str] = set()
        self._ontology: str | BNode = self.out.named_node("ontology")

    @property
    def warnings(self) -> list[Diagnostic]:
        """Warnings, with the number of those beyond the limit."""
        return counted(self._warnings, self._not_shown)

    def warn_once(self, code: str, message: str, span: Span, advice: str) -> None:
        """Keep a warning unless there is one with this code."""
        if all(one.code != code for one in self._warnings):
            self._warnings.append(warning(code, message, span, advice))

    # the document

    def begin(self, iri: str | None, version: str | None, span: Span) -> None:
        """State that there is an ontology; what it imports and its annotations are stated of it."""
        self._ontology = iri if iri is not None else self._ontology
        self.out.state(self._ontology, RDF.type, OWL.Ontology, span)
        if version is not None:
            self.out.state(self._ontology, OWL.versionIRI, version, span)

    def add(self, part: object, span: Span) -> None:
        """Take a part of the ontology: an axiom, which is stated already, or an annotation."""
        if isinstance(part, Annotation):
            self.out.annotate(self._ontology, [part])
        elif not isinstance(part, Axiom) and part is not BROKEN:
            advice = "an ontology contains axioms such as SubClassOf and ClassAssertion, declarations and annotations"
            self.fail("this is no axiom; it belongs inside of one", span, advice)

    def fail(self, message: str, span: Span, advice: str | None = None) -> Expression:
        """Report an error; the result stands for the part that has it."""
        return self.report(error("O020", message, span, advice))

    def report(self, *found: Diagnostic) -> Expression:
        """Keep errors. Raises BadInput if there are too many."""
        self.problems += found
        if len(self.problems) >= MOST_ERRORS:
            raise BadInput(self.problems)
        return BROKEN

    # elements

    def name(self, text: str, span: Span) -> Expression:
        """Expand ``prefix:name``; an unknown prefix is reported once."""
        prefix, _, local = text.partition(":")
        namespace = self.names.prefixes.get(prefix)
        if namespace is not None:
            return Expression("name", span, namespace + local)
        if prefix in self._unknown:
            return BROKEN
        self._unknown.add(prefix)
        known = PREFIXES.get(prefix, "http://...#")
        advice = f"{guess(prefix, self.names.prefixes)}declare it: {self.names.declared.format(prefix, known)}"
        return self.report(error("O021", f"unknown prefix {prefix}: in {text[:80]}", span, advice))

    def close(self, word: str, parts: Sequence[Any], span: Span) -> Any:
        """Make what an element is, whose parts are made: an expression, an annotation, an entity, a group or an axiom.

        Raises BadInput if the element is nested too deep, or if there is no room for its triples.
        """
        items: list[Any] = []
        for part in parts:
            items += part.parts if isinstance(part, Group) else (part,)
        form = EXPRESSIONS.get(word)
        if form is not None:
            return self._expression(word, form, items, span)
        rule = AXIOMS.get(word)
        if rule is not None:
            return self._axiom(word, rule, items, span)
        return self._other(word, items, span)

    def _other(self, word: str, items: list[Any], span: Span) -> Any:
        if word in ENTITIES:
            parts = self._parts(word, "name", items, span)
            return BROKEN if parts is None else Entity(ENTITIES[word], parts[0])
        if word in ("", "FacetRestriction"):
            return Group(tuple(items))
        if word == "Annotation":
            notes, rest = _without_notes(items)
            parts = self._parts(word, "name value", rest, span)
            if parts is None:
                return BROKEN
            prop, value = parts
            assert isinstance(prop.term, str)
            assert value.term is not None
            return Annotation(prop.term, value.term, span, tuple(notes), bounded(notes, span))
        if word == "Declaration":
            return self._declaration(items, span)
        if word == "Import":
            parts = self._parts(word, "name", items, span)
            if parts is not None and parts[0].term is not None:
                self.out.state(self._ontology, OWL.imports, parts[0].term, parts[0].span)
            return Axiom(word, span)
        if word in _IN_RULES:
            return Group(())
        if word in RULES:
            if len(self._warnings) < MOST_WARNINGS:
                advice = "express it by classes and property chains, or remove it"
                self._warnings.append(
                    warning("O023", f"rules ({word}) are not supported; this one is ignored", span, advice)
                )
            else:
                self._not_shown += 1
            return Axiom(word, span)
        return self.fail(f"unknown word {word[:80]}", span, guess(word, _WORDS) + "names of OWL 2 are case-sensitive")

    def _declaration(self, items: list[Any], span: Span) -> Any:
        notes, rest = _without_notes(items)
        if BROKEN in rest:
            return BROKEN
        if len(rest) != 1 or not isinstance(rest[0], Entity):
            advice = self._shown("Declaration", [self._shown("Class", ["a name"])])
            return self.fail(
                f"a declaration states one of {', '.join(ENTITIES)} with its name", span, f"write {advice}"
            )
        kind, name = rest[0]
        assert isinstance(name.term, str)
        self.out.state(name.term, RDF.type, kind, name.span)
        self.out.reify(name.term, RDF.type, kind, name.span, notes)
        return Axiom("Declaration", span)

    def _axiom(self, word: str, rule: _Rule, items: list[Any], span: Span) -> Any:
        notes, rest = _without_notes(items)
        first, *_, last = rule.parts.split() * 2
        if len(rest) == 1 and last == f"{first}+" and isinstance(rest[0], Expression | Entity):
            message = f"{word} with one part states nothing and is ignored"  # as old versions of the OWL API write
            self.warn_once("O010", message, span, "remove it, or add what it is about")
            return Axiom(word, span)
        parts = self._parts(word, rule.parts, rest, span)
        if parts is None:
            return BROKEN
        rule.state(self.out, parts, notes)
        return Axiom(word, span)

    def _expression(self, word: str, form: _Form, items: list[Any], span: Span) -> Expression:
        parts = self._parts(word, form.parts, items, span)
        if parts is None:
            return BROKEN
        kind, number = form.kind, 0
        if form.parts.startswith("number"):
            count = parts.pop(0).term
            assert isinstance(count, Literal)
            number = int(count.value)
        facets: list[tuple[str, Literal]] = []
        if kind == "facets":
            for facet, value in zip(parts[1::2], parts[2::2], strict=False):
                if not isinstance(facet.term, str) or not isinstance(value.term, Literal):
                    break
                facets.append((facet.term, value.term))
            if len(parts) != 1 + 2 * len(facets):
                advice = "write facets such as xsd:minInclusive, each with its value"
                return self.fail("a restriction of a datatype has a facet without value", span, advice)
            del parts[1:]
        return Expression(
            kind, span, parts=tuple(parts), number=number, facets=tuple(facets), depth=bounded(parts, span),
            data=form.data,
        )  # fmt: skip

    def _parts(self, word: str, wanted: str, items: list[Any], span: Span) -> list[Expression] | None:
        """Check the parts of an element; None if they have errors, which are reported."""
        parts: list[Expression] = []
        for item in items:
            if isinstance(item, Entity):
                item = item.name
            if isinstance(item, Axiom):
                advice = f"end {word} before it" if word in AXIOMS or word in EXPRESSIONS else None
                self.fail(f"{item.word} is inside of {word}, which is not closed", item.span, advice)
                return None
            if isinstance(item, Annotation):
                self.fail(f"an annotation inside of {word}", item.span, "annotate the axiom around it")
                return None
            if item is BROKEN:
                return None
            parts.append(item)
        expected = fitted(wanted, len(parts))
        if expected is None:
            shown = self._shown(word, list(map(_shown_kind, wanted.split())))
            self.fail(f"{word} has {len(parts)} part{'s' * (len(parts) != 1)}", span, f"write {shown}")
            return None
        for place, (part, kind) in enumerate(zip(parts, expected, strict=True), start=1):
            if not _KINDS[kind].fits(part):
                shown = self._shown(word, list(map(_shown_kind, wanted.split())))
                message = f"part {place} of {word} has to be {_KINDS[kind].text}"
                self.fail(message, part.span, f"write {shown}")
                return None
        return parts


def fits(word: str, parts: Sequence[Expression], place: int | None = None) -> bool:
    """Check whether an axiom or expression takes these parts, without its number; with ``place`` one part there."""
    wanted = (EXPRESSIONS.get(word) or AXIOMS[word]).parts.removeprefix("number ")
    if place is not None:
        return _KINDS[wanted.split()[place].rstrip("+?")].fits(parts[0])
    expected = fitted(wanted, len(parts))
    return expected is not None and all(_KINDS[kind].fits(part) for kind, part in zip(expected, parts, strict=True))


def _without_notes(items: Sequence[Any]) -> tuple[list[Annotation], list[Any]]:
    """Separate the leading annotations from the other parts."""
    count = next((place for place, item in enumerate(items) if not isinstance(item, Annotation)), len(items))
    return list(items[:count]), list(items[count:])


@lru_cache(1000)
def fitted(wanted: str, count: int) -> list[str] | None:
    """Repeat the kinds of parts as often as there are parts; None if there are too few or too many."""
    kinds = wanted.split()
    least = sum(not kind.endswith("?") for kind in kinds)
    more = count - least
    is_open = any(kind.endswith("+") for kind in kinds)
    if more < 0 or (more > 0 and not is_open and more > len(kinds) - least):
        return None
    fitted: list[str] = []
    for kind in kinds:
        if kind.endswith("+"):
            fitted += [kind[:-1]] * (1 + more)
        elif kind.endswith("?"):
            fitted += [kind[:-1]] * more
        else:
            fitted.append(kind)
    return fitted


def _shown_kind(kind: str) -> str:
    text = _KINDS[kind.rstrip("+?")].text
    return f"{text}, ..." if kind.endswith("+") else f"{text} or nothing" if kind.endswith("?") else text
