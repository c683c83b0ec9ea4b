"""Collect the data of a run's page during the run: its trace, its true world, and its searches for base poses."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from executive.pictures import viewpoints
from executive.pictures.drawn import drawn_in
from executive.pictures.floor_plan import Outline, outlines
from executive.report.places import Questions
from executive.report.shapes import Shapes
from executive.report.tracks import Tracks, ordered, packed
from planlang.geometry import Pose
from planlang.report import Told as Told
from planlang.report import model_of, page
from planlang.report.model import Context
from planlang.report.tree import shown
from sim.truth import Truth

if TYPE_CHECKING:
    from executive.modules.platform import Platform

VIEW = {
    "around": viewpoints.AROUND,
    "tilts": [round(math.radians(tilt), 4) for tilt in viewpoints.TILTS],
    "level": viewpoints.LEVEL,
    "near": viewpoints.NEAR,
    "calm": viewpoints.CALM,
    "border": viewpoints.BORDER,
    "least": viewpoints.LEAST_RADIUS,
}
"""Parameters of the page's choice of a viewpoint, the same as for pictures; angles in rad."""


class Watching:
    """Collects what the page of a run shows; listens to the trace and watches the true world."""

    def __init__(self, platform: Platform, truth: Truth) -> None:
        self.told = Told()
        self._truth, self._platform = truth, platform
        self._tracks, self._shapes, self._questions = Tracks(truth.rate, platform.belief), Shapes(), Questions()
        self._start = truth.configuration().base
        self._outlines = [_local(one, platform.scene.world.pose(one.name)) for one in outlines(platform.scene)]
        self._count = -1
        platform.resolver.watchers.append(self._questions.watch)

        self.move = self._tracks.move
        """Records the entities that moved."""

    def listen(self, record: Mapping[str, Any], node: object) -> None:
        """Process a record of the trace."""
        self.told.add(record)

    def tell(self, records: Iterable[Mapping[str, Any]]) -> None:
        """Start from the records of a whole trace, for a run that is repeated."""
        self.told = Told.of(records)

    def look(self, world: Truth) -> None:
        """Record the state after a world step."""
        self._questions.step = world.steps
        self._tracks.believe(world.steps)
        if self._count != world.changed:  # bodies were added
            self._count = world.changed
            self._shapes.add(drawn_in(world))

    def world(self) -> tuple[dict[str, Any], dict[str, bytes]]:
        """Build the world's part of the page's model, and its binary data by name."""
        shapes, bounds = self._shapes, [round(float(one), 3) for one in self._truth.scene.bounds]
        tracks, keys = packed(ordered(self._tracks.all.values()), self._tracks.rate, shapes.of)
        radius = self._platform.scene.base_radius
        room = {"bounds": bounds, "outlines": self._outlines, "radius": round(radius, 3), "start": list(self._start)}
        parts = {
            "scene": {"bounds": bounds, "meshes": shapes.meshes, "view": VIEW, **tracks},
            "map": room,
            "questions": self._questions.model(self.told.tree),
        }
        return parts, {"poses": keys, **({"meshes": shapes.data()} if shapes.meshes else {})}

    def save(self, path: Path, context: Context) -> None:
        """Write the page."""
        parts, blobs = self.world()
        path.write_bytes(page(model_of(self.told, context, **parts), blobs).encode(errors="backslashreplace"))


def _local(one: Outline, pose: Pose) -> dict[str, Any]:
    """Express the outline of a body in its own frame (position and yaw), so that the page can move it."""
    cos, sin = math.cos(pose.yaw), math.sin(pose.yaw)
    corners = [(a - pose.position[0], b - pose.position[1]) for a, b in one.polygon[:, :2].tolist()]
    polygon = [[round(cos * a + sin * b, 3), round(cos * b - sin * a, 3)] for a, b in corners]
    return {"name": shown(one.name), "kind": one.kind, "polygon": polygon}
