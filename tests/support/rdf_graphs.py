"""rdflib as an oracle: graphs of our triples and of what it reads, and whether two of them say the same."""

import logging
from collections.abc import Iterable

import rdflib
from rdflib.compare import isomorphic

from planlang.ontology import BNode, Literal, Term, Triple
from planlang.ontology.terms import XSD

rdflib.NORMALIZE_LITERALS = False  # values as they are written
logging.getLogger("rdflib").setLevel(logging.CRITICAL)

Graph = set[tuple[str, str, str]]
"""Subject, predicate and object: IRIs in <>, texts in quotation marks, and rdflib.BNode."""


def graph_of(triples: Iterable[Triple]) -> Graph:
    return {(word(triple.subject), word(triple.predicate), word(triple.object)) for triple in triples}


def word(term: Term) -> str:
    if isinstance(term, BNode):
        return rdflib.BNode(term.label)
    return text(term.value, term.language, term.datatype) if isinstance(term, Literal) else f"<{term}>"


def text(value: str, language: str | None, datatype: str | None) -> str:
    """A literal; of type xsd:string is every text without another, since RDF 1.1."""
    return f'"{value}"@{(language or "").lower()}^^{"" if datatype in (None, XSD.string) else datatype}'


def read_by_rdflib(content: str | bytes, form: str, base: str) -> Graph:
    return graph_of_rdflib(rdflib.Graph().parse(data=content, format=form, publicID=base))


def graph_of_rdflib(graph: rdflib.Graph) -> Graph:
    return {(word_of(subject), word_of(predicate), word_of(value)) for subject, predicate, value in graph}


def word_of(term: rdflib.term.Node) -> str:
    if isinstance(term, rdflib.Literal):
        return text(str(term), term.language, str(term.datatype) if term.datatype else None)
    return term if isinstance(term, rdflib.BNode) else f"<{term}>"


def same(found: Graph, expected: Graph) -> bool:
    """Return whether two graphs say the same, whatever their nameless nodes are called."""
    known: dict[tuple[tuple[str, str], ...], str] = {}
    one, other = outline(found, known), outline(expected, known)
    if one is not None and other is not None:
        return one == other
    return isomorphic(as_rdflib(found), as_rdflib(expected))  # takes seconds for a thousand nameless nodes


def outline(
    graph: Graph, known: dict[tuple[tuple[str, str], ...], str]
) -> list[tuple[str, tuple[tuple[str, str], ...]]] | None:
    """Return what is said of each subject, nameless nodes called by what is said of them, which ``known`` numbers.

    None if that does not tell them apart, since some are objects of several triples, or in a circle.
    """
    said: dict[str, list[tuple[str, str]]] = {}
    for subject, predicate, value in graph:
        said.setdefault(subject, []).append((predicate, value))
    nested = [value for _, _, value in graph if isinstance(value, rdflib.BNode)]
    inner = set(nested)
    if len(inner) < len(nested):
        return None
    nodes = [subject for subject in said if subject not in inner]
    outer = len(nodes)
    for node in nodes:  # grows: each node comes behind the one that mentions it
        nodes.extend(value for _, value in said.get(node, ()) if isinstance(value, rdflib.BNode))
    if len(nodes) < outer + len(inner):
        return None
    names: dict[str, str] = {}
    found = []
    for node in reversed(nodes):
        what = tuple(sorted((predicate, names.get(value, value)) for predicate, value in said.get(node, ())))
        if isinstance(node, rdflib.BNode):
            names[node] = known.setdefault(what, f"_:{len(known)}")
        found.append((names.get(node, node), what))
    return sorted(found)


def as_rdflib(graph: Graph) -> rdflib.Graph:
    found = rdflib.Graph()
    for triple in graph:
        subject, predicate, value = (one if isinstance(one, rdflib.BNode) else rdflib.Literal(one) for one in triple)
        found.add((subject, predicate, value))
    return found
