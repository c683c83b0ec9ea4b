"""What OWL builds of several triples and a file builds wrongly: restrictions, lists, values."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence

from planlang.designators import local_name
from planlang.diagnostics import Diagnostic, warning
from planlang.ontology.parsed import counted
from planlang.ontology.terms import FIRST, NIL, ON_PROPERTY, OWL, RDF, REST, XSD, BNode, Literal, Term, Triple

MOST_WARNINGS = 100
"""Of each kind about one file; how many more there are is told with the last."""

_FILLERS = frozenset(OWL + name for name in ("someValuesFrom", "allValuesFrom", "hasValue", "hasSelf"))
_NUMBERS = frozenset(
    f"{OWL}{name}ardinality" for name in ("minC", "maxC", "c", "minQualifiedC", "maxQualifiedC", "qualifiedC")
)
_INTEGER = re.compile(r"[+-]?[0-9]+")
_NATURAL = re.compile(r"\+?[0-9]+|-0+")
_DOUBLE = re.compile(r"[+-]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]+)?|[+-]?INF|NaN")
_FORMS = {
    **{XSD + name: _INTEGER for name in ("integer", "int", "long", "short", "byte")},
    **{XSD + name: _NATURAL for name in ("nonNegativeInteger", "unsignedInt", "unsignedLong", "unsignedShort")},
    XSD + "positiveInteger": re.compile(r"\+?0*[1-9][0-9]*"),
    XSD + "decimal": re.compile(r"[+-]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)"),
    XSD + "double": _DOUBLE,
    XSD + "float": _DOUBLE,
    XSD + "boolean": re.compile("true|false|0|1"),
}
"""Datatype -> what its values look like, after blanks at the ends are taken away."""


def malformed(triples: Sequence[Triple]) -> list[Diagnostic]:
    """Warnings about restrictions that say nothing, lists that do not end, and values that their datatype lacks."""
    said: dict[str | BNode, list[Triple]] = {}
    for triple in triples:
        if triple.predicate in (ON_PROPERTY, FIRST, REST) or triple.predicate in _FILLERS | _NUMBERS:
            said.setdefault(triple.subject, []).append(triple)
    kinds = (_restrictions(said), _lists(said), _values(triples))
    return [found for kind in kinds for found in _bounded(kind)]


def _bounded(found: Iterable[Diagnostic]) -> list[Diagnostic]:
    every = list(found)
    return counted(every[:MOST_WARNINGS], len(every) - MOST_WARNINGS)


def _restrictions(said: dict[str | BNode, list[Triple]]) -> Iterator[Diagnostic]:
    for triples in said.values():
        properties = [t for t in triples if t.predicate == ON_PROPERTY]
        fillers = [t for t in triples if t.predicate in _FILLERS | _NUMBERS]
        if not properties and fillers and isinstance(fillers[0].subject, BNode):
            what = f"a restriction with {local_name(fillers[0].predicate)} names no property and is left out"
            yield warning("O017", what, fillers[0].span, "add owl:onProperty")
        for prop in properties[:1]:
            name = _shown(prop.object)
            if isinstance(prop.object, Literal):
                yield warning("O017", f"a restriction of the value {name} is left out", prop.span, "name a property")
            elif len(properties) > 1:
                others = " and ".join(_shown(other.object) for other in properties)
                yield warning("O017", f"one restriction names several properties: {others}", properties[1].span)
            elif not fillers:
                advice = "add owl:someValuesFrom or owl:hasValue"
                yield warning("O017", f"a restriction of {name} has no filler and is left out", prop.span, advice)
            elif len(fillers) > 1:
                what = f"one restriction of {name} has {len(fillers)} fillers, which are read as one restriction each"
                yield warning("O017", what, fillers[1].span, "write an owl:Restriction for each")
        for filler in fillers:
            if filler.predicate in _NUMBERS and not _is_number(filler.object):
                what = f"{local_name(filler.predicate)} is no whole number: {_shown(filler.object)}"
                yield warning("O017", what, filler.span, "the restriction is left out")


def _is_number(term: Term) -> bool:
    return isinstance(term, Literal) and term.value.strip().isdecimal() and len(term.value) < 10


def _lists(said: dict[str | BNode, list[Triple]]) -> Iterator[Diagnostic]:
    cells = {
        subject: triples for subject, triples in said.items() if any(t.predicate in (FIRST, REST) for t in triples)
    }
    for triples in cells.values():
        firsts = [t for t in triples if t.predicate == FIRST]
        rests = [t for t in triples if t.predicate == REST]
        at = triples[0].span
        if len(firsts) > 1:
            yield warning("O018", "one cell of a list has several items", firsts[1].span, "write a cell for each")
        elif not firsts:
            yield warning("O018", "one cell of a list has no item", at, "add rdf:first, or leave the cell out")
        if len(rests) > 1:
            yield warning("O018", "a list goes on in several ways; one of them is taken", rests[1].span)
        elif not rests:
            yield warning("O018", "a list does not end; it is taken to end here", at, "add rdf:rest rdf:nil")
        elif rests[0].object != NIL and rests[0].object not in cells:
            what = f"a list goes on with {_shown(rests[0].object)}, which is no list; it is taken to end here"
            yield warning("O018", what, rests[0].span, "add rdf:rest rdf:nil")
    yield from _circles(cells)


def _circles(cells: dict[str | BNode, list[Triple]]) -> Iterator[Diagnostic]:
    """A warning for each list that comes back to a cell of its own."""
    following = {subject: next((t for t in triples if t.predicate == REST), None) for subject, triples in cells.items()}
    done: set[Term] = set()
    for begin in cells:
        way: dict[Term, None] = {}
        cell: Term = begin
        while isinstance(cell, (str, BNode)) and cell in following and cell not in done:
            way[cell] = None
            rest = following[cell]
            if rest is None:
                break
            if rest.object in way:
                yield warning("O018", "a list comes back to itself; it is taken to end here", rest.span)
                break
            cell = rest.object
        done |= set(way)


def _values(triples: Sequence[Triple]) -> Iterator[Diagnostic]:
    for triple in triples:
        value = triple.object
        form = _FORMS.get(value.datatype or "") if isinstance(value, Literal) else None
        if form is not None and isinstance(value, Literal) and not form.fullmatch(value.value.strip()):
            what = f"{local_name(triple.predicate)} is no {local_name(value.datatype or '')}: {value.value[:40]!r}"
            yield warning("O019", what, triple.span, "correct the value, or its datatype")


def _shown(term: Term) -> str:
    if isinstance(term, BNode):
        return "a nameless thing"
    name = local_name(term) if isinstance(term, str) else term.value
    return (name if not isinstance(term, str) or not term.startswith(RDF) else f"rdf:{name}")[:60]
