"""Write the user's map with the changes of a run: the statements of its files, updated poses, and moved joints.

A pose is replaced where the robot knows a different one, with the time of the map's newest perception plus the plan
time. Poses of unseen objects stay. Created objects are added, and nothing is stated any more about destroyed ones. As
in all maps, doors, drawers and their contents have their poses when closed, with the joint positions stated beside.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from executive.belief.belief import Belief
from executive.belief.memory import Source
from executive.maps.classes import MapObject
from executive.maps.contents import is_content
from executive.maps.statements import (
    Placement,
    decimal,
    placements,
    stated_facts,
    statements_of,
    text_of,
    with_placements,
)
from planlang.designators import local_part
from planlang.diagnostics import Diagnostic
from planlang.measures import EXTENTS
from planlang.ontology import Ontology, Term, Triple, expand, shorten
from planlang.ontology.terms import OWL, RDF, RDFS
from sim.joints import Articulation, JointKind

HAIR = 1e-6
"""Tolerance of poses for rounding [m, rad]."""
_JOINTS = {JointKind.HINGED: "HingedJoint", JointKind.PRISMATIC: "PrismaticJoint"}


class MapUpdate:
    """Map to write after a run. As a listener of the trace, it collects the leaves that were moved."""

    def __init__(self, belief: Belief, files: Collection[Path | None], found: list[Diagnostic]) -> None:
        self._belief, self._files, self._found = belief, files, found
        self._opened: dict[str, None] = {}
        """Leaves that were moved, including those closed again."""

    def __call__(self, record: Mapping[str, Any], node: object) -> None:
        """Collect the leaf of a trace record that moves one."""
        if record["event"] == "belief" and record.get("value") is not None:
            self._opened[str(record["name"])] = None

    def save(self, path: Path) -> None:
        """Write the map with the current belief to a file."""
        text = updated_map(self._belief, self._files, self._opened, self._found)
        path.write_text(text, encoding="utf-8", newline="\n")


def updated_map(belief: Belief, files: Collection[Path | None], opened: Iterable[str], found: list[Diagnostic]) -> str:
    """Write the map of some files in Manchester syntax, with the current belief.

    ``opened``: leaves that were moved, whose joint axes, and radii of doors, are stated too. Problems go to ``found``.
    """
    ontology = belief.map.ontology
    placed = placements(belief.map)
    start = max((one.time for one in placed.values() if math.isfinite(one.time)), default=0.0)
    gone = {thing.iri for thing in belief.things if _is_gone(thing, belief)}
    for thing in belief.things:
        if thing.iri not in gone and _differs_from_map(thing, belief):
            placed |= _moved(thing, belief, start, placed)
    placed = {iri: one for iri, one in placed.items() if iri not in gone}
    statements = statements_of(belief.map, files, gone)
    statements += (fact for thing in belief.memory.made.values() if thing.iri in placed for fact in _new(thing, belief))
    for leaf in (leaf for leaf in opened if leaf in belief.joints):
        statements = _with_joint(statements, leaf, belief)
    written = with_placements(statements, ontology.iri, placed, gone=gone)
    kept = (t for t in written if t.subject not in gone and not (isinstance(t.subject, str) and t.object in gone))
    return text_of(kept, ontology.iri, found)


def _is_gone(thing: MapObject, belief: Belief) -> bool:
    """Check whether an object was destroyed, alone or with its whole, or is a content that has left its vessel."""
    whole = belief.map.holder(thing)
    if any(one.name in belief.memory.gone for one in (thing, whole) if one is not None):
        return True
    vessels = [one.name for one in map(belief.map.find, thing.inside) if one is not None and one.name in belief.names()]
    contents = belief.state.matter.contents
    held = [portion for name in vessels for portion in contents.get(name, {}).values()]
    stays = any(thing.name in one.origins and one.type == shorten(thing.types[0]) for one in held)
    return is_content(thing) and bool(vessels) and not stays


def _differs_from_map(thing: MapObject, belief: Belief) -> bool:
    if thing.name not in belief.names() or any(thing.name in joint.bodies for joint in belief.joints.values()):
        return False
    if thing.name in belief.memory.made:
        return True
    if not _is_stated(thing, belief):
        return False  # a part that follows from a class: it moves with the whole
    if belief.knowledge(thing.name).source not in (Source.MAP, Source.TOLD):
        return True
    pose, mapped = belief.closed_pose(thing.name), thing.pose
    return not belief.by_map_alone(thing.name) and (mapped is None or pose.distance(mapped) + pose.turn(mapped) > HAIR)


def _is_stated(thing: MapObject, belief: Belief) -> bool:
    """Check whether the map states an object itself; parts may follow from classes."""
    return any(belief.map.ontology.triples(thing.iri))


def _moved(thing: MapObject, belief: Belief, start: float, placed: Mapping[str, Placement]) -> dict[str, Placement]:
    """Compute the placements of an object and of the parts that move with it."""
    pose, time = belief.closed_pose(thing.name), start + round(belief.knowledge(thing.name).time, 3)
    before = placed.get(thing.iri)
    moved = {thing.iri: Placement(thing.iri, pose, time)}
    for part in filter(None, map(belief.map.find, thing.parts)):
        if before is not None and part.iri in placed and part.name not in belief.names():
            offset = before.pose.inverse() @ placed[part.iri].pose
            moved[part.iri] = replace(placed[part.iri], pose=pose @ offset, time=time)
    return moved


def _new(thing: MapObject, belief: Belief) -> Iterator[Triple]:
    """Yield the statements about a created object, of the class that heat has given it by now, and about that class."""
    heated = belief.state.matter.types.get(thing.name)
    cls, *above = belief.known_types(expand(heated[0])) if heated else thing.types
    for one in above:  # a class that only the recipe declares
        yield from stated_facts(cls, [(RDF.type, OWL.Class), (RDFS.subClassOf, one)])
    facts: list[tuple[str, Term]] = [(RDF.type, cls)]
    maps = belief.map.ontology.individuals(expand("SemanticEnvironmentMap"))
    facts += [("describedInMap", one) for one in maps[:1]]
    facts += [(name, decimal(value)) for name, value in zip(EXTENTS, thing.size or (), strict=False)]
    yield from stated_facts(thing.iri, facts)


def _with_joint(statements: list[Triple], leaf: str, belief: Belief) -> list[Triple]:
    """Add the joint of a moved leaf to statements: axis and limits unless they are stated, position, and radius."""
    thing, joint = belief.map.find(leaf), belief.joints[leaf]
    if thing is None or joint.is_knob or not _is_stated(thing, belief):
        return statements
    ontology = belief.map.ontology
    stated = [one for one in _linked(thing, ontology) if belief.map.ontology.any_is_a((one,), _JOINTS.values())]
    iri = stated[0] if stated else f"{thing.iri.rpartition(local_part(thing.iri))[0]}joint_{local_part(thing.iri)}"
    facts: list[tuple[str, Term]] = []
    if not any(ontology.triples(iri, expand("maxJointValue"))):
        facts += [("minJointValue", decimal(joint.lower)), ("maxJointValue", decimal(joint.upper))]
        statements = [t for t in statements if t.subject != iri or t.predicate != expand("minJointValue")]
    if not any(ontology.triples(iri, expand("direction"))):
        facts.append(("direction", f"{iri}_direction"))
    statements = [t for t in statements if t.subject not in (iri, thing.iri) or t.predicate != expand("jointPosition")]
    if belief.is_left_open(leaf):
        facts.append(("jointPosition", decimal(joint.sign * belief.joint(leaf))))
    if joint.kind is JointKind.HINGED:
        statements = [t for t in statements if t.subject != iri or t.predicate != expand("turnRadius")]
        facts.append(("turnRadius", decimal(_opening_radius(joint, belief))))
    if not stated:
        facts.append((RDF.type, expand(_JOINTS[joint.kind])))
        statements += stated_facts(thing.iri, [("properPhysicalParts", iri)])
    statements += stated_facts(iri, facts)
    frame = belief.map.find(iri)  # the axis is stated in the frame of the joint, if the map places that
    axis = np.array(joint.axis) if frame is None or frame.pose is None else frame.pose.rotation.T @ joint.axis
    entries = zip(("vectorX", "vectorY", "vectorZ"), (joint.sign * axis).tolist(), strict=True)
    vector: list[tuple[str, Term]] = [(name, decimal(value)) for name, value in entries]
    if ("direction", f"{iri}_direction") in facts:
        statements += stated_facts(f"{iri}_direction", [(RDF.type, expand("Vector")), *vector])
    return statements


def _linked(thing: MapObject, ontology: Ontology) -> Iterator[str]:
    """Yield candidates for the joint of an object: its parts, what it is hinged or connected to, and its wholes."""
    rigidly = expand("connectedTo-Rigidly")
    yield from (*thing.parts, *thing.hinged_to)
    yield from (one for one in ontology.values(thing.iri, rigidly) if isinstance(one, str))
    yield from (
        triple.subject
        for prop in (rigidly, expand("properPhysicalParts"))
        for triple in ontology.triples(None, prop, thing.iri)
        if isinstance(triple.subject, str)
    )


def _opening_radius(joint: Articulation, belief: Belief) -> float:
    """Compute the distance from the axis of a door to its free edge [m]."""
    thing = belief.map.find(joint.leaf)
    closed = joint.motion(belief.joint(joint.leaf)).inverse() @ belief.pose(joint.leaf)
    axis, offset = np.array(joint.axis), np.array(closed.position) - joint.point
    across = offset - float(offset @ axis) * axis
    distance = float(np.linalg.norm(across))
    half = np.zeros(3) if thing is None or thing.size is None else np.array(thing.size) / 2
    return distance + float(np.abs(closed.rotation.T @ (across / distance if distance else across)) @ half)
