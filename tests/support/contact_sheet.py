"""A contact sheet of all looks, in the sizes of their classes: ``python tests/support/contact_sheet.py sheet.webp``."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from PIL import Image

from executive.pictures.drawn import Drawn, drawn_in
from executive.pictures.looks import table_of_looks
from executive.pictures.modelling import joined, model_of
from executive.pictures.rendering import rendered
from executive.pictures.viewpoints import fitting
from planlang.effects import number_of_class
from planlang.files import bundled
from planlang.geometry import Pose
from planlang.geometry.shapes import Size
from planlang.ontology import load
from sim import Body, CameraModel, PyBulletWorld, RobotBody, Scene

CELL, COLUMNS = (150, 130), 10
FROM = np.array([1.0, -0.75, 0.75])
"""Direction to the eye: before things, which face x, to their left and above."""
STATED: dict[str, Size] = {
    "stool": (0.35, 0.35, 0.5),
    "shelf": (0.35, 0.9, 1.8),
    "basket": (0.28, 0.28, 0.35),
    "lamp": (0.3, 0.3, 0.5),
    "laptop": (0.3, 0.34, 0.24),
    "tap": (0.25, 0.12, 0.3),
    "pancake_maker": (0.35, 0.35, 0.09),
    "vase": (0.12, 0.12, 0.25),
    "jar": (0.08, 0.08, 0.11),
    "pan": (0.4, 0.28, 0.06),
    "thermos": (0.09, 0.09, 0.28),
    "wooden_spoon": (0.3, 0.05, 0.03),
    "spatula": (0.34, 0.08, 0.03),
    "whisk": (0.28, 0.07, 0.07),
    "scissors": (0.2, 0.09, 0.012),
    "knife": (0.22, 0.025, 0.015),
    "sponge": (0.12, 0.07, 0.04),
    "key": (0.07, 0.03, 0.005),
    "remote": (0.17, 0.05, 0.02),
    "apple": (0.08, 0.08, 0.08),
    "butter": (0.1, 0.06, 0.04),
    "stove_top": (0.6, 0.6, 0.03),
    "telephone": (0.2, 0.18, 0.08),
    "bag": (0.15, 0.35, 0.4),
    "bread": (0.25, 0.12, 0.12),
    "spoon": (0.19, 0.042, 0.015),
    "fork": (0.19, 0.03, 0.015),
    "packet": (0.06, 0.1, 0.16),
    "can": (0.066, 0.066, 0.115),
    "bowl": (0.16, 0.16, 0.07),
    "television": (0.18, 0.9, 0.58),
}
"""Sizes of looks for whose first class the ontologies state none [m]."""
PERSONS: dict[str, Size] = {"standing": (0.3, 0.5, 1.75), "sitting": (0.6, 0.5, 1.28), "lying": (1.8, 0.5, 0.35)}


def bodies() -> Iterator[Body]:
    """Yield a body of each look, and persons."""
    ontology = load(bundled("ontologies") / "environments" / "hospital_room.omn")
    for name, row in table_of_looks().items():
        cls = row["classes"][0]
        extents = [number_of_class(ontology, [cls], f"{side}OfObject") for side in ("depth", "width", "height")]
        x, y, z = STATED.get(name) or [extent or 0.2 for extent in extents]
        yield Body(name, Pose((0.0, 0.0, z / 2)), (x, y, z), type=cls, kinds=(cls,))
    for name, size in PERSONS.items():
        yield Body(name, Pose((0.0, 0.0, size[2] / 2)), size, "person")


def cell(body: Body, world: PyBulletWorld, drawn: list[Drawn]) -> Image.Image:
    """Return a body on a piece of floor."""
    models = []
    for number, one in enumerate(drawn):
        pose = one.pose() if len(one.path) == 2 else world.pose(one.path[1]) @ one.pose()
        models.append(model_of(one.shapes, 100 * number).at(pose))
    points = joined(models).vertices
    low, high = points.min(axis=0), points.max(axis=0)
    view = fitting(points, -FROM / np.linalg.norm(FROM), CELL[0] / CELL[1], least=0.01)
    middle, radius = (low + high) / 2, float(np.linalg.norm(high - low)) / 2
    return Image.fromarray(rendered(models, view, CELL, (middle, 1.2 * radius)))


def main(path: Path) -> None:
    found = tuple(bodies())
    urdf = bundled("ontologies") / "robots" / "amigo.urdf"
    world = PyBulletWorld(Scene(found), RobotBody(urdf, CameraModel("base_link")))
    every = drawn_in(world)
    rows = -(-len(found) // COLUMNS)
    sheet = Image.new("RGB", (CELL[0] * COLUMNS, CELL[1] * rows), "white")
    for number, body in enumerate(found):
        own = [one for one in every if one.path[:2] == ("bodies", body.name)]
        row, column = divmod(number, COLUMNS)
        sheet.paste(cell(body, world, own), (CELL[0] * column, CELL[1] * row))
    world.close()
    sheet.save(path, quality=85)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
