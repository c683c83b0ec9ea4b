"""Read a file and all its imports in load order.

Imports are searched beside the file, in the folders that the user gives, and among the bundled ontologies. Nothing is
ever fetched from the network, and nothing outside these folders is read, whatever path an import has.
"""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from enum import Enum
from functools import cache, lru_cache
from pathlib import Path
from pkgutil import resolve_name
from urllib.parse import quote

from planlang.cache import Cache
from planlang.diagnostics import BadInput, Diagnostic, Span, error, unread, warning
from planlang.files import LARGEST_ONTOLOGY, bundled, decode, read_file
from planlang.ontology.annotations import without_annotations
from planlang.ontology.bson import is_bson
from planlang.ontology.checks import malformed, repair
from planlang.ontology.imports import ImportMap
from planlang.ontology.map_file import OCCUPANCY_GRID, read_map_file, sensed_map
from planlang.ontology.moved_names import use_canonical_names
from planlang.ontology.terms import OWL, RDF, SOMA, BNode, Triple
from planlang.ontology.triples import Parsed, Triples
from planlang.records import dataclass


class Syntax(Enum):
    """Syntaxes that can be read. N-Triples is a subset of Turtle and read as that."""

    RDFXML = "RDF/XML"
    MANCHESTER = "Manchester syntax"
    TURTLE = "Turtle"
    FUNCTIONAL = "functional syntax"
    OWLXML = "OWL/XML"
    NEEM = "JSON or BSON of a NEEM"
    """Triples of an episodic memory of EASE, with the poses beside it."""
    URDF = "URDF"
    """World, read as the statements of a semantic map."""
    GRID = "YAML of an occupancy grid"
    """Map of ROS map_server, read as the statement that there is such a map."""


_MANCHESTER = re.compile(
    r"(?:Prefix|Namespace|Ontology|Import|Annotations|Class|ObjectProperty|DataProperty|AnnotationProperty|Datatype"
    r"|Individual|EquivalentClasses|DisjointClasses|EquivalentProperties|DisjointProperties|SameIndividual"
    r"|DifferentIndividuals):(?=\s|$|<)"
)
_FUNCTIONAL = re.compile(r"(?:Prefix|Ontology)[ \t\r\n]*\(")
_PROLOG = r"(?:\s|<\?[^>]*\?>|<!--.*?-->|<!DOCTYPE[^>\[]*(?:\[[^\]]*\]\s*)?>)*+"
"""What may be in an XML file before its root element."""
_URDF = re.compile(rf"{_PROLOG}<robot\b", re.DOTALL)
_OWLXML = re.compile(rf"{_PROLOG}<(?:[\w.-]+:)?Ontology\b(?![^<>]*\s(?:\w+:)?(?:about|ID)\s*=)", re.DOTALL)
_GRID = re.compile(r"(?:image|resolution|origin|negate|occupied_thresh|free_thresh|mode)[ \t]*:[ \t\r\n]")
_GRID_ENTRY = re.compile(r"""(?:^|[{,])[ \t]*["']?(?:image|resolution)["']?[ \t]*:[ \t\r\n]""", re.MULTILINE)
"""An entry of such a YAML file that may come after others, of whatever name."""
_SENSED = re.compile(rb"#|VERS|ply[\r\n]|[-+0-9]|[nN]a[nN][ \t]")
"""First bytes of octrees and point clouds; a quick test before the full patterns."""
_COMMENTS = re.compile(r"(?:[^\S\r\n]*(?:#[^\r\n]*)?(?:\r\n?|\n))*(?:[^\S\r\n]*#[^\r\n]*\Z)?")
"""Blank lines and comments at the start of a file."""
_TURTLE = re.compile(
    r"""@prefix\b|@base\b|(?i:prefix|base)\s
      | <(?:[^<>\s]*://|urn:|tag:|file:|[#/]|>)  # an IRI; no element of XML is written so
      | _:[\w] | [\[(]
      | (?:[^\W\d_][\w.-]*)?:(?!//)[^\s:]*\s+(?:a\s|<|[\w.-]*:)""",
    re.VERBOSE,
)


_NEEM = re.compile(r"\[?\s*\{(?=[^}]*\"s\"\s*:)(?=[^}]*\"p\"\s*:)")
_OTHERS = {
    "a list of transforms (tf)": (
        re.compile(r"\[?\s*\{[^{}]*(?:\{[^{}]*(?:\{[^{}]*\}[^{}]*)?\}[^{}]*)*\"(?:child_frame_id|transforms)\"\s*:"),
        "poses of a NEEM are read with its triples: put this file beside them, as tf.json",
    ),
    "JSON": (re.compile(r"\{\s*[\"}]|\[\s*\{"), "convert it to Turtle or RDF/XML first; JSON-LD is not read"),
    "YAML": (
        re.compile(r"---\s|[^\s:#@<][^:\r\n]*:[ \t]*(?:#[^\r\n]*)?\r?\n[ \t]+[^\s:][^:\r\n]*:(?=[ \t\r\n])"),
        "of YAML files, those of occupancy grids are read, which name an image and its resolution",
    ),
}
"""Formats that are not read: their beginning, and advice."""


def syntax_of(text: str, file: str) -> Syntax:
    """Detect the syntax of a file's text by its first words. Raises BadInput if it is unknown."""
    comments = _COMMENTS.match(text)
    assert comments is not None
    position = comments.end()
    start = text[position : position + 10_000].lstrip()[:2000]
    if _MANCHESTER.match(start):
        return Syntax.MANCHESTER
    if _FUNCTIONAL.match(start):
        return Syntax.FUNCTIONAL
    if _GRID.match(start):
        return Syntax.GRID
    if _NEEM.match(start):
        return Syntax.NEEM
    other = next((name for name, (beginning, _) in _OTHERS.items() if beginning.match(start)), None)
    if other is None and _TURTLE.match(start):
        return Syntax.TURTLE
    if _URDF.match(text, position):
        return Syntax.URDF
    if _OWLXML.match(text, position):
        return Syntax.OWLXML
    if start.startswith("<"):
        return Syntax.RDFXML
    if not start:
        raise BadInput([error("O002", "the file is empty, or has comments only", Span(file))])
    if _GRID_ENTRY.search(start):
        return Syntax.GRID
    span = Span(file, text.count("\n", 0, position) + 1)
    if other is not None:
        raise BadInput([error("O001", f"this is {other}, not an ontology", span, _OTHERS[other][1])])
    message = "this is neither RDF/XML, OWL/XML, Turtle, functional nor Manchester syntax"
    advice = (
        "an ontology begins with <rdf:RDF>, <Ontology>, @prefix (Turtle), Prefix( or Ontology( (functional syntax), or "
        "Prefix: or Ontology: (Manchester syntax)"
    )
    raise BadInput([error("O001", message, span, advice)])


def read_syntax(content: bytes, file: str, *, base: str, label: str) -> Parsed:
    """Read the triples of a file in any syntax. Raises BadInput as the reader of its syntax does."""
    if _SENSED.match(content) and (cls := sensed_map(content)) is not None:
        return read_map_file(Path(file), base, cls)
    is_dump = is_bson(content)
    text = "" if is_dump else decode(content, file)
    syntax = Syntax.NEEM if is_dump else syntax_of(text, file)
    if syntax is Syntax.GRID:
        return read_map_file(Path(file), base, OCCUPANCY_GRID)
    read = resolve_name(_READERS[syntax])  # imported late: each reader has its parser, which no other syntax needs
    parsed: Parsed
    if syntax is Syntax.URDF:
        parsed = read(Path(file))
        return parsed
    if syntax is Syntax.NEEM:
        parsed = read(Path(file), content, is_file=Path(file).is_file() and Path(file).read_bytes() == content)
        return parsed
    parsed = read(text, file, base=base, label=label)
    parsed.is_alone = True
    return parsed


_READERS = {
    Syntax.RDFXML: "planlang.ontology.rdfxml:read_rdfxml",
    Syntax.MANCHESTER: "planlang.ontology.manchester:read_manchester",
    Syntax.TURTLE: "planlang.ontology.turtle:read_turtle",
    Syntax.FUNCTIONAL: "planlang.ontology.functional:read_functional",
    Syntax.OWLXML: "planlang.ontology.owlxml:read_owlxml",
    Syntax.NEEM: "planlang.ontology.neem:read_neem",
    Syntax.URDF: "planlang.ontology.urdf_world:read_world",
}
"""Module and function of each reader, imported when a file needs it: lark and pyoxigraph are slow to import."""


_IN_IRIS = "@:+,;=~!$&'()*"
"""Characters of a file name that are not percent-encoded in its IRI."""
MOST_DOCUMENTS = 200
"""Greatest number of files of one ontology."""

VOCABULARY = (
    "knowrob", "srdl", "roboearth", "dul", "motion_constraints", "object_change", "primitives", "recovery", "searching",
)  # fmt: skip
"""Bundled files that every ontology includes, before those in objects/ and the library of recipes."""
ALIGNED = {"soma": SOMA}
"""Bundled file -> namespace that it relates to the vocabulary; every ontology that uses names of that includes it."""


_CACHE = Cache("ontology", most=100)
"""Triples of bundled files, keyed by the digests of the file and of the reader's source."""
_OWN = Cache("documents", most=100)
"""The same of the user's files, apart from those so that many of them do not displace the vocabulary."""


@dataclass(frozen=True, slots=True)
class Document:
    """File that was read: its path, its ontology IRI, the SHA-256 of its bytes, and its syntax if it is text."""

    path: Path
    iri: str | None
    sha256: str
    syntax: Syntax | None = None


@dataclass(frozen=True, slots=True)
class Reading:
    """Document with its triples, which are repaired and have canonical names."""

    document: Document
    triples: Triples
    diagnostics: tuple[Diagnostic, ...]
    unread: tuple[Diagnostic, ...] = ()


def read_bytes(path: Path) -> bytes:
    """Read the bytes of an ontology file. Raises BadInput if it is missing, unreadable or too large."""
    return read_file(path, "O001", largest=LARGEST_ONTOLOGY, code_if_large="O003")


def base_of(path: Path) -> str:
    """IRI against which a file's relative IRIs are resolved; without folders, so that outputs do not depend on them."""
    return f"file:///{quote(os.fsencode(path.name), safe=_IN_IRIS)}"


def _read(path: Path, content: bytes, *, is_file: bool = True) -> Reading:
    """Read a document; what was read of a file before is taken from a cache, if there was nothing to report."""
    file = str(path)
    digest = hashlib.sha256(content).hexdigest()
    base, label = base_of(path), f"{digest[:8]}-"
    cache, key = _CACHE if is_bundled(path) else _OWN, f"{digest} {base} {_reader_digest()}"
    packed = cache.load(key) if is_file else None
    if packed is not None:
        with suppress(ValueError):
            triples = Triples.unpacked(packed, file)
            return Reading(Document(path, _own_iri(triples), digest, _syntax(path, content)), triples, ())
    parsed = read_syntax(content, file, base=base, label=label)
    triples = parsed.triples
    repairs = (*use_canonical_names(triples), *repair(triples), *without_annotations(triples))
    diagnostics = (*parsed.diagnostics, *repairs, *malformed(triples))
    if is_file and parsed.is_alone and not diagnostics and not parsed.unread:
        cache.keep(key, triples.packed())
    for other in parsed.others:
        digest = hashlib.sha256(digest.encode() + other).hexdigest()
    document = Document(path, _own_iri(triples), digest, _syntax(path, content) if parsed.is_alone else None)
    return Reading(document, triples, diagnostics, tuple(parsed.unread))


def _syntax(path: Path, content: bytes) -> Syntax:
    """Syntax of a file that was read."""
    return Syntax.MANCHESTER if is_bundled(path) else syntax_of(decode(content, str(path)), str(path))


@cache
def _reader_digest() -> str:
    """Digest of the source of this package, which shapes the cached triples."""
    here = Path(__file__).parent
    digest = hashlib.sha256()
    for path in sorted([*here.glob("*.py"), *here.glob("*.lark")]):
        digest.update(path.read_bytes())
    return digest.hexdigest()


def is_bundled(path: Path) -> bool:
    """Check whether a file is one of planlang's own."""
    if path.suffix != ".omn":
        return False
    real = path.resolve()
    return any(real.is_relative_to(bundled(folder).resolve()) for folder in ("ontologies", "recipes"))


def stated(path: Path) -> tuple[str, ...]:
    """IRI and version IRIs that an ontology file states, by which others import it; none if it cannot be read."""
    try:
        reading = _version(path, *_stamp(path))
    except BadInput:
        return ()
    versions = (reading.triples.triple(row).object for row in reading.triples.by(OWL.versionIRI))
    return tuple(name for name in (reading.document.iri, *versions) if isinstance(name, str))


def _own_iri(triples: Triples) -> str | None:
    ontology = triples.find(OWL.Ontology)
    rows = (row for row in triples.by(RDF.type) if triples.objects[row] == ontology) if ontology is not None else ()
    names = (triples.name(triples.subjects[row]) for row in rows)
    return next((name for name in names if name is not None), None)


def read_all(
    path: Path, folders: Sequence[Path], *, builtin: bool, also: Sequence[Path] = (), content: bytes | None = None
) -> list[Reading]:
    """Read a file, the files of ``also``, all imports depth first, then the bundled vocabulary.

    With ``content`` the main document is untrusted text, such as an upload, and no file beside it is read. Raises
    BadInput if the file or one of ``also`` cannot be used; an unusable import is a warning of the main document, and if
    it is or may be a world, also unread.
    """
    main_content = read_bytes(path) if content is None else content
    readings = [
        _read(path, main_content, is_file=content is None),
        *(_version(named, *_stamp(named)) for named in also),
    ]
    main = readings[0]
    loaded = {named.resolve() for named in (path, *also)}
    digests = {reading.document.sha256 for reading in readings}
    imports = ImportMap(path, folders, stated, is_file=content is None)
    problems: list[Diagnostic] = []
    lost = list(main.unread)
    vocabulary = {file.resolve(): file for file in _vocabulary_paths()} if builtin else {}
    pending: list[tuple[Path, Iterator[Triple]]] = [(one.document.path, _imports(one)) for one in readings[::-1]]
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
            if resolution.path is None and target.lower().endswith(WORLDS):
                lost.append(_lost(target, triple.span, resolution.problem.help))
        imported = resolution.path
        if imported is None or (resolved := imported.resolve()) in loaded or resolved in vocabulary:
            continue
        loaded.add(resolved)
        if len(readings) >= MOST_DOCUMENTS:
            message = f"more than {MOST_DOCUMENTS} files are imported; the rest is ignored"
            problems.append(warning("O033", message, triple.span))
            lost.append(_lost(target, triple.span))
            break
        try:
            reading = _version(imported, *_stamp(imported))
        except BadInput as problem:
            first = problem.diagnostics[0]
            message = f"an import cannot be read: {first.span}: {first.message}"
            problems.append(warning("O034", message, triple.span, first.help))
            lost.append(_lost(target, triple.span, first.help))
            continue
        if reading.document.sha256 not in digests:
            digests.add(reading.document.sha256)
            readings.append(reading)
            pending.append((imported, _imports(reading)))
    problems += imports.problems
    if builtin:
        vocabulary |= {file.resolve(): file for file in _alignments(readings)}
    readings += [_version(file, *_stamp(file)) for resolved, file in vocabulary.items() if resolved not in loaded]
    return [replace(main, diagnostics=(*main.diagnostics, *problems), unread=tuple(lost)), *readings[1:]]


WORLDS = (".urdf", ".yaml", ".yml", ".pcd", ".ply", ".xyz", ".bt", ".ot")
"""Suffixes of files with shapes; a missing import of OWL may be a vocabulary."""


def _lost(target: str, span: Span, help: str | None = None) -> Diagnostic:
    return unread("M034", f"nothing of an import is in the world: {target[:200]}", span, help)


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
    library = bundled("recipes") / "library"
    paths += (*sorted((folder / "objects").glob("*.omn")), *sorted(library.glob("*.omn")))
    return tuple(path for path in paths if path.is_file())


def _alignments(readings: Iterable[Reading]) -> Iterator[Path]:
    """Yield the bundled files that relate names of the documents to those of the vocabulary."""
    for name, namespace in ALIGNED.items():
        if any(isinstance(term, str) and term.startswith(namespace) for one in readings for term in one.triples.terms):
            yield bundled("ontologies") / f"{name}.omn"


def _stamp(path: Path) -> tuple[int, int]:
    """Modification time [ns] and size [bytes] of a file, which change with its content; zeros if there is none."""
    try:
        status = path.stat()
    except (OSError, ValueError):
        return 0, 0
    return status.st_mtime_ns, status.st_size


@lru_cache(2 * MOST_DOCUMENTS)
def _version(path: Path, modified: int, size: int) -> Reading:
    """Read one version of a file; cached, as a process that loads many recipes shares their imports."""
    return _read(path, read_bytes(path))
