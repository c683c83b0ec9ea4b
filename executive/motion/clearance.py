"""Clearance of a standing robot at each point of a map, and the poses that its base can reach.

A silhouette is the space of a robot that turns on the spot, compared with upright boxes. A robot that is not round can
stand closer to things with the right heading: its corners point where there is room. For that, each link has an outline
from above, which it fills over its whole height. What can be reached is one flood fill from the robot's pose over free
cells and headings: the base moves without turning, or turns on the spot, and thus reaches places where its
circumscribed circle has no room.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from functools import cached_property
from itertools import product

import numpy as np
from numpy.typing import ArrayLike, NDArray

from planlang.geometry import Array, Pose
from planlang.records import dataclass

Band = tuple[float, float, float]
"""Slice of a robot's silhouette: z_low, z_high above the floor, and radius [m]."""


ROUNDING = 1e-6
"""Margin for leaving out distant boxes [m]."""
AT_ONCE = 8192
"""Point-box distances computed together, so that they stay in the processor's cache."""
FEW = 16
"""Number of boxes that are compared with points without dividing these further."""
TOGETHER = 32_768
"""Point-box distances for which dividing the points would cost more than it saves."""


@dataclass(frozen=True, eq=False)
class Boxes:
    """Upright boxes: ``centres`` (n, 3) and ``half_extents`` (n, 3) [m], ``yaws`` (n,) [rad], in the map."""

    centres: Array
    half_extents: Array
    yaws: Array

    @staticmethod
    def around(poses: Iterable[Pose], sizes: ArrayLike) -> Boxes:
        """Enclose boxes with poses and sizes (n, 3); a tilted one by the smallest upright prism along an edge."""
        matrices = Pose.matrices(poses)
        half = np.asarray(sizes, float).reshape(-1, 3) / 2
        if len(matrices) != len(half):
            raise ValueError(f"{len(matrices)} poses do not go with {len(half)} sizes")
        columns = matrices[:, :3, :3]
        flat = np.linalg.norm(columns[:, :2], axis=1)
        # the three candidates for the prism's x direction: each edge of the box seen from above
        candidates = np.where(flat > 1e-9, np.arctan2(columns[:, 1], columns[:, 0]), 0.0)
        cosine, sine = np.cos(candidates), np.sin(candidates)
        along = cosine[:, :, None] * columns[:, None, 0] + sine[:, :, None] * columns[:, None, 1]
        across = -sine[:, :, None] * columns[:, None, 0] + cosine[:, :, None] * columns[:, None, 1]
        x = (np.abs(along) * half[:, None]).sum(axis=2)
        y = (np.abs(across) * half[:, None]).sum(axis=2)
        best = np.argmin(np.where(flat > 1e-9, np.round(x * y, 12), np.inf), axis=1)
        rows = np.arange(len(half))
        z = (np.abs(columns[:, 2]) * half).sum(axis=1)
        return Boxes(matrices[:, :3, 3], np.stack([x[rows, best], y[rows, best], z], axis=1), candidates[rows, best])

    def __len__(self) -> int:
        return len(self.yaws)

    def only(self, index: ArrayLike) -> Boxes:
        """Select boxes by index, indices or a mask."""
        rows = np.atleast_1d(np.asarray(index))
        return Boxes(self.centres[rows], self.half_extents[rows], self.yaws[rows])

    @cached_property
    def _axes(self) -> tuple[Array, Array]:
        """Cosines and sines (n, 1) of the yaws."""
        return np.cos(self.yaws)[:, None], np.sin(self.yaws)[:, None]

    def distances(self, places: Array, some: NDArray[np.intp]) -> Array:
        """Distances (m, k) from above of points (k, 2) from some boxes (m,); negative inside, to the nearest side."""
        dx, dy = places[:, 0] - self.centres[some, :1], places[:, 1] - self.centres[some, 1:2]
        cosine, sine = (turn[some] for turn in self._axes)
        along = np.abs(cosine * dx + sine * dy) - self.half_extents[some, :1]
        across = np.abs(cosine * dy - sine * dx) - self.half_extents[some, 1:2]
        inside = np.minimum(np.maximum(along, across), 0.0)
        outside = np.sqrt(np.square(np.maximum(along, 0.0)) + np.square(np.maximum(across, 0.0)))
        outside += inside
        return np.asarray(outside)

    def beyond(self, low: Array, high: Array, some: NDArray[np.intp]) -> Array:
        """Lower bounds (m,) of these distances of some boxes from all points of a rectangle."""
        turned = np.abs(np.concatenate([turn[some] for turn in self._axes], axis=1))
        x, y = self.half_extents[some, :1], self.half_extents[some, 1:2]
        extents, centres = x * turned + y * turned[:, ::-1], self.centres[some, :2]
        return np.asarray((np.maximum(low - centres, centres - high) - extents).max(axis=1))


@dataclass(frozen=True, slots=True)
class Grid:
    """Square cells over a rectangle of the map; ``x`` and ``y`` [m] are the centre of cell (0, 0).

    An array over the grid has shape (rows, columns): rows go along y, columns along x.
    """

    x: float
    y: float
    columns: int
    rows: int
    resolution: float = 0.05

    @staticmethod
    def over(lower: tuple[float, float], upper: tuple[float, float], resolution: float = 0.05) -> Grid:
        """Cover the rectangle between two corners [m] by whole cells that do not leave it."""
        counts = [int(np.floor((high - low) / resolution + 1e-9)) for low, high in zip(lower, upper, strict=True)]
        if min(counts) < 1:
            raise ValueError(f"no cell of {resolution} m fits between {lower} and {upper}")
        return Grid(lower[0] + resolution / 2, lower[1] + resolution / 2, counts[0], counts[1], resolution)

    def centres(self) -> Array:
        """Cell centres (rows, columns, 2) [m]."""
        xs = self.x + self.resolution * np.arange(self.columns)
        ys = self.y + self.resolution * np.arange(self.rows)
        return np.stack(np.meshgrid(xs, ys), axis=-1)

    def cell(self, x: float, y: float) -> tuple[int, int] | None:
        """Row and column of the cell that contains a point; None outside the grid."""
        row, column = round((y - self.y) / self.resolution), round((x - self.x) / self.resolution)
        return (row, column) if 0 <= row < self.rows and 0 <= column < self.columns else None


def clearance_at(points: ArrayLike, boxes: Boxes, silhouette: Sequence[Band]) -> Array:
    """Compute the clearance (k,) [m] of a robot standing at points (k, 2); negative where its silhouette meets a box.

    The smallest horizontal distance between any band and any box at its height, minus the band's radius; inf without
    boxes. Inside a box distances are negative, to the nearest side.
    """
    return clearances_at(points, boxes, (silhouette,)).reshape(-1)


def clearances_at(
    points: ArrayLike, boxes: Boxes, silhouettes: Sequence[Sequence[Band]], most: float = np.inf
) -> Array:
    """Compute clearances for several silhouettes, (s, k); values above ``most`` [m] may be too large."""
    places = np.asarray(points, float).reshape(-1, 2)
    clearances = np.full((len(silhouettes), len(places)), np.inf)
    bottom = boxes.centres[:, 2] - boxes.half_extents[:, 2]
    top = boxes.centres[:, 2] + boxes.half_extents[:, 2]
    # the widest band that meets a box decides for it
    widest = np.full((len(silhouettes), len(boxes)), -np.inf)
    for number, silhouette in enumerate(silhouettes):
        for low, high, radius in silhouette:
            overlaps = (bottom < high) & (top > low)
            widest[number] = np.maximum(widest[number], np.where(overlaps, radius, -np.inf))
    relevant = np.flatnonzero(np.isfinite(widest.max(axis=0, initial=-np.inf)))
    close = boxes.only(relevant)
    for rows, some in _together(places, close, widest[:, relevant], most):
        here, radii = places[rows], widest[:, relevant[some]]
        least, batch = np.full((len(silhouettes), len(here)), np.inf), max(1, AT_ONCE // len(here))
        for first in range(0, len(some), batch):
            distances = close.distances(here, some[first : first + batch])
            for clearance, radius in zip(least, radii[:, first : first + batch], strict=True):
                np.minimum(clearance, (distances - radius[:, None]).min(axis=0), out=clearance)
        clearances[:, rows] = least
    return clearances


Part = tuple[NDArray[np.intp], NDArray[np.intp]]
"""Numbers of points that lie together, and of the boxes that matter to them."""


def _together(places: Array, boxes: Boxes, widest: Array, most: float) -> Iterator[Part]:
    """Divide points (k, 2) into groups, each with the boxes that may be the nearest to one of its points.

    A box whose distance from the group's rectangle is above the clearance that the group has anyway, by another box,
    cannot be: so each point is compared with those around it, however many there are in the map.
    """
    every = np.arange(len(boxes))
    left: list[Part] = [(np.arange(len(places)), every)] if len(places) and len(every) else []
    while left:
        rows, some = left.pop()
        low, high = places[rows].min(axis=0), places[rows].max(axis=0)
        if len(some) > FEW:
            middle, radii = (low + high) / 2, widest[:, some]
            room = boxes.distances(middle[None], some)[:, 0] - radii
            largest = np.minimum(room.min(axis=1) + float(np.hypot(*(high - low))) / 2, most)
            least = boxes.beyond(low, high, some) - radii
            some = some[(least <= largest[:, None] + ROUNDING).any(axis=0)]
        wide = int(np.argmax(high - low))
        is_low = places[rows, wide] <= (low[wide] + high[wide]) / 2
        if len(some) <= FEW or len(rows) * len(some) <= TOGETHER or is_low.all():
            if len(some):
                yield rows, some
        else:
            left += [(rows[~is_low], some), (rows[is_low], some)]


def clearance_field(grid: Grid, boxes: Boxes, silhouette: Sequence[Band]) -> Array:
    """Compute :func:`clearance_at` at the cell centres of a grid, (rows, columns) [m]."""
    return clearance_at(grid.centres(), boxes, silhouette).reshape(grid.rows, grid.columns)


TOUCHING = 0.002
"""Smallest overlap of an outline and a box that counts [m]; exact queries decide about less."""


@dataclass(frozen=True, slots=True, eq=False)
class Outline:
    """Link from above, between heights ``low`` and ``high`` [m]: a convex polygon in the base frame."""

    low: float
    high: float
    corners: Array
    """(n, 2), counter-clockwise."""
    normals: Array
    """Outward normals of the edges, (n, 2)."""
    offsets: Array
    """Distances of the edges from the base's origin along the normals (n,) [m]."""
    radius: float
    """Radius of the smallest circle about the base's origin that contains the outline [m]."""
    inner: float
    """Radius of the largest circle about the base's origin inside the outline [m]; negative if outside of it."""

    @staticmethod
    def of(low: float, high: float, corners: Array) -> Outline:
        """Create an outline from corners (n, 2) in counter-clockwise order."""
        edges = np.roll(corners, -1, axis=0) - corners
        normals = np.stack([edges[:, 1], -edges[:, 0]], axis=1) / np.linalg.norm(edges, axis=1)[:, None]
        offsets = np.einsum("nk,nk->n", normals, corners)
        radius = float(np.linalg.norm(corners, axis=1).max())
        return Outline(low, high, corners, normals, offsets, radius, float(offsets.min()))


def outlines(shapes: Iterable[tuple[float, float, Array]]) -> tuple[Outline, ...]:
    """Create the outlines of links (z_low, z_high, corners), without those that a single other one covers."""
    candidates = [Outline.of(*shape) for shape in shapes if len(shape[2]) > 2]
    kept: list[Outline] = []
    for one in sorted(candidates, key=lambda one: -one.radius):
        if not any(k.low <= one.low and one.high <= k.high and one.radius <= k.inner for k in kept):
            kept.append(one)
    return tuple(kept)


def cores(shapes: Sequence[Outline]) -> tuple[Band, ...]:
    """List the circles inside the outlines: the space that a robot takes with any heading."""
    return tuple((one.low, one.high, one.inner) for one in shapes if one.inner > 0.0)


def stands_in_none(bases: Array, boxes: Boxes, shapes: Sequence[Outline]) -> NDArray[np.bool_]:
    """Check at which bases (m, 3) no outline overlaps a box, by separating axes (m,)."""
    free = np.ones(len(bases), bool)
    bottom = boxes.centres[:, 2] - boxes.half_extents[:, 2]
    top = boxes.centres[:, 2] + boxes.half_extents[:, 2]
    c, s = np.cos(boxes.yaws), np.sin(boxes.yaws)
    x, y = (bases[:, None, axis] - boxes.centres[:, axis] for axis in (0, 1))
    along = np.maximum(np.abs(c * x + s * y) - boxes.half_extents[:, 0], 0.0)
    across = np.maximum(np.abs(c * y - s * x) - boxes.half_extents[:, 1], 0.0)
    squares = along * along + across * across
    for one in shapes:
        same_height = (bottom < one.high) & (top > one.low)
        rows, columns = np.nonzero((squares < one.radius**2) & same_height & free[:, None])
        if len(rows):
            inside = _overlap(bases[rows], boxes.only(columns), one)
            free[rows[inside]] = False
    return free


def _overlap(bases: Array, boxes: Boxes, one: Outline) -> NDArray[np.bool_]:
    """Check where an outline at a base (p, 3) overlaps its box (p,)."""
    turn = bases[:, 2] - boxes.yaws
    c, s = np.cos(boxes.yaws), np.sin(boxes.yaws)
    x, y = (bases[:, :2] - boxes.centres[:, :2]).T
    half_x, half_y = (boxes.half_extents[:, :2] - TOUCHING).T
    cosine, sine = np.cos(turn)[:, None], np.sin(turn)[:, None]
    # the outline in the box's frame
    along = (c * x + s * y)[:, None] + cosine * one.corners[:, 0] - sine * one.corners[:, 1]
    across = (c * y - s * x)[:, None] + sine * one.corners[:, 0] + cosine * one.corners[:, 1]
    inside = (along.min(axis=1) < half_x) & (along.max(axis=1) > -half_x)
    inside &= (across.min(axis=1) < half_y) & (across.max(axis=1) > -half_y)
    # the box along the outline's normals
    c, s = np.cos(bases[:, 2]), np.sin(bases[:, 2])
    ahead, left = -(c * x + s * y)[:, None], -(c * y - s * x)[:, None]
    middle = ahead * one.normals[:, 0] + left * one.normals[:, 1]
    in_box_x = cosine * one.normals[:, 0] - sine * one.normals[:, 1]
    in_box_y = sine * one.normals[:, 0] + cosine * one.normals[:, 1]
    nearest = middle - np.abs(in_box_x) * half_x[:, None] - np.abs(in_box_y) * half_y[:, None]
    return np.asarray(inside & (nearest < one.offsets).all(axis=1))


Mask = NDArray[np.bool_]
Poses = NDArray[np.uint16]
"""Headings of each cell (rows, columns) of a grid, a bit for each."""
HEADINGS = 16
"""Number of headings tested for room."""
EVERY = np.uint16(2**HEADINGS - 1)
"""All headings."""
SPARE = 0.02
"""Clearance required at poses from which the base may drive or turn to the next: real moves are arcs [m]."""
Cell = tuple[int, int, int]
"""Heading, row and column."""
TURN = 2 * math.pi / HEADINGS
"""Angle between neighbouring headings [rad]."""
THIN = 0.01
"""Least half width to which boxes are shrunk [m]: walls must not vanish."""
LACKING = 0.05
"""Clearance that may be missing where no path must be ruled out: the distance of a pose from its cell's centre [m]."""


@dataclass(frozen=True, slots=True, eq=False)
class Drivable:
    """Poses over a grid to which a base can drive."""

    grid: Grid
    poses: Poses
    beyond: bool = False
    """True if places off the grid may be reachable, too."""

    def __call__(self, bases: Array) -> Mask:
        """Check which base poses (n, 3) may be reachable, (n,)."""
        row = np.rint((bases[:, 1] - self.grid.y) / self.grid.resolution).astype(int)
        column = np.rint((bases[:, 0] - self.grid.x) / self.grid.resolution).astype(int)
        inside = (row >= 0) & (row < self.grid.rows) & (column >= 0) & (column < self.grid.columns)
        row, column = np.clip(row, 0, self.grid.rows - 1), np.clip(column, 0, self.grid.columns - 1)
        heading = np.floor(bases[:, 2] / TURN).astype(int) % HEADINGS
        return np.asarray(np.where(inside, _turned(self.poses)[row, column] >> heading & 1, self.beyond).astype(bool))

    def comes_near(self, place: Array, within: float) -> bool:
        """Check whether the base may come ``within`` [m] of a place (2,)."""
        return self.beyond or self.near(place, within) > 0

    def near(self, place: Array, within: float) -> int:
        """Count the reachable cells ``within`` [m] of a place (2,)."""
        centres = self.grid.centres()[self.poses > 0]
        return int((np.hypot(centres[:, 0] - place[0], centres[:, 1] - place[1]) <= within).sum())


def drivable(start: tuple[float, float, float], grid: Grid, free: Poses) -> Drivable:
    """Find the poses that a base at ``start`` can reach over free poses, with one cell of tolerance at both ends."""
    return Drivable(grid, _beside(flood(free, around(start, grid))[-1]))


def free_poses(
    grid: Grid, boxes: Boxes, silhouette: Sequence[Band], shapes: Sequence[Outline], slack: float = -SPARE
) -> Poses:
    """Find the poses in which a robot enters no box by more than ``slack`` [m]; negative slack is clearance.

    ``silhouette``: its room to turn; ``shapes``: its outlines, which decide in doubtful cells.
    """
    any_heading = free_cells(grid, boxes, silhouette, slack)
    doubtful = free_cells(grid, boxes, cores(shapes), slack + TOUCHING) & ~any_heading
    free = np.where(any_heading, EVERY, np.uint16(0))
    places = grid.centres()[doubtful]
    thinnest = np.minimum(boxes.half_extents, THIN)
    shrunk = Boxes(boxes.centres, np.maximum(boxes.half_extents - (slack, slack, 0.0), thinnest), boxes.yaws)
    for heading in range(HEADINGS if len(places) else 0):
        bases = np.column_stack([places, np.full(len(places), heading * TURN)])
        free[doubtful] |= stands_in_none(bases, shrunk, shapes).astype(np.uint16) << np.uint16(heading)
    return free


def around(pose: tuple[float, float, float], grid: Grid) -> list[Cell]:
    """List the grid poses near a pose, nearest first: a base that stands close to something starts at one of them."""
    exact = pose[2] / TURN, (pose[1] - grid.y) / grid.resolution, (pose[0] - grid.x) / grid.resolution
    near = product(*(range(math.floor(value) - 1, math.floor(value) + 3) for value in exact))
    return [
        (heading % HEADINGS, row, column)
        for heading, row, column in sorted(near, key=lambda one: math.dist(exact, one))
        if 0 <= row < grid.rows and 0 <= column < grid.columns
    ]


def has(poses: Poses, cell: Cell) -> bool:
    """Check whether a set of poses contains a cell."""
    heading, row, column = cell
    return bool(poses[row, column] >> heading & 1)


def flood(free: Poses, begin: Sequence[Cell], turns: Poses | None = None) -> list[Poses]:
    """Find the free poses reachable from some of them in no step, in at most one, two and so on.

    ``turns`` are the headings from which the base may turn to the next one and back; None allows all.
    """
    reached = np.zeros_like(free)
    for heading, row, column in begin:
        reached[row, column] |= np.uint16(1 << heading)
    steps = [reached & free]
    while True:
        grown = (_beside(steps[-1]) | _turned(steps[-1], EVERY if turns is None else turns)) & free
        if np.array_equal(grown, steps[-1]):
            return steps
        steps.append(grown)


def _beside(poses: Poses) -> Poses:
    """Add the neighbouring cells, with the same headings."""
    wide = poses.copy()
    wide[:, 1:] |= poses[:, :-1]
    wide[:, :-1] |= poses[:, 1:]
    grown = wide.copy()
    grown[1:] |= wide[:-1]
    grown[:-1] |= wide[1:]
    return grown


def _turned(poses: Poses, turns: Poses | np.uint16 = EVERY) -> Poses:
    """Add the next heading to either side, where turning is allowed."""
    turning, last = poses & turns, HEADINGS - 1
    grown = poses | turning << 1 | turning >> last | (poses >> 1 | poses << last) & turns
    return grown.astype(np.uint16, copy=False)


def free_cells(grid: Grid, boxes: Boxes, silhouette: Sequence[Band], slack: float) -> Mask:
    """Find the cells at whose centres no band of a silhouette enters a box by more than ``slack`` [m]."""
    free = np.ones((grid.rows, grid.columns), bool)
    for centre, half, yaw in zip(boxes.centres, boxes.half_extents, boxes.yaws.tolist(), strict=True):
        radii = [r for low, high, r in silhouette if centre[2] - half[2] < high and centre[2] + half[2] > low]
        radius = max(radii, default=0.0) - slack
        if not radii or radius <= 0.0:  # the lintel over a doorway takes no clearance
            continue
        c, s = math.cos(yaw), math.sin(yaw)
        reach = np.array([abs(c) * half[0] + abs(s) * half[1], abs(s) * half[0] + abs(c) * half[1]]) + radius
        low = np.floor((centre[:2] - reach - (grid.x, grid.y)) / grid.resolution).astype(int)
        high = np.ceil((centre[:2] + reach - (grid.x, grid.y)) / grid.resolution).astype(int) + 1
        (left, bottom), (right, top) = np.maximum(low, 0).tolist(), np.maximum(high, 0).tolist()
        window = free[bottom:top, left:right]
        if not window.size:
            continue
        x = grid.x + grid.resolution * np.arange(left, left + window.shape[1]) - centre[0]
        y = grid.y + grid.resolution * np.arange(bottom, bottom + window.shape[0])[:, None] - centre[1]
        along = np.maximum(np.abs(c * x + s * y) - half[0], 0.0)
        across = np.maximum(np.abs(c * y - s * x) - half[1], 0.0)
        window &= np.square(along) + np.square(across) >= radius * radius
    return free
