"""Explains in a sentence why no base pose of a location will do, with what would have to change in the map or task."""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np

from executive.belief.believed_bodies import Block
from executive.belief.floor import Floor
from executive.belief.planning_scene import PlanningScene
from executive.locations.base_candidates import InverseMaps
from executive.locations.demands import Reach, ReachKind
from executive.locations.grasp_candidates import CLASSES, GraspCandidates
from executive.locations.hand_predicates import Stage, candidates_of
from executive.locations.reachability import CELL, GraspClass
from executive.locations.rejections import COLLISION, NO_ROOM, NO_WAY, NOT_VISIBLE, OUT_OF_REACH, Rejections
from executive.motion import clearance_at
from executive.robots.arms import ArmModel
from planlang.geometry import Array, Pose
from planlang.records import dataclass

AROUND = 2.5
"""Distance from a thing within which the nearest place for the base is looked for [m]."""
MOST_TRIED = 4
"""Bodies of which is worked out what would be without them."""
STEP = 0.05
"""A thing is supposed to stand nearer to an edge by multiples of this [m]."""
FROM_EDGE = 0.02
"""A thing is not supposed to stand nearer to an edge than this [m]."""
BEFORE = np.arange(0.1, 1.0, CELL)
"""Distances from an edge at which the base may stand to reach over it [m]."""
GRAZING = 5e-3
"""Height by which a thing may meet others when it is supposed to be elsewhere: it stands on one of them [m]."""
APPROACHES = {GraspClass.SIDE: "from the side", GraspClass.TILTED: "at a slant", GraspClass.TOP: "from above"}
LEAST = 0.01
"""Smallest distance that is stated [m]."""
BASES = frozenset({NO_ROOM, NO_WAY, NOT_VISIBLE})
"""Reasons for which base poses are rejected."""
BESIDE = 1.0
"""Bodies that are farther from a thing than this are no reason why a hand has no room there [m]."""


WouldDo = Callable[[], bool]
"""Tells whether there is a base pose as the scene is supposed to be."""


def explain_bases(
    wanted: Sequence[Reach],
    arms: Sequence[ArmModel],
    scene: PlanningScene,
    inverse: InverseMaps,
    log: Rejections,
    would_do: WouldDo | None,
) -> None:
    """Add to ``log.figures`` what was measured about the reason that is most frequent, and what would do."""
    if not wanted or not log.counts:
        return
    explanation = _Explanation(wanted[0], arms, scene, inverse, log)
    reason = explanation.deciding()
    if reason in log.figures:
        return
    makers = {
        OUT_OF_REACH.text: explanation.out_of_reach,
        COLLISION: explanation.in_collision,
        NO_ROOM: explanation.no_room,
        NO_WAY: explanation.no_way,
    }
    sentences = [makers[reason]() if reason in makers else ""]
    vain = would_do is None or explanation.height() is not None  # no place, and no other body, changes heights
    changes = None if vain or would_do is None else _Changes(wanted[0].body, scene, log, would_do)
    if changes is not None and (helping := changes.helping()):
        sentences.append(helping)
    else:
        sentences += [explanation.nearer(), "" if changes is None else changes.in_vain()]
    if any(sentences):
        log.figures[reason] = "; ".join(filter(None, sentences))


@dataclass(frozen=True, slots=True)
class _Limit:
    """The heights of candidates for one arm and approach, and the heights that the arm reaches [m]."""

    arm: str
    grasp: GraspClass
    wanted: tuple[float, float]
    reached: tuple[float, float]
    reach: float
    """How far from the base the arm reaches at the heights of the candidates [m]."""

    @property
    def gap(self) -> float:
        """Height that is missing: above 0 if what is wanted is too high, below 0 if it is too low, else 0."""
        if self.wanted[0] > self.reached[1]:
            return self.wanted[0] - self.reached[1]
        return min(self.wanted[1] - self.reached[0], 0.0)


class _Explanation:
    """What is measured about one reach for which no base pose was found."""

    def __init__(
        self,
        reach: Reach,
        arms: Sequence[ArmModel],
        scene: PlanningScene,
        inverse: InverseMaps,
        log: Rejections,
    ) -> None:
        self.reach, self.arms, self.scene, self.inverse, self.log = reach, arms, scene, inverse, log

    def deciding(self) -> str:
        """Return the reason that is explained: the most frequent one, unless it left nothing but what is out of reach.

        Hands that are in something, wherever the base is, are counted first; the others decide.
        """
        counts = self.log.ordered()
        bases = sum(counts.get(reason, 0) for reason in BASES)
        if OUT_OF_REACH.text in counts and (self.height() is not None or bases <= 1):  # one is where the base is
            return OUT_OF_REACH.text
        return next(iter(counts))

    def height(self) -> _Limit | None:
        """Return the limit that the thing is least too high or too low for; None if it is not."""
        nearest = min(self.limits, key=lambda one: abs(one.gap), default=None)
        return nearest if nearest is not None and nearest.gap else None

    def out_of_reach(self) -> str:
        """Return by how much the thing is too high or too low; else how near the base gets, and how far arms reach."""
        nearest = self.height()
        if nearest is None:
            return "; ".join(filter(None, (self._too_far(), self.in_collision())))
        high = nearest.gap > 0
        at, limit = (nearest.wanted[0], nearest.reached[1]) if high else (nearest.wanted[1], nearest.reached[0])
        gap, digits = abs(nearest.gap), 2 if abs(nearest.gap) > 2 * LEAST else 3
        does = "grasps" if self.reach.kind is ReachKind.GRASP else "reaches"
        said = (
            f"{self._aim()} is at {at:.{digits}f} m, {gap:.{digits}f} m too {'high' if high else 'low'}; the arm "
            f"{nearest.arm} {does} {APPROACHES[nearest.grasp]} {'up' if high else 'down'} to {limit:.{digits}f} m"
        )
        return "; ".join(filter(None, (said, self.in_collision() if self.log.counts[COLLISION] else "")))

    def _aim(self) -> str:
        """Return what the hand goes to: a thing, or a place on or at it."""
        kind, body = self.reach.kind, self.reach.body
        return body if kind is ReachKind.GRASP else f"the place for the hand at {body}"

    def _tables(self) -> Iterator[tuple[ArmModel, Sequence[GraspCandidates]]]:
        """Yield grasp candidates of arms: those in which the hand itself is inside nothing; all if there are none."""
        found = self.log.findings.hands
        free = [hand for hand in found[max(found)].hands if len(hand.candidates)] if found else []
        for hand in free:
            yield hand.arm, [hand.candidates]
        for arm in () if free else self.arms:
            yield arm, candidates_of(self.reach, arm, self.scene, Rejections(), Stage.ALL)

    @cached_property
    def limits(self) -> list[_Limit]:
        """What is wanted and what is reached, arm by arm and approach by approach."""
        return list(self._limits())

    def _limits(self) -> Iterator[_Limit]:
        for arm, tables in self._tables():
            for table in tables:
                for number in sorted(set(table.grasps.tolist())):
                    heights = table.points[table.grasps == number, 2]
                    forward = self.inverse(arm, CLASSES[number]).forward
                    if not len(forward):
                        continue
                    rise = 0.0 if arm.lift is None else float(arm.lift.rise(arm.lift.highest))
                    rows, half = forward.rows, 0.5 if arm.lift is None else 0.0  # a torso rises to what is between
                    low, high = CELL * (float(rows["z"].min()) - half), CELL * (float(rows["z"].max()) + half) + rise
                    wanted = float(heights.min()), float(heights.max())
                    at = (rows["z"] >= (wanted[0] - rise) / CELL - half) & (rows["z"] <= wanted[1] / CELL + half)
                    away = CELL * np.hypot(rows["x"][at], rows["y"][at], dtype=np.float64)
                    yield _Limit(arm.name, CLASSES[number], wanted, (low, high), float(away.max(initial=0.0)))

    def _too_far(self) -> str:
        gap = self._gap(self.scene.collisions.floor())
        farthest = max(self.limits, key=lambda one: one.reach, default=None)
        if farthest is None or gap <= farthest.reach:
            return ""
        nearest = f"{gap:.2f} m" if math.isfinite(gap) else f"more than {AROUND:g} m"
        return (
            f"the base gets no nearer than {nearest} to {self.reach.body}; "
            f"the arm {farthest.arm} reaches {farthest.reach:.2f} m at that height"
        )

    def _reach_of(self, arm: ArmModel) -> float:
        return max(self.inverse(arm, grasp).reach for grasp in CLASSES)

    def _gap(self, floor: Floor) -> float:
        """Return the distance of the thing to the nearest place where the base has room to stand, inf if none [m]."""
        block = self.scene.bodies.block(self.reach.body)
        steps = np.arange(-AROUND, AROUND, CELL)
        points = np.stack(np.meshgrid(block.x + steps, block.y + steps), axis=-1).reshape(-1, 2)
        away = np.hypot(points[:, 0] - block.x, points[:, 1] - block.y)
        return float(away[floor.nearly(points, 0.0) & (floor.at(points) > -np.inf)].min(initial=np.inf))

    def in_collision(self) -> str:
        """Return which body a hand or an arm would be in, and how far that is from the thing."""
        if not self.log.blocking:
            return ""
        body, number = next(iter(self.log.ordered_blocking().items()))
        part = "the robot's own parts are" if body not in self.scene.bodies.names() else f"{body} is"
        said = f"{part} in the way of {number} of {sum(self.log.counts.values())} ways to reach {self.reach.body}"
        gap = self._beside(body)
        return said if gap is None else f"{said}, {gap:.2f} m away from it; more room between the two is needed"

    def _beside(self, body: str) -> float | None:
        """Return the horizontal distance between a body and the thing at the thing's height; None if that is large."""
        boxes, names = self.scene.collisions.boxes_but(())
        rows = np.flatnonzero([name == body for name in names])
        fixed = {self.reach.body, self.scene.bodies.support(self.reach.body), *self._furniture()}
        if not len(rows) or body in fixed:
            return None
        block = self.scene.bodies.block(self.reach.body)
        over = ((block.low + 1e-3, block.high + 0.1, 0.0),)
        gap = float(clearance_at([[block.x, block.y]], boxes.only(rows), over)[0]) - max(block.half_x, block.half_y)
        return gap if LEAST < gap < BESIDE else None

    def _furniture(self) -> set[str]:
        """Return the parts of the furniture that the thing is a part of, or in: there is no more room between these."""
        joints, body = self.scene.belief.joints.values(), self.reach.body
        holders = {one.holder for one in joints if not {body, self.scene.bodies.support(body)}.isdisjoint(one.bodies)}
        return {name for one in joints if one.holder in holders for name in (*one.bodies, one.holder or "")}

    def no_room(self) -> str:
        """Return how near the base gets."""
        if self.reach.kind is ReachKind.OFFER:
            return ""
        now = self._gap(self.scene.collisions.floor())
        if not math.isfinite(now):
            return f"the base has no room to stand within {AROUND:g} m of {self.reach.body}"
        return f"the base gets no nearer than {now:.2f} m to {self.reach.body}"

    def nearer(self) -> str:
        """Return without which body the base would get nearer, and how near; "" if there is none."""
        if self.reach.kind is ReachKind.OFFER or NO_ROOM not in self.log.counts:
            return ""
        now = self._gap(self.scene.collisions.floor())
        better = [(gap, body) for body, gap in self._without() if gap < now - CELL]
        return f"without {min(better)[1]} it would get to {min(better)[0]:.2f} m" if better else ""

    def _without(self) -> Iterator[tuple[str, float]]:
        bodies = self.scene.bodies
        fixed = {self.reach.body, bodies.support(self.reach.body), *filter(bodies.is_room, bodies.names())}
        for body in [one for one in self.log.ordered_blocking() if one not in fixed][:MOST_TRIED]:
            yield body, self._gap(self.scene.collisions.floor_without(body))

    def no_way(self) -> str:
        """Return which body closes the way to where the base would have to stand."""
        block = self.scene.bodies.block(self.reach.body)
        near = self.inverse_reach()
        body = self.scene.collisions.closes_way(np.array([block.x, block.y]), near)
        said = f"the base cannot drive to where it could reach {self.reach.body}"
        return f"{said}; without {body} it could" if body is not None else said

    def inverse_reach(self) -> float:
        """Return the farthest that any of the arms reaches from the middle of the base [m]."""
        return max(map(self._reach_of, self.arms))


class _Changes:
    """Changes of the map, one at a time, of which the search itself finds out whether they would do."""

    def __init__(self, body: str, scene: PlanningScene, log: Rejections, would_do: WouldDo) -> None:
        self.body, self.scene, self.log, self._would_do = body, scene, log, would_do
        self._tried: list[str] = []
        """Changes that would not do."""

    def helping(self) -> str:
        """Return what would do: the thing nearer to an edge of its support, or some body away; "" if neither."""
        return self._nearer() or self._without()

    def in_vain(self) -> str:
        """Return which of these changes would not do."""
        return f"it could not be reached {' or '.join(self._tried)} either" if self._tried else ""

    def _nearer(self) -> str:
        bodies = self.scene.bodies
        support = bodies.support(self.body)
        if support is None or not bodies.is_movable(self.body) or bodies.is_room(support):
            return ""
        for side, steps in self._ways_to_edges(support):
            if not steps:
                continue
            if not self._does({self.body: self._moved(side, steps[-1])}):
                self._tried = [f"at an edge of {support}"]
                continue
            # the last one does: the first one that does is looked for
            first = bisect_left(steps, True, key=lambda step: self._does({self.body: self._moved(side, step)}))
            step = steps[min(first, len(steps) - 1)]
            x, y, _ = self._moved(side, step).position
            return f"{step:.2f} m nearer to an edge of {support}, at x = {x:.2f}, y = {y:.2f}, it could be reached"
        return ""

    def _ways_to_edges(self, support: str) -> Iterator[tuple[Array, list[float]]]:
        """Yield directions (2,) to edges that the base can stand before, the nearest first, and free steps [m]."""
        bodies, floor = self.scene.bodies, self.scene.collisions.floor()
        block, thing = bodies.block(support), bodies.block(self.body)
        ways = []
        for quarter in range(4):
            heading = block.yaw + quarter * math.pi / 2
            side, half = np.array([math.cos(heading), math.sin(heading)]), (block.half_x, block.half_y)[quarter % 2]
            room = half - float(side @ [thing.x - block.x, thing.y - block.y])
            before = np.array([thing.x, thing.y]) + np.outer(room + BEFORE, side)
            if (floor.nearly(before, 0.0) & (floor.at(before) > -np.inf)).any():
                ways.append((room, side, room - thing.support(heading) - FROM_EDGE))
        for _, side, most in sorted(ways, key=lambda way: way[0]):
            steps = [*np.arange(STEP, most, STEP).tolist(), math.floor(100 * most) / 100] if most > 0 else []
            yield side, [step for step in steps if self._is_free(thing, side, step)]

    def _is_free(self, thing: Block, side: Array, step: float) -> bool:
        boxes = self.scene.collisions.boxes_but((self.body,))[0]
        inner = ((thing.low + GRAZING, thing.high - GRAZING, min(thing.half_x, thing.half_y)),)
        return bool(clearance_at(np.array([thing.x, thing.y]) + step * side, boxes, inner)[0] > 0)

    def _moved(self, side: Array, step: float) -> Pose:
        pose = self.scene.bodies.pose(self.body)
        x, y, z = pose.position
        return replace(pose, position=(x + step * float(side[0]), y + step * float(side[1]), z))

    def _without(self) -> str:
        bodies = self.scene.bodies
        fixed = {self.body, bodies.support(self.body), *filter(bodies.is_room, bodies.names())}
        fixed |= {name for joint in self.scene.belief.joints.values() for name in (*joint.bodies, joint.holder)}
        blocking = [name for name in self.log.ordered_blocking() if name not in fixed and name in bodies.names()]
        for name in blocking[:MOST_TRIED]:
            if self._does({name: None}):
                return f"without {name} it could be reached"
            self._tried.append(f"without {name}")
        return ""

    def _does(self, poses: Mapping[str, Pose | None]) -> bool:
        with self.scene.supposing(poses):
            return self._would_do()
