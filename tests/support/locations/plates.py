"""What a plate measures that is held against a robot: how wide its base is, and where its fingers end."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from contextlib import contextmanager

import numpy as np
import pybullet

from tests.support.locations.oracle import Oracle

PLATE = 4.0
"""Width of the plate, and its distance from what it measures [m]."""
HALF = (PLATE / 20, PLATE / 2, PLATE)
"""Half its extents: along the direction in which it measures, and across it."""
DIRECTIONS, BETWEEN = 90, 0.02
"""Directions in which the base is measured, and by how much it may be narrower between two of them [m]."""


class Plate:
    """A plate in the client of a judge."""

    def __init__(self, oracle: Oracle, uid: int) -> None:
        self._oracle, self._uid = oracle, uid

    def extent(self, links: Iterable[int], origin: Iterable[float], way: Iterable[float]) -> float:
        """Return how far links extend from a point (3,) along a unit vector (3,) [m]."""
        ahead, oracle = np.array([*way]), self._oracle
        slope, heading = -math.asin(float(np.clip(ahead[2], -1.0, 1.0))), math.atan2(ahead[1], ahead[0])
        turn = pybullet.getQuaternionFromEuler((0.0, slope, heading))
        middle = (np.array([*origin]) + PLATE * ahead).tolist()
        pybullet.resetBasePositionAndOrientation(self._uid, middle, turn, physicsClientId=oracle.client)
        points = (
            point
            for link in links
            for point in pybullet.getClosestPoints(
                oracle.uid, self._uid, 2 * PLATE, link, physicsClientId=oracle.client
            )
        )
        return PLATE - HALF[0] - min(point[8] for point in points)


@contextmanager
def held_against(oracle: Oracle) -> Iterator[Plate]:
    """Have a plate in the client of a judge for a while."""
    shape = pybullet.createCollisionShape(pybullet.GEOM_BOX, halfExtents=HALF, physicsClientId=oracle.client)
    plate = pybullet.createMultiBody(0, shape, physicsClientId=oracle.client)
    try:
        yield Plate(oracle, plate)
    finally:
        pybullet.removeBody(plate, physicsClientId=oracle.client)


def least_width(oracle: Oracle) -> float:
    """Return a lower bound of the width of what never moves on a base [m], in the narrowest of its directions."""
    moving = {*oracle.joints.values()}
    still = [link for link in oracle.names if moving.isdisjoint(oracle.upwards(link))]
    oracle.place((0.0, 0.0, 0.0), oracle.posture)
    angles = (np.arange(2 * DIRECTIONS) * math.pi / DIRECTIONS).tolist()
    with held_against(oracle) as plate:
        away = [plate.extent(still, (0.0, 0.0, 0.0), (math.cos(one), math.sin(one), 0.0)) for one in angles]
    return float((np.array(away[:DIRECTIONS]) + np.array(away[DIRECTIONS:])).min()) - BETWEEN


def fingers_ahead(oracle: Oracle, arm: str) -> float:
    """Return how far the ends of an arm's opened fingers are ahead of its grip point [m]; 0 without fingers."""
    part = oracle.robot.arm(arm)
    if part.gripper is None:
        return 0.0
    oracle.place((0.0, 0.0, 0.0), {**oracle.posture, **part.gripper.opened})
    tip = oracle.link(part.tip)
    with held_against(oracle) as plate:
        return plate.extent(oracle.fingers(arm), tip[:3, 3], tip[:3, :3] @ np.array(part.approach))
