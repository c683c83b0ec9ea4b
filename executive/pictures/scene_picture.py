"""Pictures of a world, from an automatically chosen viewpoint or one that the user states."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from pathlib import Path as File
from typing import TYPE_CHECKING

import numpy as np
from PIL import Image

from executive.options.declaring import points_of_view
from executive.pictures import rendering
from executive.pictures.modelling import Model
from executive.pictures.rendering import View, rendered
from executive.pictures.stage import Path, Stage
from executive.pictures.steps import with_caption
from executive.pictures.viewpoints import from_top, overview, subjects, view_of
from planlang.geometry import Array, Pose

if TYPE_CHECKING:
    from sim.truth import Truth

SIZE = (960, 640)
"""Width and height of a picture [pixels]."""
SHADED = 0.75
"""Radius of the sphere with shadows, as a fraction of the distance from eye to target."""


def save_picture(
    path: File,
    world: Truth,
    names: Collection[str] = (),
    view: str | None = None,
    always: Collection[str] = (),
    title: str = "",
    ending: Sequence[str] = (),
) -> None:
    """Write a PNG of a world: of its robot, of the bodies ``names`` near it, and of the bodies ``always``.

    ``view`` states another viewpoint (:func:`stated_view`). If ``ending`` is given, the title and these lines stand
    below the picture. Raises OSError.
    """
    image = Image.fromarray(picture(world, names, view, always=always))
    (with_caption(image, title, ending) if ending else image).save(path, format="PNG")


def picture(
    world: Truth,
    names: Collection[str] = (),
    view: str | None = None,
    *,
    size: tuple[int, int] = SIZE,
    always: Collection[str] = (),
) -> rendering.Image:
    """Render the same picture to an array (height, width, 3)."""
    stage = Stage(world)
    poses = stage.poses()
    aspect = size[0] / size[1]
    about = subjects(stage, poses, names, always)
    chosen = view_of(stage, poses, about, aspect) if view is None else stated_view(view, stage, poses, about, aspect)
    return render_poses(stage, poses, chosen, size, stage.plumb_lines())


def render_poses(
    stage: Stage, poses: Mapping[Path, Pose], view: View, size: tuple[int, int], more: Iterable[Model] = ()
) -> rendering.Image:
    """Render given poses to a picture (height, width, 3), with ``more`` models in the map frame."""
    return rendered([*stage.scene(poses), *more], view, size, shadow_sphere(view), list(stage.walls(poses, view)))


def shadow_sphere(view: View) -> tuple[Array, float]:
    """Sphere (centre, radius) that the shadow map covers."""
    distance = float(np.linalg.norm(np.subtract(view.target, view.eye)))
    return np.asarray(view.target), max(1.0, SHADED * distance)


def stated_view(text: str, stage: Stage, poses: Mapping[Path, Pose], about: list[list[Path]], aspect: float) -> View:
    """Parse a view; an eye without a target looks at the centre of the picture's subjects."""
    points = points_of_view(text)
    if points is None:
        return (from_top if text == "top" else overview)(stage, poses, aspect)
    if len(points) == 2:
        return View(points[0], points[1])
    low, high = stage.bounds(poses, [path for paths in about for path in paths])
    x, y, z = ((low + high) / 2).tolist()
    return View(points[0], (x, y, z))
