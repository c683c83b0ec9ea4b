"""Buttons and knobs of devices: pushing a button toggles its device, turning a knob far enough switches it on."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

from planlang.geometry import Pose
from planlang.protocols import Touch
from planlang.records import dataclass
from planlang.state.matter import OFF, ON
from sim.joints import Articulation

Point = tuple[float, float, float]

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
        values: Mapping[str, float],
        joints: Mapping[str, Articulation],
    ) -> None:
        """Switch on the devices whose knob, of the joint values ``values``, is turned at first.

        ``state`` and ``put`` read and change the state of a device.
        """
        self._buttons = [one for one in controls if not one.turns]
        self._knobs = [one for one in controls if one.turns]
        self._state, self._put = state, put
        self._turned = {one.body: _is_turned(one, values, joints) for one in self._knobs}
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

    def turned(self, values: Mapping[str, float], joints: Mapping[str, Articulation]) -> None:
        """Switch devices by their knobs' joint values; one that was on at first with its knob at 0 is on there."""
        for knob in self._knobs:
            is_turned = _is_turned(knob, values, joints)
            if is_turned != self._turned[knob.body]:
                self._turned[knob.body] = is_turned
                self._put(knob.device, ON if is_turned != self._on_at_zero[knob.device] else OFF)

    def _is_on(self, device: str) -> bool:
        return self._state(device) == ON


def _is_turned(knob: Control, values: Mapping[str, float], joints: Mapping[str, Articulation]) -> bool:
    return values[knob.body] >= HALFWAY * joints[knob.body].upper
