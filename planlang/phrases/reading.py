"""Parser from phrases to locations, with diagnostics that say what the grammar expects."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from difflib import SequenceMatcher
from functools import cache
from pathlib import Path

from lark import Lark, Token, Tree, UnexpectedInput, UnexpectedToken

from planlang.designators import Device, Location, Object, Relation
from planlang.diagnostics import BadInput, Diagnostic, Span, error
from planlang.lengths import metres
from planlang.phrases.lexicon import (
    ARTICLES,
    DEEPEST,
    DEVICES,
    GRASP_FORMS,
    KINDS,
    LIMITS,
    LONGEST,
    Lexicon,
    forms,
    opposites,
    pattern,
    plain,
    viewpoints,
)
from planlang.relations import RELATIONS, measured
from planlang.spelling import similar

Explain = Callable[[UnexpectedInput, str, str], Diagnostic]
"""Explains a syntax error of a phrase from a file."""
_COMMENT = re.compile(r"<[^<>\s]*>|\w[\w+.-]*://[^\s<>(),]*|(#[^\n]*)")


def read_location(phrase: str, lexicon: Lexicon | None = None, *, file: str = "phrase") -> Location:
    """Parse a phrase to a location; ``file`` is its origin in diagnostics.

    ``#`` starts a comment until the end of the line. Raises BadInput with all errors found.
    """
    if len(phrase) > LONGEST:
        raise BadInput(
            [error("P003", f"a phrase has at most {LONGEST} characters, this one {len(phrase)}", Span(file))]
        )
    tree = parsed(phrase, parser(), "start", file)
    reader = Reader(lexicon or Lexicon(), file)
    location = reader.location(trees(tree)[0], 1)
    if reader.found:
        raise BadInput(reader.found)
    return location


def read_thing(phrase: str, lexicon: Lexicon | None = None, *, file: str = "phrase") -> Object:
    """Parse a noun with or without article, e.g. "the bottle"; raises BadInput like :func:`read_location`."""
    tree = parsed(phrase[:LONGEST], parser(), "only_thing", file)
    reader = Reader(lexicon or Lexicon(), file)
    thing = reader.thing(trees(tree)[0], tree, named=len(tree.children) == 1)
    if thing is None:
        raise BadInput(reader.found)
    return thing


def parsed(phrase: str, grammar: Lark, start: str, file: str, explain: Explain | None = None) -> Tree[Token]:
    """Parse a phrase; raises BadInput with what ``explain`` makes of a syntax error, by default of a location's."""
    phrase = _COMMENT.sub(lambda found: found[0] if found[1] is None else " " * len(found[0]), phrase)
    try:
        return grammar.parse(phrase, start=start)
    except UnexpectedInput as problem:
        raise BadInput([(explain or explained)(problem, phrase, file)]) from None


def parser(*, states: tuple[str, ...] | None = None) -> Lark:
    """Return the parser for all relations registered so far; given the words of states, that of goals."""
    return _parser(tuple(forms(1)), tuple(forms(2)), tuple(opposites()), states)


@cache
def _parser(
    single: tuple[str, ...], pairs: tuple[str, ...], opposite: tuple[str, ...], states: tuple[str, ...] | None
) -> Lark:
    """Build the parser for these forms of relations to one thing, of relations to two, and of complements."""
    files = ("location.lark",) if states is None else ("location.lark", "goal.lark")
    grammar = "\n".join(Path(__file__).with_name(file).read_text(encoding="utf-8") for file in files)
    tables = {
        "RELATION": tuple(form for form in single if not form.startswith("not ")),
        "PAIR": pairs,
        "OPPOSITE": opposite,
        "LIMIT": tuple(LIMITS),
        "GRASP": tuple(form for some in GRASP_FORMS.values() for form in some),
        "VIEW": viewpoints(),
    }
    if states is not None:
        tables["STATE"] = states
    for name, words in tables.items():  # "in between" begins with "in", which is a relation to one thing
        grammar += f"\n{name}.{6 if name == 'PAIR' else 5}: /(?:{pattern(words)})\\b/i"
    start = ["start", "only_thing"] if states is None else ["goal"]
    return Lark(grammar, parser="lalr", start=start, propagate_positions=True)


class Reader:
    """Converts the tree of a location, and records errors."""

    """Converts parse trees to locations and collects errors."""

    def __init__(self, lexicon: Lexicon, file: str) -> None:
        self.lexicon, self.file = lexicon, file
        self.found: list[Diagnostic] = []

    def wrong(self, code: str, message: str, where: Tree[Token] | Token, help: str | None = None) -> None:
        """Record an error at a word."""
        token = where if isinstance(where, Token) else next(where.scan_values(lambda _: True))
        self.found.append(error(code, message, Span(self.file, token.line or 1, token.column or 1), help))

    def location(self, tree: Tree[Token], depth: int) -> Location:
        """Convert a conjunction."""
        relations: dict[Relation, None] = {}
        device: Device | None = None
        grasp: str | None = None
        for conjunct in trees(tree, "conjunct"):
            clause, *manners = trees(conjunct)
            relation = self.clause(clause, depth)
            if relation is not None:
                relations[relation] = None
            for manner in manners:
                if manner.data == "grasp":
                    said = plain(str(manner.children[0]))
                    one = next(name for name, forms in GRASP_FORMS.items() if said in forms)
                    if grasp not in (None, one):
                        self.wrong("P005", f"one location names two grasps: {grasp} and {one}", manner)
                    grasp = one
                elif manner.data == "view":
                    viewer = self.thing(trees(manner)[-1], manner, named=len(manner.children) == 2)
                    if viewer is not None:
                        view = Relation(forms()[plain(str(manner.children[0]))], (viewer,))
                        relations[view] = None
                else:
                    other = self.device(manner)
                    if device is not None and other not in (None, device):
                        self.wrong("P005", f"one location names two arms: {device} and {other}", manner)
                    device = other or device
        return Location(tuple(relations), None, device, grasp)

    def clause(self, tree: Tree[Token], depth: int) -> Relation | None:
        """Convert a relation with its references."""
        said, *references = trees(tree)
        before = isinstance(tree.children[0], Token)
        relation = self.said(said)
        things = [self.reference(one, depth, said) for one in references]
        known = tuple(one for one in things if one is not None)
        if len(known) < len(things) or relation is None:
            return None
        return replace(relation, references=known, negated=relation.negated != before)

    def said(self, tree: Tree[Token]) -> Relation | None:
        """Convert the words of a relation; its references are placeholders."""
        nothing = (Object("Thing"),)
        match tree.data, tree.children:
            case "relation", [word]:
                name = forms()[plain(str(word))]
                return Relation(name, nothing * RELATIONS[name].arity)
            case "opposite", [word]:
                return Relation(opposites()[plain(str(word))], nothing, negated=True)
            case "near", [_, Token() as length, _]:
                return self._bounded("near", nothing, within=self.length(length))
            case "far", [_, Token() as length, _]:
                return self._bounded("far_from", nothing, beyond=self.length(length))
            case "limited", [limit, Token() as length, _]:
                bound = LIMITS[plain(str(limit))]
                return self._bounded(
                    "near" if bound == "within" else "far_from", nothing, **{bound: self.length(length)}
                )
            case "measured", [Tree() as measure, Token() as word]:
                name = forms()[plain(str(word))]
                bounds = self.measure(measure)
                if not RELATIONS[name].measured:
                    help = f"relations with a distance: {', '.join(RELATIONS[name].forms[0] for name in measured())}"
                    self.wrong("P006", f"{RELATIONS[name].forms[0]!r} has no distance to bound", word, help)
                    return None
                return self._bounded(name, nothing * RELATIONS[name].arity, **bounds)
        raise AssertionError(tree.data)

    def _bounded(self, name: str, what: tuple[Object, ...], **bounds: float | None) -> Relation | None:
        return None if None in bounds.values() else Relation(name, what, bounds.get("within"), bounds.get("beyond"))

    def measure(self, tree: Tree[Token]) -> dict[str, float | None]:
        """Convert a range or limit to bounds."""
        tokens = [token for token in tree.children if isinstance(token, Token)]
        if tree.data == "limit":
            return {LIMITS[plain(tokens[0])]: self.length(tokens[1])}
        least, most = self.length(tokens[0]), self.length(tokens[2])
        if least is not None and most is not None and least > most:
            self.wrong("P004", f"no distance is beyond {tokens[0]} and within {tokens[2]}", tokens[0])
        return {"beyond": least, "within": most}

    def length(self, token: Token) -> float | None:
        """Convert a length to metres."""
        try:
            return metres(str(token))
        except ValueError as problem:
            message, _, help = str(problem).partition("; ")
            self.wrong("P004", message, token, help or None)
            return None

    def reference(self, tree: Tree[Token], depth: int, said: Tree[Token]) -> Object | Location | None:
        """Convert a thing or a nested place; ``said`` is the relation to it."""
        inner = trees(tree)[-1]
        if tree.data == "thing":
            return self.thing(inner, said, named=len(tree.children) == 1)
        if depth >= DEEPEST:
            self.wrong("P003", f"locations are nested more than {DEEPEST} deep", inner)
            return None
        if tree.data == "group":
            return self.location(inner, depth + 1)
        relation = self.clause(inner, depth + 1)
        return None if relation is None else Location((relation,))

    def thing(self, noun: Tree[Token], said: Tree[Token], *, named: bool) -> Object | None:
        """Look up a noun; ``named``: it has no article."""
        words, kind, name, iri = _parts(noun)
        if name is not None:
            if plain(words) not in ("", *KINDS):
                help = f"before a class in brackets: {', '.join(KINDS)}"
                self.wrong("P002", f"{words!r} is not a kind of thing", noun, help)
            return (self.lexicon.thing(name) if iri is None and "/" in name else None) or kind(name, iri)
        meant = self.lexicon.meaning(words, named=named)
        if isinstance(meant, Object):
            return meant if iri is None else replace(meant, iri=iri)
        self.found.append(unknown_noun(words, meant, noun, said, self.lexicon, self.file))
        return None

    def device(self, manner: Tree[Token]) -> Device | None:
        """Convert an arm or hand."""
        noun = trees(manner)[-1]
        words, _, name, iri = _parts(noun)
        if name is not None:
            return Device(name, iri)
        if plain(words) in DEVICES:
            return replace(DEVICES[plain(words)], iri=iri)
        meant = self.lexicon.things.get(words)
        if isinstance(meant, Device):
            return meant
        self.found.append(unknown_device(words, noun, self.file))
        return None


def trees(tree: Tree[Token], data: str | None = None) -> list[Tree[Token]]:
    """Return the subtrees, optionally of one grammar rule."""
    return [part for part in tree.children if isinstance(part, Tree) and data in (None, part.data)]


def _parts(noun: Tree[Token]) -> tuple[str, type[Object], str | None, str | None]:
    """Split a noun into words, kind, class in brackets and IRI."""
    words = " ".join(str(part) for part in noun.children if isinstance(part, Token))
    inside = {str(part.data): str(part.children[-1])[1:-1] for part in noun.children if isinstance(part, Tree)}
    return words, KINDS.get(plain(words), Object), inside.get("exact"), inside.get("called")


_MOST = 24
"""Maximum number of nouns in a message."""
_ALIKE = 0.7
_GOES_ON = ("AND", "BUT", "COMMA", "WITH", "GRASP", "RPAR", "$END")
"""Terminals that may follow a noun."""
SPOKEN: Mapping[str, str] = {
    **dict.fromkeys(("NOT", "RELATION", "PAIR", "OPPOSITE", "LIMIT", "WITHIN", "BEYOND"), "a relation"),
    "LENGTH": "a length",
    **dict.fromkeys(("ARTICLE", "WORD"), "a thing"),
    **dict.fromkeys(("A_PLACE", "LPAR"), "a place"),
    **dict.fromkeys(("AND", "BUT", "COMMA"), "'and'"),
    **dict.fromkeys(("WITH", "GRASP"), "'with'"),
    "OF": "'of'",
    "FROM": "'from'",
    "TO": "'to'",
    "VIEW": "'seen from'",
    "CALLED": "'called'",
    "EXACT": "a name in <...>",
    "RPAR": "')'",
    "$END": "the end",
}
"""Terminals of the grammar in the words of messages, in the order of listing."""


def explained(problem: UnexpectedInput, phrase: str, file: str) -> Diagnostic:
    """Explain a syntax error."""
    offset = problem.pos_in_stream if problem.pos_in_stream is not None else len(phrase)
    at_end = (isinstance(problem, UnexpectedToken) and problem.token.type == "$END") or not phrase[offset:].strip()
    if at_end:
        offset = len(phrase.rstrip())
    span = span_at(phrase, offset, file)
    expected = expected_by(problem, phrase[:offset])
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
        alike = similar(plain(said), forms(), least=_ALIKE)
        if alike and alike[0] != plain(said) and plain(said) not in opposites():
            return _unknown_relation(said, alike[0], span_at(phrase, begun, file))
    found = "the phrase ends" if at_end else f"unexpected {phrase[offset:].split()[0]!r}"
    is_arm = re.search(rf"\bwith(\s+({'|'.join(ARTICLES)}))?\s*$", phrase[:offset], re.IGNORECASE) is not None
    wanted = "an arm" if is_arm and "WORD" in expected else spoken(expected)
    return error("P003", f"{found} where {wanted} is expected", span, _ADVICE.get(wanted))


def unknown_noun(
    words: str, several: Sequence[str], noun: Tree[Token], said: Tree[Token], lexicon: Lexicon, file: str
) -> Diagnostic:
    """Explain an unknown or ambiguous noun; ``said`` is the relation to it."""
    span = span_of(noun, file)
    if several:
        return error("P007", f"{words!r} could mean several classes", span, f"say which: {', '.join(several)}")
    relation = " ".join(str(token) for token in said.scan_values(lambda _: True))
    parts = words.split()
    for number in range(1, len(parts)):
        whole = f"{relation} {' '.join(parts[:number])}"
        alike = similar(plain(whole), forms(), least=0.8)
        if alike and alike[0] != plain(relation):
            return _unknown_relation(whole, alike[0], span_of(said, file))
    inner = next((form for form in forms() if f" {form} " in f" {plain(words)} "), None)
    known = list(lexicon.known())
    listed = ", ".join(known[:_MOST]) + (f" and {len(known) - _MOST} more" if len(known) > _MOST else "")
    guess = lexicon.similar(words)
    if inner is not None:
        help = f"join relations with 'and': ... and {inner} ..."
    elif guess is not None:
        help = f"did you mean {guess!r}? there are: {listed}"
    else:
        help = f"there are: {listed}" if known else "write a class in brackets: the <DrinkingBottle>"
    return error("P002", f"unknown thing {words!r}", span, help)


def unknown_device(words: str, noun: Tree[Token], file: str) -> Diagnostic:
    """Explain a noun after "with" that is not an arm."""
    close = similar(plain(words), DEVICES, least=_ALIKE)
    guess = f"did you mean {close[0]!r}? " if close else ""
    return error(
        "P002", f"{words!r} is not an arm of a robot", span_of(noun, file), f"{guess}arms: {', '.join(DEVICES)}"
    )


def _unknown_relation(said: str, guess: str | None, span: Span) -> Diagnostic:
    help = f"did you mean {guess!r}? {_relations()}" if guess else _relations()
    return error("P001", f"unknown relation {said!r}", span, help)


def _clause_before(phrase: str, offset: int) -> int | None:
    """Find the start of the clause that is incomplete at an offset; None if it is empty."""
    start = 0
    for match in re.finditer(r"(?:\b(?:and|but|not|a\s+place)\b|[,(])\s*", phrase[:offset], re.IGNORECASE):
        start = match.end()
    start += len(phrase[start:offset]) - len(phrase[start:offset].lstrip())
    return start if phrase[start:offset].strip() else None


def span_of(tree: Tree[Token], file: str) -> Span:
    """Say where the first word of a tree is."""
    token = next(tree.scan_values(lambda _: True))
    return Span(file, token.line or 1, token.column or 1)


def _most_similar(words: Sequence[str]) -> tuple[str, str | None]:
    """Split off the words in the place of a relation, and find the most similar form."""
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


def expected_by(problem: UnexpectedInput, before: str) -> set[str]:
    """Return the terminals that the grammar accepts after the text ``before``."""
    if isinstance(problem, UnexpectedToken):
        return set(problem.accepts or problem.expected)
    allowed = set(getattr(problem, "allowed", None) or ())
    if "RPAR" in allowed:  # the lexer neither knows the end of input nor counts parentheses
        bare = re.sub("<[^<>]*>", "", before)
        allowed = allowed if bare.count("(") > bare.count(")") else allowed - {"RPAR"} | {"$END"}
    return allowed


def spoken(expected: set[str], words_of: Mapping[str, str] = SPOKEN) -> str:
    """Say which terminals are expected, in the words of messages."""
    if "WORD" in expected:
        expected = expected - {"EXACT", "CALLED"}
    if expected & {*_GOES_ON}:
        expected = expected & {*_GOES_ON}
    *others, last = dict.fromkeys(words for name, words in words_of.items() if name in expected)
    return f"{', '.join(others)} or {last}" if others else last


_THING = "for example: in reach of the patient; above a place on the table"
_ADVICE = {
    "a thing": "for example: the bottle",
    "a thing or a place": _THING,
    "a place": _THING,
    "a length": "for example: within 30 cm of the door",
    "an arm": "for example: with the right arm",
    "'and'": "for example: between the bed and the table",
    "'to'": "for example: 30 cm to 1 m left of the bed; at most 1 m left of the bed",
    "a name in <...>": (
        "write names and IRIs after 'called' in brackets: the person called <patient1>; for a thing of the map its "
        "name is enough: in reach of patient1"
    ),
}


def span_at(phrase: str, offset: int, file: str) -> Span:
    """Say where a character of a phrase is."""
    before = phrase[:offset]
    line = before.count("\n") + 1
    return Span(file, line, offset - (before.rfind("\n") + 1) + 1)
