"""The world's part of a run's page, collected during the run.

Shapes are the same as in pictures and recordings, equal meshes stored once; poses of entities that moved, true and
believed, are tracks at 10 Hz, delta-encoded in 16 bits; searches for base poses have candidates, reasons of rejections
and the chosen pose. The page itself, and everything that comes from the trace, is ``planlang.report``.
"""

from __future__ import annotations

import hashlib
import math
import zlib
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from executive.belief import Belief
from executive.locations.rejections import MOST_PLACES, Rejections
from executive.pictures import viewpoints
from executive.pictures.drawn import Drawn, Shape, drawn_in
from executive.pictures.floor_plan import colours
from executive.pictures.pose_track import MAP, RATE, Track, Tracks
from executive.pictures.scenery import Outline, outlines
from executive.pictures.solids import Solid
from planlang.designators import Location
from planlang.geometry import IDENTITY, Array, Pose
from planlang.records import dataclass
from planlang.report import Told as Told
from planlang.report import model_of, page
from planlang.report.model import Context
from planlang.report.tree import shown
from planlang.runs.run_tree import RunTree, TaskNode
from sim.truth import Truth

if TYPE_CHECKING:
    from executive.modules.platform import Platform


_KINDS = {"bodies": "body", "robot": "link"}


class Shapes:
    """Shapes of entities, by kind and name as in tracks, and their meshes."""

    def __init__(self) -> None:
        self.of: dict[tuple[str, str], list[dict[str, Any]]] = {}
        self.meshes: list[dict[str, Any]] = []
        """Numbers of vertices and triangles, lower corner and size of the bounding box [m]."""
        self._numbers: dict[bytes, int] = {}
        self._data: list[bytes] = []

    def add(self, drawn: Sequence[Drawn]) -> None:
        """Add the entities that are new."""
        for one in drawn:
            kind, name = _KINDS[one.path[0]], "/".join(one.path[1:])
            kind = "limb" if kind == "body" and len(one.path) > 2 else kind
            if (kind, name) not in self.of:
                self.of[kind, name] = [self._shape(shape) for shape in one.shapes]

    def data(self) -> bytes:
        """All meshes, compressed: vertices as 16-bit fractions of the bounding box by columns, then vertex indices."""
        return zlib.compress(b"".join(self._data), 9)

    def _shape(self, shape: Shape) -> dict[str, Any]:
        data: dict[str, Any] = {"kind": shape.kind, "colour": list(shape.colour)}
        if shape.pose != IDENTITY:
            data["at"] = [round(float(one), 5) for one in (*shape.pose.position, *shape.pose.orientation)]
        if shape.mesh is not None:
            return data | {"mesh": self._mesh(shape.mesh)}
        return data | {"size": [round(float(one), 5) for one in shape.size]}

    def _mesh(self, mesh: Solid) -> int:
        points, corners = np.asarray(mesh.vertices, np.float32), mesh.faces
        key = hashlib.sha256(points.tobytes() + corners.tobytes()).digest()
        if key not in self._numbers:
            self._numbers[key] = len(self.meshes)
            low, high = points.min(axis=0), points.max(axis=0)
            size = np.maximum(high - low, 1e-6)
            fractions = np.rint((points - low) / size * 65535).astype("<u2")
            self._data += [
                np.ascontiguousarray(fractions.T).tobytes(),
                corners.astype("<u4" if len(points) > 65535 else "<u2").tobytes(),
            ]
            self.meshes.append(
                {
                    "vertices": len(points),
                    "triangles": len(corners),
                    "low": [round(float(one), 5) for one in low],
                    "size": [round(float(one), 5) for one in size],
                }
            )
        return self._numbers[key]


FINEST = 1e-4
"""Smallest unit of positions [m]."""
BELIEVED = "belief"


@dataclass(frozen=True, slots=True)
class Entity:
    """A body, limb or link, or a body as it is believed, with its poses."""

    kind: str
    name: str
    frame: str
    """Name of the parent body or link; empty for the map."""
    track: Track
    doubt: Sequence[tuple[int, float]] = ()
    """Of what is believed: steps, and how uncertain its position is from then on, as a standard deviation [m]."""

    def keyframes(self) -> tuple[NDArray[np.int64], Array]:
        """Steps (n,) at which it moved, and positions and quaternions (n, 7) from then on."""
        steps, poses = self.track.arrays()
        is_there = ~np.isnan(poses[:, 0])
        return steps[is_there], poses[is_there]

    def gone(self, rate: float) -> list[list[Any]]:
        """Times [s] at which it disappears (True) or appears again (False)."""
        gone = [pose is None for pose in self.track.poses]
        rows = zip(self.track.steps, gone, [False, *gone], strict=False)
        return [[step / rate, is_gone] for step, is_gone, was_gone in rows if is_gone != was_gone]


class Entities:
    """Records the true and the believed poses of all entities."""

    def __init__(self, belief: Belief) -> None:
        self._belief = belief
        self._told: object = None
        self._believed: dict[str, Track] = {}
        self._doubts: dict[str, list[tuple[int, float]]] = {}
        self.move = Tracks()
        """Records the entities that moved, as reported by :class:`~executive.pictures.pose_track.PoseTrack`."""

    def believe(self, step: int) -> None:
        """Record believed poses that changed since the last call; held objects have none, they move with the hand."""
        belief, state = self._belief, self._belief.state
        estimates = belief.memory.estimates
        if self._told == (told := (state.poses, state.held, state.away, estimates)):
            return
        self._told, names = told, set(belief.names()) - set(state.carried())
        for name in sorted(path[1] for path in self.move if path[0] == "bodies" and len(path) == 2):
            pose = belief.pose(name) if name in names else None
            track = self._believed.get(name)
            if track is None and pose is not None:
                track = self._believed[name] = Track(MAP)
            if track is not None and track.poses[-1:] != [pose]:
                track.add(step, pose)
            deviation = estimates[name].deviation if name in estimates and pose is not None else 0.0
            doubts = self._doubts.setdefault(name, [])
            if deviation != (doubts[-1][1] if doubts else 0.0):
                doubts.append((step, deviation))

    def all(self) -> list[Entity]:
        """List the entities; frames come before what is in them."""
        true = [Entity(*_entity_at(path), _entity_at(one.frame)[1], one) for path, one in self.move.items()]
        believed = (Entity(BELIEVED, name, "", one, self._doubts[name]) for name, one in self._believed.items())
        return ordered([*true, *believed])


def _entity_at(path: tuple[str, ...]) -> tuple[str, str]:
    """Kind and name of the entity at a path of :class:`~executive.pictures.drawn.Drawn`; both are empty for the map."""
    kind = "limb" if len(path) > 2 else _KINDS.get(path[0], "") if path else ""
    return kind, "/".join(path[1:])


def packed(
    entities: Sequence[Entity], rate: float, shapes: Mapping[tuple[str, str], Any]
) -> tuple[dict[str, Any], bytes]:
    """Encode entities with their shapes for the page's model, and their keyframes as compressed binary data.

    The data are the steps of all keyframes as 32-bit integers, then x, y, z, qx, qy, qz, qw as 16-bit integers, column
    by column; each is the difference from the entity's keyframe before. Poses are in the frame of the track.
    """
    index = {(one.kind, one.name): number for number, one in enumerate(entities)}
    keyframes = [one.keyframes() for one in entities]
    all_poses = [_continuous(poses) for _, poses in keyframes]
    farthest = max((float(np.abs(poses[:, :3]).max()) for poses in all_poses if len(poses)), default=1.0)
    scale = max(FINEST, farthest / 32767)
    numbers = [_differences(np.rint(poses / ([scale] * 3 + [1 / 32767] * 4)).astype(np.int64)) for poses in all_poses]
    steps = [_differences(steps.reshape(-1, 1)) for steps, _ in keyframes]
    columns = np.concatenate(numbers or [np.zeros((0, 7))]).T.astype("<i2")
    data = np.concatenate(steps or [np.zeros((0, 1))]).astype("<i4").tobytes() + np.ascontiguousarray(columns).tobytes()
    listed = [_entity(one, index, len(at), shapes, rate) for one, (at, _) in zip(entities, keyframes, strict=True)]
    return {"entities": listed, "scale": scale, "period": 1 / RATE}, zlib.compress(data, 9)


def _entity(
    one: Entity,
    index: Mapping[tuple[str, str], int],
    keys: int,
    shapes: Mapping[tuple[str, str], Any],
    rate: float,
) -> dict[str, Any]:
    frames = ((kind, one.frame) for kind in (("body",) if one.kind == "limb" else ("link",)) if one.kind != "body")
    frame = next((index[key] for key in frames if key in index), -1)
    entity: dict[str, Any] = {"name": one.name, "kind": one.kind, "frame": frame, "keys": keys}
    if one.kind == BELIEVED:
        entity["of"] = index["body", one.name]
    if one.doubt:
        entity["doubt"] = [[round(step / rate, 4), round(deviation, 5)] for step, deviation in one.doubt]
    entity["shapes"] = shapes.get((one.kind, one.name), [])
    gone = one.gone(rate)
    return entity | ({"gone": gone} if gone else {})


def _continuous(poses: Array) -> Array:
    """Normalise the quaternions of poses (n, 7), with signs such that consecutive ones turn the short way."""
    quaternions = poses[:, 3:] / np.linalg.norm(poses[:, 3:], axis=1, keepdims=True)
    signs = np.where((quaternions[1:] * quaternions[:-1]).sum(axis=1) < 0, -1.0, 1.0)
    if len(quaternions):
        quaternions *= np.concatenate([[1.0 if quaternions[0, 3] >= 0 else -1.0], signs]).cumprod()[:, None]
    return np.hstack([poses[:, :3], quaternions])


def _differences(numbers: Any) -> Any:
    return np.diff(numbers, axis=0, prepend=np.zeros((1, numbers.shape[1]), numbers.dtype))


def ordered(entities: Sequence[Entity]) -> list[Entity]:
    """Sort entities so that frames come before their children: bodies, limbs, links by depth, believed poses."""
    kinds = {"body": 0, "limb": 1, "link": 2, BELIEVED: 3}
    parent_of = {one.name: one.frame for one in entities if one.kind == "link"}

    def depth(one: Entity) -> int:
        count, frame = 0, one.frame if one.kind == "link" else ""
        while frame:
            count, frame = count + 1, parent_of.get(frame, "")
        return count

    return sorted(entities, key=lambda one: (kinds[one.kind], depth(one)))


MOST_QUESTIONS = 100
"""Largest number of searches on a page."""


@dataclass(frozen=True, slots=True)
class Search:
    """A search for base poses: when it began [world steps], the location, and the log of its candidates."""

    step: int
    location: Location
    log: Rejections


class Questions:
    """Collects the searches of a run."""

    def __init__(self) -> None:
        self.searches: list[Search] = []
        self.step = 0

    def watch(self, location: Location, log: Rejections) -> None:
        """Register a search that begins; it fills ``log`` later."""
        if len(self.searches) < MOST_QUESTIONS:
            self.searches.append(Search(self.step, location, log))

    def model(self, tree: RunTree) -> list[dict[str, Any]]:
        """Build the page's data of all searches with candidates, each with the task that needed the location."""
        texts = {id(one): str(one.location) for one in self.searches}
        by_location: dict[str, list[TaskNode]] = {}
        for node in tree.numbered.values():
            if isinstance(text := node.parameters.get("location"), str):
                by_location.setdefault(text, []).append(node)
        questions = []
        for one in self.searches:
            earlier = [node for node in by_location.get(texts[id(one)], ()) if (node.begun or 0) <= one.step]
            if (question := _question(one, earlier[-1] if earlier else None, tree.rate)) is not None:
                questions.append(question)
        clouds = [question[name] for question in questions for name in ("bases", "hands")]
        colour_of = colours([reason["text"] for cloud in clouds for reason in cloud["reasons"]])
        for reason in (reason for cloud in clouds for reason in cloud["reasons"]):  # same colours in all searches
            reason["colour"] = "#{:02x}{:02x}{:02x}".format(*colour_of[reason["text"]])
        return questions


def _question(one: Search, node: TaskNode | None, rate: float) -> dict[str, Any] | None:
    log = one.log
    if not (log.counts or log.places or log.refused):
        return None
    bases: dict[str, list[Array]] = {}
    for reason, candidates in log.refused:
        bases.setdefault(reason, []).append(np.asarray(candidates, float)[:, :2])
    for place in log.places:
        bases.setdefault(place.reason, []).append(np.array([place.base[:2]], float))
    hands: dict[str, list[Array]] = {}
    for reason, candidates in log.hands:
        hands.setdefault(reason, []).append(np.asarray(candidates, float)[:, :2])
    events = node.happened if node is not None else ()
    chosen = next((event for event in events if event.event == "solution" and event.step >= one.step), None)
    accepted = sum(place.reason == "" for place in log.places)
    return {
        "time": round(one.step / rate, 4),
        "node": None if node is None else node.number,
        "location": shown(one.location),
        "chosen": None if chosen is None else [round(float(number), 4) for number in chosen.details["base"]],
        "bases": _cloud(bases, {**log.counts, **({"": accepted} if accepted else {})}),
        "hands": _cloud(hands, {reason: sum(map(len, parts)) for reason, parts in hands.items()}),
        "blocking": [[shown(body), number] for body, number in log.blocking.most_common(8)],
    }


def _cloud(groups: Mapping[str, list[Array]], counts: Mapping[str, int]) -> dict[str, Any]:
    """Reasons with their numbers of candidates, most frequent first, and points [index of reason, x, y].

    At most ``MOST_PLACES`` evenly spaced points are kept for each reason. The empty reason (accepted) comes last.
    """
    distinct = {reason: np.unique(np.concatenate(parts).round(3), axis=0) for reason, parts in groups.items()}
    number_of = {**{reason: len(points) for reason, points in distinct.items()}, **counts}
    reasons = sorted(number_of, key=lambda reason: (reason == "", -number_of[reason], reason))
    points = []
    for index, reason in enumerate(reasons):
        positions = distinct.get(reason, np.zeros((0, 2)))
        rows = np.linspace(0, len(positions) - 1, min(MOST_PLACES, len(positions))).round().astype(int)
        points += [[index, x, y] for x, y in positions[rows].tolist()]
    return {"reasons": [{"text": shown(reason), "count": number_of[reason]} for reason in reasons], "points": points}


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
        self._entities, self._shapes, self._questions = Entities(platform.belief), Shapes(), Questions()
        self._start = truth.configuration().base
        self._outlines = [_local(one, platform.scene.world.pose(one.name)) for one in outlines(platform.scene)]
        self._count = -1
        platform.resolver.watchers.append(self._questions.watch)

        self.move = self._entities.move
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
        self._entities.believe(world.steps)
        if self._count != world.changed:  # bodies were added
            self._count = world.changed
            self._shapes.add(drawn_in(world))

    def world(self) -> tuple[dict[str, Any], dict[str, bytes]]:
        """Build the world's part of the page's model, and its binary data by name."""
        shapes, bounds = self._shapes, [round(float(one), 3) for one in self._truth.scene.bounds]
        tracks, keys = packed(self._entities.all(), self._truth.rate, shapes.of)
        radius = self._platform.scene.robot.base.radius
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
