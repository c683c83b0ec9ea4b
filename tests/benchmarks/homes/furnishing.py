"""Homes in the making: a room, furniture at its walls and in its corners, things on and in it, by a seed.

A home that cannot be furnished with what is asked for (no wall is long enough any more) is drawn anew with the next
number; how often is counted. Whether a robot can do anything in it plays no part.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from planlang.geometry import Pose
from tests.benchmarks.homes import sizes
from tests.benchmarks.homes.sizes import Extents, Range

Size = tuple[float, float, float]
TRIES = 60
"""Places that are tried for a piece of furniture or a thing."""
GAP = 0.002
"""Distance of a thing from what it stands on, so that rounding puts it into nothing [m]."""
WALLS = 0.018
"""Thickness of carcasses: chipboard of 16 to 19 mm [m]."""
HALF_TURN = Pose((0.0, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0))
LYING = Pose((0.0, 0.0, 0.0), (0.0, math.sqrt(0.5), 0.0, math.sqrt(0.5)))
"""A quarter turn about the y axis: what stood lies along x."""


class NoRoom(Exception):
    """The room is full, or too small, for what a task needs."""


@dataclass(frozen=True)
class Thing:
    """What a map says of a thing; ``facts`` are further ones, in Manchester syntax."""

    name: str
    cls: str
    pose: Pose | None
    size: Size | None
    parts: tuple[str, ...] = ()
    facts: tuple[str, ...] = ()


@dataclass(frozen=True)
class Rectangle:
    """A rectangle on the floor or a surface: its middle, heading and half extents."""

    x: float
    y: float
    yaw: float
    half: tuple[float, float]

    def corners(self) -> np.ndarray:
        """Return the corners (4, 2)."""
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        local = np.array([(1, 1), (-1, 1), (-1, -1), (1, -1)]) * self.half
        return local @ np.array([(c, s), (-s, c)]) + (self.x, self.y)

    def distances(self, points: np.ndarray) -> np.ndarray:
        """Return how far points (n, 2) are from it, 0 inside (n,)."""
        c, s = math.cos(self.yaw), math.sin(self.yaw)
        local = (points - (self.x, self.y)) @ np.array([(c, -s), (s, c)])
        return np.asarray(np.linalg.norm(np.maximum(np.abs(local) - self.half, 0.0), axis=1))

    def overlaps(self, other: Rectangle) -> bool:
        """Return True if the two have a point in common: separating axes."""
        mine, its = self.corners(), other.corners()
        for yaw in (self.yaw, other.yaw):
            for angle in (yaw, yaw + math.pi / 2):
                axis = np.array((math.cos(angle), math.sin(angle)))
                a, b = mine @ axis, its @ axis
                if a.max() <= b.min() or b.max() <= a.min():
                    return False
        return True


@dataclass(frozen=True)
class Surface:
    """A level surface of furniture: its rectangle in the map, its height, what furniture it is of, room above it."""

    owner: str
    area: Rectangle
    height: float
    clear: float = 1.0


@dataclass
class Home:
    """Rooms with all that is in them. Furniture goes into the room that was entered last."""

    rng: np.random.Generator
    inside: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Extents of that room."""
    middle: tuple[float, float] = (0.0, 0.0)
    """Its middle in the map."""
    rooms: dict[str, Rectangle] = field(default_factory=dict)
    """Rooms of a flat; empty for a home of one."""
    things: dict[str, Thing] = field(default_factory=dict)
    floor: list[Rectangle] = field(default_factory=list)
    """Footprints of furniture."""
    kept_free: list[Rectangle] = field(default_factory=list)
    """Floor before furniture, where no other may stand."""
    surfaces: dict[str, Surface] = field(default_factory=dict)
    taken: dict[str, list[Rectangle]] = field(default_factory=dict)
    """Surface -> what stands on it."""
    classes: dict[str, str] = field(default_factory=dict)
    """Classes that the map defines -> their superclass, and what else is stated of them."""
    unwanted: tuple[str, ...] = ()
    """Kinds of things that do not belong to the clutter."""

    # Numbers

    def between(self, low_high: Range) -> float:
        """Return a uniform number of a range, to the millimetre."""
        return round(float(self.rng.uniform(*low_high)), 3)

    def chance(self, share: float) -> bool:
        """Return True in that share of cases."""
        return bool(self.rng.uniform() < share)

    def one_of(self, options: Sequence[str]) -> str:
        """Return one of some names."""
        return options[int(self.rng.integers(len(options)))]

    def size_of(self, extents: Extents) -> Size:
        """Return a size within ranges."""
        depth, width, height = (self.between(one) for one in extents[1:4])
        return (depth, depth if extents.is_round else width, height)

    def named(self, kind: str) -> str:
        """Return the next free name of a kind."""
        number = 1
        while f"{kind}{number}" in self.things:
            number += 1
        return f"{kind}{number}"

    def add(self, thing: Thing) -> str:
        """Add a thing; return its name."""
        assert thing.name not in self.things
        self.things[thing.name] = thing
        return thing.name

    # Furniture

    def room(self, cls: str) -> None:
        """Make the room."""
        if cls == "LivingRoom":
            self.classes[cls] = "knowrob:RoomInAConstruction"
        self.inside = self.size_of(sizes.ROOM)
        self.add(Thing("room1", cls, Pose((0.0, 0.0, self.inside[2] / 2)), self.inside))

    def enter(self, room: str) -> None:
        """Let furniture go into a room of a flat from now on."""
        area = self.rooms[room]
        self.middle = (area.x, area.y)
        self.inside = (2 * area.half[0], 2 * area.half[1], self.inside[2])

    def holds(self, area: Rectangle, over: float = 0.0) -> bool:
        """Return True if an area lies in the room, or beyond its walls by at most ``over``."""
        return bool((np.abs(area.corners() - self.middle) <= np.array(self.inside[:2]) / 2 + over).all())

    def is_free(self, footprint: Rectangle, clearance: Rectangle | None) -> bool:
        """Return True if furniture may stand there."""
        if any(area is not None and not self.holds(area, 1e-6) for area in (footprint, clearance)):
            return False
        if any(footprint.overlaps(other) for other in (*self.floor, *self.kept_free)):
            return False
        return clearance is None or not any(clearance.overlaps(other) for other in self.floor)

    def at_wall(self, size: Size, clear: float, *, corner: bool = False, beside: str = "") -> Pose:
        """Return a pose on the floor for a box with its back at a wall, in a corner or beside furniture if asked.

        Raises NoRoom.
        """
        if beside:
            return self._side_by_side(self.things[beside], size, clear)
        for _ in range(TRIES):
            side = int(self.rng.integers(4))
            yaw = side * math.pi / 2  # the heading of its front
            along = self.inside[1 if side % 2 == 0 else 0]
            away = self.inside[0 if side % 2 == 0 else 1]
            back = self.between((0.0, 0.03))
            slack = along / 2 - size[1] / 2 - self.between((0.0, 0.02))
            if slack < 0:
                continue
            offset = math.copysign(slack, self.rng.uniform(-1, 1)) if corner else self.between((-slack, slack))
            middle = -away / 2 + back + size[0] / 2
            c, s = round(math.cos(yaw)), round(math.sin(yaw))
            x, y = middle * c - offset * s + self.middle[0], middle * s + offset * c + self.middle[1]
            if self._stand(x, y, yaw, size, clear):
                return Pose.planar(x, y, yaw, size[2] / 2)
        raise NoRoom(f"no wall has room for {size}")

    def _side_by_side(self, other: Thing, size: Size, clear: float) -> Pose:
        """Return a pose for a box right or left of other furniture, their backs in line; raises NoRoom."""
        assert other.pose is not None
        assert other.size is not None
        for sign in (1.0, -1.0) if self.chance(0.5) else (-1.0, 1.0):
            across = sign * ((other.size[1] + size[1]) / 2 + self.between((0.002, 0.03)))
            at = other.pose @ Pose(((size[0] - other.size[0]) / 2, across, 0.0))
            if self._stand(at.position[0], at.position[1], at.yaw, size, clear):
                return Pose.planar(at.position[0], at.position[1], at.yaw, size[2] / 2)
        raise NoRoom(f"no room beside {other.name}")

    def free_standing(self, size: Size, clear: float) -> Pose:
        """Return a pose for a box that stands freely, with floor on all sides; raises NoRoom."""
        for _ in range(TRIES):
            half = np.array(self.inside[:2]) / 2
            reach = math.hypot(size[0], size[1]) / 2
            x, y = (self.between((-float(h) + reach, float(h) - reach)) if h > reach else 0.0 for h in half)
            x, y = x + self.middle[0], y + self.middle[1]
            yaw = self.between((-math.pi, math.pi)) if self.chance(0.3) else int(self.rng.integers(4)) * math.pi / 2
            around = Rectangle(x, y, yaw, (size[0] / 2 + clear, size[1] / 2 + clear))
            footprint = Rectangle(x, y, yaw, (size[0] / 2, size[1] / 2))
            if self.is_free(footprint, None) and not any(around.overlaps(other) for other in self.floor):
                if not self.holds(around, clear):
                    continue
                self.floor.append(footprint)
                return Pose.planar(x, y, yaw, size[2] / 2)
        raise NoRoom(f"the floor has no room for {size}")

    def _stand(self, x: float, y: float, yaw: float, size: Size, clear: float) -> bool:
        """Take the floor for a box and what is kept free before it, if nothing else has it."""
        c, s = math.cos(yaw), math.sin(yaw)
        footprint = Rectangle(x, y, yaw, (size[0] / 2, size[1] / 2))
        ahead = (size[0] + clear) / 2
        before = Rectangle(x + ahead * c, y + ahead * s, yaw, (clear / 2, size[1] / 2))
        if not self.is_free(footprint, before):
            return False
        self.floor.append(footprint)
        self.kept_free.append(before)
        return True

    def furniture(self, kind: str, *, wall: bool | None = None, corner: bool = False) -> str:
        """Put a piece of furniture with a surface somewhere: at a wall, or freely (None: as likely as not)."""
        extents = sizes.FURNITURE[kind]
        size = self.size_of(extents)
        at_wall = self.chance(0.6) if wall is None else wall
        clear = self.between(sizes.AISLE)
        if at_wall and size[1] < size[0]:
            size = (size[1], size[0], size[2])
        pose = self.at_wall(size, clear, corner=corner) if at_wall else self.free_standing(size, clear)
        name = self.add(Thing(self.named(kind), extents.cls, pose, size))
        self.surface(name, pose, size)
        return name

    def surface(self, name: str, pose: Pose, size: Size) -> None:
        """Let things stand on a box."""
        x, y, z = pose.position
        self.surfaces[name] = Surface(name, Rectangle(x, y, pose.yaw, (size[0] / 2, size[1] / 2)), z + size[2] / 2)

    def chair_at(self, table: str) -> str:
        """Put a chair before a side of a table, facing it; raises NoRoom."""
        extents = sizes.FURNITURE["chair"]
        size, board = self.size_of(extents), self.things[table]
        assert board.pose is not None
        assert board.size is not None
        for _ in range(TRIES):
            side = int(self.rng.integers(4))
            angle = side * math.pi / 2
            deep, wide = board.size[side % 2] / 2, board.size[1 - side % 2] / 2
            far = deep + size[0] / 2 + self.between((0.02, 0.2))
            offset = self.between((-max(wide - 0.3, 0.0), max(wide - 0.3, 0.0)))
            c, s = math.cos(angle), math.sin(angle)
            place = board.pose @ Pose((far * c - offset * s, far * s + offset * c, 0.0))
            yaw = board.pose.yaw + angle + math.pi
            footprint = Rectangle(place.position[0], place.position[1], yaw, (size[0] / 2, size[1] / 2))
            if self.holds(footprint) and not any(footprint.overlaps(one) for one in self.floor):
                self.floor.append(footprint)
                pose = Pose.planar(place.position[0], place.position[1], yaw, size[2] / 2)
                return self.add(Thing(self.named("chair"), extents.cls, pose, size))
        raise NoRoom("no side of the table has room for a chair")

    # Things

    def thing(self, kind: str, on: str, *, where: str = "anywhere") -> str:
        """Put a thing on a surface: "front", "back" or "anywhere"; raises NoRoom."""
        extents = sizes.THINGS[kind]
        if extents.cls == "BunchOfKeys":
            self.classes["BunchOfKeys"] = "knowrob:HumanScaleObject"
        return self.put(self.named(kind), extents.cls, self.size_of(extents), on, where, sizes.MASSES[kind])

    def lying(self, kind: str, on: str, *, where: str = "anywhere") -> str:
        """Lay a thing that is taller than deep on a surface; raises NoRoom."""
        extents = sizes.THINGS[kind]
        depth, width, height = self.size_of(extents)
        name = self.put(self.named(kind), extents.cls, (height, width, depth), on, where, sizes.MASSES[kind])
        thing = self.things[name]
        assert thing.pose is not None
        self.things[name] = replace(thing, pose=thing.pose @ LYING, size=(depth, width, height))
        return name

    def pot(self, on: str) -> str:
        """Put a pot with two handles, for two hands, on a surface, its handles along it; raises NoRoom."""
        extents, handle = sizes.THINGS["pot"], sizes.POT_HANDLE
        self.classes[extents.cls] = "knowrob:StoveTopCookingPot, knowrob:handsNeeded value 2"
        size, name = self.size_of(extents), self.named("pot")
        handles = {f"handle{number}_of_{name}": sign for number, sign in ((1, 1.0), (2, -1.0))}
        outer = (size[0], size[1] + 2 * handle[1], size[2])
        self.put(name, extents.cls, outer, on, "front", sizes.MASSES["pot"], faces_front=True, parts=tuple(handles))
        self.things[name] = pot = replace(self.things[name], size=size)
        assert pot.pose is not None
        for one, sign in handles.items():
            away = sign * (size[1] + handle[1]) / 2
            self.add(Thing(one, "Handle", pot.pose @ Pose((0.0, away, 0.3 * size[2])), handle))
        return name

    def device(self, kind: str, on: str, *, where: str = "back") -> tuple[str, str]:
        """Put a device with a button on its front on a surface; return the names of both."""
        extents = sizes.DEVICES[kind]
        if extents.cls == "CoffeeMachine":
            self.classes["CoffeeMachine"] = "knowrob:ElectricalHouseholdAppliance"
        if extents.cls == "RadioReceiver":
            self.classes["RadioReceiver"] = "knowrob:PoweredDevice"
        size, name = self.size_of(extents), self.named(kind)
        button = f"button_of_{name}"
        self.put(name, extents.cls, size, on, where, None, faces_front=True, parts=(button,))
        pose, wide = self.things[name].pose, self.between(sizes.BUTTON)
        assert pose is not None
        thick = 0.008
        y = self.between((-size[1] / 2 + 0.04, size[1] / 2 - 0.04))
        z = self.between((-size[2] / 2 + 0.05, size[2] / 2 - 0.04))
        self.add(Thing(button, "PushButton", pose @ Pose((size[0] / 2 + thick / 2, y, z)), (thick, wide, wide)))
        return name, button

    def put(
        self,
        name: str,
        cls: str,
        size: Size,
        on: str,
        where: str,
        mass: Range | None,
        *,
        faces_front: bool = False,
        parts: tuple[str, ...] = (),
    ) -> str:
        """Put a thing of a size on a surface; raises NoRoom if there is none left."""
        surface = self.surfaces[on]
        area, others = surface.area, self.taken.setdefault(on, [])
        if size[2] > surface.clear:
            raise NoRoom(f"{name} is too high for {on}")
        for _ in range(TRIES):
            turn = 0.0 if faces_front else self.between((-math.pi, math.pi))
            if not faces_front and self.chance(0.5):
                turn = round(turn / (math.pi / 2)) * (math.pi / 2)
            c, s = abs(math.cos(turn)), abs(math.sin(turn))
            reach = ((c * size[0] + s * size[1]) / 2, (s * size[0] + c * size[1]) / 2)
            room = [half - one for half, one in zip(area.half, reach, strict=True)]
            if min(room) < 0:
                continue
            x, y = self.between((-room[0], room[0])), self.between((-room[1], room[1]))
            if where == "front":
                x = room[0] - min(self.between((0.01, 0.12)), 2 * room[0])
            elif where == "back":
                x = -room[0] + min(self.between((0.0, 0.1)), 2 * room[0])
            middle = Pose.planar(area.x, area.y, area.yaw) @ Pose((x, y, 0.0))
            gap = self.between((0.01, 0.05))  # fingers are not asked for: things stand close, and apart
            outline = Rectangle(
                middle.position[0], middle.position[1], area.yaw + turn, (size[0] / 2 + gap, size[1] / 2 + gap)
            )
            if any(outline.overlaps(other) for other in others):
                continue
            others.append(outline)
            pose = Pose.planar(
                middle.position[0], middle.position[1], area.yaw + turn, surface.height + GAP + size[2] / 2
            )
            facts = () if mass is None else (f"knowrob:massOfObject {self.between(mass)!r}",)
            return self.add(Thing(name, cls, pose, size, parts, facts))
        raise NoRoom(f"{on} has no room for {name}")

    def clutter(self, on: str, most: int) -> None:
        """Put up to so many other things on a surface; what finds no room is left out."""
        for _ in range(int(self.rng.integers(most + 1))):
            kind = self.one_of(("cup", "glass", "bottle", "can", "book", "bowl", "box", "plate"))
            if kind in self.unwanted:
                continue
            try:
                self.thing(kind, on)
            except NoRoom:
                continue

    def filled(self, vessel: str, cls: str, amount: float) -> str:
        """Put an amount of a drink [ml] into a vessel."""
        name = self.named(cls.lower())
        return self.add(
            Thing(name, cls, None, None, facts=(f"knowrob:in-ContGeneric {vessel}", f"knowrob:amount {amount!r}"))
        )

    # People

    def person_standing(self) -> str:
        """Let somebody stand with free floor ahead."""
        height = self.between(sizes.STANDING)
        size = (0.3, 0.5, height)
        pose = self.free_standing((0.5, 0.6, height), 0.7)
        return self.add(Thing("person1", "Person", pose, size))

    def person_seated(self) -> str:
        """Let somebody sit on a chair that stands freely or at a wall."""
        height = self.between(sizes.SEATED)
        size = (0.75, 0.5, height)
        pose = self.at_wall(size, 0.8) if self.chance(0.5) else self.free_standing(size, 0.7)
        return self.add(Thing("person1", "Person", pose, size))

    def person_lying(self) -> str:
        """Let somebody lie in a bed whose head is at a wall, or which stands along one."""
        bed = self.size_of(sizes.FURNITURE["bed"])
        pose = self.at_wall(bed, self.between(sizes.AISLE))  # the feet point into the room
        name = self.add(Thing("bed1", "Bed-PieceOfFurniture", pose, bed))
        length, raised = min(self.between(sizes.SLEEPING), bed[0] - 0.1), self.between(sizes.RAISED)
        at = self.things[name].pose
        assert at is not None
        x = -bed[0] / 2 + 0.05 + length / 2
        lies = at @ Pose((x, 0.0, bed[2] / 2 + raised / 2 + GAP))
        return self.add(Thing("person1", "Patient", lies, (length, 0.5, raised)))
