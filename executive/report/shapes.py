"""Shapes of a world on the page of a run, the same as in pictures and recordings; equal meshes are stored once."""

from __future__ import annotations

import hashlib
import zlib
from collections.abc import Sequence
from typing import Any

import numpy as np

from executive.pictures.drawn import HERE, Drawn, Mesh, Shape

_KINDS = {"bodies": "body", "robot": "link"}


class Shapes:
    """Shapes of entities, by kind and name as in tracks, and their meshes."""

    def __init__(self) -> None:
        self.of: dict[tuple[str, str], list[dict[str, Any]]] = {}
        self.meshes: list[dict[str, Any]] = []
        """Numbers of vertices and triangles, lower corner and size of the bounding box [m]."""
        self._numbers: dict[bytes, int] = {}
        self._data: list[bytes] = []

    def add(self, drawn: Sequence[Drawn]) -> None:
        """Add the entities that are new."""
        for one in drawn:
            kind, name = _KINDS[one.path[0]], "/".join(one.path[1:])
            kind = "limb" if kind == "body" and len(one.path) > 2 else kind
            if (kind, name) not in self.of:
                self.of[kind, name] = [self._shape(shape) for shape in one.shapes]

    def data(self) -> bytes:
        """All meshes, compressed: vertices as 16-bit fractions of the bounding box by columns, then vertex indices."""
        return zlib.compress(b"".join(self._data), 9)

    def _shape(self, shape: Shape) -> dict[str, Any]:
        data: dict[str, Any] = {"kind": shape.kind, "colour": list(shape.colour)}
        if shape.pose != HERE:
            data["at"] = [round(float(one), 5) for one in (*shape.pose.position, *shape.pose.orientation)]
        if shape.mesh is not None:
            return data | {"mesh": self._mesh(shape.mesh)}
        return data | {"size": [round(float(one), 5) for one in shape.size]}

    def _mesh(self, mesh: Mesh) -> int:
        points, corners = np.asarray(mesh.vertices, np.float32), np.asarray(mesh.triangles, np.int64)
        key = hashlib.sha256(points.tobytes() + corners.tobytes()).digest()
        if key not in self._numbers:
            self._numbers[key] = len(self.meshes)
            low, high = points.min(axis=0), points.max(axis=0)
            size = np.maximum(high - low, 1e-6)
            fractions = np.rint((points - low) / size * 65535).astype("<u2")
            self._data += [
                np.ascontiguousarray(fractions.T).tobytes(),
                corners.astype("<u4" if len(points) > 65535 else "<u2").tobytes(),
            ]
            self.meshes.append(
                {
                    "vertices": len(points),
                    "triangles": len(corners),
                    "low": [round(float(one), 5) for one in low],
                    "size": [round(float(one), 5) for one in size],
                }
            )
        return self._numbers[key]
