"""A posture to drive in, for robots about which nobody says one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from executive.motion import Chain, InverseKinematics
from executive.robots.robot import CARRYING, Arm, Robot
from planlang.diagnostics import note
from planlang.geometry import Array
from planlang.geometry.matrices import product
from planlang.protocols import Configuration
from sim import PlanningWorld, Scene

AHEAD = np.arange(0.25, 0.75, 0.1)
"""How far ahead of the base's axis the hand may be [m]."""
ASIDE = (0.0, 0.1, 0.2, 0.3)
"""How far from the middle, on the arm's own side [m]."""
ABOVE = np.arange(-0.5, 0.7, 0.15)
"""How far above the shoulder [m]."""
INWARDS = (0.0, 0.6, 1.2)
"""By how much the hand may point across the robot [rad]."""
HEIGHT = -0.2
"""Height of a hand above the shoulder that is wished for [m]."""
NARROWER = 0.05
"""Differences of width that count [m]."""
LOWEST = 0.3
"""Least height of a hand above the floor [m]."""
SEEDS = 6
STRAY = 100
"""Postures at random that are looked at as well, if the hand is level in none."""
TORSO = 0.3
"""Where in its range the torso is."""
HERE = (0.0, 0.0, 0.0)


def with_carrying(robot: Robot) -> Robot:
    """The robot, with a carrying posture if it has none: no contact with itself, hands level, as narrow as possible."""
    if CARRYING in robot.postures or not robot.arms:
        return robot
    world = PlanningWorld(Scene(()), robot.body())
    try:
        joints: dict[str, float] = {}
        if robot.torso is not None:
            low, high = world.robot.limits[robot.torso]
            joints[robot.torso] = low + TORSO * (high - low)
        for arm in robot.arms:
            joints |= _best(robot, arm, joints, world)
    finally:
        world.close()
    said = note(
        "B010",
        f"{robot.name} has no posture to drive in; one with level hands close to the body is used",
        help="a robot file (TOML) says one under [postures.carrying]",
    )
    return replace(robot, postures={**robot.postures, CARRYING: joints}, diagnostics=(*robot.diagnostics, said))


def _best(robot: Robot, arm: Arm, fixed: Mapping[str, float], world: PlanningWorld) -> dict[str, float]:
    """The joints of an arm, others fixed: least penetration first, then the narrowest, then of a good height."""
    chain = Chain.from_urdf(robot.urdf, robot.base_link, arm.tip, locked=fixed)
    rng = np.random.default_rng(0)
    candidates = _level(arm, chain, world, fixed, rng)
    free = arm.gripper.opened if arm.gripper is not None else {}
    shoulder = world.link_pose(arm.base_link, Configuration(HERE, fixed)).position[2]
    best: tuple[tuple[float, float, float], dict[str, float]] | None = None
    for rows in (candidates, chain.sample(rng, STRAY)):
        for row in rows:
            joints = dict(zip(chain.names, map(float, row), strict=True))
            world.set_configuration(Configuration(HERE, {**fixed, **joints, **free}))
            depth = round(sum(contact.depth for contact in world.contacts(moving=arm.joints)), 3)
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
    """Joint values (n, d) with the hand level, so that what it holds stays upright."""
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
    """The pose (4, 4) of the tip at a place, pointing level into a direction, fingers closing level."""
    ahead = np.array([np.cos(heading), np.sin(heading), 0.0])
    across = np.array([-np.sin(heading), np.cos(heading), 0.0])
    there = np.column_stack([ahead, across, np.cross(ahead, across)])
    tip = np.column_stack([arm.approach, arm.closing, np.cross(arm.approach, arm.closing)])
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = product(there, tip.T), position
    return pose
