"""The meshes of a URDF: read, checked, and written plainly, as PyBullet dies of broken ones."""

from __future__ import annotations

import hashlib
from functools import lru_cache
from pathlib import Path

from planlang.geometry.mesh import BadMesh, mesh_content, mesh_of, mesh_places
from planlang.geometry.urdf import Element


class Meshes:
    """The meshes that a URDF names: read, checked, and written plainly under names of their own."""

    def __init__(self, urdf: Path) -> None:
        self.urdf = urdf
        self.files: dict[str, bytes] = {}
        self.absent: dict[str, tuple[int, str]] = {}
        """Name of one that is not there or cannot be read -> the line that names it, and the reason if it is there."""
        self._names: dict[str, str | None] = {}

    def replace(self, mesh: Element) -> bool:
        """Let an element name the checked mesh; False if there is none, or the element is another kind of geometry."""
        if mesh.tag != "mesh":
            self.absent[f"<{mesh.tag}>"] = mesh.line, "no geometry of URDF"
            return False
        name = mesh.get("filename", "")
        if name not in self._names:
            self._names[name] = self._read(name, mesh.line)
        found = self._names[name]
        if found is not None:
            mesh.set("filename", found)
        return found is not None

    def _read(self, name: str, line: int) -> str | None:
        reason = ""
        for place in mesh_places(self.urdf, name):
            try:
                suffix, content = checked_mesh(place)
            except BadMesh as problem:
                reason = reason or str(problem)
                continue
            except OSError:
                continue
            own = hashlib.sha256(content).hexdigest()[:32] + suffix
            self.files[own] = content
            return own
        self.absent[name] = line, reason
        return None


@lru_cache(maxsize=256)
def _checked(content: bytes, suffix: str) -> tuple[str, bytes]:
    return mesh_of(content, suffix).written()


def checked_mesh(path: Path) -> tuple[str, bytes]:
    """Return a suffix and the content of a file that holds a mesh as PyBullet reads it without harm.

    Raises OSError for one that is not there, :class:`BadMesh` for one that cannot be used. A mesh is worked out once in
    a process, however many worlds load it.
    """
    return _checked(mesh_content(path), path.suffix.lower())
