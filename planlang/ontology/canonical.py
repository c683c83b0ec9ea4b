"""Preparation of graphs for writing: an order that does not depend on blank-node labels, and prefixed names."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from enum import Enum
from typing import TypeVar

from planlang.closure import grouped
from planlang.ontology.terms import OWL, PREFIXES, RDF, XSD, BNode, Literal, Term, Triple

T = TypeVar("T")

AXIOM = OWL.Axiom
ANNOTATION = OWL.Annotation
_SOURCE, _PROPERTY, _TARGET = (OWL + name for name in ("annotatedSource", "annotatedProperty", "annotatedTarget"))


class Sorting(Enum):
    """What a written graph is sorted by: terms, so that equal graphs give equal texts, or positions in the file."""

    TERMS = "terms"
    FILE = "file"


class CannotSay(Exception):
    """The syntax cannot express a statement; the message names the reason."""


class Graph:
    """Sorted triples by subject, with blank-node labels that depend on the graph only.

    ``written`` holds the triples that have been written; the others are lost.
    """

    def __init__(self, triples: Iterable[Triple], *, order: Sorting = Sorting.TERMS) -> None:
        self.triples = labelled(triples, order=order)
        self.written: dict[Triple, None] = {}
        self._about: dict[str | BNode, list[Triple]] = {}
        self._with: dict[BNode, list[Triple]] = {}
        self._annotated: dict[tuple[Term, Term, Term], list[BNode]] = {}
        for triple in self.triples:
            self._about.setdefault(triple.subject, []).append(triple)
            if isinstance(triple.object, BNode) and triple.predicate not in (_SOURCE, _TARGET):
                self._with.setdefault(triple.object, []).append(triple)
        for subject in self._about:
            kinds = {triple.object for triple in self.about(subject, RDF.type)}
            if isinstance(subject, BNode) and not kinds.isdisjoint((AXIOM, ANNOTATION)):
                sources, properties, targets = (self.about(subject, part) for part in (_SOURCE, _PROPERTY, _TARGET))
                if len(sources) == len(properties) == len(targets) == 1:
                    key = (sources[0].object, properties[0].object, targets[0].object)
                    self._annotated.setdefault(key, []).append(subject)

    @property
    def header(self) -> Triple | None:
        """The triple that declares the ontology, of one with a name if there is any."""
        headers = [one for one in self.triples if one.predicate == RDF.type and one.object == OWL.Ontology]
        return next((one for one in headers if isinstance(one.subject, str)), next(iter(headers), None))

    def subjects(self) -> tuple[str | BNode, ...]:
        """All subjects, in order."""
        return tuple(self._about)

    def about(self, subject: str | BNode, predicate: str | None = None) -> list[Triple]:
        """Triples about a subject, of one property or all."""
        triples = self._about.get(subject, [])
        return triples if predicate is None else [triple for triple in triples if triple.predicate == predicate]

    def uses(self, node: BNode) -> list[Triple]:
        """Triples with a blank node as object, except owl:annotatedSource and owl:annotatedTarget."""
        return self._with.get(node, [])

    def has(self, subject: str | BNode, predicate: str, value: Term) -> bool:
        return any(triple.object == value for triple in self.about(subject, predicate))

    def one(self, subject: str | BNode, predicate: str) -> Triple | None:
        """Only triple about a subject with a property, None if there is none. Raises CannotSay if there are several."""
        triples = self.about(subject, predicate)
        if len(triples) > 1:
            raise CannotSay(f"several values of {predicate}")
        return triples[0] if triples else None

    def write(self, *triples: Triple) -> None:
        """Mark triples as written."""
        self.written.update(dict.fromkeys(triples))

    def attempt(self, triple: Triple, write: Callable[[], list[T]]) -> list[T]:
        """Texts of what a triple states, which marks it as written; nothing if the syntax cannot express it."""
        before = len(self.written)
        try:
            texts = write()
        except CannotSay:
            while len(self.written) > before:
                self.written.popitem()
            return []
        self.write(triple)
        return texts

    def rest(self) -> Iterator[Triple]:
        """Yield the triples that have not been written."""
        return (triple for triple in self.triples if triple not in self.written)

    def items(self, triple: Triple) -> list[Triple]:
        """The triples of the items of the RDF list that is a triple's object; its cells are marked as written.

        Raises CannotSay if the list is broken, cyclic or shared.
        """
        items: list[Triple] = []
        cell, seen = triple.object, set[Term]()
        while cell != RDF.nil:
            if not isinstance(cell, BNode) or cell in seen or len(self.uses(cell)) != 1:
                raise CannotSay("a list that has no end, or that is used twice")
            seen.add(cell)
            first, rest = self.one(cell, RDF.first), self.one(cell, RDF.rest)
            if first is None or rest is None:
                raise CannotSay("a list with a cell that lacks its item or its end")
            self.write(first, rest, *(t for t in self.about(cell, RDF.type) if t.object == RDF.List))
            items.append(first)
            cell = rest.object
        return items

    def annotations(self, triple: Triple, kind: str) -> Iterator[list[Triple]]:
        """Yield the annotations of a triple, for each node of a kind that has some; they are marked as written."""
        for node in self._annotated.get((triple.subject, triple.predicate, triple.object), []):
            stated = self.about(node)
            notes = [one for one in stated if one.predicate not in (RDF.type, _SOURCE, _PROPERTY, _TARGET)]
            if notes and self.has(node, RDF.type, kind):
                self.write(*stated)
                yield notes


MOST_ROUNDS = 60
"""Rounds of colour refinement, each of which takes in neighbours that are one step further away."""

MOST_TIES = 200
"""Ties between equally coloured nodes that are broken by choosing one."""


def labelled(triples: Iterable[Triple], *, order: Sorting = Sorting.TERMS) -> list[Triple]:
    """Sort triples without duplicates, and label their blank nodes b1, b2, ... in order of use.

    IRIs come before literals, these before blank nodes. The order depends on the graph only, not on labels or the
    order of the triples. It is computed by colour refinement; ties are broken by the input order, which in real files
    concerns interchangeable nodes only. (In general this is graph canonicalization: graphs built to defeat colour
    refinement may get different orders.)
    """
    unique = {(t.subject, t.predicate, t.object): t for t in reversed(list(triples))}
    colours = _colours(list(unique.values()))

    def key(term: Term) -> tuple[str, ...]:
        match term:
            case BNode():
                return ("3", colours.get(term, ""), "", "")
            case Literal(value, datatype, language):
                return ("2", value, datatype or "", language or "")
            case _:
                return ("1", term, "", "")

    ordered = sorted(unique.values(), key=lambda triple: (key(triple.subject), triple.predicate, key(triple.object)))
    labels: dict[BNode, BNode] = {}

    def label(term: Term) -> Term:
        return labels.setdefault(term, BNode(f"b{len(labels) + 1}")) if isinstance(term, BNode) else term

    result = []
    for triple in ordered:
        subject = label(triple.subject)
        assert not isinstance(subject, Literal)
        result.append(Triple(subject, triple.predicate, label(triple.object), triple.span))
    return sorted(result, key=lambda triple: triple.span) if order is Sorting.FILE else result


def differences(before: Iterable[Triple], after: Iterable[Triple]) -> tuple[list[Triple], list[Triple]]:
    """Compare graphs: the triples only in the first, and only in the second; blank nodes match by their content."""
    one, two = statements(before), statements(after)
    gone = [triple for key, found in one.items() for triple in found[len(two.get(key, ())) :]]
    new = [triple for key, found in two.items() for triple in found[len(one.get(key, ())) :]]
    return gone, new


def statements(triples: Iterable[Triple]) -> dict[tuple[object, str, object], list[Triple]]:
    """Group triples under keys that are equal for equal statements of any graphs, independent of labels."""
    given = list({(t.subject, t.predicate, t.object): t for t in triples}.values())
    colours = _content([Triple(t.subject, t.predicate, _plain(t.object), t.span) for t in given])
    found: dict[tuple[object, str, object], list[Triple]] = {}
    for triple in given:
        subject, value = (
            ("node", colours[t]) if isinstance(t, BNode) else _plain(t) for t in (triple.subject, triple.object)
        )
        found.setdefault((subject, triple.predicate, value), []).append(triple)
    return found


def _plain(term: Term) -> Term:
    """Remove the datatype xsd:string, which since RDF 1.1 every plain literal has."""
    return Literal(term.value) if isinstance(term, Literal) and term.datatype == XSD.string else term


def _digest(parts: object) -> str:
    return hashlib.blake2b(repr(parts).encode(errors="surrogatepass"), digest_size=12).hexdigest()


def _incident(triples: list[Triple]) -> tuple[dict[BNode, list[Triple]], dict[BNode, list[Triple]]]:
    """Collect the triples of each blank node as subject, and as object."""
    out: dict[BNode, list[Triple]] = {}
    into: dict[BNode, list[Triple]] = {}
    for triple in triples:
        for node in (triple.subject, triple.object):
            if isinstance(node, BNode):
                out.setdefault(node, [])
                into.setdefault(node, [])
        if isinstance(triple.subject, BNode):
            out[triple.subject].append(triple)
        if isinstance(triple.object, BNode):
            into[triple.object].append(triple)
    return out, into


def _content(triples: list[Triple]) -> dict[BNode, str]:
    """Digest all statements below each blank node; on cycles, those within MOST_ROUNDS steps."""
    out, into = _incident(triples)
    waiting = {node: sum(isinstance(t.object, BNode) for t in outgoing) for node, outgoing in out.items()}
    ready = [node for node, number in waiting.items() if number == 0]
    colours: dict[BNode, str] = {}
    for node in ready:  # grows while it is walked
        colours[node] = _digest(sorted((t.predicate, _shown(t.object, colours)) for t in out[node]))
        for triple in into[node]:
            if isinstance(triple.subject, BNode):
                waiting[triple.subject] -= 1
                if waiting[triple.subject] == 0:
                    ready.append(triple.subject)
    circular = [node for node in out if node not in colours]
    colours |= dict.fromkeys(circular, "circle")
    classes = 1
    for _ in range(MOST_ROUNDS):
        colours |= {
            node: _digest(sorted((t.predicate, _shown(t.object, colours)) for t in out[node])) for node in circular
        }
        found = len({colours[node] for node in circular})
        if found == classes:
            break
        classes = found
    return colours


def _shown(term: Term, colours: Mapping[BNode, str]) -> tuple[str, ...]:
    match term:
        case BNode():
            return ("node", colours[term])
        case Literal(value, datatype, language):
            return ("value", value, datatype or "", language or "")
        case _:
            return ("iri", term)


def _colours(triples: list[Triple]) -> dict[BNode, str]:
    """Colour each blank node by the digest of its content, refined by its uses until colours differ."""
    # Colour refinement (B. Weisfeiler, A. Leman, 1968): nodes of one colour are told apart by the colours around them,
    # again and again, until no round splits a colour. What is then still equal looks equal from everywhere, mostly
    # because it is: two restrictions with the same words. One of them gets a colour of its own, and refinement carries
    # that on to the nodes that hang on it. To choose among truly interchangeable nodes changes nothing of the result;
    # graphs in which equal colours are not interchangeable exist, but nobody writes them as an ontology.
    out, into = _incident(triples)
    colours = _content(triples)
    for tie in range(MOST_TIES):
        colours = _refined(colours, out, into)
        members = grouped((colour, node) for node, colour in colours.items())
        tied = sorted(colour for colour, nodes in members.items() if len(nodes) > 1)
        if not tied:
            break
        colours[members[tied[0]][0]] = _digest(("chosen", tie, tied[0]))
    return colours


def _refined(
    colours: dict[BNode, str], out: Mapping[BNode, list[Triple]], into: Mapping[BNode, list[Triple]]
) -> dict[BNode, str]:
    classes = len(set(colours.values()))
    for _ in range(MOST_ROUNDS):
        if classes == len(colours):
            break
        finer = {
            node: _digest(
                (
                    colour,
                    sorted((t.predicate, _shown(t.subject, colours)) for t in into[node]),
                    sorted((t.predicate, _shown(t.object, colours)) for t in out[node]),
                )
            )
            for node, colour in colours.items()
        }
        found = len(set(finer.values()))
        if found == classes:
            break
        colours, classes = finer, found
    return colours


class Subjects:
    """Triples by subject, and the blank nodes with a single use, which can be written at that place (``once``)."""

    def __init__(self, triples: Iterable[Triple]) -> None:
        self.about: dict[str | BNode, list[Triple]] = {}
        uses: dict[BNode, int] = {}
        for triple in triples:
            self.about.setdefault(triple.subject, []).append(triple)
            if isinstance(triple.object, BNode):
                uses[triple.object] = uses.get(triple.object, 0) + 1
        self.once = frozenset(node for node, number in uses.items() if number == 1)

    def list_at(self, cell: Term, is_free: Callable[[BNode], bool]) -> tuple[list[Term], list[BNode]] | None:
        """Items and cells of an RDF list that can be written as such; None if it is broken or has other statements.

        ``is_free`` decides whether a cell may be written here; it must be False for cells that were written before.
        """
        items: list[Term] = []
        cells: list[BNode] = []
        while cell != RDF.nil:
            triples = self.about.get(cell, []) if isinstance(cell, BNode) else []
            parts = {triple.predicate: triple.object for triple in triples}
            if (
                not isinstance(cell, BNode)
                or len(triples) != 2
                or set(parts) != {RDF.first, RDF.rest}
                or not is_free(cell)
            ):
                return None
            items.append(parts[RDF.first])
            cells.append(cell)
            cell = parts[RDF.rest]
        return items, cells


_LETTER = (
    "A-Za-z\u00c0-\u00d6\u00d8-\u00f6\u00f8-\u02ff\u0370-\u037d\u037f-\u1fff\u2c00-\u2fef\u3001-\ud7ff\uf900-\ufdcf"
)
# kept as strings, which re compiles on first use: compiling takes 9 ms, and few commands write an ontology
_LOCAL = rf"[{_LETTER}_0-9](?:[{_LETTER}_0-9.\-\u00b7]*[{_LETTER}_0-9\-\u00b7])?"
_PREFIX = rf"(?:[{_LETTER}](?:[{_LETTER}_0-9.\-]*[{_LETTER}_0-9\-])?)?"
_NAMESPACE = re.compile(r"[^\s<>\"{}|^`\\]+[#/:_-]")


class Names:
    """Shortens IRIs to prefixed names, and records which prefixes are used.

    ``prefixes`` are those of the file; names in ``own``, the ontology IRI, get the empty prefix.
    """

    def __init__(self, prefixes: Mapping[str, str], own: str | None = None) -> None:
        spaces: dict[str, str] = {}
        for name, space in sorted(prefixes.items()):
            if name and re.fullmatch(_PREFIX, name) and _fits(space):
                spaces.setdefault(space, name)
        default = own.rstrip("#/") + "#" if own else prefixes.get("", "")
        if _fits(default):
            spaces.setdefault(default, "")
        for name, space in PREFIXES.items():
            if name not in spaces.values():
                spaces.setdefault(space, name)
        self._spaces = dict(sorted(spaces.items(), reverse=True))
        self._used: set[str] = set()
        self._found: dict[str, tuple[str, str] | None] = {}

    def split(self, iri: str) -> tuple[str, str] | None:
        """Split an IRI into prefix and local name; None if it has to be written in full."""
        if iri not in self._found:
            self._found[iri] = next(self._splits(iri), None)
        found = self._found[iri]
        if found is not None:
            self._used.add(found[0])
        return found

    def _splits(self, iri: str) -> Iterator[tuple[str, str]]:
        for space, name in self._spaces.items():
            if iri.startswith(space) and re.fullmatch(_LOCAL, local := iri.removeprefix(space)):
                yield name, local

    def known(self) -> list[tuple[str, str]]:
        """All prefixes with their namespaces, sorted."""
        return sorted((name, space) for space, name in self._spaces.items())

    def used(self, declared: Mapping[str, str] | None = None) -> list[tuple[str, str]]:
        """Used prefixes with their namespaces, sorted, and the ``declared`` ones of a file, if given.

        owl, rdf, rdfs and xsd are included only if used, as every reader knows them.
        """
        found = {name: space for space, name in self._spaces.items() if name in self._used}
        for name, space in (declared or {}).items():
            if name not in ("owl", "rdf", "rdfs", "xsd") and re.fullmatch(_PREFIX, name) and _fits(space):
                found.setdefault(name, space)
        return sorted(found.items())


def _fits(space: str) -> bool:
    return _NAMESPACE.fullmatch(space) is not None
