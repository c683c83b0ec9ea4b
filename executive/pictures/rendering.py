"""Software rasteriser for pictures of a world, in NumPy only, with the same result on every machine.

A *frame* holds the nearest triangle of each pixel (visibility buffer: C. Burns and W. Hunt, 2013). Shading is deferred
to visible pixels: hemispherical sky light, a sun with a shadow map, unsharp masking of the depth buffer, which darkens
hollows (T. Luft, C. Colditz and O. Deussen, 2006), and lines at edges. Edges are smoothed by 2 x 2 supersampling.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from executive.options.declaring import FARTHEST
from executive.pictures.modelling import Model, joined
from planlang.geometry import Array
from planlang.records import dataclass

Point = tuple[float, float, float]
Floats = NDArray[np.float32]
Image = NDArray[np.uint8]

FIELD = math.radians(36)
"""Vertical field of view [rad], that of a portrait lens, whose moderate perspective suits rooms."""
NEAR = 0.01
"""Distance of the near plane [m]."""
FINE = 2
"""Supersampling along both axes."""
SUN = (-0.55, -0.35, 1.0)
"""Direction to the sun, as components to the right of the viewer, horizontally ahead, and up."""
SHADOW = 1024
"""Side of the shadow map [pixels]."""
BIAS = 0.012
"""Depth bias of shadows [m], which keeps surfaces from shadowing themselves."""
SKY, GROUND = np.array([0.70, 0.72, 0.76], np.float32), np.array([0.56, 0.54, 0.52], np.float32)
"""Ambient light from above and from below (red, green, blue)."""
SUNLIGHT = np.array([0.42, 0.40, 0.36], np.float32)
TOP, BOTTOM = np.array([226, 232, 240], np.float32), np.array([250, 250, 250], np.float32)
"""Colours of the background."""
LINE, CREASE = 0.42, 0.75
"""Brightness factors of lines between shapes, and of lines at edges within one shape."""
BENT = 0.3
"""Difference of the cosines of illumination between two pixels at which an edge is drawn."""
STEP = 0.05
"""Relative difference of depth between two pixels at which an edge is drawn."""
HOLLOW = 10
"""Radius of the box blur of the depth buffer [pixels of a picture that is 640 wide]."""


@dataclass(frozen=True, slots=True)
class View:
    """Viewpoint: eye and target in the map [m]. With a ``width`` [m] the projection is parallel, else perspective."""

    eye: Point
    target: Point
    width: float | None = None

    def axes(self) -> Array:
        """Camera axes right, down and ahead in the map, as rows (3, 3)."""
        ahead = np.subtract(self.target, self.eye)
        ahead = ahead / np.linalg.norm(ahead)
        up = np.array([0.0, 0.0, 1.0]) if abs(ahead[2]) < 0.999 else np.array([0.0, 1.0, 0.0])
        right = np.cross(ahead, up)
        right /= np.linalg.norm(right)
        return np.array([right, np.cross(ahead, right), ahead])

    def sun(self) -> Array:
        """Unit vector to a sun over the viewer's shoulder, (3,)."""
        right, _, ahead = self.axes()
        level = np.array([-right[1], right[0], 0.0]) if abs(ahead[2]) < 0.999 else np.array([0.0, 1.0, 0.0])
        sun = SUN[0] * right + SUN[1] * level + [0.0, 0.0, SUN[2]]
        return np.asarray(sun / np.linalg.norm(sun))

    def project(self, points: NDArray[np.floating[Any]], size: tuple[int, int]) -> NDArray[np.floating[Any]]:
        """Project points (n, 3) to columns, rows [pixels] and nearness, (n, 3).

        Nearness is 1 / depth in perspective, which is linear in the picture, and ``FARTHEST`` - depth in parallel.
        """
        width, height = size
        eye, axes = np.asarray(self.eye, points.dtype), self.axes().astype(points.dtype)
        local = np.einsum("ij,nj->ni", axes, points - eye)
        depth = local[:, 2]
        if self.width is not None:
            scale, nearness = width / self.width, FARTHEST - depth
            return np.column_stack([local[:, 0] * scale + width / 2, local[:, 1] * scale + height / 2, nearness])
        near = 1.0 / np.maximum(depth, 1e-6)
        scale = height / 2 / math.tan(FIELD / 2)
        return np.column_stack([local[:, 0] * near * scale + width / 2, local[:, 1] * near * scale + height / 2, near])


class Frame:
    """Visibility buffer: the nearest triangle of each pixel (height, width)."""

    def __init__(self, view: View, size: tuple[int, int]) -> None:
        self.view, self.size = view, size
        self.keys = np.zeros(size[0] * size[1], np.uint64)
        """Nearness as float32 bits in the upper half, 1 + index of the triangle in the lower; 0 for none.

        Bits of positive floats are ordered like their values, so that the maximum of two keys is the nearer one.
        """

    def copy(self) -> Frame:
        """Copy the frame, to draw more on the copy."""
        other = Frame(self.view, self.size)
        other.keys = self.keys.copy()
        return other

    def draw(self, model: Model, first: int = 0) -> None:
        """Rasterise the front-facing triangles of a model; their indices begin at ``first``."""
        points = self.view.project(model.vertices, self.size).astype(np.float64)
        corners = points[model.triangles[:, ::-1]]  # rows count downwards, which reverses the orientation
        (ax, ay), (bx, by), (cx, cy) = (corners[:, k, :2].T for k in range(3))
        area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        width, height = self.size
        near = corners[:, :, 2]
        kept = area > FLAT
        if self.view.width is None:
            kept &= (near.max(axis=1) < 1 / NEAR) & (near.min(axis=1) > 0) & (near.max(axis=1) < 1e5)
        low = np.minimum(np.minimum(ax, bx), cx)
        high = np.maximum(np.maximum(ax, bx), cx)
        top = np.ceil(np.clip(np.minimum(np.minimum(ay, by), cy), 0, height) - 0.5).astype(np.int64)
        bottom = np.ceil(np.clip(np.maximum(np.maximum(ay, by), cy), 0, height) - 0.5).astype(np.int64)
        top = np.maximum(top, 0)
        kept &= (high > 0) & (low < width) & (bottom > top)
        which = np.flatnonzero(kept)
        if len(which):
            self._fill(corners[which], area[which], top[which], bottom[which], which + first)

    def _fill(self, corners: Array, area: Array, top: NDArray[Any], bottom: NDArray[Any], names: NDArray[Any]) -> None:
        """Split triangles into horizontal spans, one for each row of pixel centres, and write these."""
        width, _ = self.size
        counts = bottom - top
        of = np.repeat(np.arange(len(corners)), counts)
        rows = np.arange(len(of)) - np.repeat(np.cumsum(counts) - counts, counts) + top[of]
        middle = rows + 0.5
        left, right = np.zeros(len(of)), np.full(len(of), float(width))
        for k in range(3):
            (ax, ay), (bx, by) = corners[:, k, :2].T, corners[:, (k + 1) % 3, :2].T
            rise, run = by - ay, bx - ax
            with np.errstate(divide="ignore", invalid="ignore"):
                slope = np.where(np.abs(rise) > 1e-12, run / rise, 0.0)
            at = (ax - ay * slope)[of] + slope[of] * middle
            # the interior is to the right of edges that go up in the picture, to the left of those that go down
            goes_up, goes_down = (rise < -1e-12)[of], (rise > 1e-12)[of]
            left = np.where(goes_up, np.maximum(left, at), left)
            right = np.where(goes_down, np.minimum(right, at), right)
        begin = np.ceil(left - 0.5).astype(np.int64)
        lengths = np.maximum(np.ceil(right - 0.5).astype(np.int64) - begin, 0)
        slopes = _slopes(corners, corners[:, :, 2], area)
        start = slopes[of, 0] + slopes[of, 1] * (begin + 0.5) + slopes[of, 2] * middle
        self._put(rows * width + begin, lengths, start, slopes[of, 1], names[of])

    def _put(self, begin: NDArray[Any], lengths: NDArray[Any], start: Array, step: Array, names: NDArray[Any]) -> None:
        """Write spans of pixels with a depth test, in portions that fit the CPU's cache."""
        ends = np.cumsum(lengths)
        cuts = np.searchsorted(ends, np.arange(PORTION, int(ends[-1]) + PORTION, PORTION)) + 1
        first = 0
        for cut in [*cuts.tolist(), len(lengths)]:
            part = slice(first, cut)
            first = cut
            counts = lengths[part]
            total = int(counts.sum())
            if not total:
                continue
            along = np.arange(total, dtype=np.int64) - np.repeat(np.cumsum(counts) - counts, counts)
            near = (np.repeat(start[part], counts) + np.repeat(step[part], counts) * along).astype(np.float32)
            keys = np.maximum(near, 1e-9).view(np.uint32).astype(np.uint64) << np.uint64(32)
            keys |= np.repeat(names[part] + 1, counts).astype(np.uint64)
            np.maximum.at(self.keys, np.repeat(begin[part], counts) + along, keys)

    @property
    def triangles(self) -> NDArray[np.int64]:
        """Index of the nearest triangle of each pixel, (height * width,); -1 for none."""
        return (self.keys & np.uint64(0xFFFFFFFF)).astype(np.int64) - 1

    @property
    def nearness(self) -> Floats:
        """Nearness of each pixel, (height * width,); 0 for the background."""
        return (self.keys >> np.uint64(32)).astype(np.uint32).view(np.float32)


PORTION = 1 << 18
"""Pixels that are written at a time."""


def _slopes(corners: Array, values: Array, area: Array) -> Array:
    """Interpolate values (m, 3) at the corners of triangles: coefficients (m, 3) of a + b * column + c * row."""
    (ax, ay), (bx, by), (cx, cy) = (corners[:, k, :2].T for k in range(3))
    first, second = values[:, 1] - values[:, 0], values[:, 2] - values[:, 0]
    across = (first * (cy - ay) - second * (by - ay)) / area
    down = (second * (bx - ax) - first * (cx - ax)) / area
    return np.column_stack([values[:, 0] - across * ax - down * ay, across, down])


class Shadow:
    """Shadow map of the sun."""

    def __init__(self, models: Sequence[Model], sun: Array, around: tuple[Array, float]) -> None:
        """Render models from the direction ``sun`` (3,), within the sphere ``around`` (centre, radius)."""
        middle, radius = around
        self.sun, self._radius = sun, radius
        eye = middle + sun * 3 * radius
        view = View(tuple(eye.tolist()), tuple(middle.tolist()), 2 * radius)
        self.frame = Frame(view, (SHADOW, SHADOW))
        self.frame.draw(joined(models))
        self._near = self.frame.nearness

    def reaches(self, view: View, local: Sequence[Floats], cosines: Floats) -> Floats:
        """Fraction of sunlight that reaches surface points, (n,), by percentage-closer filtering of 2 x 2 samples.

        ``local`` are the coordinates of the points along the axes of a view, from its eye, (n,) each; ``cosines`` (n,)
        are those of the angles between surface normals and the sun.
        """
        sun = self.frame.view
        turn = np.einsum("ij,kj->ik", sun.axes(), view.axes())
        shift = np.einsum("ij,j->i", sun.axes(), np.subtract(view.eye, sun.eye))
        across, down, ahead = (
            sum((local[k] * np.float32(turn[i, k]) for k in range(3)), np.float32(shift[i])) for i in range(3)
        )
        scale, half = np.float32(SHADOW / (2 * self._radius)), np.float32(SHADOW / 2)
        across, down = across * scale + half, down * scale + half
        # the bias grows with the slope of the surface, as depth varies more within a pixel of the map
        near = np.float32(FARTHEST + BIAS) - ahead + 2 / (scale * np.maximum(cosines, np.float32(0.1)))
        lit = np.zeros(len(near), np.float32)
        for dx in (-0.8, 0.8):
            columns = np.clip((across + np.float32(dx)).astype(np.int32), 0, SHADOW - 1)
            for dy in (-0.8, 0.8):
                rows = np.clip((down + np.float32(dy)).astype(np.int32), 0, SHADOW - 1)
                lit += self._near[rows * SHADOW + columns] <= near
        return np.asarray(lit / np.float32(4))


def rendered(
    models: Sequence[Model], view: View, size: tuple[int, int], around: tuple[Array, float], walls: Sequence[Model] = ()
) -> Image:
    """Render models and walls to a picture (height, width, 3). Walls throw no shadow.

    Shadows are limited to the sphere ``around`` (centre, radius).
    """
    scene = joined([*models, *walls])
    is_opaque = scene.colours[:, 3] == 255
    opaque, clear = scene.only(is_opaque), scene.only(~is_opaque)
    frame = Frame(view, (size[0] * FINE, size[1] * FINE))
    frame.draw(opaque)
    return shade(frame, opaque, clear, Shadow(models, view.sun(), around))


def shade(frame: Frame, opaque: Model, clear: Model, shadow: Shadow) -> Image:
    """Shade a frame of opaque triangles and blend transparent ones in front of it: a picture (height, width, 3).

    Only the nearest layer of transparent surfaces is drawn.
    """
    width, height = frame.size
    picture = np.repeat(TOP + (BOTTOM - TOP) * np.linspace(0, 1, height, dtype=np.float32)[:, None], width, axis=0)
    edges = _Edges(frame.size)
    back = _Visible(frame, opaque, shadow.sun)
    picture[back.pixels] = back.colours(shadow) * _hollows(frame)[back.pixels, None]
    edges.add(back)
    if len(clear.triangles):
        frame, first = frame.copy(), len(opaque.triangles)
        frame.draw(clear, first)
        front = _Visible(frame, joined([opaque, clear]), shadow.sun, first)
        opacity = front.model.colours[front.names, 3:].astype(np.float32) / np.float32(255)
        behind = picture[front.pixels]
        picture[front.pixels] = behind + (front.colours(shadow) - behind) * opacity
        edges.add(front)
    picture *= edges.lines()[:, None]
    rows = picture.reshape(height // FINE, FINE, width // FINE, FINE, 3)
    blocks = sum(rows[:, i, :, j] for i in range(FINE) for j in range(FINE)) / np.float32(FINE * FINE)
    return np.asarray(np.clip(blocks + 0.5, 0, 255), np.uint8)


class _Visible:
    """Pixels of a frame that show triangles with indices from ``first`` on, with their interpolated illumination."""

    def __init__(self, frame: Frame, model: Model, sun: Array, first: int = 0) -> None:
        triangles = frame.triangles
        self.view, self.size, self.model = frame.view, frame.size, model
        self.pixels = np.flatnonzero(triangles >= first)
        self.names = triangles[self.pixels]
        self.near = (frame.keys[self.pixels] >> np.uint64(32)).astype(np.uint32).view(np.float32)
        rows, columns = np.divmod(self.pixels, frame.size[0])
        self._rows, self._columns = rows.astype(np.float32) + _HALF, columns.astype(np.float32) + _HALF
        self.sun, self.up = self._facing(sun)

    def _facing(self, sun: Array) -> tuple[Floats, Floats]:
        """Cosines (n,) between the surface normals and the directions to the sun and up, interpolated from vertices.

        The interpolation is perspective-correct: values are multiplied by nearness before, and divided after it.
        """
        model = self.model
        points = self.view.project(model.vertices, self.size).astype(np.float64)
        corners = model.triangles[:, ::-1]
        at = points[corners]
        (ax, ay), (bx, by), (cx, cy) = (at[:, k, :2].T for k in range(3))
        area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        area = np.where(np.abs(area) > FLAT, area, FLAT)
        cosines = []
        for axis in (sun, np.array([0.0, 0.0, 1.0])):
            values = np.einsum("nj,j->n", model.normals, axis) * points[:, 2]
            a, b, c = _slopes(at, values[corners], area).astype(np.float32).T
            value = (a[self.names] + b[self.names] * self._columns + c[self.names] * self._rows) / self.near
            cosines.append(np.clip(value, np.float32(-1), np.float32(1)))
        return cosines[0], cosines[1]

    def colours(self, shadow: Shadow) -> Floats:
        """Colours lit by sky and sun, (n, 3)."""
        lit: Floats = np.maximum(self.sun, np.float32(0))
        faces = np.flatnonzero(lit)
        width, height = self.size
        scale, depth = np.float32(2 * math.tan(FIELD / 2) / height), np.float32(1) / self.near[faces]
        across = (self._columns[faces] - np.float32(width / 2)) * depth * scale
        down = (self._rows[faces] - np.float32(height / 2)) * depth * scale
        lit[faces] *= shadow.reaches(self.view, (across, down, depth), self.sun[faces])
        from_above = self.up * _HALF + _HALF
        albedo = self.model.colours[:, :3].astype(np.float32)
        colours = np.empty((len(self.names), 3), np.float32)
        for k in range(3):
            light = GROUND[k] + (SKY[k] - GROUND[k]) * from_above + SUNLIGHT[k] * lit
            colours[:, k] = np.minimum(albedo[:, k][self.names] * light, np.float32(255))
        return colours


_HALF = np.float32(0.5)
FLAT = 1e-9
"""Smallest doubled area of a triangle that is drawn [pixels]."""


def _hollows(frame: Frame) -> Floats:
    """Brightness factors (height * width,) that darken surfaces which lie behind their surroundings."""
    width, height = frame.size
    near = frame.nearness.reshape(height, width)[::FINE, ::FINE].copy()
    if not near.any():
        return np.ones(width * height, np.float32)
    near[near == 0] = near[near > 0].min()
    depth = np.log(near)
    behind = _blurred(depth, max(2, round(HOLLOW * width / FINE / 640))) - depth
    factor = 1 - np.clip(behind * np.float32(2.2), 0, np.float32(0.22))
    return np.repeat(np.repeat(factor, FINE, axis=0), FINE, axis=1).reshape(-1)


def _blurred(values: Floats, radius: int) -> Floats:
    """Box-blur an image (height, width), one axis after the other."""
    blurred, side = values.astype(np.float64), 2 * radius + 1
    for _ in range(2):
        padded = np.pad(blurred, [(radius + 1, radius), (0, 0)], mode="edge")
        sums = np.cumsum(padded, axis=0)
        blurred = ((sums[side:] - sums[:-side]) / side).T
    return blurred.astype(np.float32)


class _Edges:
    """Detects edges by the differences of owner, illumination and depth between adjacent pixels."""

    def __init__(self, size: tuple[int, int]) -> None:
        self._size = size
        count = size[0] * size[1]
        self._owners = np.full(count, -1, np.int32)
        self._sun, self._up, self._depth = (
            np.zeros(count, np.float32),
            np.zeros(count, np.float32),
            np.zeros(count, np.float32),
        )

    def add(self, visible: _Visible) -> None:
        """Add the properties of visible pixels."""
        self._owners[visible.pixels] = visible.model.owners[visible.names]
        self._sun[visible.pixels], self._up[visible.pixels] = visible.sun, visible.up
        self._depth[visible.pixels] = np.log(visible.near)

    def lines(self) -> Floats:
        """Brightness factors (height * width,) that draw the lines."""
        width, height = self._size
        owners, sun, up, depth = (
            one.reshape(height, width) for one in (self._owners, self._sun, self._up, self._depth)
        )
        factors = np.ones((height, width), np.float32)
        for first, second in ((np.s_[:-1, :], np.s_[1:, :]), (np.s_[:, :-1], np.s_[:, 1:])):
            crease = (np.abs(sun[first] - sun[second]) > BENT) | (np.abs(up[first] - up[second]) > BENT)
            apart = (owners[first] != owners[second]) | (np.abs(depth[first] - depth[second]) > STEP)
            for lines, value in ((crease, CREASE), (apart, LINE)):
                for part in (factors[first], factors[second]):
                    np.minimum(part, np.float32(value), out=part, where=lines)
        return factors.reshape(-1)
