"""Mistakes that editors of real RDF/XML files made and that keep expat from reading them: found, undone, reported."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field

from planlang.diagnostics import Diagnostic, warning
from planlang.ontology.terms import PREFIXES
from planlang.ontology.triples import counted
from planlang.ontology.xml_text import position_of

_SECTIONS = {"<!--": "-->", "<![CDATA[": "]]>", "<?": "?>"}
_OPENING = re.compile(r"<!--|<!\[CDATA\[|<\?")
_BROKEN_COMMENT = re.compile(r"<!-(?!-)[^<>]*>")
_START_TAG = re.compile(r"<[A-Za-z_][\w:.-]*(?:\s+[\w:.-]+\s*=\s*(?:\"[^\"<]*\"|'[^'<]*'))*\s*/?>")
_ATTRIBUTE = re.compile(r"\s+([\w:.-]+)\s*=\s*(\"[^\"<]*\"|'[^'<]*')")
_REFERENCE = re.compile(r"&([^\W\d][\w.-]*);")
_DECLARED = re.compile(r"<!ENTITY\s+([\w.:-]+)")
_PREFIX = re.compile(r"\sxmlns:([\w.-]+)\s*=\s*(?:\"([^\"'<]*)\"|'([^\"'<]*)')")
_DOCTYPE = re.compile(r"<!DOCTYPE\s[^\[<>]*(\[?)")


MOST_WARNINGS = 100
"""Warnings about one file that are shown; further ones are counted."""


@dataclass
class Repaired:
    """A text with the same lines, and what was changed. Columns move only where entities were declared."""

    text: str
    diagnostics: list[Diagnostic] = field(default_factory=list)
    unsaid: int = 0
    """Mistakes beyond those that are shown."""


def repair(text: str, file: str) -> Repaired:
    """Undo what can be undone without a guess; a text without such mistakes comes back as it is.

    Comments opened by ``<!-``, hyphens in pairs inside comments, an XML declaration that is not at the start, and an
    attribute that an element states twice are made blank (of two the later counts). An undeclared entity with the name
    of a declared or known prefix is declared.
    """
    result = Repaired(text)
    blanks = [*_declaration(result, file), *_hyphens(result, file)]
    visible = _without_comments(text)
    body = max(visible.find("]>"), 0)
    blanks += _broken_comments(visible, body, result, file)
    for tag in _START_TAG.finditer(visible, body):
        if "=" in tag[0]:
            blanks += _repeated_attributes(tag, result, file)
    entities = _undeclared_entities(visible, result, file)
    result.text = _blanked(text, sorted(blanks))
    if entities:
        result.text = _declare(result.text, visible, entities)
    result.diagnostics.sort(key=lambda found: found.span or position_of(text, 0, file))
    result.diagnostics = counted(result.diagnostics, result.unsaid)
    return result


def _note(result: Repaired, file: str, offset: int, code: str, message: str, advice: str) -> None:
    if len(result.diagnostics) >= MOST_WARNINGS:
        result.unsaid += 1
        return
    result.diagnostics.append(warning(code, message, position_of(result.text, offset, file), advice))


def _declaration(result: Repaired, file: str) -> Iterator[tuple[int, int]]:
    match = re.compile(r"\s*(?:<!--.*?-->\s*)*(<\?xml\s[^>]*\?>)", re.DOTALL).match(result.text)
    if match and match.start(1) > 0:
        message = "the XML declaration is not at the start of the file"
        _note(result, file, match.start(1), "O006", message, "it is skipped; put it in front of everything else")
        yield match.span(1)


def _hyphens(result: Repaired, file: str) -> Iterator[tuple[int, int]]:
    for start, end in _sections(result.text):
        words = result.text[start + 4 : end - 3]
        if result.text.startswith("<!--", start) and ("--" in words or words.endswith("-")):
            _note(result, file, start, "O006", "a comment contains '--'", "the hyphens are skipped; write a single one")
            yield from ((start + 4 + m.start(), start + 4 + m.end()) for m in re.finditer("-+", words))


def _broken_comments(visible: str, body: int, result: Repaired, file: str) -> Iterator[tuple[int, int]]:
    for match in _BROKEN_COMMENT.finditer(visible, body):
        if match[0].endswith("->"):
            message = f"a comment is opened by '<!-' instead of '<!--': {' '.join(match[0].split())[:60]}"
            _note(result, file, match.start(), "O006", message, "the words are skipped; write <!-- ... -->")
            yield match.span()


def _repeated_attributes(tag: re.Match[str], result: Repaired, file: str) -> Iterator[tuple[int, int]]:
    last: dict[str, re.Match[str]] = {}
    for attribute in _ATTRIBUTE.finditer(tag[0]):
        earlier = last.get(attribute[1])
        last[attribute[1]] = attribute
        if earlier is not None:
            yield tag.start() + earlier.start(), tag.start() + earlier.end()
            same = "with the same value" if earlier[2][1:-1] == attribute[2][1:-1] else f"first as {earlier[2]}"
            message = f"{attribute[1]} is stated twice in one element, {same}"
            advice = f"the later one counts: {attribute[2]}; remove one of the two"
            _note(result, file, tag.start() + earlier.start(1), "O007", message, advice)


def _undeclared_entities(visible: str, result: Repaired, file: str) -> dict[str, str]:
    """Name -> value of entities that are used without declaration but are the names of prefixes."""
    declared = {"amp", "lt", "gt", "apos", "quot", *_DECLARED.findall(visible)}
    prefixes = PREFIXES | {name: double or single for name, double, single in _PREFIX.findall(visible)}
    found: dict[str, str] = {}
    for reference in _REFERENCE.finditer(visible):
        name = reference[1]
        value = prefixes.get(name)
        if name not in declared and name not in found and value and "&" not in value and "%" not in value:
            found[name] = value
            message = f"the entity &{name}; is not declared and is read as the prefix of this name: {value}"
            advice = f'declare it in the DOCTYPE: <!ENTITY {name} "{value}">'
            _note(result, file, reference.start(), "O016", message, advice)
    return found


def _declare(text: str, visible: str, entities: dict[str, str]) -> str:
    declarations = "".join(f'<!ENTITY {name} "{value}">' for name, value in entities.items())
    doctype = _DOCTYPE.search(visible)
    if doctype is None:
        root = re.search(r"<[A-Za-z]", visible)
        start = root.start() if root else len(text)
        return f"{text[:start]}<!DOCTYPE rdf:RDF [{declarations}]>{text[start:]}"
    if doctype[1]:
        return text[: doctype.end()] + declarations + text[doctype.end() :]
    return f"{text[: doctype.end()]}[{declarations}]{text[doctype.end() :]}"


def _sections(text: str) -> Iterator[tuple[int, int]]:
    """Yield the spans of comments, CDATA sections and processing instructions."""
    position = 0
    while opening := _OPENING.search(text, position):
        closing = _SECTIONS[opening[0]]
        end = text.find(closing, opening.end())
        if end < 0:
            return
        position = end + len(closing)
        yield opening.start(), position


def _without_comments(text: str) -> str:
    """Return the text with comments, CDATA sections and processing instructions made blank, offsets kept."""
    return _blanked(text, list(_sections(text)))


def _blanked(text: str, ranges: list[tuple[int, int]]) -> str:
    pieces: list[str] = []
    position = 0
    for start, end in ranges:
        if start >= position:
            pieces += (text[position:start], re.sub(r"[^\r\n]", " ", text[start:end]))
            position = end
    return "".join(pieces) + text[position:]
