"""Recording of the reachability maps of a robot's arms for the rerun viewer."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import rerun
from rerun import blueprint

from executive.locations.capabilities import Maps
from executive.locations.reachability import CELL, YAWS, ReachabilityMap
from executive.pictures.drawn import Drawn
from executive.pictures.reach_picture import SCALE
from executive.pictures.recorded_world import MAP, TRUTH, record_robot, stream_to
from executive.robots.arms import ArmModel
from planlang.sheets import blended

POINT = 0.012
"""Radius of a point of a cloud [m]."""


def save_reach_recording(
    path: Path, drawn: Sequence[Drawn], models: Sequence[ArmModel], maps: Mapping[str, Maps]
) -> None:
    """Write a recording with a point cloud for each arm and class of grasps.

    Colours show the number of reachable headings of the hand, as in the picture. ``drawn`` are the links of the robot
    at the origin of the map.
    """
    view = blueprint.Spatial3DView(origin=TRUTH, name="Reach")
    stream = stream_to(path, "planlang robot inspect", blueprint.Blueprint(view))
    record_robot(stream, drawn)
    for model in models:
        for grasp, reach in maps[model.name].items():
            entity = f"{TRUTH}/reach/{model.name}/{grasp.value}"
            stream.log(entity, rerun.CoordinateFrame(MAP), _cloud(reach), static=True)
    stream.flush()
    stream.disconnect()


def _cloud(reach: ReachabilityMap) -> rerun.Points3D:
    """Cells of a map as points, coloured by their numbers of headings."""
    rows = reach.rows
    entries = np.stack([rows[name].astype(int) for name in ("x", "y", "z", "yaw")], axis=1).reshape(-1, 4)
    cells, counts = np.unique(np.unique(entries, axis=0)[:, :3], axis=0, return_counts=True)
    palette = np.array([blended(SCALE, count / (YAWS - 1)) for count in range(YAWS)], np.uint8)
    labels = [f"{count} of {YAWS} headings" for count in counts.tolist()]
    return rerun.Points3D(CELL * cells, radii=POINT, colors=palette[counts - 1], labels=labels, show_labels=False)
