"""Recordings of runs for the rerun viewer: the world, the robot's belief, and the plan, on one time line.

Candidate base poses and grasps are coloured by the reason of their rejection. Importing it needs the package rerun-sdk;
:func:`planlang.extras.no_recorder` checks for it.
"""

from __future__ import annotations

import inspect
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import rerun
from numpy.typing import NDArray
from rerun import blueprint
from rerun.blueprint import archetypes

from executive.belief import Belief
from executive.locations.rejections import Rejections
from executive.pictures.drawn import drawn_in
from executive.pictures.floor_plan import colours
from executive.pictures.pose_track import Placed, Tracks
from executive.pictures.recorded_plan import (
    FAILED,
    FLASH,
    LANES,
    RECIPE,
    TREE,
    record_lanes,
    record_recipe,
    record_tree,
    tasks_of,
)
from executive.pictures.recorded_world import (
    BELIEF,
    CANDIDATES,
    MAP,
    TIME_LINE,
    TRUTH,
    Keyframe,
    entity_of,
    frame_of,
    record_belief,
    record_truth,
    stream_to,
    times,
)
from planlang.runs.run_tree import RunTree
from sim.truth import Truth

if TYPE_CHECKING:
    from planlang.compiler.drawing import TaskGraph


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


TEXT = "events"
APART = 0.002
"""Distance between true and believed position above which a thing gets a ghost [m]."""
COLOURS = {"ERROR": FAILED, "WARN": (230, 145, 30), "INFO": (120, 120, 125)}
"""Colours of log lines by level."""

FROM, NEAREST = (-0.6, -0.7, 0.8), 4.0
"""Initial position of the eye, in units of the extent of all movement, and the smallest such extent [m]."""


class Recording:
    """Recording of one run, kept in memory until :meth:`save`: a log call costs 50 us, sending columns little."""

    def __init__(self, world: Truth, belief: Belief, *, recipe: TaskGraph | None = None, title: str = "run") -> None:
        """Start to record the true world; ``recipe`` is the graph of the recipe that the plan was compiled from."""
        self._world, self._belief, self._recipe, self._title = world, belief, recipe, title
        self._tracks = Tracks()
        self._drawn = {thing.path: thing for thing in drawn_in(world)}
        self._records: list[Mapping[str, Any]] = []
        self._lines: list[tuple[int, str, str]] = []
        self._searches: dict[int, list[Rejections]] = {}
        self._believed: dict[str, list[Keyframe]] = {}
        self._believe(0)

    def move(self, step: int, moved: Sequence[Placed]) -> None:
        """Record the entities that moved; new bodies are drawn with their shape at this time."""
        self._tracks(step, moved)
        if any(one.path not in self._drawn and one.path[0] == "bodies" for one in moved):
            self._drawn = {thing.path: thing for thing in drawn_in(self._world)} | self._drawn

    def hear(self, record: Mapping[str, Any], node: object) -> None:
        """Process a record of the trace, and sample the belief if it changed."""
        self._records.append(record)
        if record["event"] == "belief":
            self._believe(record["step"])

    def event(self, step: int, text: str) -> None:
        """Log a line of text about the latest record of the trace."""
        record = self._records[-1] if self._records else {}
        # records of recoveries contain a failure, too
        level = "WARN" if record.get("event") == "recovery" else "ERROR" if "failure" in record else "INFO"
        self._lines.append((step, text, level))

    def search(self, location: object, log: Rejections) -> None:
        """Register a search for base poses that begins now; it fills ``log`` later."""
        self._searches.setdefault(self._world.steps, []).append(log)

    def _believe(self, step: int) -> None:
        """Record believed poses: held objects in the frame of the hand, unknown ones without a pose."""
        now = {name: Keyframe(step, MAP, self._belief.pose(name)) for name in self._belief.names()}
        for name, grip in self._belief.held.items():
            now[name] = Keyframe(step, frame_of(("robot", grip.link)), grip.offset)
        for name in [name for name in self._believed if name not in now]:
            now[name] = Keyframe(step, MAP, None)
        for name, keyframe in now.items():
            keyframes = self._believed.setdefault(name, [])
            if not keyframes or (keyframes[-1].frame, keyframes[-1].pose) != (keyframe.frame, keyframe.pose):
                keyframes.append(keyframe)

    def save(self, path: Path) -> None:
        """Write the recording."""
        rate, end = self._world.rate, self._world.steps
        tree = RunTree(self._records)
        stream = stream_to(path, self._title, _blueprint(self._recipe, self._view(), end / rate + FLASH))
        record_truth(stream, tuple(self._drawn.values()), self._tracks, rate)
        for name, keyframes in self._believed.items():
            thing = self._drawn.get(("bodies", name))
            if thing is not None and self._is_apart(name, keyframes):
                record_belief(stream, thing.shapes, name, keyframes, rate)
        record_candidates(stream, self._searches, rate)
        tasks = tasks_of(tree, end)
        record_lanes(stream, tree, tasks, end)
        record_tree(stream, tree, tasks)
        if self._recipe is not None:
            record_recipe(stream, self._recipe, tree)
        self._write_lines(stream, tree)
        stream.flush()
        stream.disconnect()

    def _view(self) -> archetypes.EyeControls3D:
        """Initial view, from above at the area in which the robot and things moved."""
        moved = [track for track in self._tracks.values() if not track.frame and len(track.poses) > 1]
        positions = [track.arrays()[1][:, :3] for track in moved or self._tracks.values() if not track.frame]
        points = np.concatenate(positions)
        low, high = np.nanmin(points, axis=0), np.nanmax(points, axis=0)
        middle = (low + high) / 2
        extent = max(float(np.linalg.norm(high - low)), NEAREST)
        return archetypes.EyeControls3D(position=middle + extent * np.array(FROM), look_target=middle, eye_up=(0, 0, 1))

    def _is_apart(self, name: str, keyframes: Sequence[Keyframe]) -> bool:
        """Check whether a thing needs a ghost: it moves, its believed pose changes, or the two differ initially."""
        track = self._tracks.get(("bodies", name))
        if track is None or len(track.poses) > 1 or len(keyframes) > 1:
            return True
        first, believed = track.poses[0], keyframes[0].pose
        return first is None or believed is None or first.distance(believed) > APART

    def _write_lines(self, stream: rerun.RecordingStream, tree: RunTree) -> None:
        """Write the log lines, and at the end of a failed run the chain of causes."""
        end = self._world.steps
        why = [(end, text, "ERROR") for root in tree.roots if root.failure for text in _reasons(root.failure)]
        lines = [*self._lines, *why]
        if not lines:
            return
        steps, texts, levels = zip(*lines, strict=True)
        columns = rerun.TextLog.columns(text=texts, level=levels, color=[COLOURS[level] for level in levels])
        stream.send_columns(TEXT, indexes=[times(steps, self._world.rate)], columns=columns)


def _reasons(failure: Mapping[str, Any]) -> Iterator[str]:
    """Yield the texts of a failure and of its chain of causes."""
    lead, link = "", failure
    while link:
        yield f"{lead}{link['type']}: {link['message']}"
        lead, link = "  because of ", link.get("cause", {})


def _blueprint(recipe: TaskGraph | None, view: archetypes.EyeControls3D, end: float) -> Any:
    """Layout of the viewer: the scene beside graphs and text, and below them lanes on a time axis to ``end`` [s]."""
    graphs = [blueprint.GraphView(origin=TREE, name="Plan")]
    if recipe is not None:
        graphs.append(blueprint.GraphView(origin=RECIPE, name="Recipe"))
    text = blueprint.TextLogView(
        origin=TEXT,
        name="Events",
        columns=archetypes.TextLogColumns(timeline_columns=[TIME_LINE], text_log_columns=["Body"]),
    )
    scene = blueprint.Spatial3DView(
        origin="/",
        name="World",
        contents=[f"/{root}/**" for root in (TRUTH, BELIEF, CANDIDATES)],
        spatial_information=archetypes.SpatialInformation(MAP),
        eye_controls=view,
    )
    above = blueprint.Horizontal(
        scene, blueprint.Vertical(blueprint.Tabs(*graphs), text, row_shares=[3, 2]), column_shares=[3, 2]
    )
    known = inspect.signature(blueprint.StateTimelineView.__init__).parameters
    ends = (rerun.TimeRangeBoundary.absolute(seconds=moment) for moment in (0.0, end))
    # Viewers of rerun 0.32 show the whole range by default. The axis is not linked: a linked axis ignores its range,
    # and centres on the cursor whenever that is set.
    axis = {"time_view": archetypes.TimeAxis(view_range=rerun.TimeRange(*ends))} if "time_view" in known else {}
    lanes = blueprint.StateTimelineView(origin=LANES, name="Lanes", **axis)
    return blueprint.Blueprint(
        blueprint.Vertical(above, lanes, row_shares=[3, 2]),
        blueprint.TimePanel(timeline=TIME_LINE, state="collapsed"),
        blueprint.SelectionPanel(state="hidden"),
        blueprint.BlueprintPanel(state="hidden"),
    )
