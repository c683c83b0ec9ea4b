"""Poses of things at locations: upright or as they lay, on or in other things, or in front of people, with clearance.

A round thing may have any yaw; others are aligned with the edges of their support, or else at 45 degrees to them.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from executive.belief.planning_scene import PlanningScene
from executive.locations.demands import ThingDemand
from executive.locations.dropping import insides, open_above
from executive.locations.leaf_ways import ways_of
from executive.locations.rejections import Rejections, unmet
from executive.motion import clearance_at
from executive.motion.clearance import Boxes
from planlang.geometry import Array, Pose
from planlang.geometry.areas import Block, Region
from planlang.records import dataclass

SPACING = 0.04
"""Spacing of places on a surface [m]."""
COARSE_SPACING, FINE_SPACING = 0.02, 0.005
"""The same if relations to other things restrict the surface [m]: to find the allowed part, and within it."""
MOST_PLACES = 4000
"""Largest number of places on one surface; large surfaces get a wider spacing."""
FREE = 0.005
"""Clearance of an object from others [m]."""
RESTING = 0.02
"""Largest distance of an object's lowest point from the surface that supports it [m]."""
ABOVE_SURFACE = 0.002
"""Height above the surface at which an object is released [m]."""
FLAT = 0.001
"""Height above the surface up to which bodies below an object are ignored [m], for rounding."""
EDGE, EDGE_BESIDE = 0.03, 0.15
"""Distance from the edge of a surface beyond which a place gets no better [m]; larger if more things may follow."""
SMALL = 0.6
"""Distance from the centre of a surface up to which closer places are better [m]."""
CENTRED = 0.4
"""Share of its score that a place loses up to that distance, or up to the farthest place on a small surface."""
NATURAL = 2
"""Power of the score of an area: well in front of a chair is far better than just in front."""
HAIR = 1e-6
"""Rounding tolerance of lengths [m]."""
TRAVEL = 4.0
"""Distance of the base over which a place loses most of its score [m]."""
ROOMY, ROOMY_BESIDE = 0.1, 0.01
"""Clearance beyond which a place gets no better [m]; smaller beside something, where more things may follow."""
LAID = math.cos(math.radians(20.0))
"""Least cosine between the vertical and an axis of a thing that lies on a side."""
UPRIGHT = Pose((0.0, 0.0, 0.0))
"""Attitude of a thing that stands."""
ACROSS = 0.5
"""Weight of a long thing that points at what it is beside, as things lie parallel to each other."""
IN_THE_WAY = "in the way of a door or drawer"
"""Reason to reject a place where the object would keep one shut, or from being closed, that a later step moves."""
MOST_CELLS = 24
"""Largest number of circles in a row that cover the outline of a long object."""


@dataclass(frozen=True, slots=True)
class Placement:
    """An object, and the location required for it."""

    name: str
    demand: ThingDemand
    scene: PlanningScene
    near: bool = True
    """True if places near the base's present pose are better."""
    oblique: bool = False
    """True if things that are not round may also stand at 45 degrees to the edges of their support."""
    attitude: Pose = UPRIGHT
    """Rotation of the object at yaw 0, among :func:`attitudes`; it stands upright by default."""
    above_rim: float | None = None
    """Height of its lowest point above the rim of what it is dropped into [m]; None if it is put down.

    The places are then those where it is let go."""

    def spots(self, log: Rejections) -> tuple[Array, Array]:
        """Find places and yaws (n, 4) of the object's box centre, in its attitude, and scores (n,), best first.

        Rejected ones are counted.
        """
        by_heading = [self._free(upright, log) for upright in self._turned()]
        yaws = [np.full((len(places), 1), one.yaw) for one, (places, _) in zip(self._turned(), by_heading, strict=True)]
        spots = np.hstack([np.concatenate([places for places, _ in by_heading]), np.concatenate(yaws)])
        scores = np.concatenate([scores for _, scores in by_heading])
        order = np.argsort(-scores.round(9), kind="stable")
        return spots[order], scores[order]

    def poses(self, log: Rejections) -> Iterator[Pose]:
        """Yield poses of the object's box centre, in its attitude, best first; rejected ones are counted."""
        for x, y, z, yaw in self.spots(log)[0].tolist():
            yield Pose.planar(x, y, yaw, z) @ self.attitude

    def _free(self, upright: Block, log: Rejections) -> tuple[Array, Array]:
        """Find places (m, 3) for the object's centre, turned as ``upright``, a prism at the origin, and scores."""
        demand, bodies = self.demand, self.scene.bodies
        before = log.counts.total()
        centres = self._centres(upright, log)
        if not len(centres) and log.counts.total() == before:
            log.add("too small for the object")
        areas = [area.of_thing(upright) for area in demand.areas]
        for area in areas:
            in_area = area.score(centres[:, :2]) > 0
            log.refuse(unmet(area), centres[~in_area])
            centres = centres[in_area]
        for person, inside in demand.people:
            zone = bodies.zone(person)
            keep = np.array([zone.contains(centre) == inside for centre in centres], bool)
            log.refuse(f"{'not ' if inside else ''}in reach of {person}", centres[~keep])
            centres = centres[keep]
        for body, inside in demand.neither:
            rests = self._rests(upright, centres, body, inside=inside)
            log.refuse(f"{'in' if inside else 'on'} {body}", centres[rests])
            centres = centres[~rests]
        if not len(centres):
            return centres, np.zeros(0)
        in_the_way = self._room(upright, centres, ways_of(demand, self.scene)) < FREE
        log.refuse(IN_THE_WAY, centres[in_the_way])
        centres = centres[~in_the_way]
        if not len(centres):
            return centres, np.zeros(0)
        room = self._room(upright, centres, self._others())
        crowded = room < FREE
        if self.above_rim is not None:  # better where it falls to the bottom, and not onto other things
            clear = self._room(upright, centres, self._others(), self._fall())
            room = np.minimum(room, np.maximum(clear, FREE))
        log.refuse("no room for the object", centres[crowded])
        for body in self._crowding(upright, centres[crowded]):
            log.blocking[body] += 1
        roomy, border = (ROOMY_BESIDE, EDGE_BESIDE) if any(area.directions for area in areas) else (ROOMY, EDGE)
        score = np.clip(room, 0.0, roomy) / roomy
        if where := demand.on or demand.inside:  # prefer places away from the edge
            outer = bodies.block(where)
            spare = -_overhang(upright, centres[:, :2], outer)
            score = score * (0.1 + 0.9 * np.clip(spare, 0.0, border) / border)
            if not areas and not self.near:  # prefer the centre of small surfaces
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
        """Check whether the object would be at the required location with a pose."""
        demand, block = self.demand, self.block(pose)
        resting = [
            (demand.on, False, True),
            (demand.inside, True, True),
            *((*other, False) for other in demand.neither),
        ]
        for body, inside, wanted in resting:
            if body is not None and self._rests(block, block.centre[None], body, inside=inside)[0] != wanted:
                return False
        if not all(area.of_thing(block).score(np.array([pose.position[:2]]))[0] > 0 for area in demand.areas):
            return False
        centre, bodies = np.array(pose.position), self.scene.bodies
        return all(bodies.zone(person).contains(centre) == inside for person, inside in demand.people)

    @property
    def _size(self) -> tuple[float, float, float]:
        return self.scene.bodies.size(self.name)

    def block(self, pose: Pose) -> Block:
        """Fit the object's prism at a pose."""
        return Block.of(pose, self._size, cylinder=self.scene.bodies.is_round(self.name))

    def _turned(self) -> tuple[Block, ...]:
        """Create the object at the origin, in each of its allowed headings."""
        where = self.demand.on or self.demand.inside
        yaw = 0.0 if where is None else self.scene.bodies.block(where).yaw
        one = self.block(Pose.planar(0.0, 0.0, yaw) @ self.attitude)
        is_square = abs(one.half_x - one.half_y) < HAIR
        others = () if one.round or where is None else (1, 2, 3) if self.oblique else () if is_square else (2,)
        turned = (Pose.planar(0.0, 0.0, yaw + turn * math.pi / 4) @ self.attitude for turn in others)
        return (one, *map(self.block, turned))

    def _rests(self, block: Block, centres: Array, body: str, *, inside: bool) -> NDArray[np.bool_]:
        """Check whether a block, centred at places (m, 3), rests on a body, or is ``inside`` it, completely (m,)."""
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
        """Sample places (m, 3) for the object's centre; those that areas reject are counted."""
        demand, bodies = self.demand, self.scene.bodies
        where, height = demand.on or demand.inside, upright.high - upright.low
        if where is None:
            zones = [bodies.zone(person).points() for person, inside in demand.people if inside]
            return np.concatenate([np.zeros((0, 3)), *zones])
        if demand.on is None:
            inner = insides(where, self.scene) or [bodies.block(where)]
            if self.above_rim is not None:
                inner = open_above(where, self.scene)
            rooms = [
                self._on_floor(upright, room, self._released_at(room), log)
                for room in inner
                if height <= room.high - room.low
            ]
            return np.concatenate([np.zeros((0, 3)), *rooms])
        floor = bodies.rests_at(where)
        return np.zeros((0, 3)) if floor is None else self._on_floor(upright, bodies.block(where), floor, log)

    def _released_at(self, room: Block) -> float:
        """Height of the floor of a space inside a body [m], or of what would be one where the object is let go."""
        return room.low if self.above_rim is None else room.high + self.above_rim

    def _on_floor(self, upright: Block, block: Block, floor: float, log: Rejections) -> Array:
        """Sample places (m, 3) for the object's centre on a floor at a height, over a block's outline.

        Denser if areas leave only a part of it.
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
        for area in (one.of_thing(upright) for one in demand.areas):
            near = area.nearly(block.to_map(local), spacing)
            log.refuse(unmet(area), block.to_map(local[~near]))
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

    def _others(self) -> Boxes:
        """Collect the boxes of everything but the object and its support."""
        return self.scene.collisions.boxes_but((self.name, self.demand.on or ""))[0]

    def _fall(self) -> float:
        """Compute how far the object falls to the highest floor that it is dropped on [m]."""
        assert self.demand.inside is not None
        assert self.above_rim is not None
        depth = min(room.high - room.low for room in open_above(self.demand.inside, self.scene))
        return self.above_rim + depth

    def _below(self, upright: Block) -> float:
        """Compute how far below the object there has to be room, too [m]: one that is dropped gets below the rim."""
        return 0.0 if self.above_rim is None else self.above_rim + upright.high - upright.low

    def _room(self, upright: Block, centres: Array, boxes: Boxes, below: float | None = None) -> Array:
        """Compute the clearance (m,) around the object at places (m, 3), and as far ``below``, from boxes."""
        below = self._below(upright) if below is None else below
        offsets, radius = _covering(upright)
        room = np.full(len(centres), np.inf)
        for z in np.unique(centres[:, 2]):
            level = centres[:, 2] == z
            band = _band(upright, float(z), radius, below)
            spots = (centres[level, None, :2] + offsets).reshape(-1, 2)
            room[level] = clearance_at(spots, boxes, (band,)).reshape(-1, len(offsets)).min(axis=1)
        return room

    def _crowding(self, upright: Block, centres: Array) -> list[str]:
        """Name the bodies that occupy some of the places for the object's centre."""
        boxes, bodies = self.scene.collisions.boxes_but((self.name, self.demand.on or ""))
        below = self._below(upright)
        some = centres[:: max(1, len(centres) // 16)]
        crowding: dict[str, None] = {}
        for z in dict.fromkeys(some[:, 2].tolist()):
            places, band = some[some[:, 2] == z, :2], _band(upright, z, max(upright.half_x, upright.half_y), below)
            for index, body in enumerate(bodies):
                if body not in crowding and clearance_at(places, boxes.only(index), (band,)).min() < FREE:
                    crowding[body] = None
        return list(crowding)


def attitudes(pose: Pose) -> tuple[Pose, ...]:
    """List the rotations at yaw 0 in which to put down a thing that was taken at a pose: upright, and as it lay."""
    rotation = pose.matrix()[:3, :3]
    vertical = int(np.abs(rotation[2]).argmax())
    if vertical == 2 or abs(rotation[2, vertical]) < LAID:
        return (UPRIGHT,)
    yaw = Block.of(pose, (1.0, 1.0, 1.0)).yaw
    lying = np.eye(4)
    lying[:3, :3] = np.rint((Pose.planar(0.0, 0.0, -yaw).matrix()[:3, :3]) @ rotation)
    return UPRIGHT, Pose.from_matrix(lying)


def _band(block: Block, z: float, radius: float, below: float) -> tuple[float, float, float]:
    """Band that an object occupies with its centre at a height, from just above its support, which is ``below`` it."""
    half = (block.high - block.low) / 2
    return z - half - ABOVE_SURFACE - below + FLAT, z + half, radius


def _points_at(block: Block, area: Region) -> bool:
    """Check whether a block beside a body is longer towards that body than along it."""
    if not area.directions or block.round:
        return False
    return block.support(area.directions[0]) > block.support(area.directions[0] + math.pi / 2) + HAIR


def _covering(block: Block) -> tuple[Array, float]:
    """Cover a block's outline with circles: centres (n, 2) relative to its centre, and radius."""
    if block.round:
        return np.zeros((1, 2)), max(block.half_x, block.half_y)
    wide, long = sorted((block.half_x, block.half_y))
    count = min(math.ceil(2 * long / max(wide, 1e-3) - HAIR), MOST_CELLS)
    along = (np.arange(count) + 0.5) * (2 * long / count) - long
    across = np.zeros(count)
    local = np.column_stack([along, across] if block.half_x >= block.half_y else [across, along])
    return block.to_map(local) - [block.x, block.y], math.hypot(wide, long / count)


def _overhang(block: Block, points: Array, outer: Block) -> Array:
    """Compute how far a block's footprint, centred at points (m, 2), extends beyond another's outline (m,) [m]."""
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
