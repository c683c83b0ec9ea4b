"""Postures near a named one that keep the held object upright, whichever way it was grasped.

A named posture defines the position of the hand; its orientation depends on the grasp. Inverse kinematics is solved for
positions from there outwards, in all headings. Postures in self-collision, held object included, are discarded.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterator
from functools import cache
from itertools import islice
from pathlib import Path

import casadi
import numpy as np
from numpy.typing import NDArray

from executive.locations.grasp_candidates import upright
from executive.modules.commanding import Control
from executive.motion import kinematics, symbolic
from executive.robots.arms import ArmModel, Held
from planlang.cache import Cache
from planlang.geometry import Array
from planlang.geometry.matrices import moved, product, rigid, rotated
from planlang.protocols import Configuration

HEADINGS = 16
"""Headings of the hand about the vertical to try."""
ALONG = (0.0, 0.1, -0.1, 0.2, -0.2, 0.3, -0.3)
ACROSS = (0.0, 0.1, -0.1, 0.2, -0.2, 0.3, -0.3)
UP = (0.0, 0.1, -0.1, 0.2, -0.2, 0.3, -0.3)
"""Offsets from the hand's position in the named posture, in the base's frame [m]."""
TURN = 0.15
"""Cost of turning the hand from its orientation in the named posture, in metres of offset [m/rad]."""
OTHERWISE = 0.5
"""Joint difference by which two solutions of one hand pose count as distinct [rad, m]."""
AT_ONCE = 240
"""Poses per call of inverse kinematics."""
LOOKED_AT = 40
"""Postures among which to choose the narrowest."""
MOST = 16
"""Most postures to return."""
NARROWER = 0.04
"""Step in which widths of the robot with its load are compared [m]: narrower fits through doors."""
NEAR = 0.01
"""Tolerance within which the hand is in a posture [m, rad]."""
OVER_THE_BASE = 2
"""Penalty, in steps of NARROWER, for a load above the base, onto which it would fall if lost."""
_CACHE = Cache("carrying", most=200)
APART = 0.12
"""Least distance of the hand between two postures [m]; postures with different orientations may be closer."""


def upright_postures(control: Control, arm: ArmModel, held: Held, named: Array) -> list[Array]:
    """Find joint positions (d,) near a named posture (d,) that keep the held object upright, best first.

    The best make the robot with its load no wider than the named posture does; ties are ordered by nearness to it.
    """
    postures = list(islice(_free(control, arm, held, named), LOOKED_AT))
    if not postures:
        return []
    joints, loads = _distances(arm, held, np.stack([named, *postures]))
    half = max(held.size[:2]) / 2
    widths = np.maximum(joints, loads + half)
    passages = _passages(control, arm, held, np.stack([named, *postures]))
    costs = np.maximum(0, np.rint((widths[1:] - widths[0]) / NARROWER))
    costs += np.maximum(0, np.rint((passages[1:] - passages[0]) / NARROWER))
    costs += OVER_THE_BASE * (loads[1:] - half < control.robot.base.radius + NEAR)
    return [postures[k] for k in np.argsort(costs, kind="stable")[:MOST]]


def is_near(arm: ArmModel, held: Held, named: Array, q: Array) -> bool:
    """Check whether joint positions q (d,) are within the search range of a named posture, with the object upright."""
    there, here = arm.chain.fk(np.stack([named, q]))
    away = np.abs(here[:3, 3] - there[:3, 3]) - np.abs([ALONG, ACROSS, UP]).max(axis=1)
    return bool((away <= NEAR).all() and rotated(here[:3, :3], held.up)[2] >= math.cos(NEAR))


def _free(control: Control, arm: ArmModel, held: Held, named: Array) -> Iterator[Array]:
    """Yield distinct joint positions without self-collision, near the named posture first.

    Inverse kinematics starts from the arm's current joints, which often leaves a straight path, and from ``named``.
    """
    targets = _targets(arm, held, arm.chain.fk(named)[0])
    kept: list[tuple[Array, Array]] = []
    for first in range(0, len(targets), AT_ONCE):
        batch = targets[first : first + AT_ONCE]
        for poses, rows in _solutions(control, arm, named, batch):
            for pose, q in zip(poses, rows, strict=True):
                duplicate = any(_alike(pose, other) and np.abs(q - p).max() < OTHERWISE for other, p in kept)
                there = Configuration(control.base(), dict(zip(arm.joints, map(float, q), strict=True)))
                if not duplicate and not control.scene.world.self_contacts(there):
                    kept.append((pose, q))
                    yield q


def _solutions(control: Control, arm: ArmModel, named: Array, targets: Array) -> Iterator[tuple[Array, Array]]:
    """Yield the reachable targets and their joint positions: seeded with the arm's joints, then with ``named``."""
    solved = np.ones(len(targets), bool)
    for first in (control.arm_joints(arm), named):
        every = np.concatenate([first[None], arm.seeds])
        joints, good = np.zeros((len(targets), len(named))), np.zeros(len(targets), bool)
        # Where the first round found nothing, the arm's own seeds have failed already and would again.
        for some, seeds in ((solved, every), (~solved, every[:1])):
            if some.any():
                joints[some], good[some] = _cached_ik(arm, targets[some], seeds)
        solved = good
        yield targets[good], joints[good]


def _cached_ik(arm: ArmModel, targets: Array, seeds: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Solve inverse kinematics for targets (n, 4, 4): joint positions (n, d), and a mask (n,) of those reached.

    Cached per user: most targets are out of reach, which is slow to find out, and repeated tasks ask for the same ones.
    """
    chain = arm.chain
    facts = (chain.digest, chain.dof, arm.standing is None, _method(), targets.tobytes(), seeds.tobytes())
    key = hashlib.sha256(repr(facts).encode()).hexdigest()
    content = _CACHE.load(key)
    if content is not None:
        rows = np.frombuffer(content).reshape(len(targets), chain.dof + 1)
        return rows[:, 1:], rows[:, 0] > 0
    joints, good = arm.solve(targets, np.broadcast_to(seeds, (len(targets), *seeds.shape)))
    _CACHE.keep(key, np.column_stack([good, joints]).tobytes())
    return joints, good


@cache
def _method() -> str:
    """Hash the code of the solver, so that cached solutions of older code are not used."""
    digest = hashlib.sha256(casadi.CasadiMeta.version().encode())
    for module in (kinematics, symbolic):
        digest.update(Path(str(module.__file__)).read_bytes())
    return digest.hexdigest()


def _targets(arm: ArmModel, held: Held, there: Array) -> Array:
    """Sample tip poses (n, 4, 4) in the base's frame that keep the held object upright, closest to ``there`` first."""
    turns = upright(np.asarray(np.arange(HEADINGS) * (2 * math.pi / HEADINGS), np.float64))
    rotations = product(turns, held.pose.rotation.T)
    approach = np.asarray(arm.frame.approach)
    cosines = rotated(rotations, approach) @ rotated(there[:3, :3], approach)
    away = np.arccos(np.clip(cosines, -1.0, 1.0))
    shifts = np.stack(np.meshgrid(ALONG, ACROSS, UP, indexing="ij"), axis=-1).reshape(-1, 3)
    shift, turn = (grid.ravel() for grid in np.meshgrid(np.arange(len(shifts)), np.arange(HEADINGS), indexing="ij"))
    cost = np.linalg.norm(shifts, axis=1)[shift] + TURN * away[turn]
    order = np.argsort(cost.round(6), kind="stable")
    return rigid(rotations[turn[order]], there[:3, 3] + shifts[shift[order]])


def _alike(pose: Array, other: Array) -> bool:
    near = float(np.linalg.norm(pose[:3, 3] - other[:3, 3])) < APART
    return near and float(np.abs(pose[:3, :3] - other[:3, :3]).max()) < 0.5


def _distances(arm: ArmModel, held: Held, q: Array) -> tuple[Array, Array]:
    """Compute distances from the base's axis, (n,) each [m]: of the arm's farthest joint, and of the load's centre."""
    chain, tips = arm.chain, arm.chain.fk(q)
    joints = np.linalg.norm(chain.frames(q)[:, :, :2, 3], axis=2).max(axis=1)
    return joints, np.linalg.norm(moved(tips, np.asarray(held.pose.position))[:, :2], axis=1)


def _passages(control: Control, arm: ArmModel, held: Held, q: Array) -> Array:
    """Compute the width of the robot with its load in the heading in which it is narrowest, (n,) [m]."""
    torso = None if arm.lift is None else arm.lift.joint
    outlines = control.scene.world.outlines([name for name in arm.joints if name != torso])
    turns = np.arange(HEADINGS) * (math.pi / HEADINGS)
    across = np.stack([np.cos(turns), np.sin(turns)])
    still = np.concatenate([corners for _, _, corners in outlines if len(corners)]) @ across
    load = moved(arm.chain.fk(q), np.asarray(held.pose.position))[:, None, :2] @ across
    moving, half = arm.chain.frames(q)[:, :, :2, 3] @ across, max(held.size[:2]) / 2
    high = np.maximum(np.maximum(moving.max(axis=1), load[:, 0] + half), still.max(axis=0))
    low = np.minimum(np.minimum(moving.min(axis=1), load[:, 0] - half), still.min(axis=0))
    return np.asarray((high - low).min(axis=1))
