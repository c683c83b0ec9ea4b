"""Faults of things: somebody moves one, or takes it away; they slip out of a hand, or roll away from where it was."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import product

import numpy as np

from planlang.faults.drawing import Drawn
from planlang.faults.kinds import Kind
from planlang.geometry import Pose
from sim.faults.injection import Injection
from sim.truth import is_inside

_MOVED = (0.1, 0.3)
"""Distances by which somebody moves a thing [m]."""
_ROLLED = (0.15, 0.3)
"""Distances by which a thing that was put down rolls away [m]."""
_TRIES = 24
"""Number of places that are tried for a thing."""
_FARTHER = 3
"""Number of distances at which it is asked whether there is room at all."""
_CARRIED = (0.3, 6.0)
"""Time from lifting a thing until it slips [s]."""
_LIFTED = 0.02
"""Distance from where it was taken from which on a thing counts as lifted [m]."""


class Things:
    """What goes wrong with things."""

    def __init__(self, injection: Injection) -> None:
        self._injection, self._truth = injection, injection.truth

    def can(self, kind: Kind, of: str | None) -> bool:
        """Check whether somebody could move or take away a thing, that of a name if one is stated."""
        return any(kind.name == "is_gone" or self.can_slide(name, _MOVED) for name in self._free(of))

    def happen(self, fault: Drawn) -> None:
        """Move a thing on what it stands on, or take it away."""
        names = self._free(None if fault.named is None else fault.named.of)
        if fault.kind.name == "is_gone":
            name = names[int(fault.share("which") * len(names))]
            self._truth.remove(name)
        else:
            names = [one for one in names if self.can_slide(one, _MOVED)]
            name = names[int(fault.share("which") * len(names))]
            pose = self.place(name, fault, *((fault.between(*_MOVED),) * 2 if fault.value else _MOVED))
            if pose is None:
                return
            self._truth.set_pose(name, pose)
        self._injection.happens(replace(fault, of=name))

    def place(self, name: str, fault: Drawn, least: float, most: float, *, out_of: str | None = None) -> Pose | None:
        """Find a place for a thing at some distance [m] from where it stands, on the same support; None without any.

        ``out_of`` is the link of a hand between whose fingers the thing must not be then.
        """
        here, first = self._truth.pose(name), fault.share("direction")
        distances = (least + (most - least) * fault.share("distance"), *np.linspace(least, most, _FARTHER).tolist())
        turns = [2 * math.pi * (first + number / _TRIES) for number in range(_TRIES)]
        for away, turn in product(distances, turns):
            pose = aside(here, away, turn)
            if self._truth.could_stand(name, pose, out_of):
                return pose
        return None

    def can_slide(
        self, name: str, distances: tuple[float, float], *, out_of: str | None = None, here: Pose | None = None
    ) -> bool:
        """Check whether there is such a place at some distance [m], from the least to the most.

        ``here``: the pose at which the thing stands; by default where it is.
        """
        here = here or self._truth.pose(name)
        turns = [2 * math.pi * number / _TRIES for number in range(_TRIES)]
        return any(
            self._truth.could_stand(name, aside(here, far, turn), out_of)
            for far, turn in product(np.linspace(*distances, _FARTHER).tolist(), turns)
        )

    def carried(self, name: str, fault: Drawn) -> None:
        """Let a thing that a hand has just taken slip out of it on the way."""
        taken, after = self._truth.pose(name), fault.between(*_CARRIED)
        since: float | None = None

        def slips() -> bool:
            nonlocal since
            if name not in self._truth.attached() or self._truth.taken(name) is not None:
                return True  # put down, or handed over, before
            if since is None and self._truth.pose(name).distance(taken) > _LIFTED:
                since = self._injection.now
            if since is None or self._injection.now < since + after:
                return False
            self._truth.release(name)
            self._injection.happens(fault)
            return True

        self._injection.later(slips)

    def put_down_by(self, link: str) -> str | None:
        """Find the thing that comes free once a hand opens: nobody else has hold of it."""
        truth = self._truth
        held = (one for one in truth.attached() if {*map(truth.hand_at, truth.holders(one))} == {link})
        return next((one for one in held if truth.taken(one) is None), None)

    def can_roll(self, name: str, link: str) -> bool:
        """Check whether there is a place to which a thing could roll once a hand has let go of it."""
        return self.can_slide(name, _ROLLED, out_of=link, here=self._truth.gravity.rest(name)[0])

    def rolls(self, name: str, fault: Drawn, link: str) -> None:
        """Let a thing roll away from where it has come to rest, out of a hand that opens."""

        def event() -> bool:
            if name in self._truth.attached() or self._truth.falling(name):
                return False
            far = (fault.between(*_ROLLED),) * 2 if fault.value else _ROLLED
            pose = self.place(name, fault, *far, out_of=link)
            if pose is not None:
                self._truth.set_pose(name, pose)
                self._injection.happens(fault)
            return True

        self._injection.later(event)

    def _free(self, of: str | None) -> list[str]:
        """List the things that somebody could take: those that stand where all can reach them."""
        truth = self._truth
        held = {*truth.attached()}
        found = []
        for name in truth.names():
            if (of is not None and name != of) or not truth.scene.body(name).graspable:
                continue
            if name in held or truth.taken(name) is not None or truth.falling(name):
                continue
            support = truth.support(name)
            if support is not None and not is_inside(truth, name, support):
                found.append(name)
        return found


def aside(pose: Pose, far: float, angle: float) -> Pose:
    """Shift a pose by a distance [m] in a direction of the map [rad]."""
    x, y, z = pose.position
    return Pose((x + far * math.cos(angle), y + far * math.sin(angle), z), pose.orientation)
