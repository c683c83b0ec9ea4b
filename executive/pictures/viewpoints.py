"""Choice of a viewpoint: the direction from which a picture's subjects are occluded least."""

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
"""Directions tried: number around the vertical, and elevations of the eye [deg]."""
SIDEWAYS = (8.0, 14.0)
"""Elevations tried if something hangs in the air [deg]; its height could not be seen from above."""
CALM = 2.6
"""Smallest distance of the eye, in radii of the sphere around the subjects; limits the distortion of near subjects."""
SMALL = (120, 80)
"""Size of the pictures by which directions are compared [pixels]."""
BORDER = 0.9
"""Largest share of the picture's width and height that the subjects fill."""
LEAST_RADIUS = 0.35
"""Half the smallest height that a picture shows [m]."""
NEAR = 2.5
"""Largest distance from the robot at which bodies of the plan are subjects [m]."""
HIGH = 1.0
"""Height above which an overview may cut things off, such as walls [m]."""
LEVEL = 0.25
"""Penalty for each step of elevation, in units of the score (logarithms of visible pixels)."""


def subjects(
    stage: Stage, poses: Mapping[Path, Pose], names: Collection[str], always: Collection[str] = ()
) -> list[list[Path]]:
    """Choose a picture's subjects, each as a list of paths: the robot, bodies ``names`` near it, and bodies ``always``.

    The last ones, and bodies that hang in the air, come with the body below them.
    """
    robot = stage.robot(poses)
    chosen: dict[str, list[Path]] = {}
    low, high = stage.bounds(poses, robot)
    for name in dict.fromkeys((*always, *names)):
        paths = stage.of(name, poses)
        lower, upper = stage.bounds(poses, paths)
        apart = np.maximum(np.maximum(lower - high, low - upper), 0.0)
        if paths and (not robot or name in always or float(np.linalg.norm(apart)) <= NEAR):
            chosen[name] = paths
    for name in [name for name in chosen if name in always or name in stage.drops()]:
        if (below := stage.below(name)) is not None:
            chosen.setdefault(below, stage.of(below, poses))
    return [robot, *chosen.values()] if robot else list(chosen.values())


@dataclass(frozen=True, slots=True, eq=False)
class Moment:
    """Poses of all entities at one time, the subjects, and ``points`` (n, 3) that have to be in the picture."""

    poses: Mapping[Path, Pose]
    about: Sequence[Sequence[Path]]
    points: Array


def moment_of(stage: Stage, poses: Mapping[Path, Pose], about: Sequence[Sequence[Path]]) -> Moment:
    """Make a moment whose points are the corners of the subjects' bounding boxes."""
    points = [stage.corners(path, poses[path]) for paths in about for path in paths]
    return Moment(poses, about, np.concatenate(points) if points else np.zeros((0, 3)))


def view_of(stage: Stage, poses: Mapping[Path, Pose], about: Sequence[Sequence[Path]], aspect: float) -> View:
    """Choose the view that contains all subjects with the least occlusion."""
    if not about:
        return overview(stage, poses, aspect)
    moment = moment_of(stage, poses, about)
    drops = [ends for name, ends in stage.drops().items() if [("bodies", name)] in about]
    tilts = SIDEWAYS if drops else TILTS
    points = np.concatenate([moment.points, *drops])
    return fitting(points, best_direction(stage, [moment], aspect, tilts), aspect)


def best_direction(stage: Stage, moments: Sequence[Moment], aspect: float, tilts: Sequence[float] = TILTS) -> Array:
    """Choose the direction of view (3,) from which the subjects of all moments are occluded least."""
    proxies = [_proxies(stage, moment.poses) for moment in moments]
    best: tuple[float, Array] | None = None
    for steepness, ahead in _directions(tilts):
        score = -LEVEL * steepness * len(moments)
        for moment, models in zip(moments, proxies, strict=True):
            score += _visibility(stage, moment, models, fitting(moment.points, ahead, aspect))
        if best is None or score > best[0] + 1e-6:
            best = score, ahead
    assert best is not None
    return best[1]


def overview(stage: Stage, poses: Mapping[Path, Pose], aspect: float) -> View:
    """View of everything, in perspective from above a corner."""
    low, high = stage.bounds(poses, poses)
    high[2] = max([min(high[2], HIGH), *(float(ends[1, 2]) for ends in stage.drops().values())])
    ahead = np.array([0.55, 0.65, -0.62])
    return fitting(ends_of(low, high), ahead / np.linalg.norm(ahead), aspect)


def from_top(stage: Stage, poses: Mapping[Path, Pose], aspect: float) -> View:
    """View of everything, in a parallel projection straight from above."""
    low, high = stage.bounds(poses, poses)
    (x, y, z), (width, depth, _) = ((low + high) / 2).tolist(), ((high - low) / BORDER).tolist()
    return View((x, y, float(high[2]) + 1.0), (x, y, z), max(width, depth * aspect))


def fitting(points: Array, ahead: Array, aspect: float, *, least: float = LEAST_RADIUS) -> View:
    """Find the view in direction ``ahead`` (3,) in which points (n, 3) fill the picture.

    ``least`` is half the smallest height that the picture shows [m].
    """
    low, high = points.min(axis=0), points.max(axis=0)
    middle = (low + high) / 2
    right = np.cross(ahead, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    up = np.cross(right, ahead)
    tall = math.tan(FIELD / 2) * BORDER
    least = max(least, CALM * tall * float(np.linalg.norm(high - low)) / 2)
    for _ in range(3):  # recentres the picture on the projected points, which perspective shifts
        offsets = points - middle
        across, above, beyond = offsets @ right, offsets @ up, offsets @ ahead
        distance = float(np.max(np.maximum(np.abs(across) / (tall * aspect), np.abs(above) / tall) - beyond))
        distance = max(distance, least / tall)
        depth = distance + beyond
        projected = across / depth, above / depth
        shift = [float(one.max() + one.min()) / 2 * distance for one in projected]
        middle = middle + shift[0] * right + shift[1] * up
    eye = middle - distance * ahead
    return View((float(eye[0]), float(eye[1]), float(eye[2])), (float(middle[0]), float(middle[1]), float(middle[2])))


def _directions(tilts: Sequence[float]) -> Iterator[tuple[int, Array]]:
    """Yield directions of view (3,), each with the index of its elevation."""
    for steepness, tilt in enumerate(np.radians(tilts)):
        for turn in (np.arange(AROUND) + 0.5) * 2 * math.pi / AROUND:
            level = math.cos(tilt)
            yield steepness, np.array([math.cos(turn) * level, math.sin(turn) * level, -math.sin(tilt)])


def _proxies(stage: Stage, poses: Mapping[Path, Pose]) -> dict[Path, Model]:
    """Models in the map frame that are fast to render: the robot's links are replaced by bounding boxes."""
    return {
        path: (coarse(stage.models[path]) if path[0] == "robot" else stage.models[path]).at(pose)
        for path, pose in poses.items()
    }


def _visibility(stage: Stage, moment: Moment, proxies: Mapping[Path, Model], view: View) -> float:
    """Score how well a view shows the subjects: the sum of the logarithms of their visible pixels."""
    whole = joined([*proxies.values(), *stage.walls(moment.poses, view)])
    frame = Frame(view, SMALL)
    frame.draw(whole)
    shown = frame.triangles
    counts = np.bincount(whole.owners[shown[shown >= 0]], minlength=int(whole.owners.max(initial=0)) + 1)
    owners = [np.unique(np.concatenate([proxies[path].owners for path in paths])) for paths in moment.about]
    return sum(math.log1p(float(counts[one].sum())) for one in owners)
