"""Measure how arms find their way, beside an RRT that asks PyBullet about every step, in the same rooms and run.

    python -m tests.benchmarks.paths                 Amigo, PR2 and Panda, 12 rooms of each kind, two questions in each
    python -m tests.benchmarks.paths --rooms 3 --robots amigo

Questions are random: a base, and two postures of one arm, all free; the arm must get from one to the other. Times are
CPU time of this process, of the whole question, timing of the motion included. Every row of our motions is judged by
PyBullet through independent code. Exit code 1 if one is wrong.
"""

from __future__ import annotations

import argparse
import statistics
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from executive.maps import read_map, scene_of
from executive.modules.platform import Platform
from executive.motion import MotionError
from executive.robots import Robot
from executive.robots.arms import ArmModel
from planlang.diagnostics import BadInput
from planlang.geometry import Array
from planlang.protocols import Configuration
from tests.benchmarks.paths.plain import Plain
from tests.support.locations.oracle import Oracle
from tests.support.locations.rooms import Room, rooms
from tests.support.locations.stage import Stage, robot_of, vocabulary

KINDS = ("hospital_room", "normal", "hard", "cluttered floor")
QUESTIONS = 2
"""In each room."""
JUDGED = 3
"""Every so many rows of a motion are judged."""


@dataclass(slots=True)
class Case:
    """One question: whether it was solved, CPU time [s], length of the path; of ours and of the peer."""

    ours: bool
    seconds: float
    length: float
    peer: bool
    peer_seconds: float
    peer_length: float
    straight: bool
    objection: str | None


def main() -> int:
    """Measure and print the table."""
    options = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    options.add_argument("--rooms", type=int, default=12, help="rooms of each kind (default: 12)")
    options.add_argument("--robots", default="amigo,pr2,panda", help="which robots (default: all that are there)")
    chosen = options.parse_args()
    print("## Paths of an arm, beside plain RRT-Connect with PyBullet\n")
    head = [
        "robot",
        "rooms",
        "solved",
        "peer",
        "median [ms]",
        "p95 [ms]",
        "peer's",
        "its p95",
        "ratio",
        "length to its",
    ]
    print(f"| {' | '.join(head)} |\n{'|---' * len(head)}|", flush=True)
    wrong = 0
    for name in chosen.robots.split(","):
        try:
            robot = robot_of(name)
        except BadInput as bad:
            print(f"{name} is left out: {bad.diagnostics[0].message}", file=sys.stderr)
            continue
        every: list[Case] = []
        for kind in KINDS:
            cases = [case for room in _rooms(kind, chosen.rooms) for case in _cases(room, robot)]
            print(_line(name, kind, cases), flush=True)
            every += cases
        print(_line(name, "all", every))
        print(_line(name, "all but straight ways", [case for case in every if not case.straight]), flush=True)
        for case in every:
            if case.objection is not None:
                print(f"- {name}: {case.objection}")
                wrong += 1
    return int(wrong > 0)


def _rooms(kind: str, number: int) -> Iterator[Room]:
    if kind != "hospital_room":
        yield from rooms(kind, number)
        return
    scene = scene_of(read_map(vocabulary()))
    for seed in range(number):
        yield Room(kind, seed, scene.bodies)


def _cases(room: Room, robot: Robot) -> Iterator[Case]:
    stage, oracle = Stage(room, robot), Oracle(room, robot)
    platform, rng = stage.platform, np.random.default_rng(room.seed)
    before = stage.world.configuration()
    x_min, y_min, x_max, y_max = platform.scene.world.scene.bounds
    try:
        for _ in range(QUESTIONS):
            arm = platform.scene.arms.all[int(rng.integers(len(platform.scene.arms.all)))]
            base, ends = (0.0, 0.0, 0.0), list[Array]()
            while len(ends) < 2:  # somewhere else where hardly any posture is free
                base = (float(rng.uniform(x_min, x_max)), float(rng.uniform(y_min, y_max)), float(rng.uniform(-3, 3)))
                if platform.scene.collisions.contacts(base):
                    continue
                postures = arm.chain.sample(rng, 60)
                ends = [q for q in postures if not platform.scene.collisions.contacts(base, arm, q)][:2]
            joints = {**before.joints, **dict(zip(arm.joints, map(float, ends[0]), strict=True))}
            stage.world.set_configuration(Configuration(base, joints))
            platform.observe()
            yield _asked(platform, arm, ends[0], ends[1], oracle, room)
            stage.world.set_configuration(before)
            platform.observe()
    finally:
        stage.close()
        oracle.close()


def _asked(platform: Platform, arm: ArmModel, start: Array, goal: Array, oracle: Oracle, room: Room) -> Case:
    base, joints = platform.base(), dict(platform.world.configuration().joints)
    for master, followers in platform.scene.world.robot.description.followers.items():
        joints |= {one.joint: one.multiplier * joints.get(master, 0.0) + one.offset for one in followers}
    platform.scene.collisions.quick_check(arm, None)  # what is worked out once for a robot and kept is not counted
    objection, length, ours = None, 0.0, True
    began = time.process_time()
    try:
        rows = platform.arms.path(arm, goal).positions
    except MotionError:
        ours = False
    seconds = time.process_time() - began
    if ours:
        length = _length(rows, arm.resolution)
        for row in rows[::JUDGED]:
            oracle.place(base, {**joints, **dict(zip(arm.joints, map(float, row), strict=True))})
            if touched := oracle.touched():
                objection = f"{room.name}: {touched} on the way"
                break

    def is_free(q: Array) -> bool:
        return not platform.scene.collisions.contacts(base, arm, q)

    began = time.process_time()
    plain = Plain(is_free, arm.resolution, arm.lower, arm.upper, np.random.default_rng(room.seed))
    path = plain.plan(start, goal)
    if path is not None:
        timed = platform.timed(arm.joints, path)
        if not all(map(is_free, timed.positions[1:])):
            path = None
    peer_seconds = time.process_time() - began
    peer_length = 0.0 if path is None else _length(path, arm.resolution)
    straight = path is not None and len(path) == 2
    return Case(ours, seconds, length, path is not None, peer_seconds, peer_length, straight, objection)


def _length(path: Array, resolution: Array) -> float:
    return sum(float(np.linalg.norm((b - a) / resolution)) for a, b in pairwise(path))


def _line(robot: str, kind: str, cases: list[Case]) -> str:
    if not cases:
        return f"| {robot} | {kind} | none | | | | | | | |"

    def percent(values: list[bool]) -> str:
        return f"{sum(values)} of {len(values)}"

    def times(values: list[float]) -> tuple[float, float]:
        ordered = sorted(1e3 * value for value in values)
        return statistics.median(ordered), ordered[round(0.95 * (len(ordered) - 1))]

    median, p95 = times([case.seconds for case in cases])
    peer, peer_p95 = times([case.peer_seconds for case in cases])
    both = [case.length / case.peer_length for case in cases if case.ours and case.peer and case.peer_length > 0]
    ratio = f"{statistics.median(both):.2f}" if both else ""
    return (
        f"| {robot} | {kind} | {percent([case.ours for case in cases])} | {percent([case.peer for case in cases])} "
        f"| {median:.1f} | {p95:.1f} | {peer:.1f} | {peer_p95:.1f} | {peer / median:.1f} | {ratio} |"
    )


if __name__ == "__main__":
    sys.exit(main())
