"""Where the meshes of a URDF are, and what stands in for those that are absent."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from planlang.geometry import Array

SUFFIXES = (".obj", ".stl", ".dae")
"""Formats that PyBullet reads."""
LARGEST = 200_000_000
"""Bytes of a mesh that is read."""
LONGEST = 900
"""Characters of a file's name: PyBullet reads a URDF in pieces of 1024."""
THINNEST = 0.002
"""Least extent of a box made from an inertia [m]."""
LIGHTEST = 30.0
"""Density of foam [kg/m3]. Inertias of lighter boxes were filled in, not measured: in real URDFs measured ones come to
300 and more, the frequent 0.1 kg with 0.01 kg m2 comes to 0.2."""


def find_mesh(urdf: Path, name: str) -> Path | None:
    """The file that a URDF means by ``filename``, if it is there and is a mesh that PyBullet can read.

    Files are looked at, never written.
    """
    return next((place.resolve() for place in places_of(urdf, name) if _is_mesh(place)), None)


def places_of(urdf: Path, name: str) -> list[Path]:
    """Where a URDF's ``filename`` may be, whether something is there or not.

    ``package://p/rest`` is looked for as p/rest in the URDF's folder and those above it, and as rest in one of these
    that is called p; any other name is relative to the URDF.
    """
    scheme = re.match(r"(package|model|file)://", name)
    rest = name[scheme.end() :] if scheme else name
    folder = urdf.resolve().parent
    if scheme and scheme[1] != "file":
        package, _, inner = rest.partition("/")
        return [
            place
            for above in (folder, *folder.parents)
            for place in (above / rest, *([above / inner] if above.name == package else []))
        ]
    return [folder / rest]


def _is_mesh(path: Path) -> bool:
    try:
        if path.suffix.lower() not in SUFFIXES or not path.is_file() or not 0 < path.stat().st_size <= LARGEST:
            return False
        if len(str(path.resolve())) > LONGEST or not str(path.resolve()).isprintable():
            return False
        content = path.read_bytes()
    except (OSError, ValueError):
        return False
    match path.suffix.lower():
        case ".obj":
            return bool(re.search(rb"^\s*v\s", content, re.MULTILINE) and re.search(rb"^\s*f\s", content, re.MULTILINE))
        case ".stl":  # the binary kind: a header of 80 bytes, the number of triangles, 50 bytes each
            triangles = int.from_bytes(content[80:84], "little")
            return triangles > 0 and len(content) >= 84 + 50 * triangles
    return b"<COLLADA" in content


def inertia_box(mass: float, inertia: Array) -> tuple[Array, Array] | None:
    """Extents (3,) [m] and axes (3, 3), one per column, of the box of even density with this mass and inertia (3, 3).

    From m / 12 (b^2 + c^2) and so on for the principal moments. None without mass or moments, and for a box lighter
    than foam (:data:`LIGHTEST`). What no body can have (a moment larger than the others' sum) gives the thinnest box.
    """
    if not np.allclose(inertia, np.diag(np.diag(inertia)), rtol=0.0, atol=1e-12):
        moments, axes = np.linalg.eigh(inertia)
        if np.linalg.det(axes) < 0:
            axes[:, 2] *= -1
    else:
        moments, axes = np.diag(inertia), np.eye(3)
    if mass <= 0 or moments.max() <= 0:
        return None
    squares = 6.0 / mass * (moments.sum() - 2.0 * moments)
    extents = np.maximum(np.sqrt(np.maximum(squares, 0.0)), THINNEST)
    return (extents, axes) if mass >= LIGHTEST * float(np.prod(extents)) else None
