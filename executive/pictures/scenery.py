"""What a picture of a resolution shows besides it: bodies, robot, and where the conjuncts of the location hold."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from functools import partial

import numpy as np

from executive.belief.planning_scene import PlanningScene
from executive.locations.areas import Facing
from executive.locations.demands import base_demand, thing_demand
from executive.pictures.floor_plan import Outline, Region, Scenery
from planlang.designators import Location
from planlang.failures import LocationUnresolvable
from planlang.geometry import Array
from planlang.geometry.box import corners
from planlang.geometry.outline import outline_of
from sim.scene import BodyShape


def scenery_of(
    scene: PlanningScene, location: Location, meant: Collection[str], placed_thing: str | None = None
) -> Scenery:
    """The room as it is believed; places are as large as the base, or as a thing that is placed."""
    world = scene.world
    bodies = []
    tops = {name: float(corners(world.pose(name), world.scene.body(name).size)[:, 2].max()) for name in world.names()}
    for name in sorted(tops, key=lambda name: tops[name]):  # what is on top is drawn last
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
            "meant" if name in meant else body.shape if body.shape in (BodyShape.PERSON, BodyShape.MARKER) else "solid"
        )
        facing = scene.bodies.front(name) if body.shape is BodyShape.PERSON else None
        bodies.append(Outline(name, points, kind, facing))
    robot = scene.base_radius
    size = robot if placed_thing is None else max(world.size(placed_thing)[:2]) / 2
    regions = list(_regions(scene, location, placed_thing))
    on_floor = placed_thing is None
    return Scenery(world.scene.bounds, bodies, size, scene.base(), robot, regions, on_floor)


def _regions(scene: PlanningScene, location: Location, placed_thing: str | None) -> Iterator[Region]:
    """Where each conjunct about the floor holds, for the base or for a thing."""
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
