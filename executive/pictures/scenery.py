"""What a floor plan shows: a room and its bodies from above, the regions that a location means, and the candidates."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import field
from functools import partial

import numpy as np

from executive.belief.planning_scene import PlanningScene
from executive.belief.scene_collisions import BasePose
from executive.locations.demands import base_demand, thing_demand
from executive.locations.rejections import Validated
from planlang.designators import Location
from planlang.failures import LocationUnresolvable
from planlang.geometry import Array
from planlang.geometry.areas import Facing
from planlang.geometry.shapes import corners, outline_of
from planlang.records import dataclass
from sim.scene import BodyShape

Bounds = tuple[float, float, float, float]
"""x_min, y_min, x_max, y_max [m]."""


@dataclass(frozen=True, slots=True)
class Outline:
    """A body from above: its name, its outline (n, 2) in the map [m], and its kind.

    The kind is "solid", "person", "marker", or "meant" for bodies that the location refers to.
    """

    name: str
    polygon: Array
    kind: str = "solid"
    facing: float | None = None
    """Direction that a person faces [rad]."""


@dataclass(frozen=True, slots=True)
class Region:
    """Region of the map in which a conjunct holds: its phrase, and a predicate of points (n, 2) with result (n,)."""

    words: str
    inside: Callable[[Array], Array]


@dataclass(frozen=True, slots=True)
class Scenery:
    """Background of the picture: the room's floor, the bodies, and the robot's base."""

    bounds: Bounds
    bodies: Sequence[Outline]
    radius: float
    """Radius of the base or the thing that is to be placed [m]."""
    robot: BasePose
    robot_radius: float
    regions: Sequence[Region] = ()
    on_floor: bool = True
    """False if a thing is placed on furniture; candidates are then drawn over the bodies."""


@dataclass(frozen=True, slots=True)
class Resolution:
    """Candidates and results of a resolution; places are sorted best first."""

    title: str
    places: Sequence[BasePose]
    validated: Sequence[Validated]
    scored: Sequence[tuple[Array, Array]] = ()
    """Candidates (m, 3) before validation, and their scores (m,)."""
    refused: Sequence[tuple[str, Array]] = ()
    """Candidates (m, 3 or 2) that were rejected before validation, with the reason."""
    counts: Mapping[str, int] = field(default_factory=dict)
    """Rejected candidates by reason."""
    blocking: Mapping[str, int] = field(default_factory=dict)
    """Candidates in collision by body."""
    details: Sequence[str] = ()
    """Text for each place, such as the arm and the grasp."""
    message: str = ""
    """Reason why there is no place."""


def outlines(scene: PlanningScene, meant: Collection[str] = ()) -> list[Outline]:
    """Outlines of the bodies at their believed poses, in ascending order of their tops; held bodies are left out."""
    world = scene.world
    bodies: list[Outline] = []
    tops = {name: float(corners(world.pose(name), world.scene.body(name).size)[:, 2].max()) for name in world.names()}
    for name in sorted(tops, key=lambda name: tops[name]):  # higher bodies are drawn over lower ones
        body = world.scene.body(name)
        if body.shape is BodyShape.ROOM or name in world.attached():
            continue
        if body.shape is BodyShape.CYLINDER:
            block = scene.bodies.block(name)
            turns = np.arange(32) * 2 * np.pi / 32
            circle = np.column_stack([block.half_x * np.cos(turns), block.half_y * np.sin(turns)])
            points = block.to_map(circle)
        else:
            points = outline_of(corners(world.pose(name), body.size)[:, :2])
        kind = (
            "meant"
            if name in meant
            else body.shape.value
            if body.shape in (BodyShape.PERSON, BodyShape.MARKER)
            else "solid"
        )
        facing = scene.bodies.front(name) if body.shape is BodyShape.PERSON else None
        bodies.append(Outline(name, points, kind, facing))
    return bodies


def scenery_of(
    scene: PlanningScene, location: Location, meant: Collection[str], placed_thing: str | None = None
) -> Scenery:
    """Background from the believed state of the room; places have the size of the base or of the thing to be placed."""
    world, bodies = scene.world, outlines(scene, meant)
    robot = scene.robot.base.radius
    size = robot if placed_thing is None else max(world.size(placed_thing)[:2]) / 2
    regions = list(_regions(scene, location, placed_thing))
    on_floor = placed_thing is None
    return Scenery(world.scene.bounds, bodies, size, scene.base(), robot, regions, on_floor)


def _regions(scene: PlanningScene, location: Location, placed_thing: str | None) -> Iterator[Region]:
    """Yield the regions in which conjuncts about positions hold, for the base or for a thing."""
    x, y, _ = scene.base()
    try:
        if placed_thing is None:
            areas = base_demand(location, scene, (x, y)).areas
        else:
            areas = thing_demand(location, placed_thing, scene, (x, y)).areas
    except LocationUnresolvable:
        return
    for area in areas:
        if not isinstance(area, Facing):
            yield Region(area.words.replace("not not ", ""), partial(_positive, area.score))


def _positive(score: Callable[[Array], Array], points: Array) -> Array:
    return np.asarray(score(points) > 0)
