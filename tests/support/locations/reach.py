"""Reaching the bottle, or the person, room after room: the resolver, the samplers beside it, the judge over both."""

from __future__ import annotations

import statistics
import sys
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from executive.motion import MotionError
from executive.robots import Robot
from planlang.designators import Location, Object
from tests.support.locations.exhaustive import Verdict, search
from tests.support.locations.oracle import Oracle
from tests.support.locations.rooms import Room, asked
from tests.support.locations.sampler import Chains, Sampled, by_levenberg_marquardt, by_pybullet, sample
from tests.support.locations.stage import Answer, Stage


@dataclass(slots=True)
class Case:
    """One room: what the resolver answered, what the judge says of it, how others did."""

    room: Room
    answer: Answer
    objection: str | None = None
    """The error in the answer; None when it is right, or when there is none."""
    sampled: dict[str, Sampled] = field(default_factory=dict)
    verdict: Verdict | None = None

    @property
    def solved(self) -> bool:
        """Return whether there is an answer that the judge accepts."""
        return self.answer.solved and self.objection is None

    @property
    def missed(self) -> bool:
        """Return whether it is not solved although somebody found a way."""
        sampled = any(one.claim is not None for one in self.sampled.values())
        return not self.solved and (sampled or (self.verdict is not None and self.verdict.claim is not None))


Peer = tuple[str, int]
"""Inverse kinematics of a sampler, "planlang" or "PyBullet", and how many samples it may draw."""


def reach(
    robot: Robot,
    rooms: Iterable[Room],
    *,
    peers: Sequence[Peer] = (),
    classify: bool = False,
) -> Iterator[Case]:
    """Ask in every room, judge the answer, let the peers try; ``classify`` searches unsolved rooms through."""
    chains = Chains.of(robot)
    for room in rooms:
        stage, oracle = Stage(room, robot), Oracle(room, robot)
        try:
            location = asked(room)
            case = Case(room, stage.ask(location))
            if case.answer.solved:
                case.objection = judged(stage, oracle, case.answer, location)
            for ik, samples in peers:
                solve = by_pybullet(chains, oracle) if ik == "PyBullet" else by_levenberg_marquardt(chains)
                case.sampled[f"{ik} {samples}"] = sample(oracle, chains, solve, "bottle", samples=samples)
            if classify and not case.solved:
                case.verdict = search(oracle, chains, "bottle")
            yield case
            print(f"{room.name}{'' if case.solved else ', no answer'}", end="\r", file=sys.stderr, flush=True)
        finally:
            stage.close()
            oracle.close()


def judged(stage: Stage, oracle: Oracle, answer: Answer, location: Location) -> str | None:
    """Return what is wrong with the first place of an answer, by the oracle; None if nothing is."""
    what = location.relations[0].references[0]
    assert isinstance(what, Object)
    try:
        claim = stage.claim(answer.solutions[0], what)
    except MotionError as problem:
        return f"the arm cannot follow: {problem}"
    if claim is None:
        return "from the place that was given the arm finds no way"
    problem = oracle.objection(claim)
    return problem if problem or claim.target is None else oracle.is_grasp(claim)


def milliseconds(cases: Sequence[Case], of: Callable[[Case], float | None]) -> tuple[float, float]:
    """Median and 95th percentile of times given in seconds [ms]."""
    times = sorted(1e3 * time for case in cases if (time := of(case)) is not None)
    return statistics.median(times), times[min(len(times) - 1, round(0.95 * (len(times) - 1)))]


def summary(title: str, cases: Sequence[Case]) -> list[str]:
    """Lines of the table: the resolver first, then each peer, with its time as a multiple of the resolver's."""
    median, p95 = milliseconds(cases, lambda case: case.answer.seconds)
    solved = sum(case.solved for case in cases)
    count = len(cases)
    lines = [f"| {title} | planlang | {solved} of {count}, {solved / count:.1%} | {median:.1f} | {p95:.1f} | 1 | 1 |"]
    for peer in dict.fromkeys(name for case in cases for name in case.sampled):
        found = sum(case.sampled[peer].claim is not None for case in cases)
        middle, high = milliseconds(cases, lambda case, peer=peer: case.sampled[peer].seconds)  # type: ignore[misc]
        times = f"{middle:.1f} | {high:.1f} | {middle / median:.1f} | {high / p95:.1f}"
        lines.append(f"| | sampler, IK of {peer} samples | {found} of {count}, {found / count:.1%} | {times} |")
    for case in cases:
        if case.objection:
            lines.append(f"| | wrong in {case.room.name} | {case.objection} | | | | |")
    return lines


HEAD = [
    "| rooms | by | solved | median [ms] | p95 [ms] | times the median | times the p95 |",
    "|---|---|---|---|---|---|---|",
]


def unsolved(cases: Sequence[Case]) -> list[str]:
    """Room by room what was not solved, and why."""
    lines = []
    for case in cases:
        if case.solved:
            continue
        sampled = [name for name, one in case.sampled.items() if one.claim is not None]
        verdict = case.verdict.text if case.verdict is not None else "not searched"
        verdict = f"missed: the sampler ({', '.join(sampled)}) solves it" if sampled else verdict
        lines.append(f"| {case.room.name} | {verdict} | {first_reasons(case.answer)} |")
    return lines


def first_reasons(answer: Answer) -> str:
    """The two most frequent reasons, and the bodies most in the way."""
    reasons = Counter(answer.counts).most_common(2)
    bodies = Counter(answer.blocking).most_common(2)
    text = ", ".join(f"{number} {reason}" for reason, number in reasons)
    return text + (f" ({', '.join(f'{body} {number}' for body, number in bodies)})" if bodies else "")


def told_reason(counts: Mapping[str, int], expected: str) -> str:
    """The most frequent reason; that there is no room for the base counts only where next to nothing else does."""
    others = {reason: count for reason, count in counts.items() if reason != "no room for the base"}
    if expected == "no room for the base" and sum(others.values()) <= 0.01 * sum(counts.values()):
        return max(counts, key=lambda reason: counts[reason])
    return max(others or counts, key=lambda reason: counts[reason], default="none")
