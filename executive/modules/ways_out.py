"""Escapes from shallow penetrations: short motions of an arm or the base to a collision-free configuration.

Beliefs and camera poses are slightly wrong, so a robot at rest may seem to penetrate what it only touches. No path can
be planned from a start in collision. An escape adds no new contact pair on its way; if something is really there, the
robot feels it and stops.
"""

from __future__ import annotations

import math
from collections.abc import Awaitable, Callable, Iterator

import numpy as np

from executive.locations.standing import Standing
from executive.modules.platform import Platform
from executive.motion import StartInCollision
from executive.robots.arms import ArmModel
from planlang.failures import PlanFailure
from planlang.geometry import Array
from planlang.protocols import Contact, Trajectory

SHALLOW = 0.03
"""Depth up to which a penetration counts as an error of the belief [m]."""
REACHES = (1, 2, 4, 8)
"""Lengths of an arm's escapes, in steps of its collision-checking resolution."""
DIRECTIONS = 24
"""Random joint-space directions tried at each length, besides those of single joints."""
DISTANCES = (0.02, 0.04, 0.08, 0.12)
"""Lengths of the base's escapes [m]."""
CHECKS = 0.01
"""Spacing of collision checks along an escape of the base [m]."""

Contacts = Callable[[Array], tuple[Contact, ...]]


async def planned(
    plan: Callable[[], Awaitable[Trajectory]],
    way_out: Callable[[], Trajectory | None],
    follow: Callable[[Trajectory], Awaitable[object]],
) -> Trajectory:
    """Plan a motion. One that would start in collision is planned after an escape from there, if there is one."""
    try:
        return await plan()
    except PlanFailure as stuck:
        out = way_out() if isinstance(stuck.__cause__, StartInCollision) else None
        if out is None:
            raise
    await follow(out)
    return await plan()


def way_out_of_arm(platform: Platform, arm: ArmModel, touches: str | None) -> Trajectory | None:
    """Find a short motion that takes an arm out of collision; None if there is none, or the penetration is deep.

    ``touches``: the body that the hand may touch.
    """
    start, collisions, base = platform.arm_joints(arm), platform.scene.collisions, platform.base()

    def contacts(q: Array) -> tuple[Contact, ...]:
        return collisions.contacts(base, arm, q, touches)

    def ends() -> Iterator[Array]:
        random = np.random.default_rng(0)
        single = np.concatenate([np.eye(len(start)), -np.eye(len(start))])
        for reach in REACHES:
            drawn = random.normal(size=(DIRECTIONS, len(start)))
            for direction in (*single, *(drawn / np.abs(drawn).max(axis=1)[:, None])):
                q = start + reach * arm.resolution * direction
                if arm.chain.within(q[None], 1e-6).all():
                    yield q

    end = _first_free(start, ends(), contacts, lambda a, b: int(np.ceil(np.abs((b - a) / arm.resolution).max() * 2)))
    return None if end is None else platform.timed(arm.joints, np.stack([start, end]))


def way_out_of_base(platform: Platform) -> Trajectory | None:
    """Find a short motion of the base that takes the robot out of collision; None as for an arm."""
    start, poses = np.array(platform.base()), Standing(platform.scene)
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
    """Find the first collision-free end that a straight line reaches without contact pairs other than the start's."""
    # What overlaps at the start may overlap on, as long as it ends free: the belief is wrong there, not the robot. A
    # pair that is new on the way would be a real collision.
    at_start = contacts(start)
    if not at_start or max(contact.depth for contact in at_start) > SHALLOW:
        return None
    pairs = {(contact.part, contact.body) for contact in at_start}
    for end in ends:
        if contacts(end):
            continue
        shares = np.linspace(0.0, 1.0, pieces(start, end) + 1)[1:-1]
        touched = ((one.part, one.body) for share in shares for one in contacts(start + share * (end - start)))
        if pairs.issuperset(touched):
            return end
    return None
