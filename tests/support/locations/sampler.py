"""The reference: places for a base by sampling a costmap, as CRAM does it, told about reachability by failing.

Occupancy by rays straight up around the target, widened by the base's radius, times a ring at arm's length; places
drawn from it, facing the target; from each, a few hand poses by inverse kinematics, checked by the oracle.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pybullet

from executive.motion import Chain
from executive.robots import Arm, Robot
from planlang.geometry import Array
from tests.support.locations.oracle import Claim, Oracle, angle, on_the_way
from tests.support.locations.ways import Ways

CELL, CELLS = 0.04, 100
"""Resolution [m] and extent of the costmap around the target."""
RAYS = 10_000
"""Rays in one call; PyBullet loses results beyond 16,000."""
TURNS = (0.0, 0.25, 0.5)
"""How far a base turns from facing the target towards the side of its other arm [rad]."""
GRASPS = (0.0, 0.4, -0.4, 0.8)
"""Directions of a hand relative to facing the target [rad]."""
SEEDS = 5
GRIP, BACK, UP = 0.01, 0.08, 0.05
"""How far above the middle of a thing the grip point is, how far back the pre-grasp, how far up the lift [m]."""

Ik = Callable[[Arm, Array, np.random.Generator], "Iterator[Array]"]
"""Arm, tip poses in the base frame (k, 4, 4), generator -> joint values (k, d) of its chain, several ways."""


@dataclass(frozen=True, slots=True)
class Sampled:
    """The ending of sampling."""

    claim: Claim | None
    samples: int
    seconds: float


@dataclass(frozen=True, slots=True)
class Chains:
    """Chains from base to tip, torso included, and where their shoulders are."""

    robot: Robot
    chains: Mapping[str, Chain]
    reach: float
    """From the axis of the base to the farthest place at arm's length, level [m]."""

    @staticmethod
    def of(robot: Robot) -> Chains:
        """For all arms of a robot."""
        chains = {arm.name: Chain.from_urdf(robot.urdf, robot.base_link, arm.tip) for arm in robot.arms}
        tips = [
            np.hypot(*chain.fk(chain.sample(np.random.default_rng(0), 500))[:, :2, 3].T) for chain in chains.values()
        ]
        return Chains(robot, chains, float(np.quantile(np.concatenate(tips), 0.95)))


def by_levenberg_marquardt(chains: Chains) -> Ik:
    """The product's own inverse kinematics."""

    def solve(arm: Arm, poses: Array, rng: np.random.Generator) -> Iterator[Array]:
        chain = chains.chains[arm.name]
        seeds = np.concatenate([((chain.lower + chain.upper) / 2)[None], chain.sample(rng, SEEDS - 1)])
        for seed in seeds:
            q, ok = chain.solve(poses[1:2], seed[None, None])
            if not ok[0]:
                continue
            others, good = chain.solve(poses[[0, 2]], np.repeat(q[:, None], 2, 0))
            if good.all():
                yield np.stack([others[0], q[0], others[1]])

    return solve


def by_pybullet(chains: Chains, oracle: Oracle) -> Ik:
    """PyBullet's own, restarted until it is within 1 cm and 0.06 rad, as CRAM's predecessor in PyBullet does it."""
    moving = list(oracle.joints)
    low = [max(oracle.limits[name][0], -math.pi) for name in moving]
    high = [min(oracle.limits[name][1], math.pi) for name in moving]
    span = [b - a for a, b in zip(low, high, strict=True)]
    rest = [(a + b) / 2 for a, b in zip(low, high, strict=True)]

    def one(arm: Arm, pose: Array, start: Array, rng: np.random.Generator) -> Array | None:
        names = chains.chains[arm.name].names
        tip = oracle.links[arm.tip]
        for attempt in range(3):
            q = start if attempt == 0 else chains.chains[arm.name].sample(rng, 1)[0]
            for _ in range(6):
                oracle.place((0.0, 0.0, 0.0), dict(zip(names, map(float, q), strict=True)))
                found = pybullet.calculateInverseKinematics(
                    oracle.uid, tip, pose[:3, 3].tolist(), _quaternion(pose), lowerLimits=low, upperLimits=high,
                    jointRanges=span, restPoses=rest, maxNumIterations=60, residualThreshold=1e-4,
                    physicsClientId=oracle.client,
                )  # fmt: skip
                values = dict(zip(moving, found, strict=True))
                q = np.array([min(max(values[n], oracle.limits[n][0]), oracle.limits[n][1]) for n in names])
                oracle.place((0.0, 0.0, 0.0), dict(zip(names, map(float, q), strict=True)))
                frame = oracle.link(arm.tip)
                away = np.linalg.norm(frame[:3, 3] - pose[:3, 3])
                if away < 0.01 and angle(frame[:3, :3], pose[:3, :3]) < 0.06:
                    return q
        return None

    def solve(arm: Arm, poses: Array, rng: np.random.Generator) -> Iterator[Array]:
        oracle.place((0.0, 0.0, 0.0), oracle.posture)
        chain = chains.chains[arm.name]
        q: Array | None = (chain.lower + chain.upper) / 2
        ways: dict[int, Array] = {}
        for index in (1, 0, 2):
            q = one(arm, poses[index], ways.get(1, q), rng) if q is not None else None
            if q is None:
                return
            ways[index] = q
        yield np.stack([ways[0], ways[1], ways[2]])

    return solve


def sample(oracle: Oracle, chains: Chains, ik: Ik, target: str, *, samples: int, seed: int = 0) -> Sampled:
    """Draw places until one is found from which the target can be grasped, or ``samples`` have failed."""
    began, looked = time.process_time(), 0.0  # looking is not counted: what samplers would do about it is open
    rng, robot = np.random.default_rng(seed), chains.robot
    centre = np.array(oracle.room.body(target).pose.position)
    x, y, weight = _costmap(oracle, chains, centre)
    if weight.sum() == 0:
        return Sampled(None, 0, time.process_time() - began)
    picks = rng.choice(weight.size, samples, p=weight / weight.sum())
    hands, ways = {arm.name: oracle.fingers(arm.name) for arm in robot.arms}, Ways(oracle)
    for number, pick in enumerate(picks, 1):
        bx, by = float(x[pick]), float(y[pick])
        facing = math.atan2(centre[1] - by, centre[0] - bx)
        turn = float(rng.choice(TURNS))
        for arm in robot.arms:
            base = (bx, by, facing + (-turn if arm.side == "left" else turn))
            oracle.place(base, oracle.posture)
            if oracle.touched():
                continue
            for grasp in GRASPS:
                poses = grasp_poses(arm, centre + np.array([0.0, 0.0, GRIP]), facing + grasp)
                for values in ik(arm, _inverse(base) @ poses, rng):
                    opened = arm.gripper.opened if arm.gripper is not None else {}
                    claim = Claim(base, arm.name, chains.chains[arm.name].names, values, poses, target, opened)
                    if _is_free(oracle, claim, hands[arm.name]):
                        seconds = time.process_time() - began - looked
                        if ways.lead_to(base) and oracle.sees(base, target):
                            return Sampled(claim, number, seconds)
                        looked = time.process_time() - began - seconds
    return Sampled(None, samples, time.process_time() - began - looked)


def grasp_poses(arm: Arm, grip: Array, yaw: float, pitch: float = 0.0, roll: float = 1.0) -> Array:
    """Pre-grasp, grasp and lift (3, 4, 4) of a hand that comes from the direction of ``yaw``, ``pitch`` down."""
    approach = np.array([math.cos(yaw) * math.cos(pitch), math.sin(yaw) * math.cos(pitch), -math.sin(pitch)])
    closing = roll * np.array([-math.sin(yaw), math.cos(yaw), 0.0])
    return hand_poses(arm, [grip - BACK * approach, grip, grip + np.array([0.0, 0.0, UP])], approach, closing)


def hand_poses(arm: Arm, grips: Sequence[Array], approach: Array, closing: Array) -> Array:
    """Poses (k, 4, 4) of a hand with its grip point at some points, that comes and closes along unit vectors (3,)."""
    poses = np.tile(np.eye(4), (len(grips), 1, 1))
    poses[:, :3, :3] = _frame(approach, closing) @ _frame(np.array(arm.approach), np.array(arm.closing)).T
    poses[:, :3, 3] = grips
    return poses


def _frame(first: Array, second: Array) -> Array:
    return np.stack([first, second, np.cross(first, second)], axis=1)


def _inverse(base: tuple[float, float, float]) -> Array:
    x, y, yaw = base
    c, s = math.cos(yaw), math.sin(yaw)
    return np.array([[c, s, 0, -c * x - s * y], [-s, c, 0, s * x - c * y], [0, 0, 1, 0], [0, 0, 0, 1]], float)


def _quaternion(pose: Array) -> list[float]:
    from planlang.geometry import Pose

    return list(Pose.from_matrix(pose).orientation)


def _is_free(oracle: Oracle, claim: Claim, hand: frozenset[int]) -> bool:
    for values in (*claim.values, *on_the_way(claim.values)):
        oracle.place(
            claim.base, {**oracle.posture, **claim.fingers, **dict(zip(claim.joints, map(float, values), strict=True))}
        )
        if oracle.touched(hand, claim.target):
            return False
    return oracle.comes_straight(claim)


def _costmap(oracle: Oracle, chains: Chains, centre: Array) -> tuple[Array, Array, Array]:
    """Cells around the target and their weight, (n,) each."""
    steps = (np.arange(CELLS) - CELLS / 2) * CELL
    x, y = (grid.ravel() for grid in np.meshgrid(centre[0] + steps, centre[1] + steps, indexing="ij"))
    low = np.stack([x, y, np.full(len(x), 0.005)], 1)
    high = low + np.array([0.0, 0.0, 1.3])
    oracle.place((50.0, 50.0, 0.0), {})
    hits = []
    for first in range(0, len(low), RAYS):
        part = slice(first, first + RAYS)
        hits += pybullet.rayTestBatch(low[part].tolist(), high[part].tolist(), physicsClientId=oracle.client)
    taken = np.array([hit[0] >= 0 for hit in hits], float).reshape(CELLS, CELLS)
    keep = int(chains.robot.base.radius / CELL) + 1
    sums = np.pad(np.pad(taken, keep, constant_values=1).cumsum(0).cumsum(1), ((1, 0), (1, 0)))
    width = 2 * keep + 1
    around = sums[width:, width:] - sums[:-width, width:] - sums[width:, :-width] + sums[:-width, :-width]
    ring = np.exp(-0.5 * ((np.hypot(x - centre[0], y - centre[1]) - 0.84 * chains.reach) / (0.2 * chains.reach)) ** 2)
    inside = (np.abs(x) < 3.0) & (np.abs(y) < 2.5)
    return x, y, (around.ravel() == 0) * ring * inside
