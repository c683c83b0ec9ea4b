"""How a hand with a thumb closes: which way each joint bends its finger, and how the thumb opposes the fingers.

Fingers are flat at zero and bend towards the end of their range that is farther; joints with as much range on both
sides spread them. The thumb is turned before the palm, opposite the fingers, and bends towards them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from planlang.geometry import Array
from planlang.geometry.shapes import outline_of
from planlang.geometry.urdf import Joint
from planlang.records import dataclass

Values = Mapping[str, float]
Points = Callable[[Values], Mapping[str, Array]]

BENT = 0.25
"""Fraction of the way of a joint, from a flat hand to a fist, on which it shows where it moves its finger."""
EVEN = 0.65
"""Ratio of the ranges on both sides of zero above which a joint spreads fingers."""
ALONG = 0.5
"""Least share of a joint's motion along the closing direction; others spread fingers or turn the thumb."""
LEAST_TRAVEL = 0.002
"""Joints that move the fingers less than this do not close the hand [m]."""
CLEAR = 0.1
"""Distance between thumb and fingers beyond which it need not be greater [m]."""
FORWARD = 0.6
"""Weight of the thumb's reach along the approach, against its distance from the fingers."""
CHOICES, SWEEPS = 7, 2
"""Number of positions of each joint of the thumb that are tried, and how often."""
TIP = 0.8
"""Share of a finger's length beyond which its tip begins."""
SHORTER, EDGE = 0.02, 1e-3
"""Length by which a finger may end behind the tip of the thumb, and of its end where it is measured then [m]."""
APART = 2.5
"""Least ratio of the distance of a thumb's root from the line of the other roots to that of any finger's."""
ROW = 4
"""Least number of fingers, with the thumb, among which the thumb is told by its place."""


@dataclass(frozen=True, slots=True)
class ThumbGrip:
    """How a hand closes its thumb against its fingers; directions are in the frame of the hand."""

    closing: Array
    """Direction (3,) from the fingers to the thumb, in which the fingers move; of any length."""
    opened: Values
    closed: Values


def apart(roots: Mapping[str, Array]) -> set[str]:
    """Find the finger whose root (3,) is not in the row of the others': the thumb; empty if none stands out."""
    if len(roots) < ROW:
        return set()
    out = {}
    for name, root in roots.items():
        row = np.stack([other for key, other in roots.items() if key != name])
        middle = row.mean(axis=0)
        along = np.linalg.svd(row - middle)[2][0]  # the straight line that fits the row best
        away = np.linalg.norm(np.cross(np.vstack([row, root]) - middle, along), axis=1)
        out[name] = float(away[-1] / max(float(away[:-1].max()), LEAST_TRAVEL))
    thumb = max(out, key=lambda name: round(out[name], 3))
    return {thumb} if out[thumb] > APART else set()


def thumb_grip(
    points: Points, roots: Mapping[str, Array], thumbs: set[str], joints: Sequence[Joint], rest: Values, approach: Array
) -> ThumbGrip | None:
    """Find out how a hand closes; None if no joint bends its fingers one way.

    ``points``: points (n, 3) of each finger at joint values, ``rest`` by default; ``roots``: where the fingers begin.
    """
    fingers = [name for name in roots if name not in thumbs]
    flat = points({})
    bent, ways = dict[str, float](), dict[str, Array]()
    moves_fingers = set[str]()
    for joint in joints:
        lower, upper = rest[joint.name] - joint.lower, joint.upper - rest[joint.name]
        limit = joint.upper if upper > lower else joint.lower
        there = points({joint.name: rest[joint.name] + BENT * (limit - rest[joint.name])})
        ways_of = [there[name].mean(axis=0) - flat[name].mean(axis=0) for name in fingers]
        way = np.sum(ways_of, axis=0)
        if max(map(np.linalg.norm, ways_of)) < LEAST_TRAVEL:
            continue
        moves_fingers.add(joint.name)
        if min(lower, upper) <= EVEN * max(lower, upper):
            bent[joint.name], ways[joint.name] = limit, way - approach * float(way @ approach)
    closing = np.sum(list(ways.values()), axis=0) if ways else np.zeros(3)
    if np.linalg.norm(closing) < LEAST_TRAVEL:
        return None
    closing = closing / np.linalg.norm(closing)
    closed = {
        name: limit for name, limit in bent.items() if float(ways[name] @ closing) >= ALONG * np.linalg.norm(ways[name])
    }
    opened = {name: rest[name] for name in closed}
    turning = [joint for joint in joints if joint.name not in moves_fingers]
    turned = _opposed(points, roots, thumbs, turning, rest, (approach, closing))
    bending = _bending(points, roots, thumbs, turning, turned, closing)

    def width(share: float) -> float:
        bent_so_far = {name: turned[name] + share * (limit - turned[name]) for name, limit in bending.items()}
        gap = thumb_gap(points({**opened, **turned, **bent_so_far}), roots, thumbs, approach, closing)
        return -1.0 if gap is None else round(gap[1] - gap[0], 3)

    share = max(np.linspace(0.0, 1.0, CHOICES).tolist(), key=width)
    turned |= {name: turned[name] + share * (limit - turned[name]) for name, limit in bending.items()}
    return ThumbGrip(closing, opened | turned, closed | turned | bending)


def thumb_gap(
    points: Mapping[str, Array], roots: Mapping[str, Array], thumbs: set[str], approach: Array, closing: Array
) -> tuple[float, float, float] | None:
    """Interval from the fingers to the thumb's tip along the closing direction, and where that ends ahead [m].

    The fingers are measured where the tip is, as far ahead as they reach; None if none does.
    """
    tips = np.concatenate(_tips(points, roots, thumbs))
    along = tips @ approach
    fingers = [one for name, one in points.items() if name in roots and name not in thumbs]
    depths = (float(along.mean()), float(along.max()))
    faces = [face for one in fingers for at in depths if (face := _face(one, at, approach, closing)) is not None]
    return (max(faces), float((tips @ closing).min()), float(along.max())) if faces else None


def _face(points: Array, at: float, approach: Array, closing: Array) -> float | None:
    """How far the hull of points (n, 3) reaches along the closing direction at a depth; None if it ends before."""
    along, across = outline_of(np.column_stack([points @ approach, points @ closing])).T
    if float(along.max()) >= at - SHORTER:
        at = min(at, float(along.max()) - EDGE)
    behind, ahead = along <= at, along > at
    if not behind.any() or not ahead.any():
        return None
    share = (at - along[behind][:, None]) / (along[ahead] - along[behind][:, None])
    return float((across[behind][:, None] * (1 - share) + across[ahead] * share).max())


def _tips(points: Mapping[str, Array], roots: Mapping[str, Array], thumbs: set[str]) -> list[Array]:
    """Points (n, 3) of the tip of each thumb."""
    away = {name: np.linalg.norm(points[name] - roots[name], axis=1) for name in sorted(thumbs)}
    return [points[name][one >= TIP * one.max()] for name, one in away.items()]


def _tip(points: Mapping[str, Array], roots: Mapping[str, Array], thumbs: set[str]) -> Array:
    """Middle (3,) of the thumb's tip."""
    return np.asarray(np.mean([tip.mean(axis=0) for tip in _tips(points, roots, thumbs)], axis=0))


def _opposed(
    points: Points,
    roots: Mapping[str, Array],
    thumbs: set[str],
    joints: Sequence[Joint],
    rest: Values,
    axes: tuple[Array, Array],
) -> dict[str, float]:
    """Turn the thumb before the palm: opposite the middle of the fingers, away from them, and forward."""
    approach, closing = axes
    aside = np.cross(approach, closing)
    values = {joint.name: rest[joint.name] for joint in joints}

    def score(tried: Values) -> float:
        found = points(tried)
        middle = np.mean([found[name].mean(axis=0) for name in found if name in roots and name not in thumbs], axis=0)
        gap = _tip(found, roots, thumbs) - middle
        forward = min(FORWARD * float(gap @ approach), 0.0)
        return round(min(float(gap @ closing), CLEAR) - abs(float(gap @ aside)) + forward, 4)

    for _ in range(SWEEPS):
        for joint in joints:
            choices = [values[joint.name], *np.linspace(joint.lower, joint.upper, CHOICES).tolist()]
            scores = [score(values | {joint.name: value}) for value in choices]
            values[joint.name] = choices[scores.index(max(scores))]
    return values


def _bending(
    points: Points,
    roots: Mapping[str, Array],
    thumbs: set[str],
    joints: Sequence[Joint],
    turned: Values,
    closing: Array,
) -> dict[str, float]:
    """Find the ends of the joints that bend a turned thumb towards the fingers."""
    before, bending = _tip(points(turned), roots, thumbs), {}
    for joint in joints:
        for limit in (joint.lower, joint.upper):
            value = turned[joint.name] + BENT * (limit - turned[joint.name])
            way = _tip(points({**turned, joint.name: value}), roots, thumbs) - before
            if -float(way @ closing) > max(LEAST_TRAVEL, ALONG * float(np.linalg.norm(way))):
                bending[joint.name] = limit
    return bending
