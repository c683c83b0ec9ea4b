"""Buttons and knobs of devices: what a hand pushes switches on or off, what it turns far enough is on."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from planlang.geometry import Pose
from planlang.protocols import Touch
from planlang.records import dataclass
from sim.joints import Articulation
from sim.matter import OFF, ON, Matter

Point = tuple[float, float, float]

AT_BUTTON = 0.025
"""Distance from the middle of a button within which a push is one of the button [m]."""
HALFWAY = 0.5
"""Share of its range by which a knob has to be turned."""


@dataclass(frozen=True, slots=True)
class Control:
    """The button or knob of a device; point and normal are in the frame of the body that a hand pushes or turns."""

    device: str
    body: str
    """The button or knob; the device itself if it has none of its own."""
    point: Point
    """The middle of what is pushed [m]."""
    normal: Point
    """Unit vector from there to where the hand comes from."""
    turns: bool = False
    """True for a knob, which is a leaf of the scene; False for a button, which changes the state at each push."""


class Controls:
    """The controls of one world."""

    def __init__(self, controls: Sequence[Control], matter: Matter) -> None:
        self._buttons = [one for one in controls if not one.turns]
        self._knobs = [one for one in controls if one.turns]
        self._matter = matter
        self._at_first = {one.device: matter.is_on(one.device) for one in controls}
        self._turned = dict.fromkeys((one.body for one in self._knobs), False)

    def pushed(self, body: str, touch: Touch, pose: Pose) -> None:
        """Let a hand push against a body at a pose: a button that is there switches its device."""
        for button in self._buttons:
            if button.body == body and math.dist((pose @ Pose(button.point)).position, touch.point) <= AT_BUTTON:
                self._put(button.device, not self._matter.is_on(button.device))

    def turned(self, values: Mapping[str, float], joints: Mapping[str, Articulation]) -> None:
        """Let devices follow their knobs, by the values of joints; a device that was on is on with its knob at 0."""
        for knob in self._knobs:
            is_turned = values[knob.body] >= HALFWAY * joints[knob.body].upper
            if is_turned != self._turned[knob.body]:
                self._turned[knob.body] = is_turned
                self._put(knob.device, is_turned != self._at_first[knob.device])

    def _put(self, device: str, is_on: bool) -> None:
        self._matter.states[device] = ON if is_on else OFF
