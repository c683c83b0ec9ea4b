"""Reach of arms that cannot turn their hand as they like: rows found by sampling, near lattice poses but not at them.

An arm of fewer than six joints reaches almost no pose of a lattice exactly. Random postures are pulled to the nearest
one in which the hand points as a class of grasps says, at a height of the lattice (Gauss-Newton on height and the two
components of the rotation that a heading leaves); place and heading stay free. A row stands for the cell that such a
pose is in; where exactly it is, the row's posture tells (:func:`exact_places`).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from executive.locations.reachability import CELL, YAWS, GraspClass
from executive.motion import Chain
from executive.robots.arms import HandFrame
from planlang.geometry import Array

POSTURES = 60_000
"""Random postures of each roll."""
CHUNK = 10_000
"""Number of postures that are computed at once."""
STEPS = 12
"""Steps by which a posture is pulled."""
DAMPING = 1e-6
NEAR = 1e-4, 5e-4
"""Largest distance of a pose from a height of the lattice [m], and from the wanted rotation [rad]."""


def sampled(
    chain: Chain, grasp: GraspClass, frame: HandFrame, roll: int, floor: float, rng: np.random.Generator
) -> tuple[Array, Array, NDArray[np.int64]]:
    """Joint values (n, d), places (n, 3: x, y, heading) and levels (n,) of the tips, none below ``floor`` [m]."""
    found = [_pulled(chain, grasp, frame, roll, chain.sample(rng, CHUNK)) for _ in range(POSTURES // CHUNK)]
    q = np.concatenate([part for part in found if len(part)] or [np.zeros((0, chain.dof))])
    places, heights = exact_places(chain, q, grasp, frame, roll)
    levels = np.rint(heights / CELL).astype(np.int64)
    kept = heights >= floor - CELL / 2
    return q[kept], places[kept], levels[kept]


def exact_places(chain: Chain, q: Array, grasp: GraspClass, frame: HandFrame, roll: Array | int) -> tuple[Array, Array]:
    """Where tips are for joint values (n, d): x, y [m] and heading [rad] (n, 3), and the heights (n,) [m]."""
    if not len(q):
        return np.zeros((0, 3)), np.zeros(0)
    tips = chain.fk(q)
    headings = _headings(tips[:, :3, :3], grasp, frame, roll)
    return np.column_stack([tips[:, :2, 3], headings]), tips[:, 2, 3]


def cells_of(places: Array) -> NDArray[np.int64]:
    """Return the lattice cells (n, 3: x, y, heading) that places (n, 3) are in."""
    turns = np.rint(places[:, 2] / (2 * math.pi / YAWS)).astype(np.int64) % YAWS
    return np.column_stack([np.rint(places[:, :2] / CELL).astype(np.int64), turns])


def _headings(rotations: Array, grasp: GraspClass, frame: HandFrame, roll: Array | int) -> Array:
    if grasp is GraspClass.TOP:
        closing = rotations @ np.asarray(frame.closing)
        return np.asarray(np.arctan2(-closing[:, 0] * roll, closing[:, 1] * roll))
    approach = rotations @ np.asarray(frame.approach)
    return np.asarray(np.arctan2(approach[:, 1], approach[:, 0]))


def _pulled(chain: Chain, grasp: GraspClass, frame: HandFrame, roll: int, q: Array) -> Array:
    """Return the postures (n, d) that could be pulled to the class, near where they were."""
    level = np.rint(chain.fk(q)[:, 2, 3] / CELL) * CELL
    for _ in range(STEPS):
        error = _error(chain, grasp, frame, roll, q, level)
        jacobian = chain.jacobian(q)[:, 2:5]  # velocity upwards, turning about x and y
        squares = jacobian @ jacobian.transpose(0, 2, 1) + DAMPING * np.eye(3)
        step = jacobian.transpose(0, 2, 1) @ np.linalg.solve(squares, error[:, :, None])
        q = np.clip(q + np.clip(step[:, :, 0], -0.4, 0.4), chain.lower, chain.upper)
    near = np.abs(_error(chain, grasp, frame, roll, q, level))
    kept = (near[:, 0] < NEAR[0]) & (near[:, 1:].max(axis=1) < NEAR[1])
    return np.asarray(q[kept & _level_about(chain, grasp, frame, roll, q)])


def _error(chain: Chain, grasp: GraspClass, frame: HandFrame, roll: int, q: Array, level: Array) -> Array:
    """Return the errors in height [m] and in rotation about x and y [rad], (n, 3)."""
    tips = chain.fk(q)
    wanted = grasp.rotations(_headings(tips[:, :3, :3], grasp, frame, roll), roll, frame)
    turn = wanted @ tips[:, :3, :3].transpose(0, 2, 1)
    return np.column_stack([level - tips[:, 2, 3], _log(turn)[:, :2]])


def _level_about(chain: Chain, grasp: GraspClass, frame: HandFrame, roll: int, q: Array) -> NDArray[np.bool_]:
    """Return True where the rotation about z is right, too: the whole rotation is that of the class."""
    tips = chain.fk(q)[:, :3, :3]
    wanted = grasp.rotations(_headings(tips, grasp, frame, roll), roll, frame)
    turns = wanted @ tips.transpose(0, 2, 1)
    half = np.trace(turns, axis1=1, axis2=2) < 0  # of half a turn the logarithm is zero, too
    return np.asarray((np.abs(_log(turns)).max(axis=1) < NEAR[1]) & ~half)


def _log(rotations: Array) -> Array:
    """Rotation vectors (n, 3) of rotations (n, 3, 3); of nearly half a turn only roughly, of half a turn zero."""
    cosine = np.clip((np.trace(rotations, axis1=1, axis2=2) - 1) / 2, -1.0, 1.0)
    angle = np.arccos(cosine)
    skew = np.stack(
        [
            rotations[:, 2, 1] - rotations[:, 1, 2],
            rotations[:, 0, 2] - rotations[:, 2, 0],
            rotations[:, 1, 0] - rotations[:, 0, 1],
        ],
        axis=1,
    )
    scale = np.where(angle < 1e-6, 0.5, angle / np.maximum(2 * np.sin(angle), 1e-6))
    return np.asarray(scale[:, None] * skew)
