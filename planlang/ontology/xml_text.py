"""Text of XML files: limits of entities, explanations of expat's errors, and repairs that let expat read a file.

The repairs undo mistakes that published files contain; each is reported.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import field
from functools import cache
from xml.parsers import expat

from planlang.diagnostics import BadInput, Declaration, Diagnostic, Span, error, warning
from planlang.files import bundled, offset_of, position_of
from planlang.ontology.terms import PREFIXES
from planlang.ontology.triples import Parsed, counted
from planlang.records import dataclass

LARGEST_EXPANSION = 10_000_000
"""Characters that all entity references of a file together may expand to, unless the file itself is longer."""

LARGEST_FACTOR = 100
"""Limit of the same expansion in multiples of the file's length, which binds for short files."""

_REFERENCE = re.compile(r"&([^;&\s#]+);")


class EntityTable:
    """Entities that a file declares, with their lengths after full expansion (``_lengths``, [characters]).

    XML allows an entity to refer to one that is declared after it, so lengths are computed when the document type is
    complete.
    """

    def __init__(self, text: str, file: str, here: Callable[[], Span]) -> None:
        self._text = text
        self._file = file
        self._here = here
        self._values: dict[str, tuple[str, Span]] = {}
        self._lengths: dict[str, int] = {"amp": 1, "lt": 1, "gt": 1, "apos": 1, "quot": 1}

    @property
    def limit(self) -> int:
        """Characters that the references may expand to; enough for prefixes even in short files."""
        return min(max(LARGEST_EXPANSION, len(self._text)), LARGEST_FACTOR * len(self._text))

    @property
    def names(self) -> frozenset[str]:
        """Entities that may be referred to: declared ones and those of XML itself."""
        return frozenset(self._values) | frozenset(("amp", "lt", "gt", "apos", "quot"))

    def guard(self, parser: expat.XMLParserType) -> None:
        """Make a parser ask this table what a document type may contain."""
        parser.StartDoctypeDeclHandler = self.begin
        parser.EndDoctypeDeclHandler = self.check
        parser.EntityDeclHandler = self.declare
        parser.SkippedEntityHandler = self.skip

    def begin(self, name: str, system: str | None, public: str | None, *_: object) -> None:
        """Refuse a document type in another file (expat handler)."""
        if system or public:
            message = f"external document types are not read: {system}"
            raise BadInput([error("O009", message, self._here(), "declare the entities in the file itself")])

    def declare(
        self, name: str, is_parameter: int, value: str | None, base: str | None, system: str | None, *_: object
    ) -> None:
        """Record an entity; of several declarations the first counts, as in XML (expat handler)."""
        if is_parameter:
            message, advice = f"parameter entities are not supported: %{name};", "declare a general entity instead"
            raise BadInput([error("O009", message, self._here(), advice)])
        if value is None:
            message, advice = f"external entities are not read: &{name}; {system}", "write its value into the file"
            raise BadInput([error("O009", message, self._here(), advice)])
        self._values.setdefault(name, (value, self._here()))

    def skip(self, name: str, *_: object) -> None:
        """Refuse an entity that the file does not declare (expat handler)."""
        message = f"the entity &{name}; is not declared in the file"
        raise BadInput([error("O009", message, self._here(), "declare it in the DOCTYPE")])

    def check(self) -> None:
        """Raise BadInput if references expand to more than :attr:`limit`, or if an entity contains itself."""
        for name in self._values:
            self._measure(name)
        total, limit, lengths = 0, self.limit, self._lengths
        if self._text.count("&") * max(lengths.values()) <= limit:
            return
        for match in _REFERENCE.finditer(
            self._text
        ):  # counts those inside declarations too, which errs on the safe side
            total += lengths.get(match[1], 0)
            if total > limit:
                before = match.start()
                line = self._text.count("\n", 0, before) + 1
                span = Span(self._file, line, before - self._text.rfind("\n", 0, before))
                raise BadInput([_too_much(match[1], limit, span)])

    def _measure(self, root: str) -> None:
        """Compute the lengths of an entity and of those it refers to, innermost first.

        It does not recurse, as a hostile file can nest entities deeper than Python's stack.
        """
        if root in self._lengths:
            return
        open_names = {root: iter(self._references(root))}
        while open_names:
            name = next(reversed(open_names))
            other = next((other for other in open_names[name] if other not in self._lengths), None)
            if other is None:
                del open_names[name]
                self._close(name)
            elif other in open_names:
                names = list(open_names)
                cycle = " -> ".join((*names[names.index(other) :], other))
                raise BadInput([error("O008", f"an entity contains itself: {cycle[:200]}", self._values[name][1])])
            else:
                open_names[other] = iter(self._references(other))

    def _references(self, name: str) -> list[str]:
        return _REFERENCE.findall(self._values[name][0]) if name in self._values else []

    def _close(self, name: str) -> None:
        """Record the length of an entity whose references are all measured; an undeclared one has length 0."""
        value, span = self._values.get(name, ("", Span(self._file)))
        length = len(value) + sum(self._lengths[other] for other in self._references(name))
        if length > self.limit:
            raise BadInput([_too_much(name, self.limit, span)])
        self._lengths[name] = length


def _too_much(name: str, limit: int, span: Span) -> Diagnostic:
    return error("O008", f"the entity &{name}; expands the file to more than {limit:,} characters", span)


def explain(
    problem: expat.ExpatError, text: str, file: str, opened: Sequence[Span], entities: frozenset[str]
) -> Diagnostic:
    """Make the diagnostic of an expat error.

    ``opened`` are the positions of the open elements, the innermost last; ``entities`` the names of known entities.
    """
    span = Span(file, problem.lineno, problem.offset + 1)
    reason = expat.ErrorString(problem.code) or "not well-formed"
    advice = None
    if reason == "undefined entity":
        start = offset_of(text, span)
        match = next((m for m in re.finditer(r"&([\w.:-]+);", text[start:]) if m[1] not in entities), None)
        if match:
            span = position_of(text, start + match.start(), file)
            reason = f"undefined entity &{match[1]};"
            advice = f'declare it in the DOCTYPE: <!ENTITY {match[1]} "http://...#">'
    elif reason == "unbound prefix":
        advice = 'declare the prefix in the first element: xmlns:prefix="http://...#"'
    elif reason in ("no element found", "unclosed token", "unclosed CDATA section"):
        if opened:
            reason = f"the file ends too early; {len(opened)} elements are not closed"
        advice = "the file seems to be truncated; get it again, or close its elements"
    elif reason.startswith("mismatched tag") and opened:
        return _mismatched(text, span, opened)
    return error("O005", f"this is not XML: {reason}", span, advice)


def _mismatched(text: str, span: Span, opened: Sequence[Span]) -> Diagnostic:
    """Make the diagnostic of a mismatched end tag, at the unclosed element if the tag closes an outer one.

    XML parsers notice a missing end tag only at the end of the surrounding element, which may be far below.
    """
    names = [tag[1] for one in opened if (tag := _OPENS.match(text, offset_of(text, one)))]
    closing = _CLOSES.match(text, text.rfind("</", 0, offset_of(text, span) + 2))
    if not names or closing is None:
        return error(
            "O005", "this is not XML: mismatched tag", span, f"close the element of line {opened[-1].line} first"
        )
    if closing[1] in names[:-1]:
        message = f"this is not XML: the element {names[-1]} is not closed"
        advice = f"add </{names[-1]}> before </{closing[1]}> in line {span.line}"
        return error("O005", message, opened[-1], advice)
    message = f"this is not XML: </{closing[1]}> closes no open element"
    advice = f"remove it, or close {names[-1]} of line {opened[-1].line}, the innermost open element"
    return error("O005", message, span, advice)


_OPENS, _CLOSES = re.compile(r"<([^\s/>]+)"), re.compile(r"</([^\s>]+)")


def must_be_rdf(tag: str, span: Span) -> None:
    """Raise BadInput if the root element of a file, as named by expat, is not one of RDF."""
    namespace, _, local = tag.rpartition(" ")
    if namespace and namespace != "http://www.w3.org/1999/xhtml":
        return
    message = f"this is XML, but not RDF: its root element is {local}"
    advice = "the root element of an ontology is rdf:RDF (RDF/XML) or Ontology (OWL/XML)"
    raise BadInput([error("O001", message, span, advice)])


_SECTIONS = {"<!--": "-->", "<![CDATA[": "]]>", "<?": "?>"}
_OPENING = re.compile(r"<!--|<!\[CDATA\[|<\?")
_BROKEN_COMMENT = re.compile(r"<!-(?!-)[^<>]*>")
_START_TAG = re.compile(r"<[A-Za-z_][\w:.-]*(?:\s+[\w:.-]+\s*=\s*(?:\"[^\"<]*\"|'[^'<]*'))*\s*/?>")
_ATTRIBUTE = re.compile(r"\s+([\w:.-]+)\s*=\s*(\"[^\"<]*\"|'[^'<]*')")
_PREFIX_REFERENCE = re.compile(r"&([^\W\d][\w.-]*);")
_DECLARED = re.compile(r"<!ENTITY\s+([\w.:-]+)")
_PREFIX = re.compile(r"\sxmlns:([\w.-]+)\s*=\s*(?:\"([^\"'<]*)\"|'([^\"'<]*)')")
_DOCTYPE = re.compile(r"<!DOCTYPE\s[^\[<>]*(\[?)")


MOST_WARNINGS = 100
"""Warnings about one file that are shown; further ones are counted."""


@dataclass
class Repaired:
    """Repaired text with the same lines, and the diagnostics. Columns move only where entities were declared."""

    text: str
    diagnostics: list[Diagnostic] = field(default_factory=list)
    not_shown: int = 0
    """Number of repairs without a diagnostic."""


def with_repairs(parse: Callable[[str], Parsed], text: str, file: str) -> Parsed:
    """Parse a text, and again with repairs if it is not well-formed. Raises BadInput as ``parse`` does."""
    try:
        return parse(text)
    except BadInput as problem:
        if problem.diagnostics[0].code != "O005":
            raise
        repaired = repair_xml(text, file)
        if not repaired.diagnostics:
            raise
        try:
            parsed = parse(repaired.text)
        except BadInput as remaining:
            raise BadInput([*repaired.diagnostics, *remaining.diagnostics]) from None
        parsed.diagnostics[:0] = repaired.diagnostics
        return parsed


def repair_xml(text: str, file: str) -> Repaired:
    """Repair mistakes that need no guess; a text without such mistakes is unchanged.

    Overwritten with blanks: comments opened by ``<!-``, double hyphens inside comments, an XML declaration that is not
    at the start, and the first of two equal attributes of an element. A well-known undeclared entity is declared.
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
    result.diagnostics = counted(result.diagnostics, result.not_shown)
    return result


def _note(
    result: Repaired, file: str, offset: int, code: str, message: str, advice: str, change: Declaration | None = None
) -> None:
    if len(result.diagnostics) >= MOST_WARNINGS:
        result.not_shown += 1
        return
    result.diagnostics.append(warning(code, message, position_of(result.text, offset, file), advice, change))


def _declaration(result: Repaired, file: str) -> Iterator[tuple[int, int]]:
    match = re.compile(r"\s*(?:<!--.*?-->\s*)*(<\?xml\s[^>]*\?>)", re.DOTALL).match(result.text)
    if match and match.start(1) > 0:
        message = "the XML declaration is not at the start of the file"
        _note(result, file, match.start(1), "O006", message, "it is ignored; move it to the first line")
        yield match.span(1)


def _hyphens(result: Repaired, file: str) -> Iterator[tuple[int, int]]:
    for start, end in _sections(result.text):
        words = result.text[start + 4 : end - 3]
        if result.text.startswith("<!--", start) and ("--" in words or words.endswith("-")):
            advice = "the hyphens are ignored; write single ones"
            _note(result, file, start, "O006", "a comment contains '--', or ends with '-'", advice)
            yield from ((start + 4 + m.start(), start + 4 + m.end()) for m in re.finditer("-+", words))


def _broken_comments(visible: str, body: int, result: Repaired, file: str) -> Iterator[tuple[int, int]]:
    for match in _BROKEN_COMMENT.finditer(visible, body):
        if match[0].endswith("->"):
            message = f"a comment is opened by '<!-' instead of '<!--': {' '.join(match[0].split())[:60]}"
            _note(result, file, match.start(), "O006", message, "it is read as a comment; write <!-- ... -->")
            yield match.span()


def _repeated_attributes(tag: re.Match[str], result: Repaired, file: str) -> Iterator[tuple[int, int]]:
    last: dict[str, re.Match[str]] = {}
    for attribute in _ATTRIBUTE.finditer(tag[0]):
        earlier = last.get(attribute[1])
        last[attribute[1]] = attribute
        if earlier is not None:
            yield tag.start() + earlier.start(), tag.start() + earlier.end()
            same = "with the same value" if earlier[2][1:-1] == attribute[2][1:-1] else f"first as {earlier[2]}"
            message = f"an element has the attribute {attribute[1]} twice, {same}"
            advice = f"the second one is used: {attribute[2]}; remove one of the two"
            _note(result, file, tag.start() + earlier.start(1), "O007", message, advice)


def _undeclared_entities(visible: str, result: Repaired, file: str) -> dict[str, str]:
    """Find well-known entities that are used but not declared, and their values.

    These are the prefixes of the file and of the vocabularies, and the entities that KnowRob's files declare.
    """
    declared = {"amp", "lt", "gt", "apos", "quot", *_DECLARED.findall(visible)}
    used = [one for one in _PREFIX_REFERENCE.finditer(visible) if one[1] not in declared]
    prefixes = PREFIXES | {name: double or single for name, double, single in _PREFIX.findall(visible)} if used else {}
    entities: dict[str, str] = {}
    for reference in used:
        name = reference[1]
        values = [str(prefixes[name])] if name in prefixes else _knowrob_entities().get(name, [])
        if name in entities or not values or not values[0] or "&" in values[0] or "%" in values[0]:
            continue
        entities[name] = values[0]
        source = "the prefix of this name" if name in prefixes else "in KnowRob's files"
        if len(values) > 1:
            source = f"in some of KnowRob's files (in others: {', '.join(values[1:])})"
        change = Declaration(name, values[0], is_sure=len(values) == 1)
        message = f"the entity &{name}; is not declared; it is read like {source}: {values[0]}"
        _note(result, file, reference.start(), "O016", message, f"declare it in the DOCTYPE: {change}", change)
    return entities


@cache
def _knowrob_entities() -> dict[str, list[str]]:
    """Entities that KnowRob's files declare, each with its values, the most frequent first."""
    text = (bundled("ontologies") / "entities.toml").read_text(encoding="utf-8")
    entities: dict[str, list[str]] = tomllib.loads(text)
    return entities


def _declare(text: str, visible: str, entities: dict[str, str]) -> str:
    """Declare entities in the document type, on a line that is there."""
    doctype = _DOCTYPE.search(visible)
    if doctype is not None:
        offset, before, after = doctype.end(), *(("", "") if doctype[1] else ("[", "]"))
    else:
        root = re.search(r"<[A-Za-z]", visible)
        offset, before, after = root.start() if root else len(text), "<!DOCTYPE rdf:RDF [", "]>"
    declarations = "".join(str(Declaration(name, value)) for name, value in entities.items())
    return f"{text[:offset]}{before}{declarations}{after}{text[offset:]}"


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
    """Overwrite comments, CDATA sections and processing instructions with blanks, which keeps offsets."""
    return _blanked(text, list(_sections(text)))


def _blanked(text: str, ranges: list[tuple[int, int]]) -> str:
    pieces: list[str] = []
    position = 0
    for start, end in ranges:
        if start >= position:
            pieces += (text[position:start], re.sub(r"[^\r\n]", " ", text[start:end]))
            position = end
    return "".join(pieces) + text[position:]
