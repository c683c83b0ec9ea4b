"""Recordings of runs for the rerun viewer: the world, what is believed of it, and the plan, on one time line.

Importing it needs the package rerun-sdk; :func:`executive.pictures.drawn.missing` asks for that before.
"""

from __future__ import annotations

import inspect
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import rerun
from rerun import blueprint
from rerun.blueprint import archetypes

from executive.belief import Belief
from executive.locations.rejections import Rejections
from executive.pictures.drawn import drawn_in
from executive.pictures.pose_track import Placed, Tracks
from executive.pictures.recorded_candidates import record_candidates
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
    Stand,
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

TEXT = "events"
APART = 0.002
"""A thing believed less far from its place than this [m] has no ghost: it could not be seen."""
COLOURS = {"ERROR": FAILED, "WARN": (230, 145, 30), "INFO": (120, 120, 125)}
"""Colours of lines about the plan, by level."""

FROM, NEAREST = (-0.6, -0.7, 0.8), 4.0
"""From where one looks first, as shares of the extent of what moves; and the least extent [m]."""


class Recording:
    """What happens in one run, kept in memory until :meth:`save`: single log calls cost 50 us each, columns little."""

    def __init__(
        self, world: Truth, belief: Belief, *, recipe: TaskGraph | None = None, title: str = "planlang run"
    ) -> None:
        """Begin a recording of the true world; ``recipe`` is the graph of the steps that the plan was compiled from."""
        self._world, self._belief, self._recipe, self._title = world, belief, recipe, title
        self._tracks = Tracks()
        self._drawn = {thing.path: thing for thing in drawn_in(world)}
        self._records: list[Mapping[str, Any]] = []
        self._lines: list[tuple[int, str, str]] = []
        self._searches: dict[int, list[Rejections]] = {}
        self._believed: dict[str, list[Stand]] = {}
        self._believe(0)

    def move(self, step: int, found: Sequence[Placed]) -> None:
        """Keep what has moved; what has come into being is drawn as it is then."""
        self._tracks(step, found)
        if any(one.path not in self._drawn and one.path[0] == "bodies" for one in found):
            self._drawn = {thing.path: thing for thing in drawn_in(self._world)} | self._drawn

    def hear(self, record: Mapping[str, Any], node: object) -> None:
        """Keep a record of the trace, and what is believed after a change."""
        self._records.append(record)
        if record["event"] == "belief":
            self._believe(record["step"])

    def event(self, step: int, text: str) -> None:
        """Keep a line about the record that was heard last."""
        record = self._records[-1] if self._records else {}
        # a recovery has the failure that it is about
        level = "WARN" if record.get("event") == "recovery" else "ERROR" if "failure" in record else "INFO"
        self._lines.append((step, text, level))

    def search(self, location: object, log: Rejections) -> None:
        """Keep the log of a search for base poses that begins now: it is filled as candidates are looked at."""
        self._searches.setdefault(self._world.steps, []).append(log)

    def _believe(self, step: int) -> None:
        """Keep where things are believed to be: what hands hold in their frames, what is unknown nowhere."""
        now = {name: Stand(step, MAP, self._belief.pose(name)) for name in self._belief.names()}
        for name, grip in self._belief.held.items():
            now[name] = Stand(step, frame_of(("robot", grip.link)), grip.offset)
        for name in [name for name in self._believed if name not in now]:
            now[name] = Stand(step, MAP, None)
        for name, stand in now.items():
            stands = self._believed.setdefault(name, [])
            if not stands or (stands[-1].frame, stands[-1].pose) != (stand.frame, stand.pose):
                stands.append(stand)

    def save(self, path: Path) -> None:
        """Write the recording."""
        rate, end = self._world.rate, self._world.steps
        tree = RunTree(self._records)
        stream = stream_to(path, self._title, _blueprint(self._recipe is not None, self._view(), end / rate + FLASH))
        record_truth(stream, tuple(self._drawn.values()), self._tracks, rate)
        for name, stands in self._believed.items():
            thing = self._drawn.get(("bodies", name))
            if thing is not None and self._is_apart(name, stands):
                record_belief(stream, thing.shapes, name, stands, rate)
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
        """A view from above at where the robot and things have moved."""
        moved = [track for track in self._tracks.values() if not track.frame and len(track.poses) > 1]
        every = [track.arrays()[1][:, :3] for track in moved or self._tracks.values() if not track.frame]
        points = np.concatenate(every)
        low, high = np.nanmin(points, axis=0), np.nanmax(points, axis=0)
        middle = (low + high) / 2
        away = max(float(np.linalg.norm(high - low)), NEAREST)
        return archetypes.EyeControls3D(position=middle + away * np.array(FROM), look_target=middle, eye_up=(0, 0, 1))

    def _is_apart(self, name: str, stands: Sequence[Stand]) -> bool:
        """Whether a thing is ever believed elsewhere than where it is at the beginning, or moves."""
        track = self._tracks.get(("bodies", name))
        if track is None or len(track.poses) > 1 or len(stands) > 1:
            return True
        first, believed = track.poses[0], stands[0].pose
        return first is None or believed is None or first.distance(believed) > APART

    def _write_lines(self, stream: rerun.RecordingStream, tree: RunTree) -> None:
        """Write the lines of the run, and at its end why it failed, with the causes."""
        end = self._world.steps
        why = [(end, text, "ERROR") for root in tree.roots if root.failure for text in _reasons(root.failure)]
        lines = [*self._lines, *why]
        if not lines:
            return
        steps, texts, levels = zip(*lines, strict=True)
        columns = rerun.TextLog.columns(text=texts, level=levels, color=[COLOURS[level] for level in levels])
        stream.send_columns(TEXT, indexes=[times(steps, self._world.rate)], columns=columns)


def _reasons(failure: Mapping[str, Any]) -> Iterator[str]:
    """Yield a failure, and each cause of the one before."""
    lead, link = "", failure
    while link:
        yield f"{lead}{link['type']}: {link['message']}"
        lead, link = "  because of ", link.get("cause", {})


def _blueprint(has_recipe: bool, view: archetypes.EyeControls3D, end: float) -> Any:
    """The scene, large, beside graph and text; below all lanes on one axis, which ends at ``end`` [s]."""
    graphs = [blueprint.GraphView(origin=TREE, name="Plan")]
    if has_recipe:
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
    # A viewer of 0.32 shows all of the time by itself. No link: this axis is the only one, and a linked one ignores
    # its range, and centres on the cursor whenever that is set.
    axis = {"time_view": archetypes.TimeAxis(view_range=rerun.TimeRange(*ends))} if "time_view" in known else {}
    lanes = blueprint.StateTimelineView(origin=LANES, name="Lanes", **axis)
    return blueprint.Blueprint(
        blueprint.Vertical(above, lanes, row_shares=[3, 2]),
        blueprint.TimePanel(timeline=TIME_LINE, state="collapsed"),
        blueprint.SelectionPanel(state="hidden"),
        blueprint.BlueprintPanel(state="hidden"),
    )
