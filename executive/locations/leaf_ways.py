"""The space that doors and drawers need which later steps move: where they go, and where a hand is at their handles."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator

import numpy as np

from executive.belief.planning_scene import PlanningScene
from executive.locations.demands import ThingDemand, bodies_in
from executive.motion.clearance import Boxes
from planlang.designators import Action
from planlang.geometry import Pose
from sim import Body
from sim.joints import Articulation, JointKind

SPACING = {JointKind.HINGED: 0.15, JointKind.PRISMATIC: 0.08}
"""Spacing of the values at which to look at a leaf [rad, m]: small enough that no cup fits in between."""
HAND = 0.05
"""Room that a hand needs around a handle, to each side [m]."""
BEFORE = 0.25
"""The same before the handle, from where the hand comes [m]."""

Box = tuple[Pose, tuple[float, float, float]]
"""Pose in the map, and extents [m]."""


def leaves_used(actions: Iterable[Action], scene: PlanningScene) -> tuple[str, ...]:
    """List the doors and drawers that actions move, or behind or in which they take or put something."""
    joints, bodies = scene.belief.joints, scene.bodies
    if not joints:
        return ()
    names = bodies_in(actions, scene)
    used = {leaf for leaf, one in joints.items() if not names.isdisjoint((*one.bodies, one.holder))}
    for name in names - used:
        if not bodies.is_held(name) and not bodies.is_room(name):
            drawer, door = bodies.drawer_of(name), bodies.closed_before(name)
            used |= {*(() if drawer is None else (drawer.leaf,)), *(() if door is None else (door,))}
    return tuple(leaf for leaf, one in joints.items() if leaf in used and not one.is_knob)


def ways_of(demand: ThingDemand, scene: PlanningScene) -> Boxes:
    """Collect boxes around where leaves go that a demand wants to be clear, and around hands at their handles.

    What is put into a drawer, or onto a lid, moves along, and is in no way of these.
    """
    boxes = list[Box]()
    for joint in (scene.belief.joints[leaf] for leaf in demand.clear):
        within = (*joint.bodies, joint.holder) if joint.kind is JointKind.PRISMATIC else joint.bodies
        if demand.inside not in within and demand.on not in joint.bodies:
            boxes += _way_of(joint, scene)
    return Boxes.around([pose for pose, _ in boxes], [size for _, size in boxes])


def _way_of(joint: Articulation, scene: PlanningScene) -> Iterator[Box]:
    """Yield boxes around a leaf and its parts, from closed to open, and around hands at its handles."""
    body = scene.world.scene.body
    hands = [_at_handle(joint, body(joint.leaf), body(handle)) for handle in joint.handles]
    closed = [*((body(name).pose, body(name).size) for name in joint.bodies), *hands]
    for value in np.linspace(0.0, joint.upper, math.ceil(joint.upper / SPACING[joint.kind]) + 1).tolist():
        motion = joint.motion(value)
        yield from ((motion @ pose, size) for pose, size in closed)


def _at_handle(joint: Articulation, leaf: Body, handle: Body) -> Box:
    """Make the box of a hand at a handle and before it, with the leaf closed."""
    local = leaf.pose.inverse() @ handle.pose
    middle, half = np.array(local.position), np.abs(local.rotation) @ np.array(handle.size) / 2 + HAND
    out = leaf.pose.rotation.T @ np.array(joint.axis) if joint.kind is JointKind.PRISMATIC else middle
    normal = int(np.abs(out).argmax()) if joint.kind is JointKind.PRISMATIC else int(np.argmin(leaf.size))
    half[normal] += BEFORE / 2
    middle[normal] += math.copysign(BEFORE / 2, out[normal])
    (x, y, z), (depth, width, height) = middle.tolist(), (2 * half).tolist()
    return leaf.pose @ Pose((x, y, z)), (depth, width, height)
