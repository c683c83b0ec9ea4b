"""What a camera errs by: noise of poses, things that it misses, and classes that it confuses, drawn by counter.

The n-th picture of a run with a seed has its own random numbers for each thing, a hash of all three: what a thing is
seen as depends neither on earlier pictures nor on what else is there.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

from planlang.faults.drawing import share
from planlang.geometry import Pose
from planlang.protocols import Detection
from sim.scene import CameraModel


class Erring:
    """Makes of what is in the pictures of one camera what this camera tells."""

    def __init__(self, model: CameraModel, seed: int, kinds: Callable[[str], Sequence[str]]) -> None:
        """``kinds`` lists the classes of a body, the most specific one first."""
        self._model, self._seed, self._kinds = model, seed, kinds
        self._pictures = 0

    def told(self, shown: Mapping[str, Detection], eye: Pose) -> dict[str, Detection]:
        """Return what the camera tells of the bodies that its next picture shows, taken from a pose."""
        self._pictures += 1
        told = {name: self._told(name, one, one.pose.distance(eye)) for name, one in shown.items()}
        return {name: one for name, one in told.items() if one is not None}

    def _told(self, name: str, one: Detection, distance: float) -> Detection | None:
        noise = self._model.noise
        if self._share(name, "missed") < noise.missing(one.visible, distance / self._model.far):
            return None
        deviation = noise.deviation(distance)
        return replace(
            one,
            type=self._confused(name, one.type),
            pose=self._blurred(name, one.pose, deviation),
            deviation=deviation,
            angle_deviation=noise.angle,
        )

    def _confused(self, name: str, cls: str) -> str:
        drawn, kinds = self._share(name, "confused"), (cls, *self._kinds(name))
        for one, other, often in self._model.noise.confusions:
            if one in kinds:
                if drawn < often:
                    return other
                drawn -= often
        return cls

    def _blurred(self, name: str, pose: Pose, deviation: float) -> Pose:
        x, y, z = (at + deviation * self._normal(name, axis) for at, axis in zip(pose.position, "xyz", strict=True))
        turn = [self._model.noise.angle * self._normal(name, f"about {axis}") for axis in "xyz"]
        angle = math.hypot(*turn)
        if angle == 0.0:
            return Pose((x, y, z), pose.orientation)
        a, b, c = (math.sin(angle / 2) * one / angle for one in turn)
        turned = Pose((0.0, 0.0, 0.0), (a, b, c, math.cos(angle / 2))) @ Pose((0.0, 0.0, 0.0), pose.orientation)
        return Pose((x, y, z), turned.orientation)

    def _normal(self, name: str, what: str) -> float:
        """Draw from the standard normal distribution (Box and Muller, 1958)."""
        radius = math.sqrt(-2.0 * math.log(1.0 - self._share(name, f"radius {what}")))
        return radius * math.cos(2 * math.pi * self._share(name, f"angle {what}"))

    def _share(self, name: str, what: str) -> float:
        return share(self._seed, self._pictures, f"picture {name} {what}")
