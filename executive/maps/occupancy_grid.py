"""Occupancy grids in the format of ROS map_server and nav2: a YAML file with an image; sizes are bounded.

Of the YAML only texts and lists of texts are used: tags and aliases in untrusted files are never followed. Images are
those of map_server, whatever their depth, palette or transparency. Formats: https://wiki.ros.org/map_server,
nav2_map_server's map_io.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from io import BytesIO
from pathlib import Path, PureWindowsPath

import numpy as np
import yaml
from numpy.typing import NDArray
from PIL import Image, UnidentifiedImageError

from planlang.diagnostics import BadInput, Span, unread
from planlang.files import decode, read_file
from planlang.geometry import Array, Pose
from planlang.records import dataclass

LARGEST_YAML, LARGEST_PICTURE = 10_000, 64_000_000
"""Greatest size of the files [bytes]."""
MOST_CELLS = 16_000_000
"""Greatest number of cells: 200 m by 200 m at 5 cm."""
RESOLUTIONS = (0.001, 10.0)
"""Least and greatest length of a cell [m]."""
HEIGHT = 1.0
"""Default height of obstacles [m]: high enough that hands keep away from them, too."""
HEIGHTS = (0.01, 10.0)
"""Least and greatest height of obstacles [m]."""
CODE = "M024"

Cells = NDArray[np.bool_]

FORMATS = ("PNG", "BMP", "PPM", "JPEG", "GIF")
"""Formats of images, by Pillow's names; PPM stands for PGM, PBM and PPM, in binary and in plain form."""
MODES = ("trinary", "scale", "raw")
"""What an image states: free, occupied or unknown; also probabilities; percentages."""
YES, NO = ("1", "true", "yes", "on", "y"), ("0", "false", "no", "off", "n")
"""How booleans are written, in lower case; map_server writes numbers, nav2 words."""


@dataclass(frozen=True, slots=True, eq=False)
class OccupancyGrid:
    """The occupied cells of a grid; the others are free or unknown."""

    occupied: Cells
    """Mask (rows, columns) of occupied cells; row 0 has the smallest y in the grid's frame."""
    resolution: float
    """Length of a cell [m]."""
    origin: tuple[float, float, float]
    """Pose of the outer corner of the first cell in the map: x [m], y [m], yaw [rad]."""
    height: float
    """Height of the obstacles [m]: ``height`` of the YAML file, which map_server ignores, else :data:`HEIGHT`."""

    @property
    def frame(self) -> Pose:
        """The grid's frame in the map."""
        return Pose.planar(*self.origin)

    def centres(self) -> Array:
        """Compute the centres (n, 3) of the occupied cells in the grid's frame, at z = 0 [m]."""
        rows, columns = np.nonzero(self.occupied)
        return np.stack([columns + 0.5, rows + 0.5, 0.0 * rows], axis=-1) * self.resolution


def read_grid(path: Path) -> OccupancyGrid:
    """Read the grid of a YAML file. Raises BadInput with one error and its line."""
    entries = _Entries(path)
    resolution, height = entries.number("resolution", *RESOLUTIONS), entries.number("height", *HEIGHTS, HEIGHT)
    threshold = entries.number("occupied_thresh", 0.0, 1.0, 0.65)
    mode = (entries.text("mode") or MODES[0]).lower()
    if mode not in MODES:
        raise entries.wrong("mode", f"one of {', '.join(MODES)}")
    negate = (entries.text("negate") or NO[0]).lower()
    if negate not in (*YES, *NO):
        raise entries.wrong("negate", "0 or 1, or false or true")
    origin = entries.numbers("origin")
    if len(origin) not in (2, 3):
        raise entries.wrong("origin", "[x, y, yaw]")
    shade, is_opaque = read_image(_picture(path, entries), averages_alpha=mode == MODES[0])
    if mode == "raw":
        percent = np.round(shade * 255)
        occupied = (percent / 100 > threshold) & (percent <= 100)  # above 100: unknown
    else:
        occupied = ((shade if negate in YES else 1.0 - shade) > threshold) & is_opaque
    x, y, yaw = (*origin, 0.0)[:3]
    return OccupancyGrid(occupied[::-1], resolution, (x, y, yaw), height)


def _picture(path: Path, entries: _Entries) -> Path:
    """Find the image: as named, in another case, or, for a path of another machine, the file of that name here."""
    image = entries.text("image")
    if not image:
        raise _bad("the entry image is missing", path, 1)
    named = path.parent / image
    if not named.resolve().is_relative_to(path.parent.resolve()) or not named.is_file():
        named = path.parent / PureWindowsPath(image.rstrip("/\\")).name
    if named.is_file() or not named.parent.is_dir():
        return named
    alike = sorted(one for one in named.parent.iterdir() if one.name.casefold() == named.name.casefold())
    return alike[0] if alike else named


class _Entries:
    """The entries of a YAML file, as texts with their lines. Raises BadInput for a file that has no such entries."""

    def __init__(self, path: Path) -> None:
        self._path = path
        text = decode(read_file(path, CODE, largest=LARGEST_YAML), str(path))
        try:
            node = yaml.compose(text, Loader=yaml.SafeLoader)
        except (yaml.YAMLError, RecursionError, ValueError) as problem:
            mark = getattr(problem, "problem_mark", None)
            reason = getattr(problem, "problem", None) or "it is nested too deeply"
            raise _bad(f"not YAML: {reason}", path, 1 if mark is None else mark.line + 1) from None
        if not isinstance(node, yaml.MappingNode):
            raise _bad("expected entries such as `image: map.pgm`", path, 1)
        self._texts: Mapping[str, tuple[list[str] | None, int]] = {
            str(key.value): (_texts(value), key.start_mark.line + 1) for key, value in node.value
        }

    def text(self, key: str) -> str | None:
        """The text of an entry; None if it is missing or empty. Raises BadInput for a list."""
        texts, _ = self._texts.get(key, ([], 1))
        if texts is None or len(texts) > 1:
            raise self.wrong(key, "one value")
        return texts[0].strip() if texts and texts[0].lower() not in ("", "~", "null") else None

    def numbers(self, key: str) -> list[float]:
        """The numbers of a list; none if it is missing. Raises BadInput."""
        texts, _ = self._texts.get(key, ([], 1))
        try:
            values = [float(text) for text in texts or ()]
        except ValueError:
            values = [math.nan]
        if not all(abs(value) <= 1e6 for value in values):
            raise self.wrong(key, "numbers up to 1e6")
        return values

    def number(self, key: str, least: float, most: float, default: float | None = None) -> float:
        """A number within limits. Raises BadInput."""
        if default is not None and self.text(key) is None:
            return default
        values = self.numbers(key)
        if len(values) != 1 or not least <= values[0] <= most:
            raise self.wrong(key, f"a number from {least:g} to {most:g}")
        return values[0]

    def wrong(self, key: str, wanted: str) -> BadInput:
        """The error about an entry with another value than is wanted."""
        texts, line = self._texts.get(key, ([], 1))
        shown = "what it is" if texts is None else f"`{', '.join(texts)[:80]}`"
        return _bad(f"{key} must be {wanted}, not {shown}" if texts else f"{key} must be {wanted}", self._path, line)


def _texts(node: object) -> list[str] | None:
    """The texts of a scalar, or of a list of scalars; None for anything else."""
    if isinstance(node, yaml.ScalarNode):
        return [str(node.value)]
    if isinstance(node, yaml.SequenceNode) and all(isinstance(one, yaml.ScalarNode) for one in node.value):
        return [str(one.value) for one in node.value]
    return None


def read_image(path: Path, *, averages_alpha: bool = False) -> tuple[Array, NDArray[np.bool_]]:
    """Read an image: brightness from 0 to 1 (rows, columns), the upper row first, and which pixels are opaque.

    Colours are averaged. With ``averages_alpha``, as in map_server's trinary mode, the opacity of transparent pixels is
    one of them, and all pixels count as opaque. Raises BadInput if the file is no image, or too large.
    """
    content = read_file(path, CODE, largest=LARGEST_PICTURE)
    try:
        with Image.open(BytesIO(content), formats=FORMATS) as image:
            width, height = image.size
            if width * height > MOST_CELLS:
                raise _bad(f"an image of {width} x {height} has over {MOST_CELLS:,} cells", path, 1)
            if image.mode.startswith("I"):  # 16 bits, of which Pillow would keep the lower 8
                deep = np.asarray(image, dtype=float)
                return deep / 65535, np.ones(deep.shape, dtype=bool)
            has_alpha = "A" in image.getbands() or "transparency" in image.info
            pixels = np.asarray(image.convert("RGBA" if has_alpha else "RGB"), dtype=float) / 255
    except UnidentifiedImageError:
        raise _bad(f"not an image that can be read ({', '.join(FORMATS)})", path, 1) from None
    except (OSError, ValueError, SyntaxError, EOFError, Image.DecompressionBombError) as problem:
        raise _bad(f"the image is damaged: {problem}", path, 1) from None
    shade = pixels[..., :3].mean(axis=2)
    is_opaque = pixels[..., 3] >= 1.0 if has_alpha else np.ones(shade.shape, dtype=bool)
    if not averages_alpha:
        return shade, is_opaque
    # map_server averages the opacity of opaque pixels, too, so that black is no obstacle beyond a threshold of 0.75
    return np.where(is_opaque, shade, pixels.mean(axis=2)), np.ones(shade.shape, dtype=bool)


def _bad(message: str, path: Path, line: int) -> BadInput:
    return BadInput([unread(CODE, message, Span(str(path), line))])
