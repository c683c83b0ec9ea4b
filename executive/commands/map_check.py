"""A map given to ``planlang check``: what it holds, and what its reader found."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from executive.commands.answers import Answer
from executive.maps import read_map, scene_of
from executive.maps.files import OBSTACLE
from planlang.diagnostics import BadInput, Severity
from planlang.ontology import Ontology, load
from sim import Scene
from sim.scene import BodyShape


def check_map(path: Path, folders: Sequence[Path], no_recipe: BadInput) -> Answer:
    """Read the map of a file that states no recipe; raises BadInput, ``no_recipe`` if it is no map either."""
    ontology = load(path, folders=folders)
    try:
        semantic_map = read_map(ontology)
    except BadInput as problem:
        if not any(one.severity is Severity.WARNING for one in problem.diagnostics):
            raise no_recipe from None  # nothing is stated that could have been a place
        raise BadInput((*ontology.diagnostics, *problem.diagnostics)) from None
    found = [*ontology.diagnostics, *semantic_map.diagnostics]
    counts = _counts(scene_of(semantic_map, found))
    use = f"planlang run RECIPE --environment {path} runs a recipe in it"
    if all(number == 0 for kind, (_, _, number) in counts.items() if kind != "obstacles"):
        use = f"planlang run RECIPE --environment MAP --environment {path} drives around its obstacles"
    text = f"{path}: a map of {_held(counts)}\n{use}"
    data = {"kind": "map", **{kind: number for kind, (_, _, number) in counts.items()}}
    return Answer(diagnostics=tuple(found), text=text, data=data)


def what_it_holds(ontology: Ontology) -> str | None:
    """Return what the map of an ontology holds, in words; None if it is none that can be read."""
    try:
        return _held(_counts(scene_of(read_map(ontology), [])))
    except BadInput:
        return None


def _held(counts: Mapping[str, tuple[str, str, int]]) -> str:
    held = (f"{number} {one if number == 1 else many}" for one, many, number in counts.values() if number)
    return ", ".join(held) or "nothing that is here"


def _counts(scene: Scene) -> dict[str, tuple[str, str, int]]:
    """Return how many bodies of each kind a map has, with the words for one and for several."""
    shapes = [body.shape for body in scene.bodies]
    mapped = sum(body.name.startswith(OBSTACLE) for body in scene.bodies)
    solid = sum(shape in (BodyShape.BOX, BodyShape.CYLINDER) for shape in shapes) - mapped
    leaves = sum(not joint.is_knob for joint in scene.joints)
    return {
        "things": ("thing", "things", solid),
        "graspable": ("that a hand takes", "that a hand takes", sum(body.graspable for body in scene.bodies)),
        "leaves": ("door, drawer or lid", "doors, drawers and lids", leaves),
        "devices": ("device with a switch", "devices with switches", len({one.device for one in scene.controls})),
        "persons": ("person", "persons", shapes.count(BodyShape.PERSON)),
        "rooms": ("room", "rooms", shapes.count(BodyShape.ROOM)),
        "obstacles": ("mapped obstacle", "mapped obstacles", mapped),
        "places": ("mere place", "mere places", shapes.count(BodyShape.MARKER)),
    }
