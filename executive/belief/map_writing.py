"""Write the belief as a semantic map in Manchester syntax, which ``--environment`` reads again."""

from __future__ import annotations

from collections.abc import Container, Iterator

from executive.belief.belief import Belief
from executive.maps.classes import MapObject
from executive.maps.statements import Placement, decimal, stated_facts, text_of, with_placements
from planlang.geometry import Pose
from planlang.measures import EXTENTS
from planlang.ontology import Term, Triple, expand
from planlang.ontology.terms import OWL, RDF

MAP = "http://planlang.org/kb/uploaded_map.owl"


def map_text(belief: Belief) -> str:
    """Write all objects at known places, rooms included, with classes, sizes, poses and parts.

    Doors, drawers and their contents have their poses when closed, with the joint positions stated beside.
    """
    known = set(belief.names())
    things = [(thing, belief.closed_pose(thing.name)) for thing in belief.things if thing.name in known]
    things += [handle for whole in things for handle in _handles(*whole, belief) if handle[0].name not in known]
    placed = {thing.iri: Placement(thing.iri, pose) for thing, pose in things}
    header: list[tuple[str, Term]] = [(RDF.type, OWL.Ontology), (OWL.imports, expand("").rstrip("#"))]
    statements = [
        *stated_facts(MAP, header),
        *stated_facts(f"{MAP}#map", [(RDF.type, expand("SemanticEnvironmentMap"))]),
    ]
    statements += (fact for thing, _ in things for fact in _thing(thing, placed, belief))
    return text_of(with_placements(statements, MAP, placed), MAP, [])


def _handles(whole: MapObject, pose: Pose, belief: Belief) -> Iterator[tuple[MapObject, Pose]]:
    """Yield the handles of an object at a pose, with their poses; handles may be parts of the object's body."""
    for part in filter(None, map(belief.map.find, whole.parts)):
        if whole.pose and part.pose and part.name not in belief.memory.unknown and belief.is_a(part, "Handle"):
            yield part, pose @ whole.pose.inverse() @ part.pose


def _thing(thing: MapObject, written: Container[str], belief: Belief) -> Iterator[Triple]:
    facts: list[tuple[str, Term]] = [(RDF.type, cls) for cls in thing.types]
    facts.append(("describedInMap", f"{MAP}#map"))
    facts += [(name, decimal(value)) for name, value in zip(EXTENTS, thing.size or (), strict=False)]
    facts += [("properPhysicalParts", part) for part in thing.parts if part in written]
    if thing.name in belief.joints and belief.is_left_open(thing.name):
        facts.append(("jointPosition", decimal(belief.joint(thing.name))))
    return stated_facts(thing.iri, facts)
