"""Poses over time on the page of a run: of entities that moved, at 10 Hz, delta-encoded in 16 bits."""

from __future__ import annotations

import zlib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import field
from typing import Any

import numpy as np

from executive.belief import Belief
from executive.pictures.pose_track import RATE, Placed
from planlang.geometry import Array, Pose
from planlang.records import dataclass

FINEST = 1e-4
"""Smallest unit of positions [m]."""
BELIEVED = "belief"


@dataclass(slots=True)
class Track:
    """Poses of a body, limb or link, or the believed poses of a body, as keyframes at the steps where it moved."""

    kind: str
    name: str
    frame: str
    """Name of the parent body or link; empty for the map."""
    steps: list[int] = field(default_factory=list)
    poses: list[tuple[float, ...]] = field(default_factory=list)
    """Position [m] and quaternion (x, y, z, w) at each of the steps."""
    gone: list[tuple[int, bool]] = field(default_factory=list)
    """Steps at which it disappears (True) or appears again (False)."""

    def add(self, step: int, pose: Pose) -> None:
        """Add a keyframe."""
        self.steps.append(step)
        self.poses.append((*pose.position, *pose.orientation))

    def is_there(self, step: int, there: bool) -> None:
        """Record whether it exists from a step on."""
        if (not self.gone[-1][1] if self.gone else True) != there:
            self.gone.append((step, not there))


class Tracks:
    """Records the true and the believed poses of all entities."""

    def __init__(self, rate: int, belief: Belief) -> None:
        self._belief = belief
        self._revision = -1
        self._believed: dict[str, Pose] = {}
        self.rate = rate
        self.all: dict[tuple[str, str], Track] = {}
        """By kind and name, in the order of their first keyframes."""

    def move(self, step: int, found: Sequence[Placed]) -> None:
        """Record the entities that moved, as reported by :class:`~executive.pictures.pose_track.PoseTrack`."""
        for one in found:
            (kind, name), (_, frame) = _entity_at(one.path), _entity_at(one.frame)
            track = self._track(kind, name, frame)
            track.is_there(step, one.pose is not None)
            if one.pose is not None:
                track.add(step, one.pose)

    def believe(self, step: int) -> None:
        """Record believed poses that changed since the last call, except for held objects, which move with the hand."""
        if self._revision == self._belief.revision:
            return
        self._revision = self._belief.revision
        belief, names = self._belief, set(self._belief.names())
        held = belief.carried()
        for name in sorted(names & {name for kind, name in self.all if kind == "body"}):
            pose = belief.pose(name)
            if name not in held and self._believed.get(name) != pose:
                self._believed[name] = pose
                self._track(BELIEVED, name, "").add(step, pose)
        for (kind, name), track in self.all.items():
            if kind == BELIEVED:
                track.is_there(step, name in names and name not in held)

    def _track(self, kind: str, name: str, frame: str) -> Track:
        if (kind, name) not in self.all:
            self.all[kind, name] = Track(kind, name, frame)
        return self.all[kind, name]


_KINDS = {"bodies": "body", "robot": "link"}


def _entity_at(path: tuple[str, ...]) -> tuple[str, str]:
    """Kind and name of the entity at a path of :class:`~executive.pictures.drawn.Drawn`; both are empty for the map."""
    kind = "limb" if len(path) > 2 else _KINDS.get(path[0], "") if path else ""
    return kind, "/".join(path[1:])


def packed(tracks: Sequence[Track], rate: float, shapes: Mapping[tuple[str, str], Any]) -> tuple[dict[str, Any], bytes]:
    """Encode entities with their shapes for the page's model, and their keyframes as compressed binary data.

    The data are the steps of all keyframes as 32-bit integers, then x, y, z, qx, qy, qz, qw as 16-bit integers, column
    by column; each is the difference from the entity's keyframe before. Poses are in the frame of the track.
    """
    index = {(one.kind, one.name): number for number, one in enumerate(tracks)}
    entities = [_entity(one, index, rate, shapes) for one in tracks]
    all_poses = [_continuous(np.array(one.poses, float).reshape(-1, 7)) for one in tracks]
    farthest = max((float(np.abs(poses[:, :3]).max()) for poses in all_poses if len(poses)), default=1.0)
    scale = max(FINEST, farthest / 32767)
    numbers = [_differences(np.rint(poses / ([scale] * 3 + [1 / 32767] * 4)).astype(np.int64)) for poses in all_poses]
    steps = [_differences(np.array(one.steps, np.int64).reshape(-1, 1)) for one in tracks]
    columns = np.concatenate(numbers or [np.zeros((0, 7))]).T.astype("<i2")
    data = np.concatenate(steps or [np.zeros((0, 1))]).astype("<i4").tobytes() + np.ascontiguousarray(columns).tobytes()
    return {"entities": entities, "scale": scale, "period": 1 / RATE}, zlib.compress(data, 9)


def _entity(
    one: Track, index: Mapping[tuple[str, str], int], rate: float, shapes: Mapping[tuple[str, str], Any]
) -> dict[str, Any]:
    frames = ((kind, one.frame) for kind in (("body",) if one.kind == "limb" else ("link",)) if one.kind != "body")
    frame = next((index[key] for key in frames if key in index), -1)
    entity: dict[str, Any] = {"name": one.name, "kind": one.kind, "frame": frame, "keys": len(one.steps)}
    if one.kind == BELIEVED:
        entity["of"] = index["body", one.name]
    entity["shapes"] = shapes.get((one.kind, one.name), [])
    return entity | ({"gone": [[step / rate, is_gone] for step, is_gone in one.gone]} if one.gone else {})


def _continuous(poses: Array) -> Array:
    """Normalise the quaternions of poses (n, 7), with signs such that consecutive ones turn the short way."""
    quaternions = poses[:, 3:] / np.linalg.norm(poses[:, 3:], axis=1, keepdims=True)
    signs = np.where((quaternions[1:] * quaternions[:-1]).sum(axis=1) < 0, -1.0, 1.0)
    if len(quaternions):
        quaternions *= np.concatenate([[1.0 if quaternions[0, 3] >= 0 else -1.0], signs]).cumprod()[:, None]
    return np.hstack([poses[:, :3], quaternions])


def _differences(numbers: Any) -> Any:
    return np.diff(numbers, axis=0, prepend=np.zeros((1, numbers.shape[1]), numbers.dtype))


def ordered(tracks: Iterable[Track]) -> list[Track]:
    """Sort tracks so that frames come before their children: bodies, limbs, links by depth, believed poses."""
    kinds = {"body": 0, "limb": 1, "link": 2, BELIEVED: 3}
    unsorted = list(tracks)
    parent_of = {one.name: one.frame for one in unsorted if one.kind == "link"}

    def depth(one: Track) -> int:
        count, frame = 0, one.frame if one.kind == "link" else ""
        while frame:
            count, frame = count + 1, parent_of.get(frame, "")
        return count

    return sorted(unsorted, key=lambda one: (kinds[one.kind], depth(one)))
