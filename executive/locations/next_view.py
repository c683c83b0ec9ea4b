"""Next best view of a room being explored: the pose that shows most unseen space for the time it takes."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from executive.belief.explored_space import CELL, SURFACE, ExploredSpace
from executive.belief.planning_scene import PlanningScene
from executive.belief.scene_collisions import BasePose
from executive.locations.base_poses import BasePoses
from executive.locations.likely_places import UsualPlaces, points_of
from executive.locations.views import Views
from executive.motion.base_path import cheapest_ways
from planlang.geometry import Array
from planlang.records import dataclass

LOOKING = 8.0
"""Approximate time of the views from one place [s]."""
SPACING = 0.4
"""Spacing of candidate places [m]."""
MOST_POINTS = 500
"""Largest number of frontier cells with which places are compared."""
LEAST = 0.002
"""Smallest gain of a view, as a share of the surface cells: less is not worth the drive."""
ROOM = 0.05
"""Clearance that the robot keeps from what it has seen [m]."""
HEADINGS = 24
"""Number of headings to compare."""
INSIDE = 0.8
"""Share of a picture's smaller half angle within which points count as visible."""
PAUSE = 0.5
"""Head turn that takes as long as a picture [rad]."""
TRIES = 2
"""Pictures that may fail to show a cell before it counts as hidden."""
MOST_DIRECTIONS = 48
"""Approximate number of camera directions to compare."""
RAYS = 5
"""Rays along each side of a picture with which directions are compared."""
NEAR = 0.9
"""Distance from which places are inspected closely [m]."""
PATIENCE = 2
"""Consecutive pictures with hardly any gain after which the robot moves on."""
MOST_GAZES = 16
"""Largest number of pictures from one place."""


@dataclass(frozen=True, slots=True)
class Neck:
    """Directions of the camera: pan to both sides, tilt from lowest to highest [rad]."""

    pan: float
    low: float
    high: float


class Exploration:
    """Explored part of a room, and the next view. ``names`` are the plan's names for the next view, or for the end."""

    def __init__(self, scene: PlanningScene, names: Sequence[str] = ()) -> None:
        self.scene, self.names = scene, tuple(names)
        self.goal: BasePose | None = None
        """Next base pose; None before the robot has looked around, and when nothing new is left."""
        self.finished = False
        if scene.space is None:
            scene.space = ExploredSpace(scene.world.scene.bounds)
        self.space: ExploredSpace = scene.space
        self.origin = scene.base()
        """Initial base pose."""
        self.close: list[str] = []
        """Places inspected closely, in order, or attempted."""
        self._usual, self._views = UsualPlaces(scene.belief.map.ontology), Views(scene)
        self._poses = BasePoses(scene)

    @cached_property
    def neck(self) -> Neck:
        """Limits of the neck, plus the part of a picture beyond them."""
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
        """Angle from the centre of a picture within which points count as visible [rad]."""
        camera = self.scene.robot.camera
        return 0.0 if camera is None else INSIDE * math.atan(math.tan(camera.fov / 2) * camera.height / camera.width)

    @property
    def eye(self) -> Array:
        """Position of the camera, (3,)."""
        camera = self.scene.robot.camera
        return np.array((0.0, 0.0, 0.0) if camera is None else self.scene.world.link_pose(camera.link).position)

    @property
    def extent(self) -> tuple[float, float]:
        """Height of the robot in its posture, and the radius of its base with clearance [m]."""
        return max(high for _, high, _ in self.scene.world.silhouette()), self.scene.robot.base.radius + ROOM

    # Views from the present place

    def gazes(self) -> Iterator[Array]:
        """Yield points (3,) to look at from here until nothing new is visible; pictures are processed in between.

        Cells that a picture should have shown but did not are not tried again from here, and from few other places.
        """
        self.space.free_disc(self.scene.base(), self.extent[1] + 2 * CELL)
        yield from self._close_gazes()
        ahead = np.array([math.cos(self.scene.base()[2]), math.sin(self.scene.base()[2]), 0.0])
        unseen, poor_views = self._visible(self.space.frontier(TRIES)), 0
        for _ in range(MOST_GAZES):
            if len(unseen) < max(4.0, self._least() / 4) or poor_views == PATIENCE:
                break
            eye, before = self.eye, self._surfaces()
            point = self._best_gaze(eye, unseen, ahead)
            ahead = (point - eye) / np.linalg.norm(point - eye)
            yield point
            shown = unseen[self._directions(eye, unseen) @ ahead >= math.cos(self.cone)]
            self.space.give_up(shown)
            poor_views = poor_views + 1 if self._surfaces() - before < self._least() / 2 else 0
            unseen = self._visible(self.space.frontier(TRIES))
            unseen = unseen[~self.space.among(unseen, shown)]
        self.space.give_up(unseen)

    def _visible(self, points: Array) -> Array:
        """Select the points (n, 3) that can be looked at from here."""
        return np.asarray(points[self._seen(self.eye[None], np.array([self.scene.base()]), points)[0]])

    def _directions(self, eye: Array, points: Array) -> Array:
        arrows = points - eye
        return np.asarray(arrows / np.maximum(np.linalg.norm(arrows, axis=1), 1e-9)[:, None])

    def _best_gaze(self, eye: Array, points: Array, ahead: Array) -> Array:
        """Select the point (3,) whose picture shows most unknown space, with a preference for small head turns."""
        candidates = points[:: max(1, len(points) // MOST_DIRECTIONS)]
        arrows = self._directions(eye, candidates)
        across = np.cross(arrows, [0.0, 0.0, 1.0])
        across /= np.maximum(np.linalg.norm(across, axis=1), 1e-9)[:, None]
        camera = self.scene.robot.camera
        wide = 0.0 if camera is None else math.tan(camera.fov / 2)
        shares = np.linspace(-0.8, 0.8, RAYS)
        sides, heights = (one.ravel() for one in np.meshgrid(shares * wide, shares * math.tan(self.cone / INSIDE)))
        rays = arrows[:, None] + sides[:, None] * across[:, None] + heights[:, None] * np.cross(across, arrows)[:, None]
        gain = self.space.unknown(eye, rays, 0.0 if camera is None else camera.far).sum(axis=1)
        turn = np.arccos(np.clip(arrows @ ahead, -1.0, 1.0))
        return np.asarray(candidates[int(np.argmax(((1 + gain) / (PAUSE + turn)).round(9)))])

    def _surfaces(self) -> int:
        return int((self.space.cells == SURFACE).sum())

    def _least(self) -> float:
        return LEAST * self._surfaces()

    # Views from other places

    def plan(self) -> None:
        """Select the next view; if nothing new is left, inspect usual places of things closely, then finish."""
        self.goal = self._next() or self._next_to_a_place()
        self.finished = self.goal is None

    def missed(self) -> None:
        """Replace a view to which the robot could not drive."""
        if self.goal is not None:
            eye, points = np.array([[*self.goal[:2], self.eye[2]]]), self.space.frontier(TRIES)
            for _ in range(TRIES):
                self.space.give_up(points[self._seen(eye, None, points)[0]])
        self.plan()

    def _next_to_a_place(self) -> BasePose | None:
        """Find the pose for a close inspection of the next usual place of things; None after the last.

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
        """List usual places of things not inspected closely yet, the nearest first."""
        bodies = self.scene.bodies
        seconds_to: dict[str, float] = {}
        for thing in self.scene.belief.map.objects:
            name = thing.name
            if name in self.close or name not in self.scene.belief.names() or name not in self.scene.world.names():
                continue
            if thing.size is None or bodies.is_room(name) or bodies.is_graspable(name):
                continue
            if self._usual.is_usual((thing.iri, *thing.types)):
                gaps = bodies.block(name).distance(places)
                seconds_to[name] = float((gaps / self.scene.robot.base.speed + seconds).min(initial=math.inf))
        return sorted(seconds_to, key=lambda name: seconds_to[name])

    def _close_gazes(self) -> Iterator[Array]:
        """Yield points (3,) of the place that the robot has approached."""
        if self.goal is not None and self.close and self.close[-1] in self.scene.belief.names():
            base, points = self.scene.base(), points_of(self.scene.bodies.block(self.close[-1]))
            yield from self._views.gazes(base, points[self._views.seen(np.array([base]), points)[0]])

    def _next(self) -> BasePose | None:
        points = self.space.frontier(TRIES)
        stride = max(1, len(points) // MOST_POINTS)
        sample = points[::stride]
        places, seconds = self._places()
        if not len(sample) or not len(places):
            return None
        eyes = np.column_stack([places, np.full(len(places), self.eye[2])])
        shown = self._seen(eyes, None, sample)
        order = np.argsort(-(shown.sum(axis=1) / (seconds + LOOKING)).round(9), kind="stable")
        best: tuple[float, BasePose] | None = None
        for row in order.tolist():
            gain, yaw = self._heading(eyes[row], sample[shown[row]])
            worth = gain * stride / (seconds[row] + LOOKING)
            if best is not None and shown[row].sum() * stride / (seconds[row] + LOOKING) <= best[0]:
                break
            base = (float(places[row, 0]), float(places[row, 1]), yaw)
            is_better = gain * stride >= self._least() and (best is None or worth > best[0])
            if is_better and self._poses.has_room(base):
                best = worth, base
        return None if best is None else best[1]

    def _heading(self, eye: Array, points: Array) -> tuple[int, float]:
        """Find the base heading with which the neck can turn to most points (n, 3): their number, and it [rad]."""
        azimuth = np.arctan2(points[:, 1] - eye[1], points[:, 0] - eye[0])
        yaws = np.linspace(-math.pi, math.pi, HEADINGS, endpoint=False)
        angles = np.abs(np.remainder(azimuth[None] - yaws[:, None] + math.pi, 2 * math.pi) - math.pi)
        counts = (angles <= self.neck.pan).sum(axis=1)
        middle = np.where(angles <= self.neck.pan, angles, 0.0).sum(axis=1)
        best = int(np.lexsort((middle, -counts))[0])
        return int(counts[best]), float(yaws[best])

    def _places(self) -> tuple[Array, Array]:
        """List places (n, 2) of the base connected by seen floor, and the times to drive there (n,) [s]."""
        free, base = self.space.standable(*self.extent), self.scene.base()
        start = self.space.index(np.array([[*base[:2], 0.0]]))[0][0]
        costs, first = np.where(free, 1.0, np.inf), (int(start[0]), int(start[1]))
        costs[first] = 1.0  # the robot may leave where it stands
        seconds = cheapest_ways(costs, first).field() * CELL / self.scene.robot.base.speed
        every = max(1, round(SPACING / CELL))
        chosen = np.zeros_like(free)
        chosen[::every, ::every] = True
        cells = np.argwhere(chosen & np.isfinite(seconds))
        places = self.space.centres(np.column_stack([cells, np.zeros(len(cells), int)]))[:, :2]
        room = self.scene.collisions.floor().at(places) > 0.0
        here = np.array([base[:2]])  # turning on the spot is always possible
        return np.vstack([here, places[room]]), np.concatenate([[0.0], seconds[tuple(cells.T)][room]])

    def _seen(self, eyes: Array, bases: Array | None, points: Array) -> NDArray[np.bool_]:
        """Check which points (m, 3) are visible from eyes (n, 3), through seen space only, (n, m).

        With ``bases`` (n, 3) the base keeps its heading; else it may turn.
        """
        camera = self.scene.robot.camera
        shown = np.zeros((len(eyes), len(points)), bool)
        if camera is None or not len(points):
            return shown
        arrows = points[None] - eyes[:, None]
        distances = np.linalg.norm(arrows, axis=2)
        tilt = np.arctan2(arrows[..., 2], np.hypot(arrows[..., 0], arrows[..., 1]))
        fits = (distances <= camera.far) & (tilt >= self.neck.low) & (tilt <= self.neck.high)
        if bases is not None:
            turn = np.arctan2(arrows[..., 1], arrows[..., 0]) - bases[:, 2:]
            fits &= np.abs(np.remainder(turn + math.pi, 2 * math.pi) - math.pi) <= self.neck.pan
        rows, columns = np.nonzero(fits)
        shown[rows, columns] = self.space.clear(eyes[rows], points[columns])
        return shown
