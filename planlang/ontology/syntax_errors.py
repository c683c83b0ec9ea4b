"""What a parser says about a mistake in Manchester syntax or Turtle: where, what is there, what could be there."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from difflib import get_close_matches

from lark import Lark, UnexpectedInput, UnexpectedToken
from lark.lexer import PatternStr

from planlang.diagnostics import Diagnostic, error
from planlang.ontology.xml_text import position_of

FRAME_WORDS = (
    "Class:", "ObjectProperty:", "DataProperty:", "AnnotationProperty:", "Datatype:", "Individual:",
    "EquivalentClasses:", "DisjointClasses:", "EquivalentProperties:", "DisjointProperties:", "SameIndividual:",
    "DifferentIndividuals:",
)  # fmt: skip
"""What begins a frame, or an axiom that stands beside the frames."""

_SPOKEN = {
    "NAME": "a name",
    "FULL_IRI": "an <IRI>",
    "NODE": "a node _:name",
    "STRING": 'a "text"',
    "NUMBER": "a number",
    "BOOLEAN": "true or false",
    "PREFIX": "a prefix with its colon",
    "LANGUAGE": "a @language",
    "CHARACTERISTIC": "Functional, Transitive or another characteristic",
    "FACET": "a facet such as >=",
    "IRIREF": "an <IRI>",
    "PNAME_LN": "a name prefix:name",
    "PNAME_NS": "a prefix with its colon",
    "A": "'a'",
    "BASE": "BASE",
    "SELF": "Self",
    "$END": "the end of the file",
}
"""What the terminals of the grammar are called in messages; the others are words of the language."""

_WORD = re.compile(r'"|\S+')


def where(problem: UnexpectedInput, text: str) -> int:
    """Offset of the first character that does not fit; behind the last word if there should be more."""
    if not _is_at_end(problem):
        return problem.pos_in_stream if problem.pos_in_stream is not None else len(text)
    lines = text.split("\n")
    while lines and (not lines[-1].strip() or lines[-1].lstrip().startswith("#")):
        lines.pop()
    return len("\n".join(lines).rstrip())


def explain(
    problem: UnexpectedInput,
    parser: Lark,
    text: str,
    offset: int,
    file: str,
    *,
    words: Sequence[str] = FRAME_WORDS,
) -> Diagnostic:
    """The diagnostic for a mistake at an offset of the text; ``words`` may be meant wherever they can stand."""
    word = _WORD.match(text, offset)
    found = "the end of the file" if _is_at_end(problem) or word is None else word[0][:40]
    message = f"unexpected {found}"
    if found == '"':
        message = "a text is not closed, or its quotation marks are unexpected here"
    keywords, spoken = _expected(problem, parser)
    similar = get_close_matches(found, (*keywords, *words), n=1, cutoff=0.75)
    guess = f"did you mean {similar[0]}? " if similar and similar[0] != found else ""
    return error("O020", message, position_of(text, offset, file), f"{guess}expected: {_phrase(keywords, spoken)}")


def _is_at_end(problem: UnexpectedInput) -> bool:
    return isinstance(problem, UnexpectedToken) and problem.token.type == "$END"


def _expected(problem: UnexpectedInput, parser: Lark) -> tuple[list[str], list[str]]:
    """What could stand here: signs and words that end in a colon as they are written, everything else as spoken."""
    names: Iterable[str] = getattr(problem, "accepts", None) or getattr(problem, "allowed", None) or ()
    names = names or getattr(problem, "expected", None) or ()
    order = {name: place for place, name in enumerate(_SPOKEN)}
    keywords, spoken = [], []
    for name in sorted(
        (name for name in names if not name.startswith("SIMPLE")), key=lambda name: (order.get(name, len(order)), name)
    ):
        pattern = None if name == "$END" else parser.get_terminal(name).pattern
        if isinstance(pattern, PatternStr):
            keywords.append(pattern.value)
        else:
            spoken.append(_SPOKEN.get(name, name.lower()))
    return keywords, spoken


def _phrase(keywords: list[str], spoken: list[str]) -> str:
    sections = [word for word in keywords if word.endswith(":")]
    parts = [*spoken, *(repr(word) for word in keywords if not word.endswith(":"))]
    if set(FRAME_WORDS) <= set(sections):
        sections = [word for word in sections if word not in FRAME_WORDS]
        parts.append("the next frame")
    if sections:
        parts.append(" ".join(sections))
    return ", ".join(parts[:-1]) + (" or " if len(parts) > 1 else "") + parts[-1] if parts else "nothing"
