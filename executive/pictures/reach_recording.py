"""What the arms of a robot reach, for the rerun viewer: the robot and clouds of where its hands can be."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from executive.locations.reachability import CELL, YAWS, GraspClass, ReachabilityMap
from executive.pictures.drawing import blended
from executive.pictures.reach_picture import SCALE
from executive.pictures.recording import placed, stream_to
from executive.pictures.shapes import Drawn
from executive.robots.arms import ArmModel
from planlang.outputs import replace

if TYPE_CHECKING:
    import rerun

POINT = 0.012
"""Radius of a point of a cloud [m]."""


def save_reach_recording(
    path: Path,
    drawn: Sequence[Drawn],
    models: Sequence[ArmModel],
    maps: Mapping[str, Mapping[GraspClass, ReachabilityMap]],
) -> None:
    """Write a recording, complete or not at all; ``drawn``: the links of the robot at the origin of the map.

    A cloud for each arm and class of grasp, its colours tell how many headings of the hand are reached, as in the
    picture. Raises BadInput when rerun-sdk is not installed or ``path`` cannot be written.
    """
    replace(path, lambda file: _write(file, drawn, models, maps))


def _write(
    path: Path,
    drawn: Sequence[Drawn],
    models: Sequence[ArmModel],
    maps: Mapping[str, Mapping[GraspClass, ReachabilityMap]],
) -> None:
    from rerun import blueprint

    view = blueprint.Spatial3DView(origin="world", name="Reach")
    stream = stream_to(path, "planlang robot inspect", blueprint.Blueprint(view))
    for thing in drawn:
        placed(stream, thing)
    for model in models:
        for grasp, found in maps[model.name].items():
            stream.log(f"world/reach/{model.name}/{grasp.value}", _cloud(found), static=True)
    stream.flush()
    stream.disconnect()


def _cloud(found: ReachabilityMap) -> rerun.Points3D:
    """The cells of a map, coloured by their numbers of headings."""
    import rerun

    rows = found.rows
    places = np.stack([rows[name].astype(int) for name in ("x", "y", "z", "yaw")], axis=1).reshape(-1, 4)
    cells, counts = np.unique(np.unique(places, axis=0)[:, :3], axis=0, return_counts=True)
    palette = np.array([blended(SCALE, count / (YAWS - 1)) for count in range(YAWS)], np.uint8)
    labels = [f"{count} of {YAWS} headings" for count in counts.tolist()]
    return rerun.Points3D(CELL * cells, radii=POINT, colors=palette[counts - 1], labels=labels, show_labels=False)
