"""Repair on reading, and checks of what is wrong then.

Names of old namespaces, terms in the wrong namespace and restrictions without their type are repaired. Reported is what
a file builds wrongly of several triples (restrictions, lists, values), and what is wrong in the ontology as a whole.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from difflib import get_close_matches
from functools import lru_cache
from pathlib import Path
from typing import Protocol

from planlang.designators import local_name
from planlang.diagnostics import Diagnostic, error, note, warning
from planlang.files import bundled
from planlang.ontology.classes import namesakes
from planlang.ontology.terms import KNOWROB, OWL, RDF, RDFS, XSD, BNode, Literal, Term, Triple
from planlang.ontology.triples import Triples, counted
from planlang.spelling import similar

OLD_HOST = "http://ias.cs.tum.edu/kb/"
HOST = "http://knowrob.org/kb/"

MOVED = (
    "knowrob",
    "srdl2",
    "srdl2-cap",
    "srdl2-comp",
    "srdl2-action",
    "srdl2-dl",
    "computable",
    "comp_temporal",
    "comp_spatial",
    "comp_cop",
    "comp_semantic_map",
    "knowrob_objects",
    "knowrob_units",
)
"""Vocabularies that moved from the old host to the new one. Recipes, maps and robots are never renamed."""

_RENAMED: dict[str, str] = {f"{OLD_HOST}{name}.owl": f"{HOST}{name}.owl" for name in MOVED}
"""Address of a document -> its address here."""


def canonical(iri: str) -> str:
    """Return the current name of a term or document."""
    if not iri.startswith(OLD_HOST):
        return iri
    document, hash_sign, name = iri.partition("#")
    return f"{_RENAMED.get(document, document)}{hash_sign}{name}"


def use_canonical_names(triples: Triples) -> Iterator[Diagnostic]:
    """Give the terms their canonical names; a note for each vocabulary that is renamed, where it is used first."""
    old = {number: term for term, number in triples.numbers.items() if isinstance(term, str) and _is_old(term)}
    if not old:
        return
    notes = list(_notes(triples, old))
    triples.rename({term: canonical(term) for term in old.values()})
    yield from notes


def _is_old(term: str) -> bool:
    return term.startswith(OLD_HOST) and canonical(term) != term


def _notes(triples: Triples, old: dict[int, str]) -> Iterator[Diagnostic]:
    documents = {number: term.partition("#")[0] for number, term in old.items()}
    left = {document for document in documents.values() if canonical(document) != document}
    for row, terms in enumerate(zip(triples.subjects, triples.predicates, triples.objects, strict=True)):
        for number in terms:
            if number in documents and (document := documents[number]) in left:
                left.remove(document)
                message = f"names of {document} are read as those of {canonical(document)}"
                yield note("O015", message, triples.span(row))
        if not left:
            return


TERMS: dict[str, frozenset[str]] = {space: space.terms for space in (RDFS, OWL, RDF)}
"""Namespace -> local names of its terms; a term is looked for in this order."""

_W3C_TERMS = tuple(TERMS)

MISSPELT = 0.8
"""The similarity (of difflib) at which something is read as a term: ``abuot`` is similar enough to ``about``."""

_ATTRIBUTES = frozenset(("about", "resource", "ID", "nodeID", "datatype", "parseType"))
"""Names of RDF that RDF/XML has as attributes only."""

MOST_WARNINGS = 100
"""Warnings of one kind about one file; further terms are repaired silently, further mistakes are counted."""

_SPELT = {OWL + "DataProperty": OWL.DatatypeProperty, OWL + "Individual": OWL.NamedIndividual}
_PREFIX: dict[str, str] = {RDFS: "rdfs", OWL: "owl", RDF: "rdf"}


def repair(triples: Triples) -> list[Diagnostic]:
    """Put the terms that were meant in the place of those that are written. Returns what was changed.

    ``owl:subClassOf`` becomes ``rdfs:subClassOf`` and the like; a nameless node with owl:onProperty becomes a
    restriction.
    """
    meant = _Meanings()
    wrong = {
        number
        for term, number in triples.numbers.items()
        if isinstance(term, str) and term.startswith(_W3C_TERMS) and _correction(term)
    }
    if wrong:
        _correct(triples, wrong, meant)
    return [*meant.diagnostics, *_add_restrictions(triples)]


def _correct(triples: Triples, wrong: set[int], meant: _Meanings) -> None:
    """Correct predicates, and what things are said to be."""
    types = {
        number for number in dict.fromkeys(triples.predicates) if meant_term(triples.name(number) or "") == RDF.type
    }
    for row, (predicate, value) in enumerate(zip(triples.predicates, triples.objects, strict=True)):
        if predicate in wrong:
            triples.predicates[row] = meant.number(triples, predicate, row)
        if predicate in types and value in wrong:
            triples.objects[row] = meant.number(triples, value, row)


class _Meanings:
    """Looks up what terms mean, and reports those that are not what they say."""

    def __init__(self) -> None:
        self.diagnostics: list[Diagnostic] = []
        self._known: dict[int, tuple[str, str, str | None]] = {}

    def number(self, triples: Triples, wrong: int, row: int) -> int:
        """Return the number of the term that an undefined one stands for; of the term itself if unknown."""
        iri = triples.name(wrong) or ""
        known = self._known.get(wrong)
        if known is None:
            known = self._known[wrong] = _correction(iri) or (iri, "", None)
            if _is_misspelt(iri):
                self.diagnostics.append(error("O013", known[1], triples.span(row), known[2]))
        read, message, advice = known
        if len(self.diagnostics) < MOST_WARNINGS and not _is_misspelt(iri):
            found = warning("O013" if read == iri else "O012", message, triples.span(row), advice)
            self.diagnostics.append(found)
        return triples.number(read)


def meant_term(iri: str) -> str:
    """Return the term of RDF, RDFS or OWL that an IRI means: itself, or the same name in the namespace that has it."""
    correction = _correction(iri)
    return iri if correction is None else correction[0]


def _correction(iri: str) -> tuple[str, str, str | None] | None:
    """Return what a term is read as, why, and what to write; None if there is nothing to correct."""
    local = local_name(iri)
    namespace = iri.removesuffix(local)
    if namespace not in TERMS or not local or local in TERMS[namespace] or (namespace == RDF and local[0] == "_"):
        return None
    written = f"{_PREFIX[namespace]}:{local}"
    read = next((home + local for home, terms in TERMS.items() if local in terms), _SPELT.get(iri))
    if read is not None:
        name = local_name(read)
        right = f"{_PREFIX[read.removesuffix(name)]}:{name}"
        return read, f"{written} is read as {right}", f"write {right}"
    near = _near(namespace, local, MISSPELT) or _near(namespace, local, 0.6)
    advice = f"did you mean {_PREFIX[namespace]}:{near[0]}?" if near else None
    is_term = bool(near) and near[0] in TERMS[namespace] and _is_misspelt(iri)
    return namespace + near[0] if is_term else iri, f"there is no {written}", advice


def _near(namespace: str, local: str, least: float) -> list[str]:
    terms = TERMS[namespace] | (_ATTRIBUTES if namespace == RDF else frozenset())
    return get_close_matches(local, sorted(terms), n=1, cutoff=least)


@lru_cache(100_000)  # a server meets names without end
def _is_misspelt(iri: str) -> bool:
    """Return True for a name that is nearly a term of RDF, RDFS or OWL, or an attribute of RDF/XML, but is none."""
    local = local_name(iri)
    namespace = iri.removesuffix(local)
    if namespace not in TERMS or iri in _SPELT or any(local in terms for terms in TERMS.values()):
        return False
    return bool(_near(namespace, local, MISSPELT))


def _add_restrictions(triples: Triples) -> list[Diagnostic]:
    """Say owl:Restriction of the nameless nodes that have owl:onProperty."""
    kind, restriction, on_property = map(triples.numbers.get, (RDF.type, OWL.Restriction, OWL.onProperty))
    if on_property is None:
        return []
    rows = [row for row, number in enumerate(triples.predicates) if number == on_property]
    subjects = set(map(triples.subjects.__getitem__, rows))
    if kind is not None and restriction is not None:
        subjects.difference_update(
            subject
            for subject, predicate, value in zip(triples.subjects, triples.predicates, triples.objects, strict=True)
            if value == restriction and predicate == kind
        )
    bare = {triples.subjects[row]: row for row in reversed(rows) if triples.subjects[row] in subjects}
    bare = {subject: row for subject, row in bare.items() if triples.is_node(subject)}
    if not bare:
        return []
    first = min(map(triples.span, bare.values()))
    what = "a restriction does not say owl:Restriction"
    if len(bare) > 1:
        what = f"{len(bare)} restrictions do not say owl:Restriction"
    triples.repeat(bare.values(), triples.number(RDF.type), triples.number(OWL.Restriction))
    return [note("O014", f"{what}; owl:onProperty is taken for it", first)]


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
    XSD.positiveInteger: re.compile(r"\+?0*[1-9][0-9]*"),
    XSD.decimal: re.compile(r"[+-]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)"),
    XSD.double: _DOUBLE,
    XSD.float: _DOUBLE,
    XSD.boolean: re.compile("true|false|0|1"),
}
"""Datatype -> what its values look like, after blanks at the ends are taken away."""


def malformed(triples: Triples) -> list[Diagnostic]:
    """Return warnings about restrictions that say nothing, lists that do not end, and values not of their datatype."""
    kinds = (_restrictions(triples), _lists(triples), _values(triples))
    return [found for kind in kinds for found in _bounded(kind)]


def _bounded(found: Iterable[Diagnostic]) -> list[Diagnostic]:
    every = list(found)
    return counted(every[:MOST_WARNINGS], len(every) - MOST_WARNINGS)


def _said(triples: Triples, rows: Iterable[int], subjects: set[int]) -> list[list[Triple]]:
    """Return, for each of the subjects, its triples among the rows, in document order."""
    said: dict[int, list[Triple]] = {}
    for row in sorted(rows) if subjects else ():
        if triples.subjects[row] in subjects:
            said.setdefault(triples.subjects[row], []).append(triples.triple(row))
    return list(said.values())


def _not_once(triples: Triples, *columns: Sequence[int]) -> set[int]:
    """Return the subjects that do not occur in each of these columns exactly once."""
    found: set[int] = set()
    sets = [_column(triples.subjects, rows) for rows in columns]
    for rows, unique in zip(columns, sets, strict=True):
        if len(rows) > len(unique):
            numbers = Counter(map(triples.subjects.__getitem__, rows))
            found.update(subject for subject, number in numbers.items() if number > 1)
    if any(one != sets[0] for one in sets):
        found |= sets[0].union(*sets) - sets[0].intersection(*sets)
    return found


def _column(column: Sequence[int], rows: Iterable[int]) -> set[int]:
    """Return the numbers in some rows of a column."""
    return set(map(column.__getitem__, rows))


def _restrictions(triples: Triples) -> Iterator[Diagnostic]:
    properties, fillers, numbers = triples.by(OWL.onProperty), triples.by(*_FILLERS, *_NUMBERS), triples.by(*_NUMBERS)
    odd = _not_once(triples, properties, fillers)
    values = {number for number in _column(triples.objects, properties) if isinstance(triples.terms[number], Literal)}
    if values:
        odd.update(triples.subjects[row] for row in properties if triples.objects[row] in values)
    odd.update(triples.subjects[row] for row in numbers if not _is_number(triples.term(triples.objects[row])))
    for said in _said(triples, (*properties, *fillers), odd):
        yield from _restriction(said)


def _restriction(triples: list[Triple]) -> Iterator[Diagnostic]:
    properties = [t for t in triples if t.predicate == OWL.onProperty]
    fillers = [t for t in triples if t.predicate != OWL.onProperty]
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


def _lists(triples: Triples) -> Iterator[Diagnostic]:
    firsts, rests = triples.by(RDF.first), triples.by(RDF.rest)
    known = {triples.numbers.get(RDF.nil, -1), *_column(triples.subjects, firsts)}
    known.update(map(triples.subjects.__getitem__, rests))
    odd = _not_once(triples, firsts, rests)
    if not known.issuperset(map(triples.objects.__getitem__, rests)):
        odd.update(triples.subjects[row] for row in rests if triples.objects[row] not in known)
    for said in _said(triples, (*firsts, *rests), odd):
        yield from _list(said, lambda term: triples.find(term) in known)
    yield from _circles(triples, rests)


def _list(triples: list[Triple], is_list: Callable[[Term], bool]) -> Iterator[Diagnostic]:
    """Judge one cell of a list."""
    firsts = [t for t in triples if t.predicate == RDF.first]
    rests = [t for t in triples if t.predicate == RDF.rest]
    at = triples[0].span
    if len(firsts) > 1:
        yield warning("O018", "one cell of a list has several items", firsts[1].span, "write a cell for each")
    elif not firsts:
        yield warning("O018", "one cell of a list has no item", at, "add rdf:first, or leave the cell out")
    if len(rests) > 1:
        yield warning("O018", "a list goes on in several ways; one of them is taken", rests[1].span)
    elif not rests:
        yield warning("O018", "a list does not end; it is taken to end here", at, "add rdf:rest rdf:nil")
    elif not is_list(rests[0].object):
        what = f"a list goes on with {_shown(rests[0].object)}, which is no list; it is taken to end here"
        yield warning("O018", what, rests[0].span, "add rdf:rest rdf:nil")


def _circles(triples: Triples, rests: Sequence[int]) -> Iterator[Diagnostic]:
    """Yield a warning for each list that comes back to a cell of its own."""
    end = triples.numbers.get(RDF.nil, -1)
    if all(triples.subjects[row] < triples.objects[row] or triples.objects[row] == end for row in rests):
        return  # every list goes on with a cell that was met later
    following = {triples.subjects[row]: row for row in reversed(rests)}
    done: set[int] = set()
    for begin in map(triples.subjects.__getitem__, rests):
        way: dict[int, None] = {}
        cell, row = begin, -1
        while cell in following and cell not in done and cell not in way:
            way[cell] = None
            row = following[cell]
            cell = triples.objects[row]
        if cell in way:
            yield warning("O018", "a list comes back to itself; it is taken to end here", triples.span(row))
        done.update(way)


def _values(triples: Triples) -> Iterator[Diagnostic]:
    wrong = {number for term, number in triples.numbers.items() if isinstance(term, Literal) and is_malformed(term)}
    if wrong:
        for row, number in enumerate(triples.objects):
            if number in wrong:
                triple = triples.triple(row)
                assert isinstance(triple.object, Literal)
                kind = local_name(triple.object.datatype or "")
                what = f"{local_name(triple.predicate)} is no {kind}: {triple.object.value[:40]!r}"
                yield warning("O019", what, triple.span, "correct the value, or its datatype")


def is_malformed(value: Literal) -> bool:
    """Return True for a value that its datatype does not have."""
    form = _FORMS.get(value.datatype or "")
    return form is not None and not form.fullmatch(value.value.strip())


def _shown(term: Term) -> str:
    if isinstance(term, BNode):
        return "a nameless thing"
    name = local_name(term) if isinstance(term, str) else term.value
    return (name if not isinstance(term, str) or not term.startswith(RDF) else f"rdf:{name}")[:60]


MOST_SUGGESTIONS = 20
"""Among these, those for which a similar name is looked for."""

_W3C = (OWL, RDF, RDFS, XSD)


class Declarations(Protocol):
    """The triples of all documents together, and what they declare."""

    store: Triples

    def is_class(self, iri: str) -> bool: ...
    def is_individual(self, iri: str) -> bool: ...
    def defined(self, iri: str) -> bool: ...
    def class_names(self) -> tuple[str, ...]: ...


def check(ontology: Declarations, paths: Iterable[Path]) -> Iterator[Diagnostic]:
    """Yield diagnostics about every document that is not bundled; ``paths`` are those of all documents."""
    ours = (folder := bundled("ontologies"), folder.resolve())
    has_vocabulary = ontology.is_class(KNOWROB + "Action")
    for path, rows in zip(paths, ontology.store.ranges, strict=True):
        if not (path.is_relative_to(ours[0]) or path.resolve().is_relative_to(ours[1])):
            if has_vocabulary:
                yield from _undefined_superclasses(ontology, rows)
            yield from _individuals_as_classes(ontology, rows)
            yield from _classes_as_individuals(ontology, rows)


def _named_objects(triples: Triples, predicate: str, rows: range) -> dict[str, int]:
    """Return the IRIs that are objects of a predicate in some rows, each with the first row that has it."""
    found: dict[int, int] = {}
    for row in triples.by(predicate):
        if row in rows:
            found.setdefault(triples.objects[row], row)
    return {name: row for number, row in found.items() if isinstance(name := triples.terms[number], str)}


def _undefined_superclasses(ontology: Declarations, rows: range) -> Iterator[Diagnostic]:
    first = _named_objects(ontology.store, RDFS.subClassOf, rows)
    undefined = [name for name in first if not name.startswith(_W3C) and not ontology.defined(name)]
    same = namesakes(undefined, ontology.class_names())
    for place, name in enumerate(undefined[:MOST_WARNINGS]):
        advice = "import the file that defines it, or correct the name"
        if name in same:
            message = f"nothing defines the superclass {local_name(name)} ({name}); {same[name]} is taken for it"
            yield warning("O041", message, ontology.store.span(first[name]), "correct one of the two names")
            continue
        similar = _similar(ontology, name) if place < MOST_SUGGESTIONS else None
        if similar:
            advice = f"did you mean {similar}? {advice}"
        message = f"nothing defines the superclass {local_name(name)} ({name})"
        yield warning("O041", message, ontology.store.span(first[name]), advice)


def _similar(ontology: Declarations, name: str) -> str | None:
    """Return the local name of a declared class of the same namespace that is written almost like this one."""
    local = local_name(name)
    namespace = name.removesuffix(local)
    others = [other.removeprefix(namespace) for other in ontology.class_names() if other.startswith(namespace)]
    return next(iter(similar(local, others, least=0.75)), None)


def _individuals_as_classes(ontology: Declarations, rows: range) -> Iterator[Diagnostic]:
    named = _named_objects(ontology.store, OWL.someValuesFrom, rows)
    found = [name for name in named if not ontology.is_class(name) and ontology.is_individual(name)]
    if found:
        message = f"someValuesFrom with an individual is read as hasValue: {_names(found)}"
        yield note("O042", message, ontology.store.span(named[found[0]]))


def _classes_as_individuals(ontology: Declarations, rows: range) -> Iterator[Diagnostic]:
    named = _named_objects(ontology.store, OWL.hasValue, rows)
    found = [name for name in named if ontology.is_class(name) and not ontology.is_individual(name)]
    if found:
        message = f"hasValue with a class is read as someValuesFrom: {_names(found)}"
        yield note("O043", message, ontology.store.span(named[found[0]]))


def _names(iris: Sequence[str]) -> str:
    names = list(dict.fromkeys(map(local_name, iris)))
    return ", ".join(names[:3]) + (f" and {len(names) - 3} more" if len(names) > 3 else "")
