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
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from executive.maps.scene import default_starts
from executive.robots import Arm, Robot
from planlang.geometry import Array, Pose
from planlang.state.matter import KG_PER_ML
from sim import Body, Scene
from sim.joints import Articulation, JointKind
from tests.benchmarks.homes.certificates import Search, areas, outline
from tests.benchmarks.homes.furnishing import Rectangle
from tests.benchmarks.homes.tasks import Need, Task
from tests.support.locations.dense_sampler import Joints
from tests.support.locations.oracle import Oracle, walls_of
from tests.support.locations.plates import fingers_ahead, least_width
from tests.support.locations.rooms import Room

POSTURES = 20_000
"""Random postures of an arm that say how far it reaches."""
MARGIN = 0.05
"""Distance by which an arm may reach farther than in any of them [m]."""
FOLDED, MARGIN_LOW = 0.3, 0.015
"""Height over the lowest tips at which contacts matter [m]; by how much an arm may reach deeper than was found [m]."""
WALKED = 1500
"""Postures from which, and steps by which, the lowest one without contact is looked for."""
FAR_AWAY = (100.0, 100.0, 0.0)
"""Pose of the base where nothing stands."""
LEVEL = 0.1
"""Height of the layers in which it is said how far the arm reaches [m]."""
CELL = 0.04
"""Resolution of the floor [m]."""
CORE = 0.7
"""Share of the base's radius that is free of anything in any case: of a square in its circle."""
LOW = 0.2
"""Bodies that begin higher than this are not in the way of the base's lowest part [m]."""
SPOTS = 0.02
"""Resolution of a support on which it is looked for room [m]."""
TURNS = np.arange(6) * math.pi / 6
TIGHT = 0.003
"""Extents of a thing are taken to be shorter by this when room is looked for [m]."""
SECONDS = 4.0
"""CPU time for the certificate of one need [s]."""


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
    "too low": r"too low|out of reach|reaches (only )?down to|\bdown to \d",
    "no hand": r"(one|1|two|2|both) hands?\b|no (other|free|second) hand",
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
    """Needs of which neither is shown."""

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

    lowest: float
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
        return Reach(float(tips[:, 2].min()) - MARGIN, float(tips[:, 2].max()) + MARGIN, radii + MARGIN)

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
        self.oracle = Oracle(Room("home", 0, scene.bodies), robot)
        self.oracle.room = Room("home", 0, scene.bodies, self._start(places))
        self.chains = {
            arm.name: Joints.read(robot.urdf, robot.base_link, arm.tip, self.oracle.limits) for arm in robot.arms
        }
        self.joints = {joint.leaf: joint for joint in scene.joints}
        self.search = Search(self.oracle, self.chains, self.floor, SECONDS)

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
        leaves = tuple(dict.fromkeys(need.thing for need in needs if need.kind == "open"))
        unproved = tuple(
            f"{need.kind} {need.thing}" for need in needs if not self.search.certified(need, self.scene, leaves)
        )
        return Verdict(Answer.OPEN if unproved else Answer.POSSIBLE, open=unproved)

    # Necessary conditions

    def broken(self, needs: Sequence[Need]) -> Verdict | None:
        """Return why needs are impossible, None if nothing that is necessary is broken."""
        try:
            for need in needs:
                self._necessary(need)
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
        crown = places[:, 2].max() + self._upwards(body)
        if crown < min(one.lowest for one in reaches) + FOLDED and crown < (bottom := min(self.lowest)):
            raise _Broken("too low", name, f"{what} is at {crown:.2f} m, the fingers reach down to {bottom:.2f} m")
        radius = max(one.radius(low, high) for one in reaches) + half
        away = np.linalg.norm(self.floor[:, None] - places[None, :, :2], axis=2)
        if not len(self.floor) or away.min() > radius:
            raise _Broken("no floor", name, f"no free floor within {radius:.2f} m of {what}")

    def _upwards(self, body: Body) -> float:
        """Return how far a body extends over its middle [m]."""
        return float(np.abs(body.pose.rotation[2]) @ np.array(body.size)) / 2

    @cached_property
    def lowest(self) -> list[float]:
        """Height of the lowest end of each arm's fingers without contact, by descent from random postures."""
        return [self._lowest(arm, self.chains[arm.name]) - MARGIN_LOW for arm in self.robot.arms]

    def _lowest(self, arm: Arm, chain: Joints) -> float:
        rng, ahead = np.random.default_rng(0), max(fingers_ahead(self.oracle, arm.name), 0.0)

        def ends(q: Array) -> Array:
            frames = chain.forward(q)[0]
            downwards = np.minimum(frames[:, 2, :3] @ np.array(arm.approach), 0.0)
            return frames[:, 2, 3] + ahead * downwards

        def is_free(q: Array) -> bool:
            joints = dict(zip(chain.names, q.tolist(), strict=True))
            self.oracle.place(FAR_AWAY, {**self.oracle.posture, **joints})
            return self.oracle.touched(depth=0.005) is None

        drawn = rng.uniform(chain.lower, chain.upper, (POSTURES, len(chain.names)))
        order = drawn[np.argsort(ends(drawn))[:WALKED]]
        best = next(((float(ends(q[None])[0]), q) for q in order if is_free(q)), None)
        if best is None:
            return -math.inf
        for wide in np.geomspace(0.3, 0.01, WALKED).tolist():
            q = np.clip(best[1] + rng.normal(0.0, wide, len(chain.names)), chain.lower, chain.upper)
            if (low := float(ends(q[None])[0])) < best[0] and is_free(q):
                best = low, q
        return best[0]

    @cached_property
    def floor(self) -> Array:
        """Middles (n, 2) of the cells that the core of the base gets to from the start."""
        start = np.array(self.oracle.room.start[:2])
        if self.robot.base.fixed:
            return start[None]
        rooms = [body for body in self.scene.bodies if body.shape == "room"]
        corners = np.concatenate([outline(room).corners() for room in rooms])
        low, high = corners.min(axis=0), corners.max(axis=0)
        steps = [np.arange(one, other, CELL) + CELL / 2 for one, other in zip(low, high, strict=True)]
        grid = np.stack(np.meshgrid(*steps, indexing="ij"), -1)
        points, keep = grid.reshape(-1, 2), CORE * self.robot.base.radius
        free = np.any([area.distances(points) == 0 for room in rooms for area in (outline(room), *_openings(room))], 0)
        walls = ((room, at, size) for room in rooms for at, size in walls_of(room))
        hung = {name for joint in self.scene.joints if joint.frame for name in joint.bodies}  # they may be opened
        solid = (
            (body, body.pose, body.size)
            for body in self.scene.bodies
            if body.shape not in ("room", "marker") and body.name not in hung
        )
        low_ones = (one for one in (*walls, *solid) if one[1].position[2] - one[2][2] / 2 < LOW)
        for area in itertools.starmap(outline, low_ones):
            free &= area.distances(points) > keep
        return grid[_joined(free.reshape(grid.shape[:2]), np.linalg.norm(grid - start, axis=2))]

    def _check_doorway(self, name: str) -> None:
        """Raise _Broken if the base is wider than a doorway."""
        wide, base = self.scene.body(name).size[1], least_width(self.oracle)
        if wide < base:
            raise _Broken("too narrow", name, f"{name} is {wide:.2f} m wide, the base at least {base:.2f} m")

    def _check_room(self, thing: Body, at: str) -> None:
        """Raise _Broken if there is nowhere on or in a support that a thing would fit."""
        if not any(True for _ in self.search.spots(self.scene, thing, at, SPOTS, TURNS, TIGHT)):
            raise _Broken("no room", at, f"no room on {at} for {thing.name}")


def _openings(room: Body) -> Iterator[Rectangle]:
    """Yield the floor in the openings of a room's walls."""
    return (outline(room, room.pose @ Pose(cut.centre), cut.size) for cut in room.cavities)


def _joined(free: NDArray[np.bool_], away: Array) -> NDArray[np.bool_]:
    """Return the cells that are joined to the free one that is nearest to the start."""
    seen = np.zeros_like(free)
    if not free.any():
        return seen
    first = tuple(int(k) for k in np.unravel_index(int(np.where(free, away, np.inf).argmin()), free.shape))
    front = [first]
    seen[first] = True
    while front:
        i, j = front.pop()
        for there in ((i + 1, j), (i - 1, j), (i, j + 1), (i, j - 1)):
            if 0 <= there[0] < free.shape[0] and 0 <= there[1] < free.shape[1] and free[there] and not seen[there]:
                seen[there] = True
                front.append(there)
    return seen
