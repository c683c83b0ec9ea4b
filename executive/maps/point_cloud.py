"""Point clouds as PCD (of PCL), PLY or lines of numbers (XYZ); sizes are bounded.

Formats: https://pointclouds.org/documentation/tutorials/pcd_file_format.html, http://paulbourke.net/dataformats/ply.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from planlang.diagnostics import BadInput, Span, error
from planlang.files import read_file
from planlang.geometry import Array

LARGEST = 64_000_000
"""Greatest size of a file [bytes]."""
MOST_POINTS = 4_000_000
LONGEST_HEADER = 10_000
"""Greatest size of a header [bytes]."""
CODE = "M024"
SUFFIXES = (".pcd", ".ply", ".xyz")

_PCD_TYPES = {"F4": "f4", "F8": "f8"} | {f"{kind}{size}": f"{kind.lower()}{size}" for kind in "IU" for size in "1248"}
_PLY_TYPES = {"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4"}
_PLY_TYPES |= {"float": "f4", "double": "f8", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2"}
_PLY_TYPES |= {"int32": "i4", "uint32": "u4", "float32": "f4", "float64": "f8"}
_NUMBERS = re.compile(rb"(?:[0-9eE+.\- ]|nan|NaN|inf)*+")


def read_points(path: Path) -> Array:
    """Read the points (n, 3) of a file, in its own frame [m]; some may be NaN. Raises BadInput with one error."""
    content = read_file(path, CODE, largest=LARGEST)
    try:
        match path.suffix.lower():
            case ".pcd":
                points = _pcd(content)
            case ".ply":
                points = _ply(content)
            case _:
                points = _xyz(content)
    except ValueError as problem:
        raise BadInput([error(CODE, str(problem), Span(str(path), 1))]) from None
    return points.astype(np.float64)


def _pcd(content: bytes) -> Array:
    """Read the points of a PCD file. Raises ValueError."""
    match = re.match(rb"(.*?(?:^|\n)DATA[ \t]+(\w+)[ \t\r]*)\n", content[:LONGEST_HEADER], re.DOTALL)
    if match is None:
        raise ValueError("not a PCD file: its header must end with DATA ascii or DATA binary")
    lines = [line.split() for line in match[1].decode("ascii", "replace").splitlines()]
    header = {words[0]: words[1:] for words in lines if words and not words[0].startswith("#")}
    fields, count = header.get("FIELDS", []), _count(header.get("POINTS") or header.get("WIDTH", []))
    widths = [_count([one]) for one in header.get("COUNT", ["1"] * len(fields))]
    kinds = [f"{kind}{size}" for kind, size in zip(header.get("TYPE", []), header.get("SIZE", []), strict=False)]
    if not len(fields) == len(widths) == len(kinds) or not all(1 <= number <= 1000 for number in widths):
        raise ValueError("FIELDS, SIZE, TYPE and COUNT of the PCD header must have one entry per field")
    encoding, data = match[2].decode(), content[match.end() :]
    if encoding == "ascii":
        return _table(data, fields, widths, count)
    if encoding != "binary":
        raise ValueError(f"cannot read DATA {encoding}: convert it with pcl_convert_pcd_ascii_binary")
    unknown = [kind for kind in kinds if kind not in _PCD_TYPES]
    if unknown:
        raise ValueError(f"unknown TYPE and SIZE of a PCD field: {unknown[0]}")
    return _records(data, fields, [f"<{_PCD_TYPES[kind]}" for kind in kinds], widths, count)


def _ply(content: bytes) -> Array:
    """Read the vertices of a PLY file. Raises ValueError."""
    match = re.match(rb"(ply\r?\n.*?\n)end_header[ \t\r]*\n", content[:LONGEST_HEADER], re.DOTALL)
    if match is None:
        raise ValueError("not a PLY file: its header must begin with ply and end with end_header")
    lines = [line.split() for line in match[1].decode("ascii", "replace").splitlines()[1:]]
    lines = [words for words in lines if words and words[0] not in ("comment", "obj_info")]
    elements = [row for row, words in enumerate(lines) if words[0] == "element"] or [len(lines)]
    element, properties = lines[elements[0] : elements[0] + 1], lines[elements[0] + 1 : [*elements, None][1]]
    if (
        not element
        or element[0][1:2] != ["vertex"]
        or not all(len(words) == 3 and words[0] == "property" and words[1] in _PLY_TYPES for words in properties)
    ):
        raise ValueError("the first element of the PLY header must be vertex, with numeric properties only")
    fields, count = [words[2] for words in properties], _count(element[0][2:])
    encoding = next((words[1] for words in lines if words[0] == "format" and len(words) == 3), "")
    data, ones = content[match.end() :], [1] * len(fields)
    if encoding == "ascii":
        return _table(data, fields, ones, count)
    order = {"binary_little_endian": "<", "binary_big_endian": ">"}.get(encoding)
    if order is None:
        raise ValueError(f"the format of a PLY file must be ascii or binary, not {encoding[:40]!r}")
    return _records(data, fields, [order + _PLY_TYPES[words[1]] for words in properties], ones, count)


def _xyz(content: bytes) -> Array:
    """Read the points of lines that begin with x, y and z; # starts a comment. Raises ValueError."""
    lines = [line for line in re.sub(rb"#[^\n]*", b"", content).splitlines() if line.strip()]
    _count([str(len(lines))])
    width = len(lines[0].split()) if lines else 3
    if width < 3 or any(len(line.split()) != width for line in lines):
        raise ValueError("each line of an XYZ file must begin with x, y, z, and have as many numbers as the first")
    return _table(b"\n".join(lines), ["x", "y", "z"], [1, 1, width - 2], len(lines))


def _count(words: Sequence[str]) -> int:
    """Read a number of points, or of values of a field. Raises ValueError."""
    if len(words) != 1 or not re.fullmatch(r"\d{1,9}", words[0]):
        raise ValueError("the header must state the number of points")
    if int(words[0]) > MOST_POINTS:
        raise ValueError(f"over {MOST_POINTS:,} points: downsample the cloud (pcl_voxel_grid, CloudCompare)")
    return int(words[0])


def _columns(fields: Sequence[str], widths: Sequence[int]) -> list[int]:
    """Find the columns of x, y and z; ``widths`` are numbers of columns per field. Raises ValueError."""
    starts = np.concatenate([[0], np.cumsum(widths)]).tolist()
    if any(fields.count(name) != 1 for name in "xyz"):
        raise ValueError(f"points must have the fields x, y and z, not {', '.join(fields)[:80]}")
    return [starts[fields.index(name)] for name in "xyz"]


def _table(data: bytes, fields: Sequence[str], widths: Sequence[int], count: int) -> Array:
    """Read points written as text. Raises ValueError."""
    columns, width = _columns(fields, widths), sum(widths)
    words = data.split(maxsplit=count * width)[: count * width]
    if len(words) != count * width or not _NUMBERS.fullmatch(b" ".join(words)):
        raise ValueError(f"the header promises {count} points of {width} numbers, but the data differ")
    try:
        numbers = np.array(list(map(float, words)))
    except ValueError:
        raise ValueError("the points contain something other than numbers") from None
    return numbers.reshape(count, width)[:, columns]


def _records(data: bytes, fields: Sequence[str], kinds: Sequence[str], widths: Sequence[int], count: int) -> Array:
    """Read points written as binary records. Raises ValueError."""
    _columns(fields, widths)
    names = [name if name in ("x", "y", "z") else f"_{index}" for index, name in enumerate(fields)]
    kind = np.dtype([(name, one, (number,)) for name, one, number in zip(names, kinds, widths, strict=True)])
    if len(data) < count * kind.itemsize:
        raise ValueError(f"the header promises {count} points of {kind.itemsize} bytes, but the file is shorter")
    records = np.frombuffer(data, dtype=kind, count=count)
    return np.stack([records[name][:, 0].astype(np.float64) for name in "xyz"], axis=1)
