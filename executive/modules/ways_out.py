"""Ways out of shallow penetrations: short motions of an arm or the base to where they are free.

What is believed and what is seen are a little wrong, so that a robot at rest may seem to be in what it only touches.
From there no path is planned; first it goes a little way to where it is in nothing, and on that way it is in no more
than before. Whatever is really there stops it, and is felt.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

import numpy as np

from executive.locations.base_poses import BasePoses
from executive.modules.platform import Platform
from executive.robots.arms import ArmModel
from planlang.geometry import Array
from planlang.protocols import Contact, Trajectory

SHALLOW = 0.03
"""Depth up to which a penetration is taken for an error of the belief [m]."""
REACHES = (1, 2, 4, 8)
"""Lengths of an arm's ways, in steps of the resolution at which its motions are checked."""
DIRECTIONS = 24
"""Directions of an arm's joints that are tried at each length, besides those of single joints."""
DISTANCES = (0.02, 0.04, 0.08, 0.12)
"""Lengths of the base's ways [m]."""
CHECKS = 0.01
"""Distance of the poses of the base that are checked [m]."""

Contacts = Callable[[Array], tuple[Contact, ...]]


def way_out_of_arm(platform: Platform, arm: ArmModel, touches: str | None) -> Trajectory | None:
    """Return a short motion by which an arm gets out of what it is in; None if there is none, or it is deep in."""
    start, collisions, base = platform.arm_joints(arm), platform.scene.collisions, platform.base()

    def contacts(q: Array) -> tuple[Contact, ...]:
        return collisions.contacts(base, arm, q, touches)

    def ends() -> Iterator[Array]:
        random = np.random.default_rng(0)
        single = np.concatenate([np.eye(len(start)), -np.eye(len(start))])
        for reach in REACHES:
            drawn = random.normal(size=(DIRECTIONS, len(start)))
            for way in (*single, *(drawn / np.abs(drawn).max(axis=1)[:, None])):
                q = start + reach * arm.resolution * way
                if arm.solver.chain.within(q[None], 1e-6).all():
                    yield q

    end = _first_free(start, ends(), contacts, lambda a, b: int(np.ceil(np.abs((b - a) / arm.resolution).max() * 2)))
    return None if end is None else platform.timed(arm.joints, np.stack([start, end]))


def way_out_of_base(platform: Platform) -> Trajectory | None:
    """Return a short motion by which the base gets out of what the robot is in; None as for an arm."""
    start, poses = np.array(platform.base()), BasePoses(platform.scene)
    if platform.robot.base.fixed:
        return None

    def contacts(pose: Array) -> tuple[Contact, ...]:
        x, y, yaw = map(float, pose)
        return platform.scene.collisions.contacts((x, y, yaw))

    ends = map(np.array, poses.beside(float(start[2]), DISTANCES))
    end = _first_free(start, ends, contacts, lambda a, b: int(np.ceil(math.dist(a[:2], b[:2]) / CHECKS)))
    return None if end is None else platform.drive.timed(np.stack([start, end]))


def _first_free(
    start: Array, ends: Iterator[Array], contacts: Contacts, pieces: Callable[[Array, Array], int]
) -> Array | None:
    """Return the first end that is free, on the way to which there is nothing that is not in the way at the start."""
    now = contacts(start)
    if not now or max(contact.depth for contact in now) > SHALLOW:
        return None
    pairs = {(contact.part, contact.body) for contact in now}
    for end in ends:
        if contacts(end):
            continue
        shares = np.linspace(0.0, 1.0, pieces(start, end) + 1)[1:-1]
        met = ((one.part, one.body) for share in shares for one in contacts(start + share * (end - start)))
        if pairs.issuperset(met):
            return end
    return None
