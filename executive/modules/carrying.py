"""Postures near a named one in which what is held stands upright, whichever way it is held.

A named posture says where the hand is to be; how it is turned there depends on the grasp. It is looked for by inverse
kinematics, from the hand's place outwards, for all headings; the robot and what it holds must not touch the robot.
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
"""Directions to which the hand may be turned about the vertical."""
ALONG = (0.0, 0.1, -0.1, 0.2, -0.2, 0.3, -0.3)
ACROSS = (0.0, 0.1, -0.1, 0.2, -0.2, 0.3, -0.3)
UP = (0.0, 0.1, -0.1, 0.2, -0.2, 0.3, -0.3)
"""Distances from the place of the hand in the named posture, in the base's frame [m]."""
TURN = 0.15
"""By how much [m] of distance a turn of the hand by a radian from how it is in the named posture counts."""
OTHERWISE = 0.5
"""Difference of a joint by which the arm is at a place in another way [rad, m]."""
AT_ONCE = 240
"""Poses whose inverse kinematics is solved in one call."""
LOOKED_AT = 40
"""Postures among which the narrowest are chosen."""
MOST = 16
"""Postures that are kept."""
NARROWER = 0.04
"""Differences of the robot's radius, with what it holds, that count [m]: it has to get through doors."""
NEAR = 0.01
"""Differences by which a posture is another [m, rad]."""
OVER_THE_BASE = 2
"""Such differences that are put up with, so that nothing that is lost falls on the base."""
_CACHE = Cache("carrying", most=200)
APART = 0.12
"""Least distance of the hand's places in two of them [m]; those that are turned apart may be at one place."""


def upright_postures(control: Control, arm: ArmModel, held: Held, named: Array) -> list[Array]:
    """Return joint positions (d,) near those of a named posture (d,) at which what is held is upright, the best first.

    Best is where the robot, with what it holds, is as narrow as in the named posture, then what is near that.
    """
    found = list(islice(_free(control, arm, held, named), LOOKED_AT))
    if not found:
        return []
    joints, things = _distances(arm, held, np.stack([named, *found]))
    half = max(held.size[:2]) / 2
    widths = np.maximum(joints, things + half)
    worse = np.maximum(0, np.rint((widths[1:] - widths[0]) / NARROWER))
    worse += OVER_THE_BASE * (things[1:] - half < control.robot.base.radius + NEAR)
    return [found[k] for k in np.argsort(worse, kind="stable")[:MOST]]


def is_near(arm: ArmModel, held: Held, named: Array, q: Array) -> bool:
    """Return whether an arm at joint positions (d,) is in a posture like these: near the place, upright."""
    there, here = arm.solver.chain.fk(np.stack([named, q]))
    away = np.abs(here[:3, 3] - there[:3, 3]) - np.abs([ALONG, ACROSS, UP]).max(axis=1)
    return bool((away <= NEAR).all() and rotated(here[:3, :3], held.up)[2] >= math.cos(NEAR))


def _free(control: Control, arm: ArmModel, held: Held, named: Array) -> Iterator[Array]:
    """Yield such joint positions, those near the named ones first; no two are alike.

    Solutions are looked for from where the arm is, to which there is often a straight way, and from the named posture.
    """
    targets = _targets(arm, held, arm.solver.chain.fk(named)[0])
    found: list[tuple[Array, Array]] = []
    for first in range(0, len(targets), AT_ONCE):
        part = targets[first : first + AT_ONCE]
        for poses, rows in _ways(control, arm, named, part):
            for pose, q in zip(poses, rows, strict=True):
                known = any(_alike(pose, other) and np.abs(q - p).max() < OTHERWISE for other, p in found)
                if not known and not control.scene.world.self_contacts(_configuration(control, arm, q)):
                    found.append((pose, q))
                    yield q


def _ways(control: Control, arm: ArmModel, named: Array, targets: Array) -> Iterator[tuple[Array, Array]]:
    """Yield which of some targets are reached, and how, begun where the arm is; then begun at the named posture."""
    solved = np.ones(len(targets), bool)
    for begin in (control.arm_joints(arm), named):
        every = np.concatenate([begin[None], arm.seeds])
        joints, good = np.zeros((len(targets), len(named))), np.zeros(len(targets), bool)
        # the arm's own seeds led nowhere before where nothing was solved: they would again
        for some, seeds in ((solved, every), (~solved, every[:1])):
            if some.any():
                joints[some], good[some] = _solved(arm, targets[some], seeds)
        solved = good
        yield targets[good], joints[good]


def _solved(arm: ArmModel, targets: Array, seeds: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Return joint positions (n, d) at targets (n, 4, 4), and which are reached, from the user's cache if kept there.

    Most targets are out of reach, which takes long to find out, and a task that is run again asks for the same ones.
    """
    chain = arm.solver.chain
    facts = (chain.digest, chain.dof, _method(), targets.tobytes(), seeds.tobytes())
    key = hashlib.sha256(repr(facts).encode()).hexdigest()
    content = _CACHE.load(key)
    if content is not None:
        rows = np.frombuffer(content).reshape(len(targets), chain.dof + 1)
        return rows[:, 1:], rows[:, 0] > 0
    joints, good = arm.solver.solve(targets, np.broadcast_to(seeds, (len(targets), *seeds.shape)))
    _CACHE.keep(key, np.column_stack([good, joints]).tobytes())
    return joints, good


@cache
def _method() -> str:
    """Return a digest of what solutions depend on beside the arm and the targets: the code that finds them."""
    digest = hashlib.sha256(casadi.CasadiMeta.version().encode())
    for module in (kinematics, symbolic):
        digest.update(Path(str(module.__file__)).read_bytes())
    return digest.hexdigest()


def _targets(arm: ArmModel, held: Held, there: Array) -> Array:
    """Return tip poses (n, 4, 4) in the base's frame at which what is held is upright, those like ``there`` first."""
    turns = upright(np.asarray(np.arange(HEADINGS) * (2 * math.pi / HEADINGS), np.float64))
    rotations = product(turns, held.pose.rotation.T)
    approach = np.asarray(arm.frame.approach)
    cosines = rotated(rotations, approach) @ rotated(there[:3, :3], approach)
    away = np.arccos(np.clip(cosines, -1.0, 1.0))
    shifts = np.stack(np.meshgrid(ALONG, ACROSS, UP, indexing="ij"), axis=-1).reshape(-1, 3)
    place, turn = (grid.ravel() for grid in np.meshgrid(np.arange(len(shifts)), np.arange(HEADINGS), indexing="ij"))
    cost = np.linalg.norm(shifts, axis=1)[place] + TURN * away[turn]
    order = np.argsort(cost.round(6), kind="stable")
    return rigid(rotations[turn[order]], there[:3, 3] + shifts[place[order]])


def _alike(pose: Array, other: Array) -> bool:
    near = float(np.linalg.norm(pose[:3, 3] - other[:3, 3])) < APART
    return near and float(np.abs(pose[:3, :3] - other[:3, :3]).max()) < 0.5


def _distances(arm: ArmModel, held: Held, q: Array) -> tuple[Array, Array]:
    """Return how far from the axis of the base the farthest joint of the arm is, and the thing's middle, (n,) [m]."""
    chain, tips = arm.solver.chain, arm.solver.chain.fk(q)
    joints = np.linalg.norm(chain.frames(q)[:, :, :2, 3], axis=2).max(axis=1)
    return joints, np.linalg.norm(moved(tips, np.asarray(held.pose.position))[:, :2], axis=1)


def _configuration(control: Control, arm: ArmModel, q: Array) -> Configuration:
    return Configuration(control.base(), dict(zip(arm.joints, map(float, q), strict=True)))
