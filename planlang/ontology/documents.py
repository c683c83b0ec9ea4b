"""Read a file and all its imports in load order, and detect the syntax of a file."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import Enum
from functools import cache
from pathlib import Path

from planlang.cache import Cache
from planlang.diagnostics import BadInput, Diagnostic, Span, error, warning
from planlang.files import read_file
from planlang.ontology.checks import malformed
from planlang.ontology.imports import ImportMap
from planlang.ontology.repairs import repair, use_canonical_names
from planlang.ontology.terms import OWL, RDF, BNode, Triple
from planlang.ontology.triples import Parsed, Triples
from planlang.ontology.xml_text import LARGEST_FILE, decode
from planlang.resources import bundled


class Syntax(Enum):
    """The syntaxes of OWL that are read. N-Triples is read as Turtle, of which it is a part."""

    RDFXML = "RDF/XML"
    MANCHESTER = "Manchester syntax"
    TURTLE = "Turtle"


_MANCHESTER = re.compile(
    r"(?:Prefix|Namespace|Ontology|Import|Annotations|Class|ObjectProperty|DataProperty|AnnotationProperty|Datatype"
    r"|Individual|EquivalentClasses|DisjointClasses|EquivalentProperties|DisjointProperties|SameIndividual"
    r"|DifferentIndividuals):(?=\s|$|<)"
)
_NOTHING_SAID = re.compile(r"(?:[^\S\r\n]*(?:#[^\r\n]*)?(?:\r\n?|\n))*(?:[^\S\r\n]*#[^\r\n]*\Z)?")
_TURTLE = re.compile(
    r"""@prefix\b|@base\b|(?i:prefix|base)\s
      | <(?:[^<>\s]*://|urn:|tag:|file:|[#/]|>)  # an IRI; no element of XML is written so
      | _:[\w] | [\[(]
      | (?:[^\W\d_][\w.-]*)?:(?!//)[^\s:]*\s+(?:a\s|<|[\w.-]*:)""",
    re.VERBOSE,
)


def syntax_of(content: bytes, file: str) -> Syntax:
    """Return the syntax of a file's content. Raises BadInput if it is none of the known ones."""
    return syntax_of_text(decode(content, file), file)


def syntax_of_text(text: str, file: str) -> Syntax:
    """Return the syntax of a text; see :func:`syntax_of`."""
    beginning = _NOTHING_SAID.match(text)
    assert beginning is not None
    position = beginning.end()
    start = text[position : position + 10_000].lstrip()[:2000]
    if _MANCHESTER.match(start):
        return Syntax.MANCHESTER
    if _TURTLE.match(start):
        return Syntax.TURTLE
    if start.startswith("<"):
        return Syntax.RDFXML
    if not start:
        raise BadInput([error("O002", "the file holds nothing but comments", Span(file))])
    span = Span(file, text.count("\n", 0, position) + 1)
    advice = "an ontology is RDF/XML (rdf:RDF), Turtle (@prefix) or in Manchester syntax (Prefix:, Ontology:, Class:)"
    raise BadInput([error("O001", "this is neither RDF/XML, Turtle nor Manchester syntax", span, advice)])


def read_syntax(content: bytes, file: str, *, base: str, label: str) -> Parsed:
    """Return the triples of a file in any of the syntaxes. Raises BadInput as their readers do."""
    text = decode(content, file)
    match syntax_of_text(text, file):
        case Syntax.RDFXML:
            from planlang.ontology.rdfxml import read_rdfxml as read
        case Syntax.MANCHESTER:
            from planlang.ontology.manchester import read_manchester as read
        case Syntax.TURTLE:
            from planlang.ontology.turtle import read_turtle as read
    return read(text, file, base=base, label=label)


MOST_DOCUMENTS = 200
"""Files that one ontology may be made of."""

VOCABULARY = ("knowrob", "srdl", "roboearth", "dul", "primitives", "recovery")
"""Bundled files that every ontology has, then objects/."""


_CACHE = Cache("ontology", most=100)
"""The triples of bundled files, by the digests of the file and of the reader's source."""


@dataclass(frozen=True, slots=True)
class Document:
    """A file that was read: its path, the name that it gives itself, and the digest of its bytes."""

    path: Path
    iri: str | None
    sha256: str


@dataclass(frozen=True, slots=True)
class Reading:
    """A document with what it says, after repair, under canonical names."""

    document: Document
    triples: Triples
    diagnostics: tuple[Diagnostic, ...]


def read_bytes(path: Path) -> bytes:
    """Return the content of an ontology's file. Raises BadInput."""
    return read_file(path, "O001", largest=LARGEST_FILE, code_if_large="O003")


def _read(path: Path, content: bytes) -> Reading:
    file = str(path)
    digest = hashlib.sha256(content).hexdigest()
    base, label = f"file:///{path.name}", f"{digest[:8]}-"
    key = f"{digest} {_reader_digest()}" if _is_ours(path) else None
    kept = _CACHE.load(key) if key is not None else None
    if kept is not None:
        triples = Triples.unpacked(kept, file)
        return Reading(Document(path, _own_iri(triples), digest), triples, ())
    parsed = read_syntax(content, file, base=base, label=label)
    triples = parsed.triples
    diagnostics = (*parsed.diagnostics, *use_canonical_names(triples), *repair(triples), *malformed(triples))
    if key is not None and not diagnostics:
        _CACHE.keep(key, triples.packed())
    return Reading(Document(path, _own_iri(triples), digest), triples, diagnostics)


@cache
def _reader_digest() -> str:
    """Digest of the source of everything that shapes the triples."""
    here = Path(__file__).parent
    digest = hashlib.sha256()
    for path in sorted([*here.glob("*.py"), *here.glob("*.lark")]):
        digest.update(path.read_bytes())
    return digest.hexdigest()


def _is_ours(path: Path) -> bool:
    folders = (bundled("ontologies").resolve(), bundled("recipes").resolve())
    return path.suffix == ".omn" and any(path.resolve().is_relative_to(folder) for folder in folders)


def _own_iri(triples: Triples) -> str | None:
    ontology = triples.find(OWL.Ontology)
    rows = (row for row in triples.by(RDF.type) if triples.objects[row] == ontology) if ontology is not None else ()
    names = (triples.name(triples.subjects[row]) for row in rows)
    return next((name for name in names if name is not None), None)


def read_all(path: Path, folders: Sequence[Path], *, builtin: bool) -> list[Reading]:
    """Return the file, its imports depth first, then the bundled vocabulary.

    Raises BadInput if the file itself cannot be used; an import that cannot be is a warning of the main document.
    """
    main = _read(path, read_bytes(path))
    readings = [main]
    loaded = {path.resolve()}
    digests = {main.document.sha256}
    imports = ImportMap(path, folders)
    problems: list[Diagnostic] = []
    vocabulary = _vocabulary_paths() if builtin else ()
    satisfied = {file.resolve() for file in vocabulary}
    pending: list[tuple[Path, Iterator[Triple]]] = [(path, _imports(main))]
    while pending:
        importing, remaining = pending[-1]
        triple = next(remaining, None)
        if triple is None:
            pending.pop()
            continue
        target = str(triple.object)
        resolution = imports.resolve(target, importing, triple.span)
        if resolution.problem is not None:
            problems.append(resolution.problem)
        found = resolution.path
        if found is None or found.resolve() in loaded | satisfied:
            continue
        loaded.add(found.resolve())
        if len(readings) >= MOST_DOCUMENTS:
            problems.append(warning("O033", f"more than {MOST_DOCUMENTS} files are imported", triple.span))
            break
        try:
            reading = _read(found, read_bytes(found))
        except BadInput as problem:
            first = problem.diagnostics[0]
            message = f"an import cannot be read: {first.span}: {first.message}"
            problems.append(warning("O034", message, triple.span, first.help))
            continue
        if reading.document.sha256 not in digests:
            digests.add(reading.document.sha256)
            readings.append(reading)
            pending.append((found, _imports(reading)))
    for file in vocabulary:
        if file.resolve() not in loaded:
            reading = _bundled_reading(file)
            readings.append(reading)
    return [Reading(main.document, main.triples, (*main.diagnostics, *problems)), *readings[1:]]


def _imports(reading: Reading) -> Iterator[Triple]:
    seen: set[str] = set()
    for row in reading.triples.by(OWL.imports):
        triple = reading.triples.triple(row)
        if not isinstance(triple.object, BNode) and str(triple.object) not in seen:
            seen.add(str(triple.object))
            yield triple


def _vocabulary_paths() -> tuple[Path, ...]:
    folder = bundled("ontologies")
    paths = [folder / f"{name}.omn" for name in VOCABULARY]
    return tuple(path for path in (*paths, *sorted((folder / "objects").glob("*.omn"))) if path.is_file())


def _bundled_reading(path: Path) -> Reading:
    return _bundled_version(path, path.stat().st_mtime_ns)


@cache
def _bundled_version(path: Path, modified: int) -> Reading:
    return _read(path, read_bytes(path))
