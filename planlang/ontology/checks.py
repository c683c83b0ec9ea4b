"""Repairs of a file's triples, and checks of what remains wrong.

Repaired: terms in the wrong namespace, restrictions without their type. Reported: malformed
restrictions, lists and literals of a file, and errors that only show in the ontology as a whole.
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
from planlang.ontology.terms import INTEGER, KNOWROB, LANGUAGES, OWL, RDF, RDFS, XSD, BNode, Literal, Term, Triple
from planlang.ontology.triples import Triples, counted
from planlang.spelling import similar

TERMS: dict[str, frozenset[str]] = {space: space.terms for space in (RDFS, OWL, RDF)}
"""Namespace -> local names of its terms; a misplaced term is looked up in this order."""

_W3C_TERMS = tuple(TERMS)

MISSPELT = 0.8
"""Least similarity (difflib ratio) at which a name counts as a misspelt term: ``abuot`` is one of ``about``."""

_ATTRIBUTES = frozenset(("about", "resource", "ID", "nodeID", "datatype", "parseType"))
"""RDF names that are attributes in RDF/XML, not terms."""

MOST_WARNINGS = 100
"""Warnings of one kind about one file; further terms are repaired silently, further mistakes are counted."""

_SYNONYMS = {OWL + "DataProperty": OWL.DatatypeProperty, OWL + "Individual": OWL.NamedIndividual}
"""Words of Manchester syntax, which people also write as OWL terms."""
_PREFIX: dict[str, str] = {RDFS: "rdfs", OWL: "owl", RDF: "rdf"}


def repair(triples: Triples) -> list[Diagnostic]:
    """Replace wrong terms by those that are meant, and return the diagnostics.

    ``owl:subClassOf`` becomes ``rdfs:subClassOf`` and so on; a blank node with owl:onProperty becomes a restriction.
    """
    corrections = _Corrections()
    wrong = {
        number
        for term, number in triples.numbers.items()
        if isinstance(term, str) and term.startswith(_W3C_TERMS) and _correction(term)
    }
    if wrong:
        _correct(triples, wrong, corrections)
    return [*corrections.diagnostics, *_add_restrictions(triples)]


def _correct(triples: Triples, wrong: set[int], corrections: _Corrections) -> None:
    """Correct predicates and types; in other places the term may be mentioned on purpose."""
    types = {
        number for number in dict.fromkeys(triples.predicates) if meant_term(triples.name(number) or "") == RDF.type
    }
    for row, (predicate, value) in enumerate(zip(triples.predicates, triples.objects, strict=True)):
        if predicate in wrong:
            triples.predicates[row] = corrections.number(triples, predicate, row)
        if predicate in types and value in wrong:
            triples.objects[row] = corrections.number(triples, value, row)


class _Corrections:
    """Looks up corrected terms, and reports each correction where it is made."""

    def __init__(self) -> None:
        self.diagnostics: list[Diagnostic] = []
        self._known: dict[int, tuple[str, str, str | None]] = {}

    def number(self, triples: Triples, wrong: int, row: int) -> int:
        """Number of the term that replaces an undefined one; of the term itself if no replacement is known."""
        iri = triples.name(wrong) or ""
        known = self._known.get(wrong)
        if known is None:
            known = self._known[wrong] = _correction(iri) or (iri, "", None)
            if _is_misspelt(iri):
                self.diagnostics.append(error("O013", known[1], triples.span(row), known[2]))
        corrected, message, advice = known
        if len(self.diagnostics) < MOST_WARNINGS and not _is_misspelt(iri):
            code = "O013" if corrected == iri else "O012"
            self.diagnostics.append(warning(code, message, triples.span(row), advice))
        return triples.number(corrected)


def meant_term(iri: str) -> str:
    """Correct an IRI in the namespaces of RDF, RDFS and OWL that is no term of theirs; others are unchanged."""
    correction = _correction(iri)
    return iri if correction is None else correction[0]


def _correction(iri: str) -> tuple[str, str, str | None] | None:
    """Corrected IRI, message and advice for a term; None if there is nothing to correct."""
    local = local_name(iri)
    namespace = iri.removesuffix(local)
    if namespace not in TERMS or not local or local in TERMS[namespace] or (namespace == RDF and local[0] == "_"):
        return None  # rdf:_1, rdf:_2, ... are the members of containers
    written = f"{_PREFIX[namespace]}:{local}"
    corrected = next((home + local for home, terms in TERMS.items() if local in terms), _SYNONYMS.get(iri))
    if corrected is not None:
        name = local_name(corrected)
        right = f"{_PREFIX[corrected.removesuffix(name)]}:{name}"
        return corrected, f"{written} is read as {right}", f"write {right}"
    near = _near(namespace, local, MISSPELT) or _near(namespace, local, 0.6)
    advice = f"did you mean {_PREFIX[namespace]}:{near[0]}?" if near else None
    is_term = bool(near) and near[0] in TERMS[namespace] and _is_misspelt(iri)
    vocabulary = _PREFIX[namespace].upper()
    return namespace + near[0] if is_term else iri, f"{vocabulary} has no term {written}", advice


def _near(namespace: str, local: str, least: float) -> list[str]:
    terms = TERMS[namespace] | (_ATTRIBUTES if namespace == RDF else frozenset())
    return get_close_matches(local, sorted(terms), n=1, cutoff=least)


@lru_cache(100_000)  # bounded, as a server reads unlimited numbers of names
def _is_misspelt(iri: str) -> bool:
    """Check whether an IRI is a typo of a term of RDF, RDFS or OWL, or of an attribute of RDF/XML."""
    local = local_name(iri)
    namespace = iri.removesuffix(local)
    if namespace not in TERMS or iri in _SYNONYMS or any(local in terms for terms in TERMS.values()):
        return False
    return bool(_near(namespace, local, MISSPELT))


def _add_restrictions(triples: Triples) -> list[Diagnostic]:
    """Add the type owl:Restriction to blank nodes with owl:onProperty that lack it."""
    rdf_type, restriction, on_property = map(triples.numbers.get, (RDF.type, OWL.Restriction, OWL.onProperty))
    if on_property is None:
        return []
    rows = [row for row, number in enumerate(triples.predicates) if number == on_property]
    subjects = set(map(triples.subjects.__getitem__, rows))
    if rdf_type is not None and restriction is not None:
        subjects.difference_update(
            subject
            for subject, predicate, value in zip(triples.subjects, triples.predicates, triples.objects, strict=True)
            if value == restriction and predicate == rdf_type
        )
    untyped = {triples.subjects[row]: row for row in reversed(rows) if triples.subjects[row] in subjects}
    untyped = {subject: row for subject, row in untyped.items() if triples.is_node(subject)}
    if not untyped:
        return []
    first = min(map(triples.span, untyped.values()))
    what = f"{len(untyped)} restrictions lack" if len(untyped) > 1 else "a restriction lacks"
    triples.repeat(untyped.values(), triples.number(RDF.type), triples.number(OWL.Restriction))
    return [note("O014", f"{what} the type owl:Restriction; it is inferred from owl:onProperty", first)]


_FILLERS = frozenset(OWL + name for name in ("someValuesFrom", "allValuesFrom", "hasValue", "hasSelf"))
_NUMBERS = frozenset(
    f"{OWL}{name}ardinality" for name in ("minC", "maxC", "c", "minQualifiedC", "maxQualifiedC", "qualifiedC")
)
_NATURAL = re.compile(r"\+?[0-9]+|-0+")
_DOUBLE = re.compile(r"[+-]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]+)?|[+-]?INF|NaN")
_FORMS = {
    **{XSD + name: INTEGER for name in ("integer", "int", "long", "short", "byte")},
    **{XSD + name: _NATURAL for name in ("nonNegativeInteger", "unsignedInt", "unsignedLong", "unsignedShort")},
    XSD.positiveInteger: re.compile(r"\+?0*[1-9][0-9]*"),
    XSD.decimal: re.compile(r"[+-]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)"),
    XSD.double: _DOUBLE,
    XSD.float: _DOUBLE,
    XSD.boolean: re.compile("true|false|0|1"),
}
"""Datatype -> pattern of its values without surrounding white space (lexical space of XML Schema)."""


def malformed(triples: Triples) -> list[Diagnostic]:
    """Find incomplete restrictions, broken lists and literals that do not match their datatype."""
    kinds = (_restrictions(triples), _lists(triples), _values(triples))
    found = [list(kind) for kind in kinds]
    return [one for every in found for one in counted(every[:MOST_WARNINGS], len(every) - MOST_WARNINGS)]


def _by_subject(triples: Triples, rows: Iterable[int], subjects: set[int]) -> list[list[Triple]]:
    """Group the triples of some rows by these subjects, in document order."""
    groups: dict[int, list[Triple]] = {}
    for row in sorted(rows) if subjects else ():
        if triples.subjects[row] in subjects:
            groups.setdefault(triples.subjects[row], []).append(triples.triple(row))
    return list(groups.values())


def _not_once(triples: Triples, *groups: Sequence[int]) -> set[int]:
    """Find the subjects that do not occur exactly once in each of these groups of rows."""
    odd: set[int] = set()
    sets = [_column(triples.subjects, rows) for rows in groups]
    for rows, unique in zip(groups, sets, strict=True):
        if len(rows) > len(unique):
            counts = Counter(map(triples.subjects.__getitem__, rows))
            odd.update(subject for subject, count in counts.items() if count > 1)
    if any(one != sets[0] for one in sets):
        odd |= sets[0].union(*sets) - sets[0].intersection(*sets)
    return odd


def _column(column: Sequence[int], rows: Iterable[int]) -> set[int]:
    """Set of the numbers in some rows of a column."""
    return set(map(column.__getitem__, rows))


def _restrictions(triples: Triples) -> Iterator[Diagnostic]:
    properties, fillers, numbers = triples.by(OWL.onProperty), triples.by(*_FILLERS, *_NUMBERS), triples.by(*_NUMBERS)
    odd = _not_once(triples, properties, fillers)
    values = {number for number in _column(triples.objects, properties) if isinstance(triples.terms[number], Literal)}
    if values:
        odd.update(triples.subjects[row] for row in properties if triples.objects[row] in values)
    odd.update(triples.subjects[row] for row in numbers if not _is_number(triples.term(triples.objects[row])))
    for group in _by_subject(triples, (*properties, *fillers), odd):
        yield from _restriction(group)


def _restriction(triples: list[Triple]) -> Iterator[Diagnostic]:
    """Check one restriction, given its triples with property, fillers and cardinalities."""
    properties = [t for t in triples if t.predicate == OWL.onProperty]
    fillers = [t for t in triples if t.predicate != OWL.onProperty]
    if not properties and fillers and isinstance(fillers[0].subject, BNode):
        what = f"a restriction with {local_name(fillers[0].predicate)} names no property and is ignored"
        yield warning("O017", what, fillers[0].span, "add owl:onProperty")
    for prop in properties[:1]:
        name = _shown(prop.object)
        if isinstance(prop.object, Literal):
            message = f"a restriction has the literal {name} as its property and is ignored"
            yield warning("O017", message, prop.span, "name a property in owl:onProperty")
        elif len(properties) > 1:
            others = " and ".join(_shown(other.object) for other in properties)
            message = f"one restriction names several properties: {others}; only the first counts"
            yield warning("O017", message, properties[1].span, "write an owl:Restriction for each")
        elif not fillers:
            advice = "add owl:someValuesFrom or owl:hasValue"
            yield warning("O017", f"a restriction on {name} has no filler and is ignored", prop.span, advice)
        elif len(fillers) > 1:
            what = f"one restriction on {name} has {len(fillers)} fillers; each is read as a restriction of its own"
            yield warning("O017", what, fillers[1].span, "write an owl:Restriction for each")
    for filler in fillers:
        if filler.predicate in _NUMBERS and not _is_number(filler.object):
            what = f"a restriction is ignored: its {local_name(filler.predicate)} {_shown(filler.object)} is no number"
            yield warning("O017", what, filler.span, "write a whole number, such as 1")


def _is_number(term: Term) -> bool:
    return isinstance(term, Literal) and term.value.strip().isdecimal() and len(term.value) < 10


_LISTED = (
    OWL.unionOf, OWL.intersectionOf, OWL.oneOf, OWL.disjointUnionOf, OWL.members, OWL.distinctMembers, OWL.hasKey,
    OWL.propertyChainAxiom, OWL.withRestrictions, OWL.onProperties,
)  # fmt: skip
"""Properties whose value is a list."""


def _lists(triples: Triples) -> Iterator[Diagnostic]:
    firsts, rests = triples.by(RDF.first), triples.by(RDF.rest)
    cells = {triples.numbers.get(RDF.nil, -1), *_column(triples.subjects, firsts)}
    cells.update(map(triples.subjects.__getitem__, rests))
    odd = _not_once(triples, firsts, rests)
    if not cells.issuperset(map(triples.objects.__getitem__, rests)):
        odd.update(triples.subjects[row] for row in rests if triples.objects[row] not in cells)
    for group in _by_subject(triples, (*firsts, *rests), odd):
        yield from _list(group, lambda term: triples.find(term) in cells)
    for row in triples.by(*_LISTED):
        if triples.objects[row] not in cells:
            one = triples.triple(row)
            word, value = local_name(one.predicate), _shown(one.object)
            message = f"{word} has {value}, which is no list, and is ignored"
            yield warning("O018", message, one.span, f"write a list: owl:{word} ( {value} ... )")
    yield from _cycles(triples, rests)


def _list(triples: list[Triple], is_list: Callable[[Term], bool]) -> Iterator[Diagnostic]:
    """Check one cell of a list, given its triples."""
    firsts = [t for t in triples if t.predicate == RDF.first]
    rests = [t for t in triples if t.predicate == RDF.rest]
    at = triples[0].span
    if len(firsts) > 1:
        yield warning("O018", "one cell of a list has several items", firsts[1].span, "write a cell for each")
    elif not firsts:
        yield warning("O018", "one cell of a list has no item", at, "add rdf:first, or remove the cell")
    if len(rests) > 1:
        message = "one cell of a list has several successors; only one is used"
        yield warning("O018", message, rests[1].span, "remove all rdf:rest of the cell but one")
    elif not rests:
        yield warning("O018", "a list does not end; it is assumed to end here", at, "add rdf:rest rdf:nil")
    elif not is_list(rests[0].object):
        what = f"a list continues with {_shown(rests[0].object)}, which is no list; it is assumed to end here"
        yield warning("O018", what, rests[0].span, "write rdf:rest rdf:nil")


def _cycles(triples: Triples, rests: Sequence[int]) -> Iterator[Diagnostic]:
    """Yield a warning for each cyclic list."""
    end = triples.numbers.get(RDF.nil, -1)
    if all(triples.subjects[row] < triples.objects[row] or triples.objects[row] == end for row in rests):
        return  # numbers of cells increase along each list, so none has a cycle
    following = {triples.subjects[row]: row for row in reversed(rests)}
    done: set[int] = set()
    for start in map(triples.subjects.__getitem__, rests):
        path: dict[int, None] = {}
        cell, row = start, -1
        while cell in following and cell not in done and cell not in path:
            path[cell] = None
            row = following[cell]
            cell = triples.objects[row]
        if cell in path:
            message = "a list continues with one of its earlier cells; it is assumed to end here"
            yield warning("O018", message, triples.span(row), "write rdf:rest rdf:nil")
        done.update(path)


def _values(triples: Triples) -> Iterator[Diagnostic]:
    wrong = {number for term, number in triples.numbers.items() if isinstance(term, Literal) and is_malformed(term)}
    if wrong:
        for row, number in enumerate(triples.objects):
            if number in wrong:
                triple = triples.triple(row)
                assert isinstance(triple.object, Literal)
                kind = local_name(triple.object.datatype or "")
                what = (
                    f"the value of {local_name(triple.predicate)} is not of type {kind}: {triple.object.value[:40]!r}"
                )
                yield warning("O019", what, triple.span, "correct the value, or its datatype")


def is_malformed(value: Literal) -> bool:
    """Check whether a literal is outside the lexical space of its datatype."""
    form = _FORMS.get(value.datatype or "")
    return form is not None and not form.fullmatch(value.value.strip())


def _shown(term: Term) -> str:
    if isinstance(term, BNode):
        return "a blank node"
    name = local_name(term) if isinstance(term, str) else term.value
    return (name if not isinstance(term, str) or not term.startswith(RDF) else f"rdf:{name}")[:60]


MOST_SUGGESTIONS = 20
"""Undefined classes for which a similar name is looked up, which is slow in large ontologies."""


class Declarations(Protocol):
    """Part of Ontology that the checks need: the triples of all documents, and what they declare."""

    store: Triples

    def is_class(self, iri: str) -> bool: ...
    def is_individual(self, iri: str) -> bool: ...
    def defined(self, iri: str) -> bool: ...
    def class_names(self) -> tuple[str, ...]: ...


def check(ontology: Declarations, paths: Iterable[Path]) -> Iterator[Diagnostic]:
    """Check every document that is not bundled against the whole ontology; ``paths`` are those of all documents."""
    own = (folder := bundled("ontologies"), folder.resolve())
    has_vocabulary = ontology.is_class(KNOWROB + "Action")
    for path, rows in zip(paths, ontology.store.ranges, strict=True):
        if not (path.is_relative_to(own[0]) or path.resolve().is_relative_to(own[1])):
            if has_vocabulary:
                superclasses = _named_objects(ontology.store, RDFS.subClassOf, rows)
                yield from _undefined(ontology, "the superclass {}", superclasses)
                yield from _undefined(ontology, "the class {} of an effect", _classes_of_effects(ontology.store, rows))
            yield from _individuals_as_classes(ontology, rows)
            yield from _classes_as_individuals(ontology, rows)
            yield from _one_of_two_names(ontology.store, rows)


def _one_of_two_names(triples: Triples, rows: range) -> Iterator[Diagnostic]:
    """Yield a warning for what is stated to be the same and is still two: classes, properties, nodes without names."""
    for row in [row for row in triples.by(OWL.sameAs) if row in rows][:MOST_WARNINGS]:
        one, about = triples.triple(row), map(triples.predicates.__getitem__, triples.about(triples.objects[row]))
        if one.object != one.subject and any(predicate != triples.predicates[row] for predicate in about):
            names = f"{_shown(one.subject)} and {_shown(one.object)} are stated to be the same individual"
            advice = "use one IRI for both, or owl:equivalentClass for classes"
            yield warning("O046", f"{names}; planlang takes them for two", one.span, advice)


def _named_objects(triples: Triples, predicate: str, rows: range) -> dict[str, int]:
    """Map the IRIs that are objects of a predicate in some rows to the first row of each."""
    return _first_uses(triples, [row for row in triples.by(predicate) if row in rows])


def _first_uses(triples: Triples, rows: Iterable[int]) -> dict[str, int]:
    """Map the IRIs that are objects of some rows to the first row of each."""
    first: dict[int, int] = {}
    for row in rows:
        first.setdefault(triples.objects[row], row)
    return {name: row for number, row in first.items() if isinstance(name := triples.terms[number], str)}


_OF_EFFECTS = tuple(KNOWROB + name for name in ("byAction", "inputsDestroyed", "outputsCreated", "turnedOver"))
"""Properties of an ObjectChange or a HeatChange that name classes."""


def _classes_of_effects(triples: Triples, rows: range) -> dict[str, int]:
    """Map the classes that declared effects name, and those of which steps create some, to the first row of each."""
    changes = {triples.numbers.get(KNOWROB + name) for name in ("ObjectChange", "HeatChange")}
    declaring = [
        row
        for row in triples.by(*_OF_EFFECTS)
        if row in rows and any(triples.objects[one] in changes for one in triples.about(triples.subjects[row]))
    ]
    output = triples.numbers.get(KNOWROB + "outputsCreated", -1)
    restricted = [row for row in triples.by(OWL.onProperty) if row in rows and triples.objects[row] == output]
    created = {triples.subjects[row] for row in restricted}
    declaring += [row for row in triples.by(OWL.someValuesFrom) if triples.subjects[row] in created]
    return _first_uses(triples, sorted(declaring))


def _undefined(ontology: Declarations, what: str, first: dict[str, int]) -> Iterator[Diagnostic]:
    """Yield a warning for each class (IRI -> row of its first use) that nothing defines; ``what`` says what it is."""
    undefined = [name for name in first if not name.startswith(LANGUAGES) and not ontology.defined(name)]
    same = namesakes(undefined, ontology.class_names())
    for index, name in enumerate(undefined[:MOST_WARNINGS]):
        message = f"{what.format(f'{local_name(name)} ({name})')} is not defined"
        advice = "import the file that defines it, or correct the name"
        if name in same:
            message = f"{message}; {same[name]} is used instead"
            yield warning("O041", message, ontology.store.span(first[name]), "correct one of the two names")
            continue
        similar = _similar(ontology, name) if index < MOST_SUGGESTIONS else None
        if similar:
            advice = f"did you mean {similar}? {advice}"
        yield warning("O041", message, ontology.store.span(first[name]), advice)


def _similar(ontology: Declarations, name: str) -> str | None:
    """Local name of the declared class of the same namespace with the most similar name, if any is similar."""
    local = local_name(name)
    namespace = name.removesuffix(local)
    others = [other.removeprefix(namespace) for other in ontology.class_names() if other.startswith(namespace)]
    return next(iter(similar(local, others, least=0.75)), None)


def _individuals_as_classes(ontology: Declarations, rows: range) -> Iterator[Diagnostic]:
    fillers = _named_objects(ontology.store, OWL.someValuesFrom, rows)
    wrong = [name for name in fillers if not ontology.is_class(name) and ontology.is_individual(name)]
    if wrong:
        message = f"someValuesFrom with an individual is read as hasValue: {_names(wrong)}"
        yield note("O042", message, ontology.store.span(fillers[wrong[0]]))


def _classes_as_individuals(ontology: Declarations, rows: range) -> Iterator[Diagnostic]:
    fillers = _named_objects(ontology.store, OWL.hasValue, rows)
    wrong = [name for name in fillers if ontology.is_class(name) and not ontology.is_individual(name)]
    if wrong:
        message = f"hasValue with a class is read as someValuesFrom: {_names(wrong)}"
        yield note("O043", message, ontology.store.span(fillers[wrong[0]]))


def _names(iris: Sequence[str]) -> str:
    names = list(dict.fromkeys(map(local_name, iris)))
    return ", ".join(names[:3]) + (f" and {len(names) - 3} more" if len(names) > 3 else "")
