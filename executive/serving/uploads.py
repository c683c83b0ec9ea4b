"""Check uploads with the compiler and the readers of maps and robots, and describe them for the index.

Uploads are untrusted: imports are looked up only among the bundled ontologies and in the operator's folders, and
nothing of an upload is ever written to a file or executed.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

from executive.maps.semantic_map import WHOLES, read_map
from executive.robots.robot import read_self_model
from executive.serving.vocabulary import Vocabulary
from planlang.compiler import compile_ontology
from planlang.designators import local_name
from planlang.diagnostics import GO_ON, BadInput, Diagnostic, Span, error, has_errors
from planlang.experience import episode_in
from planlang.files import Bundled, bundled, decode
from planlang.knowledge import facts
from planlang.knowledge.axioms import One, Some, own_axioms_of
from planlang.knowledge.completion import TooLarge
from planlang.knowledge.descriptions import Description, described
from planlang.knowledge.entries import Content, Kind, Syntax, uid_of
from planlang.knowledge.places import places
from planlang.ontology import BNode, Literal, Ontology, documents, expand, load_apart
from planlang.ontology.terms import OWL, RDF, RDFS
from planlang.records import dataclass
from planlang.words import COMMAND_LINE, Blank, Text, calling, said

MOST_WORDS, LONGEST_WORD = 500, 200
"""Names and labels indexed for an entry, and characters of one."""

LAYOUT = "3"
"""Layout of descriptions in a store; those of another layout are computed again from the content."""
MAPS = ("knowrob:SemanticEnvironmentMap", "srdl2-comp:EnvironmentMap")
"""Classes of maps."""
OUTWARD = ("objectActedOn", "relativeTo", "providesModelFor", "subClassOf")
"""Properties whose object is not a part of their subject, so that it can still be the subject of an entry."""
IMPORTS = ("O030", "O031", "O032")
"""Codes of missing imports."""


@dataclass(frozen=True, slots=True)
class Upload:
    """An accepted upload, with notes and warnings about it."""

    content: Content
    diagnostics: tuple[Diagnostic, ...]


def read_upload(kind: Kind, name: str, data: bytes, about: str | None, vocabulary: Vocabulary) -> Upload:
    """Check and describe an upload.

    ``about`` is the local name or IRI of its subject, needed if there are several candidates. Raises BadInput with all
    errors found.
    """
    _check_name("upload", name, None)
    ontology, syntax, file = _load(name, data, vocabulary)
    diagnostics = [one for one in ontology.diagnostics if _concerns(one, file)]
    subject = _check(kind, ontology, about, diagnostics)
    diagnostics = list(dict.fromkeys(as_here(one, vocabulary) for one in diagnostics if _concerns(one, file)))
    _check_name(subject, name, Span(file))
    if has_errors(diagnostics):
        raise BadInput(diagnostics)
    description = _describe(ontology, subject, vocabulary, file)
    label = (ontology.label(subject) or local_name(subject))[:LONGEST_WORD]
    content = Content(kind, subject, name, label, syntax, data, packed(description, vocabulary))
    return Upload(content, tuple(diagnostics))


def as_here(diagnostic: Diagnostic, vocabulary: Vocabulary) -> Diagnostic:
    """Rewrite a diagnostic for a client: with advice on uploads, and without paths of the server's file system."""

    def named(text: str) -> str:
        for folder in (str(path) for given in vocabulary.folders for path in (given, given.resolve())):
            text = re.sub(rf"(?<![\w./-]){re.escape(folder)}/", "ontologies/", text)
        return text.replace(f"{bundled('ontologies')}/", "ontologies/")

    diagnostic = diagnostic.said(COMMAND_LINE)  # who uploads has a browser, or the command line
    advice = diagnostic.help and (
        named(diagnostic.help).removesuffix(said(GO_ON, COMMAND_LINE)).removesuffix("; ") or None
    )
    if diagnostic.code in IMPORTS:
        advice = "this server has only the bundled ontologies, and those that its operator added"
    span = diagnostic.span and diagnostic.span._replace(file=named(diagnostic.span.file))
    return replace(diagnostic, message=named(diagnostic.message), span=span, help=advice)


def _check_name(about: str, name: str, span: Span | None) -> None:
    try:
        uid_of(about, name)
    except ValueError as problem:
        raise BadInput([error("K012", str(problem), span)]) from None


def packed(description: Description, vocabulary: Vocabulary) -> bytes:
    """Encode a description for a store, after a line with its layout and the digest of the vocabulary."""
    return f"{_stamp(vocabulary)}\n".encode() + facts.packed(description)


def unpacked(stored: bytes, vocabulary: Vocabulary) -> tuple[facts.Unpacked | None, bool]:
    """Decode a stored description (None if it has another layout); the flag is True if it has to be computed again."""
    stamp, _, data = stored.partition(b"\n")
    if stamp.partition(b" ")[0] != LAYOUT.encode():
        return None, True
    try:
        return facts.unpacked(data), stamp.decode() != _stamp(vocabulary)
    except (ValueError, TypeError):
        return None, True


def _stamp(vocabulary: Vocabulary) -> str:
    return f"{LAYOUT} {vocabulary.digest}"


def load_upload(name: str, data: bytes, vocabulary: Vocabulary) -> Ontology:
    """Load a content with its imports and the bundled vocabulary. Raises BadInput."""
    return _load(name, data, vocabulary)[0]


def _load(name: str, data: bytes, vocabulary: Vocabulary) -> tuple[Ontology, Syntax, str]:
    stem = "".join(name.split()) or "upload"
    detected = documents.syntax_of(decode(data, stem), stem)
    syntax = Syntax.__members__.get(detected.name)
    if syntax is None:
        advice = (
            "convert a world to a map in Manchester syntax; for a robot, upload its self-model "
            "and attach the URDF to it"
            if detected in (documents.Syntax.URDF, documents.Syntax.GRID)
            else Text("convert it first: ", calling("convert", Blank("FILE"), syntax="manchester"))
        )
        raise BadInput([error("K014", f"{detected.value} cannot be uploaded", Span(stem), advice)])
    file = stem.replace("/", "_")[:100] + syntax.suffix
    return load_apart(Path(file), folders=vocabulary.folders, content=data), syntax, file


def _concerns(diagnostic: Diagnostic, file: str) -> bool:
    return diagnostic.span is None or diagnostic.span.file == file or has_errors([diagnostic])


# the subject


def _check(kind: Kind, ontology: Ontology, about: str | None, diagnostics: list[Diagnostic]) -> str:
    """Check an upload by the reader of its kind, whose diagnostics are appended; returns the IRI of its subject.

    Raises BadInput.
    """
    if kind is Kind.RECIPE:
        plan = compile_ontology(ontology, task=about)
        diagnostics += plan.diagnostics
        return plan.recipes.main.iri
    if kind is Kind.ENVIRONMENT:
        return _map_of(ontology, about, diagnostics)
    if kind is Kind.EXPERIENCE:
        return episode_in(ontology.alone().triples(), str(ontology.documents[0].path))
    if kind is Kind.ROBOT:
        robot = read_self_model(ontology).iri
        return robot if about is None else _named(ontology, about)
    if about is not None:
        return _named(ontology, about)
    return _only(kind, ontology, _subjects(ontology, kind))


def _map_of(ontology: Ontology, about: str | None, diagnostics: list[Diagnostic]) -> str:
    maps = _maps(ontology)
    try:
        diagnostics += read_map(ontology).diagnostics
    except BadInput as problem:
        if not maps or {one.code for one in problem.diagnostics if has_errors([one])} != {"M009"}:
            raise
        diagnostics += (one for one in problem.diagnostics if one.code != "M009")  # the map may be an attached image
    if about is not None:
        return _named(ontology, about)
    rooms = [one for one in ontology.individuals(expand("RoomInAConstruction")) if ontology.main(one)]
    return _only(Kind.ENVIRONMENT, ontology, maps or rooms or _subjects(ontology, Kind.ENVIRONMENT))


def _maps(ontology: Ontology) -> list[str]:
    """Individuals of the main document that are maps: by class, by a map file, or by the things described in them."""
    main = ontology.alone()
    maps = [one for name in MAPS for one in ontology.individuals(expand(name)) if ontology.main(one)]
    maps += [str(t.object) for t in main.using("describedInMap") if isinstance(t.object, str)]
    linked = (triple.subject for triple in main.using("linkToMapFile") if isinstance(triple.subject, str))
    maps += [one for one in linked if ontology.is_a(one, expand("Map"))]
    return list(dict.fromkeys(maps))


def _named(ontology: Ontology, about: str) -> str:
    """Resolve a local name or IRI to an IRI of the main document. Raises BadInput."""
    own = dict.fromkeys(term for term in ontology.alone().store.terms if isinstance(term, str) and ontology.main(term))
    matches = [iri for iri in own if about in (iri, local_name(iri))]
    if about in matches:
        return about
    if len(matches) == 1:
        return matches[0]
    span = Span(str(ontology.documents[0].path))
    if matches:
        raise BadInput([error("K010", f"{about} is ambiguous", span, f"set about to one of {_listed(matches)}")])
    raise BadInput([error("K011", f"this file defines nothing named {about}", span)])


def _only(kind: Kind, ontology: Ontology, candidates: list[str]) -> str:
    span = Span(str(ontology.documents[0].path))
    if len(candidates) == 1:
        return candidates[0]
    if candidates:
        message = f"this file has {len(candidates)} possible subjects of the {kind.word}"
        raise BadInput([error("K010", message, span, f"set about to one of {_listed(candidates)}")])
    raise BadInput([error("K011", f"this file has no possible subject of the {kind.word}", span)])


def _listed(iris: list[str]) -> str:
    return ", ".join(iris[:5]) + (", ..." if len(iris) > 5 else "")


def _subjects(ontology: Ontology, kind: Kind) -> list[str]:
    """Possible subjects of a file: for objects its classes, else its individuals; without parts of others."""
    main = ontology.alone()
    subjects = dict.fromkeys(t.subject for t in main.triples() if isinstance(t.subject, str))
    things = [iri for iri in subjects if not _is_language(main, iri)]
    classes = [iri for iri in things if any(main.triples(iri, RDFS.subClassOf)) and kind is Kind.OBJECT]
    candidates = classes or [iri for iri in things if main.is_individual(iri) and not _is_event(ontology, iri, kind)]
    outward = set(main.properties_named(*OUTWARD))
    inside = {t.object for t in main.triples() if t.predicate not in (RDF.type, *outward)}
    inside |= {t.subject for t in main.using(*WHOLES)}
    return [iri for iri in candidates if iri not in inside]


def _is_event(ontology: Ontology, iri: str, kind: Kind) -> bool:
    """Check for an event, such as a perception of a thing in a map: only an experience has events as subjects."""
    return kind is not Kind.EXPERIENCE and ontology.is_a(iri, expand("Event"))


def _is_language(main: Ontology, iri: str) -> bool:
    return main.is_property(iri) or OWL.Ontology in main.values(iri, RDF.type)


# the description


def _describe(ontology: Ontology, subject: str, vocabulary: Vocabulary, file: str) -> Description:
    own = own_axioms_of(ontology, vocabulary.axioms)
    for thing in _things_in_map(ontology, subject):
        own.state(One(subject), Some(expand("mapOf"), One(thing)))
    is_individual = not ontology.is_class(subject)
    try:
        words = _words(ontology, subject)
        description = described(subject, vocabulary.axioms, own, is_individual=is_individual, words=words)
    except TooLarge as problem:
        raise BadInput([error("K013", str(problem), Span(file))]) from None
    return replace(description, place=places(ontology))


def _things_in_map(ontology: Ontology, subject: str) -> Iterator[str]:
    """Yield the things (IRIs) of a map that do not state ``describedInMap``; the only map of a file has them all.

    A file without a map of its own describes its room.
    """
    if (_maps(ontology) or [subject]) != [subject] or not ontology.any_is_a((subject,), (*MAPS, "RoomInAConstruction")):
        return
    with suppress(BadInput):  # a map that is an attached image has no things
        for thing in read_map(ontology).objects:
            if ontology.main(thing.iri) and thing.iri != subject:
                yield thing.iri


def warm_up(vocabulary: Vocabulary) -> None:
    """Check a bundled recipe once, so that lazily loaded data is there before workers are forked."""
    read_upload(Kind.RECIPE, "first", Bundled.RECIPE.find("serve_a_drink").read_bytes(), None, vocabulary)


def describe(about: str, name: str, data: bytes, vocabulary: Vocabulary) -> Description:
    """Describe a stored content again. Raises BadInput if it can no longer be read."""
    ontology, _, file = _load(name, data, vocabulary)
    return _describe(ontology, about, vocabulary, file)


def _words(ontology: Ontology, subject: str) -> Iterator[str]:
    words: dict[str, None] = {}
    for word in _all_words(ontology, subject):
        words.setdefault(word[:LONGEST_WORD])
        if len(words) == MOST_WORDS:
            break
    yield from words


def _all_words(ontology: Ontology, subject: str) -> Iterable[str]:
    """Yield names and labels: those of the subject, then all others in the main document."""
    main = ontology.alone()
    yield local_name(subject)
    for text in main.values(subject, RDFS.label):
        if isinstance(text, Literal):
            yield text.value.strip()
    for triple in main.triples():
        if triple.predicate == RDFS.label and isinstance(triple.object, Literal):
            yield triple.object.value.strip()
        elif not isinstance(triple.subject, BNode) and not _is_language(main, triple.subject):
            yield local_name(triple.subject)
