"""Checks of maps: their contents, and the findings of their reader."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from executive.commands.checked import CheckResult
from executive.maps import SemanticMap, read_map, scene_of
from executive.maps.classes import MapObject
from executive.maps.occupied_space import OBSTACLE
from executive.maps.scene import is_too_wide
from executive.runs.files import RecipeFile
from planlang.closure import grouped
from planlang.designators import local_name
from planlang.diagnostics import BadInput, Diagnostic, Severity, note
from planlang.ontology import Ontology, load
from planlang.words import Blank, Text, calling, joined
from sim import Scene
from sim.joints import Articulation, JointKind
from sim.scene import GRASPABLE_WIDTH, BodyShape

RECIPE = Blank("RECIPE")


def check_map(
    file: RecipeFile, folders: Sequence[Path], no_recipe: BadInput, *, lists_contents: bool, ignore_unread: bool
) -> CheckResult:
    """Check a file without a recipe as a map. Raises BadInput; ``no_recipe`` if it is no map either."""
    path = file.path
    ontology = load(path, folders=folders, content=file.content)
    try:
        semantic_map = read_map(ontology, ignore_unread=ignore_unread)
    except BadInput as problem:
        if not any(one.code != "M009" and one.severity is not Severity.NOTE for one in problem.diagnostics):
            raise no_recipe from None  # nothing in it could have been a place
        raise BadInput((*ontology.diagnostics, *problem.diagnostics)) from None
    diagnostics = [*ontology.diagnostics, *semantic_map.diagnostics]
    try:
        scene = scene_of(semantic_map, diagnostics)
    except BadInput as problem:
        raise BadInput((*diagnostics, *problem.diagnostics)) from None
    diagnostics += _wide(scene, semantic_map)
    counts = _counts(scene)
    use = Text(calling("run", RECIPE, environment=path), " runs a recipe in it")
    if all(number == 0 for kind, (_, _, number) in counts.items() if kind != "obstacles"):
        both = calling("run", RECIPE, environment=[Blank("MAP"), path])
        use = Text(both, " drives around its obstacles")
    opened = {joint.leaf: _range(joint) for joint in scene.joints if not joint.is_knob}
    contents = [line(one, opened.get(one.name, "")) for one in semantic_map.objects]
    text = joined("\n", (f"{path}: a map of {_in_words(counts)}", *(contents if lists_contents else ()), use))
    data = {kind: number for kind, (_, _, number) in counts.items()}
    return CheckResult(True, "map", text, tuple(diagnostics), data)


def _wide(scene: Scene, semantic_map: SemanticMap) -> Iterator[Diagnostic]:
    """Note which things are too wide to be taken; devices with a switch are operated where they stand."""
    devices = {one.device for one in scene.controls}
    bodies = [body for body in scene.bodies if body.name not in devices and is_too_wide(body, semantic_map)]
    if not bodies:
        return
    of_width = grouped((f"{min(body.size[:2]):.3g} m wide", body.name) for body in bodies)
    each = (f"{', '.join(names)} {'are' if names[1:] else 'is'} {wide}" for wide, names in of_width.items())
    message = f"{', '.join(each)}: no hand takes more than {GRASPABLE_WIDTH:g} m"
    first = semantic_map.find(bodies[0].iri)
    help = "if there is a handle for one hand, state it as a part of the thing (Handle, properPhysicalParts)"
    yield note("M040", message, None if first is None else first.span, help)


def line(thing: MapObject, opened: str) -> str:
    """Describe an object of a map: name, classes, centre of its box in the frame of the map [m], how far it opens."""
    centre = "" if thing.pose is None else "  at {:.2f}, {:.2f}, {:.2f}".format(*thing.pose.position)
    return f"  {thing.name}  {', '.join(map(local_name, thing.types))}{centre}{opened}"


def _range(joint: Articulation) -> str:
    slides = joint.kind is JointKind.PRISMATIC
    return f"  opens by {100 * joint.upper:.0f} cm" if slides else f"  opens by {math.degrees(joint.upper):.0f} degrees"


def contents_in_words(ontology: Ontology) -> str | None:
    """Describe the contents of a map; None if the ontology cannot be read as one."""
    try:
        return _in_words(_counts(scene_of(read_map(ontology), [])))
    except BadInput:
        return None


def _in_words(counts: Mapping[str, tuple[str, str, int]]) -> str:
    graspable = counts["graspable"][2]
    of_things = f" ({graspable} graspable)" if graspable else ""
    kinds = (
        f"{number} {one if number == 1 else many}{of_things if kind == 'things' else ''}"
        for kind, (one, many, number) in counts.items()
        if number and kind != "graspable"
    )
    return ", ".join(kinds) or "nothing with a pose"


def _counts(scene: Scene) -> dict[str, tuple[str, str, int]]:
    """Count the bodies of each kind, with the words for one and for several."""
    shapes = [body.shape for body in scene.bodies]
    mapped = sum(body.name.startswith(OBSTACLE) for body in scene.bodies)
    solid = sum(shape in (BodyShape.BOX, BodyShape.CYLINDER) for shape in shapes) - mapped
    leaves = sum(not joint.is_knob for joint in scene.joints)
    return {
        "things": ("object", "objects", solid),
        "graspable": ("graspable", "graspable", sum(body.graspable for body in scene.bodies)),
        "leaves": ("door, drawer or lid", "doors, drawers and lids", leaves),
        "devices": ("device with a switch", "devices with switches", len({one.device for one in scene.controls})),
        "persons": ("person", "persons", shapes.count(BodyShape.PERSON)),
        "rooms": ("room", "rooms", shapes.count(BodyShape.ROOM)),
        "obstacles": ("mapped obstacle", "mapped obstacles", mapped),
        "places": ("mere place", "mere places", shapes.count(BodyShape.MARKER)),
    }
