"""Candidates for what a hand does with a held thing: hold it over something, offer it, put it down."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from executive.locations.grasp_candidates import (
    APPROACH,
    CLASSES,
    HEADINGS,
    GraspCandidates,
    classified,
    oriented,
    upright,
)
from executive.locations.headroom import RISES
from executive.locations.placement import UPRIGHT
from executive.locations.reachability import GraspClass
from executive.robots.arms import HandFrame, Held
from planlang.geometry import Array, Pose
from planlang.geometry.areas import Block
from planlang.geometry.matrices import product, rotated
from planlang.records import dataclass
from sim import ComfortZone
from sim.people import LOW

SHARES = (0.4, 0.15, 0.75)
"""Heights above a surface to try, as shares of the allowed range."""
ARM_ROOM = 0.45
"""Greatest distance that a hand reaches beyond the edge of a surface [m]."""
COMFORTABLE = 0.2
"""Distance inside a comfort zone at which a place is optimal (see :meth:`ComfortZone.margins`)."""
LEANING = 0.7
"""Weight of offering a thing tilted, relative to level."""
AS_IT_LAY = 0.5
"""Weight of putting a thing down as it lay, relative to upright."""
DROPPED = 0.1
"""Weight of letting a thing go above an open container, relative to putting it down in it."""
BARELY_RAISED = 0.5
"""Weight of lowering a thing from just above its place, relative to from as high as there is room for it."""
PARTICULAR, POOREST = 4, 0.001
"""Power of a spot's score, relative to the best, that gives the weight of a candidate, and the smallest weight."""


def held_above(
    name: str,
    block: Block,
    frame: HandFrame,
    held: Held | None,
    lowest: Callable[[Array], Array],
    heights: tuple[float, float],
    *,
    inset: float,
    fine: bool,
    kept: Sequence[Pose] = (UPRIGHT,),
) -> GraspCandidates:
    """Generate level candidates over the block's top, so that a released thing lands whole on it; near the edges first.

    The held thing is in one of the attitudes ``kept``. ``heights``: least and greatest height of the lowest point above
    the top [m]; ``lowest``: that point's height relative to the tip for rotations (m, 3, 3); ``inset``: distance that
    an empty hand keeps from the edges [m].
    """
    places = block.grid(0.1 if fine else 0.2, (max(held.size[:2]) / 2 if held else inset) + 0.03)
    count = HEADINGS if fine else HEADINGS // 2
    turns = np.asarray(block.yaw + np.arange(count) * (2 * math.pi / count), np.float64)
    over = _over_the_edge(block, places, turns)
    at, turn = np.nonzero(over <= ARM_ROOM)
    low, high = heights
    tables = []
    for share in SHARES if fine else SHARES[:1]:
        weights = np.exp(-((over[at, turn] / 0.3) ** 2)) * (1.0 if share == SHARES[0] else 0.8)
        points = np.column_stack([places[at], np.full(len(at), block.high + low + share * (high - low))])
        for attitude in kept:
            tables.append(_level(f"above {name}", points, turns[turn], weights, frame, held, lowest, attitude))
    return GraspCandidates.joined(tables).best(1200 if fine else 64)


def _over_the_edge(block: Block, places: Array, headings: Array) -> Array:
    """Distances of places (m, 2) from the edge, against each heading (h,) of the hand, (m, h)."""
    local = block.to_local(places)
    local_headings = headings - block.yaw
    back = -np.stack([np.cos(local_headings), np.sin(local_headings)], axis=1)
    half = np.array([block.half_x, block.half_y])
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = (np.sign(back)[None] * half - local[:, None]) / back[None]
    return np.asarray(np.where(np.abs(back)[None] < 1e-9, np.inf, distance).min(axis=2))


def offering(
    name: str, zone: ComfortZone, frame: HandFrame, held: Held | None, *, fine: bool, low: bool = False
) -> GraspCandidates:
    """Generate candidates with the held thing inside the person's comfort zone, from the side that they face.

    The thing is level; if its tilt is unrestricted, the hand may be level instead. With ``low`` it may also be at the
    height of the person's belly, for robots that reach no higher.
    """
    if low:
        comfortable = offering(name, zone, frame, held, fine=fine)
        return GraspCandidates.joined([comfortable, _offered(name, zone, zone.points(LOW), frame, held, fine=fine)])
    return _offered(name, zone, zone.points(), frame, held, fine=fine)


def _offered(
    name: str, zone: ComfortZone, points: Array, frame: HandFrame, held: Held | None, *, fine: bool
) -> GraspCandidates:
    """Generate candidates that offer a thing at some points (n, 3) of a zone."""
    points = points if fine else points[np.argsort(-zone.margins(points).round(6), kind="stable")[:16]]
    turns = np.array([0.0, 0.4, -0.4, 0.8, -0.8, 1.2, -1.2, 1.6, -1.6] if fine else [0.0, 0.8, -0.8])
    at, turn = (grid.ravel() for grid in np.meshgrid(np.arange(len(points)), np.arange(len(turns)), indexing="ij"))
    weights = (1.0 - 0.2 * np.abs(turns[turn])) * np.clip(zone.margins(points)[at] / COMFORTABLE, 0.05, 1.0)
    headings = zone.heading + math.pi + turns[turn]
    tables = [_level(f"offer to {name}", points[at], headings, weights, frame, held)]
    if held is not None and held.largest_tilt is None:
        level = _level(f"offer to {name}", points[at], headings, LEANING * weights, frame, None)
        places = np.tile(points[at], (len(level) // len(at), 1))
        tables.append(replace(level, points=places - held.offsets(level.rotations)))
    return GraspCandidates.joined(tables).best(1200 if fine else 64)


@dataclass(frozen=True, slots=True, eq=False)
class Spots:
    """Where a thing may be put down in one attitude: its rotation at yaw 0."""

    attitude: Pose
    places: Array
    """Places and yaws of its box centre (n, 4)."""
    scores: Array
    """Scores (n,), higher for better places."""
    rooms: Array
    """Headroom of the thing there, (n,) [m], from where the hand lowers it."""
    turns_freely: bool = False
    """True for a round thing that stands: others may only be turned by half a turn."""
    dropped: bool = False
    """True where the thing is let go above what it falls into."""

    @property
    def is_upright(self) -> bool:
        """Whether the thing stands as it is meant to."""
        return self.attitude == UPRIGHT

    @property
    def weight(self) -> float:
        """How natural it is to put the thing there in this way, 0..1."""
        return (1.0 if self.is_upright else AS_IT_LAY) * (DROPPED if self.dropped else 1.0)

    def barely_raised(self) -> Spots:
        """Create the same ones with the least headroom, for hands or arms that do not get as high as the thing may."""
        return replace(self, rooms=np.minimum(self.rooms, RISES[-1]))


def placing(name: str, spots: Spots, frame: HandFrame, held: Held, *, fine: bool) -> GraspCandidates:
    """Generate candidates that lower a held thing onto one of some spots, and retreat.

    The better the score of a spot, the more natural it is; less so where the thing does not stand, or falls.
    """
    count = 2 if not spots.turns_freely else HEADINGS if fine else HEADINGS // 2
    at, turn = (grid.ravel() for grid in np.meshgrid(np.arange(len(spots.places)), np.arange(count), indexing="ij"))
    yaws = spots.places[at, 3] + turn * (2 * math.pi / count)
    base, grasp, heading, roll = _held_as(frame, held, spots.attitude)
    rotations = product(upright(yaws), base)
    points = spots.places[at, :3] - held.offsets(rotations)
    back = -APPROACH * rotated(rotations, np.asarray(frame.approach))
    still = np.zeros((len(at), 3))
    shares = spots.scores / spots.scores.max(initial=0.0)
    return GraspCandidates(
        f"put on {name}",
        points,
        rotations,
        np.stack([spots.rooms[at, None] * np.array([0.0, 0.0, 1.0]), still, back], axis=1),
        1,
        np.full(len(at), grasp, np.intp),
        yaws + heading,
        np.full(len(at), roll, np.intp),
        spots.weight * np.clip(shares**PARTICULAR, POOREST, 1.0)[at],
    ).best(1200 if fine else 64)


def _level(
    text: str,
    places: Array,
    headings: Array,
    weights: Array,
    frame: HandFrame,
    held: Held | None,
    lowest: Callable[[Array], Array] | None = None,
    attitude: Pose = UPRIGHT,
) -> GraspCandidates:
    """Generate candidates with a level hand in either roll, or a held thing in an attitude; centres at places (m, 3).

    With ``lowest`` (see :func:`held_above`) the places' heights are those of the lowest point of hand and held thing.
    """
    count = len(places)
    still = np.zeros((count, 1, 3))
    if held is None:
        side = [CLASSES.index(GraspClass.SIDE)] * count
        candidates = GraspCandidates.joined(
            [
                oriented(text, places, still, 0, side, list(headings), [roll] * count, list(weights), frame)
                for roll in (1, -1)
            ]
        )
        return (
            candidates
            if lowest is None
            else replace(candidates, points=_raised(candidates.points, lowest(candidates.rotations)))
        )
    base, grasp, heading, roll = _held_as(frame, held, attitude)
    rotations = product(upright(headings - heading), base)
    points = places - held.offsets(rotations)
    if lowest is not None:
        points[:, 2] = places[:, 2]
        points = _raised(points, lowest(rotations))
    rolls, grasps = np.full(count, roll, np.intp), np.full(count, grasp, np.intp)
    return GraspCandidates(text, points, rotations, still, 0, grasps, headings, rolls, weights)


def _raised(points: Array, lowest: Array) -> Array:
    """Raise points (m, 3) by the depth of the lowest point below them (m,)."""
    return np.asarray(points - lowest[:, None] * np.array([0.0, 0.0, 1.0]))


def _held_as(frame: HandFrame, held: Held, attitude: Pose) -> tuple[Array, int, float, int]:
    """Tip rotation that keeps a held thing in an attitude, with its class, heading and roll."""
    base: Array = attitude.matrix()[:3, :3] @ held.pose.matrix()[:3, :3].T
    return (base, *classified(base, frame))
