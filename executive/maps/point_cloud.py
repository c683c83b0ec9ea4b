"""Points as PCL writes them (PCD), as PLY, or as lines of numbers (XYZ), read with bounds.

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
"""Bytes that are read at most."""
MOST_POINTS = 4_000_000
LONGEST_HEADER = 10_000
"""Bytes of a header."""
CODE = "M024"
SUFFIXES = (".pcd", ".ply", ".xyz")

_PCD_TYPES = {"F4": "f4", "F8": "f8"} | {f"{kind}{size}": f"{kind.lower()}{size}" for kind in "IU" for size in "1248"}
_PLY_TYPES = {"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4"}
_PLY_TYPES |= {"float": "f4", "double": "f8", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2"}
_PLY_TYPES |= {"int32": "i4", "uint32": "u4", "float32": "f4", "float64": "f8"}
_NUMBERS = re.compile(rb"(?:[0-9eE+.\- ]|nan|NaN|inf)*+")


def read_points(path: Path) -> Array:
    """Return the points (n, 3) of a file in its frame [m]; not all need be finite.

    Raises BadInput with one error that says what is wrong.
    """
    content = read_file(path, CODE, largest=LARGEST)
    try:
        match path.suffix.lower():
            case ".pcd":
                points = _pcd(content)
            case ".ply":
                points = _ply(content)
            case _:
                points = _lines(content)
    except ValueError as problem:
        raise BadInput([error(CODE, str(problem), Span(str(path), 1))]) from None
    return points.astype(np.float64)


def _pcd(content: bytes) -> Array:
    """Return the points of a PCD file. Raises ValueError."""
    found = re.match(rb"(.*?(?:^|\n)DATA[ \t]+(\w+)[ \t\r]*)\n", content[:LONGEST_HEADER], re.DOTALL)
    if found is None:
        raise ValueError("this is no PCD file: no line of its beginning is DATA ascii or DATA binary")
    lines = [line.split() for line in found[1].decode("ascii", "replace").splitlines()]
    header = {words[0]: words[1:] for words in lines if words and not words[0].startswith("#")}
    fields, count = header.get("FIELDS", []), _count(header.get("POINTS") or header.get("WIDTH", []))
    several = [_count([one]) for one in header.get("COUNT", ["1"] * len(fields))]
    kinds = [f"{kind}{size}" for kind, size in zip(header.get("TYPE", []), header.get("SIZE", []), strict=False)]
    if not len(fields) == len(several) == len(kinds) or not all(1 <= number <= 1000 for number in several):
        raise ValueError("FIELDS, SIZE, TYPE and COUNT of a PCD file have an entry for each field")
    encoding, data = found[2].decode(), content[found.end() :]
    if encoding == "ascii":
        return _table(data, fields, several, count)
    if encoding != "binary":
        raise ValueError(f"DATA {encoding} is not read: pcl_convert_pcd_ascii_binary writes ascii or binary")
    unknown = [kind for kind in kinds if kind not in _PCD_TYPES]
    if unknown:
        raise ValueError(f"{unknown[0]} is no type and size of a PCD file's field")
    return _records(data, fields, [f"<{_PCD_TYPES[kind]}" for kind in kinds], several, count)


def _ply(content: bytes) -> Array:
    """Return the vertices of a PLY file. Raises ValueError."""
    found = re.match(rb"(ply\r?\n.*?\n)end_header[ \t\r]*\n", content[:LONGEST_HEADER], re.DOTALL)
    if found is None:
        raise ValueError("this is no PLY file: it begins with ply, and its header ends with end_header")
    lines = [line.split() for line in found[1].decode("ascii", "replace").splitlines()[1:]]
    lines = [words for words in lines if words and words[0] not in ("comment", "obj_info")]
    elements = [row for row, words in enumerate(lines) if words[0] == "element"] or [len(lines)]
    element, properties = lines[elements[0] : elements[0] + 1], lines[elements[0] + 1 : [*elements, None][1]]
    if (
        not element
        or element[0][1:2] != ["vertex"]
        or not all(len(words) == 3 and words[0] == "property" and words[1] in _PLY_TYPES for words in properties)
    ):
        raise ValueError("the first element of a PLY file is to be vertex, and its properties numbers")
    fields, count = [words[2] for words in properties], _count(element[0][2:])
    encoding = next((words[1] for words in lines if words[0] == "format" and len(words) == 3), "")
    data, ones = content[found.end() :], [1] * len(fields)
    if encoding == "ascii":
        return _table(data, fields, ones, count)
    order = {"binary_little_endian": "<", "binary_big_endian": ">"}.get(encoding)
    if order is None:
        raise ValueError(f"the format of this PLY file is {encoding[:40]!r}: ascii or binary is read")
    return _records(data, fields, [order + _PLY_TYPES[words[1]] for words in properties], ones, count)


def _lines(content: bytes) -> Array:
    """Return the points of lines that begin with x, y and z; what follows # is a comment. Raises ValueError."""
    lines = [line for line in re.sub(rb"#[^\n]*", b"", content).splitlines() if line.strip()]
    _count([str(len(lines))])
    width = len(lines[0].split()) if lines else 3
    if width < 3 or any(len(line.split()) != width for line in lines):
        raise ValueError("each line of an XYZ file has as many numbers as the first: x, y, z and others")
    return _table(b"\n".join(lines), ["x", "y", "z"], [1, 1, width - 2], len(lines))


def _count(words: Sequence[str]) -> int:
    """Return a number of points. Raises ValueError."""
    if len(words) != 1 or not re.fullmatch(r"\d{1,9}", words[0]):
        raise ValueError("the header states no number of points")
    if int(words[0]) > MOST_POINTS:
        raise ValueError(f"over {MOST_POINTS:,} points: make them fewer (pcl_voxel_grid, CloudCompare)")
    return int(words[0])


def _columns(fields: Sequence[str], several: Sequence[int]) -> list[int]:
    """Return the columns of x, y and z; each field has so many. Raises ValueError."""
    starts = np.concatenate([[0], np.cumsum(several)]).tolist()
    if any(fields.count(name) != 1 for name in "xyz"):
        raise ValueError(f"the fields of a point are to be x, y and z, not {', '.join(fields)[:80]}")
    return [starts[fields.index(name)] for name in "xyz"]


def _table(data: bytes, fields: Sequence[str], several: Sequence[int], count: int) -> Array:
    """Return points of text with so many numbers for each. Raises ValueError."""
    columns, width = _columns(fields, several), sum(several)
    words = data.split(maxsplit=count * width)[: count * width]
    if len(words) != count * width or not _NUMBERS.fullmatch(b" ".join(words)):
        raise ValueError(f"{count} points of {width} numbers are announced, and not there")
    try:
        numbers = np.array(list(map(float, words)))
    except ValueError:
        raise ValueError("something else than numbers is among the points") from None
    return numbers.reshape(count, width)[:, columns]


def _records(data: bytes, fields: Sequence[str], kinds: Sequence[str], several: Sequence[int], count: int) -> Array:
    """Return points of records. Raises ValueError."""
    _columns(fields, several)
    named = [name if name in ("x", "y", "z") else f"_{index}" for index, name in enumerate(fields)]
    kind = np.dtype([(name, one, (number,)) for name, one, number in zip(named, kinds, several, strict=True)])
    if len(data) < count * kind.itemsize:
        raise ValueError(f"{count} points of {kind.itemsize} bytes are announced, and not there")
    records = np.frombuffer(data, dtype=kind, count=count)
    return np.stack([records[name][:, 0].astype(np.float64) for name in "xyz"], axis=1)
