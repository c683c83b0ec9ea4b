"""Paths of a hand that moves a door or a drawer: grasps of its handle along the arc or line that the joint makes of it.

The joint leads: each grasp is carried through the values of the joint, and inverse kinematics follows from value to
value, for many places of the base at once. What is left is looked at exactly in the planning scene, best first.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from executive.belief.scene_collisions import BasePose
from executive.locations.hand_solutions import base_matrices
from executive.modules.control import Control
from executive.motion import cartesian_path
from executive.robots.arms import ArmModel, HandFrame
from planlang.geometry import Array
from planlang.geometry.matrices import cross_matrix, inverse, moved, product, rigid, rotated
from planlang.protocols import Configuration
from planlang.records import dataclass
from sim.joints import Articulation, JointKind

APPROACH = 0.08
"""Distance of the pose before a handle back along the approach direction [m]."""
STEPS = {JointKind.HINGED: 0.06, JointKind.PRISMATIC: 0.025}
"""Steps of a joint between two postures [rad, m]."""
TILTS = (0.0, 0.4, -0.4)
"""Turns of the approach direction about the bar of a handle, from square to the leaf [rad]."""
LEANS = (0.0, 0.5, 0.9)
"""Angles by which a hand comes from above along an upright bar, the forearm clear of the floor [rad]."""
LAGS = (0.0, 0.5, 1.0)
"""By how much of the leaf's turning a hand turns less, about a bar that is parallel to the hinge."""
OUTWARDS = (0.0, 0.015, 0.03)
"""Distances from the middle of the handle, away from the leaf, at which the tip of the hand is [m]."""
PARALLEL = 0.95
"""Cosine from which on two directions count as parallel."""
LONG = 1.5
"""A handle that is longer than this many times its second extent is a bar: fingers close across it."""
AROUND, RADII, HEADINGS = 24, 0.1, (0.0, 0.35, -0.35, 0.8, -0.8)
"""Places of the base around the handle: directions, spacing [m], and headings relative to that of the handle [rad]."""
NEAREST = 0.35
"""Distance of the base from the handle, at least [m]."""
BLOCK = 24
"""Places of the base that are looked at in one go."""
MOST_BLOCKS = 12
"""Blocks that are looked at before what was found has to do."""
FARTHEST = 0.5
"""Largest move of a joint of the arm between two postures [rad, m]."""
ENOUGH = 0.12
"""Share of its way by which a hand has to move a leaf from one place, at least."""


@dataclass(frozen=True, slots=True, eq=False)
class LeafPath:
    """A place of the base, a grasp of the handle, and how the arm moves the leaf from there."""

    arm: ArmModel
    base: BasePose
    before: Array
    """Joint values before the handle (d,)."""
    poses: Array
    """Poses of the tip in the map, before the handle and then at each value (1 + n, 4, 4)."""
    values: Array
    """Values of the joint (n,)."""
    joints: Array
    """Joint values of the arm at each of them (n, d)."""


class LeafPaths:
    """Looks for ways to move one leaf."""

    def __init__(self, control: Control, joint: Articulation) -> None:
        self._control, self._joint = control, joint

    def towards(self, value: float, arms: Sequence[ArmModel], wanted: float) -> Iterator[LeafPath | None]:
        """Yield ways to move the leaf from where it is to a value, those that get there first; None while it looks.

        ``wanted``: the value that will do as well. Ways that end before come last, the farthest first.
        """
        control, joint = self._control, self._joint
        control.sync()
        now = control.belief.joint(joint.leaf)
        count = max(2, math.ceil(abs(value - now) / STEPS[joint.kind]) + 1)
        values = np.linspace(now, value, count)
        enough = int(np.argmax((values >= wanted) if value > now else (values <= wanted))) + 1
        partial: list[LeafPath] = []
        for arm in arms:
            for path in self._of_arm(arm, values):
                if path is None or len(path.values) >= enough:
                    yield path
                else:
                    partial.append(path)
        least = max(2, math.ceil(ENOUGH * count))
        yield from sorted((one for one in partial if len(one.values) > least), key=lambda one: -len(one.values))

    def _of_arm(self, arm: ArmModel, values: Array) -> Iterator[LeafPath | None]:
        """Yield ways with one arm, as far as they are free; best places of the base first, None after some of them."""
        grasps = self._grasps(arm, values)
        if not len(grasps):
            return
        bases = self._bases(arm, values, grasps[0])
        for first in range(0, min(len(bases), BLOCK * MOST_BLOCKS), BLOCK):
            found = self._solved(arm, bases[first : first + BLOCK], grasps)
            tried = set[BasePose]()
            for base, number, joints in found:
                path = None if base in tried else self._checked(arm, base, grasps[number], values, joints)
                if path is not None:
                    tried.add(base)
                    yield path
            yield None

    # Grasps of the handle

    def _grasps(self, arm: ArmModel, values: Array) -> Array:
        """Return the poses of the tip for each grasp of the handle, before it and at each value, (g, 1 + n, 4, 4)."""
        joint, scene = self._joint, self._control.scene
        assert joint.handle is not None
        pose, size = scene.bodies.pose(joint.handle), np.asarray(scene.bodies.size(joint.handle))
        outwards, axis = self._outwards(), np.array(joint.axis)
        order = np.argsort(size)
        is_bar = size[order[2]] > LONG * size[order[1]]
        bars = [pose.rotation[:, order[2]]] if is_bar else [pose.rotation[:, k] for k in range(3)]
        motions = [joint.motion(v).matrix() for v in values.tolist()]
        back, middle = inverse(motions[0]), np.array(pose.position)
        grasps = []
        for bar in (bar for bar in bars if abs(float(bar @ outwards)) < 0.5):
            bar = _square(bar, outwards)
            turns = joint.kind is JointKind.HINGED and abs(float(bar @ axis)) > PARALLEL
            upright = abs(float(bar[2])) > PARALLEL
            for tilt, lean in ((tilt, lean) for lean in LEANS for tilt in TILTS if not lean or (upright and not tilt)):
                approach = -(math.cos(tilt) * outwards + math.sin(tilt) * np.cross(bar, outwards))
                closing = np.cross(bar, approach)
                approach = math.cos(lean) * approach - math.sin(lean) * math.copysign(1.0, bar[2]) * bar
                if float(np.abs(pose.rotation.T @ closing) @ size) > arm.max_opening:
                    continue
                for sign in (1.0, -1.0):
                    for out in OUTWARDS:
                        start = _tip(arm.frame, approach, sign * closing, middle + out * outwards)
                        for lag in LAGS if turns else LAGS[:1]:
                            turned = [
                                _turned(product(motion, back), start, middle, axis, -lag * (v - values[0]))
                                for motion, v in zip(motions, values.tolist(), strict=True)
                            ]
                            before = start.copy()
                            before[:3, 3] -= APPROACH * approach
                            grasps.append(np.stack([before, *turned]))
        return np.array(grasps).reshape(-1, 1 + len(values), 4, 4)

    def _outwards(self) -> Array:
        """Return the direction in which the free side of the leaf shows now."""
        joint, control = self._joint, self._control
        if joint.kind is JointKind.PRISMATIC:
            return np.array(joint.axis)
        if joint.is_knob and joint.holder is not None:
            device = control.scene.bodies.pose(joint.holder).position
            arrow = np.array(control.scene.bodies.pose(joint.leaf).position) - device
            return np.array(joint.axis) * math.copysign(1.0, float(arrow @ joint.axis))
        leaf, handle = control.scene.bodies.pose(joint.leaf), control.scene.bodies.pose(joint.handle or joint.leaf)
        normal = leaf.rotation[:, int(np.argmin(control.scene.bodies.size(joint.leaf)))]
        arm = np.array(leaf.position) - np.array(joint.point)
        opens = float(np.cross(joint.axis, arm) @ normal)
        away = float((np.array(handle.position) - np.array(leaf.position)) @ normal)
        return np.asarray(normal * math.copysign(1.0, away if abs(away) > 1e-3 else opens))

    # Places of the base

    def _bases(self, arm: ArmModel, values: Array, grasp: Array) -> Array:
        """Return free places of the base from which the way of a grasp is within the arm's reach, best first (m, 3)."""
        tips = grasp[1:, :3, 3]
        middle = tips.mean(axis=0)
        directions = np.arange(AROUND) * 2 * math.pi / AROUND
        radii = np.arange(NEAREST, arm.reach + 2 * NEAREST, RADII)
        turn, radius, offset = (grid.ravel() for grid in np.meshgrid(directions, radii, HEADINGS, indexing="ij"))
        x, y = middle[0] + radius * np.cos(turn), middle[1] + radius * np.sin(turn)
        bases = np.column_stack([x, y, np.remainder(turn + 2 * math.pi + offset, 2 * math.pi) - math.pi])
        here = np.array([self._control.base()])
        bases = here if self._control.robot.base.fixed else np.concatenate([here, bases])
        bases = bases[self._control.scene.collisions.floor().holds(bases)]
        bases = bases[self._beside(bases, values)]
        shoulder = moved(base_matrices(bases), (arm.shoulder_low + arm.shoulder_high) / 2)
        low, high = arm.shoulder_low[2], arm.shoulder_high[2]
        gaps = shoulder[:, None] - tips[None]
        gaps[..., 2] = np.clip(tips[None, :, 2], low, high) - tips[None, :, 2]
        away = np.linalg.norm(gaps, axis=2) / arm.reach
        reached = np.logical_and.accumulate(away < 1.0, axis=1).sum(axis=1)
        strain = np.abs(away - 0.65).max(axis=1) + 0.1 * (np.linalg.norm(bases[:, :2] - here[:, :2], axis=1) > 1e-6)
        order = np.lexsort((strain.round(6), -reached))
        return np.asarray(bases[order[reached[order] > 1]])

    def _beside(self, bases: Array, values: Array) -> NDArray[np.bool_]:
        """Return which bases (m, 3) the leaf does not sweep over, as far as the base's round outline tells, (m,)."""
        joint, world = self._joint, self._control.scene.world
        leaf, radius = world.scene.body(joint.leaf), 0.8 * self._control.scene.base_radius
        free = np.ones(len(bases), bool)
        for value in values[:: max(1, len(values) // 8)].tolist():
            pose = joint.motion(value) @ leaf.pose
            points = np.column_stack([bases[:, :2], np.full(len(bases), pose.position[2])])
            local = np.abs(moved(pose.inverse().matrix(), points)) - np.asarray(leaf.size) / 2
            free &= np.linalg.norm(np.maximum(local, 0.0), axis=1) > radius
        return free

    # Ways

    def _solved(self, arm: ArmModel, bases: Array, grasps: Array) -> list[tuple[BasePose, int, Array]]:
        """Return for places and grasps the joint values from before the handle on (k, d), longest ways first."""
        rows, numbers = (grid.ravel() for grid in np.indices((len(bases), len(grasps))))
        targets = product(inverse(base_matrices(bases))[rows][:, None], grasps[numbers])
        joints = np.zeros((*targets.shape[:2], len(arm.joints)))
        seeds = np.broadcast_to(arm.seeds, (len(rows), *arm.seeds.shape))
        joints[:, 1], alive = arm.solver.solve(targets[:, 1], seeds)
        reached = alive.astype(int)
        near = np.flatnonzero(alive)
        q, good = arm.solver.solve(targets[near, 0], joints[near, 1][:, None])
        joints[near, 0] = q
        near = near[good & (np.abs(q - joints[near, 1]).max(axis=1) < 2 * FARTHEST)]
        reached[np.setdiff1d(np.arange(len(rows)), near)] = 0
        joints[near, 1], good = arm.solver.solve(
            targets[near, 1], joints[near, 0][:, None]
        )  # as the arm will get there
        near = near[good]
        for k in range(2, targets.shape[1]):
            if not len(near):
                break
            q, good = arm.solver.solve(targets[near, k], joints[near, k - 1][:, None])
            joints[near, k] = q
            near = near[good & (np.abs(q - joints[near, k - 1]).max(axis=1) < FARTHEST)]
            reached[near] = k
        order = [row for row in np.argsort(-reached, kind="stable").tolist() if reached[row] > 1]
        found = []
        for row in order:
            x, y, yaw = bases[rows[row]].tolist()
            found.append(((x, y, yaw), int(numbers[row]), joints[row, : reached[row] + 1]))
        return found

    def _checked(self, arm: ArmModel, base: BasePose, grasp: Array, values: Array, joints: Array) -> LeafPath | None:
        """Return a way as far as nothing is in it, None if not even the handle can be taken."""
        control, handle = self._control, self._joint.handle
        scene = control.scene
        assert handle is not None

        def is_free(q: Array) -> bool:
            return not scene.collisions.contacts(base, arm, q, handle, arm.openings.widest)

        if scene.collisions.contacts(base) or not (is_free(joints[0]) and is_free(joints[1])):
            return None
        ends = product(inverse(base_matrices(np.array([base]))[0]), grasp[:2])
        line = cartesian_path(arm.solver, joints[0], ends[0], ends[1], is_free)
        if line.waypoints is None or np.abs(line.waypoints[-1] - joints[1]).max() > 0.1:
            return None
        fingers = scene.collisions.closed_on(base, arm, joints[1], handle)
        if fingers is None:
            return None
        count = 1 + self._free_steps(arm, base, joints[1:], fingers)
        return LeafPath(arm, base, joints[0], grasp[: 1 + count], values[:count], joints[1 : 1 + count])

    def _free_steps(self, arm: ArmModel, base: BasePose, rows: Array, fingers: Mapping[str, float]) -> int:
        """Return how many steps the arm can go with the fingers closed on the handle, and the leaf behind them."""
        control, world = self._control, self._control.scene.world
        joints = {**world.configuration().joints, **fingers}
        try:
            world.set_configuration(Configuration(base, joints | dict(zip(arm.joints, rows[0].tolist(), strict=True))))
            world.lead(control.robot.arm(arm.name).tip, self._joint.leaf)
            for number, row in enumerate(rows[1:]):
                if world.contacts(Configuration(base, joints | dict(zip(arm.joints, row.tolist(), strict=True)))):
                    return number
            return len(rows) - 1
        finally:
            world.let_go(self._joint.leaf)
            control.sync()


def _square(direction: Array, to: Array) -> Array:
    """Return the part of a direction that is square to another, as unit vector."""
    part = direction - float(direction @ to) * to
    return np.asarray(part / np.linalg.norm(part))


def _tip(frame: HandFrame, approach: Array, closing: Array, position: Array) -> Array:
    return rigid(frame.rotation(approach, closing), position)


def _turned(motion: Array, pose: Array, middle: Array, axis: Array, angle: float) -> Array:
    """Return a pose (4, 4) after a motion (4, 4), turned about an axis through what has become of a point (3,)."""
    cross = cross_matrix(axis)
    turn = np.eye(3) + math.sin(angle) * cross + (1 - math.cos(angle)) * product(cross, cross)
    centre, there = moved(motion, middle), product(motion, pose)
    return rigid(product(turn, there[:3, :3]), centre + rotated(turn, there[:3, 3] - centre))
