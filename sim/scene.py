"""Descriptions of a world: bodies of simple shape, a robot's body, a camera's optics. Pure data.

Lengths in metres, angles in radians; the map has z up and the floor at z = 0.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum
from pathlib import Path

from planlang.geometry import Pose


class BodyShape(StrEnum):
    """The kind of a body in the scene."""

    BOX = "box"
    CYLINDER = "cylinder"
    """Axis z, diameter is the larger horizontal size: bottles, cups."""
    PERSON = "person"
    """A person lying, seated or standing, depending on the size; x of the pose is where the person faces."""
    MARKER = "marker"
    """A place: touches nothing, is not seen."""
    ROOM = "room"
    """A room: size and pose are of the *interior*; walls stand outside it, there is no ceiling."""


GRASPABLE_WIDTH = 0.12
"""A movable body not wider than this in one horizontal direction counts as something a hand can take [m]."""


@dataclass(frozen=True, slots=True)
class Body:
    """A body of the map: a box of ``size`` (along its own axes) whose centre is at ``pose``."""

    name: str
    pose: Pose
    size: tuple[float, float, float]
    shape: BodyShape = BodyShape.BOX
    """The shape; its value, as text, will do as well."""
    iri: str = ""
    type: str = ""
    """Class of the thing, local name or IRI."""
    movable: bool = False
    """True for what may stand elsewhere than in the map: see :func:`sim.perturb.perturb`."""
    color: tuple[float, float, float, float] | None = None

    def __post_init__(self) -> None:
        if self.shape not in tuple(BodyShape):
            raise ValueError(f"body {self.name!r} has shape {self.shape!r}; shapes are {', '.join(BodyShape)}")
        object.__setattr__(self, "shape", BodyShape(self.shape))
        if self.shape is not BodyShape.MARKER and not all(extent > 0 for extent in self.size):
            raise ValueError(
                f"body {self.name!r} has size {self.size}; every extent of a {self.shape} must be positive"
            )

    @property
    def graspable(self) -> bool:
        """Return True if a hand could take it: a movable box or cylinder that is narrow enough."""
        return (
            self.movable and self.shape in (BodyShape.BOX, BodyShape.CYLINDER) and min(self.size[:2]) <= GRASPABLE_WIDTH
        )


@dataclass(frozen=True, slots=True)
class Scene:
    """A scene: all bodies, in an order that is kept everywhere, and where the robot starts."""

    bodies: tuple[Body, ...]
    bounds: tuple[float, float, float, float] = (-5.0, -5.0, 5.0, 5.0)
    """The rectangle in which a robot may drive: x_min, y_min, x_max, y_max."""
    start: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Base of the robot at the beginning: x, y, yaw."""

    def __post_init__(self) -> None:
        names = [body.name for body in self.bodies]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise ValueError(f"bodies of a scene have names of their own, these occur twice: {', '.join(twice)}")

    def body(self, name: str) -> Body:
        """Return the body of that name; ``KeyError`` lists the names there are."""
        for body in self.bodies:
            if body.name == name:
                return body
        raise KeyError(f"no body {name!r} in the scene; there are {', '.join(body.name for body in self.bodies)}")

    def with_poses(self, poses: Mapping[str, Pose]) -> Scene:
        """Return the same scene with some bodies elsewhere."""
        return replace(self, bodies=tuple(replace(body, pose=poses.get(body.name, body.pose)) for body in self.bodies))


@dataclass(frozen=True, slots=True)
class CameraModel:
    """Optics of a camera at a link of the robot."""

    link: str
    fov: float = 1.0
    """Horizontal opening angle [rad]."""
    near: float = 0.3
    far: float = 4.0
    """Objects whose centre is nearer or farther than these are not recognised [m]."""
    width: int = 160
    height: int = 120
    forward: tuple[float, float, float] = (0.0, 0.0, 1.0)
    """The direction of view, in the link's frame: z for an optical frame, x for a body frame."""
    up: tuple[float, float, float] = (0.0, -1.0, 0.0)
    """The upward direction of its picture, in the link's frame."""

    @property
    def half_angle(self) -> float:
        """Return the angle from the middle of the picture to its corners [rad]."""
        return math.atan(math.tan(self.fov / 2) * math.hypot(1.0, self.height / self.width))


@dataclass(frozen=True, slots=True)
class RobotBody:
    """The robot as the simulator needs it."""

    urdf: Path
    camera: CameraModel
    hands: Mapping[str, Collection[str]] = field(default_factory=dict)
    """Link of a hand -> links of its fingers."""
    allowed: Collection[tuple[str, str]] = ()
    """Pairs of links that may touch, beyond the pairs that the simulator finds itself."""
    posture: Mapping[str, float] = field(default_factory=dict)
    """Initial joint positions; joints not named are at zero, or at the limit nearest to it."""
    moving: Collection[str] | None = None
    """Joints that are commanded; the others never move, except when they mimic these. None: all may."""
