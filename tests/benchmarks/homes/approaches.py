"""What the hands of a robot nearly do in a scene: what none of them nearly does is impossible.

It errs to the side of possible: a grip holds what is within a finger's breadth of it, of the base there is its core
until contacts are looked at, and doors, people, other arms and what can be set aside are not in the way.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping

import numpy as np

from planlang.geometry import Array, Pose
from sim import Body, Scene
from sim.joints import Articulation, JointKind
from tests.benchmarks.homes.certificates import areas, between, carries, joint_of, outward
from tests.benchmarks.homes.floor import Floor, stays
from tests.benchmarks.homes.grips import Grips
from tests.benchmarks.homes.nearest import MET, Aim, Nearest
from tests.benchmarks.homes.tasks import Need
from tests.support.locations.dense_sampler import Joints
from tests.support.locations.oracle import Oracle

GROWN = 0.01
"""By how much what is taken is larger: fingers are not lines, and feel what is so near [m]."""
BEHIND = 0.05
"""Length of the fingers behind the grip point that may hold, too [m]."""
LEANING = 0.5
"""Largest share of a radius by which fingers are off the middle of what is round: opposite sides face each other."""
NEARLY = 0.005
"""What may remain where something counts as possible [m]."""
DEPTH = -0.001
"""How far something is pressed into something else before it counts [m]."""
ROUNDS = 12
"""Sets of postures that are begun from before something counts as impossible."""
VALUES = 9
"""Openings of a drawer that are looked at."""
BUTTON = 0.01
"""Half the extents of the place that is pressed, at least [m]."""


class Approaches:
    """The hands of a robot in a scene."""

    def __init__(self, oracle: Oracle, chains: Mapping[str, Joints], scene: Scene, floor: Floor, grips: Grips) -> None:
        self._oracle, self._scene = oracle, scene
        self._nearest = {
            arm.name: Nearest(oracle, chains[arm.name], arm, floor, (-BEHIND, grips.ahead(arm)))
            for arm in oracle.robot.arms
        }
        slides = {name for joint in scene.joints if is_drawer(joint) for name in joint.bodies}
        self._solid = {body.name for body in scene.bodies if stays(scene, body)} | slides

    def remains(self, aims: Mapping[str, Aim], joint: Articulation | None) -> float:
        """Return how far all hands stay from aims at targets [m]; with several boxes a joint brings them there.

        It is ``MET`` or more if nothing is near even without contacts.
        """
        least = np.inf
        solid = self._solid | ({*joint.bodies} if joint else set())
        for seed, (target, aim), arm in itertools.product(range(ROUNDS), aims.items(), self._oracle.robot.arms):
            nearest, hand = self._nearest[arm.name], self._oracle.hand_links(arm.name)
            found = nearest.postures(aim, seed)
            if found is None:
                continue
            least = min(least, max(float(found.left[0]), MET))

            def may(link: int, body: str, hand: frozenset[int] = hand, target: str = target) -> bool:
                return body not in solid or (body == target and link in hand)

            def prepare(number: int, aim: Aim = aim) -> None:
                if joint and len(aim.poses) > 1:
                    self._put(joint, joint.upper * number / (len(aim.poses) - 1))

            try:
                for left, *_ in nearest.yielded(aim, found, prepare, may, DEPTH):
                    least = min(least, left)
                    if least < NEARLY:
                        return least
            finally:
                prepare(0)
        return least

    def aims(self, need: Need) -> tuple[dict[str, Aim], Articulation | None] | None:
        """Return what a hand takes for a need, by the body, and the joint that brings it; None if nothing is known."""
        scene = self._scene
        body = scene.body(need.thing)
        match need.kind:
            case "grasp":
                joint = next((one for one in scene.joints if is_drawer(one) and carries(scene, one.leaf, body)), None)
                return {body.name: Aim(_along(joint, body.pose), _held(body) + GROWN, None, between(body))}, joint
            case "open":
                joint = joint_of(scene, need.thing)
                if joint.first > joint.last_shut or need.either:
                    return None
                handles = map(scene.body, joint.handles or (joint.leaf,))
                leaf = scene.body(joint.leaf)
                return {
                    one.name: Aim(
                        [one.pose], np.array(one.size) / 2 + GROWN, outward(joint, leaf, leaf.pose, one.pose), one.size
                    )
                    for one in handles
                }, joint
            case "press":
                half = np.maximum(np.array(body.size) / 2, BUTTON) + GROWN
                return {body.name: Aim([body.pose], half, body.pose.rotation[:, 0])}, None
            case "place" if not scene.body(need.at).graspable:
                joint = next((one for one in scene.joints if one.leaf == need.at and is_drawer(one)), None)
                places = {}
                for number, (frame, (x, y), _) in enumerate(areas(scene, need.at, {})):
                    middle = frame @ Pose((0.0, 0.0, body.size[2] / 2))
                    half = np.array([x, y, body.size[2]]) / 2 + GROWN
                    places[f"{body.name} {number}"] = Aim(_along(joint, middle), half)
                return places, joint
        return None

    def _put(self, joint: Articulation, value: float) -> None:
        for name in joint.bodies:
            self._oracle.move(name, joint.motion(value) @ self._scene.body(name).pose)


def _along(joint: Articulation | None, pose: Pose) -> list[Pose]:
    """Return where a drawer brings something."""
    if joint is None:
        return [pose]
    return [joint.motion(value) @ pose for value in np.linspace(0.0, joint.upper, VALUES).tolist()]


def _held(body: Body) -> Array:
    """Return half the extents (3,) of where a grip holds a body: near the middle of what stands and is round."""
    half = np.array(body.size) / 2
    if body.shape == "cylinder" and not body.wall and not body.handles and abs(body.pose.rotation[2, 2]) > 0.99:
        half[:2] *= LEANING
    return half


def is_drawer(joint: Articulation) -> bool:
    """Return True for a joint of furniture that slides."""
    return joint.kind is JointKind.PRISMATIC and not joint.frame
