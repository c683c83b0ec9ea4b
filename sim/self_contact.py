"""Which pairs of a robot's links must not touch each other."""

from __future__ import annotations

import contextlib
import hashlib
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from planlang.protocols import Configuration
from sim.engine import bullet

if TYPE_CHECKING:
    from sim.robot import Robot

TOLERANCE = 0.0005
"""Penetrations not deeper than this are touching, not contact [m]."""

_SAMPLES = 120
_ALWAYS = 0.95
_COINCIDENT = 0.03
_pairs_of: dict[str, tuple[tuple[int, int], ...]] = {}


def watched_pairs(robot: Robot) -> tuple[tuple[int, int], ...]:
    """Pairs of solid links that must not touch, computed once per URDF and robot's body.

    Left out are pairs that may touch, that are rigidly connected or joined by one joint, that touch nearly always, and
    those that touch in the posture that is said to begin with: there the model is wrong, not the robot.
    """
    body = robot.body
    allowed = sorted(tuple(sorted(pair)) for pair in body.allowed)
    moving = None if body.moving is None else sorted(body.moving)
    text = robot.description.text + repr((allowed, moving, sorted(robot.shown.items())))
    key = hashlib.sha256(text.encode()).hexdigest()
    if key not in _pairs_of:
        _pairs_of[key] = _find_pairs(robot)
    return _pairs_of[key]


def _find_pairs(robot: Robot) -> tuple[tuple[int, int], ...]:
    allowed = {frozenset(pair) for pair in robot.body.allowed}
    names = robot.solid_names
    pairs = [
        (a, b)
        for a in range(len(names))
        for b in range(a + 1, len(names))
        if frozenset((names[a], names[b])) not in allowed and not _adjacent(robot, robot.solid[a], robot.solid[b])
    ]
    if robot.body.posture:
        touching = {pair for pair in robot.near_pairs(pairs) if robot.depth_between(*pair) > TOLERANCE}
        pairs = [pair for pair in pairs if pair not in touching]
    spans = {
        name: (max(low, -np.pi), min(high, np.pi))
        for name, (low, high) in robot.limits.items()
        if robot.joints[name] not in robot.fixed
    }
    lower, upper = np.array([*spans.values()]).reshape(-1, 2).T
    touched = dict.fromkeys(pairs, _SAMPLES)
    always = pairs
    with _kept(robot):
        for values in np.random.default_rng(0).uniform(lower, upper, (_SAMPLES, len(spans))).tolist():
            robot.show(Configuration(robot.base, dict(zip(spans, values, strict=True))))
            touching = {pair for pair in robot.near_pairs(always) if robot.depth_between(*pair) > TOLERANCE}
            for pair in always:
                touched[pair] -= pair not in touching
            always = [pair for pair in always if touched[pair] >= _ALWAYS * _SAMPLES]
            if not always:  # nothing is left that the other postures could tell
                break
    return tuple(pair for pair in pairs if pair not in always)


@contextlib.contextmanager
def _kept(robot: Robot) -> Iterator[None]:
    before = robot.configuration()
    yield
    robot.show(before)


def _adjacent(robot: Robot, a: int, b: int) -> bool:
    """Rigidly connected, or joined by one joint or by several whose frames coincide (a shoulder, a wrist)."""
    up_a, up_b = robot.ancestors(a), robot.ancestors(b)
    between = [i for i in up_a if i not in up_b] + [i for i in up_b if i not in up_a]
    moving = [index for index in between if index not in robot.fixed]
    if len(moving) <= 1:
        return True
    if a not in up_b and b not in up_a:
        return False
    frames = np.array([bullet.getLinkState(robot.uid, i, physicsClientId=robot.client)[4] for i in moving], dtype=float)
    return bool(np.all(np.linalg.norm(frames - frames[0], axis=1) < _COINCIDENT))
