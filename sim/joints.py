"""Doors, drawers and lids, which turn about or slide along one axis; and the buttons and knobs of devices.

Joint values are in radians for hinges and in metres for slides; 0 is closed, larger values are more open. Pushing a
button toggles its device, turning a knob far enough switches it on.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from enum import StrEnum

import numpy as np

from planlang.geometry import Array, Pose
from planlang.geometry.matrices import cross_matrix, product, rotated
from planlang.protocols import Touch
from planlang.records import dataclass
from planlang.state.matter import OFF, ON

SHUT = 0.03
"""Share of its range up to which a joint counts as closed."""
WIDE = 0.7
"""Share of its range from which on a joint counts as open: 63 of 90 degrees."""
PASSABLE = 0.9
"""The same for a door between rooms: a base drives past it."""
Point = tuple[float, float, float]


class JointKind(StrEnum):
    HINGED = "hinged"
    PRISMATIC = "prismatic"


@dataclass(frozen=True, slots=True)
class Articulation:
    """Joint between a leaf (a door, a drawer, a lid) and what holds it, furniture or a wall, at a fixed place."""

    leaf: str
    """The moving body."""
    kind: JointKind
    point: Point
    """Point on the axis, in the map [m]."""
    axis: Point
    """Unit vector in the map: the leaf turns about it (right-hand rule), or slides along it."""
    lower: float
    upper: float
    holder: str | None = None
    """Body to which the leaf belongs."""
    parts: tuple[str, ...] = ()
    """Bodies that move with the leaf: handles, knobs, the front of a drawer."""
    handle: str | None = None
    """The part by which a hand moves the leaf."""
    other_handles: tuple[str, ...] = ()
    """Further parts by which a hand can move it: those on the other side of a door between rooms."""
    frame: tuple[str, ...] = ()
    """Of a door between rooms: the doorway, wall or room in which it hangs, then the rooms that it parts; its holder is
    None. It may touch them. Empty for leaves of furniture."""
    first: float = 0.0
    """Initial value."""
    sign: float = 1.0
    """-1 if smaller values are more open in the file that describes the joint, so that its axis is reversed."""

    def __post_init__(self) -> None:
        if not (self.lower <= 0.0 < self.upper and math.isfinite(self.lower + self.upper)):
            raise ValueError(f"limits of {self.leaf} must include 0 (closed), got {self.lower} to {self.upper}")
        if not self.lower <= self.first <= self.upper:
            raise ValueError(f"{self.leaf} starts at {self.first}, outside its limits {self.lower} to {self.upper}")

    @property
    def bodies(self) -> tuple[str, ...]:
        """All moving bodies: the leaf and its parts."""
        return (self.leaf, *self.parts)

    @property
    def is_knob(self) -> bool:
        """Whether the leaf is its own handle: a knob, which opens nothing."""
        return self.handle == self.leaf

    @property
    def handles(self) -> tuple[str, ...]:
        """All parts by which a hand can move the leaf, the preferred one first."""
        return () if self.handle is None else (self.handle, *self.other_handles)

    def by(self, handle: str) -> Articulation:
        """Get the joint as a hand moves it that holds one of its handles."""
        others = tuple(one for one in self.handles if one != handle)
        return self if handle == self.handle else replace(self, handle=handle, other_handles=others)

    def within(self, value: float) -> float:
        """Clamp a value to the limits."""
        return min(max(value, self.lower), self.upper)

    @property
    def last_shut(self) -> float:
        """Largest value at which the leaf counts as closed."""
        return SHUT * self.upper

    @property
    def first_open(self) -> float:
        """Smallest value at which the leaf counts as open."""
        return (PASSABLE if self.frame else WIDE) * self.upper

    def is_shut(self, value: float) -> bool:
        """Check whether the leaf counts as closed."""
        return abs(value) <= self.last_shut

    def is_open(self, value: float) -> bool:
        """Check whether the leaf counts as open."""
        return value >= self.first_open

    def motion(self, value: float) -> Pose:
        """Compute the displacement of the leaf in the map since it was closed (Rodrigues' formula)."""
        axis, point = np.array(self.axis), np.array(self.point)
        if self.kind is JointKind.PRISMATIC:
            x, y, z = (value * axis).tolist()
            return Pose((x, y, z))
        x, y, z = (math.sin(value / 2) * axis).tolist()
        turn = Pose((0.0, 0.0, 0.0), (x, y, z, math.cos(value / 2)))
        x, y, z = (point - rotated(turn.rotation, point)).tolist()
        return Pose((x, y, z), turn.orientation)

    def poses(self, value: float, closed: Mapping[str, Pose], inside: Mapping[str, Pose]) -> dict[str, Pose]:
        """Compute the poses of the leaf, its parts and the things inside it, with the joint at a value.

        ``closed`` are the poses of the leaf and its parts when it is closed, ``inside`` those of things in its frame.
        """
        motion = self.motion(value)
        poses = {name: motion @ closed[name] if value else closed[name] for name in self.bodies}
        return poses | {name: poses[self.leaf] @ offset for name, offset in inside.items()}

    def value_at(self, closed: Array, now: Array) -> float:
        """Compute the value, within the limits, that brings a point of the leaf nearest to ``now`` (3,) in the map.

        ``closed`` (3,) is the position of the point when the leaf is closed.
        """
        axis, point = np.array(self.axis), np.array(self.point)
        if self.kind is JointKind.PRISMATIC:
            return self.within(float((now - closed) @ axis))
        before, after = (arm - (arm @ axis) * axis for arm in (closed - point, now - point))
        angle = math.atan2(float(np.cross(before, after) @ axis), float(before @ after))
        options = (angle, angle + 2 * math.pi, angle - 2 * math.pi)
        return min(map(self.within, options), key=lambda value: min(abs(value - one) for one in options))

    def value_of(self, closed: Pose, now: Pose) -> float:
        """Compute the value at which a leaf with the pose ``closed`` when shut has the pose ``now``."""
        if self.kind is JointKind.PRISMATIC:
            return self.value_at(np.array(closed.position), np.array(now.position))
        turn = product(now.rotation, closed.rotation.T)
        cross = cross_matrix(np.array(self.axis))
        sine, cosine = -np.trace(product(cross, turn)) / 2, (np.trace(turn) - 1) / 2
        return self.within(math.atan2(float(sine), float(cosine)))


AT_BUTTON = 0.025
"""Largest distance of a push from the middle of a button at which it still hits the button [m]."""
HALFWAY = 0.5
"""Share of a knob's range beyond which it switches its device."""


@dataclass(frozen=True, slots=True)
class Control:
    """Button or knob of a device; point and normal are in the frame of the body that a hand pushes or turns."""

    device: str
    body: str
    """The button or knob; the device itself if it has no separate one."""
    point: Point
    """Centre of the surface that is pushed [m]."""
    normal: Point
    """Unit vector from that surface towards the approaching hand."""
    turns: bool = False
    """True for a knob, which is a leaf of the scene; False for a button, which toggles the device at each push."""


class Controls:
    """Buttons and knobs of one world."""

    def __init__(
        self,
        controls: Sequence[Control],
        state: Callable[[str], str | None],
        put: Callable[[str, str], None],
        is_turned: Callable[[Control], bool],
    ) -> None:
        """Switch on devices with a knob that ``is_turned`` at first; ``state`` and ``put`` read and change theirs."""
        self._buttons = [one for one in controls if not one.turns]
        self._knobs = [one for one in controls if one.turns]
        self._state, self._put, self._is_turned = state, put, is_turned
        self._turned = {one.body: is_turned(one) for one in self._knobs}
        for knob in self._knobs:
            if self._turned[knob.body]:
                put(knob.device, ON)
        self._on_at_zero = {
            one.device: self._is_on(one.device) and not self._turned.get(one.body, False) for one in controls
        }

    def shown(self, name: str) -> str | None:
        """Look up the state that a body shows: ON or OFF for a device; None for a body that is neither."""
        state = self._state(name) or (OFF if name in self._on_at_zero else None)
        return state if state in (ON, OFF) else None

    def pushed(self, body: str, touch: Touch, pose: Pose) -> None:
        """Toggle the device of a button that a hand touches on a body at a pose."""
        for button in self._buttons:
            if button.body == body and math.dist((pose @ Pose(button.point)).position, touch.point) <= AT_BUTTON:
                self._put(button.device, OFF if self._is_on(button.device) else ON)

    def turned(self) -> None:
        """Switch devices by their knobs; one that was on at first with its knob at 0 is on there."""
        for knob in self._knobs:
            is_turned = self._is_turned(knob)
            if is_turned != self._turned[knob.body]:
                self._turned[knob.body] = is_turned
                self._put(knob.device, ON if is_turned != self._on_at_zero[knob.device] else OFF)

    def _is_on(self, device: str) -> bool:
        return self._state(device) == ON
