"""Candidates for what a hand does with a thing in it: hold it over something, offer it, put it down."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from executive.belief.believed_bodies import Block
from executive.locations.grasp_candidates import (
    APPROACH,
    CLASSES,
    HEADINGS,
    GraspCandidates,
    classified,
    oriented,
    upright,
)
from executive.locations.reachability import GraspClass
from executive.robots.arms import HandFrame, Held
from planlang.geometry import Array
from planlang.geometry.matrices import product, rotated
from sim import ComfortZone

SHARES = (0.4, 0.15, 0.75)
"""Heights above a surface that are tried, as shares of what is allowed."""
ARM_ROOM = 0.45
"""Largest reach of a hand over the edge of a surface for a place over it [m]."""
COMFORTABLE = 0.2
"""Distance inside a comfort zone from which a place is as good as can be (see :meth:`ComfortZone.margins`)."""
LEANING = 0.7
"""Weight of offering a thing that leans, beside one that is as it stood."""
PARTICULAR, POOREST = 4, 0.001
"""Power of a spot's score, beside that of the best one, that is the weight of what is put there, and the least one."""


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
) -> GraspCandidates:
    """Return candidates level over the block's top, so that what is held comes down whole on it; near the edges first.

    ``heights``: of the lowest point over the top, least and greatest [m]; ``lowest``: where that is, relative to the
    tip, for rotations (m, 3, 3); ``inset``: how far from the edges an empty hand stays [m].
    """
    places = block.grid(0.1 if fine else 0.2, (max(held.size[:2]) / 2 if held else inset) + 0.03)
    count = HEADINGS if fine else HEADINGS // 2
    turns = np.asarray(block.yaw + np.arange(count) * (2 * math.pi / count), np.float64)
    over = _over_the_edge(block, places, turns)
    at, turn = np.nonzero(over <= ARM_ROOM)
    low, high = heights
    found = []
    for share in SHARES if fine else SHARES[:1]:
        weights = np.exp(-((over[at, turn] / 0.3) ** 2)) * (1.0 if share == SHARES[0] else 0.8)
        points = np.column_stack([places[at], np.full(len(at), block.high + low + share * (high - low))])
        found.append(_level(f"above {name}", points, turns[turn], weights, frame, held, lowest))
    return GraspCandidates.joined(found).best(1200 if fine else 64)


def _over_the_edge(block: Block, places: Array, headings: Array) -> Array:
    """Return how far inside the edge places (m, 2) are, along each heading (h,) of the hand, (m, h)."""
    local = block.to_local(places)
    candidates = headings - block.yaw
    back = -np.stack([np.cos(candidates), np.sin(candidates)], axis=1)
    half = np.array([block.half_x, block.half_y])
    with np.errstate(divide="ignore", invalid="ignore"):
        out = (np.sign(back)[None] * half - local[:, None]) / back[None]
    return np.asarray(np.where(np.abs(back)[None] < 1e-9, np.inf, out).min(axis=2))


def offering(name: str, zone: ComfortZone, frame: HandFrame, held: Held | None, *, fine: bool) -> GraspCandidates:
    """Return candidates with what is held inside the person's comfort zone, coming from where they face.

    What is held is level; if it may lean as it likes, the hand may be level instead.
    """
    points = zone.points()
    points = points if fine else points[np.argsort(-zone.margins(points).round(6), kind="stable")[:16]]
    turns = np.array([0.0, 0.4, -0.4, 0.8, -0.8, 1.2, -1.2, 1.6, -1.6] if fine else [0.0, 0.8, -0.8])
    at, turn = (grid.ravel() for grid in np.meshgrid(np.arange(len(points)), np.arange(len(turns)), indexing="ij"))
    weights = (1.0 - 0.2 * np.abs(turns[turn])) * np.clip(zone.margins(points)[at] / COMFORTABLE, 0.05, 1.0)
    headings = zone.heading + math.pi + turns[turn]
    found = [_level(f"offer to {name}", points[at], headings, weights, frame, held)]
    if held is not None and held.largest_tilt is None:
        level = _level(f"offer to {name}", points[at], headings, LEANING * weights, frame, None)
        places = np.tile(points[at], (len(level) // len(at), 1))
        found.append(replace(level, points=places - held.offsets(level.rotations)))
    return GraspCandidates.joined(found).best(1200 if fine else 64)


def placing(
    name: str,
    spots: Array,
    scores: Array,
    rooms: Array,
    frame: HandFrame,
    held: Held,
    *,
    is_round: bool,
    fine: bool,
) -> GraspCandidates:
    """Return candidates down onto a place for what is held, and back from it: as a whole upright at one of ``spots``.

    These (n, 4) are its places and yaws, with so much room above (n,) [m], from where the hand puts it down. The better
    the score of one (n,), the more natural it is. What is round may be turned as one likes, anything else only by half
    a turn.
    """
    count = 2 if not is_round else HEADINGS if fine else HEADINGS // 2
    at, turn = (grid.ravel() for grid in np.meshgrid(np.arange(len(spots)), np.arange(count), indexing="ij"))
    yaws = spots[at, 3] + turn * (2 * math.pi / count)
    base, grasp, heading, roll = _held_upright(frame, held)
    rotations = product(upright(yaws), base)
    points = spots[at, :3] - held.offsets(rotations)
    back = -APPROACH * rotated(rotations, np.asarray(frame.approach))
    still = np.zeros((len(at), 3))
    return GraspCandidates(
        f"put on {name}",
        points,
        rotations,
        np.stack([rooms[at, None] * np.array([0.0, 0.0, 1.0]), still, back], axis=1),
        1,
        np.full(len(at), grasp, np.intp),
        yaws + heading,
        np.full(len(at), roll, np.intp),
        np.clip((scores / scores.max(initial=0.0)) ** PARTICULAR, POOREST, 1.0)[at],
    ).best(1200 if fine else 64)


def _level(
    text: str,
    places: Array,
    headings: Array,
    weights: Array,
    frame: HandFrame,
    held: Held | None,
    lowest: Callable[[Array], Array] | None = None,
) -> GraspCandidates:
    """Return candidates level, with either roll, or what it holds upright, its middle at places (m, 3).

    With ``lowest`` (see :func:`held_above`) it is the lowest point of hand and held object whose height they say.
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
    base, grasp, heading, roll = _held_upright(frame, held)
    rotations = product(upright(headings - heading), base)
    points = places - held.offsets(rotations)
    if lowest is not None:
        points[:, 2] = places[:, 2]
        points = _raised(points, lowest(rotations))
    rolls, grasps = np.full(count, roll, np.intp), np.full(count, grasp, np.intp)
    return GraspCandidates(text, points, rotations, still, 0, grasps, headings, rolls, weights)


def _raised(points: Array, lowest: Array) -> Array:
    """Return points (m, 3) higher by as much as the lowest point is below them (m,)."""
    return np.asarray(points - lowest[:, None] * np.array([0.0, 0.0, 1.0]))


def _held_upright(frame: HandFrame, held: Held) -> tuple[Array, int, float, int]:
    """Return a tip rotation that keeps what is held as it stands, and its class, heading and roll."""
    base: Array = held.pose.matrix()[:3, :3].T
    return (base, *classified(base, frame))
