"""How places are found: in one run beside samplers and other inverse kinematics, judged by PyBullet.

    python -m tests.benchmarks.locations                 all of it, 200 rooms of the kinds that are promised about
    python -m tests.benchmarks.locations --rooms 20      less of it

Times are CPU time of this process. Exit code 1 if an answer is wrong.
"""

from __future__ import annotations

import argparse
import statistics
import subprocess
import sys
import time
from dataclasses import dataclass

from executive.capabilities import Robot
from planlang.designators import a_location
from planlang.diagnostics import BadInput
from tests.benchmarks.locations import ik
from tests.benchmarks.locations.infeasible import infeasible_rooms
from tests.benchmarks.locations.oracle import Oracle
from tests.benchmarks.locations.queries import ask_many, check_areas, resolve_again, some_stage
from tests.benchmarks.locations.reach import (
    HEAD,
    Case,
    first_reasons,
    milliseconds,
    reach,
    summary,
    told_reason,
    unsolved,
)
from tests.benchmarks.locations.rooms import KINDS, SUPPORTS, THE_BOTTLE, asked, rooms, thing
from tests.benchmarks.locations.stage import Stage, robot_of

ROBOTS = ("amigo", "pr2", "panda")


@dataclass(frozen=True, slots=True)
class Promise:
    """One line of the last table."""

    what: str
    measured: str
    bound: str
    kept: bool


def main() -> int:
    """Measure and print the tables."""
    options = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    options.add_argument("--rooms", type=int, default=200, help="rooms of the kinds normal and hard (default: 200)")
    options.add_argument("--targets", type=int, default=1000, help="targets of inverse kinematics (default: 1000)")
    options.add_argument("--robots", default=",".join(ROBOTS), help="which robots (default: all that are there)")
    options.add_argument("--queries", type=int, default=1000, help="random questions (default: 1000)")
    options.add_argument("--without-search", action="store_true", help="do not search unsolved rooms through")
    chosen = options.parse_args()
    found = [robot for name in chosen.robots.split(",") if (robot := _robot(name)) is not None]
    promises: list[Promise] = []
    _inverse_kinematics(found, chosen.targets, promises)
    wrong = 0
    for robot in found:
        wrong += _reach(robot, chosen.rooms, promises, search=not chosen.without_search)
    _infeasible(found[0], max(1, chosen.rooms // 20), promises)
    _visible(found[0], chosen.rooms // 2, promises)
    wrong += _on(found[0], chosen.rooms // 2, promises)
    wrong += _areas(found[0], max(2, chosen.rooms // 10), promises)
    _shell(promises)
    _unchanged(chosen.queries, promises)
    print("\n## Promises\n\n| promise | measured | bound | |\n|---|---|---|---|")
    for promise in promises:
        print(f"| {promise.what} | {promise.measured} | {promise.bound} | {'' if promise.kept else 'missed'} |")
    return int(wrong > 0)


def _robot(name: str) -> Robot | None:
    try:
        return robot_of(name)
    except BadInput as bad:
        print(f"{name} is left out: {bad.diagnostics[0].message}", file=sys.stderr)
        return None


def _inverse_kinematics(robots: list[Robot], targets: int, promises: list[Promise]) -> None:
    print(f"## Inverse kinematics, {targets} random reachable targets, 0.1 mm and 1 mrad\n")
    rows = [row for robot in robots for row in ik.measure(robot, targets)]
    print(ik.table(rows), flush=True)
    for robot in robots:
        by = {row.solver: row for row in rows if row.robot == robot.name}
        batch, single = by["planlang, batch"], by["planlang, one call each"]
        promises.append(Promise(f"IK solved, {robot.name}", f"{batch.solved:.1%}", ">= 99.8 %", batch.solved >= 0.998))
        if trac := by.get("TRAC-IK (pytracik)"):
            for row, least in ((batch, 20), (single, 10)):
                ratio = trac.microseconds / row.microseconds
                what = f"TRAC-IK / {row.solver}, {robot.name}"
                promises.append(Promise(what, f"{ratio:.1f}", f">= {least}", ratio >= least))


def _reach(robot: Robot, number: int, promises: list[Promise], *, search: bool) -> int:
    """Rooms of all kinds; how many answers were wrong."""
    print(f"\n## {robot.name}: in reach of the bottle, or of the person\n")
    print("\n".join(HEAD), flush=True)
    main_robot = robot.name == "amigo"
    cases: dict[str, list[Case]] = {}
    for kind in KINDS:
        promised = kind in ("normal", "hard")
        peers = [("planlang", 200), ("PyBullet", 60)] if promised and main_robot else []
        longer = [("planlang", 2000)] if kind == "hard" else []
        count = number if promised else max(1, number // 8)
        classify = search and kind == "hard" and main_robot
        cases[kind] = list(reach(robot, rooms(kind, count), peers=peers, only_unsolved=longer, classify=classify))
        print("\n".join(summary(kind, cases[kind])), flush=True)
    normal, hard = cases["normal"], cases["hard"]
    median, p95 = milliseconds(normal, lambda case: case.answer.seconds)
    share = sum(case.solved for case in normal) / len(normal)
    least, fastest = (0.995, 25.0) if main_robot else (0.99, 50.0)
    promises.append(Promise(f"{robot.name}, normal rooms", f"{share:.1%}", f">= {least:.1%}", share >= least))
    promises.append(Promise(f"{robot.name}, median", f"{median:.1f} ms", f"<= {fastest:.0f} ms", median <= fastest))
    if main_robot:
        promises.append(Promise(f"{robot.name}, p95", f"{p95:.1f} ms", "<= 50 ms", p95 <= 50))
        _hard(hard, promises, searched=search)
    return sum(case.objection is not None for each in cases.values() for case in each)


def _hard(cases: list[Case], promises: list[Promise], *, searched: bool) -> None:
    print("\n### Hard rooms without answer\n\n| room | verdict | reasons of the resolver |\n|---|---|---|")
    print("\n".join(unsolved(cases)), flush=True)
    p95 = milliseconds(cases, lambda case: case.answer.seconds)[1]
    solved = sum(case.solved for case in cases)
    quick = sum(case.sampled["planlang 200"].claim is not None for case in cases)
    beaten = [c for c in cases if not c.solved and any(s.claim is not None for s in c.sampled.values())]
    long = sum(any(s.claim is not None for n, s in c.sampled.items() if n.startswith("planlang")) for c in cases)
    promises.append(Promise("hard rooms, p95", f"{p95:.0f} ms", "<= 600 ms", p95 <= 600))
    promises.append(Promise("hard rooms that only the sampler solves", str(len(beaten)), "0", not beaten))
    ratio = solved / max(quick, 1)
    promises.append(Promise("hard rooms solved / by the sampler in 200", f"{ratio:.2f}", ">= 1.5", ratio >= 1.5))
    promises.append(
        Promise("hard rooms solved / by the sampler in 2,000 at least", f"{solved / max(long, 1):.2f}", "", True)
    )
    if searched:
        missed = [c for c in cases if not c.solved and c.verdict is not None and c.verdict.claim is not None]
        share = len(missed) / len(cases)
        promises.append(Promise("hard rooms missed", f"{share:.1%}", "<= 2 %", share <= 0.02))


def _infeasible(robot: Robot, number: int, promises: list[Promise]) -> None:
    print(
        "\n## Rooms built to be infeasible\n\n| room | asked for | told first | ms | reasons |\n|---|---|---|---|---|"
    )
    right, times = 0, []
    for room, location in infeasible_rooms(number):
        stage = Stage(room, robot)
        answer = stage.ask(location)
        stage.close()
        told = told_reason(answer.counts, room.reason)
        times.append(answer.seconds)
        right += told == room.reason and not answer.solved
        print(f"| {room.name} | {room.reason} | {told} | {1e3 * answer.seconds:.0f} | {first_reasons(answer)} |")
    promises.append(Promise("unreachable, right reason", f"{right} of {len(times)}", "all", right == len(times)))
    promises.append(Promise("unreachable, longest", f"{1e3 * max(times):.0f} ms", "<= 500 ms", max(times) <= 0.5))


def _visible(robot: Robot, number: int, promises: list[Promise]) -> None:
    times = []
    for room in rooms("normal", max(2, number)):
        stage = Stage(room, robot)
        times.append(stage.ask(a_location(visible_from=THE_BOTTLE)).seconds)
        stage.close()
    median = 1e3 * statistics.median(times)
    promises.append(Promise("visible from, median", f"{median:.1f} ms", "<= 30 ms", median <= 30))


def _on(robot: Robot, number: int, promises: list[Promise]) -> int:
    """Putting the bottle on a table, a nightstand, a cabinet; how many answers were wrong."""
    times, wrong, none = [], 0, 0
    for index, room in enumerate(rooms("normal", max(3, number))):
        support = room.body(SUPPORTS[index % len(SUPPORTS)])
        stage, oracle = Stage(room, robot), Oracle(room, robot)
        pose, seconds = stage.put(a_location(on=thing(support)), THE_BOTTLE)
        times.append(seconds)
        none += pose is None
        if pose is not None and (problem := oracle.rests("bottle", pose, support.name)) is not None:
            print(f"- {room.name}: on {support.name}: {problem}")
            wrong += 1
        stage.close()
        oracle.close()
    median = 1e3 * statistics.median(times)
    promises.append(Promise("on, median", f"{median:.1f} ms", "<= 2 ms", median <= 2))
    promises.append(Promise("on, without answer", f"{none} of {len(times)}", "0", not none))
    promises.append(Promise("on, wrong", str(wrong), "0", not wrong))
    return wrong


def _areas(robot: Robot, number: int, promises: list[Promise]) -> int:
    """Random conjunctions of relations about the floor; how many places do not keep one of them."""
    answered = asked_for = 0
    found: list[str] = []
    for room in rooms("normal", number):
        stage = Stage(room, robot)
        for objections_, solved in check_areas(stage, 10, room.seed):
            asked_for += 1
            answered += solved
            found += objections_
        stage.close()
    for line in found[:20]:
        print(f"- {line}")
    what = f"places against their words, {answered} answers of {asked_for} conjunctions"
    promises.append(Promise(what, str(len(found)), "0", not found))
    return len(found)


def _shell(promises: list[Promise]) -> None:
    """The whole command, its maps in the cache; the fastest of some runs, as others use the machine, too."""
    phrase = "in reach of the patient with the right arm and not blocking the door"
    command = [
        sys.executable,
        "-m",
        "executive",
        "locate",
        phrase,
        "--robot",
        "amigo",
        "--environment",
        "hospital_room",
    ]
    walls = []
    for _ in range(6):
        began = time.perf_counter()
        subprocess.run(command, check=True, capture_output=True)
        walls.append(time.perf_counter() - began)
    fastest = min(walls[1:])
    promises.append(Promise("planlang locate, whole process", f"{fastest:.2f} s", "<= 1.5 s", fastest <= 1.5))


def _unchanged(number: int, promises: list[Promise]) -> None:
    """Random questions, and the same one again and again."""
    room, robot = some_stage()
    stage = Stage(room, robot_of(robot))
    asked_many = ask_many(stage, number, tell=print)
    endings = ", ".join(f"{count} {ending}" for ending, count in asked_many.endings.most_common())
    print(f"\n## Random questions\n\n{number} in {room.name}: {endings}")
    for line in asked_many.other_failures[:20]:
        print(f"- {line}")
    promises.append(
        Promise("questions that changed something", str(len(asked_many.changed)), "0", not asked_many.changed)
    )
    wrong = len(asked_many.other_failures)
    promises.append(Promise("questions that ended in an internal error", str(wrong), "0", not wrong))
    growth = resolve_again(stage, asked(room), number)
    stage.close()
    what = f"memory in the last {number // 2} of {number} resolutions"
    promises.append(Promise(what, f"{growth:+.1f} MB", "<= 2 MB", growth <= 2))


if __name__ == "__main__":
    sys.exit(main())
