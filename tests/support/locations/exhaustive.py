"""Rooms without answer: each is searched through on a finer grid than any resolver would, or found possible after all.

Grasps first: those whose hand alone, in the air, touches nothing at pre-grasp, grasp and lift and in between. Then for
each of them every base of a grid around the target, several solutions of inverse kinematics for each, and the oracle's
check; the target must be seen from the base, too. Found is what presses nothing into anything; where the oracle, who
lets 2 mm pass, would confirm a way only because of these, that is told.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from planlang.geometry import Array
from tests.support.locations.oracle import PRESSED, BasePose, Claim, Oracle, on_the_way, straight
from tests.support.locations.sampler import Chains, grasp_poses
from tests.support.locations.ways import Ways

CELL, HEADINGS = 0.04, 24
"""Distance of the places for the base [m], headings at each."""
YAWS, PITCHES, HEIGHTS = 48, (0.0, 0.4, 0.8, math.pi / 2), (0.0, 0.01, -0.01)
"""Directions and tilts of the hand [rad], heights of the grip over the middle of the target [m]: at most 1 cm."""
POSTURES, ENOUGH = 8, 3
"""Postures that inverse kinematics is started from, and after how many a hand pose without solution is given up."""
CHUNK = 4096
VOXEL, SAMPLES = 0.05, 200_000
"""Resolution of the space that an arm's tip gets to at all [m], random postures it is known from."""
LONGEST = 90.0
"""CPU time after which a search ends without verdict [s]."""


@dataclass(frozen=True, slots=True)
class Verdict:
    """The verdict of the search: ``claim`` is a way that was found; else the stage at which nothing was left."""

    claim: Claim | None
    grasps: int
    bases: int
    reachable: int
    finished: bool = True
    pressed: tuple[str, str] | None = None
    """One link and what it is in, if there was a way only with something pressed in by up to 2 mm."""

    @property
    def text(self) -> str:
        """For the table."""
        if self.claim is not None:
            return "missed"
        if not self.finished:
            return f"nothing found among {self.reachable} reachable hand poses before the time was over"
        if not self.grasps:
            return "infeasible: no hand gets there"
        if not self.bases:
            return "infeasible: no room for the base"
        if not self.reachable:
            return "infeasible: out of reach from where there is room"
        if self.pressed is not None:
            return f"infeasible: only with {self.pressed[0]} pressed into {self.pressed[1]}"
        return "infeasible: the arm always collides"


def search(oracle: Oracle, chains: Chains, target: str) -> Verdict:
    """Search a room through for a way to grasp the target from where the base can drive to."""
    began, rng = time.process_time(), np.random.default_rng(0)
    centre = np.array(oracle.room.body(target).pose.position)
    bases, ways = _bases(oracle, chains, centre), Ways(oracle)
    grasps = reachable = 0
    pressed: tuple[str, str] | None = None
    for arm in oracle.robot.arms:
        chain = chains.chains[arm.name]
        hand = oracle.fingers(arm.name)
        opened = dict(arm.gripper.opened) if arm.gripper is not None else {}
        postures = np.concatenate([((chain.lower + chain.upper) / 2)[None], chain.sample(rng, POSTURES - 1)])
        inverses = np.array([_inverse(base) for base in bases]).reshape(-1, 4, 4)
        space = _Space(chain.fk(chain.sample(rng, SAMPLES))[:, :3, 3])
        for poses in _grasps(oracle, chains, arm.name, centre, target):
            grasps += 1
            near = np.flatnonzero(np.all([space.has((inverses @ pose)[:, :3, 3]) for pose in poses], axis=0))
            for first in range(0, len(near), CHUNK):
                places = near[first : first + CHUNK]
                goals = inverses[places] @ poses[1]
                solved = np.zeros(len(places), bool)
                for number, posture in enumerate(postures):
                    left = np.flatnonzero(solved) if number >= ENOUGH else np.arange(len(places))
                    if not len(left):
                        break
                    q, ok = chain.solve(goals[left], np.tile(posture, (len(left), 1, 1)))
                    solved[left] |= ok
                    for index in np.flatnonzero(ok):
                        base = bases[places[left[index]]]
                        if not ways.lead_to(base):
                            continue
                        reachable += 1
                        claim = _complete(oracle, chains, arm.name, base, poses, q[index], hand, opened, target)
                        if claim is not None:
                            deepest = _pressed(oracle, claim, hand, opened)
                            if deepest is None:
                                return Verdict(claim, grasps, len(bases), reachable)
                            pressed = pressed or deepest
                    if time.process_time() - began > LONGEST:
                        return Verdict(None, grasps, len(bases), reachable, False, pressed)
    return Verdict(None, grasps, len(bases), reachable, pressed=pressed)


def _pressed(oracle: Oracle, claim: Claim, hand: frozenset[int], opened: dict[str, float]) -> tuple[str, str] | None:
    """Return what is pressed into what on a way on which nothing penetrates deeper than the oracle lets pass."""
    oracle.place(claim.base, oracle.posture)
    pairs = [oracle.touched(itself=False, depth=PRESSED)]
    for values in claim.values:
        joints = dict(zip(claim.joints, map(float, values), strict=True))
        oracle.place(claim.base, {**oracle.posture, **opened, **joints})
        pairs.append(oracle.touched(hand, claim.target, depth=PRESSED))
    return next((pair for pair in pairs if pair is not None), None)


class _Space:
    """Cells of the base frame in which an arm's tip has been, and their neighbours."""

    def __init__(self, points: Array) -> None:
        self.low = points.min(0) - 2 * VOXEL
        cells = np.floor((points - self.low) / VOXEL).astype(int)
        self.cells = np.zeros(cells.max(0) + 3, bool)
        for offset in np.ndindex(3, 3, 3):
            self.cells[tuple((cells + np.array(offset) - 1).T)] = True

    def has(self, points: Array) -> NDArray[np.bool_]:
        """Return which points (n, 3) lie in them."""
        cells = np.floor((points - self.low) / VOXEL).astype(int)
        inside = np.all((cells >= 0) & (cells < self.cells.shape), axis=1)
        found = np.zeros(len(points), bool)
        found[inside] = self.cells[tuple(cells[inside].T)]
        return found


def _bases(oracle: Oracle, chains: Chains, centre: Array) -> list[BasePose]:
    """All places of the grid at which the robot in its posture touches nothing."""
    reach = 1.15 * chains.reach
    steps = np.arange(-reach, reach + CELL, CELL)
    found: list[BasePose] = []
    for dx in steps:
        for dy in steps:
            x, y = float(centre[0] + dx), float(centre[1] + dy)
            if math.hypot(dx, dy) > reach or abs(x) > 3.0 or abs(y) > 2.5:
                continue
            for index in range(HEADINGS):
                base = (x, y, index * 2 * math.pi / HEADINGS)
                oracle.place(base, oracle.posture)
                if not oracle.touched(itself=False):
                    found.append(base)
                elif index == 0 and _hopeless(oracle, base):
                    break
    return found


def _hopeless(oracle: Oracle, base: BasePose) -> bool:
    """Return whether what stands still when the robot turns, its base, is in something."""
    touching = oracle.touched(itself=False)
    return touching is not None and touching[0] == oracle.robot.base_link


def _grasps(oracle: Oracle, chains: Chains, name: str, centre: Array, target: str) -> Iterator[Array]:
    """Pre-grasp, grasp and lift (3, 4, 4) of those hands that, without their arm, touch nothing all the way."""
    arm = oracle.robot.arm(name)
    if arm.gripper is not None and min(oracle.room.body(target).size[:2]) > arm.gripper.max_opening:
        return
    chain = chains.chains[name]
    middle = (chain.lower + chain.upper) / 2
    back = np.linalg.inv(chain.fk(middle[None])[0])
    joints = dict(zip(chain.names, map(float, middle), strict=True))
    joints |= arm.gripper.opened if arm.gripper is not None else {}
    for pitch in PITCHES:
        for height in HEIGHTS:
            for index in range(YAWS):
                for roll in (1.0, -1.0):
                    yaw = index * 2 * math.pi / YAWS
                    poses = grasp_poses(arm, centre + np.array([0.0, 0.0, height]), yaw, pitch, roll)
                    whole = (*poses, *straight(poses))
                    if all(oracle.hand_alone_is_free(name, joints, pose @ back, target) for pose in whole):
                        yield poses


def _complete(
    oracle: Oracle,
    chains: Chains,
    name: str,
    base: BasePose,
    poses: Array,
    q: Array,
    hand: frozenset[int],
    opened: dict[str, float],
    target: str,
) -> Claim | None:
    """The whole way from one solution of its grasp, if nothing of it touches anything."""
    chain = chains.chains[name]

    def is_free(values: Array) -> bool:
        oracle.place(base, {**oracle.posture, **opened, **dict(zip(chain.names, map(float, values), strict=True))})
        return oracle.touched(hand, target) is None

    if not is_free(q):
        return None
    others, good = chain.solve(_inverse(base) @ poses[[0, 2]], np.tile(q, (2, 1, 1)))
    if not good.all() or not all(map(is_free, others)) or not oracle.sees(base, target):
        return None
    values = np.stack([others[0], q, others[1]])
    if not all(map(is_free, on_the_way(values))):
        return None
    return Claim(base, name, chain.names, values, poses, target, opened)


def _inverse(base: BasePose) -> Array:
    x, y, yaw = base
    c, s = math.cos(yaw), math.sin(yaw)
    return np.array([[c, s, 0, -c * x - s * y], [-s, c, 0, s * x - c * y], [0, 0, 1, 0], [0, 0, 0, 1]], float)
