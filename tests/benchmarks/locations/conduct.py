"""Conduct of finding places, whatever is asked: the whole command, what it leaves alone, two processes, tests."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import time

from tests.benchmarks.locations.promises import Report
from tests.support.locations.queries import ask_many, resolve_again, some_stage
from tests.support.locations.rooms import KINDS, asked
from tests.support.locations.stage import Stage, robot_of

PHRASE = "in reach of the patient with the right arm and not blocking the door"
TESTED = {
    "answers in mirrored, moved and turned rooms, with more obstacles; none of it changes anything": (
        "tests/executive/locations/test_resolution_properties.py",
        "tests/executive/locations/test_rooms.py",
    ),
    "phrase, location, phrase: random locations and bad words": ("tests/planlang/phrases",),
    "relations, reasons, unknown and contradictory and broken input": (
        "tests/executive/locations/test_relations.py",
        "tests/executive/locations/test_rejections.py",
        "tests/executive/maps/test_semantic_map.py",
        "tests/executive/test_locate.py",
    ),
}
"""What is shown by tests -> where they are."""


def shell() -> Report:
    """The whole command, its maps in the cache; the fastest of some runs, as others use the machine, too."""
    report = Report()
    command = [sys.executable, "-m", "executive", "locate", PHRASE, "--robot", "amigo"]
    command += ["--environment", "hospital_room"]
    walls = []
    for _ in range(6):
        began = time.perf_counter()
        subprocess.run(command, check=True, capture_output=True)
        walls.append(time.perf_counter() - began)
    report.at_most("planlang locate, whole process", min(walls[1:]), 1.5, " s", 2)
    return report


def unchanged(number: int) -> Report:
    """Random questions, and the same one again and again."""
    report = Report()
    room, robot = some_stage()
    stage = Stage(room, robot_of(robot))
    answers = ask_many(stage, number, tell=print)
    endings = ", ".join(f"{count} {ending}" for ending, count in answers.endings.most_common())
    print(f"{number} random questions in {room.name}: {endings}")
    for line in answers.other_failures[:20]:
        print(f"- {line}")
    report.none(f"of {number} questions, some of them interrupted: changed something", len(answers.changed))
    report.none("ended in an internal error", len(answers.other_failures))
    growth = resolve_again(stage, asked(room), number)
    stage.close()
    report.at_most(f"memory in the last {number // 2} of {number} resolutions", growth, 2.0, " MB", 1)
    return report


def identical(number: int) -> Report:
    """The answers of two processes in rooms of all kinds, whose hashes are seeded differently."""
    command = [sys.executable, "-m", "tests.support.locations.answers", str(number), *KINDS]
    outputs = [
        subprocess.run(
            command, check=True, capture_output=True, text=True, env={**os.environ, "PYTHONHASHSEED": seed}
        ).stdout.splitlines()
        for seed in ("1", "2")
    ]
    different = sum(one != other for one, other in zip(*outputs, strict=True))
    report = Report(wrong=different)
    report.none(f"of {len(outputs[0])} answers: not bit-identical in two processes", different)
    return report


def properties() -> Report:
    """The tests that show the rest."""
    report = Report()
    for what, files in TESTED.items():
        command = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", *files]
        done = subprocess.run(command, check=False, capture_output=True, text=True)
        passed, failed = _counts(done.stdout)
        print(f"{what}: {passed} passed, {failed} failed")
        report.wrong += failed
        report.add(f"tests: {what}", f"{passed} passed, {failed} failed", "all", done.returncode == 0 and passed > 0)
    return report


def _counts(output: str) -> tuple[int, int]:
    """Return how many tests passed, and how many did not."""
    found = {"passed": 0, "failed": 0, "error": 0}
    for number, word in re.findall(r"(\d+) (passed|failed|error)", output):
        found[word] += int(number)
    return found["passed"], found["failed"] + found["error"]
