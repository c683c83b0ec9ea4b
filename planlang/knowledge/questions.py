"""Class expressions as a user writes them: Manchester syntax, names without namespaces where these are clear."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
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
_EXAMPLE = "ServingFoodOrDrink and objectActedOn some DrinkingBottle"
_ADVICE = f"a question is a class expression, such as {_EXAMPLE}; a label is searched for words"
_SEVERAL = re.compile(r":(?=\s|$)")


def read_question(
    text: str, names: Mapping[str, Iterable[str]], own: Mapping[str, Iterable[str]] | None = None
) -> Expression:
    """Return the expression that a text is, with IRIs for names; positions are those in the text.

    ``names`` has the IRIs of every local name that may be asked for. Names of ``own`` are no vocabulary's but what
    entries call their classes: if several do, any of them is meant. Raises BadInput: K002 for a name that is unknown
    or has several meanings, K003 for what is no single expression, and as the reader of Manchester syntax does.
    """
    if len(text) > LONGEST:
        raise BadInput([error("K003", f"a question has at most {LONGEST:,} characters", Span(_FILE))])
    if not text.strip():
        raise BadInput([error("K003", "the question is empty", Span(_FILE), _ADVICE)])
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
        raise BadInput([error("K003", f"this is no question: {problem}", Span(_FILE), _ADVICE)]) from None
    problems: list[Diagnostic] = []
    expression = _resolved(expression, _Names(names, own or {}), problems)
    if problems:
        raise BadInput(problems)
    return expression


@dataclass(frozen=True, slots=True)
class _Names:
    """IRIs of local names: of the vocabulary, and of what entries define."""

    vocabulary: Mapping[str, Iterable[str]]
    own: Mapping[str, Iterable[str]]

    def of(self, name: str) -> list[str]:
        if name == local_name(OWL.Thing):  # vocabularies may have things of their own; whoever says no more means all
            return [OWL.Thing]
        return sorted(set(self.vocabulary.get(name) or self.own.get(name, ())))

    def knows(self, iri: str) -> bool:
        name = local_name(iri)
        known = {*self.vocabulary.get(name, ()), *self.own.get(name, ())}
        return not known or iri in known or iri == OWL.Thing


_OF_CLASSES = frozenset(("and", "or", "not"))


def _resolved(
    expression: Expression, names: _Names, problems: list[Diagnostic], *, is_class: bool = True
) -> Expression:
    """Return an expression with known IRIs for names without namespace; appends what is wrong with others."""
    fillers = expression.kind not in ("value", "one of")
    parts = tuple(
        _resolved(part, names, problems, is_class=fillers and (number > 0 or expression.kind in _OF_CLASSES))
        for number, part in enumerate(expression.parts)
    )
    span = _in_text(expression.span)
    term = expression.term
    is_assumed = isinstance(term, str) and term.startswith(KNOWROB) and not names.knows(term)
    if isinstance(term, str) and (is_assumed or term.startswith(_LOCAL)):
        name = local_name(term)  # the reader takes words of the vocabulary for KnowRob's
        meant = names.of(name)
        if len(meant) > 1 and is_class and name not in names.vocabulary:
            return Expression("or", span, parts=tuple(Expression("name", span, iri) for iri in meant))
        if len(meant) != 1:
            problems.append(_unclear(name, meant, names, span))
        return replace(expression, parts=parts, span=span, term=meant[0] if meant else None)
    if isinstance(term, str) and expression.kind == "name" and not names.knows(term):
        problems.append(error("K002", f"nothing here knows <{term}>", span))
    return replace(expression, parts=parts, span=span, term=term)


def _unclear(name: str, meant: list[str], names: _Names, span: Span) -> Diagnostic:
    if meant:
        advice = "write one of " + ", ".join(f"<{iri}>" for iri in meant[:5])
        return error("K002", f"{name} has several meanings", span, advice)
    similar = get_close_matches(name, {**names.own, **names.vocabulary}, n=3)
    guess = f"did you mean {' or '.join(similar)}?" if similar else None
    return error("K002", f"nothing here is called {name}", span, guess)


def _shifted(diagnostic: Diagnostic) -> Diagnostic:
    """Return what the reader of files says, as said of a question: what a file could go on with is no advice here."""
    message = diagnostic.message.replace("the end of the file", "the end")
    advice = _ADVICE if diagnostic.code == "O020" else diagnostic.help
    return replace(diagnostic, message=message, span=_in_text(diagnostic.span or Span(_FILE)), help=advice)


def _in_text(span: Span) -> Span:
    return span._replace(line=max(1, span.line - _LINES_ABOVE))


def names_in(iris: Iterable[str]) -> dict[str, list[str]]:
    """Return the IRIs of each local name."""
    found: dict[str, list[str]] = {}
    for iri in iris:
        found.setdefault(local_name(iri), []).append(iri)
    return found
