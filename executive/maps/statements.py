"""Map files with new poses: each thing's newest one, as one perception, in the frame that it was stated in.

All else of the files is kept as it is: classes, sizes, parts, places, and what no reader here knows.
"""

from __future__ import annotations

from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from executive.maps.semantic_map import PosesOfThings, SemanticMap
from planlang.designators import local_name, unused_name
from planlang.diagnostics import Diagnostic, Span, warning
from planlang.geometry import Pose
from planlang.ontology import Literal, Ontology, Term, Triple, expand
from planlang.ontology.convert import Target, write
from planlang.ontology.terms import OWL, RDF, RDFS, XSD
from planlang.outputs import MARK
from planlang.records import dataclass

DIGITS = 9
"""Decimal places of lengths [m] and of the entries of rotations."""
NOWHERE = Span("")
_POSES = tuple(map(expand, ("orientation", "pose")))
_IN_PLACE = tuple(map(expand, ("translation", "heading", "quaternion", "relativeTo")))
"""Properties of a pose, which a thing may state itself."""
_OF_EVENTS = tuple(map(expand, ("objectActedOn", "eventOccursAt", "startTime")))


@dataclass(frozen=True, slots=True)
class Placement:
    """The place of a thing, what states it, and since when."""

    thing: str
    """IRI."""
    pose: Pose
    """In the map's frame."""
    time: float = float("-inf")
    """Seconds of the perception; minus infinity if nothing says when it was."""
    relative_to: str | None = None
    """The thing, by IRI, in whose frame the pose is written."""
    facts: tuple[tuple[str, Term], ...] = ()
    """Other statements about the perception."""


def placements(semantic_map: SemanticMap) -> dict[str, Placement]:
    """Return the placement of each thing that has a pose, by IRI, in the order of the map."""
    ontology = semantic_map.ontology
    poses = PosesOfThings(ontology, [])
    found = {}
    for thing in semantic_map.objects:
        if thing.pose is None or not any(ontology.triples(thing.iri)):
            continue  # it has no place, or follows from its class
        seen = poses.newest(thing.iri)
        event = None if seen is None else seen.event
        place = poses.place_of(thing.iri) if seen is None else seen.place
        parents = [] if place is None else ontology.values(place, expand("relativeTo"))
        parent = next((one.iri for one in map(semantic_map.find, map(str, parents)) if one and one.pose), None)
        facts = () if event is None else tuple(facts_of(ontology, event))
        time = float("-inf") if seen is None else seen.time
        found[thing.iri] = Placement(thing.iri, thing.pose, time, parent, facts)
    return found


def facts_of(ontology: Ontology, event: str) -> Iterator[tuple[str, Term]]:
    """Yield what else is stated about a perception: property and value."""
    for triple in ontology.triples(event):
        if triple.predicate not in _OF_EVENTS and triple.object != OWL.NamedIndividual:
            yield triple.predicate, triple.object


def main_statements(ontology: Ontology, files: Container[Path | None]) -> list[Triple]:
    """Return what some of an ontology's files state, in document order, without what it imports."""
    ranges = zip(ontology.documents, ontology.store.ranges, strict=True)
    several = [[ontology.store.triple(row) for row in rows] for document, rows in ranges if document.path in files]
    return [triple for statements in with_one_header(several) for triple in statements]


def with_one_header(several: Sequence[Sequence[Triple]]) -> Iterator[list[Triple]]:
    """Yield the statements of several files with the header of the first one, which imports what all import."""
    names = {t.subject: None for statements in several for t in statements if _is_header(t)}
    types = (t for statements in several for t in statements if t.predicate == RDF.type)
    things = {t.subject for t in types if not _is_header(t)}  # some maps are named as their files are
    for statements in several:
        found = []
        for triple in statements:
            if triple.predicate == OWL.imports:
                if triple.object not in names:
                    found.append(replace(triple, subject=next(iter(names), triple.subject)))
            elif triple.subject == next(iter(names), None) or triple.subject not in names:
                found.append(triple)
            elif triple.subject in things and not _is_header(triple):
                found.append(triple)  # nothing else is said of a file that is no more
        yield found


def _is_header(triple: Triple) -> bool:
    return triple.predicate == RDF.type and triple.object == OWL.Ontology


def with_placements(
    statements: Sequence[Triple], map_iri: str | None, placed: Mapping[str, Placement], *, gone: Container[str] = ()
) -> list[Triple]:
    """Return statements in which each placed thing has one pose, that of its placement; those ``gone`` have none."""
    things = {iri for iri in dict.fromkeys(str(t.subject) for t in statements) if iri in placed or iri in gone}
    things |= placed.keys()
    kept = _without_poses(statements, things)
    taken = {str(triple.subject) for triple in kept}
    base = f"{(map_iri or 'http://planlang.org/kb/map.owl').rstrip('#')}#"
    for placement in placed.values():
        kept += _perception(placement, placed, base, taken)
    return kept


def _without_poses(statements: Sequence[Triple], things: set[str]) -> list[Triple]:
    """Return the statements without the poses of things, and without the perceptions that tell nothing else."""
    acted, at = expand("objectActedOn"), expand("eventOccursAt")
    others = {t.subject for t in statements if t.predicate == acted and t.object not in things}
    of_these = {t.subject for t in statements if t.predicate == acted and t.object in things}
    events = {t.subject for t in statements if t.predicate == at and t.subject in of_these - others}
    own = (*_POSES, *_IN_PLACE)
    kept = [t for t in statements if t.subject not in events and not (t.subject in things and t.predicate in own)]
    dropped = {t.object for t in statements if t.subject in events or (t.subject in things and t.predicate in _POSES)}
    kinds = {expand("RotationMatrix3D"), expand("TimePoint")}
    there: set[Term] = {t.subject for t in statements if t.predicate == RDF.type and t.object in kinds}
    there |= {t.object for t in statements if t.predicate in (at, *_POSES)}
    used = {t.object for t in kept if t.predicate != expand("relativeTo") or t.subject not in dropped}
    unused = (dropped & there) - used - things
    return [t for t in kept if t.subject not in unused]


def _perception(placement: Placement, placed: Mapping[str, Placement], base: str, taken: set[str]) -> Iterator[Triple]:
    name = local_name(placement.thing)
    event, place = _free(f"{base}perception_{name}", taken), _free(f"{base}pose_{name}", taken)
    parent = placed.get(placement.relative_to or "")
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


def _free(iri: str, taken: set[str]) -> str:
    taken.add(found := unused_name(iri, taken))
    return found


def _stated(subject: str, predicate: str, value: Term) -> Triple:
    return Triple(subject, predicate, value, NOWHERE)


def stated_facts(subject: str, facts: Iterable[tuple[str, Term]]) -> Iterator[Triple]:
    """Yield statements about a subject; names are those of the vocabulary."""
    for prop, value in facts:
        yield _stated(subject, prop if prop == RDF.type else expand(prop), value)


def decimal(value: float) -> Literal:
    """Return a length or an entry of a rotation as a literal."""
    return Literal(number(value), f"{XSD}decimal")


def number(value: float) -> str:
    """Return a number with at most :data:`DIGITS` decimal places, and at least one."""
    text = f"{round(value, DIGITS) + 0.0:.{DIGITS}f}".rstrip("0")
    return f"{text}0" if text.endswith(".") else text


def text_of(statements: Iterable[Triple], map_iri: str | None, found: list[Diagnostic]) -> str:
    """Return a map in Manchester syntax; what the syntax cannot say is told."""
    own = f"{map_iri.rstrip('#')}#" if map_iri else ""
    prefixes = {"": own} if own else {}
    prefixes |= {"knowrob": expand(""), "roboearth": "http://www.roboearth.org/kb/roboearth.owl#"}
    prefixes |= {"rdfs": str(RDFS), "xsd": str(XSD), "owl": str(OWL)}
    text, lost = write(statements, Target.MANCHESTER, prefixes)
    if lost:
        first = f"{local_name(str(lost[0].subject))} {local_name(lost[0].predicate)}"
        found.append(warning("O050", f"{len(lost)} statements are lost in Manchester syntax; the first: {first}"))
    return f"# A semantic map, {MARK}.\n\n{text}"
