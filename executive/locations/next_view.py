"""The next best view of a room that is explored: from where most of what is still unseen is seen, and soon."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from functools import cached_property
from heapq import heappop, heappush

import numpy as np
from numpy.typing import NDArray

from executive.belief.explored_space import CELL, SURFACE, ExploredSpace
from executive.belief.planning_scene import PlanningScene
from executive.belief.scene_collisions import BasePose
from executive.locations.base_poses import BasePoses
from executive.locations.likely_places import UsualPlaces, points_of
from executive.locations.views import Views
from planlang.geometry import Array
from planlang.records import dataclass

LOOKING = 8.0
"""Time that the views from one place take, roughly [s]."""
SPACING = 0.4
"""Distance of places that are compared [m]."""
MOST_POINTS = 500
"""Cells beside seen space by which places are compared, at most."""
LEAST = 0.002
"""The least share of the cells with a surface that a view has to show anew: less is not worth the way."""
ROOM = 0.05
"""Room that the robot keeps to what it has seen [m]."""
HEADINGS = 24
"""Headings that are compared."""
INSIDE = 0.8
"""Share of the lower half angle of a picture within which points count as shown."""
PAUSE = 0.5
"""Turn of the head that takes as long as a picture beside the way to it [rad]."""
TRIES = 2
"""Pictures that may fail to show a cell before it counts as hidden."""
MOST_DIRECTIONS = 48
"""Directions of the camera that are compared, about."""
RAYS = 5
"""Rays along each side of a picture by which directions are compared."""
NEAR = 0.9
"""Distance from which places are looked at from near [m]."""
PATIENCE = 2
"""Pictures in a row that show hardly anything new, after which the robot goes on."""
MOST_GAZES = 16
"""Pictures that are taken from one place at most."""


@dataclass(frozen=True, slots=True)
class Neck:
    """The directions in which the camera can be turned: pan to both sides, tilt from lowest to highest [rad]."""

    pan: float
    low: float
    high: float


class Exploration:
    """The explored part of a room, and where to go on. ``names`` are what the plan calls the next view, or the end."""

    def __init__(self, scene: PlanningScene, names: Sequence[str] = ()) -> None:
        self.scene, self.names = scene, tuple(names)
        self.goal: BasePose | None = None
        """The place that the robot goes to next; None before it has looked around, and when nothing is new."""
        self.finished = False
        if scene.space is None:
            scene.space = ExploredSpace(scene.world.scene.bounds)
        self.space: ExploredSpace = scene.space
        self.origin = scene.base()
        """Pose of the base at the beginning."""
        self.close: list[str] = []
        """Places at which the robot has looked from near, the last one last, or could not."""
        self._usual, self._views = UsualPlaces(scene.belief.map.ontology), Views(scene)
        self._poses = BasePoses(scene)

    @cached_property
    def neck(self) -> Neck:
        """The limits of the neck, with what of a picture may lie beyond them."""
        camera, gaze = self.scene.robot.camera, self.scene.visibility.gaze
        if camera is None or gaze is None:
            return Neck(0.0, 0.0, 0.0)
        eye = gaze.at_all(np.array([[2.0, 0.0, 1.0]]))[1][0]
        angles = np.linspace(0.0, math.pi, 61)
        flat = eye + 2.0 * np.stack([np.cos(angles), np.sin(angles), np.zeros(61)], axis=1)
        upright = np.linspace(-1.4, 1.4, 57)
        tall = eye + 2.0 * np.stack([np.cos(upright), np.zeros(57), np.sin(upright)], axis=1)
        pans = angles[gaze.at_all(flat)[0] <= self.cone]
        tilts = upright[gaze.at_all(tall)[0] <= self.cone]
        low, high = (float(tilts.min()), float(tilts.max())) if len(tilts) else (0.0, 0.0)
        return Neck(float(pans.max(initial=0.0)), low, high)

    @property
    def cone(self) -> float:
        """Angle from the middle of a picture within which points count as shown [rad]."""
        camera = self.scene.robot.camera
        return 0.0 if camera is None else INSIDE * math.atan(math.tan(camera.fov / 2) * camera.height / camera.width)

    @property
    def eye(self) -> Array:
        """Return the place of the camera, (3,)."""
        camera = self.scene.robot.camera
        return np.array((0.0, 0.0, 0.0) if camera is None else self.scene.world.link_pose(camera.link).position)

    @property
    def extent(self) -> tuple[float, float]:
        """Height of the robot in its posture, and the radius of its base with room around it [m]."""
        return max(high for _, high, _ in self.scene.collisions.silhouette()), self.scene.robot.base.radius + ROOM

    # Here

    def gazes(self) -> Iterator[Array]:
        """Yield points (3,) to look at from here until nothing new is to be seen; pictures are learnt in between.

        What a picture should have shown, and did not, is not looked at again from here, and from few other places.
        """
        self.space.free_disc(self.scene.base(), self.extent[1] + 2 * CELL)
        yield from self._close_gazes()
        ahead = np.array([math.cos(self.scene.base()[2]), math.sin(self.scene.base()[2]), 0.0])
        left, poor = self._visible(self.space.frontier(TRIES)), 0
        for _ in range(MOST_GAZES):
            if len(left) < max(4.0, self._least() / 4) or poor == PATIENCE:
                break
            eye, before = self.eye, self._surfaces()
            point = self._best_gaze(eye, left, ahead)
            ahead = (point - eye) / np.linalg.norm(point - eye)
            yield point
            shown = left[self._directions(eye, left) @ ahead >= math.cos(self.cone)]
            self.space.give_up(shown)
            poor = poor + 1 if self._surfaces() - before < self._least() / 2 else 0
            left = self._visible(self.space.frontier(TRIES))
            left = left[~self.space.among(left, shown)]
        self.space.give_up(left)

    def _visible(self, points: Array) -> Array:
        """Return those of points (n, 3) that can be looked at from here."""
        return np.asarray(points[self._seen(self.eye[None], np.array([self.scene.base()]), points)[0]])

    def _directions(self, eye: Array, points: Array) -> Array:
        arrows = points - eye
        return np.asarray(arrows / np.maximum(np.linalg.norm(arrows, axis=1), 1e-9)[:, None])

    def _best_gaze(self, eye: Array, points: Array, ahead: Array) -> Array:
        """Return the point (3,) in a picture of which most is unknown, the less the head turns to it the better."""
        some = points[:: max(1, len(points) // MOST_DIRECTIONS)]
        arrows = self._directions(eye, some)
        across = np.cross(arrows, [0.0, 0.0, 1.0])
        across /= np.maximum(np.linalg.norm(across, axis=1), 1e-9)[:, None]
        camera = self.scene.robot.camera
        wide = 0.0 if camera is None else math.tan(camera.fov / 2)
        shares = np.linspace(-0.8, 0.8, RAYS)
        sides, heights = (one.ravel() for one in np.meshgrid(shares * wide, shares * math.tan(self.cone / INSIDE)))
        rays = arrows[:, None] + sides[:, None] * across[:, None] + heights[:, None] * np.cross(across, arrows)[:, None]
        gain = self.space.unknown(eye, rays, 0.0 if camera is None else camera.far).sum(axis=1)
        turn = np.arccos(np.clip(arrows @ ahead, -1.0, 1.0))
        return np.asarray(some[int(np.argmax(((1 + gain) / (PAUSE + turn)).round(9)))])

    def _surfaces(self) -> int:
        return int((self.space.cells == SURFACE).sum())

    def _least(self) -> float:
        return LEAST * self._surfaces()

    # Elsewhere

    def plan(self) -> None:
        """Choose the next view; when nothing new is to be seen, look at each place of things from near, then end."""
        self.goal = self._next() or self._next_to_a_place()
        self.finished = self.goal is None

    def missed(self) -> None:
        """Choose another view than the last one, to which the robot could not drive."""
        if self.goal is not None:
            eye, points = np.array([[*self.goal[:2], self.eye[2]]]), self.space.frontier(TRIES)
            for _ in range(TRIES):
                self.space.give_up(points[self._seen(eye, None, points)[0]])
        self.plan()

    def _next_to_a_place(self) -> BasePose | None:
        """Return from where most of a place where things usually are is seen from near; None if all were looked at.

        Small things have too few pixels to be recognised from afar.
        """
        places, seconds = self._places()
        for name in self._unvisited(places, seconds):
            self.close.append(name)
            block = self.scene.bodies.block(name)
            near = np.flatnonzero(block.distance(places) <= NEAR)
            headings = np.arctan2(block.y - places[near, 1], block.x - places[near, 0])
            bases = np.column_stack([places[near], headings])
            counts = self._views.seen(bases, points_of(block)).sum(axis=1)
            for row in np.argsort(-counts, kind="stable").tolist():
                base = (float(bases[row, 0]), float(bases[row, 1]), float(bases[row, 2]))
                if counts[row] > 0 and self._poses.has_room(base):
                    return base
        return None

    def _unvisited(self, places: Array, seconds: Array) -> list[str]:
        """Return places where things usually are at which was not looked from near, the nearest first."""
        bodies = self.scene.bodies
        away: dict[str, float] = {}
        for thing in self.scene.belief.map.objects:
            name = thing.name
            if name in self.close or name not in self.scene.belief.names() or name not in self.scene.world.names():
                continue
            if thing.size is None or bodies.is_room(name) or bodies.is_graspable(name):
                continue
            if self._usual.is_usual((thing.iri, *thing.types)):
                gaps = bodies.block(name).distance(places)
                away[name] = float((gaps / self.scene.robot.base.speed + seconds).min(initial=math.inf))
        return sorted(away, key=lambda name: away[name])

    def _close_gazes(self) -> Iterator[Array]:
        """Yield points (3,) of the place that the robot has come near to."""
        if self.goal is not None and self.close and self.close[-1] in self.scene.belief.names():
            base, points = self.scene.base(), points_of(self.scene.bodies.block(self.close[-1]))
            yield from self._views.gazes(base, points[self._views.seen(np.array([base]), points)[0]])

    def _next(self) -> BasePose | None:
        points = self.space.frontier(TRIES)
        stride = max(1, len(points) // MOST_POINTS)
        some = points[::stride]
        places, seconds = self._places()
        if not len(some) or not len(places):
            return None
        eyes = np.column_stack([places, np.full(len(places), self.eye[2])])
        shown = self._seen(eyes, None, some)
        order = np.argsort(-(shown.sum(axis=1) / (seconds + LOOKING)).round(9), kind="stable")
        best: tuple[float, BasePose] | None = None
        for row in order.tolist():
            gain, yaw = self._heading(eyes[row], some[shown[row]])
            worth = gain * stride / (seconds[row] + LOOKING)
            if best is not None and shown[row].sum() * stride / (seconds[row] + LOOKING) <= best[0]:
                break
            base = (float(places[row, 0]), float(places[row, 1]), yaw)
            is_better = gain * stride >= self._least() and (best is None or worth > best[0])
            if is_better and self._poses.has_room(base):
                best = worth, base
        return None if best is None else best[1]

    def _heading(self, eye: Array, points: Array) -> tuple[int, float]:
        """Return how many points (n, 3) the neck can turn to with the best heading of the base, and that [rad]."""
        azimuth = np.arctan2(points[:, 1] - eye[1], points[:, 0] - eye[0])
        yaws = np.linspace(-math.pi, math.pi, HEADINGS, endpoint=False)
        away = np.abs(np.remainder(azimuth[None] - yaws[:, None] + math.pi, 2 * math.pi) - math.pi)
        counts = (away <= self.neck.pan).sum(axis=1)
        middle = np.where(away <= self.neck.pan, away, 0.0).sum(axis=1)
        best = int(np.lexsort((middle, -counts))[0])
        return int(counts[best]), float(yaws[best])

    def _places(self) -> tuple[Array, Array]:
        """Return places (n, 2) of the base that seen floor leads to, and the times to drive there (n,) [s]."""
        free, base = self.space.standable(*self.extent), self.scene.base()
        start = self.space.index(np.array([[*base[:2], 0.0]]))[0][0]
        seconds = _distances(free, (int(start[0]), int(start[1]))) * CELL / self.scene.robot.base.speed
        every = max(1, round(SPACING / CELL))
        chosen = np.zeros_like(free)
        chosen[::every, ::every] = True
        cells = np.argwhere(chosen & np.isfinite(seconds))
        places = self.space.centres(np.column_stack([cells, np.zeros(len(cells), int)]))[:, :2]
        room = self.scene.collisions.floor().at(places) > 0.0
        here = np.array([base[:2]])  # it may turn, at least
        return np.vstack([here, places[room]]), np.concatenate([[0.0], seconds[tuple(cells.T)][room]])

    def _seen(self, eyes: Array, bases: Array | None, points: Array) -> NDArray[np.bool_]:
        """Return which points (m, 3) are to be seen from eyes (n, 3), through seen space alone, (n, m).

        With ``bases`` (n, 3) the base keeps its heading; else it may turn.
        """
        camera = self.scene.robot.camera
        shown = np.zeros((len(eyes), len(points)), bool)
        if camera is None or not len(points):
            return shown
        arrows = points[None] - eyes[:, None]
        away = np.linalg.norm(arrows, axis=2)
        tilt = np.arctan2(arrows[..., 2], np.hypot(arrows[..., 0], arrows[..., 1]))
        fits = (away <= camera.far) & (tilt >= self.neck.low) & (tilt <= self.neck.high)
        if bases is not None:
            turn = np.arctan2(arrows[..., 1], arrows[..., 0]) - bases[:, 2:]
            fits &= np.abs(np.remainder(turn + math.pi, 2 * math.pi) - math.pi) <= self.neck.pan
        rows, columns = np.nonzero(fits)
        shown[rows, columns] = self.space.clear(eyes[rows], points[columns])
        return shown


def _distances(free: NDArray[np.bool_], start: tuple[int, int]) -> Array:
    """Return lengths of ways over free cells (nx, ny) from one of them, in cells; inf where none leads."""
    found = np.full(free.shape, np.inf)
    found[start] = 0.0
    queue = [(0.0, *start)]
    while queue:
        away, i, j = heappop(queue)
        if away > found[i, j]:
            continue
        for di, dj in ((1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (1, -1), (-1, 1), (-1, -1)):
            k, n = i + di, j + dj
            if 0 <= k < free.shape[0] and 0 <= n < free.shape[1] and free[k, n]:
                there = away + math.hypot(di, dj)
                if there < found[k, n]:
                    found[k, n] = there
                    heappush(queue, (there, k, n))
    return found
