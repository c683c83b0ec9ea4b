"""Poses of things at locations: on and in other things and before people, upright, with free room around.

A round thing may be turned as it likes; any other one stands along the edges of what it is on, or else aslant.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from executive.belief.believed_bodies import Block
from executive.belief.planning_scene import PlanningScene
from executive.locations.areas import Area
from executive.locations.demands import ThingDemand
from executive.locations.rejections import Rejections
from executive.motion import clearance_at
from planlang.geometry import Array, Pose
from planlang.records import dataclass

SPACING = 0.04
"""Distance of neighbouring places on a surface [m]."""
COARSE_SPACING, FINE_SPACING = 0.02, 0.005
"""The same where relations to other things leave only a part of the surface [m], to find that and within it."""
MOST_PLACES = 4000
"""Places on one surface: on a large one they are farther apart."""
FREE = 0.005
"""Distance that an object keeps from others [m]."""
RESTING = 0.02
"""Largest distance of an object's lowest point from the surface that it rests on [m]."""
ABOVE_SURFACE = 0.002
"""Height above the surface at which an object is put [m]."""
FLAT = 0.001
"""Height above the surface up to which something may lie under an object [m]: no more than rounding."""
EDGE, EDGE_BESIDE = 0.03, 0.15
"""Distance from the edge of a surface from which a place is as good as can be [m]; where more may come, too."""
SMALL = 0.6
"""Distance from the middle of a surface up to which a place is the better the nearer it is [m]."""
CENTRED = 0.4
"""Share of its worth that a place loses up to there, or as far from the middle as a thing fits on what is small."""
NATURAL = 2
"""Power of the score of an area: well in front of a chair is far better than still so."""
HAIR = 1e-6
"""Length that rounding may add [m]."""
TRAVEL = 4.0
"""Distance of the base over which a place loses most of its worth [m]."""
ROOMY, ROOMY_BESIDE = 0.1, 0.01
"""More room around an object than this is not better [m]; beside something less, as more may come there."""
ACROSS = 0.5
"""Weight of a long thing that points at what it is beside: things lie along each other."""
MOST_CELLS = 24
"""Circles in a row that cover the outline of a long object."""


@dataclass(frozen=True, slots=True)
class Placement:
    """An object, and where a location asks it to be."""

    name: str
    demand: ThingDemand
    scene: PlanningScene
    near: bool = True
    """True if places near to where the base is now are better."""
    oblique: bool = False
    """True if what is not round may also stand at 45 degrees to the edges of what it is on."""

    def spots(self, log: Rejections) -> tuple[Array, Array]:
        """Return places and yaws (n, 4) of the object's box centre, upright, and scores (n,), best first.

        Reasons of others are counted.
        """
        found = [self._free(upright, log) for upright in self._turned()]
        yaws = [np.full((len(places), 1), one.yaw) for one, (places, _) in zip(self._turned(), found, strict=True)]
        spots = np.hstack([np.concatenate([places for places, _ in found]), np.concatenate(yaws)])
        scores = np.concatenate([scores for _, scores in found])
        order = np.argsort(-scores.round(9), kind="stable")
        return spots[order], scores[order]

    def poses(self, log: Rejections) -> Iterator[Pose]:
        """Yield poses of the object's box centre, upright, best first; reasons of others are counted."""
        for x, y, z, yaw in self.spots(log)[0].tolist():
            yield Pose.planar(x, y, yaw, z)

    def _free(self, upright: Block, log: Rejections) -> tuple[Array, Array]:
        """Return places (m, 3) for the object's centre, turned as ``upright``, a prism at the origin, and scores."""
        demand, bodies = self.demand, self.scene.bodies
        before = log.counts.total()
        centres = self._centres(upright, log)
        if not len(centres) and log.counts.total() == before:
            log.add("too small for the object")
        areas = _areas(demand, upright)
        for area in areas:
            wanted = area.score(centres[:, :2]) > 0
            log.refuse(_unmet(area), centres[~wanted])
            centres = centres[wanted]
        for person, inside in demand.people:
            zone = bodies.zone(person)
            keep = np.array([zone.contains(centre) == inside for centre in centres], bool)
            log.refuse(f"{'not ' if inside else ''}in reach of {person}", centres[~keep])
            centres = centres[keep]
        for body, inside in demand.neither:
            there = self._rests(upright, centres, body, inside=inside)
            log.refuse(f"{'in' if inside else 'on'} {body}", centres[there])
            centres = centres[~there]
        if not len(centres):
            return centres, np.zeros(0)
        room = self._room(upright, centres)
        crowded = room < FREE
        log.refuse("no room for the object", centres[crowded])
        for body in self._crowding(centres[crowded]):
            log.blocking[body] += 1
        roomy, border = (ROOMY_BESIDE, EDGE_BESIDE) if any(area.directions for area in areas) else (ROOMY, EDGE)
        score = np.clip(room, 0.0, roomy) / roomy
        if where := demand.on or demand.inside:  # rather not at the very edge
            outer = bodies.block(where)
            spare = -_overhang(upright, centres[:, :2], outer)
            score = score * (0.1 + 0.9 * np.clip(spare, 0.0, border) / border)
            if not areas and not self.near:  # rather in the middle of what is small
                aside = np.hypot(centres[:, 0] - outer.x, centres[:, 1] - outer.y)
                score = score * (1.0 - CENTRED * np.clip(aside / np.clip(aside.max(), HAIR, SMALL), 0.0, 1.0))
        for area in areas:
            score = score * area.score(centres[:, :2]) ** NATURAL * (ACROSS if _points_at(upright, area) else 1.0)
        if self.near:
            x, y, _ = self.scene.base()
            score = score * np.exp(-np.hypot(centres[:, 0] - x, centres[:, 1] - y) / TRAVEL)
        log.weigh(centres[~crowded], score[~crowded])
        return centres[~crowded], score[~crowded]

    def holds(self, pose: Pose) -> bool:
        """Return whether the object, at a pose, is where it is asked to be."""
        demand, block = self.demand, self._block(pose)
        resting = [
            (demand.on, False, True),
            (demand.inside, True, True),
            *((*other, False) for other in demand.neither),
        ]
        for body, inside, wanted in resting:
            if body is not None and self._rests(block, block.centre[None], body, inside=inside)[0] != wanted:
                return False
        if not all(area.holds(pose.position[:2]) for area in _areas(demand, block)):
            return False
        centre, bodies = np.array(pose.position), self.scene.bodies
        return all(bodies.zone(person).contains(centre) == inside for person, inside in demand.people)

    @property
    def _size(self) -> tuple[float, float, float]:
        return self.scene.bodies.size(self.name)

    def _block(self, pose: Pose) -> Block:
        return Block.of(pose, self._size, cylinder=self.scene.bodies.is_round(self.name))

    def _turned(self) -> tuple[Block, ...]:
        """Return the object at the origin, in each of the headings that it may have."""
        where = self.demand.on or self.demand.inside
        yaw = 0.0 if where is None else self.scene.bodies.block(where).yaw
        one = self._block(Pose.planar(0.0, 0.0, yaw))
        alike = abs(one.half_x - one.half_y) < HAIR
        others = () if one.round or where is None else (1, 2, 3) if self.oblique else () if alike else (2,)
        return (one, *(self._block(Pose.planar(0.0, 0.0, yaw + turn * math.pi / 4)) for turn in others))

    def _rests(self, block: Block, centres: Array, body: str, *, inside: bool) -> NDArray[np.bool_]:
        """Return whether a block, centred at places (m, 3), rests on a body, or is ``inside`` it, as a whole (m,)."""
        outer, top = self.scene.bodies.block(body), self.scene.bodies.rests_at(body)
        half = (block.high - block.low) / 2
        low, high = centres[:, 2] - half, centres[:, 2] + half
        if inside:
            level = (low >= outer.low - RESTING) & (high <= outer.high + RESTING)
        else:
            level = np.zeros(len(centres), bool) if top is None else np.abs(low - top) <= RESTING
        if not level.any():
            return level
        return np.asarray(level & (_overhang(block, centres[:, :2], outer) <= HAIR))

    def _centres(self, upright: Block, log: Rejections) -> Array:
        """Return places (m, 3) for the object's centre; those that areas refuse are counted."""
        demand, bodies = self.demand, self.scene.bodies
        where, height = demand.on or demand.inside, upright.high - upright.low
        if where is None:
            zones = [bodies.zone(person).points() for person, inside in demand.people if inside]
            return np.concatenate([np.zeros((0, 3)), *zones])
        if demand.on is None:
            rooms = [
                self._on_floor(upright, room, room.low, log)
                for room in self._rooms(where)
                if height <= room.high - room.low
            ]
            return np.concatenate([np.zeros((0, 3)), *rooms])
        floor = bodies.rests_at(where)
        return np.zeros((0, 3)) if floor is None else self._on_floor(upright, bodies.block(where), floor, log)

    def _rooms(self, where: str) -> list[Block]:
        """Return the rooms inside a body: those over its floor and its shelves if it is hollow, else all of it."""
        bodies = self.scene.bodies
        pose, (x, y, z) = bodies.pose(where), bodies.size(where)
        rooms = []
        for cavity in self.scene.world.scene.body(where).cavities:  # they may go beyond the body where it is open
            ends = [np.array(cavity.centre) + sign * np.array(cavity.size) / 2 for sign in (-1, 1)]
            low, high = np.clip(ends, (-x / 2, -y / 2, -z / 2), (x / 2, y / 2, z / 2))
            if (high > low).all():
                rooms.append(Block.of(pose @ Pose(tuple(((low + high) / 2).tolist())), tuple((high - low).tolist())))
        return rooms or [bodies.block(where)]

    def _on_floor(self, upright: Block, block: Block, floor: float, log: Rejections) -> Array:
        """Return places (m, 3) for the object's centre on a floor at a height, over a block's outline.

        Where areas leave a part of it they are closer to each other.
        """
        demand, height = self.demand, upright.high - upright.low
        half_x = block.half_x - upright.support(block.yaw)
        half_y = block.half_y - upright.support(block.yaw + math.pi / 2)
        if half_x < -HAIR or half_y < -HAIR:
            return np.zeros((0, 3))
        half_x, half_y = max(half_x, 0.0), max(half_y, 0.0)
        spacing = max(COARSE_SPACING if demand.areas else SPACING, 2 * math.sqrt(half_x * half_y / MOST_PLACES))
        axes = [np.linspace(-half, half, 2 * math.ceil(half / spacing) + 1) for half in (half_x, half_y)]
        local = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)
        for area in _areas(demand, upright):
            near = area.nearly(block.to_map(local), spacing)
            log.refuse(_unmet(area), block.to_map(local[~near]))
            local = local[near]
        if demand.areas and len(local):
            count = min(math.isqrt(max(MOST_PLACES // len(local), 1)), math.ceil(spacing / FINE_SPACING))
            shifts = ((np.arange(count) + 0.5) / count - 0.5) * spacing
            between = np.stack(np.meshgrid(shifts, shifts, indexing="ij"), axis=-1).reshape(-1, 2)
            local = (local[:, None] + between).reshape(-1, 2)
            local = local[(np.abs(local) <= np.array([half_x, half_y]) + HAIR).all(axis=1)]
        places = block.to_map(local)
        if block.round:
            places = places[_overhang(upright, places, block) <= HAIR]
        return np.column_stack([places, np.full(len(places), floor + ABOVE_SURFACE + height / 2)])

    def _room(self, upright: Block, centres: Array) -> Array:
        """Return free distance (m,) around the object at places (m, 3), to all but what it is on."""
        boxes, _ = self.scene.collisions.boxes_but((self.name, self.demand.on or ""))
        offsets, radius = _covering(upright)
        room = np.full(len(centres), np.inf)
        for z in np.unique(centres[:, 2]):
            level = centres[:, 2] == z
            band = self._band(float(z), radius)
            spots = (centres[level, None, :2] + offsets).reshape(-1, 2)
            room[level] = clearance_at(spots, boxes, (band,)).reshape(-1, len(offsets)).min(axis=1)
        return room

    def _crowding(self, centres: Array) -> list[str]:
        """Return the bodies that take the room at some of the places."""
        boxes, bodies = self.scene.collisions.boxes_but((self.name, self.demand.on or ""))
        some = centres[:: max(1, len(centres) // 16)]
        found: dict[str, None] = {}
        for z in dict.fromkeys(some[:, 2].tolist()):
            places, band = some[some[:, 2] == z, :2], self._band(z, max(self._size[:2]) / 2)
            for index, body in enumerate(bodies):
                if body not in found and clearance_at(places, boxes.only(index), (band,)).min() < FREE:
                    found[body] = None
        return list(found)

    def _band(self, z: float, radius: float) -> tuple[float, float, float]:
        """Return the room that the object takes with its centre at a height, from just over what it is on."""
        half = self._size[2] / 2
        return z - half - ABOVE_SURFACE + FLAT, z + half, radius


def _areas(demand: ThingDemand, block: Block) -> tuple[Area, ...]:
    """Return the areas for an object turned as a block: on a side of X only its extent towards X counts."""
    return tuple(
        replace(area, radius=block.support(area.directions[0])) if area.directions else area for area in demand.areas
    )


def _unmet(area: Area) -> str:
    """Return what is said of places that an area refuses."""
    return f"not {area.words}".replace("not not ", "")


def _points_at(block: Block, area: Area) -> bool:
    """Return whether a block is longer towards the body that it is on a side of than along that side."""
    if not area.directions or block.round:
        return False
    return block.support(area.directions[0]) > block.support(area.directions[0] + math.pi / 2) + HAIR


def _covering(block: Block) -> tuple[Array, float]:
    """Return centres (n, 2), relative to the middle of a block, and the radius of circles that cover its outline."""
    if block.round:
        return np.zeros((1, 2)), max(block.half_x, block.half_y)
    wide, long = sorted((block.half_x, block.half_y))
    count = min(math.ceil(2 * long / max(wide, 1e-3) - HAIR), MOST_CELLS)
    along = (np.arange(count) + 0.5) * (2 * long / count) - long
    across = np.zeros(count)
    local = np.column_stack([along, across] if block.half_x >= block.half_y else [across, along])
    return block.to_map(local) - [block.x, block.y], math.hypot(wide, long / count)


def _overhang(block: Block, points: Array, outer: Block) -> Array:
    """Return how far a block's footprint, its middle at points (m, 2), is at most beyond another's outline (m,) [m]."""
    if block.round:
        edge, radius = np.zeros((1, 2)), max(block.half_x, block.half_y)
    else:
        signs = np.array([[a, b] for a in (-1, 1) for b in (-1, 1)])
        edge = block.to_map(signs * [block.half_x, block.half_y]) - [block.x, block.y]
        radius = 0.0
    spots = (points[:, None] + edge).reshape(-1, 2)
    if outer.round:
        beyond = np.hypot(spots[:, 0] - outer.x, spots[:, 1] - outer.y) - max(outer.half_x, outer.half_y)
    else:
        beyond = (np.abs(outer.to_local(spots)) - [outer.half_x, outer.half_y]).max(axis=1)
    return np.asarray(beyond.reshape(len(points), -1).max(axis=1) + radius)
