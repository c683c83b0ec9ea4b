"""Descriptions of a world: bodies of simple shape, the robot's body, camera optics.

Lengths in metres, angles in radians; the map has z up and the floor at z = 0.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Collection, Mapping
from dataclasses import field, replace
from enum import StrEnum
from pathlib import Path

from planlang.geometry import Pose
from planlang.records import dataclass
from planlang.state.matter import Portion, Rules
from sim.joints import Articulation, Control
from sim.movers import Mover


class BodyShape(StrEnum):
    BOX = "box"
    CYLINDER = "cylinder"
    """Axis z, the diameter is the larger horizontal size: bottles, cups."""
    PERSON = "person"
    """A person lying, seated or standing, depending on the size; x of the pose is where the person faces."""
    MARKER = "marker"
    """A place without substance: cannot be touched or seen."""
    ROOM = "room"
    """A room: size and pose are of the *interior*; walls stand outside it, there is no ceiling."""


THIN = 0.02
"""Height up to which a movable thing lies flat, so that a blade goes under it [m]."""
GRASPABLE_WIDTH = 0.12
"""Horizontal width up to which a hand can take a movable body [m]."""
LONGEST = 0.6
"""Greatest length of a thing that a hand takes [m]."""


@dataclass(frozen=True, slots=True)
class Cavity:
    """Hollow inside a box, along the box's axes: centre in the box's frame, and extents [m].

    Where it reaches beyond the box, the box is open.
    """

    centre: tuple[float, float, float]
    size: tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Handle:
    """Box that sticks out of a body, by which a hand takes it: pose in the body's frame, and extents [m]."""

    pose: Pose
    size: tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Body:
    """Body of the map: a box of ``size`` (along its own axes) whose centre is at ``pose``."""

    name: str
    pose: Pose
    size: tuple[float, float, float]
    shape: BodyShape = BodyShape.BOX
    """Shape; its value as text works as well."""
    iri: str = ""
    type: str = ""
    """Class of the thing: local name or IRI."""
    movable: bool = False
    """True for things that may be displaced from the map: see :func:`sim.displacing.perturb`."""
    color: tuple[float, float, float, float] | None = None
    cavities: tuple[Cavity, ...] = ()
    """Hollows of a box: compartments, the inside of a drawer; for a room, openings in its walls."""
    content: tuple[Portion, ...] = ()
    """Initial contents, or what it consists of."""
    capacity: float = 0.0
    """Capacity as a vessel [ml]."""
    is_on: bool = False
    """True for a device that is initially on."""
    blade: float = 0.0
    """Length of the blade at the front end of its longest axis [m]; 0 without one."""
    wall: float = 0.0
    """Wall thickness of a hollow thing that is open above, such as a plate or a bowl [m]; 0 if solid."""
    soft: bool = False
    """True for cloth and the like: two fingers that close on it from above form a fold."""
    handles: tuple[Handle, ...] = ()
    """Handles by which it is taken."""
    centre: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Centre of its box in its own frame [m]: nonzero only for a tool, whose frame is in its blade."""
    mass: float = 0.0
    """Mass without its contents [kg]; 0 if unknown."""
    largest_tilt: float | None = None
    """Largest angle of its z axis from the vertical while carried [rad]; None if unrestricted."""
    hands: int = 1
    """Number of hands it takes to hold; it slips out of fewer."""
    largest_drop: float = 0.0
    """Greatest height from which things are dropped into it, above the bottom of its inside [m]; 0 for never."""
    mark: str | None = None
    """Label or mark by which it can be told from others of its class; of a person, by the face."""
    colour: str | None = None
    """Word for its colour, if the map states it: a camera reads it."""
    kinds: tuple[str, ...] = field(default=(), repr=False, compare=False)
    """Its class and superclasses by local names, nearest first: determines its looks."""

    def __post_init__(self) -> None:
        if self.shape not in tuple(BodyShape):
            raise ValueError(f"body {self.name!r} has unknown shape {self.shape!r}; shapes are {', '.join(BodyShape)}")
        object.__setattr__(self, "shape", BodyShape(self.shape))
        if self.shape is not BodyShape.MARKER and not all(extent > 0 for extent in self.size):
            raise ValueError(
                f"body {self.name!r} has size {self.size}; every extent of a {self.shape} must be positive"
            )

    @property
    def thin(self) -> bool:
        """Whether a blade goes under it: movable, and not higher than :data:`THIN`."""
        return self.movable and self.size[2] <= THIN

    @property
    def graspable(self) -> bool:
        """Whether a hand can take it: a movable box or cylinder that is narrow or soft, or has a rim or a handle."""
        narrow = min(self.size[:2]) <= GRASPABLE_WIDTH or self.wall > 0 or self.soft or bool(self.handles)
        return self.movable and self.shape in (BodyShape.BOX, BodyShape.CYLINDER) and narrow


@dataclass(frozen=True, slots=True)
class Scene:
    """All bodies, in an order that is preserved everywhere, and the robot's start."""

    bodies: tuple[Body, ...]
    bounds: tuple[float, float, float, float] = (-5.0, -5.0, 5.0, 5.0)
    """Rectangle in which the robot may drive: x_min, y_min, x_max, y_max."""
    start: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Initial base pose of the robot: x, y, yaw."""
    joints: tuple[Articulation, ...] = ()
    """Joints of the leaves; the poses of their bodies, and of what lies in them, are given for closed leaves."""
    controls: tuple[Control, ...] = ()
    """Buttons and knobs of devices."""
    movers: tuple[Mover, ...] = ()
    """Bodies that move by themselves, such as another robot."""
    rules: Rules = field(default_factory=Rules)
    """Effects of heat and tilting on things."""
    _by_name: Mapping[str, Body] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        names = [body.name for body in self.bodies]
        object.__setattr__(self, "_by_name", {body.name: body for body in self.bodies})
        twice = sorted(name for name, number in Counter(names).items() if number > 1)
        if twice:
            raise ValueError(f"names of bodies must be unique; these occur twice: {', '.join(twice)}")
        moving = [name for joint in self.joints for name in joint.bodies]
        if not set(moving) <= set(names) or len(set(moving)) != len(moving):
            raise ValueError("every body moved by a joint must be in the scene, and be moved by that joint only")

    def body(self, name: str) -> Body:
        """Look up a body by name; ``KeyError`` lists the names that exist."""
        if name in self._by_name:
            return self._by_name[name]
        raise KeyError(f"no body {name!r} in the scene; there are {', '.join(body.name for body in self.bodies)}")

    def first_pose(self, body: Body) -> Pose:
        """Initial pose of a body, given that some leaves may be open."""
        joint = next((joint for joint in self.joints if joint.first and body.name in joint.bodies), None)
        return body.pose if joint is None else joint.motion(joint.first) @ body.pose

    def with_poses(self, poses: Mapping[str, Pose]) -> Scene:
        """Copy the scene with some bodies at other poses."""
        return replace(self, bodies=tuple(replace(body, pose=poses.get(body.name, body.pose)) for body in self.bodies))


UNSURE, MOST_PICTURES = 1e-3, 6
"""Probability with which a thing may be missed in all pictures that are taken to be sure, and most of these."""


@dataclass(frozen=True, slots=True)
class CameraNoise:
    """How a camera errs; with all zero it is exact. What it errs by is drawn anew for each thing in each picture."""

    position: float = 0.0
    """Standard deviation of a position along each axis, the part that does not depend on the distance [m]."""
    position_per_metre: float = 0.0
    """The part that grows with the distance from the camera [m/m]; the variances of both parts add up."""
    angle: float = 0.0
    """Standard deviation of the rotation about each axis [rad]."""
    misses: float = 0.0
    """Probability that a picture does not show a thing of which all is in sight, at no distance."""
    misses_hidden: float = 0.0
    """The same because of what hides a thing, as nothing of it is left in sight; proportional to the hidden share."""
    misses_far: float = 0.0
    """The same because of its distance, at the end of the camera's range; proportional to the distance."""
    confusions: tuple[tuple[str, str, float], ...] = ()
    """Class, class for which its things are taken, probability."""

    @property
    def is_exact(self) -> bool:
        """True for a camera that does not err."""
        return self == CameraNoise()

    def deviation(self, distance: float) -> float:
        """Compute the standard deviation of a position along each axis, at a distance from the camera [m]."""
        return math.hypot(self.position, self.position_per_metre * distance)

    def missing(self, visible: float, far: float) -> float:
        """Compute the probability that a picture does not show a thing, for shares of it in sight and of the range."""
        shown = (1 - self.misses) * (1 - self.misses_hidden * (1 - visible)) * (1 - self.misses_far * min(1.0, far))
        return 1 - shown

    @property
    def pictures(self) -> int:
        """Number of pictures, one of which almost surely shows a thing that is there, half hidden and half as far."""
        missed = self.missing(0.5, 0.5)
        if not 0 < missed < 1:
            return 1 if missed <= 0 else MOST_PICTURES
        return min(MOST_PICTURES, math.ceil(math.log(UNSURE) / math.log(missed)))

    def scaled(self, factor: float) -> CameraNoise:
        """Make the noise with all deviations and probabilities multiplied by a factor, the latter up to 1."""
        total = dict[str, float]()
        for one, _, often in self.confusions:
            total[one] = total.get(one, 0.0) + factor * often
        confused = ((one, other, factor * often / max(1.0, total[one])) for one, other, often in self.confusions)
        return CameraNoise(
            position=factor * self.position,
            position_per_metre=factor * self.position_per_metre,
            angle=factor * self.angle,
            misses=min(1.0, factor * self.misses),
            misses_hidden=min(1.0, factor * self.misses_hidden),
            misses_far=min(1.0, factor * self.misses_far),
            confusions=tuple(confused) if factor else (),
        )


TYPICAL = CameraNoise(
    position=0.003, position_per_metre=0.002, angle=0.035, misses=0.05, misses_hidden=0.5, misses_far=0.1
)
"""Noise of a camera for which no other is stated, if it is to err: that of a depth camera of the Kinect kind and of the
estimation of poses in its pictures, about 4 mm and 2 degrees at 1 m."""


@dataclass(frozen=True, slots=True)
class CameraModel:
    """Optics of a camera at a link of the robot."""

    link: str
    fov: float = 1.0
    """Horizontal opening angle [rad]."""
    near: float = 0.3
    far: float = 4.0
    """Range [m]: objects whose centre is nearer or farther are not recognised."""
    width: int = 160
    height: int = 120
    forward: tuple[float, float, float] = (0.0, 0.0, 1.0)
    """Viewing direction in the link's frame: z for an optical frame, x for a body frame."""
    up: tuple[float, float, float] = (0.0, -1.0, 0.0)
    """Upward direction of its picture, in the link's frame."""
    recognises: tuple[str, ...] | None = None
    """Classes of things with recognition models from the start; None: all."""
    noise: CameraNoise = CameraNoise()

    @property
    def half_angle(self) -> float:
        """Angle from the centre of the picture to its corners [rad]."""
        return math.atan(math.tan(self.fov / 2) * math.hypot(1.0, self.height / self.width))


@dataclass(frozen=True, slots=True)
class RobotBody:
    """The robot as the simulator needs it."""

    urdf: Path
    camera: CameraModel
    hands: Mapping[str, Collection[str]] = field(default_factory=dict)
    """Link of a hand -> links of its fingers."""
    allowed: Collection[tuple[str, str]] = ()
    """Pairs of links that may touch, besides the pairs that the simulator finds itself."""
    posture: Mapping[str, float] = field(default_factory=dict)
    """Initial joint positions; joints not named are at zero, or at the limit nearest to it."""
    moving: Collection[str] | None = None
    """Commanded joints; the others never move, unless they mimic these. None: all."""
