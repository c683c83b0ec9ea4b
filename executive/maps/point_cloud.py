"""Point clouds as PCD (of PCL), PLY or lines of numbers (XYZ); sizes are bounded. Faces of a PLY become points, too.

Formats: https://pointclouds.org/documentation/tutorials/pcd_file_format.html, http://paulbourke.net/dataformats/ply.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np

from planlang.diagnostics import BadInput, Span, unread
from planlang.files import read_file
from planlang.geometry import Array
from planlang.geometry.cover import CELL, samples
from planlang.records import dataclass

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
        raise BadInput([unread(CODE, str(problem), Span(str(path), 1))]) from None
    return points.astype(np.float64)


def _pcd(content: bytes) -> Array:
    """Read the points of a PCD file. Raises ValueError."""
    match = re.match(rb"(.*?(?:^|\n)DATA[ \t]+(\w+)[ \t\r]*)\n", content[:LONGEST_HEADER], re.DOTALL)
    if match is None:
        raise ValueError("not a PCD file: its header must end with DATA ascii, binary or binary_compressed")
    lines = [line.split() for line in match[1].decode("ascii", "replace").splitlines()]
    header = {words[0]: words[1:] for words in lines if words and not words[0].startswith("#")}
    fields, count = header.get("FIELDS") or header.get("COLUMNS", []), _pcd_count(header)
    widths = [_count([one]) for one in header.get("COUNT", ["1"] * len(fields))]
    kinds = [f"{kind}{size}" for kind, size in zip(header.get("TYPE", []), header.get("SIZE", []), strict=False)]
    if not len(fields) == len(widths) == len(kinds) or not all(number <= 1000 for number in widths):
        raise ValueError("FIELDS, SIZE, TYPE and COUNT of the PCD header must have one entry per field")
    encoding, data = match[2].decode(), content[match.end() :]
    if encoding == "ascii":
        return _table(data, fields, widths, count)[0]
    if encoding not in ("binary", "binary_compressed"):
        raise ValueError(f"cannot read DATA {encoding}: convert it with pcl_convert_pcd_ascii_binary")
    unknown = [kind for kind in kinds if kind not in _PCD_TYPES]
    if unknown:
        raise ValueError(f"unknown TYPE and SIZE of a PCD field: {unknown[0]}")
    record = _record(fields, [f"<{_PCD_TYPES[kind]}" for kind in kinds], widths)
    if encoding == "binary_compressed":
        data = _in_records(_decompressed(data), record, count)
    return _records(data, record, count)


def _pcd_count(header: Mapping[str, Sequence[str]]) -> int:
    """Read the number of points: POINTS, which may be missing, and rows times columns. Raises ValueError."""
    points, width = header.get("POINTS"), header.get("WIDTH")
    if width is None:
        return _count(points or [])
    count = _count([str(_count(width) * _count(header.get("HEIGHT", ["1"])))])
    if points is not None and _count(points) != count:
        raise ValueError(f"the header states {points[0]} POINTS, but WIDTH times HEIGHT are {count}")
    return count


def _decompressed(data: bytes) -> bytes:
    """Decompress the data of a PCD file: two sizes, then the format of LibLZF. Raises ValueError.

    A byte below 32 is followed by one more byte than it says; a greater one repeats earlier bytes: its upper three bits
    are their number less two (seven: plus the next byte), its lower five and the next byte are how far back they begin.
    """
    packed, size = struct.unpack("<II", data[:8].ljust(8, b"\0"))
    if size > LARGEST:
        raise ValueError(f"the points are larger than {LARGEST // 1_000_000} MB: downsample the cloud")
    packed_data, found, at = data[8 : 8 + packed], bytearray(), 0
    try:
        while at < len(packed_data) and len(found) <= size:
            control = packed_data[at]
            at += 1
            if control < 32:
                found += packed_data[at : at + control + 1]
                at += control + 1
                continue
            length = control >> 5
            if length == 7:
                length += packed_data[at]
                at += 1
            start = len(found) - ((control & 31) << 8) - packed_data[at] - 1
            at += 1
            if start < 0:
                raise ValueError("the compressed points are damaged")
            wanted = len(found) + length + 2
            while len(found) < wanted:  # what is repeated may overlap with what it makes
                found += found[start : start + wanted - len(found)]
    except IndexError:
        raise ValueError("the compressed points are damaged") from None
    if len(found) != size:
        raise ValueError(f"the compressed points promise {size} bytes, but have {len(found)}")
    return bytes(found)


def _in_records(columns: bytes, record: np.dtype[np.void], count: int) -> bytes:
    """Bring points that were written field by field into the order of records. Raises ValueError."""
    if len(columns) != count * record.itemsize:
        raise ValueError(f"the header promises {count} points of {record.itemsize} bytes, but the data differ")
    records, start = np.empty(count, dtype=record), 0
    for name in record.names or ():
        kind = record[name]
        field = np.frombuffer(columns, dtype=kind.base, count=count * kind.itemsize // kind.base.itemsize, offset=start)
        records[name] = field.reshape(count, -1)
        start += count * kind.itemsize
    return records.tobytes()


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
    faces = _Faces.of(lines[elements[1] :] if len(elements) > 1 else [])
    if encoding == "ascii":
        points, rest = _table(data, fields, ones, count, is_last=faces is None)
        return points if faces is None else _with_surface(points, faces.read(rest.split()))
    order = {"binary_little_endian": "<", "binary_big_endian": ">"}.get(encoding)
    if order is None:
        raise ValueError(f"the format of a PLY file must be ascii or binary, not {encoding[:40]!r}")
    record = _record(fields, [order + _PLY_TYPES[words[1]] for words in properties], ones)
    points = _records(data, record, count, is_last=faces is None)
    return points if faces is None else _with_surface(points, faces.unpack(data[count * record.itemsize :], order))


@dataclass(frozen=True, slots=True)
class _Faces:
    """The faces of a PLY file, which follow its vertices: how many, and the types of their properties."""

    count: int
    kinds: Sequence[tuple[str, ...]]
    """For each property its type, or the types of the length and the items of a list."""
    corners: int
    """Index of the property that lists the corners."""

    @classmethod
    def of(cls, lines: Sequence[Sequence[str]]) -> _Faces | None:
        """Read the header of the element behind the vertices; None if there are no faces. Raises ValueError."""
        if not any(words[:2] == ["element", "face"] and words[2:] != ["0"] for words in lines):
            return None
        ends = [row for row, words in enumerate(lines) if words[0] == "element"][1:]
        element, properties = lines[0], lines[1 : ends[0] if ends else None]
        kinds = [tuple(words[2:-1] if words[1:2] == ["list"] else words[1:-1]) for words in properties]
        named = [index for index, words in enumerate(properties) if words[-1] in ("vertex_indices", "vertex_index")]
        known = all(len(kind) in (1, 2) and set(kind) <= set(_PLY_TYPES) for kind in kinds)
        if element[1] != "face" or not known or len(named) != 1 or len(kinds[named[0]]) != 2:
            raise ValueError("the element behind the vertices must be face, with a list vertex_indices")
        return cls(_count(element[2:]), kinds, named[0])

    def read(self, words: Sequence[bytes]) -> Iterator[Sequence[int]]:
        """Yield the corners of each face written as text. Raises ValueError."""
        at = 0
        for _ in range(self.count):
            for index, kind in enumerate(self.kinds):
                length, first = (int(words[at]), at + 1) if len(kind) == 2 and at < len(words) else (1, at)
                at = first + length
                if not first <= at <= len(words):
                    raise ValueError("the file ends before the last face")
                if index == self.corners:
                    yield [int(word) for word in words[first:at]]

    def unpack(self, data: bytes, order: str) -> Iterator[Sequence[int]]:
        """Yield the corners of each face written as binary. Raises ValueError."""
        codes = {"i1": "b", "u1": "B", "i2": "h", "u2": "H", "i4": "i", "u4": "I", "f4": "f", "f8": "d"}
        kinds = [[codes[_PLY_TYPES[one]] for one in kind] for kind in self.kinds]
        at = 0
        try:
            for _ in range(self.count):
                for index, kind in enumerate(kinds):
                    length = 1
                    if len(kind) == 2:
                        (length,) = struct.unpack_from(order + kind[0], data, at)
                        at += struct.calcsize(order + kind[0])
                    items = struct.unpack_from(f"{order}{max(int(length), 0)}{kind[-1]}", data, at)
                    at += struct.calcsize(f"{order}{len(items)}{kind[-1]}")
                    if index == self.corners:
                        yield [int(item) for item in items]
        except struct.error:
            raise ValueError("the file ends before the last face") from None


def _with_surface(points: Array, faces: Iterator[Sequence[int]]) -> Array:
    """Add points (n, 3) on faces, which may lie far from their corners. Raises ValueError."""
    triangles = [(one[0], b, c) for one in faces for b, c in pairwise(one[1:])]
    if not triangles:
        return points
    corners = np.array(triangles, dtype=np.int64)
    if corners.min() < 0 or corners.max() >= len(points):
        raise ValueError(f"a face names a vertex that is not there: there are {len(points)}")
    corners = corners[np.isfinite(points[corners]).all(axis=(1, 2)) & (np.abs(points[corners]) < 1e6).all(axis=(1, 2))]
    return np.concatenate([points, samples(points, corners, CELL)[0]]) if len(corners) else points


def _xyz(content: bytes) -> Array:
    """Read the points of lines that begin with x, y and z; # starts a comment. Raises ValueError."""
    lines = [line for line in re.sub(rb"#[^\n]*", b"", content).splitlines() if line.strip()]
    _count([str(len(lines))])
    width = len(lines[0].split()) if lines else 3
    if width < 3 or any(len(line.split()) != width for line in lines):
        raise ValueError("each line of an XYZ file must begin with x, y, z, and have as many numbers as the first")
    return _table(b"\n".join(lines), ["x", "y", "z"], [1, 1, width - 2], len(lines))[0]


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


def _table(
    data: bytes, fields: Sequence[str], widths: Sequence[int], count: int, *, is_last: bool = True
) -> tuple[Array, bytes]:
    """Read points written as text, and return the rest of the data: none if they are the last. Raises ValueError."""
    columns, width = _columns(fields, widths), sum(widths)
    *words, rest = [*data.split(maxsplit=count * width), b""][: count * width + 1]
    if len(words) != count * width or (is_last and rest.strip()) or not _NUMBERS.fullmatch(b" ".join(words)):
        raise ValueError(f"the header promises {count} points of {width} numbers, but the data differ")
    try:
        numbers = np.array(list(map(float, words)))
    except ValueError:
        raise ValueError("the points contain something other than numbers") from None
    return numbers.reshape(count, width)[:, columns], rest


def _record(fields: Sequence[str], kinds: Sequence[str], widths: Sequence[int]) -> np.dtype[np.void]:
    """Make the type of a binary record. Raises ValueError."""
    _columns(fields, widths)
    names = [name if name in ("x", "y", "z") else f"_{index}" for index, name in enumerate(fields)]
    return np.dtype([(name, one, (number,)) for name, one, number in zip(names, kinds, widths, strict=True)])


def _records(data: bytes, record: np.dtype[np.void], count: int, *, is_last: bool = True) -> Array:
    """Read points written as binary records. Raises ValueError."""
    more = len(data) - count * record.itemsize
    if more < 0 or (is_last and more >= record.itemsize):
        raise ValueError(f"the header promises {count} points of {record.itemsize} bytes, but the data differ")
    records = np.frombuffer(data, dtype=record, count=count)
    return np.stack([records[name][:, 0].astype(np.float64) for name in "xyz"], axis=1)
