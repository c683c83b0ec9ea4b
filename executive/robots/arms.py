"""Arms of a bound robot as location resolving and motion planning need them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from executive.locations import ArmModel, HandFrame
from executive.locations.reachability_building import lift_of
from executive.motion import Chain, Gaze, InverseKinematics
from executive.motion.urdf import Joint, displacement, joints_between, read_joints
from executive.robots import Arm, Robot
from planlang.geometry import Array
from planlang.geometry.matrices import product
from planlang.protocols import Configuration
from sim import PyBulletWorld

SAMPLES = 400
"""Random configurations from which the length of an arm is measured."""
TURN_STEP, SLIDE_STEP = 0.08, 0.02
"""Steps in which motions of turning and sliding joints are checked [rad], [m]."""


def arm_models(robot: Robot, world: PyBulletWorld) -> tuple[ArmModel, ...]:
    """All arms of a robot, in its order; ``world`` tells which links belong to a hand."""
    return tuple(_model(robot, arm, world) for arm in robot.arms)


def gaze_of(robot: Robot) -> Gaze | None:
    """How to point the camera; None for a robot without one."""
    if robot.camera is None:
        return None
    posture = robot.postures.get("carrying", {})
    joints = joints_between(read_joints(robot.urdf), robot.base_link, robot.camera.link)
    still = {joint.name: posture.get(joint.name, 0.0) for joint in joints if joint.kind != "fixed"}
    if not robot.neck:
        return Gaze.fixed(_pose(joints, still), robot.camera.forward)
    still = {name: value for name, value in still.items() if name not in robot.neck}
    return Gaze(robot.urdf, robot.base_link, robot.camera.link, robot.neck, robot.camera.forward, still=still)


def _pose(joints: Sequence[Joint], positions: Mapping[str, float]) -> Array:
    """Pose (4, 4) of the last joint's child in the first joint's parent."""
    pose = np.eye(4)
    for joint in joints:
        pose = product(pose, joint.origin)
        if joint.name in positions:
            pose = product(pose, displacement(joint, positions[joint.name]))
    return pose


def _model(robot: Robot, arm: Arm, world: PyBulletWorld) -> ArmModel:
    chain = Chain.from_urdf(robot.urdf, robot.base_link, arm.tip)
    middle = np.clip((chain.lower + chain.upper) / 2, -np.pi, np.pi)
    seeds = [middle]
    for posture in robot.postures.values():
        seeds.append(np.array([posture.get(name, value) for name, value in zip(chain.names, middle, strict=True)]))
    low, high = _shoulders(robot, arm, chain, world)
    tips = chain.fk(chain.sample(np.random.default_rng(0), SAMPLES))[:, :3, 3]
    shoulders = np.repeat(((low + high) / 2)[None], SAMPLES, 0)
    shoulders[:, 2] = np.clip(tips[:, 2], low[2], high[2])
    return ArmModel(
        name=arm.name,
        joints=chain.names,
        lower=chain.lower,
        upper=chain.upper,
        solver=InverseKinematics(chain),
        resolution=np.where(chain.prismatic, SLIDE_STEP, TURN_STEP),
        frame=HandFrame(arm.approach, arm.closing),
        max_opening=arm.gripper.max_opening if arm.gripper is not None else 0.0,
        hand_links=world.robot.hand_links(arm.tip),
        hand_radius=world.robot.hand_radius(arm.tip, arm.approach),
        hand_corners=world.robot.hand_corners(arm.tip),
        shoulder_low=low,
        shoulder_high=high,
        reach=1.02 * float(np.linalg.norm(tips - shoulders, axis=1).max()),
        seeds=_distinct(seeds),
        lift=lift_of(chain, robot.torso),
    )


def _shoulders(robot: Robot, arm: Arm, chain: Chain, world: PyBulletWorld) -> tuple[Array, Array]:
    """Where the arm begins, in the base frame, at the lowest and the highest posture of what carries it."""
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
