"""The parts of the measurements that ask in rooms: reach, hard rooms, infeasible ones, sight, putting things down."""

from __future__ import annotations

import statistics
from collections.abc import Iterator

from executive.robots import Robot
from planlang.designators import a_location
from tests.benchmarks.locations import ik
from tests.benchmarks.locations.promises import Report
from tests.support.locations.crowded_tables import ASKED, KIND, crowded_table
from tests.support.locations.dense_sampler import refutation
from tests.support.locations.infeasible import infeasible_rooms
from tests.support.locations.oracle import Oracle
from tests.support.locations.queries import check_areas
from tests.support.locations.reach import (
    HEAD,
    Case,
    first_reasons,
    judged,
    milliseconds,
    reach,
    summary,
    told_reason,
    unsolved,
)
from tests.support.locations.rooms import SUPPORTS, THE_BOTTLE, Room, asked, room_of, rooms, thing
from tests.support.locations.stage import Stage

MAIN = "amigo"
"""The robot whose rooms are given to the peers, too."""


def inverse_kinematics(robot: Robot, targets: int) -> Report:
    """Beside TRAC-IK and PyBullet, at 0.1 mm and 1 mrad."""
    report, rows = Report(), ik.measure(robot, targets)
    print(ik.table(rows))
    by = {row.solver: row for row in rows}
    batch, single = by["planlang, batch"], by["planlang, one call each"]
    solved = min(batch.solved, single.solved)
    report.add(f"IK solved, {robot.name}", f"{solved:.1%}", ">= 99.8 %", solved >= 0.998)
    trac = by.get("TRAC-IK (pytracik)")
    for row, least in ((batch, 20), (single, 10)) if trac is not None else ():
        ratio = trac.microseconds / row.microseconds if trac is not None else 0.0
        report.add(f"TRAC-IK / {row.solver}, {robot.name}", f"{ratio:.1f}", f">= {least}", ratio >= least)
    return report


def reaching(robot: Robot, kind: str, number: int, first: int) -> Report:
    """Rooms of a kind that is not hard; a room about a person without answer counts as missed, others are searched."""
    main = robot.name == MAIN
    peers = [("planlang", 200), ("PyBullet", 60)] if main and kind == "normal" else []
    about_person = kind.startswith("person")
    cases = list(reach(robot, rooms(kind, number, first), peers=peers, classify=main and not about_person))
    report = _reached(robot, kind, cases)
    for line in unsolved(cases):
        print(line)
    if main and kind != "normal":
        solved = sum(case.solved for case in cases)
        feasible = sum(case.solved or about_person or case.missed for case in cases)
        share = solved / max(feasible, 1)
        report.add(f"{robot.name}, {kind}: solved of those feasible", f"{share:.1%}", ">= 99.5%", share >= 0.995)
    if kind != "normal":
        return report
    median, p95 = milliseconds(cases, lambda case: case.answer.seconds)
    share = sum(case.solved for case in cases) / len(cases)
    least, fastest = (0.995, 25.0) if main else (0.99, 50.0)
    report.add(f"{robot.name}, normal rooms", f"{share:.1%}", f">= {least:.1%}", share >= least)
    report.at_most(f"{robot.name}, normal rooms, median", median, fastest, " ms", 1)
    if main:
        report.at_most(f"{robot.name}, normal rooms, p95", p95, 50.0, " ms", 1)
    return report


def hard(robot: Robot, number: int, first: int, *, search: bool) -> Report:
    """Hard rooms, beside samplers that may sample for long; what is not solved is searched through."""
    peers = [("planlang", 200), ("planlang", 2000), ("PyBullet", 60)]
    cases = list(reach(robot, rooms("hard", number, first), peers=peers, classify=search))
    report = _reached(robot, "hard", cases)
    print("\n| hard room without answer | verdict | reasons of the resolver |\n|---|---|---|")
    print("\n".join(unsolved(cases)))
    p95 = milliseconds(cases, lambda case: case.answer.seconds)[1]
    report.at_most("hard rooms, p95", p95, 600.0, " ms")
    solved = sum(case.solved for case in cases)
    report.add("hard rooms solved", f"{solved} of {len(cases)}", "", True)
    sampled = {name: {c.room.seed for c in cases if c.sampled[name].claim is not None} for name in cases[0].sampled}
    beaten = sampled["planlang 2000"] - {case.room.seed for case in cases if case.solved}
    report.none("hard rooms that only the sampler solves, in 2,000 samples", len(beaten))
    for samples in (200, 2000):
        ratio = solved / max(len(sampled[f"planlang {samples}"]), 1)
        report.add(f"hard rooms solved / by the sampler in {samples:,} samples", f"{ratio:.2f}", ">= 1.5", ratio >= 1.5)
    if search:
        missed = sum(case.missed for case in cases)
        report.add("hard rooms missed", f"{missed / len(cases):.1%}", "<= 2 %", missed <= 0.02 * len(cases))
        open_ = sum(case.verdict is not None and not case.verdict.finished for case in cases)
        report.add("hard rooms whose search was not finished", str(open_), "", True)
    return report


def _reached(robot: Robot, kind: str, cases: list[Case]) -> Report:
    print("\n".join([*HEAD, *summary(f"{robot.name}, {kind}", cases)]))
    wrong = sum(case.objection is not None for case in cases)
    report = Report(wrong=wrong)
    report.none(f"{robot.name}, {kind}: answers that PyBullet does not confirm", wrong)
    return report


def infeasible(robot: Robot, number: int) -> Report:
    """Rooms built to be infeasible for one known reason, so many of each."""
    report = Report()
    print("| room | asked for | told first | ms | reasons |\n|---|---|---|---|---|")
    right, times = 0, []
    for room, location in infeasible_rooms(number):
        stage = Stage(room, robot)
        answer = stage.ask(location)
        stage.close()
        told = told_reason(answer.counts, room.reason)
        times.append(answer.seconds)
        right += told == room.reason and not answer.solved
        print(f"| {room.name} | {room.reason} | {told} | {1e3 * answer.seconds:.0f} | {first_reasons(answer)} |")
    report.add("unreachable, right reason", f"{right} of {len(times)}", "all", right == len(times))
    report.at_most("unreachable, longest", 1e3 * max(times), 500.0, " ms")
    return report


def visible(robot: Robot, number: int) -> Report:
    """Places from which the bottle is seen."""
    times = []
    for room in rooms("normal", number):
        stage = Stage(room, robot)
        times.append(stage.ask(a_location(visible_from=THE_BOTTLE)).seconds)
        stage.close()
    report = Report()
    report.at_most("visible from, median", 1e3 * statistics.median(times), 30.0, " ms", 1)
    return report


def on(robot: Robot, number: int) -> Report:
    """Putting the bottle on a table, a nightstand, a cabinet."""
    report, times, none = Report(), [], 0
    for index, room in enumerate(rooms("normal", max(3, number))):
        support = room.body(SUPPORTS[index % len(SUPPORTS)])
        stage, oracle = Stage(room, robot), Oracle(room, robot)
        pose, seconds = stage.put(a_location(on=thing(support)), THE_BOTTLE)
        times.append(seconds)
        none += pose is None
        if pose is not None and (problem := oracle.rests("bottle", pose, support.name)) is not None:
            print(f"- {room.name}: on {support.name}: {problem}")
            report.wrong += 1
        stage.close()
        oracle.close()
    report.at_most("on, median", 1e3 * statistics.median(times), 2.0, " ms", 1)
    report.none(f"on, without answer, of {len(times)}", none)
    report.none("on, wrong", report.wrong)
    return report


def areas(robot: Robot, number: int) -> Report:
    """Random conjunctions of relations about the floor, and whether places keep all of them."""
    report, answered, asked_for = Report(), 0, 0
    for room in rooms("normal", number):
        stage = Stage(room, robot)
        for objections, solved in check_areas(stage, 10, room.seed):
            asked_for += 1
            answered += solved
            report.wrong += len(objections)
            for line in objections:
                print(f"- {line}")
        stage.close()
    what = f"places that break their words, of {answered} answers to {asked_for} conjunctions"
    report.none(what, report.wrong)
    return report


OTHER_KINDS = ("normal", "hard", "cluttered floor", "narrow passage")
"""Kinds of rooms that are drawn anew beside crowded tables; in all of them the bottle is asked for."""


def anew(robot: Robot, number: int, first: int) -> Report:
    """Rooms drawn anew, half of them crowded tables at which the bottle is grasped from the side, all in one run.

    PyBullet judges each place; a dense sampler of its own tries to refute each answer that there is none.
    """
    report, times = Report(), {True: list[float](), False: list[float]()}
    refuted = 0
    warm = Stage(crowded_table(0), robot)  # functions are written down at the first question of a process
    warm.ask(ASKED)
    warm.close()
    print("| room | answer | CPU time [ms] | judged |\n|---|---|---|---|")
    for room in _drawn(number, first):
        location = ASKED if room.kind == KIND else asked(room)
        stage, oracle = Stage(room, robot), Oracle(room, robot)
        answer = stage.ask(location)
        times[answer.solved].append(answer.seconds)
        if answer.solved:
            problem = judged(stage, oracle, answer, location)
            report.wrong += problem is not None
            verdict = problem or "confirmed"
        else:
            claim = refutation(oracle, "bottle", side=room.kind == KIND)
            refuted += claim is not None
            verdict = "none found by sampling" if claim is None else f"refuted: {claim.arm} from {claim.base}"
        said = f"yes: {answer.solutions[0].base}" if answer.solved else f"no: {first_reasons(answer)}"
        print(f"| {room.name} | {said} | {1e3 * answer.seconds:.0f} | {verdict} |", flush=True)
        stage.close()
        oracle.close()
    for solved, name in ((True, "yes"), (False, "no")):
        some = sorted(times[solved])
        if some:
            report.add(f"{name}, rooms", str(len(some)), "", True)
            report.add(f"{name}, median", f"{1e3 * statistics.median(some):.0f} ms", "", True)
            report.at_most(f"{name}, p95", 1e3 * some[round(0.95 * (len(some) - 1))], 300.0, " ms")
            report.at_most(f"{name}, longest", 1e3 * some[-1], 2000.0, " ms")
    report.none("yes that PyBullet does not confirm", report.wrong)
    report.none("no that the sampler refutes", refuted)
    report.wrong += refuted
    return report


def _drawn(number: int, first: int) -> Iterator[Room]:
    """Yield rooms of the seeds from the first one on: each second one a crowded table, the others by turns."""
    for index in range(number):
        seed = first + index
        kind = OTHER_KINDS[index // 2 % len(OTHER_KINDS)]
        yield crowded_table(seed) if index % 2 == 0 else room_of(kind, seed)
