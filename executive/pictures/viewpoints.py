"""From where a picture is taken: the direction from which what it is about is hidden least."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping, Sequence

import numpy as np

from executive.pictures.modelling import Model, joined
from executive.pictures.rendering import FIELD, Frame, View
from executive.pictures.stage import Path, Stage, coarse, ends_of
from planlang.geometry import Array, Pose
from planlang.records import dataclass

AROUND, TILTS = 12, (22.0, 36.0, 52.0)
"""Directions that are tried: around the vertical, and above the horizon [deg]."""
SIDEWAYS = (8.0, 14.0)
"""The same, if something hangs in the air: from above its height is not seen."""
CALM = 2.6
"""Distance of the eye, in radii of the ball around what a picture is about: what is near looks not much larger."""
SMALL = (120, 80)
"""Pixels of the pictures by which they are compared."""
BORDER = 0.9
"""Share of a picture that what it is about fills at most."""
LEAST_RADIUS = 0.35
"""Half the height that a picture shows at least [m]."""
NEAR = 2.5
"""Things of the plan that are farther from the robot than this are not what happens at the moment [m]."""
HIGH = 1.0
"""In a view of everything what is higher may be cut off [m]: the tops of walls."""
LEVEL = 0.25
"""What a view loses for each step that it is steeper, beside logarithms of pixels."""


def subjects(
    stage: Stage, poses: Mapping[Path, Pose], names: Collection[str], always: Collection[str] = ()
) -> list[list[Path]]:
    """Return what a picture is about: the robot, things and persons of the plan that are near it, and some anyhow.

    What is shown anyhow, or hangs in the air, comes with what is below it.
    """
    robot = stage.robot(poses)
    found: dict[str, list[Path]] = {}
    low, high = stage.bounds(poses, robot)
    for name in dict.fromkeys((*always, *names)):
        paths = stage.of(name, poses)
        lower, upper = stage.bounds(poses, paths)
        apart = np.maximum(np.maximum(lower - high, low - upper), 0.0)
        if paths and (not robot or name in always or float(np.linalg.norm(apart)) <= NEAR):
            found[name] = paths
    for name in [name for name in found if name in always or name in stage.drops()]:
        if (below := stage.below(name)) is not None:
            found.setdefault(below, stage.of(below, poses))
    return [robot, *found.values()] if robot else list(found.values())


@dataclass(frozen=True, slots=True, eq=False)
class Moment:
    """Where everything is, and what a picture of it is about; ``points`` (n, 3) are to be in it."""

    poses: Mapping[Path, Pose]
    about: Sequence[Sequence[Path]]
    points: Array


def moment_of(stage: Stage, poses: Mapping[Path, Pose], about: Sequence[Sequence[Path]]) -> Moment:
    """Return a moment of which all that a picture is about is to be seen."""
    points = [stage.corners(path, poses[path]) for paths in about for path in paths]
    return Moment(poses, about, np.concatenate(points) if points else np.zeros((0, 3)))


def view_of(stage: Stage, poses: Mapping[Path, Pose], about: Sequence[Sequence[Path]], aspect: float) -> View:
    """Return the view in which all of what a picture is about is seen, each of it as little hidden as can be."""
    if not about:
        return overview(stage, poses, aspect)
    moment = moment_of(stage, poses, about)
    drops = [ends for name, ends in stage.drops().items() if [("bodies", name)] in about]
    tilts = SIDEWAYS if drops else TILTS
    points = np.concatenate([moment.points, *drops])
    return fitting(points, best_direction(stage, [moment], aspect, tilts), aspect)


def best_direction(stage: Stage, moments: Sequence[Moment], aspect: float, tilts: Sequence[float] = TILTS) -> Array:
    """Return the direction of view (3,) from which, in several moments, what they are about is hidden least."""
    proxies = [_proxies(stage, moment.poses) for moment in moments]
    best: tuple[float, Array] | None = None
    for steepness, ahead in _directions(tilts):
        worth = -LEVEL * steepness * len(moments)
        for moment, models in zip(moments, proxies, strict=True):
            worth += _worth(stage, moment, models, fitting(moment.points, ahead, aspect))
        if best is None or worth > best[0] + 1e-6:
            best = worth, ahead
    assert best is not None
    return best[1]


def overview(stage: Stage, poses: Mapping[Path, Pose], aspect: float, *, top: bool = False) -> View:
    """Return a view of everything from above a corner, or straight from above, with everything above where it is."""
    low, high = stage.bounds(poses, poses)
    if top:
        (x, y, z), (wide, deep, _) = (low + high) / 2, (high - low) / BORDER
        return View(
            (float(x), float(y), float(high[2]) + 1.0), (float(x), float(y), float(z)), max(wide, deep * aspect)
        )
    high[2] = max([min(high[2], HIGH), *(float(ends[1, 2]) for ends in stage.drops().values())])
    ahead = np.array([0.55, 0.65, -0.62])
    return fitting(ends_of(low, high), ahead / np.linalg.norm(ahead), aspect)


def fitting(points: Array, ahead: Array, aspect: float, *, least: float = LEAST_RADIUS) -> View:
    """Return the view in a direction (3,) in which points (n, 3) fill the picture, ``least`` half its height [m]."""
    low, high = points.min(axis=0), points.max(axis=0)
    middle = (low + high) / 2
    right = np.cross(ahead, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    up = np.cross(right, ahead)
    tall = math.tan(FIELD / 2) * BORDER
    least = max(least, CALM * tall * float(np.linalg.norm(high - low)) / 2)
    for _ in range(3):  # the middle of the picture moves to where the points are seen
        offsets = points - middle
        across, above, beyond = offsets @ right, offsets @ up, offsets @ ahead
        distance = float(np.max(np.maximum(np.abs(across) / (tall * aspect), np.abs(above) / tall) - beyond))
        distance = max(distance, least / tall)
        depth = distance + beyond
        seen = across / depth, above / depth
        shift = [float(one.max() + one.min()) / 2 * distance for one in seen]
        middle = middle + shift[0] * right + shift[1] * up
    eye = middle - distance * ahead
    return View((float(eye[0]), float(eye[1]), float(eye[2])), (float(middle[0]), float(middle[1]), float(middle[2])))


def _directions(tilts: Sequence[float]) -> Iterator[tuple[int, Array]]:
    """Yield how steep they are, and directions from the eye to the middle."""
    for steepness, tilt in enumerate(np.radians(tilts)):
        for turn in (np.arange(AROUND) + 0.5) * 2 * math.pi / AROUND:
            level = math.cos(tilt)
            yield steepness, np.array([math.cos(turn) * level, math.sin(turn) * level, -math.sin(tilt)])


def _proxies(stage: Stage, poses: Mapping[Path, Pose]) -> dict[Path, Model]:
    """Return models in the map that are quick to draw: of the robot boxes around its links."""
    return {
        path: (coarse(stage.models[path]) if path[0] == "robot" else stage.models[path]).at(pose)
        for path, pose in poses.items()
    }


def _worth(stage: Stage, moment: Moment, proxies: Mapping[Path, Model], view: View) -> float:
    """Return how well a view shows each of several things: the sum of the logarithms of their pixels."""
    whole = joined([*proxies.values(), *stage.walls(moment.poses, view)])
    frame = Frame(view, SMALL)
    frame.draw(whole)
    shown = frame.triangles
    counts = np.bincount(whole.owners[shown[shown >= 0]], minlength=int(whole.owners.max(initial=0)) + 1)
    owners = [np.unique(np.concatenate([stage.models[path].owners for path in paths])) for paths in moment.about]
    return sum(math.log1p(float(counts[one].sum())) for one in owners)
