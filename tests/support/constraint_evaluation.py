"""Motion constraints evaluated anew, from a URDF and plain formulas: nothing of executive/motion is used."""

from __future__ import annotations

import math
import xml.etree.ElementTree as Xml
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from planlang.motion_constraints import Feature, MotionConstraint

Matrix = NDArray[np.float64]


@dataclass(frozen=True)
class Robot:
    """The joints of a URDF."""

    path: Path

    @cached_property
    def above(self) -> dict[str, Xml.Element]:
        """Child link -> the joint that moves it."""
        joints = Xml.parse(self.path).getroot().findall("joint")
        return {joint.find("child").attrib["link"]: joint for joint in joints}  # type: ignore[union-attr]

    def pose(self, base: str, link: str, q: Mapping[str, float]) -> Matrix:
        """The pose (4, 4) of a link in another above it."""
        pose = np.eye(4)
        while link != base:
            joint = self.above[link]
            pose = _of_joint(joint, q) @ pose
            link = joint.find("parent").attrib["link"]  # type: ignore[union-attr]
        return pose


def _of_joint(joint: Xml.Element, q: Mapping[str, float]) -> Matrix:
    origin = joint.find("origin")
    given = origin.attrib if origin is not None else {}
    x, y, z, roll, pitch, yaw = (float(one) for key in ("xyz", "rpy") for one in given.get(key, "0 0 0").split())
    fixed = np.eye(4)
    fixed[:3, :3] = _turn((0, 0, 1), yaw) @ _turn((0, 1, 0), pitch) @ _turn((1, 0, 0), roll)
    fixed[:3, 3] = x, y, z
    move, kind = np.eye(4), joint.attrib["type"]
    axis = joint.find("axis")
    along = np.array([float(one) for one in (axis.attrib["xyz"] if axis is not None else "1 0 0").split()])
    value = q.get(joint.attrib["name"], 0.0)
    if kind == "prismatic":
        move[:3, 3] = along / np.linalg.norm(along) * value
    elif kind != "fixed":
        move[:3, :3] = _turn(along / np.linalg.norm(along), value)
    return fixed @ move


def _turn(axis: object, angle: float) -> Matrix:
    x, y, z = np.asarray(axis, float)
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + math.sin(angle) * k + (1 - math.cos(angle)) * k @ k


def value_of(constraint: MotionConstraint, tool: Matrix, world: Matrix, frame: Matrix) -> float:
    """The function of a constraint, with poses (4, 4) of tool and thing and a reference rotation (3, 3) in the map."""
    p_t, d_t = _feature(constraint.tool, tool)
    p_o, d_o = _feature(constraint.world, world)
    v = p_t - p_o
    x, y, z = frame.T @ v
    match constraint.kind.value.owl:
        case "AboveOfConstraint":
            return float(z)
        case "BelowOfConstraint":
            return float(-z)
        case "LeftOfConstraint":
            return float(y)
        case "RightOfConstraint":
            return float(-y)
        case "BehindConstraint":
            return float(x)
        case "InFrontOfConstraint":
            return float(-x)
        case "HeightConstraint":
            return float(z) if d_o is None else float(d_o @ v)
        case "DistanceConstraint":
            return float(np.linalg.norm(v if d_o is None else v - (d_o @ v) * d_o))
    assert d_t is not None
    assert d_o is not None
    if constraint.kind.value.owl == "PerpendicularityConstraint":
        return float(d_t @ d_o)
    assert constraint.kind.value.owl == "PointingAtConstraint"
    a, b = np.cross(d_o, v), d_t - (d_o @ d_t) * d_o
    if np.linalg.norm(a) < 1e-3 or np.linalg.norm(b) < 1e-3:
        return 0.0
    return float(a @ b / np.linalg.norm(a) / np.linalg.norm(b))


def beyond(constraint: MotionConstraint, value: float) -> float:
    """Return how far a value is outside of the stated limits, in tolerances (1 mm, 0.005): at most 1 inside."""
    lower = -math.inf if constraint.lower is None else constraint.lower
    upper = math.inf if constraint.upper is None else constraint.upper
    return max(lower - value, value - upper, 0.0) / (0.001 if constraint.kind.value.unit == "m" else 0.005)


def _feature(feature: Feature, pose: Matrix) -> tuple[Matrix, Matrix | None]:
    position = pose[:3, :3] @ np.array(feature.position) + pose[:3, 3]
    if feature.direction is None:
        return position, None
    direction = pose[:3, :3] @ np.array(feature.direction)
    return position, direction / np.linalg.norm(direction)
