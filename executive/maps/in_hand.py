"""Objects in a robot's hand when a run begins: the map links them to the hand by a kinematic chain.

Maps do not state the grasp, so it is assumed. A tool with a blade points along the approach axis, its blade's normal
perpendicular to the closing axis, and is held :data:`BEHIND` its blade. Other objects are held at their centre, with
their z axis perpendicular to both axes.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from executive.maps.classes import MapObject
from executive.maps.object_models import Blade
from executive.maps.semantic_map import IN_HAND, SemanticMap
from executive.robots import Arm, Robot
from planlang.designators import local_name
from planlang.geometry import Array, Pose
from planlang.geometry.matrices import product, rotated
from planlang.state import Hold
from sim import Scene

BEHIND = 0.3
"""Distance of the hand behind the centre of a tool's blade [m]."""
STOWED = Pose((0.0, 0.0, -100.0))
"""Pose of such objects until the robot is in the world: far below everything."""


def is_in_hand(thing: MapObject, semantic_map: SemanticMap) -> bool:
    """Check whether the map links an object to a robot."""
    return bool(_links(thing, semantic_map))


def in_hands(robot: Robot, semantic_map: SemanticMap, scene: Scene) -> dict[str, Hold]:
    """Holds of the things that a robot's arms have when a run begins, one per arm, by the body's name."""
    held = {}
    for arm in robot.arms:
        thing = next(_held_by(arm, semantic_map), None)
        body = None if thing is None else next((one for one in scene.bodies if one.iri == thing.iri), None)
        if thing is not None and body is not None:
            held[body.name] = Hold(arm.name, arm.tip, grip_of(arm, thing, semantic_map))
    return held


def _held_by(arm: Arm, semantic_map: SemanticMap) -> Iterator[MapObject]:
    """Yield the objects that an arm holds when a run begins: those linked to its hand or tip, by the link's name."""
    ends = (arm.hand_link, arm.tip)
    for thing in semantic_map.objects:
        names = _links(thing, semantic_map)
        if any(name == end or name.endswith(f"_{end}") for name in names for end in ends):
            yield thing


def _links(thing: MapObject, semantic_map: SemanticMap) -> list[str]:
    values = semantic_map.ontology.values(thing.iri, IN_HAND)
    return [local_name(one) for one in values if isinstance(one, str)]


def grip_of(arm: Arm, thing: MapObject, semantic_map: SemanticMap) -> Pose:
    """Assume the pose of an object in the tip frame of the arm that holds it."""
    approach, closing = np.array(arm.approach), np.array(arm.closing)
    across = np.cross(approach, closing)
    blade = Blade.of(semantic_map.ontology, thing.iri)
    pose = np.eye(4)
    if blade is None:
        pose[:3, :3] = np.column_stack([approach, closing, across])
        return Pose.from_matrix(pose)
    ahead = blade.ahead / np.linalg.norm(blade.ahead)
    in_tip, in_tool = _axes(approach, across), _axes(ahead, blade.normal)
    pose[:3, :3] = product(in_tip, in_tool.T)
    pose[:3, 3] = BEHIND * approach - rotated(pose[:3, :3], blade.position)
    return Pose.from_matrix(pose)


def _axes(first: Array, second: Array) -> Array:
    """Rotation (3, 3) whose columns are two orthogonal unit vectors and their cross product."""
    return np.column_stack([first, second, np.cross(first, second)])
