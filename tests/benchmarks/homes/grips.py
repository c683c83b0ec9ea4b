"""Poses of hands at things and handles, for certificates of the witness; none of the product's grasps is used."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence

import numpy as np

from executive.robots import Arm
from planlang.geometry import Array, Pose
from sim import Body
from tests.benchmarks.homes.nearest import Aim, widths
from tests.support.locations.sampler import BACK, UP, hand_poses

PITCHES = (0.0, 0.4, 0.8, math.pi / 2)
"""Tilts of the hand [rad]."""
SIDE = 0.003
"""Room that is left between fingers on both sides together [m]."""
ENDS = (0.0, 0.01, 0.02, 0.03, 0.045, 0.06, 0.08)
"""Distances by which the grip point stays behind the middle of what is taken [m]: fingers are ahead of it."""
TAKEN = 0.004
"""Length of the fingers beside what they take, at least [m]."""
FOLD = 0.012
"""Depth to which fingers close on what gives way [m]."""
SLANT = 0.5
"""Angle between straight towards a handle and other directions from which a hand comes [rad]."""
RAISED = np.array([0.0, 0.0, 0.01])
"""How much over its middle a tall thing may be taken [m]."""
BAR = 0.06
"""Largest extent of a handle between fingers [m]."""
WELL_IN = 0.6
"""Share of the extents of a thing within which its grip is."""
BACKS, OFF = (BACK, 0.05), 0.015
"""Distances from which a hand comes straight to what it takes, and height by which it lifts what it pulls out [m]."""
RIMS, RIM, ACROSS = 12, (0.002, 0.02, 0.008), 0.5
"""Places around a rim, half the extents of each, and its extent along the rim and down: fingers close across it [m]."""
Hands = Array
"""Poses of a hand (n, k, 4, 4), of which the second is the one that matters."""


class Grips:
    """Poses of the hands of a robot, of which it is known how far ``ahead`` of the grip point their fingers end [m]."""

    def __init__(self, ahead: Mapping[str, float]) -> None:
        self._ahead = ahead

    def at_thing(self, arm: Arm, body: Body, pose: Pose) -> Hands:
        """Return hands (n, 3, 4, 4) between whose fingers a thing fits: before it, at it, above it."""
        room = arm.gripper.max_opening if arm.gripper is not None else 0.0
        found = []
        turns = (np.linspace(0.0, 2 * math.pi, 25)[:-1] + pose.yaw).tolist()
        for pitch, turn in itertools.product(PITCHES, turns):
            side = np.array([-math.sin(turn), math.cos(turn), 0.0])
            ahead = np.array([math.cos(turn) * math.cos(pitch), math.sin(turn) * math.cos(pitch), -math.sin(pitch)])
            width = _extent(body, pose, side)
            grip, deep = np.array(pose.position), _extent(body, pose, ahead) / 2
            if width + SIDE > room and body.wall:
                grip = grip + side * (body.size[0] / 2 - body.wall / 2) + (0.0, 0.0, body.size[2] / 2)
                deep = 0.0
            elif body.soft and pitch == PITCHES[-1]:
                deep = deep + TAKEN - FOLD
            elif width + SIDE > room:
                continue
            for behind in ENDS:
                if not behind or behind <= self._ahead[arm.name] + deep - TAKEN:
                    found.append(_lifted(arm, grip - behind * ahead, ahead, side))
            if body.size[2] > 0.05:
                found.append(_lifted(arm, grip + RAISED, ahead, side))
        return np.array(found).reshape(-1, 3, 4, 4)

    def ahead(self, arm: Arm) -> float:
        """Return how far ahead of the grip point an arm's fingers end [m]."""
        return self._ahead[arm.name]

    def aims(self, body: Body, poses: Sequence[Pose]) -> list[Aim]:
        """Return what a hand gets to that takes a body at one of some poses: its middle, and its rim if it has one.

        Of each pose an aim has as many boxes as of any other.
        """
        found = [Aim(poses, np.array(body.size) / 2 * WELL_IN, None, body.size, body.shape)]
        if body.wall and body.shape == "cylinder" and body.hands == 1:
            turns = np.linspace(0.0, 2 * math.pi, RIMS + 1)[:-1].tolist()
            out, up = (body.size[0] - body.wall) / 2, body.size[2] / 2
            there = [Pose.planar(out * math.cos(one), out * math.sin(one), one, up) for one in turns]
            rims = [pose @ rim for pose in poses for rim in there]
            found.append(Aim(rims, np.array(RIM), None, (body.wall, ACROSS, ACROSS), "box"))
        return found

    def from_tip(self, arm: Arm, tip: Array, aim: Aim | None, pose: Pose, *, lifts: bool) -> list[Hands]:
        """Return hands (k, 4, 4) that take an aim's box from a tip's pose: before it, at it, and where it brings it.

        It comes from near or far, and lifts, or pulls out what it takes. Nothing if it does not fit between the
        fingers.
        """
        if aim is not None and aim.between is not None:
            room = arm.gripper.max_opening if arm.gripper is not None else 0.0
            closing = tip[:3, :3] @ np.array(arm.closing)
            width = widths(aim.whole, aim.between, pose.rotation[None], closing[None])[0][0]
            if width + SIDE > min(room, aim.room):
                return []
        approach = tip[:3, :3] @ np.array(arm.approach)
        before = [_shifted(tip, -back * approach) for back in BACKS]
        if not lifts:
            return [np.array([one, tip]) for one in before]
        over = (_shifted(tip, np.array([0.0, 0.0, UP])), _shifted(tip, (0.0, 0.0, OFF) - BACK * approach))
        return [np.array([one, tip, other]) for one in before for other in over]

    def at_bar(self, arm: Arm, pose: Pose, size: Sequence[float], ways: Sequence[Array]) -> Hands:
        """Return hands (n, 2, 4, 4) that come in some directions (3,) to a bar, and close around it."""
        every = np.concatenate([around(arm, np.array(pose.position), way, ENDS[:4]) for way in ways])
        closing = every[:, 1, :3, :3] @ np.array(arm.closing)
        widths = np.abs(closing @ pose.rotation) @ np.array(size)
        room = arm.gripper.max_opening if arm.gripper is not None else 0.0
        return every[widths < min(room, BAR)]

    def sides_for_two(self, body: Body, pose: Pose) -> list[tuple[Pose, tuple[float, float, float], list[Array]]]:
        """Return where each of two hands takes a thing: poses, extents and directions; its handles, else its edges."""
        down = np.array([0.0, 0.0, -1.0])
        if body.handles:
            places = [(pose @ one.pose, one.size) for one in body.handles]
        else:
            x, y, z = body.size
            thin = body.wall or z
            edges = [((sign * (x - thin) / 2, 0.0, 0.0), (thin, 0.04, z)) for sign in (1.0, -1.0)]
            edges += [((0.0, sign * (y - thin) / 2, 0.0), (0.04, thin, z)) for sign in (1.0, -1.0)]
            places = [(pose @ Pose(at), size) for at, size in edges]
        found = []
        for place, size in places:
            inward = np.array(pose.position) - np.array(place.position)
            inward[2] = 0.0
            straight = inward / max(float(np.linalg.norm(inward)), 1e-9)
            slanting = (straight + down) / math.sqrt(2.0)
            found.append((place, size, [straight, down, slanting]))
        return found


def around(arm: Arm, point: Array, ahead: Array, short: Sequence[float] = (0.0,)) -> Hands:
    """Return hands (n, 2, 4, 4) that come along a direction (3,) to a point, or short of it, turned about it."""
    side = np.cross(ahead, (0.0, 0.0, 1.0)) if abs(ahead[2]) < 0.9 else np.array([1.0, 0.0, 0.0])
    side = side / np.linalg.norm(side)
    found = []
    for angle in np.linspace(0.0, 2 * math.pi, 9)[:-1].tolist():
        closing = math.cos(angle) * side + math.sin(angle) * np.cross(ahead, side)
        ends = [point - away * ahead for away in short]
        found += [hand_poses(arm, [end - BACK * ahead, end], ahead, closing) for end in ends]
    return np.array(found)


def slants(ahead: Array) -> list[Array]:
    """Return a level direction (3,) and others that slant from it: from above, from below, from either side."""
    up = np.array([0.0, 0.0, 1.0])
    side = np.cross(up, ahead)
    turned = (math.cos(SLANT) * ahead + math.sin(SLANT) * sign * one for one in (up, side) for sign in (-1.0, 1.0))
    return [ahead, *turned]


def _extent(body: Body, pose: Pose, way: Array) -> float:
    """Return how long a body is along a direction (3,)."""
    return float(widths(body.shape, body.size, pose.rotation[None], way[None])[0][0])


def _shifted(tip: Array, by: Array) -> Array:
    there = tip.copy()
    there[:3, 3] += by
    return there


def _lifted(arm: Arm, grip: Array, ahead: Array, side: Array) -> Array:
    """Return a hand (3, 4, 4) before a point, at it and above it."""
    return hand_poses(arm, [grip - BACK * ahead, grip, grip + UP * RAISED / RAISED[2]], ahead, side)
