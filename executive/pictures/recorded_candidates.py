"""Base poses and grasps that were looked at, in a recording for the rerun viewer, coloured by what became of them.

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
"""Points that are written of one search and reason, spread evenly over those that there are."""
HEIGHT = 0.03
"""Height over the floor in which base poses are drawn [m]."""
ARROW = 0.25
"""Length of the arrow that shows a heading of the base [m]."""
RADIUS, CHOSEN = 0.02, 0.04
"""Radii of rejected and of accepted candidates [m]."""
BASES, GRASPS, GOOD = "base poses", "grasps", "accepted"

Points = dict[tuple[str, str], list[NDArray[np.float64]]]
"""(what, reason) -> positions (m, 3)."""


def record_candidates(stream: rerun.RecordingStream, searches: Mapping[int, Sequence[Rejections]], rate: int) -> None:
    """Write what searches looked at, from the world step on at which they began until the next ones begin.

    There is an entity for each reason, so that the viewer's list of them is a legend.
    """
    found = {step: _points(logs) for step, logs in searches.items()}
    kinds = dict.fromkeys(kind for points in found.values() for kind in points)
    of = colours(sorted({reason for _, reason in kinds}))
    for what, reason in kinds:
        each = [_some(points.get((what, reason), [])) for points in found.values()]
        entity = entity_of(CANDIDATES, (what, reason or GOOD))
        look = rerun.Points3D.from_fields(colors=[of[reason]], radii=[RADIUS if reason else CHOSEN])
        stream.log(entity, rerun.CoordinateFrame(MAP), look, static=True)
        columns = rerun.Points3D.columns(positions=np.concatenate(each)).partition([len(one) for one in each])
        stream.send_columns(entity, indexes=[times(list(found), rate)], columns=columns)
    _record_headings(stream, searches, rate)


def _points(logs: Sequence[Rejections]) -> Points:
    """The candidates of searches that began together."""
    found: Points = {}
    for log in logs:
        for place in log.places:
            x, y, _ = place.base
            found.setdefault((BASES, place.reason), []).append(np.array([[x, y, HEIGHT]]))
        for reason, bases in log.refused:
            heights = np.full((len(bases), 1), HEIGHT)
            found.setdefault((BASES, reason), []).append(np.hstack([bases[:, :2], heights]))
        for reason, tips in log.hands:
            found.setdefault((GRASPS, reason), []).append(tips[:, :3])
    return found


def _some(parts: Sequence[NDArray[np.float64]]) -> NDArray[np.float64]:
    """At most :data:`MOST` of some positions."""
    every = np.concatenate([np.zeros((0, 3)), *parts])
    return every[np.linspace(0, len(every) - 1, min(len(every), MOST)).astype(int)] if len(every) else every


def _record_headings(stream: rerun.RecordingStream, searches: Mapping[int, Sequence[Rejections]], rate: int) -> None:
    """Write where the base looks in accepted poses."""
    good = [[one.base for log in logs for one in log.places if not one.reason] for logs in searches.values()]
    bases = np.array([base for some in good for base in some], float).reshape(-1, 3)
    if not len(bases):
        return
    entity, number = entity_of(CANDIDATES, (BASES, "headings")), [len(some) for some in good]
    look = rerun.Arrows3D.from_fields(colors=[colours([""])[""]])
    stream.log(entity, rerun.CoordinateFrame(MAP), look, static=True)
    columns = rerun.Arrows3D.columns(
        origins=np.column_stack([bases[:, :2], np.full(len(bases), HEIGHT)]),
        vectors=ARROW * np.column_stack([np.cos(bases[:, 2]), np.sin(bases[:, 2]), np.zeros(len(bases))]),
    ).partition(number)
    stream.send_columns(entity, indexes=[times(list(searches), rate)], columns=columns)
