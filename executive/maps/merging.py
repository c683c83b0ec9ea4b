"""Merging maps of one place: the newest pose of each object, every fact once, and a warning for each conflict."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from executive.maps.classes import MapObject
from executive.maps.frames import MapSource, are_related, completed, in_frame_of
from executive.maps.semantic_map import read_map
from executive.maps.statements import (
    Placement,
    main_statements,
    placements,
    text_of,
    with_one_header,
    with_placements,
)
from planlang.designators import local_name
from planlang.diagnostics import BadInput, Diagnostic, note, settled, warning
from planlang.geometry import Array
from planlang.knowledge.places import LEVELS, inverted
from planlang.measures import EXTENTS, TRIPLES
from planlang.ontology import Literal, Ontology, Triple, expand, load
from planlang.ontology.terms import RDFS
from planlang.records import dataclass
from planlang.units import stated_number, unit_of_property

SAME_PLACE = 0.01
"""Greatest distance of positions that do not conflict [m]."""
SAME_HEADING = math.radians(2.0)
"""Greatest angle between orientations that do not conflict [rad]."""
ALIKE = 0.5
"""Objects of one class are identified if their centres are closer than this fraction of their least extents."""


@dataclass(frozen=True, slots=True)
class Merged:
    """A merged map as text, with the numbers of its objects and of those with a pose, and all diagnostics."""

    text: str
    things: int
    placed: int
    diagnostics: tuple[Diagnostic, ...]


def _source(path: Path, ontology: Ontology, notes: list[Diagnostic]) -> MapSource:
    semantic_map = read_map(ontology, ignore_unread=True)  # what one map lacks another may have
    notes += ontology.diagnostics  # default sizes are reported again when the merged map is used
    notes += (one for one in semantic_map.diagnostics if one.code != "M005")
    statements = _with_places_reversed(main_statements(ontology, {ontology.documents[0].path}), ontology)
    return MapSource(path.name, semantic_map, statements, placements(semantic_map))


def merge(paths: Sequence[Path], folders: Sequence[Path] = (), *, ignore_unread: bool = False) -> Merged:
    """Merge maps of one place in the frame of the first; where values conflict, the map named later wins.

    Raises BadInput for a file that is not a map, for one of which something cannot be read, unless ``ignore_unread``,
    and if the transformation between two frames is unknown.
    """
    notes: list[Diagnostic] = []
    sources = [_source(path, load(path, folders=folders), notes) for path in paths]
    ontology = load(paths[0], folders=folders, also=paths[1:])
    _check_all_read(ontology, ignore_unread=ignore_unread)
    things = {thing.iri: thing for thing in sources[0].map.objects}
    merged = [sources[0]]
    for source in (in_frame_of(sources[0], one, ontology, notes) for one in sources[1:]):
        names = dict(_identified(things, source, ontology, notes))
        things = {names.get(one.iri, one.iri): one for one in source.map.objects} | things
        merged.append(source.named(names))
    newest = _newest(merged, [])
    merged = [completed(source, newest) for source in merged]
    statements = _united(merged, notes)
    placed = _newest(merged, notes)
    _compare_classes(merged, ontology, notes)
    frames = {iri for iri in ontology.individuals(expand("SemanticEnvironmentMap")) if iri not in placed}
    statements = with_placements(statements, ontology.iri, placed, gone=frames)
    text = text_of(statements, sources[0].map.ontology.iri, notes)
    return Merged(text, len(things), len(placed), tuple(dict.fromkeys(notes)))


def _check_all_read(ontology: Ontology, *, ignore_unread: bool) -> None:
    """Raise BadInput if something of the maps, read together, cannot be read, other than their frames."""
    try:
        read_map(ontology, ignore_unread=ignore_unread)
    except BadInput as problem:
        settled((one for one in problem.diagnostics if one.code != "M027"), ignore_unread=ignore_unread)


# One object under two names


def _identified(
    things: Mapping[str, MapObject], source: MapSource, ontology: Ontology, notes: list[Diagnostic]
) -> Iterator[tuple[str, str]]:
    """Yield the IRIs of objects that earlier maps have under another IRI, each with that IRI."""
    own_iris = {thing.iri for thing in source.map.objects}
    others = {iri: thing for iri, thing in things.items() if iri not in own_iris}
    by_number, by_name = dict[str, list[MapObject]](), dict[str, list[MapObject]]()
    for one in others.values():
        by_name.setdefault(local_name(one.iri), []).append(one)
        for number in _numbers(one, ontology):
            by_number.setdefault(number, []).append(one)
    placed = [one for one in others.values() if one.pose and one.size]
    places = np.array([one.pose.position for one in placed if one.pose]).reshape(-1, 3)
    for thing in source.map.objects:
        if thing.iri in things:
            continue
        numbers = _numbers(thing, ontology)
        alike = [one for number in numbers for one in by_number.get(number, ())]
        alike += [one for one in _near(thing, placed, places) if not (numbers and _numbers(one, ontology))]
        other = next((one for one in alike if one.iri in others and are_related(thing, one, ontology)), None)
        if other is not None:
            del others[other.iri]
            message = f"{local_name(thing.iri)} of {source.name} is the same object as {local_name(other.iri)}"
            notes.append(note("M023", message, thing.span, "both have the same class, and the same place or number"))
            yield thing.iri, other.iri
        elif any(are_related(thing, one, ontology) for one in by_name.get(local_name(thing.iri), ())):
            message = f"{local_name(thing.iri)} of {source.name} is treated as another object than that of earlier maps"
            help = f"they are in different places; if they are the same, rename <{thing.iri}>"
            notes.append(note("M023", message, thing.span, help))


def _numbers(thing: MapObject, ontology: Ontology) -> list[str]:
    """Numbers of a room, a floor or a building."""
    names = [number for _, number in LEVELS.values() if number is not None]
    return [str(one) for name in names for one in ontology.values(thing.iri, expand(name))]


def _near(thing: MapObject, placed: Sequence[MapObject], places: Array) -> Iterator[MapObject]:
    """Yield the objects whose centres (n, 3) are so close to that of ``thing`` that two objects would overlap."""
    if thing.pose is None or thing.size is None or not placed:
        return
    distances = np.linalg.norm(places - thing.pose.position, axis=1)
    for index in np.flatnonzero(distances < ALIKE * min(thing.size)).tolist():
        if distances[index] < ALIKE * min(placed[index].size or (0.0,)):
            yield placed[index]


# Poses


def _newest(sources: Sequence[MapSource], notes: list[Diagnostic]) -> dict[str, Placement]:
    """Find the newest placement of each object; of equally new ones, that of the map named later."""
    newest: dict[str, tuple[Placement, MapSource]] = {}
    for source in sources:
        for iri, placement in source.placed.items():
            before = newest.get(iri)
            if before is None:
                newest[iri] = placement, source
                continue
            newest[iri] = (placement, source) if placement.time >= before[0].time else before
            why = "is named" if placement.time == before[0].time else "has seen it"
            pose, other = placement.pose, before[0].pose
            if pose.distance(other) > SAME_PLACE or pose.turn(other) > SAME_HEADING:
                places = " and ".join(
                    "({:.3f}, {:.3f}, {:.3f})".format(*one.pose.position) + f" in {where.name}"
                    for one, where in (before, (placement, source))
                )
                message = f"{local_name(iri)} is at {places}: that of {newest[iri][1].name} counts, which {why} later"
                thing = source.map.find(iri)
                notes.append(warning("M022", message, None if thing is None else thing.span))
    return {iri: _with_newest_parents(iri, newest) for iri in newest}


def _with_newest_parents(iri: str, newest: Mapping[str, tuple[Placement, MapSource]]) -> Placement:
    """Move an object along with what its pose is relative to: compose the newest poses of the whole chain."""
    placement, source = newest[iri]
    steps, parent = [iri], placement.relative_to
    while parent in newest and parent in source.placed and parent not in steps:
        steps.append(parent)
        parent = newest[parent][0].relative_to
    pose = newest[steps[-1]][0].pose
    for child, above in zip(steps[-2::-1], steps[:0:-1], strict=True):
        own, where = newest[child]
        pose = pose @ where.placed[above].pose.inverse() @ own.pose if above in where.placed else own.pose
    return replace(placement, pose=pose)


# Other facts


def _united(sources: Sequence[MapSource], notes: list[Diagnostic]) -> list[Triple]:
    """Unite the statements of all maps under one header; of literal values, those of the last map that states any."""
    poses = {expand(f"m{row}{column}") for row in range(4) for column in range(4)}
    united: dict[tuple[object, str, object], Triple] = {}
    values: dict[tuple[object, str], tuple[str, list[Triple]]] = {}
    for source, statements in zip(sources, with_one_header([one.statements for one in sources]), strict=True):
        literals: dict[tuple[object, str], list[Triple]] = {}
        for triple in statements:
            if isinstance(triple.object, Literal) and not triple.predicate.startswith(str(RDFS)):
                literals.setdefault((triple.subject, triple.predicate), []).append(triple)
            else:
                united.setdefault((triple.subject, triple.predicate, triple.object), triple)
        _without_replaced_sizes(literals, values)
        for key, triples in literals.items():
            if key in values and key[1] not in poses:
                notes += _difference(values[key], (source.name, triples))
            values[key] = (source.name, triples)
    return [*united.values(), *(triple for _, triples in values.values() for triple in triples)]


def _with_places_reversed(statements: Sequence[Triple], ontology: Ontology) -> list[Triple]:
    """Reverse statements that make a larger place a part of a smaller one."""
    wrong = {(triple.subject, triple.object) for triple in inverted(ontology)}
    parts = expand("properPhysicalParts")
    return [
        replace(t, subject=t.object, object=t.subject)
        if t.predicate == parts and isinstance(t.object, str) and (t.subject, t.object) in wrong
        else t
        for t in statements
    ]


def _without_replaced_sizes(
    literals: Mapping[tuple[object, str], list[Triple]], values: dict[tuple[object, str], tuple[str, list[Triple]]]
) -> None:
    """Drop earlier extents that a literal of all three replaces, and the other way round."""
    one, three = [expand(name) for name in EXTENTS], [expand(name) for name in TRIPLES]
    for subject, prop in literals:
        for other in three if prop in one else one if prop in three else ():
            values.pop((subject, other), None)


def _difference(before: tuple[str, list[Triple]], after: tuple[str, list[Triple]]) -> Iterator[Diagnostic]:
    """Yield a warning if two maps state different values of one property of a thing."""
    old, new = before[1][-1], after[1][-1]
    if _value(old) == _value(new):
        return
    what = f"{local_name(new.predicate)} of {local_name(str(new.subject))}"
    values = f"{old.object.value!r} in {before[0]} and {new.object.value!r} in {after[0]}"  # type: ignore[union-attr]
    yield warning("M022", f"{what} is {values}: that of {after[0]} counts, which is named later", new.span)


def _value(triple: Triple) -> object:
    assert isinstance(triple.object, Literal)
    try:
        return float(stated_number(triple.object, unit_of_property(local_name(triple.predicate))))
    except ValueError:
        return triple.object.value.strip()


def _compare_classes(sources: Sequence[MapSource], ontology: Ontology, notes: list[Diagnostic]) -> None:
    """Warn of objects with unrelated classes in two maps; they have both in the merged one."""
    first_seen: dict[str, tuple[MapObject, str]] = {}
    for source in sources:
        for thing in source.map.objects:
            other, where = first_seen.setdefault(thing.iri, (thing, source.name))
            if thing.types and other.types and not are_related(thing, other, ontology):
                classes = [local_name(one.types[0]) for one in (other, thing)]
                message = f"{thing.name} is a {classes[0]} in {where} and a {classes[1]} in {source.name}: it is both"
                notes.append(warning("M022", message, thing.span))
