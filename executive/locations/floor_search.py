"""Base poses without a reach: sampled on the floor, validated one by one, best first.

First a grid around what the location refers to is sampled, in its frame. If that fails, the whole map is searched by
branch and bound: cells in which some conjunct surely holds nowhere are dropped, the others are subdivided, until they
are small or too many. Headings at a point are divided into intervals by the limits of what must and must not be faced;
all headings of an interval are equally good, so one of each is sampled.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Generator, Iterator
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from executive.belief.doorways import narrow_doorway
from executive.belief.floor import CELL
from executive.belief.planning_scene import PlanningScene, Unseen
from executive.locations.base_poses import MOST_CROWDED, BasePoses
from executive.locations.candidate_search import TRAVEL
from executive.locations.demands import BaseDemand
from executive.locations.questions import Question
from executive.locations.rejections import NO_ROOM, NOT_VISIBLE, unmet
from executive.locations.validation import PLACES, BaseValidator
from planlang.failure_wording import NO_WAY
from planlang.geometry import Array
from planlang.geometry.areas import FACING, HAIR, Block, Clear, Facing
from planlang.protocols import Solution

AT_ONCE = 60
"""Places tested for visibility before and between validations."""
MOST_AREAS = 600
"""Number of places to validate."""
LEAST = 0.005
"""Smallest lack of room that is reported [m]."""


Samples = tuple[Array, Array, NDArray[np.intp]]
"""Bases (n, 3), clearance of each (n,) [m], and number of the 30 cm square that contains it (n,)."""


class FloorSearch:
    """Search for base poses from which nothing has to be reached."""

    def __init__(self, validator: BaseValidator, demand: BaseDemand, question: Question) -> None:
        self.validator, self.scene, self.demand, self.question = validator, validator.scene, demand, question
        self.poses = BasePoses(self.scene, question)

    def places(self) -> Iterator[Solution]:
        """Yield base poses: around what the location refers to, then anywhere on the map."""
        samples, log = FloorSamples(self.demand, self.scene), self.question.log
        is_found, looked_at = yield from self._validated(samples.around(), MOST_AREAS)
        if looked_at >= MOST_AREAS:
            return
        counts, blocking = log.counts.copy(), log.blocking.copy()
        known = is_found or bool(blocking)  # rejections near the reference explain a failure best
        yield from self._validated(samples.anywhere(), MOST_AREAS - looked_at, named=known)
        if known:
            log.counts, log.blocking = counts, blocking

    def _validated(
        self, samples: Samples, most: int, *, named: bool = False
    ) -> Generator[Solution, None, tuple[bool, int]]:
        """Yield the valid ones of the samples; at most ``most`` are validated.

        ``named``: the bodies in the way are known. Returns whether any was valid, and how many were validated.
        """
        validator, scene, demand, log = self.validator, self.scene, self.demand, self.question.log
        bases, room, squares = samples
        score = np.ones(len(bases))
        for term in demand.areas:
            score = score * term.score(bases)
            log.refuse(unmet(term), bases[term.score(bases) <= 0])
        for name in demand.seen:
            score = score * sight_score(bases, scene.bodies.block(name), scene.visibility.camera_range())
        roomy = room > 0
        log.refuse(NO_ROOM, bases[~roomy & (score > 0)])
        x, y, _ = scene.base()
        travel = np.hypot(bases[:, 0] - x, bases[:, 1] - y)
        total = score * (0.4 + np.clip(room, 0.0, 0.3)) * np.exp(-travel / TRAVEL)
        crowded = np.flatnonzero(~roomy & (score > 0))
        good = np.flatnonzero(roomy & (score > 0))
        if not named and not len(good):
            self.poses.crowded = list(zip(score[crowded].tolist(), bases[crowded], strict=True))
            self.poses.name_crowding()
            if len(crowded) and (lack := -float(room[crowded].max())) >= LEAST:
                log.figures[NO_ROOM] = f"where it would have most room, the robot needs {lack:.2f} m more on a side"
        log.weigh(bases[good], total[good])
        order = good[np.argsort(-total[good].round(9), kind="stable")]
        is_found, hidden = False, 0
        rows = np.fromiter(islice(_spread(squares[order], order), most), np.intp)
        for row, unseen in zip(rows.tolist(), self._surely_unseen(bases[rows]), strict=True):
            if unseen and (hidden := hidden + 1) > MOST_CROWDED:
                log.add(NOT_VISIBLE)
                continue
            place = bases[row].round(PLACES)
            base = (float(place[0]), float(place[1]), math.remainder(float(place[2]), 2 * math.pi))
            worth = float(total[row])
            if not self.poses.have_way(place[None])[0]:
                continue
            # the field shows room, so visibility fails more often: test it first
            arguments = base, worth, demand, self.question
            if not validator.sees(*arguments) or not validator.stands(*arguments):
                continue
            if (answer := validator.answer(base, worth, {}, demand, self.question)) is not None:
                is_found = True
                yield answer
        if not is_found and len(order) and log.counts[NO_WAY] and NO_WAY not in log.figures:
            narrow = narrow_doorway(scene, bases[order[0], :2])
            if narrow is not None:
                log.figures[NO_WAY] = str(narrow)
        return is_found, len(rows)

    def _surely_unseen(self, bases: Array) -> Iterator[bool]:
        """Yield for bases (n, 3) whether the robot itself, or the room, surely hides what has to be visible."""
        bodies, view = self.scene.bodies, self.scene.visibility.own_view()
        for first in range(0, len(bases), AT_ONCE):
            part = bases[first : first + AT_ONCE]
            unseen = np.zeros(len(part), bool)
            for name in self.validator.to_see(self.demand):
                if view is None:
                    break
                block, solids = bodies.block(name), self.scene.collisions.solids()
                others = solids.only(np.array([body != name for body in solids.bodies], bool))
                unseen |= Unseen(view, block)(part) | view.hidden_by(others, part, block)
            yield from unseen.tolist()


def _spread(squares: NDArray[np.intp], order: NDArray[np.intp]) -> Iterator[int]:
    """Order rows so that the best of each square comes first, then the second best, and so on."""
    rank = np.zeros(len(order), np.intp)
    seen: dict[int, int] = {}
    for index, value in enumerate(squares.tolist()):
        rank[index] = seen.get(value, 0)
        seen[value] = rank[index] + 1
    return iter(order[np.argsort(rank, kind="stable")].tolist())


TOWARDS = (0.0, 0.5, -0.5)
"""Headings relative to facing the reference [rad]."""
AWAY = (math.pi, math.pi / 2, -math.pi / 2)
"""The same if it must not be faced."""
COARSE = 2 * CELL
"""Spacing of the grid [m]; larger cells of the map are subdivided whatever their number."""


MOST_CELLS = 4096
"""Cells tested at once."""
FIRST = 32
"""Initial number of cells along the longer side of the map."""
FINEST = 0.02
"""Side of cells that are not subdivided [m]."""
HEADINGS = 8
"""Number of headings if nothing must or must not be faced."""
MOST_TIGHT = 1000
"""Bases tested exactly where there is no room to turn anywhere."""
FITS = 1e-3
"""Clearance assumed for a robot that fits with its heading [m]."""
SQUARE = 0.3
"""Side of the squares over which places are spread [m]."""


class FloorSamples:
    """Base poses worth validating for demands on the floor."""

    def __init__(self, demand: BaseDemand, scene: PlanningScene) -> None:
        self.demand, self.scene, self.floor = demand, scene, scene.collisions.floor()

    def around(self) -> Samples:
        """Sample bases on a grid around what the location refers to."""
        middle, yaw, radius, looked_at = self._anchor()
        half = math.ceil(radius / COARSE)
        steps = np.arange(-half, half + 1) * COARSE
        along, across = (grid.ravel() for grid in np.meshgrid(steps, steps, indexing="ij"))
        c, s = math.cos(yaw), math.sin(yaw)
        points = np.stack([middle[0] + c * along - s * across, middle[1] + s * along + c * across], axis=1)
        room = self.floor.at(points).round(9)
        squares = np.add.outer(np.arange(2 * half + 1) // 3 * 100_000, np.arange(2 * half + 1) // 3).ravel()
        inside = room > -np.inf
        points, room, squares = points[inside], room[inside], squares[inside]
        bearing = np.arctan2(looked_at[1] - points[:, 1], looked_at[0] - points[:, 0])
        turned = [term.negated for term in self.demand.areas if isinstance(term, Facing)]
        turns = TOWARDS if not turned else AWAY if all(turned) else (0.0,)
        bases = np.concatenate([np.column_stack([points, bearing + turn]) for turn in turns])
        return bases, np.tile(room, len(turns)), np.tile(squares, len(turns))

    def _anchor(self) -> tuple[tuple[float, float], float, float, tuple[float, float]]:
        """Centre, heading and radius [m] of the search, and the point to face, from the most specific demand."""
        anchors: list[tuple[float, tuple[float, float], float]] = []
        for name in self.demand.seen:
            block = self.scene.bodies.block(name)
            anchors.append((min(self.scene.visibility.camera_range()[1], 2.6), (block.x, block.y), block.yaw))
        for term in self.demand.areas:
            if not isinstance(term, (Clear, Facing)) and (circle := term.anchor()) is not None:
                x, y, yaw, radius = circle
                anchors.append((radius, (x, y), yaw))
        facing = next((term.block for term in self.demand.areas if isinstance(term, Facing) and not term.negated), None)
        if anchors:
            radius, middle, yaw = min(anchors, key=lambda item: item[0])
            return middle, yaw, radius, middle if facing is None else (facing.x, facing.y)
        x_min, y_min, x_max, y_max = self.floor.bounds
        middle = ((x_min + x_max) / 2, (y_min + y_max) / 2)
        radius = max(x_max - x_min, y_max - y_min) / 2
        named = facing or next((term.block for term in self.demand.areas if term.block is not None), None)
        return middle, 0.0, min(radius, 10.0), middle if named is None else (named.x, named.y)

    def anywhere(self) -> Samples:
        """Sample bases on the whole map at which all demands on the floor hold."""
        points = self._points()
        headings = self._headings(points)
        bases = np.column_stack([np.repeat(points, headings.shape[1], axis=0), headings.ravel()])
        rows = np.repeat(np.arange(len(points)), headings.shape[1])
        for term in self.demand.areas:
            good = term.score(bases) > 0
            bases, rows = bases[good], rows[good]
        room = self.floor.at(points).round(9)[rows]
        if len(room) and room.max() <= 0:
            tight = np.unique(np.linspace(0, len(room) - 1, min(MOST_TIGHT, len(room))).astype(np.intp))
            room[tight[self.floor.holds(bases[tight])]] = FITS
        x_min, y_min, *_ = self.floor.bounds
        cells = ((bases[:, :2] - (x_min, y_min)) // SQUARE).astype(np.intp)
        return bases, room, cells[:, 0] * (1 << 31) + cells[:, 1]

    def _points(self) -> Array:
        """Find the centres (n, 2) of cells in which the demands may hold."""
        x_min, y_min, x_max, y_max = self.floor.bounds
        side = max(x_max - x_min, y_max - y_min, FINEST) / FIRST
        counts = [max(1, math.ceil(length / side)) for length in (x_max - x_min, y_max - y_min)]
        size = np.array([(x_max - x_min) / counts[0], (y_max - y_min) / counts[1]])
        steps = np.meshgrid(*(np.arange(count) + 0.5 for count in counts), indexing="ij")
        points: Array = np.stack(steps, axis=-1).reshape(-1, 2) * size + (x_min, y_min)
        while True:
            points = points[self._may_hold(points, float(np.hypot(*size)) / 2)]
            crowded = 4 * len(points) > MOST_CELLS
            if size.max() <= FINEST or (crowded and size.max() <= COARSE):
                return points
            if crowded:
                points = points[:: -(-4 * len(points) // MOST_CELLS)]
            size = size / 2
            quarters = np.array([(a, b) for a in (-0.5, 0.5) for b in (-0.5, 0.5)]) * size
            points = np.asarray(points[:, None] + quarters).reshape(-1, 2)

    def _may_hold(self, points: Array, within: float) -> NDArray[np.bool_]:
        """Check whether the demands may hold ``within`` [m] of points (n, 2), judging by distances (n,)."""
        good = np.ones(len(points), bool)
        for term in self.demand.areas:
            if not isinstance(term, Facing):
                good[good] = term.nearly(points[good], within)
        for name in self.demand.seen:
            block = self.scene.bodies.block(name)
            distances = np.hypot(points[:, 0] - block.x, points[:, 1] - block.y)
            good &= distances <= self.scene.visibility.camera_range()[1] + within
        faced = [term for term in self.demand.areas if isinstance(term, Facing) and not term.negated]
        for one, other in itertools.combinations(faced, 2):
            apart = np.abs(np.angle(np.exp(1j * (one.bearing(points) - other.bearing(points)))))
            good &= apart <= 2 * FACING + _swing(one, points, within) + _swing(other, points, within)
        good[good] = self.floor.nearly(points[good], within)
        return good

    def _headings(self, points: Array) -> Array:
        """Sample headings (n, m) at points (n, 2), those towards the reference first.

        They are the centres of the intervals between limits of what is faced; some more directions are limits as well.
        """
        facing = [term for term in self.demand.areas if isinstance(term, Facing)]
        blocks = [*(term.block for term in facing), *(self.scene.bodies.block(name) for name in self.demand.seen)]
        blocks += [term.block for term in self.demand.areas if term.block is not None]
        bearing = np.zeros(len(points))
        if blocks:
            bearing = np.arctan2(blocks[0].y - points[:, 1], blocks[0].x - points[:, 0])
        borders = [bearing + (turn + 0.5) * 2 * math.pi / HEADINGS for turn in range(HEADINGS)]
        borders += [term.bearing(points) + side for term in facing for side in (-FACING - HAIR, FACING + HAIR)]
        ordered = np.sort((np.stack(borders, axis=1) - bearing[:, None]) % (2 * math.pi), axis=1)
        after = np.concatenate([ordered[:, 1:], ordered[:, :1] + 2 * math.pi], axis=1)
        turns = np.mod((ordered + after) / 2 + math.pi, 2 * math.pi) - math.pi
        ahead = np.argsort(np.abs(turns).round(9), axis=1, kind="stable")
        return np.asarray(bearing[:, None] + np.take_along_axis(turns, ahead, axis=1))


def _swing(term: Facing, points: Array, within: float) -> Array:
    """Greatest change of bearings within a distance [m] of points (n, 2), (n,) [rad]."""
    distances = np.hypot(points[:, 0] - term.block.x, points[:, 1] - term.block.y)
    return np.where(distances > within, np.arcsin(np.minimum(within / np.maximum(distances, 1e-9), 1.0)), math.pi)


BEST, WIDTH = 1.2, 0.8
"""Distance from which things are seen best, and width of its decline [m]."""


def sight_score(bases: Array, block: Block, limits: tuple[float, float]) -> Array:
    """Estimate how likely a block is visible from bases (n, 3), (n,) in [0, 1]: by distance, and higher if ahead."""
    dx, dy = block.x - bases[:, 0], block.y - bases[:, 1]
    distances = np.hypot(dx, dy)
    miss = np.abs(np.arctan2(np.sin(bases[:, 2] - np.arctan2(dy, dx)), np.cos(bases[:, 2] - np.arctan2(dy, dx))))
    near, far = limits
    likely = np.exp(-(((distances - BEST) / WIDTH) ** 2)) * np.exp(-((miss / 1.5) ** 2))
    return np.where((distances < far) & (distances > min(near, 0.2)), likely, 0.0)
