"""A judge of answers that there is no place: base poses drawn uniformly, and inverse kinematics of its own.

Nothing of the product's search, maps, kinematics or checks is used: the chain is read from the URDF here, solved by
damped least squares from random postures, and PyBullet (:class:`Oracle`) looks at the rest. What it finds has to stand
up to more than an answer has to: nothing is pressed into anything by more than 0.5 mm, and the fingers can close.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from executive.robots import Arm
from planlang.geometry import Array
from tests.support.locations.oracle import PRESSED, BasePose, Claim, Oracle, on_the_way
from tests.support.locations.sampler import UP, grasp_poses
from tests.support.locations.ways import Ways

YAWS, HEIGHTS = 180, (0.0, -0.01, 0.01, 0.025, 0.04)
"""Directions of the hand, and heights of the grip over the middle of the target [m]."""
PITCHES = (0.0, 0.4, 0.8, math.pi / 2)
"""Tilts of the hand [rad]; from the side there is the first alone."""
DRAWN, RESTARTS = 12_000, 3
"""Base poses for each arm, each with one of the hand's poses, and random postures that each is solved from."""
STEPS, DAMPING, LARGEST = 40, 0.02, 0.5
"""Of damped least squares: steps, damping, and the largest move of a joint in one [rad, m]."""
NEAR, TURNED = 1e-3, 5e-3
"""Distance [m] and angle [rad] from the target within which a posture reaches it."""
CLOSING = 10
"""Postures of the closing fingers that are looked at."""
VIEWS = 60
"""Base poses from which it is looked for the target, if it is not seen from where it is grasped."""


@dataclass(frozen=True, slots=True)
class Joints:
    """A chain read from a URDF: for each joint its origin (4, 4), axis (3,), whether it slides, and its column (-1)."""

    origins: Array
    axes: Array
    slides: NDArray[np.bool_]
    columns: tuple[int, ...]
    names: tuple[str, ...]
    lower: Array
    upper: Array

    @staticmethod
    def read(urdf: Path, base: str, tip: str, limits: Mapping[str, tuple[float, float]]) -> Joints:
        """Read the chain from one link to another; ``limits`` of the joints that move."""
        above = {_of(joint, "child", "link"): joint for joint in ElementTree.parse(urdf).getroot().iter("joint")}
        chain = []
        while tip != base:
            chain.append(above[tip])
            tip = _of(chain[-1], "parent", "link")
        chain.reverse()
        names = tuple(joint.get("name", "") for joint in chain if joint.get("type") != "fixed")
        columns = tuple(names.index(n) if (n := joint.get("name", "")) in names else -1 for joint in chain)
        axes = np.array([_numbers(joint.find("axis"), "xyz", "1 0 0") for joint in chain])
        ends = np.clip(np.array([limits[name] for name in names]), -math.pi, math.pi)
        return Joints(
            np.array([_origin(joint) for joint in chain]),
            axes / np.maximum(np.linalg.norm(axes, axis=1), 1e-9)[:, None],
            np.array([joint.get("type") == "prismatic" for joint in chain]),
            columns,
            names,
            ends[:, 0],
            ends[:, 1],
        )

    def held(self, values: Mapping[str, float]) -> Joints:
        """Return the chain with some of its joints held at values."""
        lower = [values.get(name, one) for name, one in zip(self.names, self.lower, strict=True)]
        upper = [values.get(name, one) for name, one in zip(self.names, self.upper, strict=True)]
        return replace(self, lower=np.array(lower), upper=np.array(upper))

    def forward(self, q: Array) -> tuple[Array, Array]:
        """Return tip poses (n, 4, 4) and Jacobians (n, 6, d) at joint values (n, d)."""
        pose, places, axes = np.tile(np.eye(4), (len(q), 1, 1)), [], []
        for origin, axis, slides, column in zip(self.origins, self.axes, self.slides, self.columns, strict=True):
            pose = pose @ origin
            if column < 0:
                continue
            places.append(pose[:, :3, 3].copy())
            axes.append(pose[:, :3, :3] @ axis)
            move = np.tile(np.eye(4), (len(q), 1, 1))
            if slides:
                move[:, :3, 3] = q[:, column, None] * axis
            else:
                move[:, :3, :3] = _turns(axis, q[:, column])
            pose = pose @ move
        along = np.array(axes).transpose(1, 2, 0)
        arms = pose[:, :3, 3, None] - np.array(places).transpose(1, 2, 0)
        slid = np.array([slides for slides, column in zip(self.slides, self.columns, strict=True) if column >= 0])
        jacobian = np.zeros((len(q), 6, len(self.names)))
        jacobian[:, :3] = np.where(slid, along, crossed(along, arms))
        jacobian[:, 3:] = np.where(slid, 0.0, along)
        return pose, jacobian

    def solve(self, targets: Array, q: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Return joint values (n, d) for targets (n, 4, 4), from others, and which of them reach these."""
        q, reached, left = q.copy(), np.zeros(len(q), bool), np.arange(len(q))
        moving = self.lower < self.upper  # what is held takes no part of a step
        for _ in range(STEPS):
            pose, jacobian = self.forward(q[left])
            error = _error(pose, targets[left])
            done = (np.linalg.norm(error[:, :3], axis=1) < NEAR) & (np.linalg.norm(error[:, 3:], axis=1) < TURNED)
            reached[left[done]] = True
            left, jacobian, error = left[~done], jacobian[~done] * moving, error[~done]
            if not len(left):
                break
            square = jacobian @ jacobian.transpose(0, 2, 1) + DAMPING**2 * np.eye(6)
            step = (jacobian.transpose(0, 2, 1) @ np.linalg.solve(square, error[:, :, None]))[:, :, 0]
            q[left] = np.clip(q[left] + np.clip(step, -LARGEST, LARGEST), self.lower, self.upper)
        return q, reached


def crossed(one: Array, other: Array) -> Array:
    """Return the cross products of vectors (n, 3, d)."""
    (a, b, c), (x, y, z) = one.transpose(1, 0, 2), other.transpose(1, 0, 2)
    return np.stack([b * z - c * y, c * x - a * z, a * y - b * x], axis=1)


def refutation(oracle: Oracle, target: str, *, side: bool, drawn: int = DRAWN, seed: int = 0) -> Claim | None:
    """Return a way to grasp the target that shows that there is a place; None if none of those drawn is one."""
    rng, ways = np.random.default_rng(seed), Ways(oracle)
    for arm in oracle.robot.arms:
        chain = Joints.read(oracle.robot.urdf, oracle.robot.base_link, arm.tip, oracle.limits)
        hands = _free_hands(oracle, arm, chain, target, PITCHES[:1] if side else PITCHES)
        if not len(hands):
            continue
        centre = np.array(oracle.room.body(target).pose.position)
        tips = chain.forward(rng.uniform(chain.lower, chain.upper, (2000, len(chain.names))))[0][:, :2, 3]
        away = 1.05 * float(np.linalg.norm(tips, axis=1).max()) * np.sqrt(rng.uniform(0.0, 1.0, drawn))
        bearing, yaw = rng.uniform(-math.pi, math.pi, (2, drawn))
        bases = np.column_stack([centre[0] + away * np.cos(bearing), centre[1] + away * np.sin(bearing), yaw])
        bases = bases[(np.abs(bases[:, 0]) < 3.0) & (np.abs(bases[:, 1]) < 2.5)]
        chosen = hands[rng.integers(len(hands), size=len(bases))]
        back = np.array([_inverse(base) for base in bases]).reshape(-1, 4, 4)
        for _ in range(RESTARTS):
            begun = rng.uniform(chain.lower, chain.upper, (len(bases), len(chain.names)))
            q, good = chain.solve(back @ chosen[:, 1], begun)
            for row in np.flatnonzero(good):
                x, y, turn = bases[row].tolist()
                claim = _claim(oracle, ways, arm, chain, (x, y, turn), chosen[row], q[row], target)
                if claim is not None and _is_seen(oracle, ways, claim, target, rng):
                    return claim
    return None


def _free_hands(oracle: Oracle, arm: Arm, chain: Joints, target: str, pitches: Sequence[float]) -> Array:
    """Return pre-grasp, grasp and lift (h, 3, 4, 4) of hands that, without their arm, touch nothing there."""
    if arm.gripper is not None and min(oracle.room.body(target).size[:2]) > arm.gripper.max_opening:
        return np.zeros((0, 3, 4, 4))
    middle = (chain.lower + chain.upper) / 2
    back = np.linalg.inv(chain.forward(middle[None])[0][0])
    joints = {**dict(zip(chain.names, middle.tolist(), strict=True)), **_opened(arm)}
    centre, found = np.array(oracle.room.body(target).pose.position), []
    for pitch in pitches:
        for height in HEIGHTS:
            for turn in np.arange(YAWS) * 2 * math.pi / YAWS:
                for roll in (1.0, -1.0):
                    poses = grasp_poses(arm, centre + np.array([0.0, 0.0, height]), float(turn), pitch, roll)
                    if all(oracle.hand_alone_is_free(arm.name, joints, pose @ back, target) for pose in poses):
                        found.append(poses)
    return np.array(found).reshape(-1, 3, 4, 4)


def _claim(
    oracle: Oracle, ways: Ways, arm: Arm, chain: Joints, base: BasePose, poses: Array, q: Array, target: str
) -> Claim | None:
    """Return the whole way from one solution of its grasp, if nothing of it is pressed into anything."""
    claim = way_from(oracle, ways, arm, chain, base, poses, q, target)
    if claim is None:
        return None
    closed = arm.gripper.closed if arm.gripper is not None else {}
    for share in np.linspace(0.0, 1.0, CLOSING + 1)[1:].tolist():
        fingers = {name: (1.0 - share) * value + share * closed[name] for name, value in claim.fingers.items()}
        if not _is_free(oracle, arm, chain, base, q, fingers, target):
            return None
    return claim if oracle.objection(claim) is None else None


def way_from(
    oracle: Oracle,
    ways: Ways,
    arm: Arm,
    chain: Joints,
    base: BasePose,
    poses: Array,
    q: Array,
    target: str | None,
    aside: Mapping[str, float] = MappingProxyType({}),
) -> Claim | None:
    """Return a way of an arm, fingers opened, through poses (k, 4, 4), the second of which joints (d,) reach.

    Meanwhile other joints are ``aside``. None if the base cannot get there, or anything is pressed into anything but
    fingers into the target.
    """
    opened = {**_opened(arm), **aside}
    if not _is_free(oracle, arm, chain, base, q, opened, target):
        return None
    oracle.place(base, oracle.posture)
    if oracle.touched(depth=PRESSED) is not None or not ways.lead_to(base):
        return None
    rest = [0, *range(2, len(poses))]
    others, good = chain.solve(_inverse(base) @ poses[rest], np.tile(q, (len(rest), 1)))
    if not good.all() or not all(_is_free(oracle, arm, chain, base, one, opened, target) for one in others):
        return None
    values = np.insert(others, 1, q, axis=0)
    between = on_the_way(values)
    if np.abs(np.diff(values, axis=0)).max() > 1.0:
        return None
    if not all(_is_free(oracle, arm, chain, base, one, opened, target) for one in between):
        return None
    return Claim(base, arm.name, chain.names, values, poses, target, opened)


def way_of_two(
    oracle: Oracle,
    ways: Ways,
    base: BasePose,
    hands: Sequence[tuple[Arm, Joints, Array, Array]],
    target: str,
) -> bool:
    """Return whether two arms get, fingers opened, to their poses at a target and lift it together.

    Each has its chain, its poses (k, 4, 4), of which the joints (d,) reach the second, and these joints.
    """
    oracle.place(base, oracle.posture)
    if oracle.touched(depth=PRESSED) is not None or not ways.lead_to(base):
        return False
    steps: list[dict[str, float]] = [{} for _ in (0, 1, 2)]
    may: frozenset[int] = frozenset()
    for arm, chain, poses, q in hands:
        raised = poses[1].copy()
        raised[2, 3] += UP
        others, good = chain.solve(_inverse(base) @ np.array([poses[0], raised]), np.tile(q, (2, 1)))
        if not good.all() or np.abs(others - q).max() > 1.0:
            return False
        for step, values in zip(steps, (others[0], q, others[1]), strict=True):
            step |= {**_opened(arm), **dict(zip(chain.names, values.tolist(), strict=True))}
        may |= oracle.fingers(arm.name)
    for step in steps:
        oracle.place(base, {**oracle.posture, **step})
        if oracle.touched(may, target, depth=PRESSED) is not None:
            return False
    return True


def _is_free(
    oracle: Oracle,
    arm: Arm,
    chain: Joints,
    base: BasePose,
    values: Array,
    fingers: Mapping[str, float],
    target: str | None,
) -> bool:
    joints = dict(zip(chain.names, values.tolist(), strict=True))
    oracle.place(base, {**oracle.posture, **fingers, **joints})
    return oracle.touched(oracle.fingers(arm.name), target, depth=PRESSED) is None


def _is_seen(oracle: Oracle, ways: Ways, claim: Claim, target: str, rng: np.random.Generator) -> bool:
    """Return whether the target is seen from where it is grasped, or from elsewhere before."""
    if oracle.sees(claim.base, target):
        return True
    for _ in range(VIEWS):
        x, y = rng.uniform(-2.6, 2.6), rng.uniform(-2.1, 2.1)
        centre = oracle.room.body(target).pose.position
        base = (float(x), float(y), math.atan2(centre[1] - y, centre[0] - x))
        oracle.place(base, oracle.posture)
        if oracle.touched(itself=False) is None and ways.lead_to(base) and oracle.sees(base, target):
            return True
    return False


def _opened(arm: Arm) -> dict[str, float]:
    return dict(arm.gripper.opened) if arm.gripper is not None else {}


def _error(pose: Array, target: Array) -> Array:
    """Return how far tips (n, 4, 4) are from their targets: shifts [m] above rotation vectors [rad], (n, 6)."""
    turn = target[:, :3, :3] @ pose[:, :3, :3].transpose(0, 2, 1)
    axis = np.stack([turn[:, 2, 1] - turn[:, 1, 2], turn[:, 0, 2] - turn[:, 2, 0], turn[:, 1, 0] - turn[:, 0, 1]], 1)
    angle = np.arccos(np.clip((np.trace(turn, axis1=1, axis2=2) - 1) / 2, -1.0, 1.0))
    length = np.linalg.norm(axis, axis=1)
    vector = axis * (angle / np.maximum(length, 1e-9))[:, None]
    return np.concatenate([target[:, :3, 3] - pose[:, :3, 3], vector], axis=1)


def _turns(axis: Array, angles: Array) -> Array:
    """Return rotations (n, 3, 3) about an axis (3,)."""
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    sine, cosine = np.sin(angles)[:, None, None], np.cos(angles)[:, None, None]
    return np.eye(3) + sine * cross + (1.0 - cosine) * (cross @ cross)


def _of(joint: ElementTree.Element, tag: str, name: str) -> str:
    found = joint.find(tag)
    return "" if found is None else found.get(name, "")


def _numbers(element: ElementTree.Element | None, name: str, usual: str) -> list[float]:
    return [float(text) for text in (usual if element is None else element.get(name, usual)).split()]


def _origin(joint: ElementTree.Element) -> Array:
    found, pose = joint.find("origin"), np.eye(4)
    roll, pitch, yaw = _numbers(found, "rpy", "0 0 0")
    x, y, z = np.eye(3)
    pose[:3, :3] = _turns(z, np.array([yaw]))[0] @ _turns(y, np.array([pitch]))[0] @ _turns(x, np.array([roll]))[0]
    pose[:3, 3] = _numbers(found, "xyz", "0 0 0")
    return pose


def _inverse(base: BasePose | Array) -> Array:
    x, y, yaw = (float(value) for value in base)
    c, s = math.cos(yaw), math.sin(yaw)
    return np.array([[c, s, 0, -c * x - s * y], [-s, c, 0, s * x - c * y], [0, 0, 1, 0], [0, 0, 0, 1]], float)
