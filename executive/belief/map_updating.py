"""A map as a robot leaves it behind: what its files state, with what was seen, felt and done since, and moved joints.

A pose of the map is replaced where the robot knows it otherwise; its time is that of the map's newest perception and
the plan time since. What was never seen stays as the map has it. Doors, drawers and what lies in them are written where
they are when it is closed, as maps are, with the position of the joint.
"""

from __future__ import annotations

import math
from collections.abc import Container, Iterable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from executive.belief.belief import Belief
from executive.belief.knowledge import Source
from executive.maps.measures import EXTENTS
from executive.maps.semantic_map import MapObject
from executive.maps.statements import (
    Placement,
    decimal,
    main_statements,
    placements,
    stated_facts,
    text_of,
    with_placements,
)
from planlang.designators import local_name
from planlang.diagnostics import Diagnostic
from planlang.ontology import Ontology, Term, Triple, expand
from planlang.ontology.terms import RDF
from sim.joints import Articulation, JointKind

HAIR = 1e-6
"""Difference of poses that is of rounding [m, rad]."""
_JOINTS = {JointKind.HINGED: "HingedJoint", JointKind.PRISMATIC: "PrismaticJoint"}


class MapUpdate:
    """The map of some files as it is left behind by a run, to whose trace this listens."""

    def __init__(self, belief: Belief, files: Container[Path | None], found: list[Diagnostic]) -> None:
        self._belief, self._files, self._found = belief, files, found
        self._opened: dict[str, None] = {}
        """Leaves that were moved, also if they were closed again."""

    def __call__(self, record: Mapping[str, Any], node: object) -> None:
        """Take note of a record of the trace."""
        if record["event"] == "belief" and record.get("value") is not None:
            self._opened[str(record["name"])] = None

    def save(self, path: Path) -> None:
        """Write the map as it is believed to be now."""
        text = updated_map(self._belief, self._files, self._opened, self._found)
        path.write_text(text, encoding="utf-8", newline="\n")


def updated_map(belief: Belief, files: Container[Path | None], opened: Iterable[str], found: list[Diagnostic]) -> str:
    """Return the map of some files in Manchester syntax, with what the robot believes now.

    ``opened`` are the leaves that it has opened: the axis that led them is written down, a door's with its radius.
    """
    ontology = belief.map.ontology
    placed = placements(belief.map)
    start = max((one.time for one in placed.values() if math.isfinite(one.time)), default=0.0)
    gone = {thing.iri for thing in belief.things if not _is_there(thing, belief)}
    for thing in belief.things:
        if thing.iri not in gone and _is_known_otherwise(thing, belief):
            placed |= _moved(thing, belief, start, placed)
    placed = {iri: one for iri, one in placed.items() if iri not in gone}
    statements = main_statements(ontology, files)
    statements += (fact for thing in belief.made.values() if thing.iri in placed for fact in _new(thing))
    for leaf in (leaf for leaf in opened if leaf in belief.joints):
        statements = _with_joint(statements, leaf, belief)
    return text_of(with_placements(statements, ontology.iri, placed, gone=gone), ontology.iri, found)


def _is_there(thing: MapObject, belief: Belief) -> bool:
    """Return whether a thing is still somewhere: what was not seen is where the map has it."""
    return thing.pose is None or thing.name in belief.names() or thing.name in belief.unknown or _rides(thing, belief)


def _rides(thing: MapObject, belief: Belief) -> bool:
    """Return whether a thing is no body of its own: a handle is a part of the body that it moves with."""
    holder = belief.map.holder(thing)
    return holder is not None and (holder.name in belief.names() or holder.name in belief.unknown)


def _is_known_otherwise(thing: MapObject, belief: Belief) -> bool:
    if thing.name not in belief.names() or any(thing.name in joint.bodies for joint in belief.joints.values()):
        return False
    if thing.name not in belief.made and not _is_stated(thing, belief):
        return False  # it goes with what it is a part of
    if belief.knowledge(thing.name).source not in (Source.MAP, Source.TOLD):
        return True
    pose, mapped = belief.closed_pose(thing.name), thing.pose
    return not belief.by_map_alone(thing.name) and (mapped is None or pose.distance(mapped) + pose.turn(mapped) > HAIR)


def _is_stated(thing: MapObject, belief: Belief) -> bool:
    """Return whether a map states a thing; parts may follow from classes."""
    return any(belief.map.ontology.triples(thing.iri))


def _moved(thing: MapObject, belief: Belief, start: float, placed: Mapping[str, Placement]) -> dict[str, Placement]:
    """Return the placements of a thing and of the parts that move with it."""
    pose, time = belief.closed_pose(thing.name), start + round(belief.knowledge(thing.name).time, 3)
    before = placed.get(thing.iri)
    moved = {thing.iri: Placement(thing.iri, pose, time)}
    for part in filter(None, map(belief.map.find, thing.parts)):
        if before is not None and part.iri in placed and part.name not in belief.names():
            offset = before.pose.inverse() @ placed[part.iri].pose
            moved[part.iri] = replace(placed[part.iri], pose=pose @ offset, time=time)
    return moved


def _new(thing: MapObject) -> Iterator[Triple]:
    """Yield what is said of a thing that came into being."""
    facts: list[tuple[str, Term]] = [(RDF.type, cls) for cls in thing.types]
    facts += [(name, decimal(value)) for name, value in zip(EXTENTS, thing.size or (), strict=False)]
    return stated_facts(thing.iri, facts)


def _with_joint(statements: list[Triple], leaf: str, belief: Belief) -> list[Triple]:
    """Return statements with the joint of a leaf as it moved: axis and limits unless they are stated, and radius."""
    thing, joint = belief.map.find(leaf), belief.joints[leaf]
    if thing is None or joint.is_knob or not _is_stated(thing, belief):
        return statements
    ontology = belief.map.ontology
    stated = [one for one in _linked(thing, ontology) if _is_joint(one, belief)]
    iri = stated[0] if stated else f"{thing.iri.rpartition(local_name(thing.iri))[0]}joint_{local_name(thing.iri)}"
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
    frame = belief.map.find(iri)  # an axis is in the frame of its joint if that has a place
    axis = np.array(joint.axis) if frame is None or frame.pose is None else frame.pose.rotation.T @ joint.axis
    entries = zip(("vectorX", "vectorY", "vectorZ"), (joint.sign * axis).tolist(), strict=True)
    vector: list[tuple[str, Term]] = [(name, decimal(value)) for name, value in entries]
    if ("direction", f"{iri}_direction") in facts:
        statements += stated_facts(f"{iri}_direction", [(RDF.type, expand("Vector")), *vector])
    return statements


def _linked(thing: MapObject, ontology: Ontology) -> Iterator[str]:
    """Yield what may be the joint of a thing: parts, what it is hinged or connected to, what it is a part of."""
    rigidly = expand("connectedTo-Rigidly")
    yield from (*thing.parts, *thing.hinged_to)
    yield from (one for one in ontology.values(thing.iri, rigidly) if isinstance(one, str))
    yield from (
        triple.subject
        for prop in (rigidly, expand("properPhysicalParts"))
        for triple in ontology.triples(None, prop, thing.iri)
        if isinstance(triple.subject, str)
    )


def _is_joint(iri: str, belief: Belief) -> bool:
    return belief.map.ontology.any_is_a((iri,), _JOINTS.values())


def _opening_radius(joint: Articulation, belief: Belief) -> float:
    """Return the distance from the axis of a door to its free edge [m]."""
    thing = belief.map.find(joint.leaf)
    closed = joint.motion(belief.joint(joint.leaf)).inverse() @ belief.pose(joint.leaf)
    axis, arrow = np.array(joint.axis), np.array(closed.position) - joint.point
    across = arrow - float(arrow @ axis) * axis
    distance = float(np.linalg.norm(across))
    half = np.zeros(3) if thing is None or thing.size is None else np.array(thing.size) / 2
    return distance + float(np.abs(closed.rotation.T @ (across / distance if distance else across)) @ half)
