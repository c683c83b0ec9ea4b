"""Changes of the map that would make a location reachable, tested by the search itself."""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from executive.belief.believed_bodies import BelievedBodies
from executive.belief.planning_scene import PlanningScene
from executive.locations.reachability import CELL
from executive.locations.rejections import NOT_LOOKED_AT, Rejections
from executive.locations.standing import floor_near
from executive.motion import clearance_at
from planlang.geometry import Array, Pose
from planlang.geometry.areas import Block

MOST_TRIED = 4
"""Number of bodies whose removal is tested."""
MOST_EDGES = 2
"""Number of edges to which a thing is moved: the nearest, and where the base gets closest."""
MOST_SEARCHES = 10
"""Number of changes that are tested in all, each by a search."""
STEP = 0.05
"""Step by which a thing is moved towards an edge [m]."""
TABLE = 0.75
"""Height of a table [m]: a thing is raised or lowered by shares of its difference from this."""
HEIGHTS = (0.5, 1.0)
"""These shares."""
FROM_EDGE = 0.02
"""Distance that a thing keeps from an edge [m]."""
BEFORE = np.arange(0.1, 1.0, CELL)
"""Distances from an edge at which the base may stand to reach over it [m]."""
TOWARDS = 0.7
"""Smallest cosine between the way to an edge and a given direction."""
ROUND = Pose((0.0, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0))
"""Half a turn about the vertical."""
GRAZING = 5e-3
"""Height by which a displaced thing may overlap others [m]: it stands on one of them."""

IsFeasible = Callable[[PlanningScene, Rejections], bool]
"""Check whether a scene, which is supposed, has a base pose; counts why others are rejected."""


def with_supports(names: Iterable[str], bodies: BelievedBodies) -> set[str]:
    """Collect bodies with all that they stand on or in, directly or not: without these they would hang in the air."""
    found, left = set[str](), list(names)
    while left:
        name = left.pop()
        found.add(name)
        support = bodies.support(name)
        left += [support] if support is not None and support not in found else []
    return found


class Changes:
    """Changes of the map, one at a time, each tested by the search itself."""

    def __init__(
        self,
        body: str,
        scene: PlanningScene,
        log: Rejections,
        is_feasible: IsFeasible,
        *,
        parts: Collection[str] = (),
        needed: Collection[str] = (),
    ) -> None:
        """Prepare; ``parts`` move with ``body``, as the button of a device; ``needed`` bodies are not removed."""
        self.body, self.scene, self.log, self._is_feasible, self._needed = body, scene, log, is_feasible, needed
        self._is_movable = scene.bodies.is_movable(body) or not {*parts} <= {body}
        self._along = {*parts, *(scene.world.standing_on(body) if self._is_movable else ())} - {body}
        self.meanwhile = Rejections()
        """Why base poses are rejected with these changes."""
        self._tried: list[str] = []
        """Changes with which the search found nothing."""
        self._left = MOST_SEARCHES

    def helping(self) -> str:
        """Describe a change that helps: the thing nearer to an edge, without a body, or at another height."""
        return self.nearer() or self._without() or self._at_another_height()

    def in_vain(self) -> str:
        """Describe the changes with which a search was made in vain: a shorter one than that which failed."""
        return f"a short search found nothing with {' or '.join(self._tried)} either" if self._tried else ""

    def nearer(self, towards: Array | None = None) -> str:
        """Describe how far, and where to, the thing has to be moved on its support; "" if that does not help.

        With ``towards`` (2,), a direction in the map, only that way.
        """
        bodies = self.scene.bodies
        support = bodies.support(self.body)
        if support is None or not self._is_movable or bodies.is_room(support):
            return ""
        ways: list[tuple[Array, list[float], Pose]] = []
        for side, steps in self._ways_to_edges(support):
            if not steps or (towards is not None and float(towards @ side) < TOWARDS):
                continue
            end = self._moved(side, steps[-1])
            if all(math.dist(end.position, other.position) > STEP for _, _, other in ways):
                ways.append((side, steps, end))
        for side, steps, farthest in ways if len(ways) <= MOST_EDGES else (*ways[: MOST_EDGES - 1], ways[-1]):
            x, y, _ = farthest.position
            if not self._helps_at(farthest, f"{self.body} at x = {x:.2f}, y = {y:.2f}"):
                continue
            # the last step helps: bisect for the first that does
            first = bisect_left(steps, True, key=lambda step: self._helps_at(self._moved(side, step)))
            step = steps[min(first, len(steps) - 1)]
            x, y, _ = self._moved(side, step).position
            return f"moved {step:.2f} m, to x = {x:.2f}, y = {y:.2f}, {self.body} could be reached"
        return ""

    def _ways_to_edges(self, support: str) -> Iterator[tuple[Array, list[float]]]:
        """Yield directions (2,) in which a thing can be moved on its support, and free steps [m].

        First those to edges at which the base can stand, the nearest first; then the one to where the base gets
        closest, as behind a corner.
        """
        bodies = self.scene.bodies
        thing = bodies.block(self.body)
        ways = self._straight_ways(bodies.block(support), thing)
        for side, most in (*ways, *self._ways_to_corners(bodies.block(support), thing)):
            steps = [*np.arange(STEP, most, STEP).tolist(), math.floor(100 * most) / 100] if most > 0 else []
            yield side, [step for step in steps if self._is_free(thing, side, step)]

    def _straight_ways(self, block: Block, thing: Block) -> list[tuple[Array, float]]:
        floor, ways = self.scene.collisions.floor(), []
        for quarter in range(4):
            heading = block.yaw + quarter * math.pi / 2
            side, half = np.array([math.cos(heading), math.sin(heading)]), (block.half_x, block.half_y)[quarter % 2]
            room = half - float(side @ [thing.x - block.x, thing.y - block.y])
            before = np.array([thing.x, thing.y]) + np.outer(room + BEFORE, side)
            if floor.fits(before).any():
                ways.append((room, side, room - thing.support(heading) - FROM_EDGE))
        return [(side, most) for _, side, most in sorted(ways, key=lambda way: way[0])]

    def _ways_to_corners(self, block: Block, thing: Block) -> Iterator[tuple[Array, float]]:
        points = floor_near(block, self.scene.collisions.floor())
        c, s = math.cos(block.yaw), math.sin(block.yaw)
        axes = np.array([[c, s], [-s, c]])
        most = [block.half_x, block.half_y] - (np.hypot(thing.half_x, thing.half_y) + FROM_EDGE)
        if not len(points) or (most <= 0).any():
            return
        over = np.clip((points - [block.x, block.y]) @ axes.T, -most, most) @ axes + [block.x, block.y]
        distances = np.linalg.norm(over - points, axis=1)
        moved = over - [thing.x, thing.y]
        way = moved[np.lexsort((np.linalg.norm(moved, axis=1).round(6), distances.round(1)))[0]]
        if (length := float(np.linalg.norm(way))) > STEP:
            yield way / length, length

    def _is_free(self, thing: Block, side: Array, step: float, others: Collection[str] = ()) -> bool:
        """Check whether a thing displaced to a side overlaps nothing, besides what moves along, as far as known."""
        boxes = self.scene.collisions.boxes_but((self.body, *self._along, *others))[0]
        inner = ((thing.low + GRAZING, thing.high - GRAZING, min(thing.half_x, thing.half_y)),)
        return bool(clearance_at(np.array([thing.x, thing.y]) + step * side, boxes, inner)[0] > 0)

    def _moved(self, side: Array, step: float) -> Pose:
        """Pose of the thing displaced to a side, rounded as reported: a user will write what was tested."""
        pose = self.scene.bodies.pose(self.body)
        x, y, z = pose.position
        if not step:
            return pose
        return replace(pose, position=(round(x + step * float(side[0]), 2), round(y + step * float(side[1]), 2), z))

    def _without(self) -> str:
        bodies = self.scene.bodies
        fixed = {*with_supports({self.body, *self._needed}, bodies), *filter(bodies.is_room, bodies.names())}
        joints = self.scene.belief.joints.values()
        fixed |= {name for joint in joints if self.body in joint.bodies for name in joint.bodies}
        fixed |= {*(joint.holder for joint in joints if joint.holder is not None), *self.scene.belief.state.carried()}
        blocking = [name for name in self.log.ordered_blocking() if name not in fixed and name in bodies.names()]
        for name in blocking[:MOST_TRIED]:
            leaf, riders = self.scene.belief.joints.get(name), self.scene.world.standing_on(name)
            gone = {name, *riders, *(leaf.bodies if leaf is not None else ())} - fixed
            if self._helps(dict.fromkeys(sorted(gone)), f"{name} removed"):
                open_leaf = f"{name} is in the way as it is open: " if leaf is not None else ""
                return f"{open_leaf}without {name}{' and what stands on it' if riders else ''} this would work"
        return ""

    def _at_another_height(self) -> str:
        """Describe the height closer to a table's at which a thing, or its furniture, would be reachable."""
        bodies = self.scene.bodies
        support = bodies.support(self.body)
        if furniture := self._furniture():
            return self._with_furniture(furniture)
        if support is None or not bodies.is_movable(self.body):
            return ""
        thing = bodies.block(self.body)
        rises = TABLE - thing.low
        edge = max((way for way in self._ways_to_edges(support) if way[1]), key=lambda way: way[1][-1], default=None)
        ways = [(np.zeros(2), 0.0), *([] if edge is None else [(edge[0], edge[1][-1])])]
        onto = bodies.block(support).high - thing.low  # a thing that floats above its support is meant to stand on it
        shares = (share * rises for share in HEIGHTS)
        for rise in (onto, *shares) if abs(onto) >= STEP else shares:
            above = replace(thing, low=thing.low + rise, high=thing.high + rise)
            for side, step in ways if abs(rise) >= STEP else ():
                x, y, z = self._moved(side, step).position
                if not self._is_free(above, side, step):
                    continue
                place = f" and at x = {x:.2f}, y = {y:.2f}" if step else ""
                height = f"{above.low:.2f} m above the floor"
                if self._helps_at(
                    replace(bodies.pose(self.body), position=(x, y, z + rise)), f"{self.body} {height}{place}"
                ):
                    return f"{height} instead of {thing.low:.2f} m{place}, {self.body} could be reached"
        return ""

    def _with_furniture(self, parts: Sequence[str]) -> str:
        """Describe how much higher or lower furniture has to be, with its parts and all that is in or on it."""
        bodies, name = self.scene.bodies, parts[0]
        block, most = bodies.block(name), TABLE - bodies.block(self.body).low
        rises = [math.copysign(STEP * step, most) for step in range(1, int(abs(most) / STEP) + 1)]
        rises = [rise for rise in rises if self._fits(block, rise, parts)]

        word = "higher" if most > 0 else "lower"

        def helps(rise: float) -> bool:
            poses = {one: Pose((0.0, 0.0, rise)) @ bodies.pose(one) for one in parts}
            return self._helps(poses, f"{name} {abs(rise):.2f} m {word}")

        # the largest rise may be too large: bisect for the smallest below one that helps
        last = next(
            (k for k in sorted({len(rises) - 1, len(rises) // 2}, reverse=True) if rises and helps(rises[k])), None
        )
        if last is None:
            return ""
        rise = rises[bisect_left(rises[:last], True, key=helps)]
        what = "it" if name == self.body else self.body
        return f"with {name} {abs(rise):.2f} m {word}, {what} could be reached"

    def _fits(self, furniture: Block, rise: float, parts: Sequence[str]) -> bool:
        """Check whether furniture has room at another height: it overlaps neither the floor nor other bodies."""
        raised = replace(furniture, low=furniture.low + rise, high=furniture.high + rise)
        return raised.low >= -GRAZING and self._is_free(raised, np.zeros(2), 0.0, parts)

    def _furniture(self) -> list[str]:
        """List the furniture with doors or drawers that contains a thing or place, then its parts and contents."""
        bodies, joints = self.scene.bodies, self.scene.belief.joints.values()
        support = bodies.support(self.body)
        holders = {one.holder for one in joints if not {self.body, support}.isdisjoint({*one.bodies, one.holder})}
        parts = sorted(name for name in holders if name is not None)[:1]
        parts += [name for one in joints if one.holder in parts for name in one.bodies]
        for name in parts:  # grows by what stands in or on each
            parts += [one for one in bodies.names() if one not in parts and bodies.support(one) == name]
        return parts

    def turned(self) -> str:
        """Describe a half turn of the thing, if that helps."""
        x, y, _ = self.scene.bodies.pose(self.body).position
        turned = Pose((x, y, 0.0)) @ ROUND @ Pose((-x, -y, 0.0)) @ self.scene.bodies.pose(self.body)
        if self._helps_at(turned, f"{self.body} turned by 180 degrees"):
            return f"turned by 180 degrees, {self.body} could be reached"
        return ""

    def _helps_at(self, pose: Pose, said: str = "") -> bool:
        """Check whether it helps if the thing, with what moves along, is at a pose."""
        bodies = self.scene.bodies
        change = pose @ bodies.pose(self.body).inverse()
        return self._helps({self.body: pose, **{one: change @ bodies.pose(one) for one in self._along}}, said)

    def _helps(self, poses: Mapping[str, Pose | None], said: str = "") -> bool:
        """Check whether a change helps; without searches left it counts as not tested, and nothing is ``said``."""
        if not self._left:
            return False
        self._left -= 1
        skipped = self.meanwhile.counts[NOT_LOOKED_AT]
        if self._is_feasible(self.scene.supposing(self.scene.belief.state.placed(poses)), self.meanwhile):
            return True
        is_complete = self.meanwhile.counts[NOT_LOOKED_AT] == skipped
        self._tried += [said] if said and is_complete else []
        return False
