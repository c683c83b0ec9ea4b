"""The renderable models of a world, and their poses, for pictures and videos."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping
from typing import TYPE_CHECKING

import numpy as np

from executive.pictures.drawn import Drawn, Shape, drawn_in, lowered
from executive.pictures.modelling import Model, model_of
from executive.pictures.rendering import View
from planlang.geometry import Array, Pose
from planlang.geometry.matrices import moved, rotated
from planlang.geometry.shapes import SolidKind
from planlang.records import dataclass
from sim.scene import BodyShape
from sim.truth import held_by

if TYPE_CHECKING:
    from sim.truth import Truth

Path = tuple[str, ...]
MARGIN = 3.0
"""Margin of the ground plate in a world without a room [m]."""
GROUND = (196, 194, 188, 255)
HANGING = 0.03
"""Height above its support from which on a body is marked as hanging in the air [m]."""
THIN, PLUMB = 0.012, (196, 52, 44, 255)
"""Width [m] and colour of the plumb line below it."""


@dataclass(frozen=True, slots=True)
class _Wall:
    """A complete wall, and its lower edge, which is drawn instead where the wall would hide the room."""

    whole: Model
    edge: Model | None
    """None for a lintel, whose wall has an opening below."""
    middle: Array
    outward: Array


class Stage:
    """The models of a world. Poses are kept separately, by path, so that a past moment can be rendered later."""

    def __init__(self, world: Truth) -> None:
        self.world = world
        self.models: dict[Path, Model] = {}
        """By path, in the frame of the body or link."""
        self._walls: dict[Path, list[_Wall]] = {}
        self._names: tuple[str, ...] | None = None
        self._drawn: tuple[Drawn, ...] = ()
        self._paths: dict[str, list[Path]] = {}
        """By the body's name."""
        self._drops: tuple[object, dict[str, Array]] | None = None
        self._owners = 0

    def poses(self) -> dict[Path, Pose]:
        """Current poses of all existing entities in the map."""
        if self._names != self.world.names():
            # walls are complete here: those between the viewer and the room are left out of each picture
            self._names, self._drawn = self.world.names(), drawn_in(self.world, lambda wall: wall)
            for one in self._drawn:
                if one.path not in self.models:
                    self._add(one)
        poses: dict[Path, Pose] = {}
        for one in self._drawn:
            parent = poses.get(one.path[:-1])
            poses[one.path] = one.pose() if parent is None else parent @ one.pose()
        return poses

    def _add(self, drawn: Drawn) -> None:
        if drawn.path[0] == "bodies":
            self._paths.setdefault(drawn.path[1], []).append(drawn.path)
        plain = [shape for shape in drawn.shapes if shape.outward is None]
        self.models[drawn.path] = model_of(plain, self._owners)
        walls = [shape for shape in drawn.shapes if shape.outward is not None]
        self._owners += len(plain) + 1
        self._walls[drawn.path] = [self._wall(shape, self._owners) for shape in walls]
        self._owners += len(walls) > 0

    def _wall(self, shape: Shape, owner: int) -> _Wall:
        """Model a wall. All walls of a room have the same owner, so that no lines are drawn where they meet."""
        whole, low = model_of([shape], owner), lowered(shape)
        edge = None if low is None else model_of([low], owner)
        return _Wall(
            whole, edge, np.asarray(shape.pose.position), rotated(shape.pose.rotation, np.asarray(shape.outward))
        )

    def scene(self, poses: Mapping[Path, Pose]) -> Iterator[Model]:
        """Yield all models in the map frame, without walls, and a ground plate if there is no room."""
        for path, pose in poses.items():
            yield self.models[path].at(pose)
        if not any(self._walls.values()):
            yield self._ground(poses)

    def walls(self, poses: Mapping[Path, Pose], view: View) -> Iterator[Model]:
        """Yield the walls in the map frame; only the lower edges of those between the viewer and the room.

        A plan from above has no lintels, which would close the doorways below them.
        """
        for path, pose in poses.items():
            for wall in self._walls[path]:
                away = np.asarray(view.eye) - moved(pose.matrix(), wall.middle)
                is_before = float(away @ rotated(pose.rotation, wall.outward)) > 0
                shown = wall.edge if is_before or (wall.edge is None and view.width is not None) else wall.whole
                if shown is not None:
                    yield shown.at(pose)

    def _ground(self, poses: Mapping[Path, Pose]) -> Model:
        low, high = self.bounds(poses, poses)
        size = (*(high - low + 2 * MARGIN)[:2].round(1).tolist(), 0.02)
        x, y = ((low + high) / 2)[:2].tolist()
        return model_of([Shape(SolidKind.BOX, size, Pose((x, y, -0.01)), GROUND)], self._owners)

    def bounds(self, poses: Mapping[Path, Pose], paths: Collection[Path]) -> tuple[Array, Array]:
        """Lower and upper corner of the bounding box of models without walls; the origin if there are none."""
        corners = [self.corners(path, poses[path]) for path in paths if path in poses]
        points = np.concatenate([np.zeros((0, 3)), *corners])
        points = points if len(points) else np.zeros((1, 3))
        return points.min(axis=0), points.max(axis=0)

    def corners(self, path: Path, pose: Pose) -> Array:
        """Corners (8, 3) of a model's bounding box at a pose; (0, 3) for a model without shapes."""
        vertices = self.models[path].vertices
        if not len(vertices):
            return np.zeros((0, 3))
        return moved(pose.matrix(), ends_of(vertices.min(axis=0), vertices.max(axis=0)))

    def of(self, name: str, poses: Mapping[Path, Pose]) -> list[Path]:
        """Paths of a body and its limbs."""
        return [path for path in self._paths.get(name, ()) if path in poses]

    def below(self, name: str) -> str | None:
        """Body on which a body stands or above which it hangs; None for the floor, and for held or fixed bodies."""
        if not self._is_loose(name):
            return None
        support = self.world.support(name)
        return None if support is None or self.world.scene.body(support).shape == BodyShape.ROOM else support

    def drops(self) -> dict[str, Array]:
        """Ends (2, 3) of the plumb lines of bodies that hang in the air now, in the map, by the body's name."""
        state = self.world.poses(), dict(self.world.attached())
        if self._drops is None or self._drops[0] != state:
            self._drops = state, dict(self._hanging())
        return self._drops[1]

    def _hanging(self) -> Iterator[tuple[str, Array]]:
        poses = self.poses()
        for name in (one for one in self.world.names() if self._is_loose(one) and not self.world.stands(one)):
            height, paths = self.world.height_above_support(name), self.of(name, poses)
            if paths and HANGING < height < math.inf:
                low, high = self.bounds(poses, paths)
                x, y, _ = (low + high) / 2
                yield name, np.array([(x, y, low[2] - height), (x, y, low[2])])

    def plumb_lines(self) -> Iterator[Model]:
        """Yield a plumb line with a mark at its lower end for each body that hangs in the air now."""
        for (x, y, low), (_, _, high) in self.drops().values():
            line = Shape(SolidKind.CYLINDER, (THIN, THIN, high - low), Pose((x, y, (low + high) / 2)), PLUMB)
            mark = Shape(SolidKind.CYLINDER, (10 * THIN, 10 * THIN, THIN), Pose((x, y, low + THIN / 2)), PLUMB)
            yield model_of([line, mark], self._owners + 1)

    def _is_loose(self, name: str) -> bool:
        return self.world.scene.body(name).graspable and held_by(self.world, name) is None

    def robot(self, poses: Mapping[Path, Pose]) -> list[Path]:
        """Paths of the robot's links."""
        return [path for path in poses if path[0] == "robot"]


def ends_of(low: Array, high: Array) -> Array:
    """Corners (8, 3) of the box between a lower and an upper corner."""
    return np.array([np.choose(one, [low, high]) for one in np.ndindex(2, 2, 2)])


def coarse(model: Model) -> Model:
    """Bounding box of a model with the same owner: a cheap proxy for tests of visibility."""
    if not len(model.vertices):
        return model
    low, high = model.vertices.min(axis=0), model.vertices.max(axis=0)
    x, y, z = np.maximum(high - low, 1e-3).tolist()
    a, b, c = ((low + high) / 2).tolist()
    return model_of([Shape(SolidKind.BOX, (x, y, z), Pose((a, b, c)))], int(model.owners[0]))
