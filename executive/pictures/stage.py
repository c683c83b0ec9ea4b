"""A world as models that move: what pictures and videos render."""

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
"""Ground around everything in a world without a room [m]."""
GROUND = (196, 194, 188, 255)
HANGING = 0.03
"""Height above what is below it from which on a body is shown to hang in the air [m]."""
THIN, PLUMB = 0.012, (196, 52, 44, 255)
"""Width [m] and colour of the vertical below it."""


@dataclass(frozen=True, slots=True)
class _Wall:
    """A wall as it is, and its lower edge, which is drawn where the wall would hide the room."""

    whole: Model
    edge: Model
    middle: Array
    outward: Array


class Stage:
    """The models of a world. Poses are kept apart, by path, so that a moment can be drawn later."""

    def __init__(self, world: Truth) -> None:
        self.world = world
        self.models: dict[Path, Model] = {}
        """In the frames of what they belong to."""
        self._walls: dict[Path, list[_Wall]] = {}
        self._names: tuple[str, ...] | None = None
        self._drawn: tuple[Drawn, ...] = ()
        self._owners = 0

    def poses(self) -> dict[Path, Pose]:
        """Return where everything is in the map now; what is not there is left out."""
        if self._names != self.world.names():
            self._names, self._drawn = self.world.names(), drawn_in(self.world, walls=True)
            for one in self._drawn:
                if one.path not in self.models:
                    self._add(one)
        found: dict[Path, Pose] = {}
        for one in self._drawn:
            above = found.get(one.path[:-1])
            found[one.path] = one.pose() if above is None else above @ one.pose()
        return found

    def _add(self, drawn: Drawn) -> None:
        plain = [shape for shape in drawn.shapes if shape.outward is None]
        self.models[drawn.path] = model_of(plain, self._owners)
        walls = [shape for shape in drawn.shapes if shape.outward is not None]
        self._owners += len(plain) + 1
        self._walls[drawn.path] = [self._wall(shape, self._owners) for shape in walls]
        self._owners += len(walls) > 0

    def _wall(self, shape: Shape, owner: int) -> _Wall:
        """All walls of a room have one owner: no lines are drawn where their pieces meet."""
        whole, edge = model_of([shape], owner), model_of([lowered(shape)], owner)
        return _Wall(
            whole, edge, np.asarray(shape.pose.position), rotated(shape.pose.rotation, np.asarray(shape.outward))
        )

    def scene(self, poses: Mapping[Path, Pose]) -> Iterator[Model]:
        """Yield the models of a moment, in the map, without walls, and the ground if there is no room."""
        for path, pose in poses.items():
            yield self.models[path].at(pose)
        if not any(self._walls.values()):
            yield self._ground(poses)

    def walls(self, poses: Mapping[Path, Pose], view: View) -> Iterator[Model]:
        """Yield the walls, in the map; of those that stand before the room only the lower edges."""
        for path, pose in poses.items():
            for wall in self._walls[path]:
                away = np.asarray(view.eye) - moved(pose.matrix(), wall.middle)
                is_before = float(away @ rotated(pose.rotation, wall.outward)) > 0
                yield (wall.edge if is_before else wall.whole).at(pose)

    def _ground(self, poses: Mapping[Path, Pose]) -> Model:
        low, high = self.bounds(poses, poses)
        size = (*(high - low + 2 * MARGIN)[:2].round(1).tolist(), 0.02)
        x, y = ((low + high) / 2)[:2].tolist()
        return model_of([Shape(SolidKind.BOX, size, Pose((x, y, -0.01)), GROUND)], self._owners)

    def bounds(self, poses: Mapping[Path, Pose], paths: Collection[Path]) -> tuple[Array, Array]:
        """Return the lower and the upper corner of the box around some models, walls left out; around 0 if none."""
        points = [self.corners(path, poses[path]) for path in paths if path in poses]
        every = np.concatenate([np.zeros((0, 3)), *points])
        every = every if len(every) else np.zeros((1, 3))
        return every.min(axis=0), every.max(axis=0)

    def corners(self, path: Path, pose: Pose) -> Array:
        """Return the corners (8, 3) of the box around a model, at a pose; (0, 3) of one without shapes."""
        vertices = self.models[path].vertices
        if not len(vertices):
            return np.zeros((0, 3))
        return moved(pose.matrix(), ends_of(vertices.min(axis=0), vertices.max(axis=0)))

    def of(self, name: str, poses: Mapping[Path, Pose]) -> list[Path]:
        """Return the paths of a body, its limbs included."""
        return [path for path in poses if path[:2] == ("bodies", name)]

    def below(self, name: str) -> str | None:
        """Return what a body stands on or hangs above; None for a floor, and for what is held or fixed."""
        if not self._is_loose(name):
            return None
        found = self.world.support(name)
        return None if found is None or self.world.scene.body(found).shape == BodyShape.ROOM else found

    def drops(self) -> dict[str, Array]:
        """Return the bodies that hang in the air now, each with the ends (2, 3) of the vertical below it in the map."""
        poses, found = self.poses(), dict[str, Array]()
        for name in filter(self._is_loose, self.world.names()):
            height, paths = self.world.height_above_support(name), self.of(name, poses)
            if paths and HANGING < height < math.inf:
                low, high = self.bounds(poses, paths)
                x, y, _ = (low + high) / 2
                found[name] = np.array([(x, y, low[2] - height), (x, y, low[2])])
        return found

    def plumb_lines(self) -> Iterator[Model]:
        """Yield a thin vertical and a mark at its lower end for each body that hangs in the air now."""
        for (x, y, low), (_, _, high) in self.drops().values():
            line = Shape(SolidKind.CYLINDER, (THIN, THIN, high - low), Pose((x, y, (low + high) / 2)), PLUMB)
            mark = Shape(SolidKind.CYLINDER, (10 * THIN, 10 * THIN, THIN), Pose((x, y, low + THIN / 2)), PLUMB)
            yield model_of([line, mark], self._owners + 1)

    def _is_loose(self, name: str) -> bool:
        return self.world.scene.body(name).graspable and held_by(self.world, name) is None

    def robot(self, poses: Mapping[Path, Pose]) -> list[Path]:
        """Return the paths of the robot's links."""
        return [path for path in poses if path[0] == "robot"]


def ends_of(low: Array, high: Array) -> Array:
    """Return the corners (8, 3) of the box between two of them."""
    return np.array([np.choose(one, [low, high]) for one in np.ndindex(2, 2, 2)])


def coarse(model: Model) -> Model:
    """Return the box around a model, in its owner's name: enough to see whether it hides something."""
    if not len(model.vertices):
        return model
    low, high = model.vertices.min(axis=0), model.vertices.max(axis=0)
    x, y, z = np.maximum(high - low, 1e-3).tolist()
    a, b, c = ((low + high) / 2).tolist()
    return model_of([Shape(SolidKind.BOX, (x, y, z), Pose((a, b, c)))], int(model.owners[0]))
