"""Strokes of a closed hand that push a door, drawer or lid shut, from outside, at its handle if it has one.

The fingertips go along the leaf's way, so that they stay on the leaf: on a line, or on an arc about the hinge. A bar
is thin, and fingers that meet an edge of it jam: after a stroke that moved nothing they push the leaf beside it.
"""

from __future__ import annotations

import math

import numpy as np

from executive.modules.arm.hand_work import HandWork
from executive.modules.furniture.leaf_grips import hand_with, outwards_of
from executive.modules.phases import Phase
from executive.modules.tools.motion_grounding import Grounding
from executive.modules.tools.strokes import Plane, StrokeWork
from executive.modules.tries import Tries
from executive.robots.arms import ArmModel
from planlang.designators import Device
from planlang.failures import ContainerStuck, HandleNotReachable
from planlang.geometry import Array, Pose
from planlang.geometry.matrices import inverse, moved, product
from planlang.motion_constraints import MotionConstraint, a_constraint, a_feature
from planlang.protocols import Trajectory
from sim.joints import Articulation, JointKind

BEFORE = 0.1
"""Distance of the fingertips from the leaf where the push begins [m]."""
STEP = 0.05
"""Distance of places on the way [m]."""
FARTHEST = 0.25
"""Longest way from one place of the base [m]."""
STROKES = 4
"""Strokes after which a leaf that is open still is given up."""
BESIDE, EDGE = 0.07, 0.02
"""Distance from a handle to where the leaf is pushed beside it, and from there to its edge at least [m]."""
MOVED = 0.01
"""Way of what is pushed up to which a stroke moved nothing [m]."""
NORMAL = 0.9
"""Cosine of the largest angle between the free side of a leaf and the axis of its box that is normal to it."""
FINE = 40
"""Values of the joint that are compared with where the hand is."""
EXACT = 0.003
"""Largest error of heights [m]."""
ACROSS = 0.3
"""Sine of the largest angle between a bar and the fingers beside each other, where it would go between them."""
LEANS = {JointKind.PRISMATIC: -0.7, JointKind.HINGED: -0.2}
"""Cosine of the largest angle between the hand and the way to the leaf; one that turns takes the hand along."""


class LeafStrokes(StrokeWork):
    """Pushes one leaf shut."""

    def __init__(self, work: HandWork, joint: Articulation) -> None:
        super().__init__(work.platform)
        self._work, self._joint = work, joint
        self._is_beside = joint.handle is None
        """Whether the leaf is pushed, not its handle."""

    async def shut(self) -> None:
        """Push until the leaf is shut; raises ContainerStuck, or HandleNotReachable where no hand gets there."""
        joint, belief = self._joint, self.platform.belief
        for _ in range(STROKES):
            if joint.is_shut(belief.joint(joint.leaf)):
                return
            await self._once()
        if not joint.is_shut(belief.joint(joint.leaf)):
            raise ContainerStuck(f"{joint.leaf} is at {belief.joint(joint.leaf):.2f}", what=joint.leaf)

    async def _once(self) -> None:
        """Push with the first hand that can; raises HandleNotReachable if none can."""
        tries = Tries()
        arms = self._work.free_hands()
        if not arms:
            raise HandleNotReachable(f"{HandleNotReachable.text}: no hand is free", what=self._joint.leaf)
        for arm in arms:
            await self._work.tuck(self.platform.arms.untucked())
            await self.platform.hands.move(arm, closed=True)
            self.platform.arms.choices.choose(arm.name)
            with tries:
                return await self._pushed(arm, self.platform.belief.joint(self._joint.leaf))
        said = f"{self._joint.leaf} is out of reach of a hand that pushes"
        raise HandleNotReachable(said, what=self._joint.leaf) from tries.problem

    async def _pushed(self, arm: ArmModel, value: float) -> None:
        """Push once with a hand, as far as it goes from one place of the base; look how far that was."""
        platform, joint = self.platform, self._joint
        platform.sync()
        approach = np.array(arm.frame.approach)
        tips = Pose(tuple((float((hand_with(platform.scene, arm) @ approach).max()) * approach).tolist()))
        way = self._along(value)
        asked = self._asked(arm, way, tips)
        grounding = Grounding(platform, {joint.holder} if joint.holder else (), joint.bodies)
        phase = Phase()
        await self._look(grounding, asked, phase)
        plane = Plane(grounding.grounded(asked, phase).constraints[0])
        normal = np.array(plane.height.world.direction)
        local = moved(inverse(platform.belief.pose(joint.leaf).matrix()), way)
        over = (local - local[1]) @ normal
        points = np.column_stack([local - over[:, None] * normal, over])
        lap = await self.stroke(grounding, phase, asked, plane, points, closed=False)
        link = platform.robot.arm(arm.name).tip
        try:
            await platform.follow(arm.name, lap, pushes=link)
        finally:
            self._believe(np.array((platform.world.link_pose(link) @ tips).position), way)
        await self._back(arm, lap)
        await self._work.look(joint.handle or joint.leaf)
        turn = product(joint.motion(platform.belief.joint(joint.leaf)).matrix(), joint.motion(value).inverse().matrix())
        gone = float(np.linalg.norm(moved(turn, way[1]) - way[1]))
        self._is_beside = self._is_beside or gone < MOVED

    def _along(self, value: float) -> Array:
        """Return the fingertips' way in the map (n, 3): before the leaf, on it, and with it as far as a stroke goes."""
        joint, back = self._joint, self._joint.motion(value).inverse().matrix()
        start = self._place()
        ends = moved(product(joint.motion(0.0).matrix(), back), start)
        length = float(np.linalg.norm(ends - start))
        goal = value * max(0.0, 1.0 - FARTHEST / max(length, 1e-6))
        count = 2 + math.ceil(min(length, FARTHEST) / STEP)
        along = np.stack(
            [moved(product(joint.motion(one).matrix(), back), start) for one in np.linspace(value, goal, count)]
        )
        ahead = (along[1] - along[0]) / np.linalg.norm(along[1] - along[0])
        return np.vstack([along[0] - BEFORE * ahead, along])

    def _place(self) -> Array:
        """Return where the leaf is pushed now (3,): the middle of its handle, or its free side beside that."""
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
        middle, here = np.array(leaf.position), np.array(handle.position)
        there = leaf.rotation.T @ (here + math.copysign(BESIDE, float((middle - here) @ across)) * across - middle)
        free = leaf.rotation.T @ outwards
        room = np.maximum(half - EDGE, 0.0)
        face = np.where(np.abs(free) > NORMAL, np.sign(free) * half, np.clip(there, -room, room))
        return middle + leaf.rotation @ face

    def _asked(self, arm: ArmModel, way: Array, tips: Pose) -> tuple[MotionConstraint, ...]:
        """Return that the fingertips, at a pose in the tip frame, are on the leaf, and how hand and fingers lean."""
        x, y, z = map(float, arm.frame.approach)
        hand = self.platform.robot.arm(arm.name).hand
        tip = a_feature("LINE", of=hand, position=tips.position, direction=(x, y, z))
        pose = self.platform.belief.pose(self._joint.leaf)
        px, py, pz = moved(inverse(pose.matrix()), way[1]).tolist()
        nx, ny, nz = (pose.rotation.T @ (way[0] - way[1]) / BEFORE).tolist()
        of = self.platform.scene.bodies.designator(self._joint.leaf)
        leaf = a_feature("PLANE", of=of, position=(px, py, pz), direction=(nx, ny, nz))
        leans = LEANS[self._joint.kind]
        return (
            a_constraint("HEIGHT", tip, leaf, lower=-EXACT, upper=EXACT, name="fingertips on the leaf"),
            a_constraint("PERPENDICULARITY", tip, leaf, lower=-1.2, upper=leans, name="hand along its way"),
            *self._beside(arm, hand),
        )

    def _beside(self, arm: ArmModel, hand: Device) -> tuple[MotionConstraint, ...]:
        """Return that the fingers are beside each other along a bar that goes between them: they would jam on it."""
        handle, bodies = self._joint.handle, self.platform.scene.bodies
        if handle is None or self._is_beside or not arm.openings.lets_in(min(bodies.size(handle))):
            return ()
        x, y, z = np.cross(arm.frame.approach, arm.frame.closing).tolist()
        side = a_feature("LINE", of=hand, position=(0.0, 0.0, 0.0), direction=(x, y, z))
        x, y, z = np.eye(3)[int(np.argmax(bodies.size(handle)))].tolist()
        bar = a_feature("LINE", of=bodies.designator(handle), position=(0.0, 0.0, 0.0), direction=(x, y, z))
        return (a_constraint("PERPENDICULARITY", side, bar, lower=-ACROSS, upper=ACROSS, name="fingers along the bar"),)

    def _believe(self, tip: Array, way: Array) -> None:
        """Believe that the leaf went with the hand as far as that is into it; ``tip`` (3,): its fingertips."""
        joint, belief = self._joint, self.platform.belief
        value = belief.joint(joint.leaf)
        closed = moved(joint.motion(value).inverse().matrix(), way[1])
        self.platform.sync()
        world, values = self.platform.scene.world, np.linspace(min(value, joint.value_at(closed, tip)), 0.0, FINE)
        for value in values.tolist():
            world.set_joint(joint.leaf, value)
            if all(one.body not in joint.bodies for one in world.contacts()):
                break
        belief.moved(joint.leaf, value, "pushed")
        self.platform.sync()

    async def _back(self, arm: ArmModel, lap: Trajectory) -> None:
        base = Pose.planar(*self.platform.base()).matrix()
        rows = arm.solver.chain.fk(lap.positions[[0, -1]])
        await self._work.back(arm, product(base, rows), self._joint.leaf)
