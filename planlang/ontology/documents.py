"""Read a file and all its imports in load order.

Imports are looked for beside the file, in the folders that the user gives, and among the bundled ontologies. Nothing is
ever fetched, and nothing is read outside these folders, whatever an import says.
"""

from __future__ import annotations

import glob
import hashlib
import os
import re
from collections.abc import Iterator, Sequence
from enum import Enum
from functools import cache, lru_cache
from importlib import import_module
from pathlib import Path
from urllib.parse import quote, unquote

from planlang.cache import Cache
from planlang.diagnostics import BadInput, Diagnostic, Span, error, warning
from planlang.files import LARGEST_ONTOLOGY, bundled, decode, read_file
from planlang.ontology.checks import HOST, OLD_HOST, canonical, malformed, repair, use_canonical_names
from planlang.ontology.map_file import OCCUPANCY_GRID, read_map_file, sensed_map
from planlang.ontology.terms import OWL, RDF, RDFS, VOCABULARIES, BNode, Triple
from planlang.ontology.triples import Parsed, Triples
from planlang.records import dataclass


class Syntax(Enum):
    """The syntaxes of OWL that are read. N-Triples is read as Turtle, of which it is a part."""

    RDFXML = "RDF/XML"
    MANCHESTER = "Manchester syntax"
    TURTLE = "Turtle"
    URDF = "URDF"
    """A world: read as the statements of a map."""
    GRID = "YAML of an occupancy grid"
    """As ROS map_server writes it: read as the statement of such a map."""


_MANCHESTER = re.compile(
    r"(?:Prefix|Namespace|Ontology|Import|Annotations|Class|ObjectProperty|DataProperty|AnnotationProperty|Datatype"
    r"|Individual|EquivalentClasses|DisjointClasses|EquivalentProperties|DisjointProperties|SameIndividual"
    r"|DifferentIndividuals):(?=\s|$|<)"
)
_URDF = re.compile(r"(?:\s|<\?[^>]*\?>|<!--.*?-->|<!DOCTYPE[^>\[]*(?:\[[^\]]*\]\s*)?>)*+<robot\b", re.DOTALL)
_GRID = re.compile(r"(?:image|resolution|origin|negate|occupied_thresh|free_thresh|mode)[ \t]*:[ \t\r\n]")
_SENSED = re.compile(rb"#|VERS|ply[\r\n]|[-+0-9]")
"""The beginnings that files of octrees and points may have."""
_NOTHING_SAID = re.compile(r"(?:[^\S\r\n]*(?:#[^\r\n]*)?(?:\r\n?|\n))*(?:[^\S\r\n]*#[^\r\n]*\Z)?")
_TURTLE = re.compile(
    r"""@prefix\b|@base\b|(?i:prefix|base)\s
      | <(?:[^<>\s]*://|urn:|tag:|file:|[#/]|>)  # an IRI; no element of XML is written so
      | _:[\w] | [\[(]
      | (?:[^\W\d_][\w.-]*)?:(?!//)[^\s:]*\s+(?:a\s|<|[\w.-]*:)""",
    re.VERBOSE,
)


def syntax_of(text: str, file: str) -> Syntax:
    """Return the syntax of a file's text. Raises BadInput if it is none of the known ones."""
    beginning = _NOTHING_SAID.match(text)
    assert beginning is not None
    position = beginning.end()
    start = text[position : position + 10_000].lstrip()[:2000]
    if _MANCHESTER.match(start):
        return Syntax.MANCHESTER
    if _GRID.match(start):
        return Syntax.GRID
    if _TURTLE.match(start):
        return Syntax.TURTLE
    if _URDF.match(text, position):
        return Syntax.URDF
    if start.startswith("<"):
        return Syntax.RDFXML
    if not start:
        raise BadInput([error("O002", "the file holds nothing but comments", Span(file))])
    span = Span(file, text.count("\n", 0, position) + 1)
    advice = "an ontology is RDF/XML (rdf:RDF), Turtle (@prefix) or in Manchester syntax (Prefix:, Ontology:, Class:)"
    raise BadInput([error("O001", "this is neither RDF/XML, Turtle nor Manchester syntax", span, advice)])


def read_syntax(content: bytes, file: str, *, base: str, label: str) -> Parsed:
    """Return the triples of a file in any of the syntaxes. Raises BadInput as their readers do."""
    if _SENSED.match(content) and (cls := sensed_map(content)) is not None:
        return read_map_file(Path(file), base, cls)
    text = decode(content, file)
    syntax = syntax_of(text, file)
    if syntax is Syntax.GRID:
        return read_map_file(Path(file), base, OCCUPANCY_GRID)
    module, name = _READERS[syntax]
    read = getattr(import_module(f"planlang.ontology.{module}"), name)
    parsed: Parsed = read(Path(file)) if syntax is Syntax.URDF else read(text, file, base=base, label=label)
    return parsed


_READERS = {
    Syntax.RDFXML: ("rdfxml", "read_rdfxml"),
    Syntax.MANCHESTER: ("manchester", "read_manchester"),
    Syntax.TURTLE: ("turtle", "read_turtle"),
    Syntax.URDF: ("urdf_world", "read_world"),
}
"""Module and function that read a syntax; each is imported when a file needs it, as some take long to import."""


_IN_IRIS = "@:+,;=~!$&'()*"
"""Characters of a file's name that stay as they are."""
MOST_DOCUMENTS = 200
"""Files that one ontology may be made of."""

VOCABULARY = (
    "knowrob", "srdl", "roboearth", "dul", "soma", "motion_constraints", "object_change", "primitives", "recovery",
    "searching",
)  # fmt: skip
"""Bundled files that every ontology has, then objects/, and the library of recipes."""


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
    return read_file(path, "O001", largest=LARGEST_ONTOLOGY, code_if_large="O003")


def base_of(path: Path) -> str:
    """Return the IRI against which the relative names of a file are resolved; of its folders it tells nothing."""
    return f"file:///{quote(os.fsencode(path.name), safe=_IN_IRIS)}"


def _read(path: Path, content: bytes) -> Reading:
    file = str(path)
    digest = hashlib.sha256(content).hexdigest()
    base, label = base_of(path), f"{digest[:8]}-"
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
    for other in parsed.others:
        digest = hashlib.sha256(digest.encode() + other).hexdigest()
    return Reading(Document(path, _own_iri(triples), digest), triples, diagnostics)


@cache
def _reader_digest() -> str:
    """Return a digest of the source of everything that shapes the triples."""
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


def read_all(
    path: Path, folders: Sequence[Path], *, builtin: bool, also: Sequence[Path] = (), content: bytes | None = None
) -> list[Reading]:
    """Return the file, those that are named beside it, the imports of all depth first, then the bundled vocabulary.

    With ``content`` the first is no file but a stranger's text under that name: nothing beside it is looked at.
    Raises BadInput if a named file cannot be used; an import that cannot be is a warning of the main document.
    """
    main_content = read_bytes(path) if content is None else content
    readings = [_read(path, main_content), *(_version(named, *_stamp(named)) for named in also)]
    main = readings[0]
    loaded = {named.resolve() for named in (path, *also)}
    digests = {reading.document.sha256 for reading in readings}
    imports = ImportMap(path, folders, is_file=content is None)
    problems: list[Diagnostic] = []
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
        found = resolution.path
        if found is None or (resolved := found.resolve()) in loaded or resolved in vocabulary:
            continue
        loaded.add(resolved)
        if len(readings) >= MOST_DOCUMENTS:
            problems.append(warning("O033", f"more than {MOST_DOCUMENTS} files are imported", triple.span))
            break
        try:
            reading = _version(found, *_stamp(found))
        except BadInput as problem:
            first = problem.diagnostics[0]
            message = f"an import cannot be read: {first.span}: {first.message}"
            problems.append(warning("O034", message, triple.span, first.help))
            continue
        if reading.document.sha256 not in digests:
            digests.add(reading.document.sha256)
            readings.append(reading)
            pending.append((found, _imports(reading)))
    readings += [_version(file, *_stamp(file)) for resolved, file in vocabulary.items() if resolved not in loaded]
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
    library = bundled("recipes") / "library"
    more = (*sorted((folder / "objects").glob("*.omn")), *sorted(library.glob("*.omn")))
    return tuple(path for path in (*paths, *more) if path.is_file())


def _stamp(path: Path) -> tuple[int, int]:
    """Return what tells one version of a file from another: when it was changed [ns], and its size; 0 for none."""
    try:
        found = path.stat()
    except (OSError, ValueError):
        return 0, 0
    return found.st_mtime_ns, found.st_size


@lru_cache(2 * MOST_DOCUMENTS)
def _version(path: Path, modified: int, size: int) -> Reading:
    """Return what a version of a file says; a process that reads many files reads what all of them import once."""
    return _read(path, read_bytes(path))


LONGEST_PATH = 24
"""Folders in the path of an import that are looked at."""

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
"""Name of a vocabulary -> the bundled file that stands for it; None: it only binds terms to programs."""

_LANGUAGES = tuple(namespace.rstrip("#") for namespace in (OWL, RDF, RDFS))
_HOSTS = (HOST, OLD_HOST, "http://www.roboearth.org/kb/")
_SUFFIXES = ("", ".omn", ".owl", ".owl.in", ".ttl", ".nt", ".rdf")
_URL = re.compile(r"([A-Za-z][A-Za-z0-9+.-]*):(//)?(.*)", re.DOTALL)
_TEMPLATE = re.compile(r"@\w+@|\$\{[^}]*\}")
_HEADING = re.compile(r"^[ \t]*Ontology:\s*<([^<>\s]*)>", re.MULTILINE)


@dataclass(frozen=True, slots=True)
class Resolution:
    """The result of an import: a file, or the problem that there is none. Both None: nothing has to be read."""

    path: Path | None = None
    problem: Diagnostic | None = None


class ImportMap:
    """Finds files for imports. ``folders`` are searched in their order, after the importing file's own.

    If the main document ``is_file``, its own folder is one of them; else it is a stranger's text, who is not told
    either which other files there are.
    """

    def __init__(self, main: Path, folders: Sequence[Path] = (), *, is_file: bool = True) -> None:
        self._folders = tuple(folders)
        self._ours = bundled("ontologies")
        self._is_file = is_file
        own = (main.parent, main.resolve().parent) if is_file else ()
        self._roots = tuple(root.resolve() for root in (*own, *folders, self._ours))

    def resolve(self, target: str, importing: Path, span: Span) -> Resolution:
        """Return the file that ``target`` means in the file ``importing``."""
        address = canonical(target).rstrip("#")
        if address in _LANGUAGES:
            return Resolution()
        scheme, path = _split(target)
        remote = scheme not in ("", "file", "package")
        if self._is_inside(importing, self._ours):
            bundled_first = self._bundled(address, path, remote)
            if bundled_first is not None:
                return Resolution(bundled_first)
        escaped = False
        for candidate in self._candidates(path, importing.parent):
            found = _file(candidate)
            if found is None:
                continue
            if any(self._is_inside(found, root) for root in self._roots):
                return Resolution(found)
            escaped = self._is_file
        vocabulary = _vocabulary(address, path, remote)
        if vocabulary in VOCABULARY_FILES:
            name = VOCABULARY_FILES[vocabulary]
            return Resolution(self._ours / name if name else None)
        ours = self._bundled(address, path, remote) or self._of_a_version(path, importing.parent)
        if ours is not None:
            return Resolution(ours)
        return Resolution(problem=_unresolved(target, path, span, remote=remote, escaped=escaped or ".." in path))

    def _candidates(self, path: tuple[str, ...], beside: Path) -> Iterator[Path]:
        """Yield the path as it is, then ever shorter ends of it in every folder, with the suffixes of ontologies."""
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

    def _of_a_version(self, path: tuple[str, ...], beside: Path) -> Path | None:
        """Return a file that is named like the last part of a path, but for ``@`` and a version before its suffix."""
        if not path:
            return None
        stem = glob.escape(_stem(path[-1]))
        found = (file for folder in (beside, *self._folders) for file in sorted(folder.glob(f"{stem}@*")))
        usable = (file for file in found if file.name.endswith(_SUFFIXES[1:]) and _file(file) is not None)
        return next((file for file in usable if any(self._is_inside(file, root) for root in self._roots)), None)

    def _bundled(self, address: str, path: tuple[str, ...], remote: bool) -> Path | None:
        """Return a bundled file of this name; an address must be the one that the file gives itself."""
        if not path:
            return None
        stem = _stem(path[-1])
        for folder in ("", "robots", "environments", "objects"):
            candidate = self._ours / folder / f"{stem}.omn"
            if _file(candidate) is not None and (not remote or _address(candidate) == address):
                return candidate
        return None

    @staticmethod
    def _is_inside(path: Path, root: Path) -> bool:
        return path.resolve().is_relative_to(root.resolve())


def _split(target: str) -> tuple[str, tuple[str, ...]]:
    """Scheme and folders of an import, without host and without what a build should have filled in (``@PREFIX@``)."""
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
    except (OSError, ValueError, RuntimeError):  # a name too long, a null character, a circle of links
        return None


def _vocabulary(address: str, path: tuple[str, ...], remote: bool) -> str:
    if remote:
        return _vocabulary_addresses().get(address, "")
    return _stem(path[-1]) if path else ""


@cache
def _vocabulary_addresses() -> dict[str, str]:
    """Return every address under which a vocabulary was ever published -> its name."""
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
            "nothing is fetched from the network; save the file beside this one, or give its folder by --ontologies DIR"
        )
        return warning("O031", f"an import of an unknown address is left out: {target}", span, advice)
    name = path[-1] if path else target
    if escaped:
        advice = f"allow it by --ontologies DIR, where DIR is the folder of {name}"
        return warning("O032", f"an import outside the given folders is left out: {target}", span, advice)
    advice = f"put {name} beside this file, or give its folder by --ontologies DIR"
    return warning("O030", f"import not found: {target}", span, advice)
