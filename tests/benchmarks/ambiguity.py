"""Things that look alike: what the belief says of looks drawn at random, and whether the right one is delivered.

    python -m tests.benchmarks.ambiguity looks [--looks 200] [--first 0]
    python -m tests.benchmarks.ambiguity worlds [--worlds 10] [--first 0]

A look is ambiguous in truth if another thing of the class and features of the thing that is meant is within its gate:
precision and recall are those of what the belief says of the look. The true world is seen by the simulator's camera.

In a world two bottles alike stand on a cabinet, at times swapped, and a third that no map has; chairs stand about.
In every second world marks tell the bottles apart. The recipe serves bottle1, which is judged in truth.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from executive.belief.association import MAP_GATE, SEEN_GATE
from executive.belief.obstacles import with_store
from executive.maps import MapObject, SemanticMap
from executive.modules.platform import Platform
from executive.robots import Robot, bind_robot
from executive.runs.assembly import platform_of
from executive.runs.options import RunOptions
from executive.runs.plan_run import run_plan_file
from planlang.designators import an_object
from planlang.files import bundled
from planlang.geometry import Pose
from planlang.ontology import Ontology, expand, load
from planlang.protocols import Configuration
from sim import Body, PlanningWorld, PyBulletWorld, Scene
from sim.likeness import is_like

MAP = "http://example.org/alike.owl#"
HERE = (0.0, 0.0, 0.0)
TABLE = Body("table1", Pose((1.6, 0.0, 0.3)), (0.8, 2.4, 0.6), type="Table-PieceOfFurniture")
SIZES = ((0.08, 0.08, 0.1), (0.08, 0.08, 0.16), (0.06, 0.06, 0.24))
MARKS = (None, "Ann", "Ben")
AWAY = 0.1
"""Share of the cups that somebody has taken away."""
LOOKS_PER_ROOM = 5
"""Looks at the same things at different places."""


@dataclass(frozen=True, slots=True)
class Look:
    """A look at a thing: whether others like it are within its gate, and what the belief says."""

    name: str
    is_ambiguous: bool
    is_said: bool


def _things(rng: np.random.Generator, number: int) -> list[Body]:
    """Draw cups on the table, some of which are alike."""
    spots = rng.permutation(np.linspace(-1.0, 1.0, 11))[:number]
    made = []
    for index, y in enumerate(spots.tolist(), 1):
        size, mark = SIZES[rng.integers(len(SIZES))], MARKS[rng.integers(len(MARKS))]
        x = 1.35 + 0.4 * float(rng.random())
        made.append(Body(f"cup{index}", Pose((x, y, 0.6 + size[2] / 2)), size, "cylinder", type="Cup", movable=True))
        made[-1] = replace(made[-1], mark=mark)
    return made


def looks(robot: Robot, ontology: Ontology, seed: int) -> Iterator[Look]:
    """Draw a room, and look at its cups several times, each time displaced anew; twice with what was seen before."""
    rng = np.random.default_rng([44, seed])
    known = _things(rng, int(rng.integers(2, 6)))
    strange = replace(known[0], name="strange", pose=Pose((1.2, 0.0, known[0].pose.position[2])))
    there = [*known, *([strange] if rng.random() < 0.3 else [])]
    things = (MapObject(MAP + one.name, one.name, (expand(one.type),), one.pose, one.size) for one in (TABLE, *known))
    semantic_map = SemanticMap(MAP, ontology, tuple(things), ())
    with ExitStack() as stack:
        truth = PyBulletWorld(Scene((TABLE, *there), start=HERE), robot.body())
        believed = PlanningWorld(with_store(Scene((TABLE, *known), start=HERE)), robot.body())
        stack.callback(truth.close)
        stack.callback(believed.close)
        for _ in range(LOOKS_PER_ROOM):
            platform = platform_of(robot, semantic_map, truth, believed, 0)
            belief, meant = platform.belief, known[int(rng.integers(len(known)))].name
            belief.bind(an_object("Cup", MAP + meant), HERE)
            for gate in (MAP_GATE, SEEN_GATE):
                for one in there:
                    x, y, z = one.pose.position
                    shift = rng.normal(0.0, 0.03, 2).tolist()
                    is_away = one.name != meant and rng.random() < AWAY
                    truth.set_pose(one.name, Pose((x + shift[0], 9.0 if is_away else y + shift[1], z)))
                _look_at(platform, truth, meant)
                if gate is SEEN_GATE and not belief.seen(meant):
                    break
                around = belief.pose(meant)
                like = [one for one in there if one.name == meant or is_like(one, truth.scene.body(meant))]
                inside = [one for one in like if around.distance(truth.pose(one.name)) <= gate]
                platform.sensing.see()
                said = belief.alike(meant)
                yield Look(meant, len(inside) > 1, said is not None and (said.by is None or bool(said.same)))


def _look_at(platform: Platform, truth: PyBulletWorld, name: str) -> None:
    """Turn the camera to where a thing is believed to be."""
    gaze = platform.scene.visibility.gaze
    assert gaze is not None
    neck, _, _ = gaze.at(np.array(platform.belief.pose(name).position))
    truth.set_configuration(Configuration(HERE, dict(zip(gaze.joints, neck.tolist(), strict=True))))
    platform.observe()


def precision_and_recall(seen: Sequence[Look]) -> tuple[float, float]:
    """Compute the share of right ones of those said, and of those said of the right ones."""
    right = sum(one.is_ambiguous and one.is_said for one in seen)
    return right / max(sum(one.is_said for one in seen), 1), right / max(sum(one.is_ambiguous for one in seen), 1)


def many_looks(number: int, first: int = 0) -> list[Look]:
    """Draw rooms until there are so many looks."""
    robot, ontology = bind_robot("amigo"), load(bundled("ontologies") / "knowrob.omn")
    seen = list[Look]()
    seed = first
    while len(seen) < number:
        seen += looks(robot, ontology, seed)
        seed += 1
    return seen[:number]


HEAD = """Prefix: : <http://example.org/{name}.owl#>
Prefix: knowrob: <http://knowrob.org/kb/knowrob.owl#>
Prefix: room: <http://planlang.org/kb/hospital_room.owl#>
Ontology: <http://example.org/{name}.owl>
    Import: <{imports}>
"""
THING = """
Individual: {name}
    Types: knowrob:{cls}
    Facts: knowrob:pose {name}_at, knowrob:depthOfObject {size[0]}, knowrob:widthOfObject {size[1]},
        knowrob:heightOfObject {size[2]}{mark}
Individual: {name}_at
    Types: knowrob:RotationMatrix3D
    Facts: knowrob:translation "{at}", knowrob:quaternion "0 0 0 1"
"""
BOTTLE, CHAIR = (0.065, 0.065, 0.2), (0.5, 0.5, 0.9)
PLACES = ((-2.72, -0.8), (-2.72, -0.5), (-2.72, -1.05))
CHAIRS = ((-1.2, 0.6), (0.2, -1.2), (0.9, 0.4))


@dataclass(frozen=True, slots=True)
class Served:
    """What became of serving bottle1 in a world."""

    seed: int
    is_marked: bool
    is_done: bool
    delivered: tuple[str, ...]
    """What the patient has in the end."""
    is_wrong: bool
    """True if that is another bottle, although a mark tells them apart."""
    message: str

    def __str__(self) -> str:
        marked = "marks" if self.is_marked else "alike"
        said = "done" if self.is_done else self.message.partition("\n")[0]
        wrong = ", WRONG" if self.is_wrong else ""
        return f"{self.seed:3d} {marked}: {said}; delivered: {', '.join(self.delivered) or 'nothing'}{wrong}"


def written(seed: int, folder: Path) -> RunOptions:
    """Write a world into a folder; return the options of a run that serves bottle1 in it."""
    rng, is_marked = np.random.default_rng([45, seed]), seed % 2 == 0
    marks = {
        name: f', knowrob:markOfObject "{mark}"' if is_marked else "" for name, mark in zip("123", MARKED, strict=True)
    }
    first = f'\nIndividual: room:bottle1\n    Facts: knowrob:markOfObject "{MARKED[0]}"\n' if is_marked else ""
    places = [f"{x} {y + float(rng.uniform(-0.05, 0.05)):.3f} 0.9" for x, y in PLACES]
    known = THING.format(name="bottle2", cls="DrinkingBottle", size=BOTTLE, at=places[1], mark=marks["2"])
    room = HEAD.format(name="alike", imports="http://planlang.org/kb/hospital_room.owl") + first + known
    (folder / "alike.omn").write_text(room)
    third = THING.format(name="bottle3", cls="DrinkingBottle", size=BOTTLE, at=places[2], mark=marks["3"])
    x, y = CHAIRS[int(rng.integers(len(CHAIRS)))]
    chair = THING.format(name="chair9", cls="Chair-PieceOfFurniture", size=CHAIR, at=f"{x} {y} 0.45", mark="")
    (folder / "world.omn").write_text(HEAD.format(name="world", imports="http://example.org/alike.owl") + third + chair)
    swapped = [*map(float, places[1].split())], [-2.72, -0.8, 0.9]
    moved = zip(("bottle1", "bottle2"), swapped, strict=True)
    changes = (
        [{"thing": name, "property": "translation", "value": at} for name, at in moved] if rng.random() < 0.6 else []
    )
    (folder / "swapped.json").write_text(json.dumps(changes))
    return RunOptions(
        recipe=bundled("recipes") / "serve_a_drink.omn",
        robot=bundled("ontologies") / "robots" / "amigo.omn",
        environment=folder / "alike.omn",
        world=[folder / "world.omn", *([folder / "swapped.json"] if changes else [])],
        ontologies=[folder],
        goal=["bottle1 held by patient1"],
    )


def served(seed: int, folder: Path) -> Served:
    """Serve bottle1 in a world that is written into a folder."""
    is_marked, result = seed % 2 == 0, run_plan_file(written(seed, folder))
    delivered = tuple(line.partition(":")[0] for line in result.final_state if line.endswith("held by patient1"))
    is_wrong = is_marked and any(name != "bottle1" for name in delivered)
    return Served(seed, is_marked, result.outcome.name == "DONE", delivered, is_wrong, result.message)


MARKED = ("Ann", "Ben", "Cid")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run what was asked for."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    commands = parser.add_subparsers(dest="command", required=True)
    for name, number in (("looks", 200), ("worlds", 10)):
        command = commands.add_parser(name)
        command.add_argument(f"--{name}", dest="number", type=int, default=number)
        command.add_argument("--first", type=int, default=0)
    options = parser.parse_args(arguments)
    if options.command == "looks":
        seen = many_looks(options.number, options.first)
        precision, recall = precision_and_recall(seen)
        said, true = sum(one.is_said for one in seen), sum(one.is_ambiguous for one in seen)
        print(f"{len(seen)} looks, {true} ambiguous, {said} said: precision {precision:.1%}, recall {recall:.1%}")
        return int(min(precision, recall) < 0.95)
    rows = []
    for seed in range(options.first, options.first + options.number):
        with TemporaryDirectory() as folder:
            rows.append(served(seed, Path(folder)))
        print(rows[-1], flush=True)
    wrong, good = sum(one.is_wrong for one in rows), sum(one.is_done for one in rows)
    print(f"{good} of {len(rows)} done, {wrong} wrong things delivered where a mark tells them apart")
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main())
