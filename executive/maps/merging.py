"""Several maps of one place become one: the newest pose of each thing, one of each fact, and where they disagree."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from executive.maps.frames import MapSource, are_related, completed, in_frame_of
from executive.maps.measures import EXTENTS, TRIPLES
from executive.maps.semantic_map import MapObject, read_map
from executive.maps.statements import (
    Placement,
    main_statements,
    placements,
    text_of,
    with_one_header,
    with_placements,
)
from planlang.designators import local_name
from planlang.diagnostics import Diagnostic, note, warning
from planlang.geometry import Array
from planlang.knowledge.places import LEVELS, inverted
from planlang.ontology import Literal, Ontology, Triple, expand, load
from planlang.ontology.terms import RDFS
from planlang.records import dataclass
from planlang.units import stated_number, unit_of_property

SAME_PLACE = 0.01
"""Difference of positions that is none [m]."""
SAME_HEADING = math.radians(2.0)
"""Difference of orientations that is none [rad]."""
ALIKE = 0.5
"""Two things of one class are one if their centres are nearer to each other than this share of the least extent."""


@dataclass(frozen=True, slots=True)
class Merged:
    """A map as text, the number of its things, those of them that have a place, and what was found."""

    text: str
    things: int
    placed: int
    diagnostics: tuple[Diagnostic, ...]


def _source(path: Path, ontology: Ontology, found: list[Diagnostic]) -> MapSource:
    semantic_map = read_map(ontology)
    filled_in = ("M005", "M006")  # that is for who uses the merged map
    found += (*ontology.diagnostics, *(one for one in semantic_map.diagnostics if one.code not in filled_in))
    statements = _turned(main_statements(ontology, {ontology.documents[0].path}), ontology)
    return MapSource(path.name, semantic_map, statements, placements(semantic_map))


def merge(paths: Sequence[Path], folders: Sequence[Path] = ()) -> Merged:
    """Merge maps of one place in the frame of the first; of facts that differ, the later named map's count.

    Raises BadInput for a file that is no map, and if nothing tells how their frames lie to each other.
    """
    found: list[Diagnostic] = []
    sources = [_source(path, load(path, folders=folders), found) for path in paths]
    whole = load(paths[0], folders=folders, also=paths[1:])
    things = {thing.iri: thing for thing in sources[0].map.objects}
    merged = [sources[0]]
    for source in (in_frame_of(sources[0], one, whole, found) for one in sources[1:]):
        names = dict(_same(things, source, whole, found))
        things = {names.get(one.iri, one.iri): one for one in source.map.objects} | things
        merged.append(source.named(names))
    known = _newest(merged, [])
    merged = [completed(source, known) for source in merged]
    statements = _united(merged, found)
    placed = _newest(merged, found)
    _compare_classes(merged, whole, found)
    frames = {iri for iri in whole.individuals(expand("SemanticEnvironmentMap")) if iri not in placed}
    statements = with_placements(statements, whole.iri, placed, gone=frames)
    text = text_of(statements, sources[0].map.ontology.iri, found)
    return Merged(text, len(things), len(placed), tuple(dict.fromkeys(found)))


# One thing by two names


def _same(
    things: Mapping[str, MapObject], source: MapSource, ontology: Ontology, found: list[Diagnostic]
) -> Iterator[tuple[str, str]]:
    """Yield the names of things in a map that the earlier ones have by another name, with that name."""
    own = {thing.iri for thing in source.map.objects}
    others = {iri: thing for iri, thing in things.items() if iri not in own}
    numbered, named = dict[str, list[MapObject]](), dict[str, list[MapObject]]()
    for one in others.values():
        named.setdefault(local_name(one.iri), []).append(one)
        for number in _numbers(one, ontology):
            numbered.setdefault(number, []).append(one)
    placed = [one for one in others.values() if one.pose and one.size]
    places = np.array([one.pose.position for one in placed if one.pose]).reshape(-1, 3)
    for thing in source.map.objects:
        if thing.iri in things:
            continue
        numbers = _numbers(thing, ontology)
        alike = [one for number in numbers for one in numbered.get(number, ())]
        alike += [one for one in _near(thing, placed, places) if not (numbers and _numbers(one, ontology))]
        other = next((one for one in alike if one.iri in others and are_related(thing, one, ontology)), None)
        if other is not None:
            del others[other.iri]
            message = f"{local_name(thing.iri)} of {source.name} is {local_name(other.iri)} of the maps before it"
            found.append(note("M023", message, thing.span, "same class, and same place or number"))
            yield thing.iri, other.iri
        elif any(are_related(thing, one, ontology) for one in named.get(local_name(thing.iri), ())):
            message = f"{local_name(thing.iri)} of {source.name} is taken as another than that of the maps before"
            help = f"they are at different places; rename <{thing.iri}> if they are one"
            found.append(note("M023", message, thing.span, help))


def _numbers(thing: MapObject, ontology: Ontology) -> list[str]:
    """Return the numbers of a place: of a room, a floor, a building."""
    names = [number for _, number in LEVELS.values() if number is not None]
    return [str(one) for name in names for one in ontology.values(thing.iri, expand(name))]


def _near(thing: MapObject, placed: Sequence[MapObject], places: Array) -> Iterator[MapObject]:
    """Yield the things whose middles (n, 3) are so near to that of a thing that two of them have no room there."""
    if thing.pose is None or thing.size is None or not placed:
        return
    distances = np.linalg.norm(places - thing.pose.position, axis=1)
    for index in np.flatnonzero(distances < ALIKE * min(thing.size)).tolist():
        if distances[index] < ALIKE * min(placed[index].size or (0.0,)):
            yield placed[index]


# Where they are


def _newest(sources: Sequence[MapSource], found: list[Diagnostic]) -> dict[str, Placement]:
    """Return the newest placement of each thing; of equally new ones that of the map that is named later."""
    newest: dict[str, tuple[Placement, MapSource]] = {}
    for source in sources:
        for iri, placement in source.placed.items():
            before = newest.get(iri)
            if before is None:
                newest[iri] = placement, source
                continue
            taken = (placement, source) if placement.time >= before[0].time else before
            newest[iri] = taken
            why = "is named" if placement.time == before[0].time else "has seen it"
            if _differ(placement, before[0]):
                places = " and ".join(f"{_shown(one)} in {where.name}" for one, where in (before, (placement, source)))
                message = f"{local_name(iri)} is at {places}: that of {taken[1].name} counts, which {why} later"
                thing = source.map.find(iri)
                found.append(warning("M022", message, None if thing is None else thing.span))
    return {iri: _carried(iri, newest) for iri in newest}


def _carried(iri: str, newest: Mapping[str, tuple[Placement, MapSource]]) -> Placement:
    """Return the placement of a thing; what is stated relative to another one goes with the newest pose of that."""
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


def _differ(a: Placement, b: Placement) -> bool:
    return a.pose.distance(b.pose) > SAME_PLACE or a.pose.turn(b.pose) > SAME_HEADING


def _shown(placement: Placement) -> str:
    x, y, z = placement.pose.position
    return f"({x:.3f}, {y:.3f}, {z:.3f})"


# What is said of them


def _united(sources: Sequence[MapSource], found: list[Diagnostic]) -> list[Triple]:
    """Return the statements of all maps: one header, and values of the last map that states any."""
    poses = {expand(f"m{row}{column}") for row in range(4) for column in range(4)}
    united: dict[tuple[object, str, object], Triple] = {}
    values: dict[tuple[object, str], tuple[str, list[Triple]]] = {}
    for source, statements in zip(sources, with_one_header([one.statements for one in sources]), strict=True):
        stated: dict[tuple[object, str], list[Triple]] = {}
        for triple in statements:
            if isinstance(triple.object, Literal) and not triple.predicate.startswith(str(RDFS)):
                stated.setdefault((triple.subject, triple.predicate), []).append(triple)
            else:
                united.setdefault((triple.subject, triple.predicate, triple.object), triple)
        _without_replaced_sizes(stated, values)
        for key, triples in stated.items():
            if key in values and key[1] not in poses:
                found += _difference(values[key], (source.name, triples))
            values[key] = (source.name, triples)
    return [*united.values(), *(triple for _, triples in values.values() for triple in triples)]


def _turned(statements: Sequence[Triple], ontology: Ontology) -> list[Triple]:
    """Return statements without larger places that are parts of smaller ones: those are parts of them."""
    wrong = {(triple.subject, triple.object) for triple in inverted(ontology)}
    parts = expand("properPhysicalParts")
    return [
        replace(t, subject=t.object, object=t.subject)
        if t.predicate == parts and isinstance(t.object, str) and (t.subject, t.object) in wrong
        else t
        for t in statements
    ]


def _without_replaced_sizes(
    stated: Mapping[tuple[object, str], list[Triple]], values: dict[tuple[object, str], tuple[str, list[Triple]]]
) -> None:
    """Drop extents that one literal replaces, and the other way round."""
    one, three = [expand(name) for name in EXTENTS], [expand(name) for name in TRIPLES]
    for subject, prop in stated:
        for other in three if prop in one else one if prop in three else ():
            values.pop((subject, other), None)


def _difference(before: tuple[str, list[Triple]], after: tuple[str, list[Triple]]) -> Iterator[Diagnostic]:
    """Yield a warning if two maps state different values of one property of a thing."""
    old, new = before[1][-1], after[1][-1]
    if _value(old) == _value(new):
        return
    what = f"{local_name(new.predicate)} of {local_name(str(new.subject))}"
    told = f"{old.object.value!r} in {before[0]} and {new.object.value!r} in {after[0]}"  # type: ignore[union-attr]
    yield warning("M022", f"{what} is {told}: that of {after[0]} counts, which is named later", new.span)


def _value(triple: Triple) -> object:
    assert isinstance(triple.object, Literal)
    try:
        return float(stated_number(triple.object, unit_of_property(local_name(triple.predicate))))
    except ValueError:
        return triple.object.value.strip()


def _compare_classes(sources: Sequence[MapSource], ontology: Ontology, found: list[Diagnostic]) -> None:
    """Tell of things that are of unrelated classes in two maps; they are of both in the merged one."""
    known: dict[str, tuple[MapObject, str]] = {}
    for source in sources:
        for thing in source.map.objects:
            other, where = known.setdefault(thing.iri, (thing, source.name))
            if not are_related(thing, other, ontology):
                classes = [local_name(one.types[0]) for one in (other, thing)]
                message = f"{thing.name} is a {classes[0]} in {where} and a {classes[1]} in {source.name}: it is both"
                found.append(warning("M022", message, thing.span))
