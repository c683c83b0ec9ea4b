"""Doorways that are too narrow for the robot as it drives, with what it holds."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from executive.belief.floor import CELL
from executive.maps.semantic_map import OPENINGS
from executive.motion import Grid, clearance_at, clearance_field
from executive.motion.base_path import cheapest_ways
from planlang.geometry import Array
from planlang.geometry.areas import Block
from planlang.records import dataclass

if TYPE_CHECKING:
    from executive.belief.planning_scene import PlanningScene

SLIM = ((0.1, 1.0, 0.1),)
"""Silhouette of something slim that passes wherever a robot may."""
HEADINGS = 36
"""Directions in half a turn in which the robot's width is measured."""
AVOIDED = 1000.0
"""Cost of a metre within a doorway that is too narrow, in metres elsewhere."""
BEYOND = 0.3
"""Distance from a doorway at which there is floor on either side of it [m]."""


@dataclass(frozen=True, slots=True)
class NarrowDoorway:
    """A doorway through which the robot does not fit."""

    name: str
    width: float
    needed: float
    """Width through which it would drive [m]."""
    held: tuple[str, ...]
    """What it holds."""

    def __str__(self) -> str:
        holding = f" with {' and '.join(self.held)}" if self.held else ""
        return f"{self.name} is {self.width:.2f} m wide;{holding} the robot needs {self.needed:.2f} m"


def narrow_doorway(scene: PlanningScene, place: Array) -> NarrowDoorway | None:
    """Find the first doorway on the way to a position (2,) that is too narrow for the robot as it drives.

    The way is that of something slim. None if it has none, or if the robot fits through all doorways on it.
    """
    needed = needed_width(scene)
    narrow = [one for one in _doorways(scene) if one[2] < needed]
    way = _slim_way(scene, place, [block for _, block, _ in narrow]) if narrow else None
    for point in () if way is None else way[:, None]:
        for name, block, width in narrow:
            if _inside(block, point)[0]:
                return NarrowDoorway(name, width, needed, tuple(scene.belief.held))
    return None


def _inside(block: Block, points: Array) -> NDArray[np.bool_]:
    """Mark the points (n, 2) in a doorway, or within a cell of it, (n,)."""
    along, across = np.abs(block.to_local(points)).T
    return np.asarray((along <= block.half_x + CELL) & (across <= block.half_y + CELL))


def needed_width(scene: PlanningScene) -> float:
    """Compute the width of a doorway through which the robot drives as it does, in its best heading [m].

    A cell of the grid on which ways are searched is added, and the centimetre is full.
    """
    corners = np.concatenate([one.corners for one in scene.collisions.travelled().outlines])
    turns = np.arange(HEADINGS) * (math.pi / HEADINGS)
    width = float(np.ptp(corners @ np.stack([np.cos(turns), np.sin(turns)]), axis=0).min())
    return math.ceil(round(100 * (width + CELL), 6)) / 100


def _doorways(scene: PlanningScene) -> list[tuple[str, Block, float]]:
    """List the doorways of the map with their widths [m], without those through which the base can drive.

    The width is that of the side before which there is floor.
    """
    found = []
    known, boxes, reached = scene.belief.map, scene.collisions.obstacles(), scene.collisions.reached()
    for thing in known.objects:
        if thing.pose is None or thing.size is None or not known.ontology.any_is_a(thing.types, OPENINGS):
            continue
        block = Block.of(thing.pose, thing.size)
        beyond = (block.half_x + BEYOND) * np.array([[math.cos(block.yaw), math.sin(block.yaw)]])
        before = np.array([[block.x, block.y]]) + np.concatenate([beyond, -beyond])
        leads_along = bool((clearance_at(before, boxes, SLIM) > 0.0).all())
        if all(reached.comes_near(point, BEYOND) for point in before):
            continue
        found.append((thing.name, block, round(2 * (block.half_y if leads_along else block.half_x), 6)))
    return found


def _slim_way(scene: PlanningScene, place: Array, narrow: Sequence[Block]) -> Array | None:
    """Find the cells (n, 2) of the way of something slim to a position (2,), or what is nearest to it.

    It leads through the blocks ``narrow`` only if no other way does.
    """
    x_min, y_min, x_max, y_max = scene.world.scene.bounds
    grid = Grid.over((x_min, y_min), (x_max, y_max))
    first = grid.cell(*scene.base()[:2])
    if first is None:
        return None
    centres = grid.centres()
    costs = np.where(clearance_field(grid, scene.collisions.obstacles(), SLIM) > 0.0, 1.0, np.inf)
    away = np.where(np.isfinite(costs), np.hypot(*np.moveaxis(centres - place, 2, 0)), np.inf)
    for block in narrow:
        costs[_inside(block, centres.reshape(-1, 2)).reshape(costs.shape)] *= AVOIDED
    last = divmod(int(away.argmin()), grid.columns)
    way = cheapest_ways(costs, first, last).to(last)
    return None if way is None else np.array([centres[cell] for cell in way])
