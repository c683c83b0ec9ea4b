"""Things in a robot's hands at the start of a run, placed in the true world and in the belief."""

from __future__ import annotations

from collections.abc import Sequence

from executive.maps import SemanticMap
from executive.maps.in_hand import grip_of, held_by
from executive.modules.platform import Platform
from executive.robots import Robot
from planlang.geometry import Pose
from planlang.protocols import Configuration
from planlang.records import dataclass
from planlang.state import Hold
from sim import Body, PyBulletWorld, Scene
from sim.truth import ROBOT


@dataclass(frozen=True, slots=True)
class InHand:
    """Thing in a hand: the arm, the link that holds it, the body, and its pose in the frame of the link."""

    arm: str
    link: str
    body: Body
    offset: Pose


def in_hands(robot: Robot, semantic_map: SemanticMap, scene: Scene) -> tuple[InHand, ...]:
    """Things that the arms of a robot hold at the start of a run, one per arm."""
    held = []
    for arm in robot.arms:
        thing = next(held_by(arm, semantic_map), None)
        body = None if thing is None else next((one for one in scene.bodies if one.iri == thing.iri), None)
        if thing is not None and body is not None:
            held.append(InHand(arm.name, arm.tip, body, grip_of(arm, thing, semantic_map)))
    return tuple(held)


def take(platform: Platform, truth: PyBulletWorld, held: Sequence[InHand]) -> None:
    """Put things into the robot's hands and close the fingers on them, in the true world and in the belief."""
    state = truth.world_state()
    for one in held:
        scene, name = platform.scene, one.body.name
        arm = next(arm for arm in platform.scene.arms.all if arm.name == one.arm)
        base, q = platform.base(), platform.arm_joints(arm)
        in_hand = scene.belief.state.placed({name: scene.world.link_pose(one.link) @ one.offset})
        fingers = scene.supposing(in_hand).collisions.closed_on(base, arm, q, name)
        there = Configuration(base, {**state.robots[ROBOT].joints, **(fingers or {})})
        state = state.with_robot(ROBOT, there).gripped(name, Hold(one.arm, one.link, one.offset))
        platform.belief.grasped(name, one.arm, one.link, one.offset)
    if held:
        truth.begin(state)
