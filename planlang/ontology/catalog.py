"""Catalogs of imports: ``catalog-v001.xml`` as Protege and the OWL API write it (OASIS XML Catalogs 1.1).

An entry names the file of an IRI. Files are found below the allowed folders only, and nothing is fetched.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple
from urllib.parse import unquote
from xml.parsers import expat

from planlang.diagnostics import BadInput, Diagnostic, Span, error, warning
from planlang.files import decode, read_file
from planlang.ontology.terms import resolve
from planlang.ontology.xml_text import EntityTable, explain
from planlang.words import Blank, Option, Text

FOLDER = Option("ontologies", Blank("DIR"))
"""Adds a folder in which imports are searched."""
NAME = "catalog-v001.xml"
LARGEST = 4_000_000
"""Greatest size of a catalog [bytes]."""
MOST = 50
"""Catalogs that are read for one ontology; it ends chains of them."""
DEEPEST = 50
"""Greatest nesting depth of groups."""

_NAMESPACE = "urn:oasis:names:tc:entity:xmlns:xml:catalog"
_BASE = "http://www.w3.org/XML/1998/namespace base"


class _Entry(NamedTuple):
    """Entry of a catalog: its element, the IRI or part of an IRI that it is about, and where that is to be found."""

    kind: str
    about: str
    target: str
    span: Span


_KINDS = {
    "uri": ("name", "uri"),
    "rewriteURI": ("uriStartString", "rewritePrefix"),
    "uriSuffix": ("uriSuffix", "uri"),
    "delegateURI": ("uriStartString", "catalog"),
    "nextCatalog": ("", "catalog"),
}
"""Element -> attributes with the IRI, and with the address that it stands for."""


class Catalogs:
    """Reads catalogs when they are needed; ``problems`` are those that cannot be used.

    ``is_allowed`` checks whether a file may be read.
    """

    def __init__(self, is_allowed: Callable[[Path], bool]) -> None:
        self._is_allowed = is_allowed
        self._read: dict[Path, tuple[_Entry, ...]] = {}
        self._reported: set[Span] = set()
        self.problems: list[Diagnostic] = []

    def find(self, folder: Path, iri: str) -> Path | str | None:
        """Find what the catalog of a folder names for an IRI: a file, or another IRI; None if it names nothing."""
        path = folder / NAME
        return self._find(path, iri, set()) if path.is_file() else None

    def _find(self, path: Path, iri: str, asked: set[Path]) -> Path | str | None:
        path = path.resolve()
        if path in asked:
            return None
        asked.add(path)
        entries = self._entries(path)
        for target, span in _answers(entries, iri):
            found = self._usable(target, span, iri)
            if found is not None:
                return found
        delegated = [one for one in entries if one.kind == "delegateURI" and iri.startswith(one.about)]
        delegated.sort(key=lambda one: -len(one.about))
        for other in delegated or [one for one in entries if one.kind == "nextCatalog"]:
            found = self._usable(other.target, other.span, "")
            answer = self._find(found, iri, asked) if isinstance(found, Path) else None
            if answer is not None:
                return answer
        return None

    def _usable(self, target: str, span: Span, iri: str) -> Path | str | None:
        if not target.startswith("file:"):
            return target if target != iri else None
        path = Path("/" + unquote(target.removeprefix("file:").partition("#")[0]).lstrip("/"))
        try:
            is_there = path.is_file()
        except (OSError, ValueError):
            is_there = False
        if not self._is_allowed(path):
            advice: str = Text("allow it with ", FOLDER, f", where DIR is the folder of {path.name}")
            self._warn(f"the entry for {iri or path.name} leads outside the allowed folders", span, advice)
        elif not is_there:
            advice = f"put {path.name} there, or correct the entry"
            self._warn(f"the entry for {iri or path.name} names a file that is not there", span, advice)
        else:
            return path
        return None

    def _warn(self, message: str, span: Span, advice: str | None) -> None:
        if span not in self._reported:
            self._reported.add(span)
            self.problems.append(warning("O036", f"in the catalog of imports, {message}", span, advice))

    def _entries(self, path: Path) -> tuple[_Entry, ...]:
        entries = self._read.get(path)
        if entries is None:
            entries = ()
            if len(self._read) < MOST:
                try:
                    entries = tuple(_Reader(decode(read_file(path, "O036", largest=LARGEST), str(path)), path).read())
                except BadInput as problem:
                    first = problem.diagnostics[0]
                    self._warn(first.message, first.span or Span(str(path)), first.help)
            self._read[path] = entries
        return entries


def _answers(entries: tuple[_Entry, ...], iri: str) -> Iterator[tuple[str, Span]]:
    """Yield the addresses for an IRI, the best first: an entry for this IRI, for its longest start, its longest end."""
    yield from ((one.target, one.span) for one in entries if one.kind == "uri" and one.about == iri)
    starts = [one for one in entries if one.kind == "rewriteURI" and iri.startswith(one.about)]
    for one in sorted(starts, key=lambda one: -len(one.about)):
        yield one.target + iri[len(one.about) :], one.span
    ends = [one for one in entries if one.kind == "uriSuffix" and iri.endswith(one.about)]
    yield from ((one.target, one.span) for one in sorted(ends, key=lambda one: -len(one.about)))


class _Reader:
    """Reads the entries of a catalog, with addresses resolved against its place and ``xml:base``."""

    def __init__(self, text: str, path: Path) -> None:
        self._text = text
        self._file = str(path)
        self._parser = expat.ParserCreate(namespace_separator=" ")
        self._bases = [path.as_uri()]
        self._entries: list[_Entry] = []
        self._spans: list[Span] = []
        self._entities = EntityTable(text, self._file, self._here)
        self._parser.StartElementHandler = self._begin
        self._parser.EndElementHandler = self._end
        self._entities.guard(self._parser)
        self._parser.StartDoctypeDeclHandler = None  # catalogs name the document type of OASIS, which is not read

    def read(self) -> list[_Entry]:
        """Read all entries. Raises BadInput if the text is not well-formed, or no catalog."""
        try:
            self._parser.Parse(self._text, True)
        except expat.ExpatError as problem:
            raise BadInput([explain(problem, self._text, self._file, self._spans, self._entities.names)]) from None
        return self._entries

    def _here(self) -> Span:
        return Span(self._file, self._parser.CurrentLineNumber, self._parser.CurrentColumnNumber + 1)

    def _begin(self, tag: str, given: dict[str, str]) -> None:
        namespace, _, name = tag.rpartition(" ")
        span = self._here()
        if not self._spans and name != "catalog":
            raise BadInput([error("O036", f"its root element is {name}, not catalog", span)])
        if len(self._spans) > DEEPEST:
            raise BadInput([error("O036", f"elements are nested more than {DEEPEST} deep", span)])
        base = given.get(_BASE)
        self._spans.append(span)
        self._bases.append(resolve(self._bases[-1], base) if base else self._bases[-1])
        attributes = _KINDS.get(name) if namespace in ("", _NAMESPACE) else None
        if attributes is not None:
            about, target = given.get(attributes[0], ""), given.get(attributes[1])
            if target is not None and (about or not attributes[0]):
                self._entries.append(_Entry(name, about, resolve(self._bases[-1], target.replace("\\", "/")), span))

    def _end(self, _: str) -> None:
        self._spans.pop()
        self._bases.pop()
