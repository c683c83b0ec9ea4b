"""rdflib as an oracle: graphs of our triples."""

import logging
from collections.abc import Callable, Iterable, Iterator

import pytest
import rdflib

from planlang.ontology import BNode, Literal, Term, Triple
from planlang.ontology.terms import XSD


def node(term: Term) -> rdflib.term.Node:
    if isinstance(term, BNode):
        return rdflib.BNode(term.label)
    if isinstance(term, Literal):
        datatype = None if term.datatype == XSD.string else term.datatype  # the same since RDF 1.1
        return rdflib.Literal(term.value, term.language, datatype, normalize=False)
    return rdflib.URIRef(term)


def graph_of(triples: Iterable[Triple]) -> rdflib.Graph:
    graph = rdflib.Graph()
    for triple in triples:
        graph.add((node(triple.subject), rdflib.URIRef(triple.predicate), node(triple.object)))
    return graph


@pytest.fixture(scope="session")
def as_rdflib() -> Callable[[Iterable[Triple]], rdflib.Graph]:
    """Makes rdflib's graph of triples, values as they are written."""
    return graph_of


@pytest.fixture(scope="session")
def by_rdflib() -> Callable[[str, str, str], rdflib.Graph]:
    """What rdflib reads in a text (text, format, address), language tags in lower case as they are here."""

    def read(text: str, serialization: str, base: str) -> rdflib.Graph:
        graph = rdflib.Graph()
        for subject, predicate, value in rdflib.Graph().parse(data=text, format=serialization, publicID=base):
            if isinstance(value, rdflib.Literal) and value.language:
                value = rdflib.Literal(str(value), value.language.lower())
            elif isinstance(value, rdflib.Literal) and str(value.datatype) == XSD.string:
                value = rdflib.Literal(str(value))
            graph.add((subject, predicate, value))
        return graph

    return read


@pytest.fixture(scope="session", autouse=True)
def _literals_as_they_are() -> Iterator[None]:
    before, rdflib.NORMALIZE_LITERALS = rdflib.NORMALIZE_LITERALS, False
    logging.getLogger("rdflib").setLevel(logging.CRITICAL)
    yield
    rdflib.NORMALIZE_LITERALS = before
