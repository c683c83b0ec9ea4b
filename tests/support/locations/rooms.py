"""Rooms to look for places in, each drawn from a kind and a seed: equal seeds give equal rooms.

All are 6 m by 5 m hospital rooms with a bed, a headboard, a person in it or on a chair, a nightstand, a cabinet with
another hung above it, a table on legs and boxes on the floor; the bottle stands on cabinet, table or nightstand.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from planlang.designators import Location, Object, a_location, a_person, an_object
from planlang.geometry import Pose
from sim import Body, Scene

BOUNDS = (-3.0, -2.5, 3.0, 2.5)
PLACE = "http://example.org/rooms.owl#"
THE_BOTTLE = an_object("DrinkingBottle", PLACE + "bottle")
THE_PATIENT = a_person("Patient", PLACE + "patient")
SUPPORTS = ("cabinet", "table", "nightstand")
TRIES = 50
"""How often a box is placed anew where it would stand in something."""


@dataclass(frozen=True, slots=True)
class Room:
    """A furnished room; ``reason`` says why a room that was built to be infeasible is so."""

    kind: str
    seed: int
    bodies: tuple[Body, ...]
    start: tuple[float, float, float] = (0.0, 0.0, 0.0)
    reason: str = ""

    @property
    def name(self) -> str:
        """Kind and seed."""
        return f"{self.kind} {self.seed}"

    def scene(self) -> Scene:
        """Return what a simulated world is made from."""
        return Scene(self.bodies, BOUNDS, self.start)

    def body(self, name: str) -> Body:
        """The body of that name."""
        return next(body for body in self.bodies if body.name == name)


def mirrored(room: Room) -> Room:
    """The room as its mirror at the plane y = 0 shows it; its bodies stand upright and are symmetric themselves."""
    bodies = []
    for body in room.bodies:
        x, y, z = body.pose.position
        bodies.append(replace(body, pose=Pose.planar(x, -y, -body.pose.yaw, z)))
    x, y, yaw = room.start
    return replace(room, bodies=tuple(bodies), start=(x, -y, -yaw))


def thing(body: Body) -> Object:
    """The designator of a body of a room."""
    return an_object(body.type or "Thing", body.iri or PLACE + body.name)


def box(name: str, size: tuple[float, float, float], at: tuple[float, float, float], yaw: float = 0.0) -> Body:
    """A box by its size and centre [m], turned about the vertical."""
    return Body(name, Pose.planar(at[0], at[1], yaw, at[2]), size, type="Thing")


class Furnisher:
    """A room in the making. What stands in it is kept with the outline that others must not enter."""

    def __init__(self, kind: str, seed: int) -> None:
        self.kind, self.seed = kind, seed
        self.rng = np.random.default_rng([sum(map(ord, kind)), seed])
        self.bodies: dict[str, Body] = {}
        size, middle = (BOUNDS[2] - BOUNDS[0], BOUNDS[3] - BOUNDS[1], 2.6), Pose((0.0, 0.0, 1.3))
        self.add(Body("room", middle, size, "room", type="HospitalRoom"))

    def add(self, body: Body) -> Body:
        """Put a body into the room."""
        self.bodies[body.name] = body
        return body

    def between(self, low: float, high: float) -> float:
        """A uniform number."""
        return float(self.rng.uniform(low, high))

    def furnish(self, patient: str = "bed") -> None:
        """Bed, person, nightstand, cabinets, table. ``patient``: in the "bed" or on a "seat"."""
        x, y = self.between(1.2, 1.7), self.between(-0.6, 0.6)
        self.add(Body("bed", Pose.planar(x, y, math.pi, 0.30), (2.1, 0.94, 0.56), type="Bed-PieceOfFurniture"))
        self.add(box("headboard", (0.06, 0.94, 1.0), (min(x + 1.08, 2.95), y, 0.5)))
        if patient == "bed":
            height = self.between(0.35, 0.8)
            at = Pose.planar(x + 0.1, y, math.pi, 0.58 + height / 2)
            self.add(Body("patient", at, (1.6, 0.5, height), "person", PLACE + "patient", "Patient"))
        else:
            yaw = self.between(-math.pi, math.pi)
            at = Pose.planar(self.between(-0.6, 0.3), self.between(0.2, 1.2), yaw, 0.65)
            self.add(Body("patient", at, (0.75, 0.5, 1.3), "person", PLACE + "patient", "Patient"))
        self.add(box("nightstand", (0.44, 0.44, 0.6), (min(x + 0.75, 2.7), y + 0.77, 0.3)))
        x = self.between(-2.4, -0.6)
        self.add(box("cabinet", (0.9, 0.5, 0.9), (x, 2.22, 0.45)))
        self.add(box("cabinet_top", (0.9, 0.3, 0.5), (x, 2.33, 1.5)))
        x, y, yaw = self.between(-2.2, -1.2), self.between(-1.6, -0.6), self.between(-0.5, 0.5)
        table = self.add(box("table", (1.0, 0.7, 0.04), (x, y, 0.72), yaw))
        for number, corner in enumerate(((0.45, 0.3), (0.45, -0.3), (-0.45, 0.3), (-0.45, -0.3))):
            at = table.pose @ Pose((*corner, -0.37))
            self.add(Body(f"leg{number}", at, (0.04, 0.04, 0.7), type="Thing"))

    def bottle(self) -> None:
        """The bottle somewhere on a support; on the cabinet in its front half."""
        support = self.bodies[SUPPORTS[int(self.rng.integers(len(SUPPORTS)))]]
        half_x, half_y = support.size[0] / 2 - 0.06, support.size[1] / 2 - 0.06
        x, y = self.between(-half_x, half_x), self.between(-half_y, half_y)
        y = -abs(y) if support.name == "cabinet" else y
        self.put_bottle(support.pose @ Pose((x, y, support.size[2] / 2 + 0.1)))

    def put_bottle(self, at: Pose) -> None:
        """The bottle, upright, with its centre at a pose's position."""
        there, size = Pose(at.position), (0.066, 0.066, 0.2)
        self.add(Body("bottle", there, size, "cylinder", PLACE + "bottle", "DrinkingBottle", movable=True))

    def clutter(self, number: int, height: tuple[float, float] = (0.4, 1.2), width: float = 0.6) -> None:
        """Boxes on the floor, each clear of all that stands there already."""
        for index in range(number):
            for _ in range(TRIES):
                x, y = self.between(-2.7, 2.7), self.between(-2.2, 2.2)
                size = (self.between(0.2, width), self.between(0.2, width), self.between(*height))
                if self._is_free(x, y, max(size[:2]) / 2 + 0.02):
                    self.add(box(f"clutter{index}", size, (x, y, size[2] / 2), self.between(0.0, 3.0)))
                    break

    def _is_free(self, x: float, y: float, keep: float) -> bool:
        """Return whether a square of half side ``keep`` meets no box around the bodies, boxes taken as not turned."""
        return all(
            max(
                abs(x - body.pose.position[0]) - body.size[0] / 2,
                abs(y - body.pose.position[1]) - body.size[1] / 2,
            )
            > keep
            for body in self.bodies.values()
            if body.shape != "room"
        )

    def niche(self) -> None:
        """Tall things around five eighths of the bottle, 13 to 20 cm away, and boxes on the floor before it."""
        x, y, z = self.bodies["bottle"].pose.position
        turn = self.between(0.0, 2 * math.pi)
        for index in range(5):
            away, angle = self.between(0.13, 0.2), turn + index * math.pi / 4
            at = (x + away * math.cos(angle), y + away * math.sin(angle), z + 0.02)
            self.add(box(f"item{index}", (0.07, 0.07, 0.24), at, angle))
        for index in range(2):
            at = (x + self.between(-1.0, 1.0), y + self.between(-1.0, 1.0), 0.35)
            if math.dist(at[:2], (x, y)) > 0.5:
                self.add(box(f"block{index}", (0.3, 0.3, 0.7), at))

    def corridor(self) -> None:
        """Shelves that leave a passage hardly wider than a robot before the bottle's support."""
        x, y, _ = self.bodies["bottle"].pose.position
        gap, depth, offset = self.between(0.80, 1.1), self.between(0.5, 0.9), self.between(-0.15, 0.15)
        for side in (-1, 1):
            if abs(y) > 1.5:  # the support stands at the wall of the large y: the passage leads there along y
                at = (x + offset + side * (gap / 2 + 0.15), y - math.copysign(0.45 + depth / 2, y), 0.5)
                size = (0.3, depth, 1.0)
            else:
                at = (x - math.copysign(0.75 + depth / 2, x), y + offset + side * (gap / 2 + 0.15), 0.5)
                size = (depth, 0.3, 1.0)
            self.add(box(f"shelf{(side + 1) // 2}", size, at))

    def colleague(self, number: int) -> None:
        """Another robot that stands there: a round base, a column, a head and an arm held out."""
        for _ in range(TRIES):
            x, y, yaw = self.between(-2.4, 2.4), self.between(-2.0, 2.0), self.between(-math.pi, math.pi)
            if not self._is_free(x, y, 0.35):
                continue
            at = Pose.planar(x, y, yaw)
            name = f"robot{number}"
            self.add(Body(f"{name}_base", at @ Pose((0, 0, 0.15)), (0.62, 0.62, 0.3), "cylinder", type="Thing"))
            self.add(Body(f"{name}_column", at @ Pose((0, 0, 0.75)), (0.28, 0.28, 0.9), type="Thing"))
            self.add(Body(f"{name}_head", at @ Pose((0, 0, 1.35)), (0.25, 0.25, 0.3), type="Thing"))
            reach = self.between(0.3, 0.6)
            arm = at @ Pose((0.14 + reach / 2, -0.2, self.between(0.7, 1.1)))
            self.add(Body(f"{name}_arm", arm, (reach, 0.1, 0.1), type="Thing"))
            return

    def room(self, reason: str = "") -> Room:
        """The room as it is now."""
        return Room(self.kind, self.seed, tuple(self.bodies.values()), reason=reason)


def _normal(room: Furnisher) -> None:
    room.furnish()
    room.bottle()
    room.clutter(int(room.rng.integers(3, 8)))


def _hard(room: Furnisher) -> None:
    room.furnish()
    room.bottle()
    room.clutter(int(room.rng.integers(10, 16)))
    room.niche()


def _floor(room: Furnisher) -> None:
    room.furnish()
    room.bottle()
    room.clutter(int(room.rng.integers(18, 28)), height=(0.05, 0.5), width=0.4)


def _narrow(room: Furnisher) -> None:
    room.furnish()
    room.bottle()
    room.corridor()
    room.clutter(3)


def _in_bed(room: Furnisher) -> None:
    room.furnish("bed")
    room.bottle()
    room.clutter(int(room.rng.integers(2, 6)))


def _seated(room: Furnisher) -> None:
    room.furnish("seat")
    room.bottle()
    room.clutter(int(room.rng.integers(2, 6)))


def _colleagues(room: Furnisher) -> None:
    room.furnish()
    room.bottle()
    for number in range(int(room.rng.integers(1, 4))):
        room.colleague(number)
    room.clutter(3)


KINDS: Mapping[str, Callable[[Furnisher], None]] = {
    "normal": _normal,
    "hard": _hard,
    "cluttered floor": _floor,
    "narrow passage": _narrow,
    "person in bed": _in_bed,
    "person seated": _seated,
    "other robots": _colleagues,
}
"""Kind of room -> what furnishes it."""


def room_of(kind: str, seed: int) -> Room:
    """The room of a kind and a seed."""
    furnisher = Furnisher(kind, seed)
    KINDS[kind](furnisher)
    return furnisher.room()


def rooms(kind: str, number: int, first: int = 0) -> Iterator[Room]:
    """Rooms of a kind, seeds in a row."""
    return (room_of(kind, seed) for seed in range(first, first + number))


def asked(room: Room) -> Location:
    """Return what is asked in a room: reach the person where the room is about them, else the bottle."""
    what: Object = THE_PATIENT if room.kind.startswith("person") else THE_BOTTLE
    return a_location(in_reach_of=what)
