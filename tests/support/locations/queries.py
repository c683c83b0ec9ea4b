"""Random questions, sensible and not, and whether they leave the world, the belief and the memory as they were.

    python -m tests.support.locations.queries 1000

asks a thousand: for places of the base, ways of a hand, poses of things, and whether something holds; of each some are
answered, some fail, some are interrupted as by Ctrl-C, closed after an answer, or evaporated in a plan. After each the
state of world, physics, belief and random numbers has to be what it was. Then a thousand resolutions in a row, of which
the last half must not take more memory. Exit code 1 if not.
"""

from __future__ import annotations

import argparse
import gc
import resource
import sys
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from itertools import islice
from types import FrameType
from typing import Any

import numpy as np

from planlang import VirtualHost, pursue, run, sleep
from planlang.designators import (
    GRASPS,
    Location,
    Object,
    Relation,
    a_device,
    an_object,
)
from planlang.failures import PlanFailure
from planlang.relations import RELATIONS
from sim.engine import bullet
from tests.support.locations.oracle import Oracle
from tests.support.locations.predicates import CHECKED, objections
from tests.support.locations.rooms import THE_BOTTLE, THE_PATIENT, Room, asked, room_of, thing
from tests.support.locations.stage import Stage, robot_of
from tests.support.world_values import value_of

DEVICES = (None, None, a_device("RightArm"), a_device("LeftGripper"))


def random_location(rng: np.random.Generator, room: Room, depth: int = 0) -> Location:
    """A conjunction of one to three relations to things of a room, to places, or to what is not there."""
    relations = tuple(_relation(rng, room, depth) for _ in range(int(rng.choice([1, 1, 2, 3]))))
    device = DEVICES[int(rng.integers(len(DEVICES)))]
    grasp = GRASPS[int(rng.integers(len(GRASPS)))] if rng.random() < 0.2 else None
    return Location(relations, device=device, grasp=grasp)


def _relation(rng: np.random.Generator, room: Room, depth: int) -> Relation:
    usual = ("in_reach_of", "visible_from", "near", "in_front_of", "next_to", "clear_of")
    names = usual if rng.random() < 0.7 else tuple(RELATIONS)
    name = names[int(rng.integers(len(names)))]
    references: tuple[Object | Location, ...] = tuple(_thing(rng, room) for _ in range(RELATIONS[name].arity))
    if depth == 0 and rng.random() < 0.2:
        references = (random_location(rng, room, 1), *references[1:])
    within = float(rng.uniform(0.1, 2.0)) if RELATIONS[name].measured and rng.random() < 0.3 else None
    return Relation(name, references, within, negated=bool(rng.random() < 0.15))


def _thing(rng: np.random.Generator, room: Room) -> Object:
    kind = rng.random()
    if kind < 0.4:
        return THE_BOTTLE
    if kind < 0.6:
        return THE_PATIENT
    if kind < 0.95:
        body = room.bodies[int(rng.integers(len(room.bodies)))]
        return thing(body)
    return an_object("Bathtub")


def check_areas(stage: Stage, number: int, seed: int) -> Iterator[tuple[list[str], bool]]:
    """Ask for random conjunctions about the floor; what places do not keep, and whether there were any."""
    rng, room = np.random.default_rng(seed), stage.room
    for _ in range(number):
        relations = []
        for _ in range(int(rng.integers(1, 4))):
            name = CHECKED[int(rng.integers(len(CHECKED)))]
            within = float(rng.uniform(0.2, 2.0)) if RELATIONS[name].measured and rng.random() < 0.4 else None
            body = room.bodies[int(rng.integers(1, len(room.bodies)))]
            relations.append(Relation(name, (thing(body),), within, None, bool(rng.random() < 0.2)))
        location = Location(tuple(relations))
        places = stage.ask(location, 3).solutions
        viewer = room.start[:2]
        found = [text for s in places for text in objections(room, stage.robot, s.base, location, viewer)]
        yield found, bool(places)


def check_reaches(stage: Stage, oracle: Oracle, number: int, seed: int) -> Iterator[tuple[list[str], bool]]:
    """Ask for random conjunctions with reach and sight; what places do not keep, and if there were any."""
    rng, room = np.random.default_rng(seed), stage.room
    # the oracle tells how much of a thing it sees where that is as wide from all sides and fits into the picture
    seen = [b for b in room.bodies if min(b.size) > 0.15 and max(b.size) < 0.65 and 0.8 < b.size[0] / b.size[1] < 1.25]
    for _ in range(number):
        relations = [Relation("in_reach_of", (THE_BOTTLE,))]
        if rng.random() < 0.3:
            relations.append(Relation("visible_from", (thing(seen[int(rng.integers(len(seen)))]),)))
        for _ in range(int(rng.integers(0, 3))):
            body = room.bodies[int(rng.integers(1, len(room.bodies)))]
            name = CHECKED[int(rng.integers(len(CHECKED)))]
            relations.append(Relation(name, (thing(body),), None, None, bool(rng.random() < 0.6)))
        location = Location(tuple(dict.fromkeys(relations)))
        places = stage.ask(location, 2).solutions
        found = []
        for place in places:
            found += objections(room, stage.robot, place.base, location, room.start[:2])
            claim = stage.claim(place, THE_BOTTLE)
            problem = "no way to the bottle" if claim is None else oracle.objection(claim) or oracle.is_grasp(claim)
            found += [] if problem is None else [f"{place.base}: {problem}"]
            for relation in relations:
                if relation.name == "visible_from" and isinstance(relation.references[0], Object):
                    body = next(body for body in room.bodies if thing(body) == relation.references[0])
                    if not oracle.sees(place.base, body.name):
                        found.append(f"{place.base}: {body.name} is not visible")
        yield found, bool(places)


def snapshot(stage: Stage) -> tuple[object, ...]:
    """Everything that a question must leave alone: world, physics, what is believed, where the generators stand."""
    belief = stage.platform.belief
    # bodies are made when something first comes near them, which changes nothing: they are all made before they count
    stage.world._bodies.fill(np.full(3, -1e3), np.full(3, 1e3))
    return (
        value_of(stage.world),
        physics(stage.world.robot.client),
        belief.revision,
        tuple((name, belief.pose(name)) for name in belief.names()),
        tuple(belief.held.items()),
        repr(stage.platform.rng.bit_generator.state),
        tuple(stage.platform.arms.choices.made.items()),
        tuple(stage.platform.arms.begun.items()),
    )


def physics(client: int) -> tuple[object, ...]:
    """Return where all bodies of a physics client are, and how all their joints stand."""
    found = []
    for index in range(bullet.getNumBodies(physicsClientId=client)):
        uid = bullet.getBodyUniqueId(index, physicsClientId=client)
        joints = range(bullet.getNumJoints(uid, physicsClientId=client))
        states = [bullet.getJointState(uid, joint, physicsClientId=client)[:2] for joint in joints]
        found.append((uid, bullet.getBasePositionAndOrientation(uid, physicsClientId=client), tuple(states)))
    return tuple(found)


class Interrupter:
    """Raises KeyboardInterrupt at the n-th call of a function, as Ctrl-C may at any."""

    def __init__(self, calls: int) -> None:
        self.left = calls

    def __enter__(self) -> None:
        sys.setprofile(self._count)

    def __exit__(self, *problem: object) -> bool:
        sys.setprofile(None)
        return problem[0] is KeyboardInterrupt

    def _count(self, frame: FrameType, event: str, argument: Any) -> None:
        if event == "call":
            self.left -= 1
            if self.left == 0:
                sys.setprofile(None)
                raise KeyboardInterrupt


@dataclass(frozen=True, slots=True)
class Asked:
    """Endings of questions, and those that changed something."""

    endings: Counter[str]
    changed: tuple[str, ...]
    other_failures: tuple[str, ...]
    """Exceptions that are no failures of a plan: programming errors."""
    growth: float
    """Of the largest memory of the process in the second half [MB]."""


KINDS = ("base", "base", "base", "hand", "thing", "holds")
"""What is asked for."""


def ask_many(stage: Stage, number: int, *, seed: int = 0, tell: Callable[[str], None] = lambda line: None) -> Asked:
    """Ask random questions; some are interrupted, closed after their first answer, or evaporated in a plan."""
    rng = np.random.default_rng(seed)
    endings: Counter[str] = Counter()
    changed, wrong = [], []
    stage.platform.observe()
    before = snapshot(stage)
    half = 0.0
    for index in range(number):
        if index == number // 2:
            gc.collect()
            half = _memory()
        location = random_location(rng, stage.room)
        kind, calls = KINDS[int(rng.integers(len(KINDS)))], int(rng.integers(1, 4000))
        try:
            ended = _ended(_asked(stage, kind, location, rng), index % 5, calls)
        except PlanFailure as failure:
            ended = type(failure).__name__
        except Exception as problem:
            ended = f"{type(problem).__name__}: {problem}"
            wrong.append(f"{kind} {location}: {ended}")
        endings[ended.split(":")[0]] += 1
        stage.platform.observe()
        if snapshot(stage) != before:
            changed.append(f"{kind} {location}")
            tell(f"{kind} {location} changed the world ({ended})")
            before = snapshot(stage)
    gc.collect()
    return Asked(endings, tuple(changed), tuple(wrong), _memory() - half)


def _asked(stage: Stage, kind: str, location: Location, rng: np.random.Generator) -> Iterator[object]:
    """The answers to a question, lazily."""
    platform = stage.platform
    arm = platform.scene.arms.all[int(rng.integers(len(platform.scene.arms.all)))]
    match kind:
        case "base":
            return platform.resolver.bases(location)
        case "hand":
            return platform.resolver.hands(location, arm, platform.arm_joints(arm))
        case "thing":
            return platform.resolver.things(location, THE_BOTTLE)
    what = (None, THE_BOTTLE, a_device(f"{arm.name.capitalize()}Arm"))[int(rng.integers(3))]
    return (platform.resolver.holds(location, what) for _ in range(2))


def _ended(answers: Iterator[object], how: int, calls: int) -> str:
    """Ask in one of five manners; how it ended."""
    match how:
        case 0:
            next(answers, None)
            del answers
            return "given up after one"
        case 1:
            next(answers, None)
            if (close := getattr(answers, "close", None)) is not None:
                close()
            return "closed after one"
        case 2:
            return f"evaporated with {_evaporated(answers)}"
        case 3:
            ended = "interrupted"
            with Interrupter(calls):
                ended = "answered" if list(islice(answers, 2)) else "none"
            return ended
    return f"answered {len(list(islice(answers, 3)))}"


def _evaporated(answers: Iterator[object]) -> int:
    """Ask in a branch of a plan that is evaporated between its second answer and the third; the number of answers."""
    found: list[object] = []

    async def ask() -> None:
        for answer in answers:
            found.append(answer)
            await sleep(1.0)
        await sleep(60.0)

    run(partial(pursue, partial(sleep, 1.5), ask), host=VirtualHost())
    return len(found)


def resolve_again(stage: Stage, location: Location, number: int) -> float:
    """Resolve a location so many times, the belief changed in between; growth of memory in the second half [MB]."""
    half = 0.0
    for index in range(number):
        if index == number // 2:
            gc.collect()
            half = _memory()
        stage.platform.belief.revision += 1
        stage.ask(location)
    gc.collect()
    return _memory() - half


def _memory() -> float:
    """Resident memory of this process now [MB]; where the system does not say, the largest it has been."""
    try:
        with open("/proc/self/statm", encoding="ascii") as file:
            return int(file.read().split()[1]) * resource.getpagesize() / 1e6
    except OSError:
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3


def main() -> int:
    """Ask, resolve, print; 1 if something changed, grew, or ended in an internal error."""
    options = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    options.add_argument("number", nargs="?", type=int, default=1000, help="questions (default: 1000)")
    number = options.parse_args().number
    room, robot = some_stage()
    stage = Stage(room, robot_of(robot))
    asked_many = ask_many(stage, number, tell=print)
    for ending, count in asked_many.endings.most_common():
        print(f"{count:5} {ending}")
    for line in asked_many.other_failures:
        print(f"internal error: {line}")
    growth = resolve_again(stage, asked(room), number)
    stage.close()
    print(f"{number} questions in {room.name}: {len(asked_many.changed)} changed something")
    print(f"{number} resolutions: {growth:+.1f} MB in the last half")
    return int(bool(asked_many.changed or asked_many.other_failures) or growth > 2.0)


def some_stage() -> tuple[Room, str]:
    """A room for questions and the robot that asks in it."""
    return room_of("person in bed", 3), "amigo"


if __name__ == "__main__":
    sys.exit(main())
