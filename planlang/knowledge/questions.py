"""Class expressions as a user writes them: Manchester syntax, names without namespaces where these are clear."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import replace
from difflib import get_close_matches

from planlang.designators import local_name
from planlang.diagnostics import BadInput, Diagnostic, Span, error
from planlang.ontology.canonical import CannotSay, Graph
from planlang.ontology.expression_text import Expressions
from planlang.ontology.expressions import Expression
from planlang.ontology.manchester import read_manchester
from planlang.ontology.terms import KNOWROB, OWL, VOCABULARIES

LONGEST = 10_000
"""Characters of a question."""

_FILE = "question"
_HEAD = "".join(f"Prefix: {prefix}: <{start}>\n" for prefix, start in VOCABULARIES.items())
_FRAME = f"Ontology: <urn:{_FILE}>\nClass: <urn:{_FILE}> EquivalentTo:\n"
_LINES_ABOVE = (_HEAD + _FRAME).count("\n")
_LOCAL = f"urn:{_FILE}#"
_SEVERAL = re.compile(r":(?=\s|$)")


def read_question(text: str, names: Mapping[str, Iterable[str]]) -> Expression:
    """Return the expression that a text is, with IRIs for names; positions are those in the text.

    ``names`` has the IRIs of every local name that may be asked for. Raises BadInput: K002 for a name that is unknown
    or has several meanings, K003 for what is no single expression, and as the reader of Manchester syntax does.
    """
    if len(text) > LONGEST:
        raise BadInput([error("K003", f"a question has at most {LONGEST:,} characters", Span(_FILE))])
    if _SEVERAL.search(text):
        raise BadInput([error("K003", "a question is one class expression, without ':' behind a word", Span(_FILE))])
    try:
        triples = read_manchester(_HEAD + _FRAME + text, _FILE, base=f"urn:{_FILE}").triples
    except BadInput as bad:
        raise BadInput([_shifted(one) for one in bad.diagnostics]) from None
    graph = Graph(list(triples))
    try:
        (stated,) = graph.about(f"urn:{_FILE}", OWL.equivalentClass)
        expression, _ = Expressions(graph).of(stated)
    except (CannotSay, ValueError) as problem:
        advice = "for instance: ServingFoodOrDrink and objectActedOn some Bottle"
        raise BadInput([error("K003", f"this is no question: {problem}", Span(_FILE), advice)]) from None
    problems: list[Diagnostic] = []
    expression = _resolved(expression, names, problems)
    if problems:
        raise BadInput(problems)
    return expression


def _resolved(expression: Expression, names: Mapping[str, Iterable[str]], problems: list[Diagnostic]) -> Expression:
    """Return an expression with known IRIs for names without namespace; appends what is wrong with others."""
    parts = tuple(_resolved(part, names, problems) for part in expression.parts)
    span = _in_text(expression.span)
    term = expression.term
    is_assumed = isinstance(term, str) and term.startswith(KNOWROB) and term not in names.get(local_name(term), (term,))
    if isinstance(term, str) and (is_assumed or term.startswith(_LOCAL)):
        name = local_name(term)  # the reader takes words of the vocabulary for KnowRob's
        meant = sorted(set(names.get(name, ())))
        if len(meant) != 1:
            problems.append(_unclear(name, meant, names, span))
        return replace(expression, parts=parts, span=span, term=meant[0] if meant else None)
    known = (OWL.Thing, *names.get(local_name(term), (term,))) if isinstance(term, str) else ()
    if isinstance(term, str) and expression.kind == "name" and term not in known:
        problems.append(error("K002", f"nothing here knows <{term}>", span))
    return replace(expression, parts=parts, span=span, term=term)


def _unclear(name: str, meant: list[str], names: Mapping[str, Iterable[str]], span: Span) -> Diagnostic:
    if meant:
        advice = "write one of " + ", ".join(f"<{iri}>" for iri in meant[:5])
        return error("K002", f"{name} has several meanings", span, advice)
    similar = get_close_matches(name, names, n=3)
    guess = f"did you mean {' or '.join(similar)}?" if similar else None
    return error("K002", f"nothing here is called {name}", span, guess)


def _shifted(diagnostic: Diagnostic) -> Diagnostic:
    return replace(diagnostic, span=_in_text(diagnostic.span or Span(_FILE)))


def _in_text(span: Span) -> Span:
    return span._replace(line=max(1, span.line - _LINES_ABOVE))


def names_in(iris: Iterable[str]) -> dict[str, list[str]]:
    """Return the IRIs of each local name."""
    found: dict[str, list[str]] = {}
    for iri in iris:
        found.setdefault(local_name(iri), []).append(iri)
    return found
