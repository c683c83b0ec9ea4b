"""Pictures of a world: of what happens in it, or from where a user asks for."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from pathlib import Path as File
from typing import TYPE_CHECKING

import numpy as np
from PIL import Image

from executive.pictures import rendering
from executive.pictures.modelling import Model
from executive.pictures.rendering import View, rendered
from executive.pictures.stage import Path, Stage
from executive.pictures.steps import captioned
from executive.pictures.viewpoints import overview, subjects, view_of
from planlang.geometry import Array, Pose

if TYPE_CHECKING:
    from sim.truth import Truth

SIZE = (960, 640)
"""Pixels of a picture."""
SHADED = 0.75
"""Radius of the ball in which there are shadows, as a share of the distance of the eye."""


def save_picture(
    path: File,
    world: Truth,
    names: Collection[str] = (),
    view: str | None = None,
    always: Collection[str] = (),
    title: str = "",
    ending: Sequence[str] = (),
) -> None:
    """Write a PNG of a world: of its robot, of bodies near it, and of some wherever they are.

    Or as ``view`` asks (:func:`stated_view`). How a run has ended, if that is given, stands below with its title.
    Raises OSError as writing does.
    """
    image = Image.fromarray(picture(world, names, view, always=always))
    (captioned(image, title, ending) if ending else image).save(path, format="PNG")


def picture(
    world: Truth,
    names: Collection[str] = (),
    view: str | None = None,
    *,
    size: tuple[int, int] = SIZE,
    always: Collection[str] = (),
) -> rendering.Image:
    """Return the same as pixels (height, width, 3)."""
    stage = Stage(world)
    poses = stage.poses()
    aspect = size[0] / size[1]
    about = subjects(stage, poses, names, always)
    shown = view_of(stage, poses, about, aspect) if view is None else stated_view(view, stage, poses, about, aspect)
    return taken(stage, poses, shown, size, stage.plumb_lines())


def taken(
    stage: Stage, poses: Mapping[Path, Pose], view: View, size: tuple[int, int], more: Iterable[Model] = ()
) -> rendering.Image:
    """Return the picture (height, width, 3) of a moment, with ``more`` models that are in the map."""
    return rendered([*stage.scene(poses), *more], view, size, shaded_ball(view), list(stage.walls(poses, view)))


def shaded_ball(view: View) -> tuple[Array, float]:
    """Return the ball (middle, radius) in which shadows are worth their pixels."""
    distance = float(np.linalg.norm(np.subtract(view.target, view.eye)))
    return np.asarray(view.target), max(1.0, SHADED * distance)


NAMED = ("overview", "top")
"""Views that have names."""


def is_view(text: str) -> bool:
    """Return whether a user can ask for a view in these words: a name, an eye, or an eye and what it looks at."""
    return text in NAMED or _points(text) is not None


def stated_view(text: str, stage: Stage, poses: Mapping[Path, Pose], about: list[list[Path]], aspect: float) -> View:
    """Return the view that a text asks for; an eye alone looks at the middle of what the picture is about."""
    points = _points(text)
    if points is None:
        return overview(stage, poses, aspect, top=text == "top")
    if len(points) == 2:
        return View(points[0], points[1])
    low, high = stage.bounds(poses, [path for paths in about for path in paths])
    x, y, z = ((low + high) / 2).tolist()
    return View(points[0], (x, y, z))


def _points(text: str) -> list[rendering.Point] | None:
    """Return the one or two points of ``X,Y,Z`` or ``X,Y,Z:X,Y,Z``; None for another text, and for equal points."""
    found: list[rendering.Point] = []
    for part in text.split(":"):
        try:
            x, y, z = map(float, part.split(","))
        except ValueError:
            return None
        if not np.isfinite([x, y, z]).all() or max(map(abs, (x, y, z))) > rendering.FAR:
            return None
        found.append((x, y, z))
    return found if len(found) == 1 or (len(found) == 2 and found[0] != found[1]) else None
