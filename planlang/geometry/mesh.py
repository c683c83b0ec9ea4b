"""Reader for untrusted meshes in OBJ, STL and COLLADA, with limits and checks, and a writer of plain copies.

A broken mesh crashes PyBullet (SIGSEGV at a missing vertex, at a malformed number, at an empty COLLADA document), so it
only gets copies of what :func:`mesh_of` has read. Normals, colours and textures are dropped.

Formats: Wavefront OBJ (1995 specification, ``v``, ``f``, ``g``, ``o``), STL (binary and text), COLLADA 1.4.1
(:mod:`planlang.geometry.collada`).
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from planlang.files import LFS_POINTER, NOT_FETCHED, encoding_of, open_regular, read_at_most
from planlang.geometry.collada import BadCollada, shapes_of
from planlang.geometry.matrices import Array
from planlang.geometry.polygons import Faces, fans
from planlang.geometry.xml_tree import BadXml, tree_of
from planlang.records import dataclass

SUFFIXES = (".obj", ".stl", ".dae")
LARGEST = 100_000_000
"""Limit in bytes; the largest of the 776 meshes of example-robot-data has 15 MB."""
MOST_VERTICES = 2_000_000
"""Limit for vertices and for triangles: PyBullet needs about 100 bytes for each."""
FARTHEST = 1e6
"""Largest coordinate; meshes drawn in millimetres stay well below."""

_STL = np.dtype([("normal", "<f4", 3), ("corners", "<f4", 9), ("attribute", "<u2")])
"""A triangle of a binary STL file; its normal may be zero."""
_VERTEX = re.compile(rb"(?<!\S)vertex\s+(\S+)\s+(\S+)\s+(\S+)", re.IGNORECASE)
"""A corner in an STL file of text."""


class BadMesh(Exception):
    """A mesh was refused; the message has the reason."""


@dataclass(frozen=True, slots=True, eq=False)
class Mesh:
    """A triangle mesh: ``vertices`` (n, 3), and for each part the vertex indices of its triangles (m, 3).

    Parts are the objects or groups of an OBJ file: each becomes a convex shape of its own.
    """

    vertices: Array
    parts: tuple[Faces, ...]

    def written(self) -> tuple[str, bytes]:
        """Return the suffix and content of a file with this mesh, in PyBullet's single precision.

        One part becomes an STL file, which PyBullet loads as one convex shape; several become an OBJ file, loaded as a
        compound. (A compound of one part would have bounding boxes that are 1 mm wider.)
        """
        if len(self.parts) == 1:
            rows = np.zeros(len(self.parts[0]), _STL)
            rows["corners"] = self.vertices[self.parts[0]].reshape(-1, 9)
            return ".stl", bytes(80) + len(rows).to_bytes(4, "little") + rows.tobytes()
        lines = [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in self.vertices.tolist()]
        for number, faces in enumerate(self.parts):
            lines.append(f"o part{number}")
            lines += [f"f {a} {b} {c}" for a, b, c in (faces + 1).tolist()]
        return ".obj", "\n".join([*lines, ""]).encode()


def mesh_content(path: Path) -> bytes:
    """Read a mesh file; raises OSError if that is impossible, :class:`BadMesh` if it is too large."""
    with open_regular(path) as file:
        content = read_at_most(file, LARGEST + 1)
    if len(content) > LARGEST:
        raise BadMesh(f"it is larger than {LARGEST // 1_000_000} MB")
    if content.startswith(LFS_POINTER):
        raise BadMesh(f"{NOT_FETCHED}: git lfs pull")
    return content


def mesh_of(content: bytes, suffix: str) -> Mesh:
    """Parse the content of a mesh file with this suffix; raises :class:`BadMesh`."""
    readers = {".obj": _read_obj, ".stl": _read_stl, ".dae": _read_collada}
    if suffix.lower() not in readers:
        raise BadMesh(f"its format is not one of {', '.join(SUFFIXES)}")
    try:
        mesh = readers[suffix.lower()](content)
    except (ValueError, OverflowError):
        raise BadMesh("it has a malformed number") from None
    return _checked(mesh)


def _checked(mesh: Mesh) -> Mesh:
    """Check limits and indices; raises BadMesh."""
    triangles = sum(map(len, mesh.parts))
    if max(len(mesh.vertices), triangles) > MOST_VERTICES:
        raise BadMesh(f"it has more than {MOST_VERTICES:,} vertices or triangles")
    if not triangles:
        raise BadMesh("it has no triangle")
    if not np.isfinite(mesh.vertices).all() or np.abs(mesh.vertices).max() > FARTHEST:
        raise BadMesh(f"it has a coordinate that is not finite, or beyond {FARTHEST:g}")
    for faces in mesh.parts:
        if faces.min() < 0 or faces.max() >= len(mesh.vertices):
            wrong = faces[(faces < 0) | (faces >= len(mesh.vertices))][0]
            raise BadMesh(f"a face names vertex {int(wrong) + 1}, there are {len(mesh.vertices)}")
    return mesh


def _read_obj(content: bytes) -> Mesh:
    vertices: list[list[float]] = []
    parts: list[tuple[list[int], list[int]]] = [([], [])]
    for line in content.decode(encoding_of(content), "replace").replace("\\\n", " ").splitlines():
        words = line.partition("#")[0].split()
        match words[:1]:
            case ["v"]:
                if len(words) < 4:
                    raise BadMesh("a vertex has fewer than three numbers")
                vertices.append([float(word) for word in words[1:4]])
            case ["f" | "fo"]:  # "fo" is what it was called before version 3
                numbers = [int(word.split("/")[0]) for word in words[1:]]
                if 0 in numbers:
                    raise BadMesh("a face names vertex 0, the first one is 1")
                parts[-1][0].append(len(numbers))
                parts[-1][1].extend(number - 1 if number > 0 else len(vertices) + number for number in numbers)
            case ["o" | "g"] if parts[-1][0]:
                parts.append(([], []))
        if len(vertices) > MOST_VERTICES:
            break
    faces = [fans(counts, np.array(corners, np.int64)) for counts, corners in parts if counts]
    return Mesh(np.array(vertices, float).reshape(-1, 3), tuple(part for part in faces if len(part)))


def _read_stl(content: bytes) -> Mesh:
    """Read binary STL, whatever its header says, or else text with vertices, whatever it begins with."""
    room = (len(content) - 84) // 50
    count = int.from_bytes(content[80:84], "little")
    if count == 0 and room > 0 and len(content) == 84 + 50 * room and b"\0" in content:
        count = room  # written before the number of triangles was known
    if 0 < count <= room:
        rows = np.frombuffer(content, _STL, count, 84)
        corners = rows["corners"].astype(float)
    else:
        found = [] if b"\0" in content else _VERTEX.findall(content)
        if len(found) % 3 or not (found or content.lstrip().startswith(b"solid")):
            raise BadMesh("it is not STL, or truncated")
        corners = np.array(found).astype(float)
    vertices = corners.reshape(-1, 3)
    return Mesh(vertices, (np.arange(len(vertices)).reshape(-1, 3),) if len(vertices) else ())


def _read_collada(content: bytes) -> Mesh:
    try:
        placed = list(shapes_of(tree_of(content), MOST_VERTICES))
    except (BadXml, BadCollada) as problem:
        raise BadMesh(str(problem)) from None
    first = np.cumsum([0, *(len(vertices) for vertices, _ in placed)]).tolist()
    faces = [part + start for (_, part), start in zip(placed, first, strict=False) if len(part)]
    vertices = np.concatenate([np.zeros((0, 3)), *(vertices for vertices, _ in placed)])
    return Mesh(vertices, (np.concatenate(faces),) if faces else ())
