"""A map with changes that a failure advised: other poses, other positions of doors and drawers, things left out."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from executive.maps.classes import MapObject
from executive.maps.scene import scene_of
from executive.maps.semantic_map import SemanticMap
from executive.maps.statements import decimal, placements, stated_facts, statements_of, text_of, with_placements
from planlang.advice import Change
from planlang.diagnostics import BadInput, Diagnostic, error
from planlang.geometry.areas import HAIR
from planlang.ontology import expand


def changed_map(
    semantic_map: SemanticMap, files: Collection[Path | None], changes: Sequence[Change], found: list[Diagnostic]
) -> str:
    """Write the map of some files in Manchester syntax, changed; problems of the syntax go to ``found``.

    A thing that is left out goes with its parts. Raises BadInput for a thing that the map does not have, and for a
    position to which it has no joint, or which its joint does not reach.
    """
    things = {change: _thing(semantic_map, change) for change in changes if change.thing is not None}
    placed = placements(semantic_map)
    gone, positions = set[str](), dict[str, float]()
    for change, thing in things.items():
        match change.what, change.value:
            case "translation", (float() as x, float() as y, float() as z) if thing.pose is not None:
                pose = replace(thing.pose, position=(x, y, z))
                placed[thing.iri] = replace(placed[thing.iri], pose=pose, relative_to=None)
            case "jointPosition", float() as position:
                positions[thing.iri] = position
            case "absent", True:
                gone |= {thing.iri, *thing.parts}
    if positions:
        _check_positions(
            semantic_map, {thing.name: positions[thing.iri] for thing in things.values() if thing.iri in positions}
        )
    placed = {iri: one for iri, one in placed.items() if iri not in gone}
    statements = statements_of(semantic_map, files, [one.iri for one in things.values()])
    statements = [t for t in statements if t.subject not in positions or t.predicate != expand("jointPosition")]
    for iri, position in positions.items():
        statements += stated_facts(iri, [("jointPosition", decimal(position))])
    written = with_placements(statements, semantic_map.ontology.iri, placed, gone=gone)
    kept = (t for t in written if t.subject not in gone and not (isinstance(t.subject, str) and t.object in gone))
    return text_of(kept, semantic_map.ontology.iri, found)


def _check_positions(semantic_map: SemanticMap, positions: Mapping[str, float]) -> None:
    """Refuse positions (leaf -> [rad or m]) that would change nothing."""
    joints = {joint.leaf: joint for joint in scene_of(semantic_map).joints}
    for name, position in positions.items():
        joint = joints.get(name)
        if joint is None:
            help = "leave the change out, or name a door, drawer or lid"
            raise BadInput([error("C025", f"{name} has no joint, so it cannot be put to {position:g}", help=help)])
        least, most = sorted((abs(joint.lower), abs(joint.upper)))
        if not least - HAIR <= abs(position) <= most + HAIR:
            help = f"state {least:.3g} to {most:.3g}"
            raise BadInput([error("C025", f"the joint of {name} does not get to {position:g}", help=help)])


def _thing(semantic_map: SemanticMap, change: Change) -> MapObject:
    thing = semantic_map.find(str(change.thing))
    if thing is None:
        raise BadInput([error("C025", f"the map has no {change.thing}, which is to be changed")])
    return thing
