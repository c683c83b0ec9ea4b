"""A bound robot as locations, motions and plans see it: models of its arms, its handle, and a posture for driving."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import field, replace
from functools import partial
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike, NDArray

from executive.motion import Chain, Gaze
from executive.robots.mechanism import Mechanism
from executive.robots.openings import Openings, bare_hand, openings_of
from executive.robots.robot import CARRYING, Arm, Gripper, Robot
from planlang.diagnostics import note
from planlang.geometry import Array, Pose
from planlang.geometry.matrices import inverse, moved, product
from planlang.geometry.urdf import Joint, displacement, joints_between, read_urdf
from planlang.progress import Report, Share, unreported
from planlang.protocols import Configuration, RobotInterface
from planlang.records import dataclass
from planlang.state import Hold, WorldState
from sim import PlanningWorld, Scene, WorldMirror

SAMPLES = 400
"""Number of random configurations from which the reach of an arm is estimated."""
REACH_MARGIN = 1.02
"""Factor on that estimate, as the samples rarely contain the fully stretched arm."""
MOST_AIMED = 3
"""Number of joints that aim the camera, the nearest to it: tables of more take gigabytes. Others stay as they are."""
AROUND = 0.01
"""Distance that a shape reaches beyond the grip point to all sides if it covers it [m]."""
LONG = 10.0
"""Time from end to end from which on a torso is slow [s]: arms are anywhere in a few seconds."""
TURN_STEP, SLIDE_STEP = 0.08, 0.02
"""Resolution of collision checks along motions of revolute and prismatic joints [rad], [m]."""

NOTHING = Scene(())
"""An empty room."""


@dataclass(frozen=True, slots=True)
class HandFrame:
    """Axes of a tip frame: unit vectors of the approach and closing directions in it."""

    approach: tuple[float, float, float]
    closing: tuple[float, float, float]

    def rotation(self, approach: Array, closing: Array) -> Array:
        """Compute the rotation (3, 3) that maps the approach and closing axes to directions in the map frame."""
        return np.asarray(_axes(approach, closing) @ _axes(self.approach, self.closing).T)


def _axes(first: Sequence[float] | Array, second: Sequence[float] | Array) -> Array:
    """Stack two orthogonal unit vectors and their cross product as columns (3, 3), without np.cross, which is slow."""
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
    """Greatest angle between its z axis and the vertical [rad]; None for any orientation."""

    @property
    def may_lie(self) -> bool:
        """Whether it may be tilted as far as to lie, if not any farther."""
        return self.largest_tilt is None or self.largest_tilt >= math.pi / 2

    @property
    def up(self) -> Array:
        """Its z axis in the tip frame, (3,)."""
        return np.asarray(self.pose.rotation[:, 2])

    def lowest_of(self, rotations: Array) -> Array:
        """Compute the height (m,) of its lowest point above the tip [m], for tip rotations (m, 3, 3) in the map."""
        in_map = rotations @ self.pose.matrix()[:3, :3]
        return np.asarray(self.offsets(rotations)[:, 2] - np.abs(in_map[:, 2]) @ (np.asarray(self.size) / 2))

    def offsets(self, rotations: Array) -> Array:
        """Compute its centre (m, 3) relative to the tip, along the map's axes, for tip rotations (m, 3, 3)."""
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

    @property
    def travel(self) -> float:
        """Greatest rise [m]."""
        return float(self.rise(self.highest))

    def rise(self, position: ArrayLike) -> Array:
        """Convert joint positions to rises [m]."""
        return np.asarray(self.per_unit * (np.asarray(position, float) - self.lowest))

    def position(self, rise: ArrayLike) -> Array:
        """Convert rises [m] to joint positions."""
        return np.asarray(self.lowest + np.asarray(rise, float) / self.per_unit)


@dataclass(frozen=True, slots=True)
class ArmModel:
    """One arm, with the joints that carry it (the torso), as planning sees it; d joints."""

    part: Arm
    """What it is, by the self-model or the robot file."""
    chain: Chain
    """From the robot's base link to the tip."""
    resolution: Array
    """Resolution of collision checks along motions, (d,) [rad, m]."""
    frame: HandFrame
    hand_links: frozenset[str]
    hand_radius: float
    """Radius of the hand about the approach axis through the tip [m]."""
    shoulder_low: Array
    """Shoulder in the base frame with the torso at its lowest, (3,)."""
    shoulder_high: Array
    """Shoulder in the base frame with the torso at its highest, (3,)."""
    reach: float
    """Greatest distance from shoulder to tip [m]."""
    seeds: Array
    """Initial postures for inverse kinematics, (s, d)."""
    lift: Lift | None = None
    """The torso, if it lifts the arm straight up."""
    standing: Chain | None = None
    """The chain with that torso at its lowest if it is slow (:data:`LONG`): the arm moves without it where it can."""
    openings: Openings = field(default_factory=Openings)
    """Openings of the hand."""
    hand_corners: Array = field(default_factory=lambda: np.zeros((1, 3)))
    """Corners of boxes around the links of the hand in the tip frame, (n, 3)."""
    palm: tuple[tuple[float, ...], ...] = ()
    """Corners of the boxes without those of the fingers: a grasped object must not touch the palm."""
    covering: str | None = None
    """Link of the hand, no finger, whose shape is around the grip point, so that nothing fits there; None as a rule."""
    bare: str = ""
    """Which links of the hand lack the collision shapes that its opening follows from; "" as a rule."""

    @property
    def name(self) -> str:
        """Name of the arm."""
        return self.part.name

    @property
    def tip(self) -> str:
        """Link whose frame is the grip point."""
        return self.part.tip

    @property
    def gripper(self) -> Gripper | None:
        """Its hand; None for an arm without fingers."""
        return self.part.gripper

    @property
    def max_opening(self) -> float:
        """Width of the widest object that fits between the opened fingers [m]; 0 without fingers."""
        return 0.0 if self.part.gripper is None else self.part.gripper.max_opening

    @property
    def payload(self) -> float:
        """Largest mass that the hand carries [kg]."""
        return self.part.payload

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of its joints, torso included, (d,)."""
        return self.chain.names

    @property
    def lower(self) -> Array:
        """Lower limits of its joints, (d,) [rad, m]."""
        return self.chain.lower

    @property
    def upper(self) -> Array:
        """Upper limits of its joints, (d,) [rad, m]."""
        return self.chain.upper

    def solve(self, targets: ArrayLike, seeds: ArrayLike) -> tuple[Array, NDArray[np.bool_]]:
        """Solve as :meth:`Chain.solve`; a slow torso stays as in the first seed if the arm alone gets there."""
        poses, starts, lift = np.asarray(targets, float), np.asarray(seeds, float), self.lift
        if lift is None or self.standing is None or not len(poses):
            return self.chain.solve(poses, starts)
        column = lift.column
        position, lowered = starts[:, 0, column].clip(self.lower[column], self.upper[column]), poses.copy()
        lowered[:, 2, 3] -= lift.rise(position)
        rest, ok = self.standing.solve(lowered, np.delete(starts, column, axis=2))
        q = np.insert(rest, column, position, axis=1)
        if not ok.all():
            q[~ok], ok[~ok] = self.chain.solve(poses[~ok], starts[~ok])
        return q, ok

    def lowest(self, rotations: Array, held: Held | None) -> Array:
        """Compute heights (m,) of the lowest point of hand and held object above the tip, for rotations (m, 3, 3)."""
        hand = (self.hand_corners @ rotations[:, 2, :, None])[..., 0].min(axis=1)
        return np.asarray(hand if held is None else np.minimum(hand, held.lowest_of(rotations)))


def called(arm: str) -> str:
    """Name an arm in a sentence: the left arm, the arm."""
    return f"the {arm}" if arm.endswith("arm") else f"the {arm} arm"


def too_far(arm: ArmModel, name: str, distance: float) -> str:
    """Describe how near the shoulder of an arm gets to a thing, ``distance`` [m]; "" if that is within its reach."""
    if not math.isfinite(distance):
        return f"the base has no room to stand near {name}"
    if distance < arm.reach:
        return ""
    where = f"the robot cannot get the shoulder of {called(arm.name)} closer than {distance:.2f} m to {name}"
    return f"{where}, and the arm reaches {arm.reach:.2f} m"


def arm_models(robot: Robot, world: PlanningWorld) -> tuple[ArmModel, ...]:
    """Build the models of all arms of a robot, in its order; ``world`` contains the robot, to measure its hands."""
    return tuple(_model(robot, arm, world) for arm in robot.arms)


def gaze_of(robot: Robot) -> Gaze | None:
    """Build the model that points the camera; None for a robot without one."""
    if robot.camera is None:
        return None
    posture = robot.postures.get("carrying", {})
    joints = joints_between(read_urdf(robot.urdf).joints, robot.base_link, robot.camera.link)
    still = {joint.name: posture.get(joint.name, joint.nearest(0.0)) for joint in joints if joint.kind != "fixed"}
    if not robot.neck:
        return Gaze.fixed(_pose(joints, still), robot.camera.forward)
    aimed = robot.neck[-MOST_AIMED:]
    still = {name: value for name, value in still.items() if name not in aimed}
    return Gaze(robot.urdf, robot.base_link, robot.camera.link, aimed, robot.camera.forward, still=still)


@dataclass(frozen=True, slots=True)
class RobotModel:
    """A bound robot with the models of its arms and of its neck, as planning sees it. Equal in every world."""

    robot: Robot
    arms: tuple[ArmModel, ...]
    """All arms, in the robot's order."""
    gaze: Gaze | None
    """Points the camera; None for a robot without one."""

    @staticmethod
    def of(robot: Robot, world: PlanningWorld) -> RobotModel:
        """Build the model of a robot; ``world`` contains it, to measure its hands."""
        return RobotModel(robot, arm_models(robot, world), gaze_of(robot))


@dataclass(frozen=True, slots=True)
class RobotHandle:
    """One robot of a run. Nothing in it says that there is no other."""

    name: str
    """Its name in states of the world."""
    interface: RobotInterface
    """The real robot: it takes commands, and the world is known only by its sensors."""
    model: RobotModel


def _pose(joints: Sequence[Joint], positions: Mapping[str, float]) -> Array:
    """Compute the pose (4, 4) of the last joint's child in the frame of the first joint's parent."""
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
    lift = lift_of(chain, robot.torso)
    return ArmModel(
        part=arm,
        chain=chain,
        resolution=np.where(chain.prismatic, SLIDE_STEP, TURN_STEP),
        frame=HandFrame(arm.approach, arm.closing),
        openings=openings_of(arm, world),
        hand_links=world.robot.hand_links(arm.tip),
        hand_radius=world.robot.hand_radius(arm.tip, arm.approach),
        hand_corners=world.robot.hand_corners(arm.tip),
        palm=tuple(map(tuple, world.robot.hand_corners(arm.tip, fingers).round(6).tolist())),
        covering=_covering(arm, world, fingers),
        bare=bare_hand(Mechanism(robot.urdf), arm.hand_link, world.robot.solid_names),
        shoulder_low=low,
        shoulder_high=high,
        reach=REACH_MARGIN * float(np.linalg.norm(tips - shoulders, axis=1).max()),
        seeds=_distinct(seeds),
        lift=lift,
        standing=None if lift is None or not _is_slow(lift, robot) else chain.locked({lift.joint: lift.lowest}),
    )


def _covering(arm: Arm, world: PlanningWorld, fingers: Sequence[str]) -> str | None:
    """Find a link of a hand, none of its fingers, whose shape is around the grip point; None if there is none."""
    names, to_tip = world.robot.solid_names, inverse(world.link_pose(arm.tip).matrix())
    palm = [number for number in sorted(world.robot.hand_of(arm.tip)) if names[number] not in fingers]
    axes = np.stack([arm.approach, arm.closing, np.cross(arm.approach, arm.closing)], axis=1)
    for number, points in zip(palm, world.robot.points(palm), strict=True):
        along = moved(to_tip, points) @ axes
        if len(along) and (along.min(axis=0) < -AROUND).all() and (along.max(axis=0) > AROUND).all():
            return names[number]
    return None


def _shoulders(robot: Robot, arm: Arm, chain: Chain, world: PlanningWorld) -> tuple[Array, Array]:
    """Compute the positions of the shoulder (3,) in the base frame with the torso at its lowest and highest."""
    positions = []
    for ends in (chain.lower, chain.upper):
        joints = {robot.torso: float(ends[chain.names.index(robot.torso)])} if robot.torso in chain.names else {}
        pose = world.link_pose(arm.base_link, Configuration((0.0, 0.0, 0.0), joints))
        positions.append(np.asarray(pose.position))
    first, second = sorted(positions, key=lambda point: float(point[2]))
    return first, second


def _distinct(seeds: list[Array]) -> Array:
    distinct: dict[bytes, Array] = {}
    for seed in seeds:
        distinct.setdefault(np.round(seed, 6).tobytes(), seed)
    return np.stack(list(distinct.values()))


def _is_slow(lift: Lift, robot: Robot) -> bool:
    return abs(lift.highest - lift.lowest) > LONG * robot.limits[lift.joint].speed


def lift_of(chain: Chain, torso: str | None) -> Lift | None:
    """Describe how a torso joint lifts a chain; None if it does not, or not straight up."""
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
"""Candidates for a carrying posture: distances of the hand in front of the base's axis [m]."""
ASIDE = (0.0, 0.1, 0.2, 0.3)
"""Distances of the hand from the sagittal plane, on the arm's own side [m]."""
ABOVE = np.arange(-0.5, 0.7, 0.15)
"""Heights of the hand above the shoulder [m]."""
INWARDS = (0.0, 0.6, 1.2)
"""Angles by which the hand points inwards, across the robot [rad]."""
HEIGHT = -0.2
"""Preferred height of the hand above the shoulder [m]."""
NARROWER = 0.05
"""Robots whose radii differ by less are equally narrow: then the height decides [m]."""
LOWEST = 0.3
"""Least height of the hand above the floor [m]."""
SEEDS = 6
"""Number of random seeds for inverse kinematics, besides the middle of the joint limits."""
RANDOM_POSTURES = 100
"""Number of random postures to try as well if no level one is free of contact."""
TORSO = 0.3
"""Height of the torso as a fraction of its range."""
ORIGIN = (0.0, 0.0, 0.0)
"""Base pose in the world of the search."""


def with_carrying(
    robot: Robot,
    held: Mapping[str, Hold] = MappingProxyType({}),
    scene: Scene = NOTHING,
    report: Report = unreported,
) -> Robot:
    """Add a carrying posture to a robot: free of contact, hands level, as narrow as possible.

    ``held`` are the objects of a scene that it holds. A robot that has a carrying posture keeps it unless they touch
    something there. ``report`` receives the progress of the search.
    """
    if (CARRYING in robot.postures and not held) or not robot.arms:
        return robot
    world = PlanningWorld(Scene(tuple(map(scene.body, held))), robot.body())
    mirror, state = WorldMirror(world, robot.name), world.world_state(robot.name).gripping(held)
    try:
        if CARRYING in robot.postures and not mirror.at(state).contacts():
            return robot
        joints: dict[str, float] = {}
        if robot.torso is not None:
            low, high = world.robot.limits[robot.torso]
            torso = read_urdf(robot.urdf).joint(robot.torso)
            joints[robot.torso] = low + TORSO * (high - low) if torso.kind == "prismatic" else torso.nearest(0.0)
        start = state.robots[robot.name]
        for arm in robot.arms:
            joints |= _best(robot, arm, joints, mirror, state, partial(report, f"carrying posture: {arm.name} arm"))
            report("", 1.0)
            if arm.gripper is not None:  # the other arms keep clear of this hand, opened, too
                state = state.with_robot(robot.name, Configuration(ORIGIN, {**start.joints, **arm.gripper.opened}))
                start = state.robots[robot.name]
    finally:
        world.close()
    assumption = note(
        "B010",
        f"{robot.name} has no posture for driving; one with level hands close to the body is used",
        help="state one under [postures.carrying] of a robot file (TOML)",
    )
    return replace(robot, postures={**robot.postures, CARRYING: joints}, diagnostics=(*robot.diagnostics, assumption))


def _best(
    robot: Robot, arm: Arm, fixed: Mapping[str, float], mirror: WorldMirror, state: WorldState, share: Share
) -> dict[str, float]:
    """Find joint values of an arm, others fixed: the least penetration, then the narrowest, then the best height."""
    world = mirror.at(state)
    chain = Chain.from_urdf(robot.urdf, robot.base_link, arm.tip, locked=fixed)
    rng = np.random.default_rng(0)
    candidates = _level(arm, chain, world, fixed, rng)
    free = {**state.robots[robot.name].joints, **(arm.gripper.opened if arm.gripper is not None else {})}
    shoulder = world.link_pose(arm.base_link, Configuration(ORIGIN, fixed)).position[2]
    best: tuple[tuple[float, float, float], dict[str, float]] | None = None
    for rows in (candidates, chain.sample(rng, RANDOM_POSTURES)):
        for number, row in enumerate(rows):
            share(number / len(rows))
            joints = dict(zip(chain.names, map(float, row), strict=True))
            world = mirror.at(state.with_robot(robot.name, Configuration(ORIGIN, {**free, **fixed, **joints})))
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
    """Sample joint values (n, d) with the hand level, so that a held object stays upright."""
    shoulder = world.link_pose(arm.base_link, Configuration(ORIGIN, fixed)).position[2]
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
    q, ok = chain.solve(np.stack(targets), np.repeat(seeds[None], len(targets), axis=0))
    solutions: Array = q[ok]
    return solutions


def _target(arm: Arm, position: tuple[float, float, float], heading: float) -> Array:
    """Compute the pose (4, 4) of a tip whose approach and closing axes are horizontal, with a heading [rad]."""
    ahead = np.array([np.cos(heading), np.sin(heading), 0.0])
    across = np.array([-np.sin(heading), np.cos(heading), 0.0])
    in_base = np.column_stack([ahead, across, np.cross(ahead, across)])
    tip = np.column_stack([arm.approach, arm.closing, np.cross(arm.approach, arm.closing)])
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = product(in_base, tip.T), position
    return pose
