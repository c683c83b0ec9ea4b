"""Class expressions of an ontology as expressions rather than triples, and as text in Manchester syntax."""

from __future__ import annotations

from planlang.diagnostics import Span
from planlang.ontology.expressions import Expression
from planlang.ontology.ontology import Ontology
from planlang.ontology.terms import BNode, Term, Triple, shorten
from planlang.ontology.writing.expressions import Expressions, Words
from planlang.ontology.writing.graph import CannotSay, Graph
from planlang.ontology.writing.names import Names

_ROOT, _IS = "urn:expression", "urn:is"


def expression_of(ontology: Ontology, term: Term, span: Span) -> Expression | None:
    """The class expression or data range that a term is, at ``span``; None if it is none or has no end."""
    if not isinstance(term, BNode):
        return Expression("name", span, term)
    triples = [Triple(_ROOT, _IS, term, span)]
    seen: set[BNode] = {term}
    queue = [term]
    for node in queue:
        for triple in ontology.triples(s=node):
            triples.append(triple)
            if isinstance(triple.object, BNode) and triple.object not in seen:
                seen.add(triple.object)
                queue.append(triple.object)
    graph = Graph(triples)
    try:
        (root,) = graph.about(_ROOT)
        return Expressions(graph).of(root)[0]
    except CannotSay:
        return None


def text_of(expression: Expression) -> str:
    """An expression in Manchester syntax; names of the vocabulary without prefix."""
    return _Short(Names({})).text(expression)


class _Short(Words):
    def name(self, iri: str) -> str:
        return shorten(iri).rpartition("#")[2] or iri
