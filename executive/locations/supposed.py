"""States to which actions lead, as far as later steps depend on them: where the base stands, and what a hand holds."""

from __future__ import annotations

from dataclasses import replace

from executive.belief.planning_scene import PlanningScene
from executive.belief.scene_collisions import BasePose
from executive.locations.hand_solutions import HandSolution
from executive.robots import CARRYING
from planlang.geometry import Pose
from planlang.protocols import Configuration
from planlang.state import Hold, WorldState


def at_rest(scene: PlanningScene, state: WorldState, base: BasePose) -> WorldState:
    """Make the state that differs from another by the base's pose, and by empty arms in their carrying posture."""
    robot = scene.belief.robot
    posture = scene.robot.postures.get(CARRYING, {})
    empty = {name for arm in scene.arms.all if scene.arms.held(arm.name) is None for name in arm.joints}
    tucked = {name: value for name, value in posture.items() if name in empty}
    return state.with_robot(robot, Configuration(base, {**state.robots[robot].joints, **tucked}))


def with_in_hand(scene: PlanningScene, state: WorldState, grasp: HandSolution) -> WorldState:
    """Make the state in which a hand has grasped a thing as a solution says, and has brought it to the base."""
    arm, thing = grasp.arm, grasp.reach.body
    offset = Pose.from_matrix(grasp.plan.poses[min(1, len(grasp.plan.poses) - 1)]).inverse() @ scene.bodies.pose(thing)
    return replace(state.gripped(thing, Hold(arm.name, arm.tip, offset)), led={})
