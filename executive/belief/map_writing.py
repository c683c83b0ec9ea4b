"""Writing what is believed as a semantic map in Manchester syntax, which ``--environment`` reads again."""

from __future__ import annotations

from collections.abc import Iterator

from executive.belief.belief import Belief
from executive.belief.map_statements import number as shown
from executive.belief.measures import EXTENTS
from executive.belief.semantic_map import MapObject
from planlang.geometry import Pose
from planlang.ontology import expand
from planlang.outputs import MARK

MAP = "http://planlang.org/kb/uploaded_map.owl"


def map_text(belief: Belief) -> str:
    """Return the things that are believed to be somewhere, with classes, sizes, poses and parts, rooms included.

    Doors, drawers and what lies in them are written where they are when closed, with how far they are open.
    """
    placed = set(belief.names())
    things = [(thing, belief.closed_pose(thing.name)) for thing in belief.things if thing.name in placed]
    things += [riding for whole in things for riding in _handles(*whole, belief) if riding[0].name not in placed]
    namespace = expand("")
    lines = [f"# A semantic map, {MARK}.", "", f"Prefix: : <{MAP}#>", f"Prefix: knowrob: <{namespace}>", ""]
    lines += [f"Ontology: <{MAP}>", f"    Import: <{namespace.rstrip('#')}>"]
    lines += ["", "Individual: map", "    Types: knowrob:SemanticEnvironmentMap"]
    written = {thing.iri for thing, _ in things}
    for number, (thing, pose) in enumerate(things, 1):
        lines += ["", *_thing(thing, number, written, belief), "", *_pose(number, pose)]
    return "\n".join(lines) + "\n"


def _handles(whole: MapObject, pose: Pose, belief: Belief) -> Iterator[tuple[MapObject, Pose]]:
    """Yield the handles of a thing that is at a pose, with theirs: they may be parts of its body."""
    for part in filter(None, map(belief.map.find, whole.parts)):
        if whole.pose and part.pose and part.name not in belief.unknown and belief.is_a(part, "Handle"):
            yield part, pose @ whole.pose.inverse() @ part.pose


def _thing(thing: MapObject, number: int, written: set[str], belief: Belief) -> Iterator[str]:
    yield f"Individual: <{thing.iri or f'{MAP}#{thing.name}'}>"
    classes = [cls for cls in thing.types if not cls.endswith("#NamedIndividual")]
    if classes:
        yield f"    Types: {', '.join(f'<{cls}>' for cls in classes)}"
    facts = ["knowrob:describedInMap map", f"knowrob:orientation pose_{number}"]
    facts += [f"knowrob:{name} {shown(value)}" for name, value in zip(EXTENTS, thing.size or (), strict=False)]
    facts += [f"knowrob:properPhysicalParts <{part}>" for part in thing.parts if part in written]
    if thing.name in belief.joints and belief.is_left_open(thing.name):
        facts.append(f"knowrob:jointPosition {shown(belief.joint(thing.name))}")
    yield "    Facts:"
    yield from (f"        {fact}{',' if fact is not facts[-1] else ''}" for fact in facts)


def _pose(number: int, pose: Pose) -> Iterator[str]:
    yield f"Individual: pose_{number}"
    yield "    Types: knowrob:RotationMatrix3D"
    yield "    Facts:"
    for row, entries in enumerate(pose.matrix().tolist()):
        facts = ", ".join(f"knowrob:m{row}{column} {shown(one)}" for column, one in enumerate(entries))
        yield f"        {facts}{',' if row < 3 else ''}"
