"""Changes of the map that would make a location reachable, tested by the search itself."""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import islice

import numpy as np

from executive.belief.belief import Belief
from executive.belief.believed_bodies import BelievedBodies
from executive.belief.planning_scene import PlanningScene
from executive.locations.reachability import CELL
from executive.locations.rejections import Rejections
from executive.maps.single_changes import leaf_moved, started_at, things_away, things_moved
from executive.motion import clearance_at
from executive.robots import CARRYING
from executive.robots.arms import called
from planlang.advice import ABSENT, POSITION, START, TRANSLATION, Advice, Change
from planlang.designators import Action, action
from planlang.geometry import Array, Pose
from planlang.geometry.areas import Block
from planlang.protocols import Configuration
from planlang.state import WorldState
from sim.joints import Articulation, JointKind

MOST_TRIED = 4
"""Number of bodies whose removal is tested."""
MOST_EDGES = 2
"""Number of edges to which a thing is moved, the nearest first."""
MOST_SEARCHES = 10
"""Number of changes that are tested in all, each by a search."""
STEP = 0.05
"""Step by which a thing is moved towards an edge [m]."""
FROM_EDGE = 0.02
"""Distance that a thing keeps from an edge [m]."""
BEFORE = np.arange(0.1, 1.0, CELL)
"""Distances from an edge at which the base may stand to reach over it [m]."""
TOWARDS = 0.7
"""Smallest cosine between the way to an edge and a given direction."""
GRAZING = 5e-3
"""Height by which a displaced thing may overlap others [m]: it stands on one of them."""

STARTS, MOST_STARTS = (0.45, 0.6, 0.75), 5
"""Distances from a thing at which a robot that does not drive is started for trial [m], and number of trials."""
AROUND = 1.5
"""Distance from the thing within which open doors and drawers are closed, or opened further, for trial [m]."""
MOST_LEAVES = 2
"""Number of these."""
FURTHER = 0.9
"""Share of its range below which a leaf may be opened further."""
OPEN, CLOSE = "OpeningAContainerArtifact", "ClosingAContainerArtifact"

IsFeasible = Callable[[PlanningScene], bool | None]
"""Check whether a scene, which is supposed, has a base pose; None if the search was cut off before it knew."""
WhatLacks = Callable[[PlanningScene], str]
"""Say what of the remaining task has no way in a scene that is supposed, as a part of a sentence; "" if all has."""


def with_supports(names: Iterable[str], bodies: BelievedBodies) -> set[str]:
    """Collect bodies with all that they stand on or in, directly or not: without these they would hang in the air."""
    found, left = set[str](), list(names)
    while left:
        name = left.pop()
        found.add(name)
        support = bodies.support(name)
        left += [support] if support is not None and support not in found else []
    return found


def with_changes(belief: Belief, changes: Iterable[Change]) -> WorldState:
    """Make the state of a belief with changes of the map, of which at most one moves a leaf."""
    changes = tuple(changes)
    start = next((one.value for one in changes if one.what == START), None)
    leaf = next((one for one in changes if one.what == POSITION), None)
    state = belief.state if leaf is None else belief.with_leaf(str(leaf.thing), _opening(belief, leaf))
    if isinstance(start, tuple):
        x, y, yaw = start
        configuration = replace(state.robots[belief.robot], base=(x, y, yaw))
        state = state.with_robot(belief.robot, configuration)
    poses: dict[str, Pose | None] = {}
    for change in changes:
        name = str(change.thing)
        if change.what == ABSENT:
            poses[name] = None
        elif change.what == TRANSLATION and isinstance(change.value, tuple):
            x, y, z = change.value
            closed = belief.closed_pose(name)
            poses[name] = belief.pose(name) @ closed.inverse() @ replace(closed, position=(x, y, z))
    return state.placed(poses)


def _opening(belief: Belief, change: Change) -> float:
    """Return the opening of a leaf [rad, m] that a change states as maps do."""
    assert isinstance(change.value, float)
    return belief.joints[str(change.thing)].sign * change.value


def _measure(joint: Articulation, value: float) -> str:
    """State a value of a joint for people."""
    slides = joint.kind is JointKind.PRISMATIC
    return f"{100 * value:.0f} cm" if slides else f"{math.degrees(value):.0f} degrees"


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
        what_lacks: WhatLacks | None = None,
    ) -> None:
        """Prepare; ``parts`` move with ``body``, as the button of a device; ``needed`` bodies are not removed.

        Of changes that help, one comes first after which nothing of the remaining task lacks a way.
        """
        self.body, self.scene, self.log, self._is_feasible, self._needed = body, scene, log, is_feasible, needed
        self._what_lacks = what_lacks
        self._is_movable = scene.bodies.is_movable(body) or not {*parts} <= {body}
        self._along = {*parts, *(scene.world.standing_on(body) if self._is_movable else ())} - {body}
        self._left, self._in_vain, self._was_cut_off = MOST_SEARCHES, list[str](), False

    def helping(self) -> Advice | None:
        """Find a change that helps: another start of what does not drive, another robot away, the thing at an edge,
        without a body, or let down.
        """
        helpful: Advice | None = None
        for find in (self._started, self._once_left, self.nearer, self._without, self._let_down):
            if (advice := find()) is not None:
                then = self.scene.supposing(with_changes(self.scene.belief, advice.changes))
                lacks = self._what_lacks(then) if self._what_lacks is not None else ""
                if not lacks:
                    return advice
                helpful = helpful or Advice(f"{advice.sentence}, but {lacks}", advice.changes)
        return helpful

    def by_the_robot(self, once_moved: IsFeasible) -> tuple[Action | None, Advice | None]:
        """Find an action of the robot that helps, and its advice: to close what is open near the thing, or to open it
        further; None and None if neither does.
        """
        for joint, value in self._leaves_near():
            name, now = joint.leaf, self.scene.belief.joint(joint.leaf)
            moved = leaf_moved(joint, value)
            then, is_shut = self.scene.supposing(with_changes(self.scene.belief, moved)), joint.is_shut(value)
            if then.bodies.closed_before(self.body) is None and once_moved(then):
                what = self.scene.bodies.designator(name)
                if is_shut:
                    said = f"with {name} closed, {self.body} could be reached"
                    return action(CLOSE, object_acted_on=what), Advice(said, moved)
                opening = action(OPEN, object_acted_on=what, all_the_way=True)
                wide = f"{_measure(joint, value)} instead of {_measure(joint, now)}"
                return opening, Advice(f"with {name} open by {wide}, {self.body} could be reached", moved)
        return None, None

    def in_order(self, once_emptied: IsFeasible) -> Advice | None:
        """Find out whether the thing is reached by a hand that holds another, which is then to be fetched after it."""
        state = self.scene.belief.state
        for name, grip in state.held.items():
            others = {other: one for other, one in state.held.items() if other != name}
            gone = replace(self._tucked(grip.arm).placed({name: None}), held=others)
            is_other = name not in self._needed and len(grip.arms) == 1
            if is_other and once_emptied(self.scene.supposing(gone)):
                only = f"only {called(grip.arm)}, which holds {name}, reaches {self.body}"
                return Advice(f"{only}: fetch {self.body} before {name}", ())
        return None

    def _tucked(self, arm: str) -> WorldState:
        """Suppose the state in which an arm, but for the torso, is in the carrying posture."""
        scene, now = self.scene, self.scene.world.configuration()
        model, posture = next(one for one in scene.arms.all if one.name == arm), scene.robot.postures.get(CARRYING, {})
        torso = None if model.lift is None else model.lift.joint
        joints = {name: posture[name] for name in model.joints if name in posture and name != torso}
        there = Configuration(now.base, {**now.joints, **joints})
        return scene.belief.state.with_robot(scene.belief.robot, there)

    def _leaves_near(self) -> Iterator[tuple[Articulation, float]]:
        """Yield open doors and drawers near the thing, most in the way first, with values to which to move them."""
        scene, blocking = self.scene, self.log.ordered_blocking()
        point = np.array(scene.bodies.pose(self.body).position)
        near = (
            joint
            for leaf, joint in scene.belief.joints.items()
            if scene.belief.is_left_open(leaf) and scene.bodies.block(leaf).away(point) < AROUND
        )
        for joint in sorted(near, key=lambda one: (-blocking.get(one.leaf, 0), one.leaf))[:MOST_LEAVES]:
            if scene.belief.joint(joint.leaf) < FURTHER * joint.upper:
                yield joint, joint.upper
            yield joint, 0.0

    def _started(self) -> Advice | None:
        """Find from where a robot that does not drive would reach the thing, facing it; None if it drives."""
        if not self.scene.robot.base.fixed:
            return None
        x, y, _ = self.scene.bodies.pose(self.body).position
        own_x, own_y, _ = self.scene.base()
        first = math.atan2(own_y - y, own_x - x)
        turns = [first + step * math.pi / 4 for step in (0, 1, -1, 2, -2, 3, -3, 4)]
        bases = [
            (round(x + away * math.cos(turn), 2), round(y + away * math.sin(turn), 2), round(turn - math.pi, 2))
            for turn in turns
            for away in STARTS
        ]
        holds = self.scene.collisions.floor().holds(np.array(bases))
        for base in islice((base for base, fits in zip(bases, holds, strict=True) if fits), MOST_STARTS):
            change = started_at(base)
            at = f"started at x = {base[0]:.2f}, y = {base[1]:.2f}"
            if self._helps(change, f"{at}, yaw = {base[2]:.2f}"):
                return Advice(f"{at}, yaw = {base[2]:.2f}, the robot could reach {self.body}", change)
        return None

    def _once_left(self) -> Advice | None:
        """Name what drives by itself, if that is in the way where it is now."""
        for name in self.scene.movers():
            gone = things_away([name])
            if name not in self._needed and self._helps(gone):
                return Advice(f"{name}, which drives by itself, is in the way where it is now", gone)
        return None

    def nearer(self, towards: Array | None = None) -> Advice | None:
        """Find how far, and where to, the thing has to be moved on its support; None if that does not help.

        With ``towards`` (2,), a direction in the map, only that way.
        """
        bodies = self.scene.bodies
        support = bodies.support(self.body)
        if support is None or not self._is_movable or bodies.is_room(support):
            return None
        ways = (way for way in self._ways_to_edges(support) if towards is None or float(towards @ way[0]) >= TOWARDS)
        each = ((side, self._free_of(side, steps), self._before(side, steps)) for side, steps in ways if steps)
        for side, steps, others in islice((way for way in each if way[1] or way[2]), MOST_EDGES):
            if steps and self._helps(self._at(self._moved(side, steps[-1])), self._stands(side, steps[-1])):
                # the last step helps: bisect for the first that does
                first = bisect_left(steps, True, key=lambda step: self._helps(self._at(self._moved(side, step))))
                return self._advised(side, steps[min(first, len(steps) - 1)])
            if others and (advice := self._past(side, *others)) is not None:
                return advice
        return None

    def _past(self, side: Array, farthest: float, others: Sequence[str]) -> Advice | None:
        """Find out whether the thing is reached without what stands between it and an edge, where it is or there."""
        gone = things_away(others)
        named = f"without {' and '.join(others)}"
        if self._helps(gone, named):
            return Advice(f"{named} this would work", gone)
        both = (*gone, *self._at(self._moved(side, farthest)))
        if self._helps(both, f"{named} {self._stands(side, farthest)}"):
            return self._advised(side, farthest, f"{named}, and ", gone)
        return None

    def _advised(self, side: Array, step: float, also: str = "", gone: tuple[Change, ...] = ()) -> Advice:
        changes = self._at(self._moved(side, step))
        said = f"{also}moved {step:.2f} m, to {_place(changes)}, {self.body} could be reached"
        return Advice(said, (*gone, *changes))

    def _stands(self, side: Array, step: float) -> str:
        return f"{self.body} at {_place(self._at(self._moved(side, step)))}"

    def none_found(self) -> str:
        """Say that no change was found that helps, what was tried, and whether the search ended before it knew.

        "" if nothing was tried.
        """
        tried = f" (tried: {', '.join(self._in_vain)})" if self._in_vain else ""
        if self._was_cut_off:
            return f"no simple change that would help was found before the search reached its limit{tried}"
        return f"no simple change was found that would help{tried}" if tried else ""

    def _ways_to_edges(self, support: str) -> Iterator[tuple[Array, list[float]]]:
        """Yield directions (2,) to edges at which the base can stand, the nearest first, with steps up to there [m]."""
        thing, block = self.scene.bodies.block(self.body), self.scene.bodies.block(support)
        floor, ways = self.scene.collisions.floor(), list[tuple[float, Array, float]]()
        for quarter in range(4):
            heading = block.yaw + quarter * math.pi / 2
            side, half = np.array([math.cos(heading), math.sin(heading)]), (block.half_x, block.half_y)[quarter % 2]
            room = half - float(side @ [thing.x - block.x, thing.y - block.y])
            before = np.array([thing.x, thing.y]) + np.outer(room + BEFORE, side)
            if floor.fits(before).any():
                ways.append((room, side, room - thing.support(heading) - FROM_EDGE))
        for _, side, most in sorted(ways, key=lambda way: way[0]):
            yield side, [*np.arange(STEP, most, STEP).tolist(), math.floor(100 * most) / 100] if most > 0 else []

    def _free_of(self, side: Array, steps: Iterable[float]) -> list[float]:
        """Select the steps to a side after which the thing overlaps nothing, as far as known."""
        thing = self.scene.bodies.block(self.body)
        return [step for step in steps if self._is_free(thing, side, step)]

    def _before(self, side: Array, steps: Sequence[float]) -> tuple[float, list[str]] | None:
        """Find the movable bodies between the thing and the edge that the last step leads to; None if it is free."""
        bodies, thing = self.scene.bodies, self.scene.bodies.block(self.body)
        points = np.array([thing.x, thing.y]) + np.outer(steps, side)
        others = []
        for name in bodies.names():
            block = bodies.block(name) if bodies.is_graspable(name) and name not in self._needed else None
            if block is not None and name not in (self.body, *self._along) and block.high > thing.low + GRAZING:
                is_near = block.distance(points).min() <= min(thing.half_x, thing.half_y)
                others += [name] if is_near and block.low < thing.high - GRAZING else []
        is_known = bool(others) and not self._is_free(thing, side, steps[-1])
        return (steps[-1], others) if is_known else None

    def _is_free(self, thing: Block, side: Array, step: float) -> bool:
        """Check whether a thing displaced to a side overlaps nothing, besides what moves along, as far as known."""
        boxes = self.scene.collisions.boxes_but((self.body, *self._along))[0]
        inner = ((thing.low + GRAZING, thing.high - GRAZING, min(thing.half_x, thing.half_y)),)
        return bool(clearance_at(np.array([thing.x, thing.y]) + step * side, boxes, inner)[0] > 0)

    def _moved(self, side: Array, step: float) -> Pose:
        """Pose of the thing displaced to a side, rounded as reported: a user will write what was tested."""
        pose = self.scene.bodies.pose(self.body)
        x, y, z = pose.position
        return replace(pose, position=(round(x + step * float(side[0]), 2), round(y + step * float(side[1]), 2), z))

    def _without(self) -> Advice | None:
        bodies = self.scene.bodies
        fixed = {*with_supports({self.body, *self._needed}, bodies), *filter(bodies.is_room, bodies.names())}
        joints = self.scene.belief.joints.values()
        fixed |= {name for joint in joints if self.body in joint.bodies for name in joint.bodies}
        fixed |= {*(joint.holder for joint in joints if joint.holder is not None), *self.scene.belief.state.carried()}
        blocking = [name for name in self.log.ordered_blocking() if name not in fixed and name in bodies.names()]
        return self.without_one_of(blocking, fixed)

    def without_one_of(self, names: Iterable[str], fixed: Collection[str] = ()) -> Advice | None:
        """Find the first of some bodies whose removal helps, with what stands on it; ``fixed`` bodies stay."""
        for name in islice(names, MOST_TRIED):
            leaf, riders = self.scene.belief.joints.get(name), self.scene.world.standing_on(name)
            gone = {name, *riders, *(leaf.bodies if leaf is not None else ())}.difference(fixed)
            changes = things_away(sorted(gone))
            if self._helps(changes, f"without {name}"):
                open_leaf = f"{name} is in the way as it is open: " if leaf is not None else ""
                and_riders = " and what stands on it" if riders else ""
                return Advice(f"{open_leaf}without {name}{and_riders} this would work", changes)
        return None

    def _let_down(self) -> Advice | None:
        """Find the height at which a thing that floats above its support stands on it, if that helps."""
        bodies = self.scene.bodies
        support = bodies.support(self.body)
        if support is None or not bodies.is_movable(self.body):
            return None
        thing, pose = bodies.block(self.body), bodies.pose(self.body)
        low = bodies.block(support).high
        down = replace(thing, low=low, high=thing.high + low - thing.low)
        if thing.low - low < STEP or not self._is_free(down, np.zeros(2), 0.0):  # below its top it is inside
            return None
        x, y, z = pose.position
        changes = self._at(replace(pose, position=(x, y, z + low - thing.low)))
        said = f"{low:.2f} m above the floor instead of {thing.low:.2f} m, {self.body} could be reached"
        return Advice(said, changes) if self._helps(changes) else None

    def _at(self, pose: Pose) -> tuple[Change, ...]:
        """Return the changes by which the thing, with what moves along, is at a pose, turned as it is."""
        bodies = self.scene.bodies
        change = pose @ bodies.pose(self.body).inverse()
        poses = {self.body: pose, **{one: change @ bodies.pose(one) for one in sorted(self._along)}}
        # maps state poses as if the drawer in which a thing stands were closed
        closing = self.scene.belief.closed_pose(self.body) @ bodies.pose(self.body).inverse()
        return things_moved({name: closing @ one for name, one in poses.items()})

    def _helps(self, changes: Iterable[Change], said: str = "") -> bool:
        """Check whether changes help; what is ``said`` of them is listed as tried if they do not.

        Where the search was cut off, or none is left, they count as no help, but were not tried.
        """
        answer = None
        if self._left:
            self._left -= 1
            answer = self._is_feasible(self.scene.supposing(with_changes(self.scene.belief, changes)))
        if answer is None:
            self._was_cut_off = True
        elif not answer and said:
            self._in_vain.append(said)
        return answer is True


def _place(changes: Sequence[Change]) -> str:
    """State where the first of the changes puts its thing, as the map has to state it."""
    assert isinstance(changes[0].value, tuple)
    return "x = {:.2f}, y = {:.2f}".format(*changes[0].value)
