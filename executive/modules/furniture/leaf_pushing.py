"""Strokes of a closed hand that push a door, drawer or lid shut from outside, at its handle if it has one.

The fingertips follow the leaf's motion, a line or an arc about the hinge, so that they stay at one point of it. Fingers
may jam on the edge of a thin bar: after a stroke that moved nothing, they push the leaf beside the handle.
"""

from __future__ import annotations

import math

import numpy as np

from executive.belief.believed_bodies import MEANT
from executive.modules.furniture.leaf_grips import hand_with, outwards_of
from executive.modules.furniture.witnessing import is_seen_from_here, is_witnessed
from executive.modules.platform import Platform
from executive.modules.runner import Skill
from executive.modules.tools.motion_grounding import Grounding
from executive.modules.tools.strokes import Plane, StrokeWork
from executive.robots.arms import ArmModel
from planlang.designators import Device
from planlang.failures import ContainerStuck, HandleNotReachable, PlanFailure, StateUnknown
from planlang.geometry import Array, Pose
from planlang.geometry.matrices import inverse, moved, product
from planlang.motion_constraints import MotionConstraint, a_constraint, a_feature
from sim.joints import Articulation, JointKind

BEFORE = 0.1
"""Distance of the fingertips from the leaf at the start of a push [m]."""
STEP = 0.05
"""Spacing of waypoints [m]."""
FARTHEST = 0.25
"""Longest stroke from one base pose [m]."""
STROKES = 6
"""Most strokes for one leaf, with any hand."""
BESIDE, EDGE = 0.07, 0.02
"""Distance from a handle to the point beside it to push at, and least distance of that point from the edge [m]."""
MOVED = 0.01
"""Distance of the pushed point up to which a stroke counts as having moved nothing [m]."""
NORMAL = 0.9
"""Least cosine between the leaf's outward direction and the box axis that counts as its normal."""
FINE = 40
"""Joint values to compare with the position of the hand."""
EXACT = 0.003
"""Tolerance of heights [m]."""
ACROSS = 0.3
"""Cosine between a bar and the normal of the fingers' closing plane at the largest misalignment."""
LEANS = {JointKind.PRISMATIC: -0.7, JointKind.HINGED: -0.2}
"""Cosine between the hand's approach and the leaf's normal at the largest lean; a hinged leaf turns under the hand."""


class LeafStrokes(StrokeWork):
    """Pushes one leaf shut."""

    def __init__(self, platform: Platform, joint: Articulation) -> None:
        super().__init__(platform)
        self._joint = _from_outside(platform, joint)
        self._is_beside = joint.handle is None
        """Whether to push the leaf itself instead of its handle."""

    async def shut(self) -> None:
        """Push until the leaf is shut.

        Raises ContainerStuck, HandleNotReachable if no hand reaches it, or StateUnknown if it cannot be seen or felt.
        """
        leaf = self._joint.leaf
        await Skill(
            lambda: self.hands_for(leaf, leaf), self._pushed, self.close_hand, most=STROKES, otherwise=self._still_open
        ).until(self._is_shut)

    async def _is_shut(self) -> bool:
        """Check whether the leaf is shut, after a look at it. Raises StateUnknown if only the map says that it is."""
        leaf, is_known = self._joint.leaf, await is_witnessed(self, self._joint.leaf)
        is_shut = self._joint.is_shut(self._value())
        if is_shut and not is_known:
            raise StateUnknown(f"it is not known whether {leaf} is shut: it was neither seen nor felt", what=leaf)
        return is_shut

    async def _still_open(self, problem: PlanFailure | None, tried: int) -> PlanFailure:
        leaf = self._joint.leaf
        if problem is not None:
            return HandleNotReachable(f"no hand can reach {leaf} to push it shut", what=leaf)
        return ContainerStuck(f"{leaf} is at {self._value():.2f}, still open after {tried} pushes", what=leaf)

    def _value(self) -> float:
        return self.platform.belief.joint(self._joint.leaf)

    async def _pushed(self, arm: ArmModel) -> None:
        """Push once from one base pose, as far as possible, and look how far the leaf moved."""
        platform, joint, value = self.platform, self._joint, self._value()
        approach = np.array(arm.frame.approach)
        tips = Pose(tuple((float((hand_with(platform.scene, arm) @ approach).max()) * approach).tolist()))
        path = self._along(value)
        touches = {joint.holder} if joint.holder else ()
        grounding = Grounding(platform, self._constraints(arm, path, tips), touches=touches, gone=joint.bodies)
        await self._look(grounding)
        plane = Plane(grounding.grounded().constraints[0])
        normal = np.array(plane.height.world.direction)
        local = moved(inverse(platform.belief.pose(joint.leaf).matrix()), path)
        heights = (local - local[1]) @ normal
        points = np.column_stack([local - heights[:, None] * normal, heights])
        lap = await self.stroke(grounding, plane, points, closed=False)
        link, feels = arm.tip, False
        try:
            await platform.follow(arm.name, lap, pushes=link)
            feels = self._feels(arm)
        finally:
            self._believe(np.array((platform.world.link_pose(link) @ tips).position), path)
        if feels:
            platform.belief.touched(joint.leaf, self._value())
        await self.leave(arm, lap, joint.leaf)
        if platform.robot.camera is not None:
            platform.belief.doubted(joint.leaf)
            if not await is_seen_from_here(platform, joint.leaf) and feels:
                platform.belief.touched(joint.leaf, self._value())
        turn = product(joint.motion(self._value()).matrix(), joint.motion(value).inverse().matrix())
        distance = float(np.linalg.norm(moved(turn, path[1]) - path[1]))
        self._is_beside = self._is_beside or distance < MOVED

    def _feels(self, arm: ArmModel) -> bool:
        """Check whether the hand feels something where the pushed leaf is believed to be."""
        bodies = self.platform.scene.bodies
        touched = [np.array(touch.point) for touch in self.platform.world.touches(arm.hand_links)]
        blocks = [bodies.block(name) for name in self._joint.bodies]
        return any(block.away(point) <= MEANT for point in touched for block in blocks)

    def _along(self, value: float) -> Array:
        """Compute the fingertips' path in the map (n, 3): one point before the leaf, then with it for one stroke."""
        joint, back = self._joint, self._joint.motion(value).inverse().matrix()
        start = self._point()
        end = moved(product(joint.motion(0.0).matrix(), back), start)
        length = float(np.linalg.norm(end - start))
        goal = value * max(0.0, 1.0 - FARTHEST / max(length, 1e-6))
        count = 2 + math.ceil(min(length, FARTHEST) / STEP)
        points = np.stack(
            [moved(product(joint.motion(one).matrix(), back), start) for one in np.linspace(value, goal, count)]
        )
        ahead = (points[1] - points[0]) / np.linalg.norm(points[1] - points[0])
        return np.vstack([points[0] - BEFORE * ahead, points])

    def _point(self) -> Array:
        """Choose the map point (3,) to push at: the middle of the handle, or a point of the leaf beside it."""
        joint, scene = self._joint, self.platform.scene
        if not self._is_beside:
            assert joint.handle is not None
            return np.array(scene.bodies.pose(joint.handle).position)
        leaf, half = scene.bodies.pose(joint.leaf), np.array(scene.bodies.size(joint.leaf)) / 2
        if joint.handle is None:
            return np.array(leaf.position)
        handle = scene.bodies.pose(joint.handle)
        outwards = outwards_of(scene, joint)
        bar = handle.rotation[:, int(np.argmax(scene.bodies.size(joint.handle)))]
        across = np.cross(outwards, bar)
        middle, grip = np.array(leaf.position), np.array(handle.position)
        beside = leaf.rotation.T @ (grip + math.copysign(BESIDE, float((middle - grip) @ across)) * across - middle)
        normal = leaf.rotation.T @ outwards
        inner = np.maximum(half - EDGE, 0.0)
        point = np.where(np.abs(normal) > NORMAL, np.sign(normal) * half, np.clip(beside, -inner, inner))
        return middle + leaf.rotation @ point

    def _constraints(self, arm: ArmModel, path: Array, tips: Pose) -> tuple[MotionConstraint, ...]:
        """Build the constraints: fingertips (``tips`` in the tip frame) on the leaf, bounds of how the hand leans."""
        x, y, z = map(float, arm.frame.approach)
        hand = arm.part.hand
        tip = a_feature("LINE", of=hand, position=tips.position, direction=(x, y, z))
        pose = self.platform.belief.pose(self._joint.leaf)
        px, py, pz = moved(inverse(pose.matrix()), path[1]).tolist()
        nx, ny, nz = (pose.rotation.T @ (path[0] - path[1]) / BEFORE).tolist()
        of = self.platform.scene.bodies.designator(self._joint.leaf)
        leaf = a_feature("PLANE", of=of, position=(px, py, pz), direction=(nx, ny, nz))
        leans = LEANS[self._joint.kind]
        return (
            a_constraint("HEIGHT", tip, leaf, lower=-EXACT, upper=EXACT, name="fingertips on the leaf"),
            a_constraint("PERPENDICULARITY", tip, leaf, lower=-1.2, upper=leans, name="hand along its way"),
            *self._beside(arm, hand),
        )

    def _beside(self, arm: ArmModel, hand: Device) -> tuple[MotionConstraint, ...]:
        """Build the constraint that both fingers lie along a thin bar, which would jam between them otherwise."""
        handle, bodies = self._joint.handle, self.platform.scene.bodies
        if handle is None or self._is_beside or not arm.openings.lets_in(min(bodies.size(handle))):
            return ()
        x, y, z = np.cross(arm.frame.approach, arm.frame.closing).tolist()
        side = a_feature("LINE", of=hand, position=(0.0, 0.0, 0.0), direction=(x, y, z))
        x, y, z = np.eye(3)[int(np.argmax(bodies.size(handle)))].tolist()
        bar = a_feature("LINE", of=bodies.designator(handle), position=(0.0, 0.0, 0.0), direction=(x, y, z))
        return (a_constraint("PERPENDICULARITY", side, bar, lower=-ACROSS, upper=ACROSS, name="fingers along the bar"),)

    def _believe(self, tip: Array, path: Array) -> None:
        """Update the believed joint value: the leaf has moved until the fingertips (3,) no longer penetrate it."""
        joint, belief = self._joint, self.platform.belief
        value = belief.joint(joint.leaf)
        point = moved(
            joint.motion(value).inverse().matrix(), path[1]
        )  # where the pushed point is when the leaf is shut
        values = np.linspace(min(value, joint.value_at(point, tip)), 0.0, FINE).tolist()
        for value in values:
            supposed = self.platform.scene.supposing(belief.with_leaf(joint.leaf, value))
            if all(one.body not in joint.bodies for one in supposed.world.contacts()):
                break
        belief.doubted(joint.leaf)
        belief.moved(joint.leaf, value, "pushed")


def _from_outside(platform: Platform, joint: Articulation) -> Articulation:
    """Get the joint as a hand moves it by the handle on the side to which the leaf opens."""
    scene = platform.scene.world.scene
    if not joint.other_handles:
        return joint
    shut = scene.body(joint.leaf).pose
    opening = np.array((joint.motion(joint.upper / 2) @ shut).position) - shut.position

    def ahead(handle: str) -> float:
        return round(float((np.array(scene.body(handle).pose.position) - shut.position) @ opening), 9)

    return joint.by(max(joint.handles, key=ahead))
