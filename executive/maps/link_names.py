"""Maps that name links of a URDF, as those of KnowRob 2: classes in OWL, poses and shapes in the URDF.

An individual with ``hasBaseLinkName`` is the object that planlang reads from that link. The map imports the URDF, or it
lies beside the map, in a folder of imports, or in ``urdf`` of the map's package of ROS, and has its name or one stated
there (``hasPersistentIdentifier`` of what ``hasDataFormat`` URDF), or else most of the links that the map names.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from urllib.parse import quote

from planlang.designators import local_name
from planlang.diagnostics import BadInput, Diagnostic, note, unread
from planlang.ontology import Literal, Ontology, Triple, expand
from planlang.ontology.documents import Document, Reading, read_all
from planlang.ontology.terms import MOVED_LINKS, RDF, URDF_WORLDS
from planlang.ontology.triples import Triples
from planlang.words import Option, Text

LINKS = ("hasBaseLinkName", "hasURDFName")
"""Properties from an object to the name of its link."""
MOST, LARGEST = 50, 16_000_000
"""URDFs in a folder that are searched for links, and the greatest size of one [bytes]."""
_LINK = re.compile(rb"<link\s[^>]*?name\s*=\s*[\"']([^\"']*)[\"']")


def is_on_disk(document: Document) -> bool:
    """Check whether a document is the content of its file: files beside an uploaded text are not its own."""
    try:
        return document.path.is_file() and hashlib.sha256(document.path.read_bytes()).hexdigest() == document.sha256
    except OSError:
        return False


def with_links(ontology: Ontology, notes: list[Diagnostic]) -> Ontology:
    """Make each individual that names a link of a URDF the object of that link; errors are appended to ``notes``."""
    names: dict[str, str] = {}
    named: dict[str, Triple] = {}
    for triple in ontology.using(*LINKS):
        if isinstance(triple.object, Literal) and isinstance(triple.subject, str):
            names.setdefault(quote(triple.object.value.strip(), safe=""), triple.subject)
            named.setdefault(triple.subject, triple)
    worlds = [one for one in ontology.readings if one.document.iri and one.document.iri.startswith(URDF_WORLDS)]
    added = [] if worlds else list(_worlds(ontology, notes)) or list(_with_most(ontology, named, notes))
    if not worlds and not added:
        first = next(iter(named.values()))
        message = (
            f"{len(named)} objects are links of a URDF, such as {_shown(first)}, which is not here: they have no pose"
        )
        file = f"{Path(first.span.file).stem}.urdf"
        folder = Option("ontologies")
        help = Text("put it beside this file or into a folder of ", folder, f", as {file}, or import it (owl:imports)")
        notes.append(unread("M033", message, first.span, help))
        return ontology
    linked: set[str] = set()
    readings = [*(_linked(one, names, ontology, linked) for one in (*ontology.readings, *added))]
    notes += [diagnostic for one in added for diagnostic in one.unread]
    lost = [triple for thing, triple in named.items() if thing not in linked]
    if lost:
        message = (
            f"{len(lost)} of {len(named)} objects are links without a shape in the URDF, such as {_shown(lost[0])}"
        )
        notes.append(note("M033", message, lost[0].span))
    return ontology.made_of(readings)


def _text(stated: Triple) -> str:
    return stated.object.value.strip() if isinstance(stated.object, Literal) else str(stated.object)


def _shown(link: Triple) -> str:
    return f"{local_name(str(link.subject))} ({_text(link)})"


def _worlds(ontology: Ontology, notes: list[Diagnostic]) -> Iterator[Reading]:
    """Yield the readings of the URDFs that belong to the documents of an ontology."""
    stated = {str(triple.subject) for triple in ontology.using("hasDataFormat") if "urdf" in str(triple.object).lower()}
    for document in ontology.documents:
        folders = _folders(ontology, document)
        ids = (one for one in ontology.using("hasPersistentIdentifier") if str(one.subject) in stated)
        own = [
            one.object.value for one in ids if isinstance(one.object, Literal) and one.span.file == str(document.path)
        ]
        uses_links = any(one.span.file == str(document.path) for one in ontology.using(*LINKS))
        for name in dict.fromkeys((*own, *((document.path.stem,) if uses_links else ()))):
            file = f"{Path(name).name.removesuffix('.urdf')}.urdf"
            if path := next((folder / file for folder in folders if (folder / file).is_file()), None):
                yield from _read(path, notes)


def _read(path: Path, notes: list[Diagnostic]) -> Iterator[Reading]:
    try:
        yield from read_all(path, (), builtin=False)
    except BadInput as problem:
        notes += problem.diagnostics


def _folders(ontology: Ontology, document: Document) -> tuple[Path, ...]:
    """Folders in which the URDF of a document may be."""
    beside = document.path.parent
    own = [beside, *([beside.parent / "urdf"] if (beside.parent / "package.xml").is_file() else [])]
    return (*(own if is_on_disk(document) else ()), *ontology.folders)


def _with_most(ontology: Ontology, named: dict[str, Triple], notes: list[Diagnostic]) -> Iterator[Reading]:
    """Yield the readings of the URDF that has most of the named links, if it has at least half of them."""
    wanted = {_text(one) for one in named.values()}
    files = {str(one.span.file) for one in named.values()}
    documents = [one for one in ontology.documents if str(one.path) in files]
    shares = {path: len(wanted & _links(path)) for path in _urdfs(_folders(ontology, one) for one in documents)}
    best = max(shares, key=lambda path: shares[path], default=None)
    if best is not None and 2 * shares[best] >= len(wanted):
        first = next(iter(named.values()))
        message = (
            f"{best.name} has {shares[best]} of the {len(wanted)} links that the map names: it is read as its URDF"
        )
        notes.append(note("M033", message, first.span, "import it (owl:imports) to say which URDF is meant"))
        yield from _read(best, notes)


def _urdfs(folders: Iterable[Iterable[Path]]) -> Iterator[Path]:
    for folder in dict.fromkeys(one for several in folders for one in several):
        try:
            names = sorted(path.name for path in folder.iterdir() if path.name.endswith(".urdf"))
        except OSError:
            continue
        yield from (folder / name for name in names[:MOST])


def _links(path: Path) -> set[str]:
    """Names of the links of a URDF, without parsing it; none if it cannot be read."""
    try:
        content = path.read_bytes() if path.is_file() and path.stat().st_size <= LARGEST else b""
    except OSError:
        return set()
    return {name.decode("utf-8", "replace").strip() for name in _LINK.findall(content)}


def _linked(reading: Reading, names: dict[str, str], ontology: Ontology, linked: set[str]) -> Reading:
    """Give the objects of a URDF the IRIs of the individuals that name their links."""
    iri = reading.document.iri or ""
    if not iri.startswith(URDF_WORLDS):
        return reading
    things = {name: thing for name, thing in names.items() if reading.triples.find(f"{iri}#{name}") is not None}
    linked.update(things.values())
    renamed = reading.triples.renamed({f"{iri}#{name}": thing for name, thing in things.items()})
    known = {thing for thing in things.values() if _says_more(ontology, thing)}
    leaves = {expand(cls) for cls in MOVED_LINKS.values()}  # what a joint says of a link
    kept = [
        triple
        for triple in renamed
        if triple.predicate != RDF.type or triple.subject not in known or triple.object in leaves
    ]
    return Reading(reading.document, Triples.of(kept, str(reading.document.path)), (), reading.unread)


def _says_more(ontology: Ontology, thing: str) -> bool:
    """Check whether the classes of an individual say more than that it is a thing somewhere."""
    things = expand("EnduringThing-Localized")
    return any(ontology.is_a(cls, things) and len(ontology.ancestors(cls)) > 3 for cls in ontology.types(thing))
