"""Cameras and rays: what a camera recognises, and which share of a body is visible, by a software renderer."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterator, Sequence
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from planlang.geometry import Array, Pose
from planlang.geometry.matrices import moved, rotated
from planlang.geometry.shapes import SolidKind, area, corners, outline_of
from planlang.protocols import Detection
from sim.bodies import Bodies
from sim.engine import bullet
from sim.robot import Robot
from sim.scene import BodyShape, CameraModel

LEAST_PIXELS = 4
"""Smallest number of pixels with which an object is recognised."""
READABLE = 0.5
"""Visible share from which on a mark is read."""

_CLIP = 0.02
"""Distance below which bodies, such as the camera's own housing, are not seen [m]."""
_AHEAD = 1e-4
"""Distance of the rendering eye ahead of the camera [m]: with a face exactly in its plane, PyBullet never returns."""
_FAR = 60.0
"""Far clipping plane [m]: the extent of the ground in a scene without a room."""
_SIDES = 12
"""Points around a round shape: the polygon is 5 % smaller than the circle, less than the error of real cameras."""
_PATCHES = 5
"""Patches per side of a face, and along a cylinder, whose visibility is tested."""
_UNSEEN = (BodyShape.MARKER, BodyShape.ROOM)


class Camera:
    """Renders pictures in one physics client."""

    def __init__(self, client: int, bodies: Bodies) -> None:
        self.client, self.bodies = client, bodies

    def detect(self, model: CameraModel, pose: Pose) -> dict[str, Detection]:
        """Recognise bodies with enough pixels in a segmentation picture taken at the pose of the camera's link.

        The names of the bodies stay in the simulator: a camera tells the detections. The visible share is the number of
        pixels divided by the area of the unoccluded silhouette, which includes parts beyond the border of the picture.
        """
        seen, found = self._segments(model, pose), dict[str, Detection]()
        for name, count in seen.items():
            body = self.bodies.bodies[name]
            if body.shape in _UNSEEN or name in self.bodies.removed or count < LEAST_PIXELS:
                continue
            place = self.bodies.poses[name]
            if not model.near <= place.distance(pose) <= model.far:
                continue
            share = min(1.0, count / max(self._silhouette(name, model, pose), 1.0))
            mark = body.mark if share >= READABLE else None
            label, face = (None, mark) if body.shape is BodyShape.PERSON else (mark, None)
            found[name] = Detection(
                body.type, place, round(share, 3), body.size, colour=body.colour, label=label, face_of=face
            )
        return found

    def scan(self, model: CameraModel, pose: Pose) -> tuple[Array, NDArray[np.bool_]]:
        """Trace lines through the pixels: their ends (n, 3) in the map, and whether each is on a surface, (n,).

        Lines that meet nothing end at the camera's greatest distance; pixels that show the robot are left out.
        """
        eye, forward, up = _axes(model, pose)
        eye = eye + _AHEAD * forward
        tall = math.tan(model.fov / 2) * model.height / model.width
        depth, mask = (layer.reshape(-1) for layer in self._picture(model, pose, model.far))
        along = _FAR * _CLIP / (_FAR - (_FAR - _CLIP) * depth)
        across = (np.arange(model.width) + 0.5) / model.width * 2 - 1
        down = 1 - (np.arange(model.height) + 0.5) / model.height * 2
        right, above = np.cross(forward, up) * math.tan(model.fov / 2), up * tall
        lines = forward + across[None, :, None] * right + down[:, None, None] * above
        lines = lines.reshape(-1, 3)
        most = model.far / np.linalg.norm(lines, axis=1)
        kept = np.array([uid < 0 or self.bodies.name_of(int(uid)) is not None for uid in np.unique(mask)], bool)
        shown = kept[np.searchsorted(np.unique(mask), mask)]
        ends = eye + lines * np.minimum(along, most)[:, None]
        return ends[shown], (along < most)[shown]

    def _segments(self, model: CameraModel, pose: Pose) -> dict[str, int]:
        """Count the pixels of each body."""
        _, mask = self._picture(model, pose, model.far + self.bodies.reach)
        counts: dict[str, int] = {}
        for uid, count in zip(*np.unique(mask, return_counts=True), strict=True):
            name = self.bodies.name_of(int(uid))
            if name is not None:
                counts[name] = counts.get(name, 0) + int(count)
        return counts

    def _picture(self, model: CameraModel, pose: Pose, far: float) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
        """Render what is up to a distance [m]: depth buffer (0..1), and id of the body in each pixel (height, width).

        The software renderer gives the same on every machine.
        """
        eye, forward, up = _axes(model, pose)
        eye = eye + _AHEAD * forward
        shape = model.height, model.width
        vertical = 2 * math.atan(math.tan(model.fov / 2) * model.height / model.width)
        view = bullet.computeViewMatrix(eye.tolist(), (eye + forward).tolist(), up.tolist())
        lens = bullet.computeProjectionMatrixFOV(math.degrees(vertical), model.width / model.height, _CLIP, _FAR)
        self._fill(model, pose, far)
        _, _, _, depth, mask = bullet.getCameraImage(
            model.width,
            model.height,
            view,
            lens,
            shadow=0,
            renderer=bullet.ER_TINY_RENDERER,
            physicsClientId=self.client,
        )
        # PyBullet built without NumPy returns flat tuples.
        return np.asarray(depth, np.float32).reshape(shape), np.asarray(mask, np.int32).reshape(shape)

    def _fill(self, model: CameraModel, pose: Pose, far: float) -> None:
        """Make what the camera may see up to a distance [m], and what may hide it, in the client."""
        eye, forward, up = _axes(model, pose)
        wide = math.tan(model.fov / 2)
        right, above = np.cross(forward, up) * wide, up * (wide * model.height / model.width)
        rim = [forward + i * right + k * above for i, k in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
        normals = np.array([np.cross(one, other) for one, other in zip(rim, [*rim[1:], rim[0]], strict=True)])
        ends = eye + far * np.array([np.zeros(3), *rim])
        planes = np.column_stack([normals, normals @ eye])
        self.bodies.fill(ends.min(axis=0), ends.max(axis=0), planes)

    def _silhouette(self, name: str, model: CameraModel, pose: Pose) -> float:
        """Compute the pixels that a body would cover with nothing in front of it.

        Pieces may hide each other, as the walls of a cup do: it covers no more than the hull of them all.
        """
        eye, forward, up = _axes(model, pose)
        right = np.cross(forward, up)
        focal = model.width / 2 / math.tan(model.fov / 2)
        total, points = 0.0, list[Array]()
        for index in self.bodies.of[name]:
            offset = self._outline(index) - eye
            depth = np.maximum(offset @ forward, _CLIP)
            points.append(np.column_stack([offset @ right / depth, offset @ up / depth]) * focal)
            total += area(outline_of(points[-1]))
        return min(total, area(outline_of(np.vstack(points)))) if len(points) > 1 else total

    def _outline(self, index: int) -> Array:
        """List points in the map whose convex hull is the piece; circles are approximated by polygons."""
        piece = self.bodies.pieces[index]
        place = piece.pose
        size = piece.part.size
        if piece.part.kind == SolidKind.BOX:
            return corners(place, size)
        ring = _ring(max(size[:2]) / 2)
        if piece.part.kind == SolidKind.CYLINDER:
            rings = [np.add(ring, (0.0, 0.0, height)) for height in (-size[2] / 2, size[2] / 2)]
        else:
            rings = [ring, ring[:, [2, 0, 1]], ring[:, [1, 2, 0]]]
        return moved(place.matrix(), np.vstack(rings))

    def sight(self, name: str, model: CameraModel, pose: Pose, cast: Any) -> tuple[float, dict[str, int]]:
        """Compute the share (0..1) of a body's camera-facing surface in sight; count what lines of sight hit.

        The share is 0 if the body's centre is out of the camera's range; points outside the field of view count as
        hidden, but their lines are counted. ``cast`` is the world's batch ray test.
        """
        axes = _axes(model, pose)
        points, weights = self._facing(name, axes[0])
        if name in self.bodies.removed or not len(points):
            return 0.0, {}
        offset = points - axes[0]
        starts = axes[0] + offset / np.linalg.norm(offset, axis=1)[:, None] * _CLIP
        lines: Sequence[str | None] = cast(starts, axes[0] + offset * 1.01)
        counts: dict[str, int] = {}
        for hit in lines:
            if hit is not None:
                counts[hit] = counts.get(hit, 0) + 1
        if not model.near <= self.bodies.poses[name].distance(pose) <= model.far:
            return 0.0, counts
        seen = _framed(offset, model, axes) & np.array([hit == name for hit in lines], bool)
        return round(float(weights[seen].sum() / weights.sum()), 3), counts

    def _facing(self, name: str, eye: Array) -> tuple[Array, Array]:
        """Sample the surface that faces the eye: points, and their shares of the silhouette."""
        points, weights = [], []
        for index in self.bodies.of[name]:
            piece = self.bodies.pieces[index]
            place = piece.pose
            local, normals, areas = _surface(piece.part.kind, piece.part.size)
            turned = moved(place.matrix(), local)
            towards = eye - turned
            distance = np.linalg.norm(towards, axis=1)
            cosine = np.sum(rotated(place.rotation, normals) * towards, axis=1) / np.maximum(distance, 1e-9)
            seen = cosine > 0.05
            points.append(turned[seen])
            weights.append((cosine * areas / np.maximum(distance, 1e-9) ** 2)[seen])
        if not points:
            return np.zeros((0, 3)), np.zeros(0)
        return np.vstack(points), np.concatenate(weights)


def _axes(model: CameraModel, pose: Pose) -> tuple[Array, Array, Array]:
    """Position, viewing direction and upward direction of the camera in the map."""
    turn = pose.rotation
    return np.asarray(pose.position), rotated(turn, np.asarray(model.forward)), rotated(turn, np.asarray(model.up))


def _framed(offset: Array, model: CameraModel, axes: tuple[Array, Array, Array]) -> NDArray[np.bool_]:
    """Check which points, given as offsets from the camera, are in its field of view."""
    _, forward, up = axes
    right = np.cross(forward, up)
    depth = offset @ forward
    wide = math.tan(model.fov / 2)
    return np.asarray(
        (depth > _CLIP)
        & (np.abs(offset @ right) <= depth * wide)
        & (np.abs(offset @ up) <= depth * wide * model.height / model.width)
    )


@lru_cache(maxsize=256)
def _surface(kind: SolidKind, size: tuple[float, float, float]) -> tuple[Array, Array, Array]:
    """Sample the surface of a primitive: points, outward normals and areas of patches, in its frame."""
    patches: list[tuple[Array, Array, float]] = []
    """Points and normals (n, 3) of equal patches, and the area of one."""
    grid = (np.arange(_PATCHES) + 0.5) / _PATCHES - 0.5
    radius, height = max(size[:2]) / 2, size[2]
    ring = _ring(1.0)
    if kind == SolidKind.BOX:
        across = np.stack(np.meshgrid(grid, grid, indexing="ij"), axis=-1).reshape(-1, 2)
        for axis in range(3):
            sides = [k for k in range(3) if k != axis]
            for sign in (-1.0, 1.0):
                points, normals = np.full((len(across), 3), sign * size[axis] / 2), np.zeros((len(across), 3))
                points[:, sides] = across * np.array(size)[sides]
                normals[:, axis] = sign
                patches.append((points, normals, size[sides[0]] * size[sides[1]] / _PATCHES**2))
    elif kind == SolidKind.CYLINDER:
        side = 2 * math.pi * radius * height / _SIDES / _PATCHES
        patches += [(ring * radius + [0.0, 0.0, share * height], ring, side) for share in grid]
        for sign in (-1.0, 1.0):
            end = ring * radius * 0.6 + [0.0, 0.0, sign * height / 2]
            patches.append((end, np.tile([0.0, 0.0, sign], (_SIDES, 1)), math.pi * radius**2 / _SIDES))
    else:
        for sine in (-0.8, -0.4, 0.0, 0.4, 0.8):  # bands of equal height have equal areas (Archimedes)
            direction = ring * math.sqrt(1 - sine * sine) + [0.0, 0.0, sine]
            patches.append((direction * radius, direction, 4 * math.pi * radius**2 / 5 / _SIDES))
    areas = [np.full(len(points), area) for points, _, area in patches]
    return np.vstack([one[0] for one in patches]), np.vstack([one[1] for one in patches]), np.concatenate(areas)


def _ring(radius: float) -> Array:
    """List points (n, 3) on a horizontal circle around the origin."""
    angles = np.arange(_SIDES) * (2 * math.pi / _SIDES)
    return np.column_stack([np.cos(angles) * radius, np.sin(angles) * radius, np.zeros(_SIDES)])


_EVERYTHING, _NOT_ROBOT = -1, ~64
_ROBOT_GROUP = 64


class Rays:
    """Ray casts; the robot's links form a collision group of their own, so that rays can ignore them."""

    def __init__(self, client: int, bodies: Bodies, robot: Robot | None) -> None:
        self.client, self.bodies, self.robot = client, bodies, robot
        if robot is not None:
            for index in robot.links.values():
                bullet.setCollisionFilterGroupMask(robot.uid, index, _ROBOT_GROUP, -1, physicsClientId=client)

    def _hits(self, starts: Array, ends: Array, mask: int) -> list[Any]:
        both = np.concatenate([starts, ends]).reshape(-1, 3)
        if not len(both):
            return []
        self.bodies.fill(both.min(axis=0), both.max(axis=0))
        hits: list[Any] = bullet.rayTestBatch(
            starts.tolist(), ends.tolist(), collisionFilterMask=mask, physicsClientId=self.client
        )
        return hits

    def _name(self, hit: Any) -> str | None:
        if self.robot is not None and hit[0] == self.robot.uid:
            return self.robot.link_names[hit[1]]
        return self.bodies.name_of(hit[0])

    def cast(self, starts: Array, ends: Array) -> tuple[str | None, ...]:
        """Name the bodies or links that lines from starts (n, 3) to ends (n, 3) hit first, n < 16,384."""
        return tuple(self._name(hit) for hit in self._hits(starts, ends, _EVERYTHING))

    def down(self, starts: Array, ends: Array) -> tuple[tuple[str | None, ...], Array]:
        """Name the bodies that lines hit, ignoring the robot, with the heights of the hits (0 for none)."""
        hits = self._hits(starts, ends, _NOT_ROBOT)
        return tuple(self._name(hit) for hit in hits), np.array([float(hit[3][2]) for hit in hits])

    def free(self, starts: Array, ends: Array) -> NDArray[np.bool_]:
        """Check which lines from starts (n, 3) to ends (n, 3) hit no body, ignoring the robot, n < 16,384."""
        return np.array([hit[0] < 0 for hit in self._hits(starts, ends, _NOT_ROBOT)], bool)

    @contextlib.contextmanager
    def without(self, *names: str) -> Iterator[None]:
        """Cast rays as if some bodies were absent."""
        pieces = [index for name in names for index in self.bodies.of[name]]
        self.bodies.hide(pieces)
        try:
            yield
        finally:
            self.bodies.show(pieces)
