"""Doorways that are too narrow for the robot as it drives, with what it holds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from executive.belief.floor import CELL
from executive.maps.doorways import is_wall
from executive.maps.semantic_map import OPENINGS
from executive.motion import Boxes, Grid, clearance_at, clearance_field
from executive.motion.base_path import cheapest_ways
from executive.motion.passages import WIDTHS, narrowest_doorway
from planlang.geometry import Array
from planlang.geometry.areas import Block
from planlang.geometry.shapes import corners
from planlang.records import dataclass
from sim.joints import Articulation
from sim.scene import BodyShape

if TYPE_CHECKING:
    from executive.belief.planning_scene import PlanningScene

SLIM = ((0.1, 1.0, 0.1),)
"""Silhouette of something slim that passes wherever a robot may."""
THIN = ((0.1, 1.0, 0.01),)
"""Silhouette of a line: only walls between floor and position count."""
AVOIDED = 1000.0
"""Cost of a metre within a doorway that is too narrow, in metres elsewhere."""
AS_FAR_AS_IT_GOES = 0.97
"""Share of its range from which on it does not help to open a door further."""
BEYOND = 0.3
"""Distance from a doorway at which there is floor on either side of it, and radius of the floor that counts [m]."""
AXES = (np.array([[1.0, 0.0], [-1.0, 0.0]]), np.array([[0.0, 1.0], [0.0, -1.0]]))
"""Both directions along x and along y."""
PAST = 0.9
"""Distance from a shut leaf at which the base has passed its door [m]."""


@dataclass(frozen=True, slots=True)
class NarrowDoorway:
    """A doorway through which the robot does not fit."""

    name: str
    width: float
    needed: float
    """Width through which it would drive [m]."""
    held: tuple[str, ...]
    """What it holds, if that makes it wider."""
    door: str = ""
    """The leaf in it, if that is not open as far as it goes."""
    wide_open: float = 0.0
    """Width that the leaf would leave then [m]."""

    def __str__(self) -> str:
        holding = f" with {' and '.join(self.held)}" if self.held else ""
        needed = f"{holding} the robot needs {self.needed:.2f} m"
        if not self.door:
            return f"{self.name} is {self.width:.2f} m wide;{needed}"
        if self.wide_open < self.needed:
            return f"{self.name} is {self.wide_open:.2f} m wide with {self.door} open;{needed}"
        if self.width == 0.0:
            return f"{self.door} in {self.name} is closed"
        opened = f"opening it further would make {self.wide_open:.2f} m"
        return f"{self.door} stands half-open and leaves {self.width:.2f} m;{needed}; {opened}"


def narrow_doorway(scene: PlanningScene, place: Array) -> NarrowDoorway | None:
    """Find the first doorway on the way to a position (2,) that is too narrow for the robot as it drives.

    The way is that of something slim. None if it has none, or if the robot fits through all doorways on it.
    """
    needed = needed_width(scene)
    narrow = _narrower(scene, needed)
    way = _slim_way(scene, place, [block for _, block, _, _ in narrow]) if narrow else None
    for point in () if way is None else way[:, None]:
        for name, block, width, door in narrow:
            if _inside(block, point)[0]:
                held = _made_wider_by(scene, needed)
                if door is None or scene.belief.joint(door.leaf) >= AS_FAR_AS_IT_GOES * door.upper:
                    return NarrowDoorway(name, width, needed, held)
                return NarrowDoorway(name, width, needed, held, door.leaf, free_width(scene, door, door.upper))
    return None


def _made_wider_by(scene: PlanningScene, needed: float) -> tuple[str, ...]:
    """List what the robot holds, if it needs less width than ``needed`` [m] with empty hands as its arms are."""
    held = tuple(scene.belief.held)
    state = replace(scene.belief.state.placed(dict.fromkeys(held)), held={})
    return held if held and needed_width(scene.supposing(state)) < needed else ()


def free_width(scene: PlanningScene, door: Articulation, value: float) -> float:
    """Compute the width that a door between rooms leaves of its doorway with its joint at a value [m].

    That is measured along the wall, from the leaf to the jamb on the other side.
    """
    leaf, frame = (scene.world.scene.body(name) for name in (door.leaf, door.frame[0]))
    opening = frame if frame.shape is BodyShape.MARKER and min(frame.size) > 0 else leaf
    normal = leaf.pose.rotation[:, int(np.argmin(leaf.size))]
    along = np.array([-normal[1], normal[0], 0.0])
    free = corners(opening.pose, opening.size) @ along
    taken = corners(door.motion(value) @ leaf.pose, leaf.size) @ along
    widest = max(float(taken.min() - free.min()), float(free.max() - taken.max()))
    return round(min(max(widest, 0.0), float(np.ptp(free))), 6)


def _inside(block: Block, points: Array) -> NDArray[np.bool_]:
    """Mark the points (n, 2) in a doorway, or within a cell of it, (n,)."""
    along, across = np.abs(block.to_local(points)).T
    return np.asarray((along <= block.half_x + CELL) & (across <= block.half_y + CELL))


def needed_width(scene: PlanningScene) -> float:
    """Compute the width of a doorway through which the robot drives as it does, wherever it is in the map [m]."""
    floor = scene.collisions.travelled()
    return narrowest_doorway(floor.silhouette, floor.outlines) or WIDTHS[-1]


def _narrower(scene: PlanningScene, needed: float) -> list[tuple[str, Block, float, Articulation | None]]:
    """List the doorways narrower than ``needed`` [m] with their widths [m] and doors.

    Left out are those without a door through which the base can drive; past a door that leaves less, a flood may get
    where no exact path does. The width is that of the side before which there is floor, or of the wider side if
    something stands before both, less what a door in it takes as it is.
    """
    found = []
    known, boxes, reached = scene.belief.map, _without_doors(scene), scene.collisions.reached()
    doors = {one.frame[0]: one for one in scene.belief.joints.values() if one.frame}
    for thing in known.objects:
        if thing.pose is None or thing.size is None or not known.ontology.any_is_a(thing.types, OPENINGS):
            continue
        block = Block.of(thing.pose, thing.size)
        beyond = block.half_x + BEYOND, block.half_y + BEYOND
        before, aside = (block.to_map(half * AXES[i]) for i, half in enumerate(beyond))
        is_free, is_free_aside = (bool((clearance_at(one, boxes, SLIM) > 0.0).all()) for one in (before, aside))
        # furniture on one side of it hides which way it leads: no doorway is deeper than wide
        leads_along = block.half_x <= block.half_y if is_free == is_free_aside else is_free
        door, sides = doors.get(thing.name), before if leads_along else aside
        width = round(2 * (block.half_y if leads_along else block.half_x), 6)
        if door is not None:
            value = scene.belief.joint(door.leaf)
            width = 0.0 if door.is_shut(value) else min(width, free_width(scene, door, value))
        if width < needed and (door is not None or not all(reached.comes_near(point, BEYOND) for point in sides)):
            found.append((thing.name, block, width, door))
    return found


def gets_past(scene: PlanningScene, door: Articulation) -> bool:
    """Check whether the base surely drives past a door between rooms as it is: it gets to the floor on both sides."""
    reached, shut = scene.collisions.reached(), scene.world.scene.body(door.leaf)
    normal = shut.pose.rotation[:2, int(np.argmin(shut.size))]
    places = np.array(shut.pose.position[:2]) + PAST * np.array([normal, -normal])
    return all(reached.comes_near(place, BEYOND) for place in places)


def _without_doors(scene: PlanningScene) -> Boxes:
    """List the obstacles but for the leaves of doors between rooms, and what is on them."""
    leaves = [name for one in scene.belief.joints.values() if one.frame for name in one.bodies]
    return scene.collisions.boxes_but(leaves)[0]


def _around_walls(scene: PlanningScene, grid: Grid, place: Array) -> Array:
    """Compute how far cells (rows, columns) are from a position (2,), past furniture but around walls [m].

    What stands at a wall is nearer to the floor behind that wall than to much of the floor of its own room.
    """
    cell = grid.cell(*place)
    if cell is None:
        return np.full((grid.rows, grid.columns), np.inf)
    bodies = (one for one in scene.world.scene.bodies if one.shape is not BodyShape.ROOM)
    furniture = [one.name for one in bodies if not is_wall(one, scene.belief.map)]
    walls = scene.collisions.boxes_but(furniture)[0]
    costs = np.where(clearance_field(grid, walls, THIN) > 0.0, 1.0, np.inf)
    costs[cell] = 1.0
    return cheapest_ways(costs, cell).field() * grid.resolution


def _slim_way(scene: PlanningScene, place: Array, narrow: Sequence[Block]) -> Array | None:
    """Find the cells (n, 2) of the way of something slim to the floor nearest to a position (2,), on its side of walls.

    It leads through the blocks ``narrow`` only if no other way does.
    """
    x_min, y_min, x_max, y_max = scene.world.scene.bounds
    grid = Grid.over((x_min, y_min), (x_max, y_max))
    first = grid.cell(*scene.base()[:2])
    if first is None:
        return None
    centres = grid.centres()
    costs = np.where(clearance_field(grid, _without_doors(scene), SLIM) > 0.0, 1.0, np.inf)
    away = np.where(np.isfinite(costs), _around_walls(scene, grid, place), np.inf)
    if not np.isfinite(away.min()):
        return None
    for block in narrow:
        costs[_inside(block, centres.reshape(-1, 2)).reshape(costs.shape)] *= AVOIDED
    last = divmod(int(away.argmin()), grid.columns)
    way = cheapest_ways(costs, first, last).to(last)
    return None if way is None else np.array([centres[cell] for cell in way])
