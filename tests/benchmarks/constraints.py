"""Motions under constraints: time for a phase, beside plain inverse kinematics of projected waypoints in the same run.

    python tests/benchmarks/constraints.py                   200 random problems, feasible by construction, per row
    python tests/benchmarks/constraints.py --problems 20

The peer moves the pose of each tool, without joints, until the constraints hold, from one violated constraint to the
next along its gradient, and again on poses between start and end for what has to hold throughout; inverse kinematics
then follows these poses. Both begin again from other configurations where they fail, 16 times. Times are CPU time, the
ratio is that of medians over the peer's problems. Ends and ways of ours are judged by formulas that share no code with
the solver.

A second table has such problems among boxes at random, that leave free the straight ways by which they were made; every
row of a motion is checked exactly; that none is found is no error. A third has problems of the first table to which one
constraint was added that asks the opposite of another: nothing else stands against it, so it has to be among those that
are named. Exit code 1 if a motion is wrong, or a contradiction is not found.
"""

from __future__ import annotations

import argparse
import statistics
import sys
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "tests" / "support")]

from constraint_bodies import bodies_around, random_problem_among_boxes  # noqa: E402
from constraint_evaluation import beyond, value_of  # noqa: E402
from constraint_problems import Arms, Matrix, arms_of, random_problem, turn  # noqa: E402

from executive.motion import MotionError  # noqa: E402
from executive.motion.constrained_ends import MotionProblem  # noqa: E402
from executive.motion.constrained_motion import PhaseMotion, solve_motion  # noqa: E402
from executive.motion.errors import ConstraintsContradict  # noqa: E402
from planlang.diagnostics import BadInput  # noqa: E402
from planlang.motion_constraints import MotionConstraint, a_constraint  # noqa: E402

ROWS = (("amigo", 1), ("amigo", 2), ("panda", 1), ("pr2", 2))
BEGINNINGS, SWEEPS, WAYPOINTS = 16, 60, 10
SMALL = 1e-6
APART = (0.05, 0.3)
"""How far the limits of a constraint and of its opposite are apart [m, no unit]."""
TIMES = ("median of a phase [ms]", "p95 [ms]")


def main() -> int:
    """Measure and print the tables."""
    options = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    options.add_argument("--problems", type=int, default=200, help="problems of each row (default: 200)")
    options.add_argument("--peer", type=int, default=20, help="of these for the peer, which is slow (default: 20)")
    options.add_argument("--hard", type=int, default=30, help="problems of each row of the other tables (default: 30)")
    chosen = options.parse_args()
    robots = dict[tuple[str, int], Arms]()
    for name, count in ROWS:
        try:
            robots[name, count] = arms_of(name, count)
        except BadInput as bad:
            print(f"{name} is left out: {bad.diagnostics[0].message}", file=sys.stderr)
    wrong = _table(
        ("solved", *TIMES, "peer solved", "its median", "its p95", "ratio"),
        robots,
        lambda arms, name: _alone(arms, name, chosen.problems, chosen.peer),
    )
    print()
    wrong += _table(("solved", *TIMES), robots, lambda arms, name: _among(arms, name, chosen.hard))
    print()
    head = ("told", "the two alone are named", "median of a problem [ms]", "p95 [ms]")
    wrong += _table(head, robots, lambda arms, name: _contradicting(arms, name, chosen.hard))
    return int(wrong > 0)


Row = tuple[int, tuple[str, ...]]
"""How much is wrong, and the columns."""


def _table(columns: Sequence[str], robots: dict[tuple[str, int], Arms], row: Callable[[Arms, str], Row]) -> int:
    """Print a row for each robot; return how much is wrong."""
    head = ("robot", "arms", *columns)
    print(f"| {' | '.join(head)} |\n{'|---' * len(head)}|", flush=True)
    wrong = 0
    for (name, count), arms in robots.items():
        found, texts = row(arms, name)
        wrong += found
        print(f"| {' | '.join((name, str(count), *texts))} |", flush=True)
    return wrong


def _alone(arms: Arms, name: str, number: int, of_peer: int) -> Row:
    """Solve problems without bodies around, some of them also by the peer."""
    ours, peers, solved, followed = list[float](), list[float](), 0, 0
    for seed in range(number):
        problem, start, phases = random_problem(arms, seed)
        solved += _solved(arms, problem, start, phases, ours, f"{name}, problem {seed}") is not None
        if seed >= of_peer:
            continue
        began = time.process_time()
        followed += _followed(arms, problem, start, phases)
        peers += [(time.process_time() - began) / len(phases)] * len(phases)
    (median, p95), (peer, peer_p95) = _times(ours), _times(peers)
    beside = _times(ours[: len(peers)])[0]
    of_times = (f"{time:.1f}" for time in (median, p95))
    of_peers = (f"{followed} of {min(number, of_peer)}", f"{peer:.1f}", f"{peer_p95:.1f}", f"{peer / beside:.1f}")
    return number - solved, (f"{solved} of {number}", *of_times, *of_peers)


def _among(arms: Arms, name: str, number: int) -> Row:
    """Solve problems among boxes."""
    ours, solved, wrong = list[float](), 0, 0
    with bodies_around(arms, ()) as alone:
        for seed in range(number):
            free, start, phases, boxes = random_problem_among_boxes(arms, alone, seed)
            with bodies_around(arms, boxes) as around:
                what = f"{name}, problem {seed} among {len(boxes)} boxes"
                motions = _solved(arms, around.of(free), start, phases, ours, what)
                rows = [row for motion in motions or () for row in motion.trajectory.positions]
                hit = next((pairs[0] for row in rows if (pairs := around.touching(row))), None)
                if hit is not None:
                    print(f"- {what}: {hit[0]} touches {hit[1]}")
                solved += motions is not None and hit is None
                wrong += hit is not None
    return wrong, (f"{solved} of {number}", *(f"{time:.1f}" for time in _times(ours)))


def _contradicting(arms: Arms, name: str, number: int) -> Row:
    """Ask for what cannot be: of each problem one constraint and its opposite."""
    ours, told, alone = list[float](), 0, 0
    for seed in range(number):
        problem, start, phases = random_problem(arms, seed)
        rng = np.random.default_rng(seed)
        phase = phases[int(rng.integers(len(phases)))]
        one = phase[int(rng.integers(len(phase)))]
        assert one.upper is not None
        low = one.upper + float(rng.uniform(*APART))
        other = a_constraint(
            one.kind, one.tool, one.world, lower=low, upper=low + APART[0], frame=one.frame, name="opposite"
        )
        phase.insert(int(rng.integers(len(phase) + 1)), other)
        named: tuple[MotionConstraint, ...] = ()
        began = time.process_time()
        try:
            solve_motion(problem, start, phases)
        except ConstraintsContradict as refused:
            named = refused.constraints
        ours.append(time.process_time() - began)
        told += other in named
        alone += other in named and set(named) <= {one, other}
        if other not in named:
            print(f"- {name}, problem {seed}: named {', '.join(map(str, named)) or 'nothing'}")
    times = (f"{time:.1f}" for time in _times(ours))
    return number - told, (f"{told} of {number}", str(alone), *times)


def _solved(
    arms: Arms,
    problem: MotionProblem,
    start: Matrix,
    phases: Sequence[Sequence[MotionConstraint]],
    times: list[float],
    what: str,
) -> Sequence[PhaseMotion] | None:
    """Return motions that are right; else print what is wrong. ``times`` gets the CPU time of each phase [s]."""
    began, objection, motions = time.process_time(), None, list[PhaseMotion]()
    try:
        motions = solve_motion(problem, start, phases)
    except MotionError as error:
        objection = str(error)
    times += [(time.process_time() - began) / len(phases)] * len(phases)
    objection = objection or arms.objection(problem, start, phases, motions)
    if objection is None:
        return motions
    print(f"- {what}: {objection}")
    return None


def _times(seconds: Sequence[float]) -> tuple[float, float]:
    ordered = sorted(1e3 * one for one in seconds)
    return statistics.median(ordered), ordered[round(0.95 * (len(ordered) - 1))]


def _followed(arms: Arms, problem: MotionProblem, start: Matrix, phases: Sequence[Sequence[MotionConstraint]]) -> bool:
    """Return whether plain inverse kinematics of projected waypoints solves all phases."""
    rng, q, before = np.random.default_rng(0), start, list[MotionConstraint]()
    for phase in phases:
        kept = [one for one in phase if any(one.asks_the_same(other) for other in before)]
        for beginning in range(BEGINNINGS):
            there = q if not beginning else rng.uniform(arms.group.lower, arms.group.upper)
            end = _waypoints(arms, problem, q, there, phase, kept)
            if end is not None:
                break
        else:
            return False
        q, before = end, list(phase)
    return True


def _waypoints(
    arms: Arms,
    problem: MotionProblem,
    q: Matrix,
    beginning: Matrix,
    phase: Sequence[MotionConstraint],
    kept: Sequence[MotionConstraint],
) -> Matrix | None:
    """The configuration at the end of a phase, reached through waypoints by inverse kinematics of each arm."""
    found = q.copy()
    for arm, chain in enumerate(arms.group.chains):
        columns = arms.group.columns[arm]
        mine, throughout = (
            [one for one in those if problem.where.tools[one.tool.of][0] == arm] for those in (phase, kept)
        )
        first = chain.fk(found[columns])[0]
        last = _projected(problem, chain.fk(beginning[columns])[0], mine)
        if last is None:
            return None
        row, ik = found[columns], chain
        for step in range(1, WAYPOINTS + 1):
            pose = (
                last if step == WAYPOINTS else _projected(problem, _between(first, last, step / WAYPOINTS), throughout)
            )
            if pose is None:
                return None
            seeds = np.stack([row, beginning[columns]])[None]
            (row,), (met,) = ik.solve(pose[None], seeds)
            if not met:
                return None
        found[columns] = row
    return found if arms.worst(problem, phase, found) <= 1.0 else None


def _projected(problem: MotionProblem, tip: Matrix, constraints: Sequence[MotionConstraint]) -> Matrix | None:
    """The pose of a tip moved until constraints hold; None if they do not after all sweeps."""
    pose = tip.copy()
    for _ in range(SWEEPS):
        held = True
        for one in constraints:
            value = _value(problem, one, pose)
            if beyond(one, value) <= 0.3:
                continue
            held = False
            low, high = one.lower or 0.0, one.upper or 0.0
            move = (low - value) if value < low else (high - value)
            slope = np.array([(_value(problem, one, _twisted(pose, SMALL * e)) - value) / SMALL for e in np.eye(6)])
            square = float(slope @ slope)
            if square < 1e-12:
                return None
            step = slope * move / square
            pose = _twisted(pose, step / max(1.0, float(np.linalg.norm(step[3:])) / 0.5))
        if held:
            return pose
    return None


def _value(problem: MotionProblem, one: MotionConstraint, tip: Matrix) -> float:
    frame = problem.where.frames[one.frame or "map"]
    return value_of(one, tip @ problem.where.tools[one.tool.of][1], problem.where.things[one.world.of], frame)


def _twisted(pose: Matrix, twist: Matrix) -> Matrix:
    """A pose moved by (3,) [m] and turned by a rotation vector (3,) about its own place."""
    moved = pose.copy()
    angle = float(np.linalg.norm(twist[3:]))
    moved[:3, 3] += twist[:3]
    if angle > 0:
        x, y, z = (twist[3:] / angle).tolist()
        moved[:3, :3] = turn((x, y, z), angle) @ pose[:3, :3]
    return moved


def _between(first: Matrix, last: Matrix, share: float) -> Matrix:
    """A pose between two, moved and turned evenly."""
    rotation = last[:3, :3] @ first[:3, :3].T
    twice = np.array(
        [rotation[2, 1] - rotation[1, 2], rotation[0, 2] - rotation[2, 0], rotation[1, 0] - rotation[0, 1]]
    )
    sine = float(np.linalg.norm(twice)) / 2
    angle = float(np.arctan2(sine, (np.trace(rotation) - 1) / 2))
    vector = twice / (2 * sine) * angle if sine > 1e-9 else np.zeros(3)
    return _twisted(first, share * np.concatenate([last[:3, 3] - first[:3, 3], vector]))


if __name__ == "__main__":
    sys.exit(main())
