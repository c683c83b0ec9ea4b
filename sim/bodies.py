"""The bodies of a scene in one physics client: convex pieces, their poses, and bounding boxes.

A body consists of one piece (box, cylinder), several (person, room) or none (marker). The boxes around the pieces are
kept in two arrays, so that a contact query passes only near pairs to PyBullet. A piece gets its place in PyBullet when
something first comes near it, or looks there: of a map of thousands of things, a run touches few.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from planlang.geometry import IDENTITY, Array, Pose
from planlang.geometry.matrices import product, rotated
from planlang.geometry.shapes import SolidKind, overlaps
from planlang.records import dataclass
from sim.engine import bullet
from sim.scene import Body, BodyShape, Cavity, Scene

FLOOR = "floor"
"""Name of the ground in a scene without a room."""

WALL = 0.1
"""Thickness of walls and floors [m]: more than any link moves within one step."""
SEGMENTS = 16
"""Boxes that form the wall of a round, hollow thing."""
AT_REST = 1e-3
"""Distance from its initial pose up to which a limb is at rest [m]."""
_AWAY = (0.0, 0.0, -500.0)
"""Position of hidden pieces [m]: far below anything that falls or is looked at."""
_SLACK = 0.001
"""Distance beyond which pieces are surely not met [m]: PyBullet computes with single precision."""
_FEW = 500
"""Number of pieces up to which all are compared at once."""
_ARM = 2.0
"""Distance from the middle of a body beyond which nothing of it is, if none is larger: a person with arms out [m]."""
_COLORS: dict[BodyShape, tuple[float, float, float, float]] = {
    BodyShape.BOX: (0.72, 0.60, 0.45, 1.0),
    BodyShape.CYLINDER: (0.20, 0.50, 0.85, 1.0),
    BodyShape.PERSON: (0.86, 0.68, 0.56, 1.0),
    BodyShape.ROOM: (0.90, 0.90, 0.87, 1.0),
}
Color = tuple[float, float, float, float]


@dataclass(frozen=True, slots=True)
class Part:
    """Convex primitive in the frame of its body: a box of ``size``, or a cylinder or sphere inscribed in it."""

    kind: SolidKind
    size: tuple[float, float, float]
    offset: Pose
    color: Color | None = None
    limb: bool = False
    """True for a part of a person's arm: once it moves, hands and what they hold may touch it."""
    outward: tuple[float, float, float] | None = None
    """For a wall, its normal away from the room."""


@dataclass(slots=True)
class Piece:
    """A part with its place in the map."""

    body: str
    part: Part
    offset: Pose
    pose: Pose
    """Pose in the map."""
    yields: bool = False
    """True if hands and what they hold may touch it: a limb that reaches for something or holds it."""
    uid: int | None = None
    """Its number in the physics client; None before something comes near."""


class Bodies:
    """Bodies of a scene in one client; ``lower`` and ``upper`` (n, 3) hold a box per piece, empty if removed."""

    def __init__(self, client: int, scene: Scene, parts: dict[str, tuple[Part, ...]], *, shown: bool = True) -> None:
        """``parts``: those of persons; without ``shown``, pictures show none of the bodies, which takes less time."""
        self.client, self.shown = client, shown
        self.bodies = {body.name: body for body in scene.bodies}
        self.poses = {body.name: body.pose for body in scene.bodies}
        self.removed: set[str] = set()
        self.hidden: set[int] = set()
        """Pieces temporarily out of the way; an interrupt may leave them here."""
        self.pieces: list[Piece] = []
        self.of: dict[str, list[int]] = {body.name: [] for body in scene.bodies}
        """Body -> indices of its pieces."""
        self._index: dict[int, int] = {}
        self.moves = self.carries = 0
        """Counters: ``moves`` of bodies placed or removed, ``carries`` of bodies that the robot moved along. While both
        are unchanged, so are all poses."""
        if not any(body.shape is BodyShape.ROOM for body in scene.bodies):
            ground = Body(FLOOR, Pose((0.0, 0.0, -0.05)), (60.0, 60.0, 0.1), color=_COLORS[BodyShape.ROOM])
            self.bodies[FLOOR], self.poses[FLOOR], self.of[FLOOR] = ground, ground.pose, []
        self.lower, self.upper = np.zeros((0, 3)), np.zeros((0, 3))
        self._made = np.zeros(0, bool)
        """Which pieces exist in the client."""
        self._boxes: tuple[object, tuple[list[str], Array, Array]] | None = None
        self._making: int | None = None
        """Number of bodies in the client before the piece that is being made."""
        self._add(self.bodies.values(), parts)
        rooms = [body.name for body in self.bodies.values() if body.shape is BodyShape.ROOM]
        middles = np.array([self.poses[piece.body].position for piece in self.pieces]).reshape(-1, 3)
        reaches = np.linalg.norm(np.maximum(self.upper - middles, middles - self.lower), axis=1)
        inner = np.ones(len(self.pieces), bool)
        inner[[index for name in rooms for index in self.of[name]]] = False
        self.reach = float(reaches[inner].max(initial=_ARM))
        """Distance from the middle of any body but rooms within which all of it is [m]."""

    def create(self, body: Body) -> None:
        """Add a body that was not in the scene, in place of an earlier one of its name."""
        if body.name in self.of:  # its pieces stay away for good; the new ones are the last, as boxes() needs them
            self.remove(body.name)
            del self.bodies[body.name], self.poses[body.name], self.of[body.name]
        self.removed.discard(body.name)
        self.bodies[body.name], self.poses[body.name], self.of[body.name] = body, body.pose, []
        self._add([body], {})
        self.moves += 1

    def lets_touch(self, one: str, other: str) -> bool:
        """Check whether one of two bodies has a blade that goes under the other."""
        first, second = self.bodies[one], self.bodies[other]
        return bool((first.blade and second.thin) or (second.blade and first.thin))

    def _add(self, bodies: Iterable[Body], parts: Mapping[str, tuple[Part, ...]]) -> None:
        """Add the pieces of bodies, all at once; their places are the same bits as those of :meth:`_put`."""
        owned = [(body, part) for body in bodies for part in parts.get(body.name) or plain(body)]
        offset = [k for k, (_, part) in enumerate(owned) if part.offset != IDENTITY]
        poses = [body.pose for body, _ in owned]
        composed = product(Pose.matrices(poses[k] for k in offset), Pose.matrices(owned[k][1].offset for k in offset))
        for k, pose in zip(offset, Pose.from_matrices(composed), strict=True):
            poses[k] = pose
        for (body, part), pose in zip(owned, poses, strict=True):
            self.of[body.name].append(len(self.pieces))
            self.pieces.append(Piece(body.name, part, part.offset, pose))
        matrices = Pose.matrices(poses)
        half = np.array([_extents(part) for _, part in owned]).reshape(-1, 3) / 2
        reach, middles = rotated(np.abs(matrices[:, :3, :3]), half), matrices[:, :3, 3]
        self.lower = np.vstack([self.lower, middles - reach])
        self.upper = np.vstack([self.upper, middles + reach])
        self._made = np.concatenate([self._made, np.zeros(len(owned), bool)])

    def uid(self, index: int) -> int:
        """Number of a piece in the physics client, where it is made if it was not needed before."""
        uid = self.pieces[index].uid
        return self._make(index) if uid is None else uid

    def fill(self, lower: Array, upper: Array, planes: Array | None = None) -> None:
        """Make the pieces in a box, given by its corners (3,), in the client: rays and pictures meet only those.

        ``planes`` (k, 4), normals and distances from the origin, leave out pieces wholly on the positive side of one.
        """
        some = self.within(lower - _SLACK, upper + _SLACK)
        some = some[~self._made[some]]
        if planes is not None and len(some):
            low, high = self.lower[some, None], self.upper[some, None]
            least = np.where(planes[:, :3] > 0, low, high) * planes[:, :3]
            some = some[(least.sum(axis=2) <= planes[:, 3] + _SLACK).all(axis=1)]
        for index in some.tolist():
            self._make(index)

    def _make(self, index: int) -> int:
        """Make a piece where it is now: where many overlap, each further one takes PyBullet longer."""
        count = bullet.getNumBodies(physicsClientId=self.client)
        if self._making is not None and count > self._making:  # an interrupt came before it was noted
            bullet.removeBody(bullet.getBodyUniqueId(count - 1, physicsClientId=self.client), self.client)
            count -= 1
        self._making = count
        piece = self.pieces[index]
        body, part = self.bodies[piece.body], piece.part
        x, y, z = part.size
        color = part.color or body.color or _COLORS.get(body.shape, (0.7, 0.7, 0.7, 1.0))
        solid: dict[str, Any] = {"physicsClientId": self.client}
        visual: dict[str, Any] = {"physicsClientId": self.client, "rgbaColor": color}
        match part.kind:
            case SolidKind.BOX:
                shape = bullet.GEOM_BOX
                solid |= {"halfExtents": (x / 2, y / 2, z / 2)}
                visual |= {"halfExtents": (x / 2, y / 2, z / 2)}
            case SolidKind.CYLINDER:
                shape = bullet.GEOM_CYLINDER
                solid |= {"radius": max(x, y) / 2, "height": z}
                visual |= {"radius": max(x, y) / 2, "length": z}
            case _:
                shape = bullet.GEOM_SPHERE
                solid |= {"radius": max(x, y) / 2}
                visual |= {"radius": max(x, y) / 2}
        uid = int(
            bullet.createMultiBody(
                0,
                bullet.createCollisionShape(shape, **solid),
                bullet.createVisualShape(shape, **visual) if self.shown else -1,
                basePosition=_AWAY,
                physicsClientId=self.client,
            )
        )
        if index not in self.hidden and piece.body not in self.removed:
            # Not placed as it is made: that gives other last digits than placing it later, after a hypothesis.
            bullet.resetBasePositionAndOrientation(
                uid, piece.pose.position, piece.pose.orientation, physicsClientId=self.client
            )
        piece.uid, self._index[uid], self._made[index] = uid, index, True
        self._making = None
        return uid

    def place(self, name: str, pose: Pose) -> None:
        """Place a body with all its pieces; a removed one stays away until :meth:`restore`."""
        self.moves += 1
        self._place(name, pose)

    def carry(self, name: str, pose: Pose) -> None:
        """Place a body that moves along with a hand."""
        self.carries += 1
        self._place(name, pose)

    def _place(self, name: str, pose: Pose) -> None:
        self.poses[name] = pose
        self._put(name, self.of[name])

    def place_part(self, index: int, offset: Pose) -> None:
        """Move one piece within its body's frame (a person's arm)."""
        piece = self.pieces[index]
        self.moves += 1
        piece.offset = offset
        piece.yields = piece.part.limb and offset.distance(piece.part.offset) > AT_REST
        self._put(piece.body, [index])

    def _put(self, name: str, indices: Sequence[int]) -> None:
        """Move pieces of a body to where they belong: all at once, as a thing in a hand moves with each query."""
        pieces, body = [self.pieces[index] for index in indices], self.poses[name]
        apart = [piece for piece in pieces if piece.offset != IDENTITY]
        for piece in pieces:
            piece.pose = body
        if apart:
            placed = Pose.from_matrices(product(body.matrix(), Pose.matrices(piece.offset for piece in apart)))
            for piece, pose in zip(apart, placed, strict=True):
                piece.pose = pose
        if name in self.removed:
            return
        for piece in pieces:
            if piece.uid is not None:
                bullet.resetBasePositionAndOrientation(
                    piece.uid, piece.pose.position, piece.pose.orientation, physicsClientId=self.client
                )
        matrices = Pose.matrices(piece.pose for piece in pieces)
        reach = rotated(np.abs(matrices[:, :3, :3]), np.array([_extents(piece.part) for piece in pieces]) / 2)
        self.lower[indices], self.upper[indices] = matrices[:, :3, 3] - reach, matrices[:, :3, 3] + reach

    def remove(self, name: str) -> None:
        """Take a body out of the world: it cannot be touched or seen."""
        self.moves += 1
        self.removed.add(name)
        self.hide(self.of[name])
        self.hidden.difference_update(self.of[name])
        self.lower[self.of[name]], self.upper[self.of[name]] = np.inf, -np.inf

    def restore(self, name: str) -> None:
        """Bring a removed body back to its last pose."""
        self.removed.discard(name)
        self.place(name, self.poses[name])

    def hide(self, indices: Sequence[int]) -> None:
        """Move pieces out of the way within the client only; :meth:`show` brings them back."""
        self.hidden.update(indices)  # before moving them: an interrupt may come at any moment
        for index in indices:
            uid = self.pieces[index].uid
            if uid is not None:
                bullet.resetBasePositionAndOrientation(uid, _AWAY, (0, 0, 0, 1), physicsClientId=self.client)

    def show(self, indices: Sequence[int]) -> None:
        """Undo :meth:`hide`."""
        for piece in (self.pieces[index] for index in indices):
            if piece.uid is not None and piece.body not in self.removed:
                place = piece.pose.position, piece.pose.orientation
                bullet.resetBasePositionAndOrientation(piece.uid, *place, physicsClientId=self.client)
        self.hidden.difference_update(indices)

    def name_of(self, uid: int) -> str | None:
        """Name the body of the piece with this id, if there is one."""
        index = self._index.get(uid)
        return None if index is None else self.pieces[index].body

    def near(self, lower: Array, upper: Array) -> tuple[list[int], list[int]]:
        """List which of n boxes overlap the boxes of which pieces: numbers of both, in the order of the boxes."""
        if len(self.pieces) <= _FEW or not len(lower):
            which, pieces = np.nonzero(overlaps(lower, upper, self.lower, self.upper))
            return which.tolist(), pieces.tolist()
        around = self.within(lower.min(axis=0), upper.max(axis=0))
        which, pieces = np.nonzero(overlaps(lower, upper, self.lower[around], self.upper[around]))
        return which.tolist(), around[pieces].tolist()

    def within(self, lower: Array, upper: Array) -> NDArray[np.intp]:
        """List the pieces whose boxes overlap one, given by its corners (3,), in ascending order."""
        return np.flatnonzero(overlaps(lower[None], upper[None], self.lower, self.upper)[0])

    def box_of(self, name: str) -> tuple[Array, Array]:
        """Lower and upper corner of the box around a body, along the map's axes; inf and -inf for a removed one."""
        indices = self.of[name]
        if not indices:
            return np.full(3, np.inf), np.full(3, -np.inf)
        return self.lower[indices].min(axis=0), self.upper[indices].max(axis=0)

    def boxes(self) -> tuple[list[str], Array, Array]:
        """List the bodies that have pieces, and the corners (n, 3) of their boxes, as :meth:`box_of` has them."""
        state = self.moves, self.carries, len(self.pieces)
        if self._boxes is None or self._boxes[0] != state:
            names = [name for name, indices in self.of.items() if indices]
            first = [self.of[name][0] for name in names]  # the pieces of a body follow one another
            lower, upper = (np.zeros((0, 3)), np.zeros((0, 3)))
            if names:
                lower, upper = np.minimum.reduceat(self.lower, first), np.maximum.reduceat(self.upper, first)
            self._boxes = state, (names, lower, upper)
        return self._boxes[1]

    def spans(self, indices: Sequence[int]) -> tuple[Array, Array, Array]:
        """Oriented boxes around some pieces: centres (n, 3), axes (n, 3, 3) as columns, and half extents (n, 3)."""
        places = Pose.matrices(self.pieces[index].pose for index in indices)
        half = np.array([self.pieces[index].part.size for index in indices]).reshape(-1, 3) / 2
        is_round = np.array([self.pieces[index].part.kind != SolidKind.BOX for index in indices], bool)
        half[is_round, :2] = half[is_round, :2].max(axis=1, keepdims=True)
        return places[:, :3, 3], places[:, :3, :3], half

    def gap(self, first: Sequence[int], second: Sequence[int], within: float) -> float:
        """Compute the distance of two sets of pieces [m]: negative in penetration, ``inf`` beyond ``within``."""
        smallest = float("inf")
        for a in first:
            for b in second:
                for point in bullet.getClosestPoints(self.uid(a), self.uid(b), within, physicsClientId=self.client):
                    smallest = min(smallest, point[8])
        return smallest


def _extents(part: Part) -> tuple[float, float, float]:
    """Extents of the box around a part; round ones are as wide as their larger side."""
    x, y, z = part.size
    return (x, y, z) if part.kind == SolidKind.BOX else (max(x, y), max(x, y), z)


def plain(body: Body) -> tuple[Part, ...]:
    """Split a body other than a person into its parts."""
    own = (body.shape, body.size, body.cavities, body.blade, body.wall, body.handles, body.centre)
    return _parts_of(own)


@lru_cache(maxsize=4096)
def _parts_of(own: tuple[Any, ...]) -> tuple[Part, ...]:
    """Split a body with these properties, which many things of a class share."""
    shape, size, cavities, blade, wall, handles, centre = own
    body = Body("", IDENTITY, size, shape, cavities=cavities, blade=blade, wall=wall, handles=handles, centre=centre)
    return (*_without_handles(body), *(Part(SolidKind.BOX, one.size, one.pose) for one in body.handles))


def _without_handles(body: Body) -> tuple[Part, ...]:
    match body.shape:
        case BodyShape.MARKER | BodyShape.PERSON:
            return ()
        case BodyShape.ROOM:
            return _room(body)
        case BodyShape.BOX if body.cavities:
            return tuple(_around(body.size, body.cavities))
        case BodyShape.BOX if 0 < body.blade < max(body.size):
            return _blade_and_handle(body)
        case BodyShape.BOX if body.wall:
            x, y, z = body.size
            inside = Cavity((0.0, 0.0, body.wall), (x - 2 * body.wall, y - 2 * body.wall, z))
            return tuple(_around(body.size, (inside,)))
        case BodyShape.CYLINDER if body.wall:
            return tuple(_dish(body.size, body.wall))
        case shape:
            return (Part(SolidKind(shape), body.size, IDENTITY),)


BLADE, HANDLE = 0.002, 0.02
"""Thickness of the blade of a tool, and of the handle behind it [m]."""


def axes_of(size: tuple[float, float, float]) -> tuple[int, int, int]:
    """Sort the axes of a tool's box: longest, middle, shortest."""
    short, middle, long = sorted(range(3), key=lambda k: size[k])
    return long, middle, short


def _blade_and_handle(body: Body) -> tuple[Part, Part]:
    """Build a thin blade at the front end of a tool's longest axis, on its lower side, and the handle behind it."""
    along, across, normal = axes_of(body.size)
    length, width = body.size[along], body.size[across]

    def part(extent: float, wide: float, thick: float, end: int) -> Part:
        size, place = [0.0, 0.0, 0.0], list(body.centre)
        size[along], size[across], size[normal] = extent, min(wide, width), min(thick, body.size[normal])
        place[along] += end * (length - extent) / 2
        place[normal] -= (body.size[normal] - size[normal]) / 2
        return Part(SolidKind.BOX, (size[0], size[1], size[2]), Pose((place[0], place[1], place[2])))

    return part(body.blade, width, BLADE, 1), part(length - body.blade, HANDLE, HANDLE, -1)


def _around(size: tuple[float, float, float], cavities: Sequence[Cavity]) -> Iterator[Part]:
    """Yield boxes that fill what cavities leave of a box.

    The planes of the cavities' faces cut the box into cells; each full cell grows along x, y, then z into a larger box.
    """
    low, high = -np.asarray(size) / 2, np.asarray(size) / 2
    arrays = ((np.array(cavity.centre), np.array(cavity.size)) for cavity in cavities)
    hollows = [(np.clip(c - s / 2, low, high), np.clip(c + s / 2, low, high)) for c, s in arrays]
    planes = [np.unique([low[k], high[k], *(end[k] for hollow in hollows for end in hollow)]) for k in range(3)]
    middles = np.stack(np.meshgrid(*((axis[1:] + axis[:-1]) / 2 for axis in planes), indexing="ij"), axis=-1)
    full = ~np.any([np.all((middles > lower) & (middles < upper), axis=-1) for lower, upper in hollows], axis=0)
    for cell in np.argwhere(full):
        if not full[tuple(cell)]:
            continue  # already part of an earlier box
        end = cell + 1
        for k in range(3):
            while (
                end[k] < full.shape[k]
                and full[tuple(map(slice, cell, np.where(np.arange(3) == k, end + 1, end)))].all()
            ):
                end[k] += 1
        full[tuple(map(slice, cell, end))] = False
        begin, stop = (np.array([planes[k][corner[k]] for k in range(3)]) for corner in (cell, end))
        (x, y, z), (dx, dy, dz) = ((begin + stop) / 2).tolist(), (stop - begin).tolist()
        yield Part(SolidKind.BOX, (dx, dy, dz), Pose((x, y, z)))


def _dish(size: tuple[float, float, float], wall: float) -> Iterator[Part]:
    """Yield a bottom and :data:`SEGMENTS` boxes around it, inside a cylinder, the first in direction of the x axis."""
    x, y, height = size
    radius = max(x, y) / 2
    yield Part(SolidKind.CYLINDER, (2 * radius - wall, 2 * radius - wall, wall), Pose((0.0, 0.0, (wall - height) / 2)))
    half = math.pi / SEGMENTS
    middle = radius * math.cos(half) - wall / 2
    for number in range(SEGMENTS):
        turn = 2 * half * number
        place = Pose.planar(middle * math.cos(turn), middle * math.sin(turn), turn)
        yield Part(SolidKind.BOX, (wall, 2 * radius * math.sin(half), height), place)


def _room(body: Body) -> tuple[Part, ...]:
    """Build a slab under the interior, and four walls around it with the room's cavities as openings."""
    x, y, z = body.size
    floor = Part(
        SolidKind.BOX, (x + 2 * WALL, y + 2 * WALL, WALL), Pose((0.0, 0.0, -z / 2 - WALL / 2)), (0.62, 0.64, 0.66, 1.0)
    )
    walls = [
        Part(
            SolidKind.BOX,
            (WALL, y, z) if axis == 0 else (x + 2 * WALL, WALL, z),
            Pose((sign * (x + WALL) / 2, 0.0, 0.0) if axis == 0 else (0.0, sign * (y + WALL) / 2, 0.0)),
            outward=(sign, 0.0, 0.0) if axis == 0 else (0.0, sign, 0.0),
        )
        for axis in (0, 1)
        for sign in (-1.0, 1.0)
    ]
    return (floor, *(part for wall in walls for part in _with_openings(wall, body.cavities)))


def _with_openings(wall: Part, openings: Sequence[Cavity]) -> Iterator[Part]:
    """Yield what openings leave of a wall."""
    if not openings:
        yield wall
        return
    own = (wall.offset.inverse() @ Pose(one.centre) for one in openings)
    cuts = [Cavity(pose.position, one.size) for pose, one in zip(own, openings, strict=True)]
    for part in _around(wall.size, cuts):
        yield replace(part, offset=wall.offset @ part.offset, outward=wall.outward)
