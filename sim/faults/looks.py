"""Faults of a camera: it sees nothing, overlooks the things of a class, or recognises one where it is not."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from functools import partial

from planlang.faults.drawing import Drawn
from planlang.faults.kinds import Kind, Opportunity
from planlang.protocols import Detection
from sim.faults.injection import Injection
from sim.faults.things import aside
from sim.world import order

_BESIDE = (0.15, 0.4)
"""Distance of what is recognised by mistake from the thing that looks like it [m]."""


class Looks:
    """What goes wrong with looks."""

    def __init__(self, injection: Injection) -> None:
        self._injection = injection

    def seen(self, camera: str, shown: Mapping[str, Detection]) -> tuple[Detection, ...]:
        """Return what a camera recognises of the bodies that it should recognise."""
        return tuple(sorted(self._seen(camera, shown), key=order))

    def _seen(self, camera: str, shown: Mapping[str, Detection]) -> list[Detection]:
        found = {name: shown[name] for name in self._injection.truth.names() if name in shown}
        fault = self._injection.begins(Opportunity.LOOK, (camera,), partial(self._can, found=found))
        if fault is None:
            return [*found.values()]
        self._injection.happens(fault)
        if fault.kind.name == "blind":
            return []
        things = self._things(found, fault.value)
        which = things[int(fault.share("which") * len(things))]
        if fault.kind.name == "overlooks":
            cls = fault.value or self._class_of(which)
            return [one for name, one in found.items() if not self._is_a(name, cls)]
        return [*found.values(), _beside(found[which], fault)]

    def _can(self, kind: Kind, of: str | None, value: str | None, found: Mapping[str, Detection]) -> bool:
        return bool(found) and (kind.name == "blind" or bool(self._things(found, value)))

    def _things(self, found: Mapping[str, Detection], value: str | None) -> list[str]:
        """List the bodies in the picture that hands take, or those of a class or a name."""
        scene = self._injection.truth.scene
        if value is not None:
            return [name for name in found if name == value or self._is_a(name, value)]
        return [name for name in found if scene.body(name).graspable]

    def _class_of(self, name: str) -> str:
        body = self._injection.truth.scene.body(name)
        return body.kinds[0] if body.kinds else body.type

    def _is_a(self, name: str, cls: str) -> bool:
        body = self._injection.truth.scene.body(name)
        return cls in body.kinds or cls == body.type


def _beside(one: Detection, fault: Drawn) -> Detection:
    far, angle = _BESIDE[0] + fault.share("distance") * (_BESIDE[1] - _BESIDE[0]), 2 * math.pi * fault.share("angle")
    return replace(one, pose=aside(one.pose, far, angle))
