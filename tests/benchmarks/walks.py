"""Print the walks that a reader takes through the code, of one checkout or several.

    python -m tests.benchmarks.walks                                        this checkout
    python -m tests.benchmarks.walks --checkout ../main --checkout .        side by side
    python -m tests.benchmarks.walks --places location                      every place of a walk, in order

Two walks: a location phrase, read and resolved to a base pose; and one ``perform`` that opens a gripper, whose motion
the robot reports as failed, until the plan has the failure. Both run in the hospital room, with amigo, and begin when
the world stands and the plan runs. They are asked for by public names alone (``read_location`` of planlang.phrases,
at_location, perform, process_module, RobotInterface.motion), which later commits have as well.

A *place* is a function of planlang, executive or sim that is entered; comprehensions and lambdas belong to the function
around them. A *passage* is a pair of places of which one calls (or resumes) the other, counted once however often it
happens. A *return* is a passage into another file that the walk has been in before.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from textwrap import dedent

TOP = Path(__file__).resolve().parents[2]
RECORD = "recorded.json"

PHRASE = "in reach of the bottle"
PLAN_OF_A_LOCATION = """
    from planlang import action_class, at_location, plan
    from planlang.designators import Location

    ARRIVING = action_class("http://walks.org/walk#Arriving", below="Translation-LocationChange")

    @plan
    async def walk(*, where: Location) -> None:
        async def arrived() -> None:
            pass

        walk_begins()
        await at_location(where, arrived, by=ARRIVING)

    def walk_begins() -> None:
        pass
    """
ARRIVING = """
    from planlang import process_module

    @process_module
    class Arriving:
        name = "arriving"
        actions = ("Arriving",)
        failures = ()

        def __init__(self, platform):
            pass

        def resources(self, action):
            return ("base",)

        async def execute(self, action):
            walk_ends()

    def walk_ends():
        pass
    """
PLAN_OF_A_FAILURE = """
    from planlang import action, perform, plan
    from planlang.designators import a_device
    from planlang.failures import GripperGoalNotReached

    @plan
    async def walk() -> None:
        walk_begins()
        try:
            await perform(action("OpeningAGripper", device_used=a_device("LeftHand")))
        except GripperGoalNotReached:
            walk_ends()

    def walk_begins() -> None:
        pass

    def walk_ends() -> None:
        pass
    """
TRACER = """
    import json, os, sys, threading

    root, record, *words = sys.argv[1:]
    sys.path.insert(0, root)
    folders = tuple(os.path.join(root, folder) + os.sep for folder in ("planlang", "executive", "sim"))
    files, passages, known, reading, walking = {}, [], set(), 0, False

    def place_of(code):
        file = files.get(code.co_filename)
        if file is None:
            name = os.path.abspath(code.co_filename)
            file = files[code.co_filename] = os.path.relpath(name, root) if name.startswith(folders) else ""
        if not file:
            return None
        parts = code.co_qualname.split(".")
        while parts[-1].startswith("<"):
            parts.pop()
            if not parts:
                return None  # the file itself: an import
        return file, ".".join(parts)

    def told(frame, event, argument):
        global reading, walking
        if event not in ("call", "return"):
            return
        name = frame.f_code.co_name
        if name == "read_location" and "phrases" in frame.f_code.co_filename:
            reading += 1 if event == "call" else -1
        if event != "call":
            return
        if name in ("walk_begins", "walk_ends"):
            walking = name == "walk_begins"
            if not walking:
                with open(record, "w", encoding="utf-8") as file:
                    json.dump(passages, file)
                os._exit(0)
        if not (walking or reading) or (place := place_of(frame.f_code)) is None:
            return
        back = frame.f_back
        while back is not None and (caller := place_of(back.f_code)) is None:
            back = back.f_back
        passage = (None if back is None else caller, place)
        if passage not in known and passage[0] != place:
            known.add(passage)
            passages.append(passage)

    if "--failing" in words:
        from planlang.protocols import Motion, MotionState
        from sim import PyBulletWorld

        words.remove("--failing")
        PyBulletWorld.motion = lambda self, group: Motion(MotionState.FAILED)
    from executive.__main__ import main

    sys.argv = ["planlang", *words]
    threading.setprofile(told)
    sys.setprofile(told)
    main()
    """

Place = tuple[str, str]
"""File and name of a function."""


@dataclass(frozen=True)
class Walk:
    """A way through the code."""

    name: str
    plan: str
    modules: str = ""
    words: tuple[str, ...] = ()


WALKS = (
    Walk("a location phrase to a base pose", PLAN_OF_A_LOCATION, ARRIVING, ("--set", f"where={PHRASE}")),
    Walk("one perform to a motion and back as failure", PLAN_OF_A_FAILURE, "", ("--failing",)),
)


def passages(walk: Walk, checkout: Path) -> list[tuple[Place | None, Place]]:
    """Walk through a checkout; return its passages, in the order in which they happen first."""
    with tempfile.TemporaryDirectory() as folder:
        for name, text in (("walk.py", walk.plan), ("arriving.py", walk.modules), ("tracer.py", TRACER)):
            Path(folder, name).write_text(dedent(text), encoding="utf-8")
        words = ["run", "walk.py", "--robot", "amigo", "--environment", "hospital_room", *walk.words]
        words += ["--modules", "arriving.py"] if walk.modules else []
        command = [sys.executable, "tracer.py", str(checkout), RECORD, *words]
        environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "PYTHONHASHSEED": "0"}
        for _ in range(2):  # the first fills caches on disk
            done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)
        record = Path(folder, RECORD)
        if done.returncode or not record.exists():
            raise SystemExit(f"{walk.name} did not end in {checkout}:\n{done.stdout}{done.stderr}")
        found = json.loads(record.read_text(encoding="utf-8"))
    return [(None if caller is None else (caller[0], caller[1]), (place[0], place[1])) for caller, place in found]


def counts(walked: Sequence[tuple[Place | None, Place]]) -> Mapping[str, int]:
    """Count places, returns and files."""
    places, files, returns = set[Place](), set[str](), 0
    for caller, place in walked:
        returns += place[0] in files and caller is not None and caller[0] != place[0]
        places.add(place)
        files.add(place[0])
    return {"places": len(places), "returns": returns, "files": len(files)}


def main(words: Sequence[str] | None = None) -> None:
    """Print a table: a row for each figure of each walk, a column for each checkout."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--checkout", type=Path, action="append", help="folder of a checkout; repeatable")
    parser.add_argument("--places", metavar="WORD", help="print the passages of the walks with this in their name")
    given = parser.parse_args(words)
    checkouts = [one.resolve() for one in given.checkout or [TOP]]
    for walk in WALKS:
        if given.places and given.places not in walk.name:
            continue
        found = [passages(walk, checkout) for checkout in checkouts]
        if given.places:
            for one in found:
                print(*(f"{caller and ' '.join(caller)} -> {' '.join(place)}" for caller, place in one), sep="\n")
            continue
        columns = [counts(one) for one in found]
        for row in columns[0]:
            print(f"{walk.name}: {row:10}", *(f"{column[row]:8}" for column in columns))


if __name__ == "__main__":
    main()
