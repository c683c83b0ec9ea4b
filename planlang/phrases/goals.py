"""Parser from phrases to goals, such as "bottle1 held by patient1" or "at least 2 Cup on table1"."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from difflib import SequenceMatcher
from functools import partial

from lark import Token, Tree, UnexpectedInput, UnexpectedToken

from planlang.designators import Object
from planlang.diagnostics import BadInput, Diagnostic, error
from planlang.goals import CLOSED, EMPTY, OFF, ON, OPEN, At, Exists, Fact, Goal, HeldBy, Holds, InState, Number
from planlang.phrases.lexicon import LIMITS, LONGEST, Lexicon, forms, plain
from planlang.phrases.reading import SPOKEN, Reader, expected_by, explained, parsed, parser, span_at, spoken, trees
from planlang.volumes import millilitres

ROBOT = "robot"
"""The noun for the robot, unless the map has a thing of this name."""
STATES: Mapping[str, str] = {
    **dict.fromkeys(("open", "opened"), OPEN),
    **dict.fromkeys(("closed", "shut"), CLOSED),
    **dict.fromkeys(("switched on", "turned on"), ON),
    **dict.fromkeys(("switched off", "turned off", "off"), OFF),
    "empty": EMPTY,
}
"""Words of the states that each world has; "on" is a relation, and a state if no thing follows it."""
VERBS = ("held by", "contains", "exists")
"""Words that join a subject to what has to hold, beside states and relations."""
EXAMPLES = (
    "bottle1 held by patient1; cabinet1 closed; 3 Cup on table1; stove1 switched on; cup1 contains 120 ml of Water; "
    "robot in kitchen1"
)
"""Goals that show each kind."""
_SYNONYMS = ("opened", "shut", "turned on", "turned off", "off")
_NUMBERS = ("one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten")
_STRICT = {"more than": 1, "less than": -1}
_SPOKEN = {
    **SPOKEN,
    **dict.fromkeys(("NUMBER", "EVERY", "NO"), "a number"),
    "BY": "'by'",
    "VOLUME": "an amount",
}
_ALIKE = 0.7


def read_goal(
    phrase: str, lexicon: Lexicon | None = None, states: Mapping[str, str] | None = None, *, file: str = "goal"
) -> Goal:
    """Parse a goal; ``file`` is its origin in diagnostics, ``states`` maps further words to states (IRIs).

    Raises BadInput with all errors found.
    """
    if len(phrase) > LONGEST:
        raise BadInput([error("P003", f"a goal has at most {LONGEST} characters, this one {len(phrase)}")])
    known = {**STATES, **{plain(word): state for word, state in (states or {}).items()}}
    tree = parsed(phrase, parser(states=tuple(known)), "goal", file, partial(_explained, states=known))
    reader = _GoalReader(lexicon or Lexicon(), file, known)
    goal = reader.goal(tree, plain_text(phrase))
    if reader.found or goal is None:
        raise BadInput(reader.found)
    return goal


def plain_text(phrase: str) -> str:
    """Return a phrase with single spaces, as results state it."""
    return " ".join(phrase.split())


class _GoalReader(Reader):
    """Converts the tree of a goal, and records errors."""

    def __init__(self, lexicon: Lexicon, file: str, states: Mapping[str, str]) -> None:
        super().__init__(lexicon, file)
        self._states = states

    def goal(self, tree: Tree[Token], text: str) -> Goal | None:
        """Convert a goal; None after an error."""
        said, fact = trees(tree)
        noun = trees(said)[-1]
        number = self._number(said)
        subject: Object | None = None
        is_robot = said.data == "one" and self._is_robot(noun)
        if not is_robot:
            is_named = said.data == "one" and len(said.children) == 1
            subject = self._several(noun, said) if said.data != "one" else self._subject(noun, said, named=is_named)
            if subject is not None and subject.iri is not None and said.data != "one":
                name = " ".join(str(one) for one in noun.children)
                self.wrong("P012", f"{name} is one thing, and cannot be counted", noun, "count the things of a class")
        what = self._fact(fact, subject, is_robot=is_robot)
        if what is None or (subject is None and not is_robot):
            return None
        return Goal(text, subject, what, number)

    def _is_robot(self, noun: Tree[Token]) -> bool:
        words = " ".join(str(part) for part in noun.children if isinstance(part, Token))
        return plain(words) == ROBOT and self.lexicon.thing(ROBOT) is None

    def _subject(self, noun: Tree[Token], said: Tree[Token], *, named: bool) -> Object | None:
        """Look up the thing that the goal is about; an unknown word after it was meant as what has to hold."""
        words = [part for part in noun.children if isinstance(part, Token)]
        for number in range(1, len(words)):
            before, rest = (" ".join(map(str, some)) for some in (words[:number], words[number:]))
            if not self.lexicon.meaning(" ".join(map(str, words)), named=named) and self.lexicon.thing(before):
                help = f"after a thing: {', '.join(VERBS)}, a state, or a relation: {EXAMPLES}"
                self.wrong("P001", f"{rest!r} is neither a state nor a relation", words[number], help)
                return None
        return self.thing(noun, said, named=named)

    def _several(self, noun: Tree[Token], said: Tree[Token]) -> Object | None:
        """Look up the class of counted things, also in the plural."""
        words = [part for part in noun.children if isinstance(part, Token)]
        if words and str(words[-1]).endswith("s") and len(words) == len(noun.children):
            whole = " ".join(map(str, words))
            if not self.lexicon.meaning(whole, named=False) and self.lexicon.meaning(whole[:-1], named=False):
                one = Token(words[-1].type, words[-1][:-1])
                one.line, one.column = words[-1].line, words[-1].column
                noun = Tree(noun.data, [*words[:-1], one])
        return self.thing(noun, said, named=True)

    def _number(self, said: Tree[Token]) -> Number:
        if said.data == "every":
            return Number(0, every=True)
        if said.data == "none":
            return Number(0, 0)
        if said.data != "counted":
            return Number()
        *limit, figure = (str(one) for one in said.children if isinstance(one, Token))
        count = _NUMBERS.index(figure.lower()) + 1 if figure.lower() in _NUMBERS else int(figure)
        if not limit:
            return Number(count, count)
        words = plain(limit[0])
        count += _STRICT.get(words, 0)
        if count < 0:
            self.wrong("P012", f"no number is {words} 0", said)
        return Number(count) if LIMITS[words] == "beyond" else Number(0, count)

    def _fact(self, tree: Tree[Token], subject: Object | None, *, is_robot: bool) -> Fact | None:
        """Convert what has to hold; None after an error."""
        negated = any(isinstance(one, Token) and one.type == "NOT" for one in tree.children)
        match tree.data:
            case "held":
                return self._held(tree, negated=negated)
            case "at":
                location = self.location(trees(tree)[0], 1)
                if location.device is not None or location.grasp is not None:
                    self.wrong("P012", "arms and grasps are no part of a goal", tree, "leave them out")
                return None if self.found else At(location)
            case "state":
                return self._state(
                    next(one for one in tree.children if isinstance(one, Token) and one.type != "NOT"), negated
                )
            case "contains":
                return self._contents(trees(tree)[0])
        return Exists(negated)

    def _held(self, tree: Tree[Token], *, negated: bool) -> HeldBy | None:
        noun = trees(tree)[-1]
        if self._is_robot(noun):
            return HeldBy(None, negated)
        has_article = any(isinstance(one, Token) and one.type == "ARTICLE" for one in tree.children)
        holder = self.thing(noun, tree, named=not has_article)
        return None if holder is None else HeldBy(holder, negated)

    def _state(self, word: Token, negated: bool) -> InState | None:
        said = plain(str(word))
        if word.type == "RELATION":
            if forms()[said] != "on":
                self.wrong("P003", f"the goal ends where a thing is expected after {said!r}", word)
                return None
            return InState(ON, negated)
        return InState(self._states[said], negated)

    def _contents(self, tree: Tree[Token]) -> Holds | None:
        noun = next(iter(trees(tree)), None)
        has_article = any(isinstance(one, Token) and one.type == "ARTICLE" for one in tree.children)
        substance = None if noun is None else self.thing(noun, tree, named=not has_article)
        if noun is not None and substance is None:
            return None
        if tree.data == "some":
            return Holds(substance)
        tokens = {one.type: one for one in tree.children if isinstance(one, Token)}
        try:
            amount = millilitres(str(tokens["VOLUME"]))
        except ValueError as problem:
            message, _, help = str(problem).partition("; ")
            self.wrong("P004", message, tokens["VOLUME"], help or None)
            return None
        if (limit := tokens.get("LIMIT")) is None:
            return Holds(substance, amount, amount)
        return Holds(substance, amount) if LIMITS[plain(str(limit))] == "beyond" else Holds(substance, 0.0, amount)


def _explained(problem: UnexpectedInput, phrase: str, file: str, *, states: Iterable[str]) -> Diagnostic:
    """Explain a syntax error of a goal."""
    offset = problem.pos_in_stream if problem.pos_in_stream is not None else len(phrase)
    is_end = isinstance(problem, UnexpectedToken) and problem.token.type == "$END"
    if is_end or not phrase[offset:].strip():
        is_end, offset = True, len(phrase.rstrip())
    expected = expected_by(problem, phrase[:offset])
    span = span_at(phrase, offset, file)
    if not phrase.strip():
        return error("P003", "the goal is empty", None, f"for example: {EXAMPLES}")
    if "STATE" in expected:
        return _without_fact(phrase, offset, file, tuple(states))
    if "RELATION" in expected and re.search(r"\b(?:and|but)\s*$|,\s*$", phrase[:offset], re.IGNORECASE):
        found = explained(problem, phrase, file)
        return replace(found, help=f"{found.help}; another goal is stated by itself" if found.help else None)
    if "RELATION" in expected or expected & {"CALLED", "LENGTH"}:
        return explained(problem, phrase, file)
    found_words = "the goal ends" if is_end else f"unexpected {phrase[offset:].split()[0]!r}"
    message = f"{found_words} where {spoken(expected, _SPOKEN)} is expected"
    return error("P003", message, span, f"for example: {EXAMPLES}")


def _without_fact(phrase: str, offset: int, file: str, states: Sequence[str]) -> Diagnostic:
    """Explain a goal that says nowhere what has to hold, and name what is most like its words."""
    words = list(re.finditer(r"\S+", phrase))
    best: tuple[float, str, str, int] = (_ALIKE, "", "", 0)
    for begin in range(1, len(words)):
        for end in range(begin, min(begin + 3, len(words))):
            said = phrase[words[begin].start() : words[end].end()]
            for form in (*states, *VERBS, *forms()):
                alike = SequenceMatcher(None, plain(said), form).ratio()
                if best[0] < alike < 1.0:
                    best = (alike, said, form, words[begin].start())
    known = [word for word in states if word not in _SYNONYMS]
    valid = f"states: {', '.join(known)}; also: {', '.join(VERBS)}, and relations such as on, in, near"
    help = f"{valid}; for example: {EXAMPLES}"
    if best[1]:
        message, help = f"unknown words {best[1]!r}", f"did you mean {best[2]!r}? {valid}"
        return error("P001", message, span_at(phrase, best[3], file), help)
    if phrase[offset:].strip():
        said = phrase[offset:].split()[0]
        return error("P001", f"{said!r} is neither a state nor a relation", span_at(phrase, offset, file), help)
    return error("P003", "the goal does not say what has to hold", span_at(phrase, offset, file), help)
