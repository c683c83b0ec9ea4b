"""Changes of the map that would do where no base pose is found, as the search itself finds out."""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from executive.belief.believed_bodies import Block
from executive.belief.planning_scene import PlanningScene
from executive.locations.base_poses import floor_near
from executive.locations.reachability import CELL
from executive.locations.rejections import Rejections
from executive.motion import clearance_at
from planlang.geometry import Array, Pose

MOST_TRIED = 4
"""Bodies of which is worked out what would be without them."""
STEP = 0.05
"""A thing is supposed to stand nearer to an edge by multiples of this [m]."""
TABLE = 0.75
"""Height of a table [m]: a thing is supposed to stand higher or lower by shares of its difference to this."""
HEIGHTS = (0.5, 1.0)
"""These shares."""
FROM_EDGE = 0.02
"""A thing is not supposed to stand nearer to an edge than this [m]."""
BEFORE = np.arange(0.1, 1.0, CELL)
"""Distances from an edge at which the base may stand to reach over it [m]."""
TOWARDS = 0.7
"""Cosine from which on the way to an edge counts as one towards a direction."""
ROUND = Pose((0.0, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0))
"""Half a turn about the vertical."""
GRAZING = 5e-3
"""Height by which a thing may meet others when it is supposed to be elsewhere: it stands on one of them [m]."""

WouldDo = Callable[[Rejections], bool]
"""Tells whether there is a base pose as the scene is supposed to be, and counts why others will not do."""


class Changes:
    """Changes of the map, one at a time, of which the search itself finds out whether they would do."""

    def __init__(
        self, body: str, scene: PlanningScene, log: Rejections, would_do: WouldDo, along: Collection[str] = ()
    ) -> None:
        """``along`` are bodies that go where ``body`` goes, as the button of a device."""
        self.body, self.scene, self.log, self._would_do = body, scene, log, would_do
        self._along = {*along} - {body}
        self.meanwhile = Rejections()
        """Why base poses would not do with these changes."""
        self._tried: list[str] = []
        """Changes that would not do."""

    def helping(self) -> str:
        """Return what would do: the thing nearer to an edge, a body away, or it or its furniture at another height."""
        return self.nearer() or self._without() or self._at_another_height()

    def in_vain(self) -> str:
        """Return which of these changes would not do."""
        return f"{' or '.join(self._tried)} would not help" if self._tried else ""

    def nearer(self, towards: Array | None = None) -> str:
        """Return how far, and where to, the thing would have to be moved on what it stands on; "" if that is no use.

        With ``towards`` (2,), a direction of the map, only that way.
        """
        bodies = self.scene.bodies
        support = bodies.support(self.body)
        if support is None or not (bodies.is_movable(self.body) or self._along) or bodies.is_room(support):
            return ""
        for side, steps in self._ways_to_edges(support):
            if not steps or (towards is not None and float(towards @ side) < TOWARDS):
                continue
            if not self._goes(self._moved(side, steps[-1])):
                self._tried = [f"moving it to an edge of {support}"]
                continue
            # the last one does: the first one that does is looked for
            first = bisect_left(steps, True, key=lambda step: self._goes(self._moved(side, step)))
            step = steps[min(first, len(steps) - 1)]
            x, y, _ = self._moved(side, step).position
            return f"moved {step:.2f} m, to x = {x:.2f}, y = {y:.2f}, {self.body} could be reached"
        return ""

    def _ways_to_edges(self, support: str) -> Iterator[tuple[Array, list[float]]]:
        """Yield directions (2,) in which a thing can be moved on its support, and free steps [m].

        First those to edges that the base can stand before, the nearest first; then the one to where the base gets
        nearest, as behind a corner.
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
        away = np.linalg.norm(over - points, axis=1)
        moved = over - [thing.x, thing.y]
        way = moved[np.lexsort((np.linalg.norm(moved, axis=1).round(6), away.round(1)))[0]]
        if (length := float(np.linalg.norm(way))) > STEP:
            yield way / length, length

    def _is_free(self, thing: Block, side: Array, step: float, others: Collection[str] = ()) -> bool:
        """Return whether a thing meets nothing so far to a side, as far as can be told, but what goes along."""
        boxes = self.scene.collisions.boxes_but((self.body, *self._along, *others))[0]
        inner = ((thing.low + GRAZING, thing.high - GRAZING, min(thing.half_x, thing.half_y)),)
        return bool(clearance_at(np.array([thing.x, thing.y]) + step * side, boxes, inner)[0] > 0)

    def _moved(self, side: Array, step: float) -> Pose:
        """Return the pose of the thing so far to a side, as it is told: what is tried is what a user will write."""
        pose = self.scene.bodies.pose(self.body)
        x, y, z = pose.position
        if not step:
            return pose
        return replace(pose, position=(round(x + step * float(side[0]), 2), round(y + step * float(side[1]), 2), z))

    def _without(self) -> str:
        bodies = self.scene.bodies
        fixed = {self.body, bodies.support(self.body), *filter(bodies.is_room, bodies.names())}
        joints = self.scene.belief.joints.values()
        fixed |= {name for joint in joints if self.body in joint.bodies for name in joint.bodies}
        fixed |= {*(joint.holder for joint in joints), *self.scene.belief.carried()}
        blocking = [name for name in self.log.ordered_blocking() if name not in fixed and name in bodies.names()]
        for name in blocking[:MOST_TRIED]:
            if self._does({name: None}):
                open_leaf = f"{name} is in the way as it is open: " if name in self.scene.belief.joints else ""
                return f"{open_leaf}without {name} this would work"
            self._tried.append(f"removing {name} alone")
        return ""

    def _at_another_height(self) -> str:
        """Return at what height nearer to that of a table a thing would have to stand, if not where it is in a room."""
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
        onto = bodies.block(support).high - thing.low  # what hangs above its support in the map is meant to stand on it
        shares = (share * rises for share in HEIGHTS)
        for rise in (onto, *shares) if abs(onto) >= STEP else shares:
            above = replace(thing, low=thing.low + rise, high=thing.high + rise)
            for side, step in ways if abs(rise) >= STEP else ():
                x, y, z = self._moved(side, step).position
                if not self._is_free(above, side, step):
                    continue
                if self._goes(replace(bodies.pose(self.body), position=(x, y, z + rise))):
                    place = f" and at x = {x:.2f}, y = {y:.2f}" if step else ""
                    height = f"{above.low:.2f} m above the floor instead of {thing.low:.2f} m"
                    return f"{height}{place}, {self.body} could be reached"
                way = f"{'raising' if rises > 0 else 'lowering'} {self.body}"
                self._tried += [] if way in self._tried else [way]
        return ""

    def _with_furniture(self, parts: Sequence[str]) -> str:
        """Return how much higher or lower furniture would have to be, with all that is part of it, in it or on it."""
        bodies, name = self.scene.bodies, parts[0]
        block, most = bodies.block(name), TABLE - bodies.block(self.body).low
        rises = [math.copysign(STEP * step, most) for step in range(1, int(abs(most) / STEP) + 1)]
        rises = [rise for rise in rises if self._fits(block, rise, parts)]

        def does(rise: float) -> bool:
            return self._does({one: Pose((0.0, 0.0, rise)) @ bodies.pose(one) for one in parts})

        # what is too low may be too high in the end: the least rise is looked for below one that does
        last = next(
            (k for k in sorted({len(rises) - 1, len(rises) // 2}, reverse=True) if rises and does(rises[k])), None
        )
        if last is None:
            self._tried += [f"{'raising' if most > 0 else 'lowering'} {name}"] if rises else []
            return ""
        rise = rises[bisect_left(rises[:last], True, key=does)]
        what = "it" if name == self.body else self.body
        return f"with {name} {abs(rise):.2f} m {'higher' if most > 0 else 'lower'}, {what} could be reached"

    def _fits(self, furniture: Block, rise: float, parts: Sequence[str]) -> bool:
        """Return whether furniture has room so much higher or lower: it meets neither the floor nor other bodies."""
        there = replace(furniture, low=furniture.low + rise, high=furniture.high + rise)
        return there.low >= -GRAZING and self._is_free(there, np.zeros(2), 0.0, parts)

    def _furniture(self) -> list[str]:
        """Return the furniture with doors or drawers that a thing, or a place, is in, then all its parts and things."""
        bodies, joints = self.scene.bodies, self.scene.belief.joints.values()
        support = bodies.support(self.body)
        around = {one.holder for one in joints if not {self.body, support}.isdisjoint({*one.bodies, one.holder})}
        parts = sorted(name for name in around if name is not None)[:1]
        parts += [name for one in joints if one.holder in parts for name in one.bodies]
        for name in parts:  # grows: what stands in or on it, and on that
            parts += [one for one in bodies.names() if one not in parts and bodies.support(one) == name]
        return parts

    def turned(self) -> str:
        """Return that the thing would have to be turned round, if that is of use."""
        x, y, _ = self.scene.bodies.pose(self.body).position
        if self._goes(Pose((x, y, 0.0)) @ ROUND @ Pose((-x, -y, 0.0)) @ self.scene.bodies.pose(self.body)):
            return f"turned by 180 degrees, {self.body} could be reached"
        self._tried.append("turning it by 180 degrees")
        return ""

    def _goes(self, pose: Pose) -> bool:
        """Return whether it would do if the thing, with what goes along, were at a pose."""
        bodies = self.scene.bodies
        change = pose @ bodies.pose(self.body).inverse()
        return self._does({self.body: pose, **{one: change @ bodies.pose(one) for one in self._along}})

    def _does(self, poses: Mapping[str, Pose | None]) -> bool:
        with self.scene.supposing(poses):
            return self._would_do(self.meanwhile)
