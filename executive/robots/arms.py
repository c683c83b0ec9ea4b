"""Arms of a bound robot as location resolving and motion planning need them, and a posture for them to drive in."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import field, replace
from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from executive.motion import Chain, Gaze, InverseKinematics
from executive.robots.openings import Openings, openings_of
from executive.robots.robot import CARRYING, Arm, Robot
from planlang.diagnostics import note
from planlang.geometry import Array, Pose
from planlang.geometry.matrices import product
from planlang.geometry.urdf import Joint, displacement, joints_between, read_urdf
from planlang.progress import Report, Share, unreported
from planlang.protocols import Configuration
from planlang.records import dataclass
from sim import Body, PlanningWorld, Scene

SAMPLES = 400
"""Random configurations from which the length of an arm is measured; 2 % are added for those that were not drawn."""
TURN_STEP, SLIDE_STEP = 0.08, 0.02
"""Steps in which motions of turning and sliding joints are checked [rad], [m]."""


@dataclass(frozen=True, slots=True)
class HandFrame:
    """Convention of a tip frame: unit vectors of the approach and of the closing direction in it."""

    approach: tuple[float, float, float]
    closing: tuple[float, float, float]

    def rotation(self, approach: Array, closing: Array) -> Array:
        """Return the rotation (3, 3) that turns the frame's approach and closing axes into the given map directions."""
        return np.asarray(_axes(approach, closing) @ _axes(self.approach, self.closing).T)


def _axes(first: Sequence[float] | Array, second: Sequence[float] | Array) -> Array:
    """Return two orthogonal unit vectors and their cross product as columns (3, 3): np.cross is slow for one."""
    a, b, c = first
    d, e, f = second
    return np.array([[a, d, b * f - c * e], [b, e, c * d - a * f], [c, f, a * e - b * d]])


@dataclass(frozen=True, slots=True)
class Held:
    """Object in a hand: name, pose in the tip frame, size of its box [m]."""

    name: str
    pose: Pose
    size: tuple[float, float, float]
    largest_tilt: float | None = None
    """The angle by which its z axis may lean from upright [rad]; None if it may be turned as one likes."""

    @property
    def up(self) -> Array:
        """Return its z axis in the tip frame, (3,)."""
        return np.asarray(self.pose.rotation[:, 2])

    def lowest_of(self, rotations: Array) -> Array:
        """Return height of the object's lowest point relative to the tip, for tip rotations (m, 3, 3), (m,) [m]."""
        turned = rotations @ self.pose.matrix()[:3, :3]
        return np.asarray(self.offsets(rotations)[:, 2] - np.abs(turned[:, 2]) @ (np.asarray(self.size) / 2))

    def offsets(self, rotations: Array) -> Array:
        """Return the object's centre relative to the tip, in the map, for tip rotations (m, 3, 3), (m, 3)."""
        return np.asarray(rotations @ np.asarray(self.pose.position))


@dataclass(frozen=True, slots=True)
class Lift:
    """A torso that lifts the arms straight up: rise [m] = ``per_unit`` * (position - ``lowest``)."""

    joint: str
    column: int
    """Index of the joint among the arm's joints."""
    lowest: float
    """Joint position at which the rise is 0 [m]."""
    highest: float
    """Joint position at which the rise is greatest [m]."""
    per_unit: float

    def rise(self, position: ArrayLike) -> Array:
        """Return rise [m] of joint positions."""
        return np.asarray(self.per_unit * (np.asarray(position, float) - self.lowest))

    def position(self, rise: ArrayLike) -> Array:
        """Return the joint positions for a rise [m]."""
        return np.asarray(self.lowest + np.asarray(rise, float) / self.per_unit)


@dataclass(frozen=True, slots=True)
class ArmModel:
    """One arm (with the joints that carry it, e.g. the torso) as the resolver sees it."""

    name: str
    joints: tuple[str, ...]
    lower: Array
    upper: Array
    solver: InverseKinematics
    resolution: Array
    """Steps in which motions are checked, (d,) [rad, m]."""
    frame: HandFrame
    max_opening: float
    hand_links: frozenset[str]
    hand_radius: float
    """Extent of the hand around its tip frame across the approach direction [m]."""
    shoulder_low: Array
    """Shoulder in the base frame at the lowest posture of what carries the arm, (3,)."""
    shoulder_high: Array
    """The same at the highest, (3,)."""
    reach: float
    """Longest distance from shoulder to tip [m]."""
    seeds: Array
    """Postures to start inverse kinematics from, (s, d)."""
    lift: Lift | None = None
    """The torso that lifts it straight up."""
    payload: float = math.inf
    """Largest mass that the hand carries [kg]."""
    openings: Openings = field(default_factory=Openings)
    """Openings of the hand."""
    hand_corners: Array = field(default_factory=lambda: np.zeros((1, 3)))
    """Corners of boxes around the hand's pieces in the tip frame, (n, 3)."""
    palm: tuple[tuple[float, ...], ...] = ()
    """The pieces that are no fingers, which nothing that is grasped may touch."""

    def lowest(self, rotations: Array, held: Held | None) -> Array:
        """Return the lowest point (m,) of hand and held object over the tip [m], for tip rotations (m, 3, 3)."""
        hand = (self.hand_corners @ rotations[:, 2, :, None])[..., 0].min(axis=1)
        return np.asarray(hand if held is None else np.minimum(hand, held.lowest_of(rotations)))


def arm_models(robot: Robot, world: PlanningWorld) -> tuple[ArmModel, ...]:
    """Return all arms of a robot, in its order; ``world`` knows which links belong to a hand."""
    return tuple(_model(robot, arm, world) for arm in robot.arms)


def gaze_of(robot: Robot) -> Gaze | None:
    """Return what points the camera; None for a robot without one."""
    if robot.camera is None:
        return None
    posture = robot.postures.get("carrying", {})
    joints = joints_between(read_urdf(robot.urdf).joints, robot.base_link, robot.camera.link)
    still = {joint.name: posture.get(joint.name, 0.0) for joint in joints if joint.kind != "fixed"}
    if not robot.neck:
        return Gaze.fixed(_pose(joints, still), robot.camera.forward)
    still = {name: value for name, value in still.items() if name not in robot.neck}
    return Gaze(robot.urdf, robot.base_link, robot.camera.link, robot.neck, robot.camera.forward, still=still)


def _pose(joints: Sequence[Joint], positions: Mapping[str, float]) -> Array:
    """Return the pose (4, 4) of the last joint's child in the first joint's parent."""
    pose = np.eye(4)
    for joint in joints:
        pose = product(pose, joint.origin)
        if joint.name in positions:
            pose = product(pose, displacement(joint, positions[joint.name]))
    return pose


def _model(robot: Robot, arm: Arm, world: PlanningWorld) -> ArmModel:
    chain = Chain.from_urdf(robot.urdf, robot.base_link, arm.tip)
    middle = np.clip((chain.lower + chain.upper) / 2, -np.pi, np.pi)
    seeds = [middle]
    for posture in robot.postures.values():
        seeds.append(np.array([posture.get(name, value) for name, value in zip(chain.names, middle, strict=True)]))
    low, high = _shoulders(robot, arm, chain, world)
    tips = chain.fk(chain.sample(np.random.default_rng(0), SAMPLES))[:, :3, 3]
    shoulders = np.repeat(((low + high) / 2)[None], SAMPLES, 0)
    shoulders[:, 2] = np.clip(tips[:, 2], low[2], high[2])
    fingers = arm.gripper.finger_links if arm.gripper is not None else ()
    return ArmModel(
        name=arm.name,
        joints=chain.names,
        lower=chain.lower,
        upper=chain.upper,
        solver=InverseKinematics(chain),
        resolution=np.where(chain.prismatic, SLIDE_STEP, TURN_STEP),
        frame=HandFrame(arm.approach, arm.closing),
        payload=arm.payload,
        max_opening=arm.gripper.max_opening if arm.gripper is not None else 0.0,
        openings=openings_of(arm, world),
        hand_links=world.robot.hand_links(arm.tip),
        hand_radius=world.robot.hand_radius(arm.tip, arm.approach),
        hand_corners=world.robot.hand_corners(arm.tip),
        palm=tuple(map(tuple, world.robot.hand_corners(arm.tip, fingers).round(6).tolist())),
        shoulder_low=low,
        shoulder_high=high,
        reach=1.02 * float(np.linalg.norm(tips - shoulders, axis=1).max()),
        seeds=_distinct(seeds),
        lift=lift_of(chain, robot.torso),
    )


def _shoulders(robot: Robot, arm: Arm, chain: Chain, world: PlanningWorld) -> tuple[Array, Array]:
    """Return where the arm begins, in the base frame, at the lowest and the highest posture of what carries it."""
    found = []
    for ends in (chain.lower, chain.upper):
        joints = {robot.torso: float(ends[chain.names.index(robot.torso)])} if robot.torso in chain.names else {}
        pose = world.link_pose(arm.base_link, Configuration((0.0, 0.0, 0.0), joints))
        found.append(np.asarray(pose.position))
    first, second = sorted(found, key=lambda point: float(point[2]))
    return first, second


def _distinct(seeds: list[Array]) -> Array:
    kept: dict[bytes, Array] = {}
    for seed in seeds:
        kept.setdefault(np.round(seed, 6).tobytes(), seed)
    return np.stack(list(kept.values()))


def lift_of(chain: Chain, torso: str | None) -> Lift | None:
    """Return how a torso joint lifts a chain; None if it does not, or not straight up."""
    if torso is None or torso not in chain.names:
        return None
    column = chain.names.index(torso)
    low, high = float(chain.lower[column]), float(chain.upper[column])
    ends = np.tile((chain.lower + chain.upper) / 2, (2, 1))
    ends[:, column] = low, high
    below, above = chain.fk(ends)
    travel = above[:3, 3] - below[:3, 3]
    if not chain.prismatic[column] or high - low < 1e-6 or np.abs(above[:3, :3] - below[:3, :3]).max() > 1e-9:
        return None
    rise = float(travel[2])
    if np.hypot(*travel[:2]) > 1e-3 * abs(rise):
        return None
    if rise < 0:
        low, high, rise = high, low, -rise
    return Lift(torso, column, low, high, rise / (high - low))


AHEAD = np.arange(0.25, 0.75, 0.1)
"""Distances of the hand ahead of the base's axis [m]."""
ASIDE = (0.0, 0.1, 0.2, 0.3)
"""Distances from the middle, on the arm's own side [m]."""
ABOVE = np.arange(-0.5, 0.7, 0.15)
"""Heights above the shoulder [m]."""
INWARDS = (0.0, 0.6, 1.2)
"""By how much the hand may point across the robot [rad]."""
HEIGHT = -0.2
"""Height of a hand above the shoulder that is wished for [m]."""
NARROWER = 0.05
"""Differences of width that count [m]."""
LOWEST = 0.3
"""Least height of a hand above the floor [m]."""
SEEDS = 6
"""Random postures from which inverse kinematics begins, beside the middle one: it is run once for a robot."""
STRAY = 100
"""Postures at random that are looked at as well, if the hand is level in none."""
TORSO = 0.3
"""Height of the torso as a share of its range."""
HERE = (0.0, 0.0, 0.0)


def with_carrying(robot: Robot, held: Sequence[tuple[str, Body, Pose]] = (), report: Report = unreported) -> Robot:
    """Return the robot with a carrying posture: without contact, hands level, as narrow as possible.

    ``held`` are the things that it holds: the link, the body, and its pose in the frame of the link. The posture that
    the robot has is left to it if these touch nothing there. ``report`` is given the progress of the search.
    """
    if (CARRYING in robot.postures and not held) or not robot.arms:
        return robot
    world = PlanningWorld(Scene(tuple(body for _, body, _ in held)), robot.body())
    try:
        for link, body, offset in held:
            world.set_pose(body.name, world.link_pose(link) @ offset)
            world.attach(link, body.name)
        if CARRYING in robot.postures and not world.contacts():
            return robot
        joints: dict[str, float] = {}
        if robot.torso is not None:
            low, high = world.robot.limits[robot.torso]
            joints[robot.torso] = low + TORSO * (high - low)
        for arm in robot.arms:
            joints |= _best(robot, arm, joints, world, partial(report, f"posture to drive in: {arm.name} arm"))
            report("", 1.0)
    finally:
        world.close()
    assumed = note(
        "B010",
        f"{robot.name} has no posture to drive in; one with level hands close to the body is used",
        help="a robot file (TOML) says one under [postures.carrying]",
    )
    return replace(robot, postures={**robot.postures, CARRYING: joints}, diagnostics=(*robot.diagnostics, assumed))


def _best(robot: Robot, arm: Arm, fixed: Mapping[str, float], world: PlanningWorld, share: Share) -> dict[str, float]:
    """Return the joints of an arm, others fixed: least penetration first, then the narrowest, then of a good height."""
    chain = Chain.from_urdf(robot.urdf, robot.base_link, arm.tip, locked=fixed)
    rng = np.random.default_rng(0)
    candidates = _level(arm, chain, world, fixed, rng)
    free = arm.gripper.opened if arm.gripper is not None else {}
    shoulder = world.link_pose(arm.base_link, Configuration(HERE, fixed)).position[2]
    best: tuple[tuple[float, float, float], dict[str, float]] | None = None
    for rows in (candidates, chain.sample(rng, STRAY)):
        for number, row in enumerate(rows):
            share(number / len(rows))
            joints = dict(zip(chain.names, map(float, row), strict=True))
            world.set_configuration(Configuration(HERE, {**fixed, **joints, **free}))
            depth = round(sum(contact.depth for contact in world.contacts(moving=arm.joints)), 3)
            if best is not None and depth > best[0][0]:
                continue
            width = max(radius for _, _, radius in world.silhouette())
            height = world.link_pose(arm.tip).position[2] - shoulder
            rank = (depth, round(width / NARROWER), abs(height - HEIGHT))
            if best is None or rank < best[0]:
                best = rank, joints
        if best is not None and best[0][0] == 0.0:
            break
    assert best is not None
    return best[1]


def _level(arm: Arm, chain: Chain, world: PlanningWorld, fixed: Mapping[str, float], rng: np.random.Generator) -> Array:
    """Return the joint values (n, d) with the hand level, so that what it holds stays upright."""
    shoulder = world.link_pose(arm.base_link, Configuration(HERE, fixed)).position[2]
    side = {"left": 1.0, "right": -1.0}.get(arm.side or "", 1.0)
    targets = [
        _target(arm, (x, side * y, z), -side * inwards)
        for z in np.maximum(shoulder + ABOVE, LOWEST)
        for x in AHEAD
        for y in ASIDE
        for inwards in INWARDS
    ]
    middle = np.clip((chain.lower + chain.upper) / 2, -np.pi, np.pi)
    seeds = np.concatenate([middle[None], chain.sample(rng, SEEDS)])
    q, ok = InverseKinematics(chain).solve(np.stack(targets), np.repeat(seeds[None], len(targets), axis=0))
    found: Array = q[ok]
    return found


def _target(arm: Arm, position: tuple[float, float, float], heading: float) -> Array:
    """Return the pose (4, 4) of the tip at a place, pointing level into a direction, fingers closing level."""
    ahead = np.array([np.cos(heading), np.sin(heading), 0.0])
    across = np.array([-np.sin(heading), np.cos(heading), 0.0])
    there = np.column_stack([ahead, across, np.cross(ahead, across)])
    tip = np.column_stack([arm.approach, arm.closing, np.cross(arm.approach, arm.closing)])
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = product(there, tip.T), position
    return pose
