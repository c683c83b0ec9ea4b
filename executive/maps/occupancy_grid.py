"""Occupancy grids in the format of ROS map_server: a YAML file with a PGM image; sizes are bounded.

Only the YAML that map_server writes is read: flat ``key: value`` lines, and a list of three numbers for the origin.
Anchors, tags and nesting in untrusted files are never followed. Formats: https://wiki.ros.org/map_server, Netpbm's PGM.
"""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from planlang.diagnostics import BadInput, Span, error
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

_LINE = re.compile(r"(\w+)[ \t]*:[ \t]*(.*?)[ \t]*(?:#.*)?")
_ITEM = re.compile(r"[ \t]*-[ \t]*(.*?)[ \t]*(?:#.*)?")
_SPACE = rb"(?:\s|#[^\n]*\n)++"
_DIGITS = re.compile(rb"[0-9\s]*+")
_HEADER = re.compile(rb"(P[25])" + 3 * (_SPACE + rb"(\d{1,6})") + rb"\s")


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
    entries = _entries(path)

    def number(key: str, default: float | None = None) -> float:
        text, line = entries.get(key, ("", 1))
        if not text and default is not None:
            return default
        return _number(text, key, Span(str(path), line))

    def within(key: str, least: float, most: float, default: float | None = None) -> float:
        value = number(key, default)
        if not least <= value <= most:
            raise _bad(f"{key} must be from {least} to {most} m, not {value} m", path, entries[key][1])
        return value

    resolution, height = within("resolution", *RESOLUTIONS), within("height", *HEIGHTS, HEIGHT)
    image, line = entries.get("image", ("", 1))
    if not image:
        raise _bad("the entry image is missing", path, line)
    picture = path.parent / image
    if not picture.resolve().is_relative_to(path.parent.resolve()):
        picture = path.parent / Path(image).name  # often an absolute path of the machine that made the map
    brightness, raw = read_pgm(picture)
    mode = entries.get("mode", ("trinary", 1))[0]
    probability = raw / 100 if mode == "raw" else brightness if number("negate", 0.0) else 1.0 - brightness
    threshold = number("occupied_thresh", 0.65)
    occupied = (probability > threshold) & ((raw <= 100) if mode == "raw" else True)  # above 100: unknown
    text, line = entries.get("origin", ("", 1))
    words = text.strip("[]").replace(",", " ").split()
    if len(words) != 3:
        raise _bad(f"origin must be [x, y, yaw], not {text[:80]!r}", path, line)
    x, y, yaw = (_number(word, "origin", Span(str(path), line)) for word in words)
    return OccupancyGrid(occupied[::-1], resolution, (x, y, yaw), height)


def _entries(path: Path) -> dict[str, tuple[str, int]]:
    """Split a YAML file into values as text, each with its line; the items of a list are joined by spaces."""
    text = decode(read_file(path, CODE, largest=LARGEST_YAML), str(path))
    entries: dict[str, tuple[str, int]] = {}
    last = ""
    for number, line in enumerate(text.splitlines(), 1):
        if not line.strip() or line.lstrip().startswith(("#", "---")):
            continue
        item, entry = _ITEM.fullmatch(line), _LINE.fullmatch(line)
        if item is not None and last:
            text_before, first_line = entries[last]
            entries[last] = f"{text_before} {item[1]}", first_line
        elif entry is not None:
            last = entry[1]
            entries[last] = entry[2].strip("\"'"), number
        else:
            raise _bad(f"expected `key: value`, found {line[:80]!r}", path, number)
    return entries


def _number(text: str, key: str, span: Span) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not abs(value) <= 1e6:
        raise BadInput([error(CODE, f"{key} must be a number up to 1e6, not {text[:80]!r}", span)])
    return value


def read_pgm(path: Path) -> tuple[Array, Array]:
    """Read a PGM image: brightness from 0 to 1 (rows, columns), the upper row first, and the raw values.

    Raises BadInput if it is not a PGM image, or too large.
    """
    content = read_file(path, CODE, largest=LARGEST_PICTURE)
    header = _HEADER.match(content)
    if header is None:
        raise _bad("not a PGM image (P5 or P2)", path, 1)
    width, height, greatest = (int(number) for number in header.groups()[1:])
    if not (0 < width * height <= MOST_CELLS and 0 < greatest <= 65535):
        message = f"an image of {width} x {height} with values up to {greatest} is empty or invalid, or has over"
        raise _bad(f"{message} {MOST_CELLS:,} cells", path, 1)
    data = content[header.end() :]
    if header[1] == b"P2":
        if not _DIGITS.fullmatch(data):
            raise _bad("only numbers may follow the header", path, 1)
        values = np.fromstring(data, dtype=np.int64, sep=" ")[: width * height]
    else:
        kind = np.dtype(np.uint8 if greatest < 256 else ">u2")
        values = np.frombuffer(data[: width * height * kind.itemsize], dtype=kind).astype(np.int64)
    if len(values) != width * height or values.min() < 0 or values.max() > greatest:
        raise _bad(f"the header promises {width} x {height} values from 0 to {greatest}, but the data differ", path, 1)
    raw = values.reshape(height, width).astype(float)
    return raw / greatest, raw


def _bad(message: str, path: Path, line: int) -> BadInput:
    return BadInput([error(CODE, message, Span(str(path), line))])
