"""Inverse kinematics of single arms beside TRAC-IK and PyBullet: the same random reachable targets, one process."""

from __future__ import annotations

import re
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pybullet

from executive.motion import Chain
from executive.robots import Robot
from planlang.geometry import Array, Pose
from sim.engine import quiet
from tests.support.locations.oracle import angle

SEEDS = 20
"""Postures that a solve may start from, random but for the first."""
TIP, TURN = 1e-4, 1e-3
"""Tolerance [m], [rad]; PyBullet is asked for ten times as much."""
TIMEOUT = 0.05
"""What TRAC-IK is given for one target [s]."""


@dataclass(frozen=True, slots=True)
class Row:
    """The results of one solver: share of targets solved within the tolerance, microseconds for each."""

    robot: str
    solver: str
    solved: float
    microseconds: float


def measure(robot: Robot, number: int) -> list[Row]:
    """All solvers on the first arm of a robot, torso left out, ``number`` targets."""
    arm = robot.arms[0]
    chain = Chain.from_urdf(robot.urdf, arm.base_link, arm.tip)
    rng = np.random.default_rng(0)
    targets = chain.fk(chain.sample(rng, number))
    middle = np.clip((chain.lower + chain.upper) / 2, -np.pi, np.pi)
    seeds = np.concatenate([np.tile(middle, (number, 1, 1)), chain.sample(rng, (number, SEEDS - 1))], axis=1)
    chain.solve(targets[:10], seeds[:10])

    def batch() -> Array:
        return chain.solve(targets, seeds)[0]

    def single() -> Array:
        return np.stack([chain.solve(targets[i : i + 1], seeds[i : i + 1])[0][0] for i in range(number)])

    rows = [
        _row(robot, "planlang, batch", chain, targets, batch, (TIP, TURN)),
        _row(robot, "planlang, one call each", chain, targets, single, (TIP, TURN)),
    ]
    try:
        rows.append(
            _row(robot, "TRAC-IK (pytracik)", chain, targets, _trac_ik(robot, chain, targets, middle), (TIP, TURN))
        )
    except ImportError:
        print("TRAC-IK is left out: make bench installs it")
    whole = Chain.from_urdf(robot.urdf, robot.base_link, arm.tip)  # PyBullet moves all joints, the torso, too
    count = max(10, number // 20)
    some, starts = whole.fk(whole.sample(rng, count)), whole.sample(rng, (count, SEEDS))
    answers = _pybullet(robot, whole, some, starts)
    return [*rows, _row(robot, "PyBullet, at 1 mm, 10 mrad", whole, some, answers, (1e-3, 1e-2))]


def _row(
    robot: Robot, name: str, chain: Chain, targets: Array, solve: Callable[[], Array], tolerance: tuple[float, float]
) -> Row:
    began = time.process_time()
    q = solve()
    seconds = time.process_time() - began
    reached = chain.fk(q)
    good = sum(
        bool(np.linalg.norm(a[:3, 3] - b[:3, 3]) <= 1.01 * tolerance[0])
        and angle(a[:3, :3], b[:3, :3]) <= 1.01 * tolerance[1]
        for a, b in zip(reached, targets, strict=True)
    )
    inside = chain.within(q, 1e-6)
    return Row(robot.name, name, min(good, int(inside.sum())) / len(targets), seconds / len(targets) * 1e6)


def _trac_ik(robot: Robot, chain: Chain, targets: Array, middle: Array) -> Callable[[], Array]:
    import pytracik

    arm = robot.arms[0]
    # with a safety_controller pytracik takes all limits to be zero
    urdf = re.sub(r"<safety_controller[^>]*/>", "", robot.urdf.read_text(encoding="utf-8"))
    with quiet():
        solver = pytracik.TRAC_IK(arm.base_link, arm.tip, urdf, TIMEOUT, TIP / 2, pytracik.SolveType.Speed)
    calls = [(*pose[:3, 3], *Pose.from_matrix(pose).orientation) for pose in targets]

    def solve() -> Array:
        found = [np.asarray(pytracik.ik(solver, middle, *call)) for call in calls]
        return np.stack([row[1:] if row[0] >= 0 else middle for row in found])

    return solve


def _pybullet(robot: Robot, chain: Chain, targets: Array, starts: Array) -> Callable[[], Array]:
    client = pybullet.connect(pybullet.DIRECT)
    with quiet():
        uid = pybullet.loadURDF(str(robot.urdf), useFixedBase=True, physicsClientId=client)
    infos = [pybullet.getJointInfo(uid, i, physicsClientId=client) for i in range(pybullet.getNumJoints(uid, client))]
    links = {info[12].decode(): info[0] for info in infos}
    moving = [info for info in infos if info[2] != pybullet.JOINT_FIXED]
    columns = [[info[1].decode() for info in moving].index(name) for name in chain.names]
    numbers = [moving[column][0] for column in columns]
    arm = robot.arms[0]
    low = [max(info[8], -np.pi) if info[8] < info[9] else -np.pi for info in moving]
    high = [min(info[9], np.pi) if info[8] < info[9] else np.pi for info in moving]
    span, rest = [b - a for a, b in zip(low, high, strict=True)], [(a + b) / 2 for a, b in zip(low, high, strict=True)]

    def solve() -> Array:
        found = []
        for target, seeds in zip(targets, starts, strict=True):
            pose = Pose.from_matrix(target)
            goal = pose.position, pose.orientation
            best = seeds[0]
            for start in seeds[:6]:
                q = start
                for _ in range(6):
                    for number, value in zip(numbers, q, strict=True):
                        pybullet.resetJointState(uid, number, value, physicsClientId=client)
                    answer = pybullet.calculateInverseKinematics(
                        uid, links[arm.tip], *goal, lowerLimits=low, upperLimits=high, jointRanges=span,
                        restPoses=rest, maxNumIterations=100, residualThreshold=1e-5, physicsClientId=client,
                    )  # fmt: skip
                    q = np.clip([answer[column] for column in columns], chain.lower, chain.upper)
                    reached = chain.fk(q)[0]
                    close = np.linalg.norm(reached[:3, 3] - target[:3, 3]) < 1e-3
                    if close and angle(reached[:3, :3], target[:3, :3]) < 1e-2:
                        break
                else:
                    continue
                best = q
                break
            found.append(best)
        pybullet.disconnect(client)
        return np.stack(found)

    return solve


def table(rows: list[Row]) -> str:
    """One line for each solver, with its time as a multiple of the batch's of the same robot."""
    lines = ["| robot | solver | solved | one target | times planlang's batch |", "|---|---|---|---|---|"]
    base = {row.robot: row.microseconds for row in rows if row.solver == "planlang, batch"}
    for row in rows:
        ratio = row.microseconds / base[row.robot]
        lines.append(f"| {row.robot} | {row.solver} | {row.solved:.1%} | {row.microseconds:.1f} us | {ratio:.1f} |")
    return "\n".join(lines)
