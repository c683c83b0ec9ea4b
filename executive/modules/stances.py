"""Places of the base before points at which arms work: where they are as far from the shoulders as suits the arms."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from executive.belief.scene_collisions import BasePose
from executive.modules.platform import Platform
from executive.robots.arms import ArmModel
from planlang.geometry import Array, Pose

SHARES = (0.3, 0.35, 0.4, 0.45, 0.5, 0.55, 0.6, 0.65, 0.7, 0.75, 0.8, 0.85)
"""Distances of the point ahead of the shoulders, as shares of an arm's reach."""
BEST = 0.6
"""The best of these."""
HEADINGS = 24
"""Headings of the base that are tried."""
ASIDE = (0.0, math.radians(45.0), math.radians(-45.0), math.radians(90.0), math.radians(-90.0))
"""Angles from the heading at which the point may lie: into a corner, or along a wall, arms reach sideways."""
SIDEWAYS = 0.2
"""Price of a point at 90 degrees from the heading, beside the distance from the best place [m]."""
FARTHER = 0.3
"""Price of driving one metre farther, beside the distance from the best place [m]."""
LEVEL = 0.3
"""Share of the reach with which is reckoned at least, however far below or above the shoulder points are."""
GRID, TURNS = 0.08, 12
"""Distance of base positions [m], and number of headings, of which it is computed how far points are from there."""
HAIR = 1e-6
"""What rounding takes from these shares."""
MOST = 40
"""Free places that are offered."""
ALIKE = 3
"""Free places at one distance of the point ahead that are offered before the next ones at any other."""


def is_at_ease(platform: Platform, point: Array, arms: Sequence[ArmModel]) -> bool:
    """Return whether arms reach a point (2,) of the map from where the base is with some reach to spare."""
    shoulder, reach = _shoulder(arms)
    there = Pose.planar(*platform.base()).inverse() @ Pose((float(point[0]), float(point[1]), 0.0))
    return math.dist(there.position[:2], shoulder) <= SHARES[-1] * reach


def _shoulder(arms: Sequence[ArmModel]) -> tuple[Array, float]:
    """Return where shoulders are in the base's frame, on the floor (2,), and the reach of the shortest arm [m]."""
    middle = np.mean([(arm.shoulder_low + arm.shoulder_high)[:2] / 2 for arm in arms], axis=0)
    return middle, min(arm.reach for arm in arms)


def _level_reach(arms: Sequence[ArmModel], heights: Array, reach: float) -> float:
    """Return how much of a reach is left horizontally at the worst of heights (k,) above the floor [m]."""
    low = float(np.mean([arm.shoulder_low[2] for arm in arms]))
    high = float(np.mean([arm.shoulder_high[2] for arm in arms]))
    away = float(np.maximum(low - heights, heights - high).max())
    return math.sqrt(max(reach**2 - max(away, 0.0) ** 2, (LEVEL * reach) ** 2))


def _parts(platform: Platform, arms: Sequence[ArmModel]) -> frozenset[str]:
    """Return the links of arms, and what they hold."""
    names = {arm.name for arm in arms}
    held = (name for name, grip in platform.belief.held.items() if names & set(grip.arms))
    return frozenset(held).union(*({*arm.solver.chain.carriers, *arm.hand_links} for arm in arms))


def stances(
    platform: Platform,
    points: Array,
    arms: Sequence[ArmModel],
    headings: Array | None = None,
    *,
    arms_first: bool = False,
) -> Iterator[BasePose]:
    """Yield free places about a point (2,), or points (k, 2), of the map, those near and at a good distance first.

    The point at the worst distance counts: a row of points is in reach from its side, not from its end. Of points
    (k, 3) the height counts, too: far below or above the shoulder, less of the reach is left. Places from
    which a point is nearer or farther than all of ``SHARES`` come last: arms seldom get to it, which takes long to find
    out. ``headings`` (h,) are those of the base that are tried [rad]: by default many, all around. ``arms_first``: the
    arms take another posture before the base goes there, so that it does not matter what they would touch as they are.
    """
    platform.sync()
    scene, now = platform.scene, np.array(platform.base())
    shoulder, reach = _shoulder(arms)
    points = np.atleast_2d(points)
    if points.shape[1] == 3:
        points, reach = points[:, :2], _level_reach(arms, points[:, 2], reach)
    around = now[2] + np.linspace(-np.pi, np.pi, HEADINGS, endpoint=False)
    yaws = around if headings is None else np.remainder(headings + np.pi, 2 * np.pi) - np.pi
    ahead, turned, aside = (grid.ravel() for grid in np.meshgrid(np.array(SHARES), yaws, np.array(ASIDE)))
    x, y = shoulder[0] + reach * ahead * np.cos(aside), shoulder[1] + reach * ahead * np.sin(aside)
    c, s = np.cos(turned), np.sin(turned)
    middle = points.mean(axis=0)
    bases = np.stack([middle[0] - c * x + s * y, middle[1] - s * x - c * y, turned], axis=1)
    shoulders = middle - reach * ahead[:, None] * np.stack([np.cos(turned + aside), np.sin(turned + aside)], axis=1)
    away = np.linalg.norm(points - shoulders[:, None], axis=2)
    price = np.abs(away - BEST * reach).max(axis=1) + FARTHER * np.linalg.norm(bases[:, :2] - now[:2], axis=1)
    price += SIDEWAYS * np.abs(aside) / (np.pi / 2)
    doubtful = (away.min(axis=1) < (SHARES[0] - HAIR) * reach) | (away.max(axis=1) > (SHARES[-1] + HAIR) * reach)
    free = scene.collisions.floor().holds(bases) & scene.collisions.drivable()(bases)
    offered, moving = 0, _parts(platform, arms) if arms_first else frozenset()
    price = price.round(9)  # noise of the last bits decides nothing
    for row in np.lexsort((price, _turn(ahead, price, free), doubtful)):
        base = tuple(map(float, bases[row]))
        if offered == MOST or not free[row]:
            continue
        contacts = scene.collisions.contacts((base[0], base[1], base[2]))
        if all(one.part in moving for one in contacts):
            offered += 1
            yield base[0], base[1], base[2]


def _turn(ahead: Array, price: Array, free: NDArray[np.bool_]) -> Array:
    """Return how many times ``ALIKE`` cheaper free places there are at the same distance (n,).

    How far an arm reaches depends on how the hand has to be: there are more places at the best distance than are tried.
    """
    turn = np.zeros(len(ahead), int)
    for share in SHARES:
        rows = np.flatnonzero(free & (ahead == share))
        turn[rows[np.argsort(price[rows], kind="stable")]] = np.arange(len(rows)) // ALIKE
    return turn


def distances(platform: Platform, rows: Sequence[Array], arms: Sequence[ArmModel]) -> list[float]:
    """Compute how near arms get to rows of points (k, 2) of the map, from the best free base pose for each [m].

    The distance of a row is that of its farthest point from the shoulders, inf if there is no such base pose.
    """
    platform.sync()
    collisions, (shoulder, reach) = platform.scene.collisions, _shoulder(arms)
    every = np.concatenate(rows)
    far = reach + float(np.linalg.norm(shoulder))
    x, y, yaw = (
        grid.ravel()
        for grid in np.meshgrid(
            *(np.arange(low - far, high + far, GRID) for low, high in zip(every.min(0), every.max(0), strict=True)),
            np.linspace(-np.pi, np.pi, TURNS, endpoint=False),
        )
    )
    bases = np.stack([x, y, yaw], axis=1)
    bases = bases[collisions.drivable()(bases)]
    bases = bases[collisions.floor().holds(bases)]
    if not len(bases):
        return [math.inf] * len(rows)
    c, s = np.cos(bases[:, 2]), np.sin(bases[:, 2])
    shoulders = bases[:, :2] + np.stack([c * shoulder[0] - s * shoulder[1], s * shoulder[0] + c * shoulder[1]], axis=1)
    return [float(np.linalg.norm(shoulders[:, None] - row, axis=2).max(axis=1).min()) for row in rows]
