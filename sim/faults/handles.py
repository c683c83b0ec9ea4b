"""Faults of doors, drawers, lids and knobs that a hand has taken by their handle, and of the grip on the handle."""

from __future__ import annotations

import math
from functools import partial

from planlang.faults.drawing import Drawn
from planlang.faults.kinds import Kind, Opportunity
from planlang.protocols import Motion, MotionState
from sim.faults.injection import Event, Injection
from sim.joints import JointKind

_LOOSE, _STOPS = (0.1, 0.5), (0.2, 0.5)
"""Shares of a joint's range after which a hand slips off the handle, and after which a leaf stops."""
_PULLS = 0.01
"""Distance of a hand from where the handle is at which the force stops the arm [m]."""
_WAITS = 0.5
"""Time from letting go of a door until it falls shut [s]."""
_FALLS = {JointKind.HINGED: 1.2, JointKind.PRISMATIC: 0.6}
"""Speed with which it falls shut [rad/s, m/s]."""


class Handles:
    """What goes wrong with contacts with handles."""

    def __init__(self, injection: Injection) -> None:
        self._injection, self._truth = injection, injection.truth
        self._jammed: set[str] = set()
        """Leaves that do not move any more."""
        self.stopped: set[str] = set()
        """Links of hands that pull at a leaf which does not follow."""

    def taken(self, leaf: str, names: tuple[str, ...]) -> None:
        """Draw what goes wrong with a leaf whose handle a hand has just taken."""
        if leaf in self._jammed:
            self._injection.later(self._stays(leaf, None, 0.0))
            return
        fault = self._injection.begins(Opportunity.HANDLE, (leaf, *names), partial(self._can, leaf=leaf))
        if fault is None:
            return
        match fault.kind.name:
            case "comes_loose":
                self._injection.later(self._loose(leaf, fault))
            case "falls_shut":
                self._injection.later(self._shut(leaf, fault))
            case "stops":
                self._injection.later(self._stays(leaf, fault, fault.between(*_STOPS)))
            case name:
                if name == "jams":
                    self._jammed.add(leaf)
                self._injection.later(self._stays(leaf, fault, 0.0))

    def _can(self, kind: Kind, of: str | None, value: str | None, leaf: str) -> bool:
        return kind.name != "falls_shut" or not self._truth.leaf(leaf).is_knob

    def motion(self, group: str, motion: Motion) -> Motion:
        """Return the state of an arm's motion: it has stopped if it pulled at a leaf that does not follow."""
        if motion.state is MotionState.HALTED and group in self.stopped:
            return Motion(MotionState.BLOCKED)
        return motion

    def _loose(self, leaf: str, fault: Drawn) -> Event:
        start, far = self._truth.joint(leaf), fault.between(*_LOOSE) * self._truth.leaf(leaf).upper

        def event() -> bool:
            if leaf not in self._truth.led():
                return True
            if abs(self._truth.joint(leaf) - start) < far:
                return False
            self._truth.let_go(leaf)
            self._injection.happens(fault)
            return True

        return event

    def _stays(self, leaf: str, fault: Drawn | None, share: float) -> Event:
        start, far = self._truth.joint(leaf), share * self._truth.leaf(leaf).upper
        self._truth.jam(leaf, (start - far, start + far))
        told = fault is None

        def event() -> bool:
            nonlocal told
            link = self._truth.led().get(leaf)
            if link is None:
                self._truth.jam(leaf, None)
                return True
            if self._truth.strain(leaf) > _PULLS:
                for group in self._truth.moving(link):
                    self._truth.halt(group)
                    self.stopped.add(group)
                if not told and fault is not None:
                    told = True
                    self._injection.happens(fault)
            return False

        return event

    def _shut(self, leaf: str, fault: Drawn) -> Event:
        joint, since, told = self._truth.leaf(leaf), math.inf, False
        step = _FALLS[joint.kind] / self._truth.rate

        def event() -> bool:
            nonlocal since, told
            if leaf in self._truth.led():
                since = math.inf
                return told  # somebody has taken it again
            since = min(since, self._injection.now)
            value = self._truth.joint(leaf)
            if joint.is_shut(value):
                return True
            if self._injection.now < since + _WAITS:
                return False
            self._truth.set_joint(leaf, max(0.0, value - step))
            if not self._truth.is_clear(leaf):
                self._truth.set_joint(leaf, value)  # the robot is in its way
            elif not told:
                told = True
                self._injection.happens(fault)
            return False

        return event
