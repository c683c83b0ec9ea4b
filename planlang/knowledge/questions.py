"""Parser of search expressions: class expressions in Manchester syntax, with unambiguous names unprefixed."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace

from planlang.designators import local_name
from planlang.diagnostics import BadInput, Diagnostic, Span, error
from planlang.knowledge.names import Names
from planlang.ontology.canonical import CannotSay, Graph
from planlang.ontology.expression_text import Expressions
from planlang.ontology.expressions import Expression
from planlang.ontology.manchester import read_manchester
from planlang.ontology.terms import KNOWROB, OWL, UPPER, VOCABULARIES

LONGEST = 10_000
"""Longest expression [characters]."""
MOST_UNKNOWN, MOST_GUESSES = 10, 3
"""Limits for the unknown names reported, and for those with suggestions."""
LONGEST_SHOWN = 100
"""Characters of an unknown name shown in a message."""

_FILE = "question"
_PREFIXES = {**VOCABULARIES, **dict(zip(("soma", "dul"), UPPER, strict=True))}
_HEAD = "".join(f"Prefix: {prefix}: <{start}>\n" for prefix, start in _PREFIXES.items())
_FRAME = f"Ontology: <urn:{_FILE}>\nClass: <urn:{_FILE}> EquivalentTo:\n"
_LINES_ABOVE = (_HEAD + _FRAME).count("\n")
_LOCAL = f"urn:{_FILE}#"
_EXAMPLE = "ServingFoodOrDrink and objectActedOn some DrinkingBottle"
_ADVICE = f"a question is a class expression, such as {_EXAMPLE}; a label is searched for words"
_SEVERAL = re.compile(r":(?=\s|$)")


def read_question(text: str, names: Names) -> Expression:
    """Parse an expression and resolve its names to IRIs; positions refer to the text.

    Raises BadInput: K002 for an unknown or ambiguous name, K003 unless it is a single expression, and the errors of the
    Manchester parser.
    """
    return with_names(parse_question(text), names)


def with_names(expression: Expression, names: Names) -> Expression:
    """Resolve the names of a parsed expression to IRIs. Raises BadInput with K002."""
    problems: list[Diagnostic] = []
    expression = _resolved(expression, names, problems)
    if problems:
        left_out = len(problems) - MOST_UNKNOWN
        more = [error("K002", f"and {left_out} more names", Span(_FILE))] if left_out > 0 else []
        raise BadInput([*problems[:MOST_UNKNOWN], *more])
    return expression


def parse_question(text: str) -> Expression:
    """Parse an expression, with names as written. Raises BadInput."""
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
        expression = Expressions(graph).of(stated)
    except (CannotSay, ValueError) as problem:
        raise BadInput([error("K003", f"this is no question: {problem}", Span(_FILE), _ADVICE)]) from None
    return expression


_OF_CLASSES = frozenset(("and", "or", "not"))


def _resolved(expression: Expression, names: Names, problems: list[Diagnostic], *, is_class: bool = True) -> Expression:
    """Resolve unprefixed names to known IRIs; append errors for the others to ``problems``."""
    fillers = expression.kind not in ("value", "one of")
    parts = tuple(
        _resolved(part, names, problems, is_class=fillers and (number > 0 or expression.kind in _OF_CLASSES))
        for number, part in enumerate(expression.parts)
    )
    span = _in_text(expression.span)
    term = expression.term
    is_assumed = isinstance(term, str) and term.startswith(KNOWROB) and not names.knows(term)
    if isinstance(term, str) and (is_assumed or term.startswith(_LOCAL)):
        name = local_name(term)  # the Manchester parser puts words of the vocabulary in KnowRob's namespace
        meant = names.of(name)
        if len(meant) > 1 and is_class and names.is_of_entries(name):
            return Expression("or", span, parts=tuple(Expression("name", span, iri) for iri in meant))
        if len(meant) != 1:
            guessed = names if len(problems) < MOST_GUESSES else None
            problems.append(_ambiguous(name, meant, span) if meant else _unknown(name, guessed, span))
        return replace(expression, parts=parts, span=span, term=meant[0] if meant else None)
    if isinstance(term, str) and expression.kind == "name" and not names.knows(term):
        problems.append(error("K002", f"unknown name <{term}>", span))
    return replace(expression, parts=parts, span=span, term=term)


def _ambiguous(name: str, meant: Sequence[str], span: Span) -> Diagnostic:
    advice = "write one of " + ", ".join(f"<{iri}>" for iri in meant[:5])
    return error("K002", f"{name} has several meanings", span, advice)


def _unknown(name: str, names: Names | None, span: Span) -> Diagnostic:
    """Error for a name that none of ``names`` is; None: no similar one is looked for."""
    similar = [] if names is None else names.similar(name)
    guess = f"did you mean {' or '.join(similar)}?" if similar else None
    shown = name if len(name) <= LONGEST_SHOWN else f"{name[:LONGEST_SHOWN]}..."
    return error("K002", f"unknown name {shown}", span, guess)


def _shifted(diagnostic: Diagnostic) -> Diagnostic:
    """Adapt a diagnostic of the file parser to an expression: advice on what a file may contain does not apply."""
    message = diagnostic.message.replace("the end of the file", "the end")
    advice = _ADVICE if diagnostic.code == "O020" else diagnostic.help
    return replace(diagnostic, message=message, span=_in_text(diagnostic.span or Span(_FILE)), help=advice)


def _in_text(span: Span) -> Span:
    return span._replace(line=max(1, span.line - _LINES_ABOVE))
