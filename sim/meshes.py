"""Meshes of a URDF: read, checked, and rewritten in a plain form, since broken ones crash PyBullet."""

from __future__ import annotations

import hashlib
from functools import lru_cache
from pathlib import Path

from planlang.geometry.mesh import BadMesh, mesh_content, mesh_of
from planlang.geometry.urdf import Element
from planlang.package_paths import case_differs, file_places


class Meshes:
    """Meshes named by a URDF; valid ones are rewritten as files named by their content."""

    def __init__(self, urdf: Path) -> None:
        self.urdf = urdf
        self.files: dict[str, bytes] = {}
        self.absent: dict[str, tuple[int, str]] = {}
        """Name of a missing or unreadable mesh -> line that names it, and the reason if the file exists."""
        self.other_cases: dict[str, tuple[int, str]] = {}
        """Name of a mesh whose file has another case -> line that names it, and the name of the file."""
        self._names: dict[str, str | None] = {}

    def replace(self, mesh: Element) -> bool:
        """Point an element to the rewritten mesh; return False if the mesh is unusable or the geometry is unknown."""
        if mesh.tag != "mesh":
            self.absent[f"<{mesh.tag}>"] = mesh.line, "not a URDF geometry"
            return False
        name = mesh.get("filename", "")
        if name not in self._names:
            self._names[name] = self._read(name, mesh.line)
        file_name = self._names[name]
        if file_name is not None:
            mesh.set("filename", file_name)
        return file_name is not None

    def _read(self, name: str, line: int) -> str | None:
        reason = ""
        for place in file_places(self.urdf, name):
            try:
                suffix, content = checked_mesh(place)
            except BadMesh as problem:
                reason = reason or str(problem)
                continue
            except OSError:
                continue
            if case_differs(name, place):
                self.other_cases[name] = line, place.name
            own = hashlib.sha256(content).hexdigest()[:32] + suffix
            self.files[own] = content
            return own
        self.absent[name] = line, reason
        return None


@lru_cache(maxsize=256)
def _checked(content: bytes, suffix: str) -> tuple[str, bytes]:
    return mesh_of(content, suffix).written()


def checked_mesh(path: Path) -> tuple[str, bytes]:
    """Read a mesh file and return the suffix and content of a file that PyBullet reads safely.

    Raises OSError if the file is missing, :class:`BadMesh` if it is unusable. Results are cached for the process, since
    many worlds load the same mesh.
    """
    return _checked(mesh_content(path), path.suffix.lower())
