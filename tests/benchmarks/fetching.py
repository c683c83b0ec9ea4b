"""Count how often robots fetch a bottle from a closed cabinet or drawer: 30 drawn by seeds, each robot, a whole run.

    python tests/benchmarks/fetching.py [--rooms 30] [--robots amigo,pr2] [--first 0]

Cabinets differ in size, height, side of the hinge and handle, and in the bottle's place behind the door. The bundled
recipe ``fetch_from_cabinet`` takes the bottle and closes the door. The goal is asked of the simulated world: the bottle
is in the robot's hand, the door open by less than 3 degrees, and neither touched anything else.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections import Counter
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from executive.maps import MapObject
from planlang.geometry import Pose
from planlang.ontology import shorten
from tests.benchmarks.goals import row
from tests.support.leaves import drawn, thing
from tests.support.scenarios import Scenario
from tests.support.scenarios.fridge import fetched, touching

BOTTLE = (0.065, 0.065, 0.2)
WALL = 0.02
"""Thickness of furniture's walls [m]."""
FRONT = 0.6
"""The front of cabinets, and the border of the room behind it [m]."""
HEADER = """
Prefix: : <http://planlang.org/kb/kitchenette.owl#>
Prefix: knowrob: <http://knowrob.org/kb/knowrob.owl#>
Ontology: <http://planlang.org/kb/kitchenette.owl>
"""
NAMES = {"case": "cabinet1", "leaf": "leaf", "grip": "grip"}


def cabinet(seed: int) -> tuple[MapObject, ...]:
    """A room, a cabinet in it, its leaf, the handle, and a bottle behind the leaf, by a seed."""
    case, leaf, grip = drawn(seed)
    assert leaf.pose is not None
    assert leaf.size is not None
    assert case.size is not None
    rng = np.random.default_rng([seed, 1])
    slides = shorten(leaf.types[0]) == "Drawer"
    depth = case.size[0]
    x = FRONT + (rng.uniform(0.08, 0.2) if slides else rng.uniform(0.07, min(0.2, depth - 0.08)))
    side = leaf.size[1] / 2 - 0.08
    low = leaf.pose.position[2] - leaf.size[2] / 2 + (0.01 if slides else 0.0)
    pose = Pose((x, float(rng.uniform(-side, side)), low + BOTTLE[2] / 2 + 0.001))
    room = thing("room1", "Kitchen", Pose((-1.0, 0.0, 1.3)), (6.0, 6.0, 2.6))
    return room, case, leaf, grip, thing("bottle1", "DrinkingBottle", pose, BOTTLE)


def written(things: tuple[MapObject, ...]) -> str:
    """Return a map in Manchester syntax."""
    frames = [HEADER]
    for one in things:
        assert one.pose is not None
        assert one.size is not None
        name = NAMES.get(one.name, one.name)
        extents = zip(("depthOfObject", "widthOfObject", "heightOfObject"), one.size, strict=True)
        facts = [f"knowrob:{prop} {value!r}" for prop, value in extents] + [f"knowrob:pose pose_{name}"]
        facts += [f"knowrob:properPhysicalParts {part.partition('#')[2]}" for part in one.parts]
        place = " ".join(map(repr, map(float, one.pose.position)))
        turn = " ".join(map(repr, map(float, one.pose.orientation)))
        frames.append(
            f"Individual: {name}\n    Types: knowrob:{shorten(one.types[0])}\n    Facts: {', '.join(facts)}\n"
        )
        frames.append(
            f"Individual: pose_{name}\n    Types: knowrob:RotationMatrix3D\n"
            f'    Facts: knowrob:translation "{place}", knowrob:quaternion "{turn}"\n'
        )
    return "".join(frames)


def main() -> int:
    """Measure, print a row for each run and a line for each robot."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--rooms", type=int, default=30)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--robots", default="amigo,pr2")
    given = parser.parse_args()
    print("| scenario | seed | goal | plan time [s] | wall clock [s] |\n|---|---|---|---|---|")
    reached: Counter[str] = Counter()
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(given.first, given.first + given.rooms):
            path = Path(folder) / f"cabinet_{seed}.omn"
            path.write_text(written(cabinet(seed)), encoding="utf-8")
            for robot in given.robots.split(","):
                arguments = ("fetch_from_cabinet", "--robot", robot, "--environment", str(path), "--start=-1,0,0")
                goal, watchers = fetched("bottle1", "leaf"), (touching("bottle1", "leaf", but=("grip",)),)
                good, text = row(Scenario(f"cabinet {seed}, {robot}", arguments, goal, watchers), 0)
                reached[robot] += good
                print(text, flush=True)
    for robot in given.robots.split(","):
        print(f"{robot}: {reached[robot]} of {given.rooms}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
