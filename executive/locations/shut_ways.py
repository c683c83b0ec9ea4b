"""Doors between rooms that keep the base from a place as they are: shut, half-open, or open across its way.

Asked of the world as it would be with them open, or closed: which of them are needed, in the order of the way.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence

import numpy as np

from executive.belief.doorways import AS_FAR_AS_IT_GOES, BEYOND, PAST, free_width, gets_past, needed_width
from executive.belief.planning_scene import PlanningScene
from executive.locations.standing import Standing
from planlang.designators import FixedPose
from planlang.failures import BehindClosedDoor
from planlang.geometry import Array
from sim.joints import Articulation

BEFORE = (0.5, 0.7, 0.9, 1.1)
"""Distances from a leaf at which a base stands that opens it [m]."""
AROUND = 8
"""Headings of the base to try there."""
WIDER = (0.9, 0.93, 0.96, 0.99)
"""Shares of its range to which to open a door, until the base drives past it."""

FINELY = 0.001
"""Accuracy to which to find how far it may be closed again then, as a share of its range."""

IsPossible = Callable[[PlanningScene], bool]


def behind_doors(
    scene: PlanningScene, is_possible: IsPossible, what: str, wanted: str, but: Sequence[str] = ()
) -> BehindClosedDoor | None:
    """Build the failure of something that becomes possible once doors between rooms are open, or open further.

    ``is_possible`` tells of a scene whether it is; in this one it is not. ``what`` is behind them, ``wanted`` describes
    the place, ``but`` are leaves that do not count. None if no door keeps it from being possible.
    """
    doors = _to_open(scene, is_possible, but)
    if not doors:
        return None
    door, *further = names = [scene.bodies.designator(one.leaf) for one, _ in doors]
    first, now = doors[0][0], scene.belief.joint(doors[0][0].leaf)
    shut = [one.is_shut(scene.belief.joint(one.leaf)) for one, _ in doors]
    sides = [side if is_shut else None for (_, side), is_shut in zip(doors, shut, strict=True)]
    beyond = tuple((name, side) for name, side in zip(names, sides, strict=True) if side is not None)
    figures = ""
    if not first.is_shut(now):
        made, free = (f"{free_width(scene, first, value):.2f} m" for value in (first.upper, now))
        figures = f"{first.leaf} stands half-open: opening it further would make {made} instead of {free}"
    return BehindClosedDoor(
        designator=wanted, what=what, door=door, further=tuple(further), beyond=beyond, figures=figures
    )


def check_way_to(scene: PlanningScene, name: str) -> None:
    """Raise BehindClosedDoor if doors between rooms keep the base from everywhere near a body."""
    if scene.robot.base.fixed or not any(one.frame for one in scene.belief.joints.values()):
        return

    def is_near(scene: PlanningScene) -> bool:
        return next(Standing(scene).before(scene.bodies.block(name).centre[:2], scene.arms.all), None) is not None

    if not is_near(scene) and (behind := behind_doors(scene, is_near, name, f"the base near {name}")) is not None:
        raise behind


def _to_open(
    scene: PlanningScene, is_possible: IsPossible, but: Sequence[str]
) -> list[tuple[Articulation, FixedPose | None]]:
    """List the doors to open so that something becomes possible, in the order in which the base gets to them.

    Each with a pose on its other side, as :func:`side_of`.
    """
    belief = scene.belief
    doors = [
        one
        for one in belief.joints.values()
        if one.frame and one.leaf not in but and belief.joint(one.leaf) < AS_FAR_AS_IT_GOES * one.upper
    ]
    if not doors or not is_possible(_opened(scene, doors)):
        return []
    # where another way leads, a door that has no handle is not needed
    needed = sorted(doors, key=lambda one: bool(one.handles))
    for door in tuple(needed) if len(doors) > 1 else ():
        others = [one for one in needed if one is not door]
        if is_possible(_opened(scene, others)):
            needed = others
    ordered: list[tuple[Articulation, FixedPose | None]] = []
    while needed:
        drivable = scene.collisions.drivable()
        # where a base gets to no handle, opening the door beside it fails and says so
        here = (one for any_side in (False, True) for one in needed if drivable(_before(scene, one, any_side)).any())
        if (nearest := next(here, None)) is None:
            break
        ordered.append((nearest, side_of(scene, nearest, there=True)))
        needed = [one for one in needed if one is not nearest]
        scene = _opened(scene, [nearest])
    return ordered


def side_of(scene: PlanningScene, door: Articulation, *, there: bool) -> FixedPose | None:
    """Make a base pose on one side of a door between rooms that faces away from it: ``there`` or here.

    Here is where the base gets to with the door shut; None if that is neither side, or both.
    """
    shut = scene.world.scene.body(door.leaf)
    middle, normal = np.array(shut.pose.position[:2]), shut.pose.rotation[:2, int(np.argmin(shut.size))]
    reached = scene.supposing(scene.belief.with_leaf(door.leaf, 0.0)).collisions.drivable()
    ahead, behind = (reached.comes_near(middle + sign * PAST * normal, BEYOND) for sign in (1, -1))
    if ahead == behind:
        return None
    out = normal if ahead != there else -normal
    x, y = middle + PAST * out
    return FixedPose(x=float(x), y=float(y), yaw=math.atan2(out[1], out[0]))


def is_gripped_from_beyond(scene: PlanningScene, door: Articulation) -> bool:
    """Check whether all handles of a door between rooms are on its other side from where the base gets to."""
    here, shut = side_of(scene, door, there=False), scene.world.scene.body(door.leaf)
    if here is None or not door.handles:
        return False
    middle, grips = np.array(shut.pose.position[:2]), [scene.world.scene.body(one).pose for one in door.handles]
    out = np.array([here.x, here.y]) - middle
    return all(float(out @ (np.array(grip.position[:2]) - middle)) < 0.0 for grip in grips)


def to_close(scene: PlanningScene, is_possible: IsPossible) -> str | None:
    """Find a door between rooms that is open, and with which closed something becomes possible; None without one."""
    belief = scene.belief
    for one in (one for one in belief.joints.values() if one.frame and not one.is_shut(belief.joint(one.leaf))):
        shut = scene.supposing(belief.with_leaf(one.leaf, 0.0))
        if not shut.collisions.contacts(shut.base()) and is_possible(shut):
            return one.leaf
    return None


def open_wide(scene: PlanningScene, joint: Articulation) -> float:
    """Compute how far to open a door between rooms so that the base drives past it as it is [rad or m].

    At least so far that it counts as open, and no further if it does not get past it anyhow.
    """
    needed = min(needed_width(scene), free_width(scene, joint, WIDER[-1] * joint.upper))

    def passes(value: float) -> bool:
        then = scene.supposing(scene.belief.with_leaf(joint.leaf, value))
        return free_width(scene, joint, value) >= needed and gets_past(then, joint)

    return next((value for value in (share * joint.upper for share in WIDER) if passes(value)), joint.first_open)


def least_passed(scene: PlanningScene, joint: Articulation) -> float:
    """Compute how far an open door between rooms may be closed so that the base surely drives past it [rad or m].

    Infinite if it does not get past it as it is. The base may just get past a door of less width than it needs at any
    place of the grid, but then its path may fail for a centimetre.
    """
    needed = needed_width(scene)

    def passes(value: float) -> bool:
        then = scene.supposing(scene.belief.with_leaf(joint.leaf, value))
        is_wide = free_width(scene, joint, value) >= needed
        return is_wide and not then.collisions.contacts(then.base()) and gets_past(then, joint)

    least, low = scene.belief.joint(joint.leaf), 0.0
    if not passes(least):
        return math.inf
    while least - low > FINELY * joint.upper:
        middle = (low + least) / 2
        least, low = (middle, low) if passes(middle) else (least, middle)
    return least


def _opened(scene: PlanningScene, doors: Iterable[Articulation]) -> PlanningScene:
    """Suppose that doors are open as far as they go; those that would touch the robot where it is are left out."""
    for door in doors:
        then = scene.supposing(scene.belief.with_leaf(door.leaf, door.upper))
        if then.collisions.contacts(then.base()):
            then = scene.supposing(scene.belief.state.placed(dict.fromkeys(door.bodies)))
        scene = then
    return scene


def _before(scene: PlanningScene, door: Articulation, any_side: bool) -> Array:
    """Sample base poses (n, 3) before a door: on the sides on which it has handles, or on both."""
    block = scene.bodies.block(door.leaf)
    heading = block.yaw + (math.pi / 2 if block.half_x > block.half_y else 0.0)
    middle, normal = np.array([block.x, block.y]), np.array([math.cos(heading), math.sin(heading)])
    grips = [] if any_side else [np.array(scene.bodies.pose(one).position[:2]) for one in door.handles]
    sides = {math.copysign(1.0, float((grip - middle) @ normal)) for grip in grips} or {1.0, -1.0}
    places = [middle + side * away * normal for away in BEFORE for side in sorted(sides)]
    turns = 2 * math.pi * np.arange(AROUND) / AROUND
    return np.array([[x, y, turn] for x, y in places for turn in turns])
