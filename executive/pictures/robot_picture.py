"""Pictures of a robot by itself: its body with the frames of hands and camera, and each hand with open fingers.

An arrow on the floor in front of the body points forward.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace

import numpy as np

from executive.pictures.drawn import Shape, drawn_in
from executive.pictures.modelling import Model, joined, model_of
from executive.pictures.rendering import Image, rendered
from executive.pictures.scene_picture import shadow_sphere
from executive.pictures.viewpoints import fitting
from executive.robots import Arm, Robot
from planlang.geometry import Array, Pose
from planlang.geometry.matrices import moved
from planlang.geometry.shapes import SolidKind
from planlang.protocols import Configuration
from sim import PlanningWorld, WorldMirror

RED, GREEN, BLUE = (205, 70, 60, 255), (70, 150, 75, 255), (65, 100, 200, 255)
"""Colours of the x, y and z axes of a frame."""
FINGER, SIGHT = (235, 150, 60, 255), (120, 90, 170, 255)
"""Colours of fingers, and of the edges of what the camera sees."""
FORWARD = (30, 30, 30, 255)
"""Colour of the arrow that points forward."""
ARROW, BARB = 0.35, 0.12
"""Length of that arrow, from the edge of the base on, and of its barbs along and across it [m]."""
AXIS, THICK = 0.2, 0.012
"""Length and thickness of the axes of a frame [m]; in a hand's picture a third of that."""
SEEN = 0.6
"""Length of the edges of the camera's view [m]."""
ASIDE, ABOVE = math.radians(35), math.radians(18)
"""Direction from which the robot is seen: to its left of straight ahead, and above level."""
HAND_ASIDE, HAND_ABOVE = math.radians(25), math.radians(50)
"""The same for a hand: from its approach towards its side, and out of the plane of its fingers."""
LEAST = 0.05
"""Half the least height that a picture shows [m]."""
ORIGIN = (0.0, 0.0, 0.0)


def robot_picture(robot: Robot, world: PlanningWorld, size: tuple[int, int]) -> Image:
    """Render a robot in its current posture, with the frames of base, tips and camera: a picture (height, width, 3).

    An arrow points forward.
    """
    models, arrow = list(_models(robot, world, ())), _arrow(robot.base.radius)
    points = np.concatenate([joined(models).vertices, arrow.vertices])
    away = np.array([math.cos(ASIDE) * math.cos(ABOVE), math.sin(ASIDE) * math.cos(ABOVE), math.sin(ABOVE)])
    frames = [arrow, _frame(Pose(ORIGIN), AXIS), *(_frame(world.link_pose(arm.tip), AXIS / 2) for arm in robot.arms)]
    if robot.camera is not None:
        frames += [_frame(world.link_pose(robot.camera.link), AXIS / 2), _sight(robot, world)]
    return _rendered([*models, *frames], points, -away, size)


def hand_picture(robot: Robot, arm: Arm, world: PlanningWorld, size: tuple[int, int]) -> Image:
    """Render the open hand of an arm, its fingers in orange, with the frame of its tip and a line between its fingers.

    The robot is left with this hand open.
    """
    links = _links_of_hand(arm, world)
    if arm.gripper is not None:
        joints = world.configuration().joints
        opened = {name: arm.gripper.opened.get(name, value) for name, value in joints.items()}
        state = world.world_state(robot.name).with_robot(robot.name, Configuration(ORIGIN, opened))
        world = WorldMirror(world, robot.name).at(state)
    fingers = frozenset(arm.gripper.finger_links) if arm.gripper is not None else frozenset[str]()
    models = list(_models(robot, world, fingers, links))
    tip = world.link_pose(arm.tip)
    axes = tip.rotation
    approach, closing = axes @ np.asarray(arm.approach), axes @ np.asarray(arm.closing)
    third = np.cross(approach, closing)
    points = np.concatenate([joined(models).vertices, np.array([tip.position])])
    level = math.cos(HAND_ASIDE) * third + math.sin(HAND_ASIDE) * closing
    away = math.cos(HAND_ABOVE) * approach + math.sin(HAND_ABOVE) * level
    frames = [_frame(tip, AXIS / 3)]
    if arm.gripper is not None and arm.gripper.max_opening > 0:
        half = arm.gripper.max_opening / 2 * closing
        at = np.asarray(tip.position)
        frames.append(_line(at - half, at + half, THICK / 4, SIGHT))
    return _rendered([*models, *frames], points, -away, size)


def _links_of_hand(arm: Arm, world: PlanningWorld) -> frozenset[str]:
    """List the links of the hand of an arm, with those that hang from it and have a look but no collision shape."""
    hand = world.robot.hand_of(arm.tip)
    carriers = {link: world.robot.carrier(link) for link in world.robot.links}
    return frozenset(link for link, carrier in carriers.items() if carrier and carrier <= hand)


def _models(
    robot: Robot, world: PlanningWorld, fingers: Collection[str], links: Collection[str] | None = None
) -> Iterator[Model]:
    """Yield the links of a robot in the map, or only some; fingers of its hands in a colour of their own."""
    painted = fingers or {link for arm in robot.arms if arm.gripper for link in arm.gripper.finger_links}
    for number, drawn in enumerate(drawn_in(world)):
        link = drawn.path[-1]
        if links is None or link in links:
            shapes = [replace(shape, colour=FINGER) for shape in drawn.shapes] if link in painted else drawn.shapes
            yield model_of(shapes, 100 * number).at(drawn.pose())


def _rendered(models: Sequence[Model], points: Array, ahead: Array, size: tuple[int, int]) -> Image:
    """Render models from a direction (3,), so that points (n, 3) fill the picture."""
    view = fitting(points, ahead, size[0] / size[1], least=LEAST)
    return rendered(models, view, size, shadow_sphere(view))


def _frame(pose: Pose, length: float) -> Model:
    """Model a frame as three rods from its origin."""
    at, axes = np.asarray(pose.position), pose.rotation
    thick = THICK * length / AXIS
    rods = [_line(at, at + length * axes[:, k], thick, colour) for k, colour in enumerate((RED, GREEN, BLUE))]
    return joined(rods)


def _arrow(radius: float) -> Model:
    """Model an arrow on the floor from the edge of a base of a radius [m] forward, along x."""
    tip = np.array([radius + ARROW, 0.0, THICK / 2])
    barbs = [tip + np.array([-BARB, side * BARB, 0.0]) for side in (1.0, -1.0)]
    ends = [(np.array([radius, 0.0, THICK / 2]), tip), *((barb, tip) for barb in barbs)]
    return joined([_line(start, end, THICK, FORWARD) for start, end in ends])


def _line(start: Array, end: Array, thick: float, colour: tuple[int, int, int, int]) -> Model:
    """Model a line as a thin cylinder."""
    along, length = end - start, float(np.linalg.norm(end - start))
    z = along / length
    x = np.cross(z, np.eye(3)[int(np.abs(z).argmin())])
    x /= np.linalg.norm(x)
    turn = np.eye(4)
    turn[:3, :3], turn[:3, 3] = np.column_stack([x, np.cross(z, x), z]), (start + end) / 2
    return model_of([Shape(SolidKind.CYLINDER, (thick, thick, length), Pose.from_matrix(turn), colour)], 1_000_000)


def _sight(robot: Robot, world: PlanningWorld) -> Model:
    """Model the edges of what the camera sees."""
    camera = robot.camera
    assert camera is not None
    forward, up = np.asarray(camera.forward), np.asarray(camera.up)
    wide = math.tan(camera.fov / 2)
    high = wide * camera.height / camera.width
    aside = np.cross(forward, up)
    corners = np.array([forward + a * wide * aside + b * high * up for a, b in ((1, 1), (1, -1), (-1, -1), (-1, 1))])
    at = world.link_pose(camera.link).matrix()
    ends = moved(at, SEEN * corners / np.linalg.norm(corners, axis=1)[:, None])
    rim = zip(ends, np.roll(ends, -1, axis=0), strict=True)
    return joined([_line(a, b, THICK / 3, SIGHT) for a, b in [*((at[:3, 3], end) for end in ends), *rim]])
