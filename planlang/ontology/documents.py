"""Read a file and all its imports in load order.

Imports are searched beside the file, in the folders that the user gives, and among the bundled ontologies. Nothing is
ever fetched from the network, and nothing outside these folders is read, whatever path an import has.
"""

from __future__ import annotations

import glob
import hashlib
import os
import re
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from enum import Enum
from functools import cache, lru_cache
from importlib import import_module
from pathlib import Path
from urllib.parse import quote, unquote

from planlang.cache import Cache
from planlang.diagnostics import BadInput, Diagnostic, Span, error, unread, warning
from planlang.files import LARGEST_ONTOLOGY, bundled, decode, read_file
from planlang.ontology.annotations import without_annotations
from planlang.ontology.checks import HOST, OLD_HOST, canonical, malformed, repair, use_canonical_names
from planlang.ontology.map_file import OCCUPANCY_GRID, read_map_file, sensed_map
from planlang.ontology.terms import OWL, RDF, RDFS, VOCABULARIES, BNode, Triple
from planlang.ontology.triples import Parsed, Triples
from planlang.records import dataclass


class Syntax(Enum):
    """Syntaxes that can be read. N-Triples is a subset of Turtle and read as that."""

    RDFXML = "RDF/XML"
    MANCHESTER = "Manchester syntax"
    TURTLE = "Turtle"
    FUNCTIONAL = "functional syntax"
    OWLXML = "OWL/XML"
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
    if _TURTLE.match(start):
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
    advice = (
        "an ontology begins with <rdf:RDF> (RDF/XML), @prefix (Turtle), or Prefix: or Ontology: (Manchester syntax)"
    )
    raise BadInput([error("O001", "this is neither RDF/XML, Turtle nor Manchester syntax", span, advice)])


def read_syntax(content: bytes, file: str, *, base: str, label: str) -> Parsed:
    """Read the triples of a file in any syntax. Raises BadInput as the reader of its syntax does."""
    if _SENSED.match(content) and (cls := sensed_map(content)) is not None:
        return read_map_file(Path(file), base, cls)
    text = decode(content, file)
    syntax = syntax_of(text, file)
    if syntax is Syntax.GRID:
        return read_map_file(Path(file), base, OCCUPANCY_GRID)
    module, name = _READERS[syntax]
    read = getattr(import_module(f"planlang.ontology.{module}"), name)
    if syntax is Syntax.URDF:
        parsed: Parsed = read(Path(file))
        return parsed
    parsed = read(text, file, base=base, label=label)
    parsed.is_alone = True
    return parsed


_READERS = {
    Syntax.RDFXML: ("rdfxml", "read_rdfxml"),
    Syntax.MANCHESTER: ("manchester", "read_manchester"),
    Syntax.TURTLE: ("turtle", "read_turtle"),
    Syntax.FUNCTIONAL: ("functional", "read_functional"),
    Syntax.OWLXML: ("owlxml", "read_owlxml"),
    Syntax.URDF: ("urdf_world", "read_world"),
}
"""Module and function of each reader, imported when a file needs it: lark and pyoxigraph are slow to import."""


_IN_IRIS = "@:+,;=~!$&'()*"
"""Characters of a file name that are not percent-encoded in its IRI."""
MOST_DOCUMENTS = 200
"""Greatest number of files of one ontology."""

VOCABULARY = (
    "knowrob", "srdl", "roboearth", "dul", "soma", "motion_constraints", "object_change", "primitives", "recovery",
    "searching",
)  # fmt: skip
"""Bundled files that every ontology includes, before those in objects/ and the library of recipes."""


_CACHE = Cache("ontology", most=100)
"""Triples of bundled files, keyed by the digests of the file and of the reader's source."""
_OWN = Cache("documents", most=100)
"""The same of the user's files, apart from those so that many of them do not displace the vocabulary."""


@dataclass(frozen=True, slots=True)
class Document:
    """File that was read: its path, its ontology IRI, and the SHA-256 of its bytes."""

    path: Path
    iri: str | None
    sha256: str


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
    cache, key = _CACHE if _is_bundled(path) else _OWN, f"{digest} {base} {_reader_digest()}"
    packed = cache.load(key) if is_file else None
    if packed is not None:
        with suppress(ValueError):
            triples = Triples.unpacked(packed, file)
            return Reading(Document(path, _own_iri(triples), digest), triples, ())
    parsed = read_syntax(content, file, base=base, label=label)
    triples = parsed.triples
    repairs = (*use_canonical_names(triples), *repair(triples), *without_annotations(triples))
    diagnostics = (*parsed.diagnostics, *repairs, *malformed(triples))
    if is_file and parsed.is_alone and not diagnostics and not parsed.unread:
        cache.keep(key, triples.packed())
    for other in parsed.others:
        digest = hashlib.sha256(digest.encode() + other).hexdigest()
    return Reading(Document(path, _own_iri(triples), digest), triples, diagnostics, tuple(parsed.unread))


@cache
def _reader_digest() -> str:
    """Digest of the source of this package, which shapes the cached triples."""
    here = Path(__file__).parent
    digest = hashlib.sha256()
    for path in sorted([*here.glob("*.py"), *here.glob("*.lark")]):
        digest.update(path.read_bytes())
    return digest.hexdigest()


def _is_bundled(path: Path) -> bool:
    folders = (bundled("ontologies").resolve(), bundled("recipes").resolve())
    return path.suffix == ".omn" and any(path.resolve().is_relative_to(folder) for folder in folders)


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
    imports = ImportMap(path, folders, is_file=content is None)
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
            if target.lower().endswith(WORLDS):
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


LONGEST_PATH = 24
"""Last folders of an import's path that are used; they bound the search in a hostile file."""

VOCABULARY_FILES: dict[str, str | None] = {
    "knowrob": "knowrob.omn",
    "srdl2": "srdl.omn",
    "srdl2-comp": "srdl.omn",
    "srdl2-cap": "srdl.omn",
    "srdl2-action": "srdl.omn",
    "srdl": "srdl.omn",
    "roboearth": "roboearth.omn",
    "motion-constraints": "motion_constraints.omn",
    "object-change": "object_change.omn",
    "primitives": "primitives.omn",
    "recovery": "recovery.omn",
    "searching": "searching.omn",
    "computable": None,
    "comp_spatial": None,
    "comp_temporal": None,
    "comp_cop": None,
}
"""Vocabulary -> the bundled file that replaces it; None: nothing is needed, as it only binds terms to programs."""

_LANGUAGES = tuple(namespace.rstrip("#") for namespace in (OWL, RDF, RDFS))
_HOSTS = (HOST, OLD_HOST, "http://www.roboearth.org/kb/")
_SUFFIXES = ("", ".omn", ".owl", ".owl.in", ".ttl", ".nt", ".rdf")
_URL = re.compile(r"([A-Za-z][A-Za-z0-9+.-]*):(//)?(.*)", re.DOTALL)
_TEMPLATE = re.compile(r"@\w+@|\$\{[^}]*\}")
_HEADING = re.compile(r"^[ \t]*Ontology:\s*<([^<>\s]*)>", re.MULTILINE)


@dataclass(frozen=True, slots=True)
class Resolution:
    """Resolved import: a file, or the diagnostic why there is none. Both None: nothing has to be read."""

    path: Path | None = None
    problem: Diagnostic | None = None


class ImportMap:
    """Finds the files of imports, beside the importing file, then in ``folders`` in their order.

    Without ``is_file`` the main document is untrusted text: its folder is not searched, and diagnostics do not reveal
    which other files exist.
    """

    def __init__(self, main: Path, folders: Sequence[Path] = (), *, is_file: bool = True) -> None:
        self._folders = tuple(folders)
        self._bundled = bundled("ontologies")
        self._is_file = is_file
        own = (main.parent, main.resolve().parent) if is_file else ()
        self._roots = tuple(root.resolve() for root in (*own, *folders, self._bundled))

    def resolve(self, target: str, importing: Path, span: Span) -> Resolution:
        """Find the file that ``target`` refers to in the file ``importing``."""
        address = canonical(target).rstrip("#")
        if address in _LANGUAGES:
            return Resolution()
        scheme, path = _split(target)
        remote = scheme not in ("", "file", "package")
        if self._is_inside(importing, self._bundled):
            bundled_first = self._bundled_file(address, path, remote)
            if bundled_first is not None:
                return Resolution(bundled_first)
        escaped = False
        for candidate in self._candidates(path, importing.parent):
            file = _file(candidate)
            if file is None:
                continue
            if any(self._is_inside(file, root) for root in self._roots):
                return Resolution(file)
            escaped = self._is_file
        vocabulary = _vocabulary(address, path, remote)
        if vocabulary in VOCABULARY_FILES:
            name = VOCABULARY_FILES[vocabulary]
            return Resolution(self._bundled / name if name else None)
        substitute = self._bundled_file(address, path, remote) or self._versioned_file(path, importing.parent)
        if substitute is not None:
            return Resolution(substitute)
        return Resolution(problem=_unresolved(target, path, span, remote=remote, escaped=escaped or ".." in path))

    def _candidates(self, path: tuple[str, ...], beside: Path) -> Iterator[Path]:
        """Yield the path itself, then ever shorter ends of it in every folder, each with all suffixes of ontologies.

        Published files import by paths of their authors' machines, of which only the last parts exist elsewhere.
        """
        if not path:
            return
        names = _names(path[-1])
        parents = path[:-1]
        yield from (beside.joinpath(*parents, name) for name in names)
        yield from (Path("/", *parents, name) for name in names if ".." not in parents)
        plain = len(parents) - next((i for i, part in enumerate(reversed(parents)) if part == ".."), len(parents))
        for folder in (beside, *self._folders):
            for start in range(plain, len(parents) + 1):
                yield from (folder.joinpath(*parents[start:], name) for name in names)

    def _versioned_file(self, path: tuple[str, ...], beside: Path) -> Path | None:
        """Find a file with the name of an import plus ``@`` and a version, as ``serve_drink@hydro.owl``."""
        if not path:
            return None
        stem = glob.escape(_stem(path[-1]))
        files = (file for folder in (beside, *self._folders) for file in sorted(folder.glob(f"{stem}@*")))
        usable = (file for file in files if file.name.endswith(_SUFFIXES[1:]) and _file(file) is not None)
        return next((file for file in usable if any(self._is_inside(file, root) for root in self._roots)), None)

    def _bundled_file(self, address: str, path: tuple[str, ...], remote: bool) -> Path | None:
        """Find a bundled file by name; the ontology IRI has to match too if the import is by address."""
        if not path:
            return None
        stem = _stem(path[-1])
        for folder in ("", "robots", "environments", "objects"):
            candidate = self._bundled / folder / f"{stem}.omn"
            if _file(candidate) is not None and (not remote or _address(candidate) == address):
                return candidate
        return None

    @staticmethod
    def _is_inside(path: Path, root: Path) -> bool:
        return path.resolve().is_relative_to(root.resolve())


def _split(target: str) -> tuple[str, tuple[str, ...]]:
    """Split an import into scheme and path, without host and unexpanded build variables (``@PREFIX@``)."""
    match = _URL.fullmatch(target)
    scheme, rest = (match[1].lower(), match[3]) if match else ("", target)
    if match and match[2] and scheme not in ("file", "package"):
        rest = rest.partition("/")[2]
    rest = _TEMPLATE.sub("", unquote(rest.partition("#")[0]).replace("\\", "/"))
    return scheme, tuple([part for part in rest.split("/") if part not in ("", ".")][-LONGEST_PATH:])


def _names(name: str) -> tuple[str, ...]:
    return tuple(dict.fromkeys((name, *(_stem(name) + suffix for suffix in _SUFFIXES))))


def _stem(name: str) -> str:
    for suffix in (".owl.in", ".owl", ".omn", ".rdf", ".xml", ".ttl", ".nt"):
        if name.lower().endswith(suffix):
            return name[: -len(suffix)]
    return name


def _file(path: Path) -> Path | None:
    try:
        return path.resolve() if path.is_file() else None
    except (OSError, ValueError, RuntimeError):  # name too long, null character, cyclic links
        return None


def _vocabulary(address: str, path: tuple[str, ...], remote: bool) -> str:
    if remote:
        return _vocabulary_addresses().get(address, "")
    return _stem(path[-1]) if path else ""


@cache
def _vocabulary_addresses() -> dict[str, str]:
    """Every address under which a vocabulary was ever published -> its name."""
    known = {f"{host}{name}.owl": name for host in _HOSTS for name in VOCABULARY_FILES}
    return known | {namespace.rstrip("#"): name for name, namespace in VOCABULARIES.items()}


@cache
def _address(path: Path) -> str | None:
    try:
        match = _HEADING.search(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError):
        return None
    return match[1] if match else None


def _unresolved(target: str, path: tuple[str, ...], span: Span, *, remote: bool, escaped: bool) -> Diagnostic:
    if remote:
        advice = (
            "nothing is fetched from the network; put the file beside this one, or add its folder: --ontologies DIR"
        )
        return warning("O031", f"an import of an unknown address is ignored: {target}", span, advice)
    name = path[-1] if path else target
    if escaped:
        advice = f"allow it with --ontologies DIR, where DIR is the folder of {name}"
        return warning("O032", f"an import from outside the allowed folders is ignored: {target}", span, advice)
    advice = f"put {name} beside this file, or add its folder with --ontologies DIR"
    return warning("O030", f"import not found: {target}", span, advice)
