"""Candidate base poses and grasps in a recording for the rerun viewer, coloured by the reason of their rejection.

Importing it needs the package rerun-sdk.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import rerun
from numpy.typing import NDArray

from executive.locations.rejections import Rejections
from executive.pictures.floor_plan import colours
from executive.pictures.recorded_world import CANDIDATES, MAP, entity_of, times

MOST = 300
"""Largest number of points for each search and reason; they are sampled evenly."""
HEIGHT = 0.03
"""Height above the floor at which base poses are drawn [m]."""
ARROW = 0.25
"""Length of the arrows for headings of the base [m]."""
RADIUS, CHOSEN = 0.02, 0.04
"""Radii of rejected and of accepted candidates [m]."""
BASES, GRASPS, GOOD = "base poses", "grasps", "accepted"

Points = dict[tuple[str, str], list[NDArray[np.float64]]]
"""Positions (m, 3) by kind of candidate and reason."""


def record_candidates(stream: rerun.RecordingStream, searches: Mapping[int, Sequence[Rejections]], rate: int) -> None:
    """Write the candidates of searches, each visible from the world step at which its search began to the next search.

    Each reason is an entity, so that the viewer's list of entities is a legend.
    """
    by_step = {step: _points(logs) for step, logs in searches.items()}
    groups = dict.fromkeys(group for points in by_step.values() for group in points)
    colour_of = colours(sorted({reason for _, reason in groups}))
    for kind, reason in groups:
        parts = [_sample(points.get((kind, reason), [])) for points in by_step.values()]
        entity = entity_of(CANDIDATES, (kind, reason or GOOD))
        look = rerun.Points3D.from_fields(colors=[colour_of[reason]], radii=[RADIUS if reason else CHOSEN])
        stream.log(entity, rerun.CoordinateFrame(MAP), look, static=True)
        columns = rerun.Points3D.columns(positions=np.concatenate(parts)).partition([len(one) for one in parts])
        stream.send_columns(entity, indexes=[times(list(by_step), rate)], columns=columns)
    _record_headings(stream, searches, rate)


def _points(logs: Sequence[Rejections]) -> Points:
    """Group the candidates of searches that began at the same step."""
    points: Points = {}
    for log in logs:
        for place in log.places:
            x, y, _ = place.base
            points.setdefault((BASES, place.reason), []).append(np.array([[x, y, HEIGHT]]))
        for reason, bases in log.refused:
            heights = np.full((len(bases), 1), HEIGHT)
            points.setdefault((BASES, reason), []).append(np.hstack([bases[:, :2], heights]))
        for reason, tips in log.hands:
            points.setdefault((GRASPS, reason), []).append(tips[:, :3])
    return points


def _sample(parts: Sequence[NDArray[np.float64]]) -> NDArray[np.float64]:
    """Sample at most :data:`MOST` positions evenly."""
    points = np.concatenate([np.zeros((0, 3)), *parts])
    return points[np.linspace(0, len(points) - 1, min(len(points), MOST)).astype(int)] if len(points) else points


def _record_headings(stream: rerun.RecordingStream, searches: Mapping[int, Sequence[Rejections]], rate: int) -> None:
    """Write the headings of accepted base poses as arrows."""
    accepted = [[one.base for log in logs for one in log.places if not one.reason] for logs in searches.values()]
    bases = np.array([base for group in accepted for base in group], float).reshape(-1, 3)
    if not len(bases):
        return
    entity, counts = entity_of(CANDIDATES, (BASES, "headings")), [len(group) for group in accepted]
    look = rerun.Arrows3D.from_fields(colors=[colours([""])[""]])
    stream.log(entity, rerun.CoordinateFrame(MAP), look, static=True)
    columns = rerun.Arrows3D.columns(
        origins=np.column_stack([bases[:, :2], np.full(len(bases), HEIGHT)]),
        vectors=ARROW * np.column_stack([np.cos(bases[:, 2]), np.sin(bases[:, 2]), np.zeros(len(bases))]),
    ).partition(counts)
    stream.send_columns(entity, indexes=[times(list(searches), rate)], columns=columns)
