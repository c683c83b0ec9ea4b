"""Collision bodies as convex pieces in arrays: things of a room, links of a robot, held objects; frames are numbered.

A shape is approximated from inside by spheres. What penetrates a sphere penetrates the shape. What is farther from all
spheres than ``slack``, the largest protrusion of the shape from them, does not touch it. In between only an exact query
can decide.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from itertools import compress
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from planlang.cache import Cache
from planlang.geometry import IDENTITY, Array, Pose
from planlang.geometry.matrices import moved, product, rotated
from planlang.geometry.shapes import ConvexSolid, SolidKind, convex_solid
from planlang.records import dataclass
from sim import Solid

MOST = 24
"""Largest number of spheres per shape."""
OUT = 0.008
"""Protrusion that a shape may keep from its spheres before more are added [m]."""
CENTRES, POINTS = 250, 300
"""Approximate numbers of candidate sphere centres, and of surface points that rate them."""
CELLS = 16_000
"""Approximate number of cells into which the box around a shape is divided to measure its slack.

The slack comes out too large by half the diagonal of a cell: 5 mm for a link of 10 by 10 by 30 cm."""
MOST_DISTANCES = 4_000_000
"""Distances of points from planes that are computed at once: 32 MB."""
FLAT = 1e-7
"""Distance from a face within which points count as on it [m]; rounding of coordinates of some metres is smaller."""
MOST_POINTS, DIRECTIONS = 1_500, 600
"""Number of points beyond which a shape is reduced to those that are extreme in these directions; the others'
protrusion from that smaller hull is measured."""
THINNEST = 1e-3
"""Extent to which flatter shapes are thickened [m], so that they have an interior."""
_CACHE = Cache("spheres", most=1000)


@dataclass(frozen=True, slots=True, eq=False)
class Spheres:
    """Centres and radii (k, 4) [m] in the shape's frame; the module's docstring defines ``slack`` [m]."""

    balls: Array
    slack: float


@dataclass(frozen=True, slots=True, eq=False)
class Faces:
    """Surface of a convex polyhedron: x is inside where normals (f, 3) @ x <= offsets (f,)."""

    triangles: Array
    """Corners (f, 3, 3)."""
    normals: Array
    offsets: Array

    def depths(self, places: Array) -> Array:
        """Compute depths of points (m, 3) inside (m,) [m]; negative outside, where they are only bounds."""
        at_once = max(1, MOST_DISTANCES // max(len(self.offsets), 1))  # detailed meshes have 20,000 faces
        parts = [places[first : first + at_once] for first in range(0, max(len(places), 1), at_once)]
        return np.concatenate(
            [(self.offsets - np.einsum("mk,fk->mf", part, self.normals)).min(axis=1) for part in parts]
        )

    def surface(self, spacing: float) -> Array:
        """Sample points (m, 3) such that no point of the surface is farther than ``spacing`` [m] from one."""
        pending, done = self.triangles, [self.triangles.reshape(-1, 3)]
        while len(pending):  # halve the longest side, until the corners of each triangle are near all of it
            sides = np.linalg.norm(np.roll(pending, -1, axis=1) - pending, axis=2)
            long = sides.max(axis=1) > np.sqrt(3.0) * spacing
            pending, first = pending[long], np.argmax(sides[long], axis=1)
            rows = np.arange(len(pending))
            a, b, c = (pending[rows, (first + k) % 3] for k in range(3))
            middle = (a + b) / 2
            done.append(middle)
            pending = np.concatenate([np.stack([a, middle, c], axis=1), np.stack([middle, b, c], axis=1)])
        return np.concatenate(done)

    def spacing(self) -> float:
        """Compute the spacing of about :data:`POINTS` points on the surface [m]."""
        first, second = (self.triangles[:, k] - self.triangles[:, 0] for k in (1, 2))
        area = float(np.linalg.norm(np.cross(first, second), axis=1).sum() / 2)
        return max(1e-3, float(np.sqrt(area / POINTS)))


@cache
def kept_spheres(points: bytes, radius: float, beyond: float) -> Spheres:
    """Compute :func:`spheres_in` of points (n, 3), given as bytes, or load them from the user's cache."""
    rows = np.frombuffer(points).reshape(-1, 3)
    if len(rows) == 1:
        return spheres_in(rows, radius, beyond)
    key = repr((points, radius, beyond, _method()))
    content = _CACHE.load(key)
    if content is not None:
        cached = np.frombuffer(content).reshape(-1, 4)
        return Spheres(cached[1:], float(cached[0, 0]))
    spheres = spheres_in(rows, radius, beyond)
    _CACHE.keep(key, np.vstack([[spheres.slack, 0, 0, 0], spheres.balls]).tobytes())
    return spheres


def spheres_in(points: Array, radius: float = 0.0, beyond: float = 0.0) -> Spheres:
    """Fill the hull of points (n, 3) greedily: each sphere leaves the least surface far from all spheres.

    A single point stands for a ball of ``radius`` [m]; ``beyond`` [m] is the shape's protrusion from the hull.
    """
    if len(points) == 1:
        return Spheres(np.append(points, [[radius]], axis=1), beyond)
    outer = _outermost(points)
    faces = faces_of(outer)
    if len(outer) < len(points):
        beyond += max(0.0, -float(faces.depths(points).min()))
    cells, _ = _cells(points, CENTRES)
    depths = faces.depths(cells)
    centres, radii = cells[depths > 1e-4], depths[depths > 1e-4]
    if not len(centres):  # thinner than a cell
        centres = faces.triangles.reshape(-1, 3).mean(axis=0, keepdims=True)
        radii = np.maximum(faces.depths(centres), 1e-4)
    marks = np.concatenate([faces.surface(faces.spacing()), centres])
    misses = np.maximum(_distances(marks, centres) - radii, OUT)
    nearest = np.full(len(marks), np.ptp(points, axis=0).max())
    chosen: list[int] = []
    while len(chosen) < MOST:
        gain = np.maximum(nearest[:, None] - misses, 0.0).sum(axis=0)
        best = int(np.argmax(gain.round(9)))  # rounded, so that ties do not depend on the processor
        if gain[best] <= 1e-9 and chosen:  # at least one, even for the smallest shape
            break
        chosen.append(best)
        nearest = np.minimum(nearest, misses[:, best])
        marks, misses, nearest = (array[nearest > OUT] for array in (marks, misses, nearest))
    centres, radii = centres[chosen], radii[chosen]
    cells, half = _cells(points, CELLS)
    covering = cells[faces.depths(cells) >= -half]  # these contain the whole shape
    slack = max(0.0, float((_distances(covering, centres) - radii).min(axis=1).max()) + half)
    return Spheres(np.column_stack([centres, radii]), slack + beyond)


def _outermost(points: Array) -> Array:
    """Reduce too many points (n, 3) to the extreme ones in evenly spread directions (Fibonacci sphere)."""
    if len(points) <= MOST_POINTS:
        return points
    turn = np.pi * (3.0 - np.sqrt(5.0)) * np.arange(DIRECTIONS)
    height = 1.0 - (2.0 * np.arange(DIRECTIONS) + 1.0) / DIRECTIONS
    width = np.sqrt(1.0 - height**2)
    directions = np.column_stack([width * np.cos(turn), width * np.sin(turn), height])
    return np.asarray(points[np.unique([int(np.argmax(points @ direction)) for direction in directions])])


def _cells(points: Array, number: int) -> tuple[Array, float]:
    """Divide the box around points into cells: centres (c, 3), and half their diagonal [m]."""
    low, high = points.min(axis=0), points.max(axis=0)
    size = np.maximum(high - low, 1e-3)
    pitch = float(np.cbrt(size.prod() / number))
    counts = [max(1, round(extent / pitch)) for extent in size.tolist()]
    axes = [
        middle + extent * ((np.arange(count) + 0.5) / count - 0.5)
        for middle, extent, count in zip((low + high) / 2, size, counts, strict=True)
    ]
    centres = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    return centres, float(np.linalg.norm(size / counts) / 2)


def _distances(points: Array, centres: Array) -> Array:
    """Compute distances (p, c) between points (p, 3) and centres (c, 3)."""
    products = np.einsum("pk,ck->pc", points, centres)
    squares = (points**2).sum(axis=1)[:, None] + (centres**2).sum(axis=1) - 2.0 * products
    return np.asarray(np.sqrt(np.maximum(squares, 0.0)))


@cache
def _method() -> str:
    """Digest of what results depend on besides the shape: this file."""
    return hashlib.sha256(Path(__file__).read_bytes()).hexdigest()


def _thickened(points: Array) -> Array:
    """Thicken flat shapes: double their points across the plane, so that they span a volume."""
    centre = points.mean(axis=0)
    axes = np.linalg.eigh((points - centre).T @ (points - centre))[1].T
    spread = np.ptp((points - centre) @ axes.T, axis=0)
    for axis, extent in zip(axes, spread, strict=True):
        if extent < THINNEST:
            points = np.concatenate([points + axis * THINNEST / 2, points - axis * THINNEST / 2])
    return points


def faces_of(points: Array) -> Faces:
    """Compute the convex hull of points (n, 3), by adding one point after another to a tetrahedron."""
    points = _thickened(points)
    corners = _first_four(points)
    centre = points[corners].mean(axis=0)
    faces = np.array([[corners[k] for k in range(4) if k != left] for left in range(4)])
    triangles, normals, offsets = _outward(points, faces, centre)
    # the farthest first: most of the others are inside then
    for number in np.argsort(-np.linalg.norm(points - centre, axis=1), kind="stable"):
        visible = normals @ points[number] > offsets + FLAT
        if not visible.any():
            continue
        edges = np.concatenate([triangles[visible][:, [a, b]] for a, b in ((0, 1), (1, 2), (2, 0))])
        directed = {(int(a), int(b)) for a, b in edges}
        rim = [edge for edge in directed if (edge[1], edge[0]) not in directed]
        cone = np.array([(a, b, number) for a, b in sorted(rim)])
        added = _outward(points, cone, centre)
        triangles, normals, offsets = (
            np.concatenate([old[~visible], new]) for old, new in zip((triangles, normals, offsets), added, strict=True)
        )
    return Faces(points[triangles], normals, offsets)


def _first_four(points: Array) -> list[int]:
    """Numbers of four points that span a volume."""
    first = int(np.argmin(points[:, 0]))
    second = int(np.argmax(np.linalg.norm(points - points[first], axis=1)))
    along = points[second] - points[first]
    third = int(np.argmax(np.linalg.norm(np.cross(points - points[first], along), axis=1)))
    normal = np.cross(along, points[third] - points[first])
    return [first, second, third, int(np.argmax(np.abs((points - points[first]) @ normal)))]


def _outward(points: Array, triangles: Array, inside: Array) -> tuple[Array, Array, Array]:
    """Orient triangles (f, 3) of point numbers so that normals point away from an inner point; normals; offsets."""
    a, b, c = (points[triangles[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    lengths = np.linalg.norm(normals, axis=1)
    normals = normals / np.maximum(lengths, 1e-30)[:, None]
    offsets = np.einsum("fk,fk->f", normals, a)
    back = normals @ inside > offsets
    triangles = np.where(back[:, None], triangles[:, ::-1], triangles)
    normals[back] *= -1
    offsets[back] *= -1
    return triangles, normals, offsets


MAP, BASE, FIRST_JOINT = 0, 1, 2
"""Numbers of frames; the children of moving joints follow in order."""
ANY = 1e3
"""Half extent of a piece along an axis that does not count [m]: larger than any room."""

Index = NDArray[np.intp]


@dataclass(frozen=True, slots=True, eq=False)
class Solids:
    """k convex pieces; cylinders are measured by the distance from the axis, spheres by that from the centre."""

    bodies: tuple[str, ...]
    centres: Array
    """(k, 3)."""
    axes: Array
    """(k, 3, 3), columns are the axes of each piece in its frame."""
    half: Array
    """(k, 3); of a cylinder (radius, any, half height), of a sphere (radius, any, any)."""
    kinds: Index
    """Number of axes that are combined into a radius: 1 for a box (none), 2 for a cylinder, 3 for a sphere."""
    reach: Array
    """Radius of a bounding sphere of each piece (k,)."""
    limbs: NDArray[np.bool_]
    """Mask of parts of people's arms that have left their rest, (k,)."""

    @staticmethod
    def of(pieces: Sequence[Solid]) -> Solids:
        """Convert the pieces that a world reports."""
        matrices = Pose.matrices(piece.pose for piece in pieces)
        shapes = [(piece.kind, piece.size) for piece in pieces]
        limbs = np.array([piece.limb for piece in pieces], bool)
        return replace(Solids.placed(tuple(piece.body for piece in pieces), matrices, shapes), limbs=limbs)

    @staticmethod
    def placed(
        bodies: tuple[str, ...], matrices: Array, shapes: Sequence[tuple[str, tuple[float, float, float]]]
    ) -> Solids:
        """Create pieces from their poses (k, 4, 4), kinds and extents [m]."""
        half = np.array([size for _, size in shapes]).reshape(-1, 3) / 2
        kinds = np.array(
            [{SolidKind.BOX: 1, SolidKind.CYLINDER: 2}.get(SolidKind(kind), 3) for kind, _ in shapes], np.intp
        )
        reach = np.sqrt((half**2 * (np.arange(3) >= kinds[:, None] - 1)).sum(axis=1))
        half[kinds >= 2, 1] = ANY
        half[kinds == 3, 2] = ANY
        return Solids(bodies, matrices[:, :3, 3], matrices[:, :3, :3], half, kinds, reach, np.zeros(len(bodies), bool))

    @staticmethod
    def spheres(body: str, balls: Array) -> Solids:
        """Create the spheres of a body from centres and radii (k, 4) [m]."""
        count, radii = len(balls), balls[:, 3]
        half = np.column_stack([radii, np.full((count, 2), ANY)])
        kinds, axes = np.full(count, 3, np.intp), np.tile(np.eye(3), (count, 1, 1))
        return Solids((body,) * count, balls[:, :3], axes, half, kinds, radii, np.zeros(count, bool))

    def __len__(self) -> int:
        return len(self.bodies)

    @property
    def extents(self) -> Array:
        """Half extents (k, 3) of the boxes around pieces, along their axes [m]."""
        return np.where(self.half < ANY, self.half, self.half[:, :1])

    @staticmethod
    def joined(several: Sequence[Solids]) -> Solids:
        """Concatenate pieces."""
        every = several or [Solids.of(())]
        names = tuple(body for solids in every for body in solids.bodies)
        fields = ("centres", "axes", "half", "kinds", "reach", "limbs")
        return Solids(names, *(np.concatenate([getattr(solids, field) for solids in every]) for field in fields))

    def only(self, kept: NDArray[np.bool_] | Index) -> Solids:
        """Select pieces by a mask (k,) or by numbers."""
        rows = np.flatnonzero(kept) if kept.dtype == bool else kept
        names = tuple(self.bodies[row] for row in rows.tolist())
        arrays = (self.centres, self.axes, self.half, self.kinds, self.reach, self.limbs)
        return Solids(names, *(array[rows] for array in arrays))  # type: ignore[arg-type]

    def moved(self, places: Array) -> Solids:
        """Transform each piece by the pose (k, 4, 4) of its present frame in the new one."""
        return replace(self, centres=moved(places, self.centres), axes=product(places[:, :3, :3], self.axes))

    def piece(self, number: int) -> ConvexSolid:
        """Convert one piece to points that span it; its pose is not included."""
        kind = (SolidKind.BOX, SolidKind.CYLINDER, SolidKind.SPHERE)[self.kinds[number] - 1]
        x, y, z = (2 * self.extents[number]).tolist()
        return convex_solid(kind, (x, y, z), IDENTITY)

    def crossed(self, starts: Array, ends: Array) -> NDArray[np.bool_]:
        """Check which segments (n, 3) enter a piece from outside (for a round piece, the box inside it), (n,)."""
        boxes = self.half.copy()
        round_, balls = self.kinds >= 2, self.kinds == 3
        boxes[round_, 1] = boxes[round_, 0] = self.half[round_, 0] / np.sqrt(self.kinds[round_])
        boxes[balls, 2] = boxes[balls, 0]
        first, last = np.full((len(self), len(starts)), -np.inf), np.full((len(self), len(starts)), np.inf)
        for axis in range(3):
            across, half = self.axes[:, :, axis], boxes[:, axis, None]
            begin = across @ starts.T - np.einsum("ki,ki->k", across, self.centres)[:, None]
            direction = across @ (ends - starts).T
            direction[np.abs(direction) < 1e-9] = 1e-9
            middle, span = -begin / direction, np.abs(half / direction)
            np.maximum(first, middle - span, out=first)
            np.minimum(last, middle + span, out=last)
        return np.asarray(((first <= last) & (first > 0.0) & (first <= 1.0)).any(axis=0))


def distances(local: Array, half: Array, kinds: Index) -> Array:
    """Compute distances (k, ...) of points (3, k, ...), in pieces' frames, from their surfaces, negative inside [m].

    ``half`` (3, k, ...) and ``kinds`` (k,) are those of :class:`Solids`.
    """
    offsets = np.abs(local)
    if len(round_ := np.flatnonzero(kinds >= 2)):
        x, y, z = offsets[:, round_]
        ball = kinds[round_] == 3
        z = z * ball.reshape(-1, *(1,) * (z.ndim - 1))
        offsets[0, round_] = np.sqrt(x * x + y * y + z * z)
        offsets[1, round_] = 0.0
        offsets[2, round_[ball]] = 0.0
    offsets -= half
    inside = np.minimum(offsets.max(axis=0), 0.0)
    np.maximum(offsets, 0.0, out=offsets)
    offsets *= offsets
    return np.asarray(np.sqrt(offsets[0] + offsets[1] + offsets[2]) + inside)


def counts(first: Index) -> Index:
    """Sizes of groups (m,), given where each begins and the last one ends (m + 1,)."""
    return first[1:] - first[:-1]


@dataclass(frozen=True, slots=True, eq=False)
class Bodies:
    """m links, held objects or things of a room, or single shapes of them, as pieces in the frames that carry them.

    Moving bodies are represented by spheres inside them, obstacles by as many pieces as needed.
    """

    names: tuple[str, ...]
    frames: Index
    """(m,)."""
    first: Index
    """Index of the first piece of each body, and the total: body i owns [i] to [i + 1] - 1, (m + 1,)."""
    solids: Solids
    slack: Array
    """Largest protrusion of each real body from its pieces (m,) [m]."""
    hulls: tuple[tuple[ConvexSolid, ...], ...]
    """Real shapes of each; empty where the pieces are exact."""
    places: Array
    """Poses (m, 4, 4) of the frames of the real shapes."""

    @staticmethod
    def of(rows: Sequence[tuple[str, int, Solids, float, tuple[ConvexSolid, ...]]]) -> Bodies:
        """Create bodies from rows of name, frame, pieces, slack and real shapes."""
        return Bodies(
            tuple(name for name, *_ in rows),
            np.array([frame for _, frame, *_ in rows], np.intp),
            np.cumsum([0, *(len(solids) for _, _, solids, *_ in rows)]).astype(np.intp),
            Solids.joined([solids for _, _, solids, *_ in rows]),
            np.array([slack for *_, slack, _ in rows], float),
            tuple(hulls for *_, hulls in rows),
            np.tile(np.eye(4), (len(rows), 1, 1)),
        )

    def __len__(self) -> int:
        return len(self.names)

    def only(self, kept: NDArray[np.bool_]) -> Bodies:
        """Select the bodies of a mask (m,)."""
        sizes, chosen = counts(self.first), kept.tolist()
        return Bodies(
            tuple(compress(self.names, chosen)),
            self.frames[kept],
            np.append(0, np.cumsum(sizes[kept])).astype(np.intp),
            self.solids.only(np.repeat(kept, sizes)),
            self.slack[kept],
            tuple(compress(self.hulls, chosen)),
            self.places[kept],
        )

    @staticmethod
    def joined(several: Sequence[Bodies]) -> Bodies:
        """Concatenate bodies."""
        filled = [bodies for bodies in several if len(bodies)] or [Bodies.of(())]
        if len(filled) == 1:
            return filled[0]
        return Bodies(
            tuple(name for bodies in filled for name in bodies.names),
            np.concatenate([bodies.frames for bodies in filled]),
            np.append(0, np.cumsum(np.concatenate([counts(bodies.first) for bodies in filled]))).astype(np.intp),
            Solids.joined([bodies.solids for bodies in filled]),
            np.concatenate([bodies.slack for bodies in filled]),
            tuple(hulls for bodies in filled for hulls in bodies.hulls),
            np.concatenate([bodies.places for bodies in filled]),
        )

    def moved(self, places: Array) -> Bodies:
        """Transform each body by the pose (m, 4, 4) of its present frame in the new one."""
        of_piece = np.repeat(places, counts(self.first), axis=0)
        return replace(self, solids=self.solids.moved(of_piece), places=product(places, self.places))

    def spans(self, body: int, piece: int) -> list[tuple[Array, float]]:
        """Points (n, 3) in the body's frame that span its shapes, with the protrusion of each shape [m].

        For a body whose pieces are exact, those of one ``piece`` only.
        """
        if not self.hulls[body]:
            solid, (turn, shift) = self.solids.piece(piece), (self.solids.axes[piece], self.solids.centres[piece])
            return [(rotated(turn, solid.points) + shift, solid.radius + solid.beyond)]
        return [
            (moved(product(self.places[body], solid.pose.matrix()), solid.points), solid.radius + solid.beyond)
            for solid in self.hulls[body]
        ]


@dataclass(frozen=True, slots=True, eq=False)
class Pairs:
    """w pairs of a mover and an obstacle, by number, that must not overlap by more than ``allowed`` [m]."""

    movers: Index
    obstacles: Index
    allowed: Array

    @staticmethod
    def of(pairs: Sequence[tuple[int, int]]) -> Pairs:
        """Create pairs that must not touch at all."""
        rows = np.array(pairs, np.intp).reshape(-1, 2)
        return Pairs(rows[:, 0], rows[:, 1], np.zeros(len(rows)))

    def followed_by(self, other: Pairs) -> Pairs:
        """Append other pairs."""
        return Pairs(
            np.concatenate([self.movers, other.movers]),
            np.concatenate([self.obstacles, other.obstacles]),
            np.concatenate([self.allowed, other.allowed]),
        )
