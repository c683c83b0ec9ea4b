"""Writing maps with new poses: one perception per object, relative to the frame in which its pose was stated.

All other statements are kept: classes, sizes, parts, and those that no reader here understands.
"""

from __future__ import annotations

from collections.abc import Collection, Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from executive.maps.semantic_map import PosesOfThings, SemanticMap, namespace_of
from planlang.designators import local_name, unused_name
from planlang.diagnostics import Diagnostic, Span, warning
from planlang.geometry import Pose
from planlang.ontology import Literal, Ontology, Term, Triple, expand
from planlang.ontology.convert import Target, write
from planlang.ontology.terms import OWL, RDF, RDFS, XSD
from planlang.outputs import MARK
from planlang.records import dataclass

DIGITS = 9
"""Decimal places of lengths [m] and of entries of rotations."""
NOWHERE = Span("")
_POSES = tuple(map(expand, ("orientation", "pose")))
_IN_PLACE = tuple(map(expand, ("translation", "heading", "quaternion", "relativeTo")))
"""Properties of a pose that an object may state itself."""
_OF_EVENTS = tuple(map(expand, ("objectActedOn", "eventOccursAt", "startTime")))


@dataclass(frozen=True, slots=True)
class Placement:
    """The pose of an object, and the perception that states it."""

    thing: str
    """IRI of the object."""
    pose: Pose
    """In the map frame."""
    time: float = float("-inf")
    """Time of the perception [s]; minus infinity if none is stated."""
    relative_to: str | None = None
    """IRI of the object in whose frame the pose is written."""
    facts: tuple[tuple[str, Term], ...] = ()
    """Other statements about the perception: property and value."""


def placements(semantic_map: SemanticMap) -> dict[str, Placement]:
    """Collect the placement of each object that states a pose, by IRI, in the order of the map."""
    ontology = semantic_map.ontology
    poses = PosesOfThings(ontology, [])
    placed = {}
    for thing in semantic_map.objects:
        if thing.pose is None or not any(ontology.triples(thing.iri)):
            continue  # without a pose, or a part that only its class states
        seen = poses.newest(thing.iri)
        event = None if seen is None else seen.event
        place = poses.place_of(thing.iri) if seen is None else seen.place
        parents = [] if place is None else ontology.values(place, expand("relativeTo"))
        parent = next((one.iri for one in map(semantic_map.find, map(str, parents)) if one and one.pose), None)
        facts = () if event is None else tuple(facts_of(ontology, event))
        time = float("-inf") if seen is None else seen.time
        placed[thing.iri] = Placement(thing.iri, thing.pose, time, parent, facts)
    return placed


def facts_of(ontology: Ontology, event: str) -> Iterator[tuple[str, Term]]:
    """Yield the other statements about a perception: property and value."""
    for triple in ontology.triples(event):
        if triple.predicate not in _OF_EVENTS and triple.object != OWL.NamedIndividual:
            yield triple.predicate, triple.object


def main_statements(ontology: Ontology, files: Container[Path | None]) -> list[Triple]:
    """List the statements of some files of an ontology, in document order, without those of its imports."""
    ranges = zip(ontology.documents, ontology.store.ranges, strict=True)
    by_file = [[ontology.store.triple(row) for row in rows] for document, rows in ranges if document.path in files]
    return [triple for statements in with_one_header(by_file) for triple in statements]


def statements_of(semantic_map: SemanticMap, files: Collection[Path | None], things: Iterable[str]) -> list[Triple]:
    """List the statements of some files; also those of imported maps, if these state one of the ``things``."""
    ontology, paths = semantic_map.ontology, set(map(str, files))
    if all(triple.span.file in paths for iri in things for triple in ontology.triples(iri)):
        return main_statements(ontology, files)
    paths |= {triple.span.file for thing in semantic_map.objects for triple in ontology.triples(thing.iri)}
    names = {document.iri: str(document.path) for document in ontology.documents}
    for triple in reversed([*ontology.triples(p=OWL.imports)]):  # files between them, as imports come after importers
        if names.get(str(triple.object)) in paths:
            paths.add(triple.span.file)
    others = {iri for iri, path in names.items() if path not in paths}
    statements = main_statements(ontology, {one.path for one in ontology.documents if str(one.path) in paths})
    return [triple for triple in statements if triple.predicate != OWL.imports or triple.object in others]


def with_one_header(files: Sequence[Sequence[Triple]]) -> Iterator[list[Triple]]:
    """Yield the statements of several files under the header of the first, which imports what any of them imports."""
    names = {t.subject: None for statements in files for t in statements if _is_header(t)}
    types = (t for statements in files for t in statements if t.predicate == RDF.type)
    things = {t.subject for t in types if not _is_header(t)}  # some maps have the same IRI as their file
    for statements in files:
        kept = []
        for triple in statements:
            if triple.predicate == OWL.imports:
                if triple.object not in names:
                    kept.append(replace(triple, subject=next(iter(names), triple.subject)))
            elif triple.subject == next(iter(names), None) or triple.subject not in names:
                kept.append(triple)
            elif triple.subject in things and not _is_header(triple):
                kept.append(triple)  # other statements about the later files are dropped: those files are merged away
        yield kept


def _is_header(triple: Triple) -> bool:
    return triple.predicate == RDF.type and triple.object == OWL.Ontology


def with_placements(
    statements: Sequence[Triple], map_iri: str | None, placed: Mapping[str, Placement], *, gone: Container[str] = ()
) -> list[Triple]:
    """Replace the poses of placed objects by one perception each, and remove those of the objects in ``gone``."""
    things = {iri for iri in dict.fromkeys(str(t.subject) for t in statements) if iri in placed or iri in gone}
    things |= placed.keys()
    kept = _without_poses(statements, things)
    used = {str(triple.subject) for triple in kept}
    base = namespace_of(map_iri)
    for placement in placed.values():
        kept += _perception(placement, placed, base, used)
    return kept


def _without_poses(statements: Sequence[Triple], things: set[str]) -> list[Triple]:
    """Remove the poses of objects, and their perceptions unless these are of other objects, too."""
    acted, at = expand("objectActedOn"), expand("eventOccursAt")
    others = {t.subject for t in statements if t.predicate == acted and t.object not in things}
    of_these = {t.subject for t in statements if t.predicate == acted and t.object in things}
    events = {t.subject for t in statements if t.predicate == at and t.subject in of_these - others}
    pose_facts = (*_POSES, *_IN_PLACE)
    kept = [
        t for t in statements if t.subject not in events and not (t.subject in things and t.predicate in pose_facts)
    ]
    dropped = {t.object for t in statements if t.subject in events or (t.subject in things and t.predicate in _POSES)}
    kinds = {expand("RotationMatrix3D"), expand("TimePoint")}
    removable: set[Term] = {t.subject for t in statements if t.predicate == RDF.type and t.object in kinds}
    removable |= {t.object for t in statements if t.predicate in (at, *_POSES)}
    used = {t.object for t in kept if t.predicate != expand("relativeTo") or t.subject not in dropped}
    unused = (dropped & removable) - used - things
    return [t for t in kept if t.subject not in unused]


def _perception(placement: Placement, placed: Mapping[str, Placement], base: str, used: set[str]) -> Iterator[Triple]:
    name = local_name(placement.thing)
    event, place = _free(f"{base}perception_{name}", used), _free(f"{base}pose_{name}", used)
    parent = placed.get(placement.relative_to) if placement.relative_to else None
    pose = placement.pose if parent is None else parent.pose.inverse() @ placement.pose
    facts = placement.facts or ((RDF.type, expand("SemanticMapPerception")),)
    yield from (_stated(event, prop, value) for prop, value in facts)
    yield _stated(event, expand("objectActedOn"), placement.thing)
    yield _stated(event, expand("eventOccursAt"), place)
    if placement.time > float("-inf"):
        time = f"{base}timepoint_{number(placement.time)}"
        yield from (_stated(event, expand("startTime"), time), _stated(time, RDF.type, expand("TimePoint")))
    yield _stated(place, RDF.type, expand("RotationMatrix3D"))
    for row, entries in enumerate(pose.matrix().tolist()):
        for column, entry in enumerate(entries):
            yield _stated(place, expand(f"m{row}{column}"), decimal(entry))
    if parent is not None:
        yield _stated(place, expand("relativeTo"), parent.thing)


def _free(iri: str, used: set[str]) -> str:
    used.add(free := unused_name(iri, used))
    return free


def _stated(subject: str, predicate: str, value: Term) -> Triple:
    return Triple(subject, predicate, value, NOWHERE)


def stated_facts(subject: str, facts: Iterable[tuple[str, Term]]) -> Iterator[Triple]:
    """Yield statements about a subject; properties are local names of the vocabulary, or rdf:type."""
    for prop, value in facts:
        yield _stated(subject, prop if prop == RDF.type else expand(prop), value)


def decimal(value: float) -> Literal:
    """Write a length or an entry of a rotation as a literal."""
    return Literal(number(value), f"{XSD}decimal")


def number(value: float) -> str:
    """Write a number with at least one and at most :data:`DIGITS` decimal places."""
    text = f"{round(value, DIGITS) + 0.0:.{DIGITS}f}".rstrip("0")
    return f"{text}0" if text.endswith(".") else text


def text_of(statements: Iterable[Triple], map_iri: str | None, notes: list[Diagnostic]) -> str:
    """Write a map in Manchester syntax, with a warning if the syntax cannot express some statements."""
    namespace = f"{map_iri.rstrip('#')}#" if map_iri else ""
    prefixes = {"": namespace} if namespace else {}
    prefixes |= {"knowrob": expand(""), "roboearth": "http://www.roboearth.org/kb/roboearth.owl#"}
    prefixes |= {"rdfs": str(RDFS), "xsd": str(XSD), "owl": str(OWL)}
    text, lost = write(statements, Target.MANCHESTER, prefixes)
    if lost:
        first = f"{local_name(str(lost[0].subject))} {local_name(lost[0].predicate)}"
        notes.append(warning("O050", f"{len(lost)} statements are lost in Manchester syntax; the first: {first}"))
    return f"# A semantic map, {MARK}.\n\n{text}"
