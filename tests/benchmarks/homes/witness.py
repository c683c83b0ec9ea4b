"""A witness that a task is possible for a robot, with none of the code that the robot plans with.

For each thing that has to be possible (:class:`~tests.benchmarks.homes.tasks.Need`) it first asks what is necessary in
any case; what breaks that is impossible, for a reason that the product has to name. Then it looks for a certificate
(:mod:`tests.benchmarks.homes.certificates`). What has neither is open, and counts as possible. Necessary conditions err
to the side of possible: margins are added to what the arm reaches, and taken from what the base needs.
"""

from __future__ import annotations

import itertools
import math
import re
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import cached_property

import numpy as np

from executive.maps.scene import default_starts
from executive.robots import Robot
from planlang.geometry import Array, Pose
from planlang.state.matter import KG_PER_ML
from sim import Body, Scene
from sim.joints import Articulation, JointKind
from tests.benchmarks.homes.approaches import NEARLY, Approaches
from tests.benchmarks.homes.certificates import Search, areas
from tests.benchmarks.homes.floor import Floor
from tests.benchmarks.homes.tasks import Need, Task
from tests.support.locations.dense_sampler import Joints
from tests.support.locations.oracle import Oracle
from tests.support.locations.plates import least_width
from tests.support.locations.rooms import Room

POSTURES = 20_000
"""Random postures of an arm that say how far it reaches."""
MARGIN = 0.05
"""Distance by which an arm may reach farther than in any of them [m]."""
LEVEL = 0.1
"""Height of the layers in which it is said how far the arm reaches [m]."""
GROUND = Body("the ground", Pose((0.0, 0.0, -0.055)), (60.0, 60.0, 0.1))
"""What arms must not go through; wheels stand a little above it."""
SPOTS = 0.02
"""Resolution of a support on which it is looked for room [m]."""
TURNS = np.arange(6) * math.pi / 6
TIGHT = 0.003
"""Extents of a thing are taken to be shorter by this when room is looked for [m]."""
SECONDS, ALTOGETHER = 24.0, 100.0
"""CPU time for the certificate of one need, and after which no other door is tried instead of that meant [s]."""


BY_EDGE = ("DinnerPlate", "Bowl-Eating", "Sponge-CleaningImplement", "SoupPot")
"""Classes of what is taken by a rim or handles, or gives way."""
BY_TWO_HANDS = ("SoupPot",)
"""Classes of what two hands carry."""
MASS = "knowrob:massOfObject "


class Answer(StrEnum):
    """The answers of the witness."""

    POSSIBLE = "possible"
    IMPOSSIBLE = "impossible"
    OPEN = "open"


RIGHT_REASONS: Mapping[str, str] = {
    "too wide": r"GraspTooWide|too wide|m wide, and|m wide, .* opens to",
    "too heavy": r"TooHeavy|weighs",
    "too high": r"too high|out of reach|reaches (only )?up to|\bup to \d",
    "no hand": r"(one|1|two|2|both) hands?\b|no (other|free|second) hand",
    "out of reach": r"out of reach|too (high|low)|reaches|closer than|no nearer than|no (path|way)|cannot (stand|get)",
    "no camera": r"without (a )?camera|no camera",
    "no floor": r"no room for the base|no path|NavigationPose|cannot (stand|get|drive)|out of reach|no nearer than",
    "too narrow": r"too narrow|m wide; |no path|no way|cannot drive|NavigationPose",
    "no room": r"no room (for|on|in)|does not fit|is full|too (high|large|big) for",
}
"""Kind of impossibility -> what the failure's classes or message say if the product has found the right reason."""


@dataclass(frozen=True)
class Verdict:
    """The answer for a task: that of its weakest need; ``kind`` and ``thing`` say why it is impossible."""

    answer: Answer
    kind: str = ""
    thing: str = ""
    why: str = ""
    open: tuple[str, ...] = ()
    """The first need of which neither is shown."""

    def row(self) -> dict[str, object]:
        """Return what a row keeps of it."""
        return {"answer": self.answer.value, "kind": self.kind, "thing": self.thing, "why": self.why, "open": self.open}


def is_right_reason(verdict: Mapping[str, str], failure: Sequence[str], message: str) -> bool:
    """Return True if classes or message of a failure name the reason why a task is impossible, and the thing."""
    said = " ".join((*failure, message))
    return re.search(RIGHT_REASONS[verdict["kind"]], said) is not None and verdict["thing"] in message


class _Broken(Exception):
    """A necessary condition is broken."""

    def __init__(self, kind: str, thing: str, why: str) -> None:
        super().__init__(why)
        self.kind, self.thing = kind, thing


@dataclass(frozen=True)
class Reach:
    """Points that an arm's tip gets to, over the floor: the farthest from the base's middle in layers of height."""

    highest: float
    radii: Array

    @staticmethod
    def of(chain: Joints) -> Reach:
        """Return it by random postures, and those at the ends of the joints."""
        rng = np.random.default_rng(0)
        q = rng.uniform(chain.lower, chain.upper, (POSTURES, len(chain.names)))
        ends = rng.integers(0, 3, q.shape)
        q = np.where(ends == 0, chain.lower, np.where(ends == 1, chain.upper, q))
        tips = np.concatenate([chain.forward(part)[0][:, :3, 3] for part in np.array_split(q, 10)])
        layers = np.clip(tips[:, 2] / LEVEL, 0, 49).astype(int)
        radii = np.zeros(50)
        np.maximum.at(radii, layers, np.hypot(tips[:, 0], tips[:, 1]))
        return Reach(float(tips[:, 2].max()) + MARGIN, radii + MARGIN)

    def radius(self, low: float, high: float) -> float:
        """Return how far the tip gets at some height between two."""
        first, last = (int(np.clip(height / LEVEL, 0, 49)) for height in (low - MARGIN, high + MARGIN))
        return float(self.radii[first : last + 1].max())


def hand_of(robot: Robot) -> tuple[float, float]:
    """Return how wide the hands of a robot open [m], and what they carry [kg]."""
    hands = [arm for arm in robot.arms if arm.gripper is not None]
    widest = max((arm.gripper.max_opening for arm in hands if arm.gripper), default=0.0)
    return widest, max((arm.payload for arm in hands), default=0.0)


def suited_to(robot: Robot) -> Callable[[Task], bool]:
    """Return whether the hands of a robot are large and strong enough for what a task has it take.

    Plates, bowls and sponges count as such: they are taken by the rim, or give way.
    """
    widest, strongest = hand_of(robot)

    def suits(task: Task) -> bool:
        for thing in (task.home.things[need.thing] for need in task.needs if need.kind == "grasp"):
            assert thing.size is not None
            if min(thing.size[:2]) > widest and thing.cls not in BY_EDGE:
                return False
            most = strongest * (2 if thing.cls in BY_TWO_HANDS else 1)
            if any(float(fact.split()[1]) > most for fact in thing.facts if fact.startswith(MASS)):
                return False
        return True

    return suits


class Witness:
    """A robot in a true scene."""

    def __init__(self, scene: Scene, robot: Robot) -> None:
        places = (scene.start, *default_starts(scene, robot.base.radius))
        self.scene, self.robot = scene, robot
        bodies = (*scene.bodies, GROUND)
        self.oracle = Oracle(Room("home", 0, bodies), robot)
        self.oracle.room = Room("home", 0, bodies, self._start(places))
        self.chains = {
            arm.name: Joints.read(robot.urdf, robot.base_link, arm.tip, self.oracle.limits) for arm in robot.arms
        }
        self.joints = {joint.leaf: joint for joint in scene.joints}
        self.floor = Floor(self.oracle, scene)
        self.search = Search(self.oracle, self.chains, self.floor, SECONDS)
        self.approaches = Approaches(self.oracle, self.chains, scene, self.floor, self.search.grips)

    def _start(self, places: Sequence[tuple[float, float, float]]) -> tuple[float, float, float]:
        for place in places:
            self.oracle.place(place, self.oracle.posture)
            if self.oracle.touched(itself=False) is None:
                return place
        return places[0]

    def close(self) -> None:
        """End its client."""
        self.oracle.close()

    def decide(self, needs: Sequence[Need]) -> Verdict:
        """Return the answer for what all has to be possible."""
        if broken := self.broken(needs):
            return broken
        first, until = None, time.process_time() + ALTOGETHER
        for way in self._ways(needs):
            if time.process_time() > until:
                break
            unproved = self._unproved(way)
            if unproved is None:
                return Verdict(Answer.POSSIBLE)
            first = first or unproved
        assert first is not None
        return Verdict(Answer.OPEN, open=(f"{first.kind} {first.thing}",))

    def _unproved(self, needs: Sequence[Need]) -> Need | None:
        """Return the first need for which there is no certificate, None if all have one."""
        leaves = tuple(dict.fromkeys(need.thing for need in needs if need.kind == "open"))
        return next((one for one in needs if not self.search.certified(one, self.scene, leaves)), None)

    def _ways(self, needs: Sequence[Need]) -> Iterator[tuple[Need, ...]]:
        """Yield needs as they are, then with the other door of furniture where either will do, then with both."""
        yield tuple(needs)
        named = {need.thing: need.at for need in needs if need.either and need.kind in ("open", "close")}
        others = {
            leaf: joint.leaf
            for leaf, holder in named.items()
            for joint in self.scene.joints
            if joint.holder == holder and joint.leaf != leaf and joint.kind is JointKind.HINGED
        }
        for both in (False, True) if others else ():
            swapped = []
            for need in needs:
                is_swapped = need.thing in others and need.kind in ("open", "close")
                other = replace(need, thing=others[need.thing]) if is_swapped else need
                swapped += [need, other] if both and is_swapped else [other]
            yield tuple(swapped)

    # Necessary conditions

    def broken(self, needs: Sequence[Need]) -> Verdict | None:
        """Return why needs are impossible, None if nothing that is necessary is broken."""
        try:
            for need in needs:
                self._necessary(need)
            for need in needs:
                self._check_hands_get_near(need)
        except _Broken as problem:
            return Verdict(Answer.IMPOSSIBLE, problem.kind, problem.thing, str(problem))
        return None

    def _necessary(self, need: Need) -> None:
        """Raise _Broken if what is necessary for a need is not so."""
        if need.kind == "pass":
            self._check_doorway(need.thing)
            return
        body = self.scene.body(need.thing)
        self._check_hands(body, 2 if need.kind == "hold" else body.hands)
        if need.kind in ("grasp", "pour", "place", "hand over", "wipe"):
            self._check_hand(body)
        if need.kind == "grasp":
            self._check_reach(body, self._spans(body))
        if need.kind == "see" and self.robot.camera is None:
            raise _Broken("no camera", body.name, f"the robot has no camera to look for {body.name}")
        if need.kind in ("open", "close"):
            joint = self.joints[need.thing]
            handle = self.scene.body(joint.handle or joint.leaf)
            self._check_reach(handle, self._spans(handle, joint))
        if need.kind == "press":
            self._check_reach(body, self._spans(body))
        if need.kind == "place":
            self._check_room(body, need.at)
            self._check_place(body, need.at)

    def _check_hands(self, body: Body, hands: int) -> None:
        has = sum(arm.gripper is not None for arm in self.robot.arms)
        if has < hands:
            raise _Broken("no hand", body.name, f"{body.name} needs {hands} hands, the robot has {has}")

    def _check_hand(self, body: Body) -> None:
        by_edge = body.wall > 0 or body.soft or bool(body.handles)
        widest, strongest = hand_of(self.robot)
        across = min(body.size[:2])  # its support is below it: no fingers close from above and below
        if across > widest and not by_edge:
            raise _Broken("too wide", body.name, f"{body.name} is {across:.3f} m across, hands open to {widest:.3f} m")
        mass = body.mass + sum(one.amount for one in body.content) * KG_PER_ML
        if mass > strongest * body.hands:
            raise _Broken("too heavy", body.name, f"{body.name} weighs {mass:.2f} kg, not {strongest:.2f} kg")

    def _spans(self, body: Body, joint: Articulation | None = None) -> Array:
        """Return places (n, 3) at which a body is taken: where it is, and where its drawer or door brings it."""
        joint = joint or next((one for one in self.scene.joints if self._carries(one, body)), None)
        values = np.linspace(0.0, joint.upper, 5).tolist() if joint else []
        poses = [body.pose, *((joint.motion(value) @ body.pose) for value in values if joint)]
        return np.array([pose.position for pose in poses])

    def _carries(self, joint: Articulation, body: Body) -> bool:
        leaf = self.scene.body(joint.leaf)
        local = (leaf.pose.inverse() @ body.pose).position
        return body.name in joint.bodies or bool((np.abs(local) < np.array(leaf.size) / 2).all())

    @cached_property
    def reaches(self) -> dict[str, Reach]:
        """What each arm reaches."""
        return {name: Reach.of(chain) for name, chain in self.chains.items()}

    def _check_place(self, body: Body, at: str) -> None:
        """Raise _Broken if no arm reaches any place on or in a support where a thing would stand."""
        joint = self.joints.get(at)
        values = np.linspace(0.0, joint.upper, 5).tolist() if joint and joint.kind is JointKind.PRISMATIC else [0.0]
        places = []
        for (frame, size, _), value in itertools.product(areas(self.scene, at, {}), values):
            moved = joint.motion(value) @ frame if joint and value else frame
            x, y = (np.linspace(-extent / 2, extent / 2, 2 + int(extent / LEVEL)) for extent in size)
            places += [(moved @ Pose((one, other, body.size[2] / 2))).position for one in x for other in y]
        self._check_reach(body, np.array(places), at)

    def _check_reach(self, body: Body, places: Array, at: str = "") -> None:
        """Raise _Broken if no arm reaches any of some places, by their height or by the floor before them.

        They are those of a body, or those ``at`` a support where it would stand.
        """
        half = float(np.linalg.norm(body.size)) / 2 if body.movable else max(body.size) / 2
        low, high = places[:, 2].min() - half, places[:, 2].max() + half
        name, what = at or body.name, f"the place for {body.name} at {at}" if at else body.name
        reaches = self.reaches.values()
        if low > (top := max(one.highest for one in reaches)):
            raise _Broken("too high", name, f"{what} is at {low:.2f} m, the arms reach up to {top:.2f} m")
        radius = max(one.radius(low, high) for one in reaches) + half
        cells = self.floor.cells
        away = np.linalg.norm(cells[:, None] - places[None, :, :2], axis=2)
        if not len(cells) or away.min() > radius:
            raise _Broken("no floor", name, f"no free floor within {radius:.2f} m of {what}")

    def _check_hands_get_near(self, need: Need) -> None:
        """Raise _Broken if no hand gets near to what it takes, however base and arm are moved."""
        known = self.approaches.aims(need)
        if known is None or (left := self.approaches.remains(*known)) < NEARLY:
            return
        name = need.at if need.kind == "place" else need.thing
        raise _Broken("out of reach", name, f"no hand gets nearer than {left:.3f} m to {need.kind} {need.thing}")

    def _check_doorway(self, name: str) -> None:
        """Raise _Broken if the base is wider than a doorway."""
        wide, base = self.scene.body(name).size[1], least_width(self.oracle)
        if wide < base:
            raise _Broken("too narrow", name, f"{name} is {wide:.2f} m wide, the base at least {base:.2f} m")

    def _check_room(self, thing: Body, at: str) -> None:
        """Raise _Broken if there is nowhere on or in a support that a thing would fit."""
        if not any(True for _ in self.search.spots(self.scene, thing, at, SPOTS, TURNS, TIGHT)):
            raise _Broken("no room", at, f"no room on {at} for {thing.name}")
