"""Planning scene: the believed world, as queried by location resolving and motion planning."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from copy import copy
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from executive.belief.belief import Belief
from executive.belief.believed_bodies import BelievedBodies
from executive.belief.scene_collisions import BasePose, SceneCollisions
from executive.belief.scene_part import Kept, ScenePart
from executive.motion import Gaze
from executive.motion.bodies import Solids
from executive.robots.arms import ArmModel, Held, RobotModel
from planlang.designators import Device
from planlang.geometry import Array, Pose
from planlang.geometry.areas import Block
from planlang.geometry.matrices import rotated
from planlang.geometry.shapes import SolidKind
from planlang.kernel import still_computing
from planlang.language.performing import actions_around
from planlang.protocols import Configuration
from planlang.records import dataclass
from planlang.state import WorldState
from planlang.state.questions import POURS
from sim import PlanningWorld, WorldMirror

if TYPE_CHECKING:
    from executive.belief.explored_space import ExploredSpace

SEEN_SHARE = 0.3
"""Least share of an object that must be visible from a base pose from which it counts as seen."""
CELL = 0.01
"""Resolution of an object's position in the base's frame, for caching [m]."""
SPOTS = (-0.8, 0.0, 0.8)
"""Points of an object to check for visibility, as shares of its half extents across the line of sight."""
FEW = 0.12
"""Share of these points below which the object is surely not seen, with a wide margin to :data:`SEEN_SHARE`."""
HALF = 1 << 20
"""Offset of cell indices that makes them positive: more cells than an object can be away."""
AWAY = 0.02
"""Distance from the camera below which bodies do not occlude [m]."""
CORE = 0.5
"""Share of a mesh's bounding box that is assumed to be filled."""


@dataclass(frozen=True, slots=True, eq=False)
class OwnView:
    """View that the robot's own body leaves its camera: pieces that the neck does not move, and reach of the neck."""

    solids: Solids
    """Pieces of the robot that the neck does not move, in the base's frame."""
    gaze: Gaze
    half_angle: float
    """Half the camera's field of view: an object may be that far beyond the neck's limits [rad]."""
    limits: tuple[float, float]
    """Distances between which objects are recognised [m]."""

    def misses(self, points: Array, block: Block) -> NDArray[np.bool_]:
        """Mark the points (n, 3) of the base's frame at which an object is surely not seen, even in an empty room."""
        beyond, eyes = self.gaze.at_all(points)
        distances = np.linalg.norm(points - eyes, axis=1)
        missed = (beyond > self.half_angle) | (distances < self.limits[0] - CELL) | (distances > self.limits[1] + CELL)
        open_rows = np.flatnonzero(~missed)
        if len(open_rows):
            lines = _lines(eyes[open_rows], points[open_rows], block)
            missed[open_rows] = _share(~self.solids.crossed(*lines), len(open_rows)) < FEW
        return np.asarray(missed)

    def hidden_by(self, solids: Solids, bases: Array, block: Block) -> NDArray[np.bool_]:
        """Mark the base poses (n, 3) from which other bodies' pieces surely hide an object, (n,)."""
        c, s = np.cos(bases[:, 2]), np.sin(bases[:, 2])
        points = np.column_stack([_seen_from(bases, block), np.full(len(bases), block.centre[2])])
        x, y, z = self.gaze.at_all(points)[1].T
        eyes = np.stack([bases[:, 0] + c * x - s * y, bases[:, 1] + s * x + c * y, z], axis=1)
        lines = _lines(eyes, np.tile(block.centre, (len(bases), 1)), block)
        return np.asarray(_share(~solids.crossed(*lines), len(bases)) < FEW)


def _lines(eyes: Array, points: Array, block: Block) -> tuple[Array, Array]:
    """Build lines of sight from eyes (n, 3) to m points across an object at points (n, 3): starts and ends (n m, 3)."""
    ahead = points[:, :2] - eyes[:, :2]
    ahead /= np.maximum(np.linalg.norm(ahead, axis=1), 1e-9)[:, None]
    across, up = (grid.ravel() for grid in np.meshgrid(SPOTS, SPOTS))
    aside = min(block.half_x, block.half_y) * across
    ends = np.repeat(points[:, None], aside.size, axis=1)
    ends[..., 0] -= ahead[:, None, 1] * aside
    ends[..., 1] += ahead[:, None, 0] * aside
    ends[..., 2] += (block.high - block.low) / 2 * up
    starts = np.repeat(eyes[:, None], aside.size, axis=1)
    starts += AWAY * (ends - starts) / np.linalg.norm(ends - starts, axis=2)[..., None]
    return starts.reshape(-1, 3), ends.reshape(-1, 3)


def _seen_from(bases: Array, block: Block) -> Array:
    """Positions (n, 2) of a block in the frames of base poses (n, 3)."""
    c, s = np.cos(bases[:, 2]), np.sin(bases[:, 2])
    dx, dy = block.x - bases[:, 0], block.y - bases[:, 1]
    return np.stack([c * dx + s * dy, c * dy - s * dx], axis=1)


def _share(free: NDArray[np.bool_], count: int) -> Array:
    """Compute the share of free lines (count,) for each of ``count`` positions."""
    return np.asarray(free.reshape(count, -1).mean(axis=1))


class Unseen:
    """Predicate of base poses from which an object is surely not seen, even in an empty room; results are cached."""

    def __init__(self, view: OwnView, block: Block) -> None:
        self._view, self._block = view, block
        self._known: dict[int, bool] = {}

    def __call__(self, bases: Array) -> NDArray[np.bool_]:
        """Mark base poses (n, 3), (n,)."""
        block = self._block
        cells = np.rint(_seen_from(bases, block) / CELL).astype(np.int64) + HALF
        keys, index = np.unique(2 * HALF * cells[:, 0] + cells[:, 1], return_inverse=True)
        fresh = np.array([key for key in keys.tolist() if key not in self._known], np.int64)
        if len(fresh):
            local = CELL * (np.stack(np.divmod(fresh, 2 * HALF), axis=1) - HALF)
            points = np.column_stack([local, np.full(len(fresh), block.centre[2])])
            self._known.update(zip(fresh.tolist(), self._view.misses(points, block).tolist(), strict=True))
        known = np.array([self._known[key] for key in keys.tolist()], bool)
        return np.asarray(known[index.ravel()])


def still_pieces(world: PlanningWorld, neck: Iterable[str]) -> Solids:
    """Collect the pieces that the neck's joints do not move, in the robot's current posture and the base's frame."""
    robot = world.robot
    moved = frozenset[int]().union(*(robot.moved_by(name) for name in neck))
    frames = world.solid_frames(Configuration((0.0, 0.0, 0.0), world.configuration().joints))
    pieces, shapes = [], []
    for number, name in enumerate(robot.solid_names):
        for kind, size, pose in () if number in moved else robot.shapes(number):
            pieces.append((name, frames[number] @ pose.matrix()))
            if kind == SolidKind.MESH:  # the core of its bounding box is surely filled
                x, y, z = size
                kind, size = SolidKind.BOX, (CORE * x, CORE * y, CORE * z)
            shapes.append((kind, size))
    return Solids.placed(
        tuple(name for name, _ in pieces),
        np.array([matrix for _, matrix in pieces]).reshape(-1, 4, 4),
        shapes,
    )


class Visibility(ScenePart):
    """Visibility of objects in the planning world for the robot's camera on its neck."""

    def __init__(self, mirror: WorldMirror, model: RobotModel, belief: Belief, bodies: BelievedBodies) -> None:
        super().__init__(mirror, belief)
        self._robot, self._bodies, self._gaze = model.robot, bodies, model.gaze
        self._hidden: Kept[dict[tuple[BasePose, str], str | None]] = Kept()
        self._unseen: Kept[dict[str, Unseen]] = Kept()

    @property
    def gaze(self) -> Gaze | None:
        """What points the camera; one that is fixed as it is now while the neck is given up; None without a camera."""
        camera = self._robot.camera
        if self._gaze is None or camera is None or not self._belief.memory.neck_given_up:
            return self._gaze
        base = Pose.planar(*self._world.configuration().base)
        return Gaze.fixed((base.inverse() @ self._world.link_pose(camera.link)).matrix(), camera.forward)

    def supposing(self, belief: Belief) -> Visibility:
        """Make the same part for another belief."""
        other = super().supposing(belief)
        other._bodies = self._bodies.supposing(belief)
        return other

    def sighted(self) -> bool:
        """Check whether the robot has a camera."""
        return self.gaze is not None

    def camera_range(self) -> tuple[float, float]:
        """Look up the distances between which the camera recognises objects [m]."""
        camera = self._robot.camera
        return (0.0, 0.0) if camera is None else (camera.near, camera.far)

    def own_view(self) -> OwnView | None:
        """Compute the view that the robot's body leaves its camera in the current posture; None without a camera."""
        camera = self._robot.camera
        if self.gaze is None or camera is None:
            return None
        return OwnView(still_pieces(self._world, self.gaze.joints), self.gaze, camera.half_angle, self.camera_range())

    def hidden(self, base: BasePose, name: str) -> str | None:
        """Find what hides a body from a base pose; None if the camera can see it.

        Names the body that occludes most of it; "" if it is beyond the limits of neck or camera.
        """
        cached = self._hidden.of(self._state(), dict)
        if (base, name) not in cached:
            cached[base, name] = self._hides(base, name)
        return cached[base, name]

    def unseen(self, name: str) -> Unseen | None:
        """Build the predicate of base poses from which a body is surely not seen; None without a camera."""
        cached = self._unseen.of(self._state(), dict)
        if name not in cached and (view := self.own_view()) is not None:
            cached[name] = Unseen(view, self._bodies.block(name))
        return cached.get(name)

    def _state(self) -> object:
        """Cache key of visibility."""
        state = self._belief.state
        joints = tuple(self._world.configuration().joints.items())
        return state.poses, state.away, state.held, joints, self._belief.memory.neck_given_up

    def _hides(self, base: BasePose, name: str) -> str | None:
        """Compute :meth:`hidden` without the cache."""
        still_computing()
        if self.gaze is None or self._robot.camera is None:
            return ""
        x, y, yaw = base
        c, s = math.cos(yaw), math.sin(yaw)
        turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        centre = self._bodies.block(name).centre
        neck, beyond, camera = self.gaze.at(rotated(turn.T, centre - np.array([x, y, 0.0])))
        distance = float(np.linalg.norm(centre - (rotated(turn, camera) + np.array([x, y, 0.0]))))
        if beyond > self._robot.camera.half_angle or not self._robot.camera.near <= distance <= self._robot.camera.far:
            return ""
        joints = {**self._world.configuration().joints, **dict(zip(self.gaze.joints, map(float, neck), strict=True))}
        configuration = Configuration(base, joints)
        share, lines = self._world.sight(name, configuration)
        if share >= SEEN_SHARE:
            return None
        hits = {hit: number for hit, number in lines.items() if hit != name}
        return max(hits, key=lambda hit: hits[hit]) if hits else ""


class RobotArms(ScenePart):
    """Arms of the robot, with their poses and the objects that they are believed to hold."""

    def __init__(self, mirror: WorldMirror, model: RobotModel, belief: Belief) -> None:
        super().__init__(mirror, belief)
        self._robot, self.all = model.robot, model.arms

    def of(self, device: Device) -> Sequence[ArmModel]:
        """Resolve a device designator to arms: by the robot's part, otherwise by type and side."""
        names = [arm.name for arm in self._robot.arms_of(device)]
        return [arm for arm in self.all if arm.name in names]

    def asked(self, device: object = None) -> Sequence[ArmModel]:
        """List the arms of the device that a step states, else of that of the nearest action around it; all without.

        So all steps within an action are done with its hand. What is a tool, and no hand, leaves the choice open.
        """
        if isinstance(device, Device):
            return self.of(device)
        around = (one.get("device_used") for one in actions_around())
        return next((arms for one in around if isinstance(one, Device) and (arms := self.of(one))), self.all)

    @property
    def hands(self) -> list[ArmModel]:
        """The arms that have a gripper."""
        return [arm for arm in self.all if arm.gripper is not None]

    def able(self, arms: Sequence[ArmModel]) -> list[ArmModel]:
        """Leave out the arms whose hands were given up because they failed; keep all if no other is left."""
        return [arm for arm in arms if arm.name not in self._belief.memory.given_up] or list(arms)

    @property
    def grasp(self) -> str | None:
        """Class of the grasps by which things are taken where a location leaves it open; None for any."""
        return self._belief.memory.grasp

    def tip(self, arm: ArmModel) -> Array:
        """Compute the pose (4, 4) of an arm's tip in the map."""
        return self._world.link_pose(arm.tip).matrix()

    def fingers(self, arm: ArmModel) -> tuple[float, ...]:
        """Look up the positions of the joints of an arm's fingers [rad, m]."""
        gripper, joints = arm.gripper, self._belief.state.robots[self._belief.robot].joints
        return () if gripper is None else tuple(joints[name] for name in gripper.joints)

    def held(self, arm: str) -> Held | None:
        """Look up the object that an arm is believed to hold.

        Its tilt is limited if it was grasped upright; that of one that lay, only while it has contents to spill.
        """
        for name, grip in self._belief.held.items():
            for hand in grip.hands:
                if hand.arm == arm:
                    limit, up = self._world.scene.body(name).largest_tilt, float(grip.before.rotation[2, 2])
                    if limit is not None and up < math.cos(limit):
                        lies_full = up >= POURS and self._belief.state.matter.total(name) > 0
                        limit = math.pi / 2 if lies_full else None
                    return Held(name, hand.offset, self._world.size(name), limit)
        return None

    def mates(self, arm: str) -> list[ArmModel]:
        """List the arms that hold an object together with this one, so that none of them can move alone."""
        names = {name for grip in self._belief.held.values() if arm in grip.arms for name in grip.arms} - {arm}
        return [one for one in self.all if one.name in names]

    def grasped_at(self, body: str) -> Array:
        """Compute the tip pose (4, 4) in the map at which a held body was grasped."""
        return (self._belief.reference_pose(body) @ self._belief.held[body].offset.inverse()).matrix()


class PlanningScene:
    """What is believed, as planning asks about it, by subject: bodies, arms, collisions and visibility.

    Functions take the part that they need. Nothing here reads or changes the true world.
    """

    def __init__(self, world: PlanningWorld, model: RobotModel, belief: Belief) -> None:
        self.mirror, self.robot, self.belief = WorldMirror(world, belief.robot), model.robot, belief
        self.space: ExploredSpace | None = None
        """Explored space of the room; None unless an exploration has begun."""
        self.bodies = BelievedBodies(self.mirror, belief)
        self.arms = RobotArms(self.mirror, model, belief)
        self.collisions = SceneCollisions(self.mirror, model, belief)
        self.visibility = Visibility(self.mirror, model, belief, self.bodies)

    @property
    def world(self) -> PlanningWorld:
        """The planning world as it is believed now."""
        return self.mirror.at(self.belief.state)

    def base(self) -> BasePose:
        """Look up the pose of the base."""
        return self.world.configuration().base

    def spare_payload(self, body: str) -> float:
        """Compute how much may be added to a body that hands carry, or to what is on one [kg]; inf if none does."""
        for name, grip in self.belief.held.items():
            if body in (name, *grip.riders):
                payload = min(arm.payload for arm in self.arms.all if arm.name in grip.arms)
                return max(0.0, len(grip.arms) * payload - self.bodies.mass(name))
        return math.inf

    def surroundings(self) -> object:
        """Summarise what is where beside the robot, what hands hold and which grips are refused, as a cache key.

        How devices are is part of it: who has switched one since goes on with nothing that was begun before.
        """
        state = self.belief.state
        there = state.poses, state.joints, state.held, state.led, state.away
        return there, state.matter.states, self.belief.memory.refused

    def content(self) -> object:
        """Summarise what answers about places depend on, as a cache key: scenes of equal content have equal answers."""
        state, matter = self.belief.state, self.belief.state.matter
        robot = state.robots, state.touched
        return robot, self.surroundings(), matter.contents, matter.types, self.belief.memory.evidence()

    def movers(self) -> list[str]:
        """List the bodies that drive by themselves and whose place is known, such as other robots."""
        return [one.body for one in self.world.scene.movers if one.body in self.belief.names()]

    def supposing(self, state: WorldState) -> PlanningScene:
        """Make the scene of another state, such as one with a thing elsewhere; this one stays as it is."""
        other = copy(self)
        other.belief = belief = self.belief.supposing(state)
        other.bodies, other.arms = self.bodies.supposing(belief), self.arms.supposing(belief)
        other.collisions, other.visibility = self.collisions.supposing(belief), self.visibility.supposing(belief)
        return other
