"""Movers, obstacles and pairs of them as the arrays that checkers read, compiled or not."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from executive.motion.backends import FIRST_JOINT
from executive.motion.bodies import Movers, Obstacles, Watched
from executive.motion.facets import Facets, sizes_of
from executive.motion.kinematics import Chain
from executive.motion.solids import Solids
from planlang.geometry import Array

TOUCHING = 0.001
"""How deep spheres are inside of what counts as hit [m]: what exact queries take for touching, and rounding."""
BEYOND = 0.002
"""How much farther apart than the slack bodies are that do not touch for sure [m]: collision margins of meshes."""


@dataclass(frozen=True, slots=True, eq=False)
class Bodies:
    """Movers and pieces of obstacles as arrays, in the layout of ``struct bodies`` in collision.c."""

    base: Array
    cluster: NDArray[np.int32]
    cluster_group: NDArray[np.int32]
    frame_ball: Array
    obstacle_frame: NDArray[np.int32]
    obstacle_ball: Array
    group_part: NDArray[np.int32]
    group_pair: NDArray[np.int32]
    group_width: Array
    part_ball: Array
    part_sphere: NDArray[np.int32]
    spheres: Array
    pair_piece: NDArray[np.int32]
    limit: Array
    sure: Array
    piece_kind: NDArray[np.int32]
    piece: Array
    solids: Solids
    """The pieces, each in its own frame."""
    part_frame: NDArray[np.int32]
    pair_part: NDArray[np.int32]
    piece_frame: NDArray[np.int32]
    part_faces: NDArray[np.int32]
    piece_faces: NDArray[np.int32]
    corner_first: NDArray[np.int32]
    corners: Array
    plane_first: NDArray[np.int32]
    planes: Array
    beyond: Array

    def widen(self) -> None:
        """Tell the groups how far pairs have to be looked at, after ``limit`` or ``sure`` have changed."""
        widths = np.maximum(self.limit, self.sure)
        if len(widths):
            self.group_width[:, 1] = np.maximum.reduceat(widths, self.group_pair[:-1])
            of_clusters = np.maximum.reduceat(self.group_width[:, 1], self.cluster_group[:-1])
            self.group_width[self.cluster_group[:-1], 0] = of_clusters


def arrays_of(chain: Chain, base: Array, movers: Movers, obstacles: Obstacles, groups: Watched) -> Bodies:
    """What a checker reads, for a base pose (4, 4) in the map and pairs in groups by obstacle and frame."""
    solids, first = obstacles.solids, obstacles.first
    sizes = sizes_of(first)[groups.obstacles]
    keys = np.stack([movers.frames[groups.movers], groups.obstacles], axis=1)
    begins = np.flatnonzero(np.append(True, (keys[1:] != keys[:-1]).any(axis=1))[: len(keys)])
    group_pair = np.concatenate([[0], np.cumsum(sizes)])
    part_ball = _balls(movers.spheres, movers.first)
    by_frame = np.argsort(movers.frames, kind="stable")
    frames = FIRST_JOINT + len(chain.carriers)
    of_frames = np.searchsorted(movers.frames[by_frame], np.arange(frames + 1))
    pieces = np.column_stack([solids.centres, solids.reach])
    slack = np.repeat(movers.slack[groups.movers] + obstacles.slack[groups.obstacles], sizes)
    faces, part_faces, piece_faces = _polyhedra(movers, obstacles)
    steps = np.arange(group_pair[-1]) - np.repeat(group_pair[:-1], sizes)
    found = Bodies(
        base=np.concatenate([base[:3, :3].ravel(), base[:3, 3]]),
        cluster=keys[begins].astype(np.int32),
        cluster_group=np.append(begins, len(keys)).astype(np.int32),
        frame_ball=_balls(part_ball[by_frame], of_frames),
        obstacle_frame=obstacles.frames,
        obstacle_ball=_balls(pieces, first),
        group_part=groups.movers.astype(np.int32),
        group_pair=group_pair.astype(np.int32),
        group_width=np.zeros((len(keys), 2)),
        part_ball=part_ball,
        part_sphere=movers.first,
        spheres=movers.spheres,
        pair_piece=(np.repeat(first[groups.obstacles], sizes) + steps).astype(np.int32),
        limit=-np.repeat(groups.allowed, sizes) - TOUCHING,
        sure=slack + BEYOND,
        piece_kind=solids.kinds.astype(np.int32),
        piece=np.concatenate([solids.centres, solids.axes.reshape(-1, 9), solids.half, solids.reach[:, None]], axis=1),
        solids=solids,
        part_frame=movers.frames,
        pair_part=np.repeat(groups.movers, sizes).astype(np.int32),
        piece_frame=np.repeat(obstacles.frames, sizes_of(first)),
        part_faces=part_faces,
        piece_faces=piece_faces,
        corner_first=faces.corner_first,
        corners=faces.corners,
        plane_first=faces.plane_first,
        planes=faces.planes,
        beyond=faces.beyond + BEYOND / 2,
    )
    found.widen()
    return found


def _polyhedra(movers: Movers, obstacles: Obstacles) -> tuple[Facets, NDArray[np.int32], NDArray[np.int32]]:
    """Those of movers, obstacles and pieces that are boxes, and which a mover (m,) and a piece (k,) has, -1: none."""
    solids = obstacles.solids
    if not movers.faces.known.any():  # a plane is only between two that are known
        return Facets.unknown(0), np.full(len(movers), -1, np.int32), np.full(len(solids), -1, np.int32)
    faces = Facets.joined([movers.faces, obstacles.faces])
    numbers = np.where(faces.known, np.arange(len(faces)), -1).astype(np.int32)
    of_piece = np.repeat(numbers[len(movers) :], sizes_of(obstacles.first))
    boxes = np.flatnonzero((of_piece < 0) & (solids.kinds == 1))
    of_piece[boxes] = len(faces) + np.arange(len(boxes))
    return Facets.joined([faces, _box_faces(solids, boxes)]), numbers[: len(movers)], of_piece


_SIDES = np.array([[side * (axis == k) for k in range(3)] for axis in range(3) for side in (-1.0, 1.0)])
_ENDS = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])


def _box_faces(solids: Solids, boxes: NDArray[np.intp]) -> Facets:
    """Of pieces that are boxes (b,)."""
    centres, axes, half = solids.centres[boxes, None], solids.axes[boxes], solids.half[boxes, None]
    corners = centres + np.einsum("bij,bcj->bci", axes, _ENDS * half)
    normals = np.einsum("bij,fj->bfi", axes, _SIDES)
    offsets = np.einsum("bfi,bki->bf", normals, centres) + (np.abs(_SIDES) * half).sum(axis=2)
    planes = np.concatenate([normals, offsets[..., None]], axis=2).reshape(-1, 4)
    counts = np.arange(len(boxes) + 1, dtype=np.int32)
    return Facets(8 * counts, corners.reshape(-1, 3), 6 * counts, planes, np.zeros(len(boxes)))


def _balls(spheres: Array, first: ArrayLike) -> Array:
    """Centres and radii (m, 4) of spheres around groups of spheres (s, 4); group i: those from [i] to [i + 1] - 1."""
    bounds = np.asarray(first, np.intp)
    sizes = sizes_of(bounds)
    full = np.flatnonzero(sizes)
    balls = np.zeros((len(bounds) - 1, 4))
    if len(full):
        begins, group = bounds[full], np.repeat(np.arange(len(full)), sizes[full])
        low = np.minimum.reduceat(spheres[:, :3] - spheres[:, 3:], begins)
        high = np.maximum.reduceat(spheres[:, :3] + spheres[:, 3:], begins)
        centres = (low + high) / 2
        away = np.sqrt(((spheres[:, :3] - centres[group]) ** 2).sum(axis=1)) + spheres[:, 3]
        balls[full, :3], balls[full, 3] = centres, np.maximum.reduceat(away, begins)
    return balls
