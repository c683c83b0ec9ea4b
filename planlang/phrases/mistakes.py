"""What is said about a phrase that cannot be understood: where, what is there, what could be there."""

from __future__ import annotations

import re
from collections.abc import Sequence
from difflib import SequenceMatcher, get_close_matches

from lark import Token, Tree, UnexpectedInput, UnexpectedToken

from planlang.diagnostics import Diagnostic, Span, error
from planlang.phrases.lexicon import DEVICES, Lexicon
from planlang.phrases.words import FORMS, RELATION_OF, plain

_MOST = 24
"""Nouns that are listed at most."""
_ALIKE = 0.7
_JOIN = ("AND", "BUT", "COMMA", "$END")


def explain(problem: UnexpectedInput, phrase: str, file: str) -> Diagnostic:
    """The diagnostic for a place at which the grammar does not go on."""
    offset = problem.pos_in_stream if problem.pos_in_stream is not None else len(phrase)
    at_end = (isinstance(problem, UnexpectedToken) and problem.token.type == "$END") or not phrase[offset:].strip()
    if at_end:
        offset = len(phrase.rstrip())
    span = _span(phrase, offset, file)
    expected = set(getattr(problem, "accepts", None) or getattr(problem, "allowed", None) or ())
    expected |= set(getattr(problem, "expected", None) or ())
    if "RELATION" in expected:
        if at_end:
            return error("P003", "the phrase ends where a relation is expected", span, _relations())
        words = phrase[offset:].split()
        if words[0].startswith(("(", ")")):
            return error("P003", f"unexpected {words[0][0]!r} where a relation is expected", span, _relations())
        said, guess = _most_similar(words)
        return _unknown_relation(said, guess, span)
    begun = _clause_before(phrase, offset)
    if begun is not None and "WORD" in expected:
        said = phrase[begun:offset].strip()
        alike = get_close_matches(plain(said), list(RELATION_OF), n=1, cutoff=_ALIKE)
        if alike and alike[0] != plain(said):
            return _unknown_relation(said, alike[0], _span(phrase, begun, file))
    found = "the phrase ends" if at_end else f"unexpected {phrase[offset:].split()[0]!r}"
    return error("P003", f"{found} where {_spoken(expected)} is expected", span, _advice(expected))


def unknown_noun(
    words: str, several: Sequence[str], noun: Tree[Token], said: Tree[Token], lexicon: Lexicon, file: str
) -> Diagnostic:
    """The diagnostic for a noun that means nothing, or not one thing only; ``said`` is the relation to it."""
    span = _at(noun, file)
    if several:
        return error("P007", f"{words!r} could mean several classes", span, f"say which: {', '.join(several)}")
    relation = " ".join(str(token) for token in said.scan_values(lambda _: True))
    parts = words.split()
    for number in range(1, len(parts)):
        whole = f"{relation} {' '.join(parts[:number])}"
        alike = get_close_matches(plain(whole), list(RELATION_OF), n=1, cutoff=0.8)
        if alike:
            return _unknown_relation(whole, alike[0], _at(said, file))
    inner = next((form for form in RELATION_OF if f" {form} " in f" {plain(words)} "), None)
    known = list(lexicon.known())
    listed = ", ".join(known[:_MOST]) + (f" and {len(known) - _MOST} more" if len(known) > _MOST else "")
    guess = lexicon.similar(words)
    if inner is not None:
        help = f"relations are joined by 'and': ... and {inner} ..."
    elif guess is not None:
        help = f"did you mean {guess!r}? there are: {listed}"
    else:
        help = f"there are: {listed}" if known else "write a class in brackets: the <DrinkingBottle>"
    return error("P002", f"unknown thing {words!r}", span, help)


def unknown_device(words: str, noun: Tree[Token], file: str) -> Diagnostic:
    """The diagnostic for something that nothing can be reached with."""
    close = get_close_matches(plain(words), list(DEVICES), n=1, cutoff=_ALIKE)
    guess = f"did you mean {close[0]!r}? " if close else ""
    return error("P002", f"nothing reaches with {words!r}", _at(noun, file), f"{guess}what does: {', '.join(DEVICES)}")


def _unknown_relation(said: str, guess: str | None, span: Span) -> Diagnostic:
    help = f"did you mean {guess!r}? {_relations()}" if guess else _relations()
    return error("P001", f"unknown relation {said!r}", span, help)


def _clause_before(phrase: str, offset: int) -> int | None:
    """Where the clause begins that is broken off at an offset; None if nothing of it is there."""
    start = 0
    for match in re.finditer(r"(?:\b(?:and|but|not|a\s+place)\b|[,(])\s*", phrase[:offset], re.IGNORECASE):
        start = match.end()
    start += len(phrase[start:offset]) - len(phrase[start:offset].lstrip())
    return start if phrase[start:offset].strip() else None


def _at(tree: Tree[Token], file: str) -> Span:
    token = next(tree.scan_values(lambda _: True))
    return Span(file, token.line or 1, token.column or 1)


def _most_similar(words: Sequence[str]) -> tuple[str, str | None]:
    """The words that stand for a relation, and the form that looks most like them."""
    best: tuple[float, str, str | None] = (_ALIKE, words[0], None)
    for number in range(1, min(5, len(words) + 1)):
        said = plain(" ".join(words[:number]))
        for form in RELATION_OF:
            alike = SequenceMatcher(None, said, form).ratio()
            if alike > best[0]:
                best = (alike, " ".join(words[:number]), form)
    if best[2] is None:
        until = next((i for i, word in enumerate(words) if i and word.lower() in ("the", "a", "an")), 1)
        return " ".join(words[:until]), None
    return best[1], best[2]


def _relations() -> str:
    return f"relations: {', '.join(forms[0] for forms in FORMS.values())}; within 30 cm of; not ..."


def _spoken(expected: set[str]) -> str:
    if expected & {"WORD", "ARTICLE"}:
        return "a thing or a place"
    if "LENGTH" in expected:
        return "a length"
    if expected & set(_JOIN):
        return "'and', 'with' or the end"
    words = sorted(name.lower().replace("_", " ") for name in expected if name.isupper())
    return " or ".join(f"'{word}'" for word in words) or "something else"


def _advice(expected: set[str]) -> str | None:
    if expected & {"WORD", "ARTICLE"}:
        return "for example: in reach of the patient; above a place on the table"
    if "LENGTH" in expected:
        return "for example: within 30 cm of the door"
    return None


def _span(phrase: str, offset: int, file: str) -> Span:
    before = phrase[:offset]
    line = before.count("\n") + 1
    return Span(file, line, offset - (before.rfind("\n") + 1) + 1)
