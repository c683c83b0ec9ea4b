"""Furniture that is opened: cupboards with doors, chests of drawers, refrigerators; and open shelves."""

from __future__ import annotations

from dataclasses import dataclass

from planlang.geometry import Pose
from tests.benchmarks.homes import sizes
from tests.benchmarks.homes.furnishing import WALLS, Home, Rectangle, Size, Surface, Thing

SEAM = 0.003
"""Gap between two doors, or two drawers [m]."""
MOST_DRAWERS = 4
FLOOR_OF_DRAWER = 0.012
"""Thickness of a drawer's floor [m]."""


@dataclass(frozen=True)
class Closed:
    """Furniture with one or more leaves, each with a name of its own."""

    name: str
    leaves: tuple[str, ...]
    """Doors or drawers; behind or in each is a surface of the leaf's name."""


def cupboard(
    home: Home, kind: str, *, doors: int = 1, corner: bool = False, cls: str = "Cupboard", beside: str = ""
) -> Closed:
    """Put a cupboard at a wall: "base" (below a worktop), "tall", "wall" (hangs); raises NoRoom."""
    depth = home.between(sizes.CUPBOARD_DEPTH[kind])
    leaf_width = home.between(sizes.DOOR.width)
    width = doors * leaf_width + 2 * WALLS
    if kind == "wall":
        low, leaf_height = home.between(sizes.WALL_UNIT), home.between((0.4, 0.8))
        bottom, top = low, low + leaf_height
    elif kind == "base":
        bottom, low, top = 0.0, home.between(sizes.PLINTH), home.between(sizes.FURNITURE["counter"].height)
        leaf_height = top - low - 0.04
    else:
        bottom, low, leaf_height = 0.0, home.between(sizes.PLINTH), home.between((1.0, 1.7))
        top = low + leaf_height + 0.02
    size = (depth, width, top - bottom)
    pose = home.at_wall((depth, width, top), home.between(sizes.CLEAR), corner=corner, beside=beside)
    pose = Pose.planar(pose.position[0], pose.position[1], pose.yaw, (bottom + top) / 2)
    name = home.named("cupboard")
    leaves = tuple(f"door{number}_of_{name}" for number in range(1, doors + 1))
    fact = f"knowrob:wallThickness {WALLS!r}"
    home.add(Thing(name, cls, pose, size, leaves, (fact,) if home.chance(0.5) else ()))
    if kind == "base":
        home.surface(name, pose, size)
    middle = low + leaf_height / 2 - (bottom + top) / 2
    grip = {"base": 0.85, "wall": 0.15}.get(kind, 0.5)
    for number, leaf in enumerate(leaves):
        y = (number - (doors - 1) / 2) * leaf_width
        side = (1.0 if number == 0 else -1.0) if doors == 2 else (1.0 if home.chance(0.5) else -1.0)
        _door(home, leaf, pose, size, (y, middle), (leaf_width - SEAM, leaf_height), side, grip)
    return Closed(name, leaves)


def refrigerator(home: Home, *, corner: bool = False) -> Closed:
    """Put a refrigerator at a wall; its lowest part may be a freezer that stays shut; raises NoRoom."""
    size = home.size_of(sizes.FRIDGE)
    pose = home.at_wall(size, home.between(sizes.CLEAR), corner=corner)
    name = home.named("fridge")
    low = home.between((0.05, 0.1)) if size[2] < 1.4 or home.chance(0.5) else home.between((0.55, 0.75))
    height = size[2] - low - 0.01
    leaf = f"door1_of_{name}"
    home.add(Thing(name, "Refrigerator", pose, size, (leaf,)))
    side = 1.0 if home.chance(0.5) else -1.0
    _door(home, leaf, pose, size, (0.0, low + height / 2 - size[2] / 2), (size[1] - SEAM, height), side, 0.6, bar=True)
    return Closed(name, (leaf,))


def _door(
    home: Home,
    leaf: str,
    case: Pose,
    size: Size,
    middle: tuple[float, float],
    face: tuple[float, float],
    side: float,
    grip: float,
    *,
    bar: bool = False,
) -> None:
    """Add a door before the front of a case, its handle on ``side``, ``grip`` of its height up, and the room behind."""
    thick, (width, height), (y, z) = home.between(sizes.DOOR.depth), face, middle
    front = size[0] / 2
    handle = f"handle_of_{leaf}"
    home.add(Thing(leaf, "Door", case @ Pose((front + thick / 2, y, z)), (thick, width, height), (handle,)))
    cls, extents, away = _grip(home, length_along="z", longest=0.8 * height, bar=bar)
    at = side * (width / 2 - home.between((0.03, 0.06)))
    up = min(max((grip - 0.5) * height, extents[2] / 2 + 0.03 - height / 2), height / 2 - extents[2] / 2 - 0.03)
    home.add(Thing(handle, cls, case @ Pose((front + thick + away, y + at, z + up)), extents))
    floor = max(z - height / 2, -size[2] / 2 + 0.02)
    _room(home, leaf, case @ Pose((-0.02, y, floor)), (size[0] / 2 - 0.04, width / 2 - 0.03), height - 0.04)


def chest(home: Home, *, corner: bool = False) -> Closed:
    """Put a chest of two to four drawers at a wall; raises NoRoom."""
    count = int(home.rng.integers(2, MOST_DRAWERS + 1))
    fronts = [sizes.DRAWER_FRONT[int(home.rng.integers(len(sizes.DRAWER_FRONT)))] for _ in range(count)]
    plinth, width, depth = home.between(sizes.PLINTH), home.between(sizes.DRAWER_WIDTH), home.between((0.4, 0.6))
    size = (depth, width + 2 * WALLS, plinth + sum(fronts) + 0.03)
    pose = home.at_wall(size, home.between(sizes.CLEAR), corner=corner)
    name = home.named("chest")
    leaves = tuple(f"drawer{number}_of_{name}" for number in range(1, count + 1))
    home.add(Thing(name, "Dresser-PieceOfFurniture", pose, size, leaves))
    home.surface(name, pose, size)
    low = plinth - size[2] / 2
    for leaf, front in zip(leaves, fronts, strict=True):
        _drawer(home, leaf, pose, size, low, front - SEAM)
        low += front
    return Closed(name, leaves)


def _drawer(home: Home, leaf: str, case: Pose, size: Size, low: float, height: float) -> None:
    """Add a drawer whose front stands before that of the case by the thickness of a front."""
    thick, deep, width = 0.018, size[0] - 0.05, size[1] - 2 * WALLS
    handle, front = f"handle_of_{leaf}", size[0] / 2 + thick
    middle = low + height / 2
    home.add(Thing(leaf, "Drawer", case @ Pose((front - deep / 2, 0.0, middle)), (deep, width, height), (handle,)))
    cls, extents, away = _grip(home, length_along="y", longest=0.8 * width)
    up = home.between((0.0, max(height / 2 - 0.04, 0.0)))
    home.add(Thing(handle, cls, case @ Pose((front + away, 0.0, middle + up)), extents))
    _room(
        home,
        leaf,
        case @ Pose((front - thick - deep / 2, 0.0, low + FLOOR_OF_DRAWER)),
        (deep / 2 - 0.03, width / 2 - 0.025),
        height - 0.03,
    )


def _grip(home: Home, *, length_along: str, longest: float, bar: bool = False) -> tuple[str, Size, float]:
    """Return class and size of a bar or knob, and the distance of its middle from the leaf's face."""
    if not bar and home.chance(sizes.KNOBS):
        wide = home.between(sizes.KNOB)
        return "ControlKnob", (wide, wide, wide), wide / 2
    thick, clear = home.between(sizes.BAR_THICK), home.between(sizes.BAR_CLEAR)
    most = max(int(longest / sizes.SPACING), sizes.BARS[0])
    length = int(home.rng.integers(sizes.BARS[0], min(sizes.BARS[1], most) + 1)) * sizes.SPACING
    extents = (thick, thick, length) if length_along == "z" else (thick, length, thick)
    return "Handle", extents, clear + thick / 2


def _room(home: Home, leaf: str, floor: Pose, half: tuple[float, float], clear: float) -> None:
    """Let things stand behind or in a leaf."""
    x, y, z = floor.position
    home.surfaces[leaf] = Surface(leaf, Rectangle(x, y, floor.yaw, half), z, clear)


def open_shelf(home: Home, *, corner: bool = False) -> tuple[str, ...]:
    """Put a bookcase of two to five open compartments at a wall; return their names from below; raises NoRoom."""
    count = int(home.rng.integers(2, 6))
    depth, width = home.between((0.25, 0.4)), home.between((0.4, 0.9))
    heights = [home.between((0.28, 0.4)) for _ in range(count)]
    pose = home.at_wall((depth, width, sum(heights)), home.between(sizes.AISLE), corner=corner)
    low, names = 0.0, []
    facts = ('knowrob:openSide "+x"', f"knowrob:wallThickness {WALLS!r}")
    for height in heights:
        size = (depth, width, height)
        at = Pose.planar(pose.position[0], pose.position[1], pose.yaw, low + height / 2)
        name = home.add(Thing(home.named("shelf"), "Cupboard", at, size, facts=facts))
        inner = (depth / 2 - WALLS, width / 2 - WALLS - 0.01)
        home.surfaces[name] = Surface(
            name,
            Rectangle(at.position[0], at.position[1], at.yaw, inner),
            low + WALLS,
            height - 2 * WALLS - 0.02,
        )
        names.append(name)
        low += height
    return tuple(names)
