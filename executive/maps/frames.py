"""Transformations between the frames of two maps of one place: as stated, or estimated from common objects.

A map states its frame as its own pose (of the ``SemanticEnvironmentMap``) relative to another map, an object or a pose.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from executive.maps.classes import MapObject
from executive.maps.semantic_map import PosesOfThings, SemanticMap
from executive.maps.statements import Placement, decimal, facts_of, number
from planlang.designators import local_name
from planlang.diagnostics import BadInput, Diagnostic, Span, error, note
from planlang.geometry import IDENTITY, Pose
from planlang.geometry.matrices import orthonormal, product, rigid, rotated
from planlang.measures import length, read_transform, stated
from planlang.ontology import Ontology, Triple, expand
from planlang.ontology.terms import OWL
from planlang.records import dataclass

NEAR, TURNED = 0.1, math.radians(10.0)
"""Greatest difference between the poses of an object that is in the same place in two maps [m, rad]."""
ENOUGH = 3
"""Least number of objects, in different places, to estimate a transformation from."""
CLEARLY_MORE = 3
"""A transformation is accepted if it makes more than this many times as many objects agree as the identity does."""
MOST_TRIED = 200
"""Greatest number of candidate transformations."""


@dataclass(frozen=True, slots=True)
class MapSource:
    """A map with the name of its file, its statements, and the placements that it states."""

    name: str
    map: SemanticMap
    statements: list[Triple]
    placed: dict[str, Placement]

    def named(self, names: Mapping[str, str]) -> MapSource:
        """Replace the IRIs of some objects."""
        statements = [
            replace(
                one,
                subject=names.get(one.subject, one.subject) if isinstance(one.subject, str) else one.subject,
                object=names.get(one.object, one.object) if isinstance(one.object, str) else one.object,
            )
            for one in self.statements
        ]
        placed = {}
        for iri, one in self.placed.items():
            parent = None if one.relative_to is None else names.get(one.relative_to, one.relative_to)
            placed[names.get(iri, iri)] = replace(one, thing=names.get(iri, iri), relative_to=parent)
        return replace(self, statements=statements, placed=placed)

    def moved(self, transform: Pose) -> MapSource:
        """Move objects, files and joint directions into another frame; ``transform`` is the pose of this map in it."""
        poses = PosesOfThings(self.map.ontology, [])
        maps = self.map.ontology.individuals(expand("Map"))
        with_files = [iri for iri in maps if any(self.map.ontology.said(iri, "linkToMapFile"))]
        files = {iri: Placement(iri, poses.pose(iri) or IDENTITY) for iri in with_files}
        placed = {iri: replace(one, pose=transform @ one.pose) for iri, one in {**files, **self.placed}.items()}
        things = (replace(one, pose=transform @ one.pose) if one.pose else one for one in self.map.objects)
        turned = {
            str(t.object) for t in self.statements if t.predicate == expand("direction") and t.subject not in placed
        }
        statements = [
            _rotated_vector(one, transform, self.map.ontology) if one.subject in turned else one
            for one in self.statements
        ]
        return replace(self, map=replace(self.map, objects=tuple(things)), statements=statements, placed=placed)


def in_frame_of(first: MapSource, source: MapSource, ontology: Ontology, notes: list[Diagnostic]) -> MapSource:
    """Transform a map into the frame of the first one, with a note if they differ; ``ontology`` contains both.

    Raises BadInput if the frames differ and the transformation cannot be determined.
    """
    transform, why = _stated_transform(first, source), "as stated"
    if transform is None:
        common = list(_common_objects(first, source, ontology))
        transform, count = _estimate(common)
        why = f"estimated from {count} common objects"
        if transform is None:
            _check_one_frame(first, source, len(common), count)
            return source
    if transform.distance(IDENTITY) < 1e-6 and transform.turn(IDENTITY) < 1e-6:
        return source
    x, y, z = (number(round(one, 3)) for one in transform.position)
    yaw = math.degrees(math.atan2(transform.rotation[1, 0], transform.rotation[0, 0])) + 0.0
    message = (
        f"{source.name} is in another frame than {first.name}, {why}: moved by ({x}, {y}, {z}) m, {yaw:.1f} degrees"
    )
    notes.append(note("M027", message, Span(str(source.map.ontology.documents[0].path))))
    return source.moved(transform)


# Stated frames


def _frames(ontology: Ontology) -> Iterator[tuple[str, str | None, Pose]]:
    """Yield each map with a pose: its IRI, that of its parent frame, and the pose."""
    poses = PosesOfThings(ontology, [])
    for iri in ontology.individuals(expand("SemanticEnvironmentMap")):
        place = poses.place_of(iri) if ontology.main(iri) else None
        matrix = None if place is None else read_transform(ontology, place, [])
        if place is not None and matrix is not None:
            parents = ontology.iris(place, "relativeTo")
            yield iri, next(iter(parents), None), Pose.from_matrix(matrix)


def _anchors(source: MapSource) -> dict[str, Pose]:
    """Collect the poses, in the frame of a map, of everything that another frame may be relative to, by IRI."""
    ontology = source.map.ontology
    anchors = {iri: one.pose for iri, one in source.placed.items()}
    anchors |= {iri: IDENTITY for iri in ontology.individuals(expand("SemanticEnvironmentMap")) if ontology.main(iri)}
    for _, parent, pose in _frames(ontology):
        if parent is not None:
            anchors[parent] = pose.inverse()
    return anchors


def _stated_transform(first: MapSource, source: MapSource) -> Pose | None:
    """Find the stated pose of a map's frame in that of the first; None if neither map relates them."""
    ours, theirs = _anchors(first), _anchors(source)
    parents = [parent for one in (first, source) for _, parent, _ in _frames(one.map.ontology) if parent is not None]
    return next((ours[iri] @ theirs[iri].inverse() for iri in parents if iri in ours and iri in theirs), None)


# Estimated frames


def _common_objects(first: MapSource, source: MapSource, ontology: Ontology) -> Iterator[tuple[Pose, Pose]]:
    """Yield the poses in both maps of each common object: same IRI, or a local name that is unique in both."""
    counts = [Counter(local_name(thing.iri) for thing in one.map.objects) for one in (first, source)]
    ours = {thing.iri: thing for thing in first.map.objects}
    by_name = {local_name(thing.iri): thing for thing in first.map.objects}
    for thing in source.map.objects:
        name = local_name(thing.iri)
        alone = by_name.get(name) if counts[0][name] == counts[1][name] == 1 else None
        other = ours.get(thing.iri, alone)
        if other and other.pose and thing.pose and are_related(other, thing, ontology):
            yield other.pose, thing.pose


def are_related(a: MapObject, b: MapObject, ontology: Ontology) -> bool:
    """Check whether a class of one object equals, or is a sub- or superclass of, one of the other."""
    kinds = [[cls for cls in thing.types if cls != OWL.NamedIndividual] for thing in (a, b)]
    return any(ontology.is_a(x, y) or ontology.is_a(y, x) for x in kinds[0] for y in kinds[1])


def _estimate(common: Sequence[tuple[Pose, Pose]]) -> tuple[Pose | None, int]:
    """Estimate the transformation on which most common objects agree, and count the places at which they do.

    Each common object proposes a candidate; the best is refined by averaging over the objects that agree with it.
    None unless that is clearly more than without a transformation: objects move, and some may have moved together.
    """
    counts = [(len(_places(common, IDENTITY)), IDENTITY)]
    candidates = (ours @ theirs.inverse() for ours, theirs in common[:MOST_TRIED])
    counts += [(len(_places(common, transform)), transform) for transform in candidates]
    best_count, best = max(counts, key=lambda one: one[0])
    if best_count < ENOUGH or best_count <= CLEARLY_MORE * counts[0][0]:
        return None, counts[0][0]
    agreeing = [pair for pair in common if _is_near(pair[0], best @ pair[1])]
    rotation = orthonormal(np.mean([product(ours.rotation, theirs.rotation.T) for ours, theirs in agreeing], axis=0))
    ours, theirs = (np.mean([pair[side].position for pair in agreeing], axis=0) for side in (0, 1))
    return Pose.from_matrix(rigid(rotation, ours - rotated(rotation, theirs))), best_count


def _places(common: Sequence[tuple[Pose, Pose]], transform: Pose) -> set[tuple[int, ...]]:
    """Cells of the objects whose poses agree after a transformation; objects close together count once."""
    agreeing = (ours.position for ours, theirs in common if _is_near(ours, transform @ theirs))
    return {tuple(round(one / NEAR) for one in position) for position in agreeing}


def _is_near(a: Pose, b: Pose) -> bool:
    """Check whether two poses agree, within the tolerances of position and orientation."""
    return a.distance(b) <= NEAR and a.turn(b) <= TURNED


def _check_one_frame(first: MapSource, source: MapSource, common: int, alike: int) -> None:
    """Raise BadInput if two maps seem to be in different frames: by their statements, or as no objects agree."""
    if alike >= ENOUGH:
        return
    parents = [parent for one in (first, source) for _, parent, _ in _frames(one.map.ontology) if parent is not None]
    ours, theirs = _named_frames(first), _named_frames(source)
    if parents:
        why = f"the frame of one is stated relative to {local_name(parents[0])}, which has no pose in the other"
    elif ours and theirs and not ours & theirs:
        why = f"poses are relative to {local_name(min(ours))} in one and to {local_name(min(theirs))} in the other"
    elif common >= ENOUGH and not alike:
        why = f"none of their {common} common objects is in the same place"
    else:
        return
    message = f"the transformation between the frames of {first.name} and {source.name} is unknown: {why}"
    help = (
        f"state the pose (orientation) of the map of {source.name}, relativeTo the map of {first.name} or an object "
        f"in it; or add {ENOUGH} objects to both that have not moved"
    )
    raise BadInput([error("M028", message, Span(str(source.map.ontology.documents[0].path)), help)])


def _named_frames(source: MapSource) -> set[str]:
    """Maps (IRIs) to which poses of a map are relative."""
    ontology = source.map.ontology
    maps = set(ontology.individuals(expand("SemanticEnvironmentMap")))
    own_poses = {PosesOfThings(ontology, []).place_of(iri) for iri in maps}
    relative = (t for t in source.statements if t.predicate == expand("relativeTo") and t.subject not in own_poses)
    return {str(t.object) for t in relative if t.object in maps}


# Poses relative to objects of other maps


def completed(source: MapSource, known: Mapping[str, Placement]) -> MapSource:
    """Add the placements of objects whose poses are relative to objects that only other maps place (``known``)."""
    ontology, added = source.map.ontology, dict[str, Placement]()
    times = {one.event: one.time for seen in PosesOfThings(ontology, []).places.values() for one in seen}
    stated_at = [(str(t.subject), str(t.object)) for t in source.statements if t.predicate == expand("eventOccursAt")]
    places, acted = dict(stated_at), expand("objectActedOn")
    parents = {t.subject: str(t.object) for t in source.statements if t.predicate == expand("relativeTo")}
    for triple in (t for t in source.statements if t.predicate == acted and t.object not in source.placed):
        thing, event = str(triple.object), str(triple.subject)
        parent, time = parents.get(places.get(event, ""), ""), times.get(event, -math.inf)
        matrix = read_transform(ontology, places[event], []) if parent in known else None
        if matrix is not None and (thing not in added or time >= added[thing].time):
            facts = tuple(facts_of(ontology, event))
            added[thing] = Placement(thing, known[parent].pose @ Pose.from_matrix(matrix), time, parent, facts)
    return replace(source, placed=source.placed | added)


# Statements in another frame


def _rotated_vector(triple: Triple, transform: Pose, ontology: Ontology) -> Triple:
    """Rotate a statement about a component of a vector into another frame."""
    axis = _AXES.get(local_name(triple.predicate))
    parts = [stated(ontology, str(triple.subject), name) for name in _AXES]
    if axis is None or not all(parts):
        return triple
    values = [None if part is None else length(part, []) for part in parts]
    if any(value is None for value in values):
        return triple
    return replace(triple, object=decimal(float(rotated(transform.rotation, np.array(values, dtype=float))[axis])))


_AXES = {"vectorX": 0, "vectorY": 1, "vectorZ": 2}
