"""Diagnostics of phrases: where a phrase cannot be read, what is there, and what could be there."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from difflib import SequenceMatcher, get_close_matches

from lark import Token, Tree, UnexpectedInput, UnexpectedToken

from planlang.diagnostics import Diagnostic, Span, error
from planlang.phrases.lexicon import ARTICLES, DEVICES, Lexicon, forms, opposites, plain
from planlang.relations import RELATIONS

_MOST = 24
"""Nouns that are listed at most."""
_ALIKE = 0.7
_GOES_ON = ("AND", "BUT", "COMMA", "WITH", "GRASP", "RPAR", "$END")
"""What may follow where a noun may have ended."""
SPOKEN: Mapping[str, str] = {
    **dict.fromkeys(("NOT", "RELATION", "OPPOSITE", "LIMIT", "WITHIN", "BEYOND"), "a relation"),
    "LENGTH": "a length",
    **dict.fromkeys(("ARTICLE", "WORD"), "a thing"),
    **dict.fromkeys(("A_PLACE", "LPAR"), "a place"),
    **dict.fromkeys(("AND", "BUT", "COMMA"), "'and'"),
    **dict.fromkeys(("WITH", "GRASP"), "'with'"),
    "OF": "'of'",
    "FROM": "'from'",
    "TO": "'to'",
    "CALLED": "'called'",
    "EXACT": "a name in <...>",
    "RPAR": "')'",
    "$END": "the end",
}
"""Terminal of the grammar -> what it is to whoever writes a phrase, in the order in which they are listed."""


def explain(problem: UnexpectedInput, phrase: str, file: str) -> Diagnostic:
    """Return the diagnostic for a place at which the grammar does not go on."""
    offset = problem.pos_in_stream if problem.pos_in_stream is not None else len(phrase)
    at_end = (isinstance(problem, UnexpectedToken) and problem.token.type == "$END") or not phrase[offset:].strip()
    if at_end:
        offset = len(phrase.rstrip())
    span = _span(phrase, offset, file)
    expected = _expected(problem, phrase[:offset])
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
        said = re.sub(rf"\s+({'|'.join(ARTICLES)})$", "", phrase[begun:offset].strip(), flags=re.IGNORECASE)
        alike = get_close_matches(plain(said), list(forms()), n=1, cutoff=_ALIKE)
        if alike and alike[0] != plain(said) and plain(said) not in opposites():
            return _unknown_relation(said, alike[0], _span(phrase, begun, file))
    found = "the phrase ends" if at_end else f"unexpected {phrase[offset:].split()[0]!r}"
    is_arm = re.search(rf"\bwith(\s+({'|'.join(ARTICLES)}))?\s*$", phrase[:offset], re.IGNORECASE) is not None
    wanted = "an arm" if is_arm and "WORD" in expected else _spoken(expected)
    return error("P003", f"{found} where {wanted} is expected", span, _ADVICE.get(wanted))


def unknown_noun(
    words: str, several: Sequence[str], noun: Tree[Token], said: Tree[Token], lexicon: Lexicon, file: str
) -> Diagnostic:
    """Return the diagnostic for a noun that means nothing, or not one thing only; ``said`` is the relation to it."""
    span = _at(noun, file)
    if several:
        return error("P007", f"{words!r} could mean several classes", span, f"say which: {', '.join(several)}")
    relation = " ".join(str(token) for token in said.scan_values(lambda _: True))
    parts = words.split()
    for number in range(1, len(parts)):
        whole = f"{relation} {' '.join(parts[:number])}"
        alike = get_close_matches(plain(whole), list(forms()), n=1, cutoff=0.8)
        if alike:
            return _unknown_relation(whole, alike[0], _at(said, file))
    inner = next((form for form in forms() if f" {form} " in f" {plain(words)} "), None)
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
    """Return the diagnostic for something that nothing can be reached with."""
    close = get_close_matches(plain(words), list(DEVICES), n=1, cutoff=_ALIKE)
    guess = f"did you mean {close[0]!r}? " if close else ""
    return error("P002", f"{words!r} is no arm of a robot", _at(noun, file), f"{guess}arms: {', '.join(DEVICES)}")


def _unknown_relation(said: str, guess: str | None, span: Span) -> Diagnostic:
    help = f"did you mean {guess!r}? {_relations()}" if guess else _relations()
    return error("P001", f"unknown relation {said!r}", span, help)


def _clause_before(phrase: str, offset: int) -> int | None:
    """Return where the clause begins that is broken off at an offset; None if nothing of it is there."""
    start = 0
    for match in re.finditer(r"(?:\b(?:and|but|not|a\s+place)\b|[,(])\s*", phrase[:offset], re.IGNORECASE):
        start = match.end()
    start += len(phrase[start:offset]) - len(phrase[start:offset].lstrip())
    return start if phrase[start:offset].strip() else None


def _at(tree: Tree[Token], file: str) -> Span:
    token = next(tree.scan_values(lambda _: True))
    return Span(file, token.line or 1, token.column or 1)


def _most_similar(words: Sequence[str]) -> tuple[str, str | None]:
    """Return the words that stand for a relation, and the form that looks most like them."""
    best: tuple[float, str, str | None] = (_ALIKE, words[0], None)
    for number in range(1, min(5, len(words) + 1)):
        said = plain(" ".join(words[:number]))
        for form in forms():
            alike = SequenceMatcher(None, said, form).ratio()
            if alike > best[0]:
                best = (alike, " ".join(words[:number]), form)
    if best[2] is None:
        until = next((i for i, word in enumerate(words) if i and word.lower() in ("the", "a", "an")), 1)
        return " ".join(words[:until]), None
    return best[1], best[2]


def _relations() -> str:
    return f"relations: {', '.join(relation.forms[0] for relation in RELATIONS.values())}; within 30 cm of; not ..."


def _expected(problem: UnexpectedInput, before: str) -> set[str]:
    """Return the terminals that could stand there, ``before`` being what is read already."""
    if isinstance(problem, UnexpectedToken):
        return set(problem.accepts or problem.expected)
    allowed = set(getattr(problem, "allowed", None) or ())
    if "RPAR" in allowed:  # what the lexer knows of: it has no end, and does not count parentheses
        bare = re.sub("<[^<>]*>", "", before)
        allowed = allowed if bare.count("(") > bare.count(")") else allowed - {"RPAR"} | {"$END"}
    return allowed


def _spoken(expected: set[str]) -> str:
    if "WORD" in expected:
        expected = expected - {"EXACT", "CALLED"}
    if expected & {*_GOES_ON}:
        expected = expected & {*_GOES_ON}
    *others, last = dict.fromkeys(words for name, words in SPOKEN.items() if name in expected)
    return f"{', '.join(others)} or {last}" if others else last


_THING = "for example: in reach of the patient; above a place on the table"
_ADVICE = {
    "a thing": "for example: the bottle",
    "a thing or a place": _THING,
    "a place": _THING,
    "a length": "for example: within 30 cm of the door",
    "an arm": "for example: with the right arm",
    "'to'": "for example: 30 cm to 1 m left of the bed; at most 1 m left of the bed",
    "a name in <...>": (
        "names stand in brackets, whole IRIs too: the person called <patient1>; without 'called' a thing of the map is "
        "told by its name alone: in reach of patient1"
    ),
}


def _span(phrase: str, offset: int, file: str) -> Span:
    before = phrase[:offset]
    line = before.count("\n") + 1
    return Span(file, line, offset - (before.rfind("\n") + 1) + 1)
