"""Things in a robot's hands at the start of a run, placed in the true world and in the belief."""

from __future__ import annotations

from collections.abc import Sequence

from executive.maps import SemanticMap
from executive.maps.in_hand import grip_of, held_by
from executive.modules.platform import Platform
from executive.robots import Robot
from executive.robots.arms import InHand
from planlang.protocols import Configuration
from planlang.state import Hold
from sim import PyBulletWorld, Scene
from sim.mirror import become
from sim.truth import ROBOT


def in_hands(robot: Robot, semantic_map: SemanticMap, scene: Scene) -> tuple[InHand, ...]:
    """Things that the arms of a robot hold at the start of a run, one per arm."""
    held = []
    for arm in robot.arms:
        thing = next(held_by(arm, semantic_map), None)
        body = None if thing is None else next((one for one in scene.bodies if one.iri == thing.iri), None)
        if thing is not None and body is not None:
            held.append(InHand(body, Hold(arm.name, arm.tip, grip_of(arm, thing, semantic_map))))
    return tuple(held)


def take(platform: Platform, truth: PyBulletWorld, held: Sequence[InHand]) -> None:
    """Put things into the robot's hands and close the fingers on them, in the true world and in the belief."""
    state = truth.world_state()
    for one in held:
        scene, name = platform.scene, one.body.name
        arm = next(arm for arm in platform.scene.arms.all if arm.name == one.hold.arm)
        base, q = platform.base(), platform.arm_joints(arm)
        supposed = scene.belief.state.placed({name: scene.world.link_pose(one.hold.link) @ one.hold.offset})
        fingers = scene.supposing(supposed).collisions.closed_on(base, arm, q, name)
        there = Configuration(base, {**state.robots[ROBOT].joints, **(fingers or {})})
        in_hand = truth.link_pose(one.hold.link) @ one.hold.offset
        state = state.with_robot(ROBOT, there).placed({name: in_hand}).gripped(name, one.hold)
        platform.belief.grasped(name, *one.hold)
    if held:
        become(truth, ROBOT, state)
