"""Pose individuals of a map: rotation matrices (m00..m33, row major) or translation and quaternion, made rigid."""

from __future__ import annotations

import numpy as np

from executive.belief.numbers import length, lengths, stated
from planlang.designators import local_name
from planlang.diagnostics import Diagnostic, Span, error, note, warning
from planlang.geometry import Array, Pose
from planlang.geometry.matrices import product
from planlang.ontology import Ontology

TOLERANCE = 1e-3
"""Entries of a rotation may differ by this from an orthonormal matrix before that is worth a note."""

_ROTATION = tuple(f"m{i}{j}" for i in range(3) for j in range(3))
_TRANSLATION = ("m03", "m13", "m23")


def read_transform(ontology: Ontology, iri: str, found: list[Diagnostic]) -> Array | None:
    """The homogeneous (4, 4) matrix that an individual states, repaired to a rigid one; lengths in metres.

    Understands RotationMatrix3D with m00..m23 (the last row is not needed), and ``translation "x y z"`` with
    ``quaternion "x y z w"``. None, with an error in ``found``, if numbers are missing or not finite.
    """
    if stated(ontology, iri, "m00") or stated(ontology, iri, "m03"):
        return _from_entries(ontology, iri, found)
    return _from_quaternion(ontology, iri, found)


def _from_entries(ontology: Ontology, iri: str, found: list[Diagnostic]) -> Array | None:
    matrix = np.eye(4)
    missing = []
    complete = True
    for name in (*_ROTATION, *_TRANSLATION):
        triple = stated(ontology, iri, name)
        if triple is None:
            missing.append(name)
            continue
        value = length(triple, found)
        if value is None:
            complete = False
        else:
            matrix[int(name[1]), int(name[2])] = value
    if missing:
        message = f"the matrix {local_name(iri)} has no {', '.join(missing)}"
        found.append(error("M003", message, ontology.span(iri), "a pose needs m00..m22 and m03, m13, m23"))
    if missing or not complete:
        return None
    matrix[:3, :3] = rigid(matrix[:3, :3], local_name(iri), ontology.span(iri), found)
    return matrix


def _from_quaternion(ontology: Ontology, iri: str, found: list[Diagnostic]) -> Array | None:
    values = {}
    for name, count in (("translation", 3), ("quaternion", 4)):
        triple = stated(ontology, iri, name)
        numbers = lengths(triple, found) if triple else None
        if triple and numbers is None:
            return None
        if triple is None or numbers is None or len(numbers) != count:
            message = f"the pose {local_name(iri)} states neither a matrix nor a {name} of {count} numbers"
            span = triple.span if triple else ontology.span(iri)
            found.append(error("M003", message, span, "a pose needs m00..m22 and m03, m13, m23"))
            return None
        values[name] = numbers
    norm = float(np.linalg.norm(values["quaternion"]))
    if norm < 1e-6:
        found.append(warning("M004", f"the quaternion of {local_name(iri)} is zero; not turned", ontology.span(iri)))
        quaternion = (0.0, 0.0, 0.0, 1.0)
    else:
        x, y, z, w = (value / norm for value in values["quaternion"])
        quaternion = (x, y, z, w)
    px, py, pz = values["translation"]
    return Pose((px, py, pz), quaternion).matrix()


def rigid(rotation: Array, name: str, span: Span | None, found: list[Diagnostic]) -> Array:
    """The rotation (3, 3) that is meant by a matrix which may be a reflection or not orthonormal; repairs are noted.

    A reflection keeps its x axis (the front of a thing) and its z axis, y is turned around: a box looks the same.
    Others become the nearest rotation (polar decomposition). One without three directions is replaced by no rotation.
    """
    left, scale, right = np.linalg.svd(rotation)
    if scale[2] < 0.05 * max(float(scale[0]), 1e-9):
        found.append(warning("M004", f"the matrix {name} has no three directions; taken as not turned", span))
        return np.eye(3)
    if np.abs(product(rotation.T, rotation) - np.eye(3)).max() > TOLERANCE:
        found.append(note("M001", f"the matrix {name} is not orthonormal; the nearest rotation is used", span))
    orthonormal = product(left, right)
    if np.linalg.det(orthonormal) < 0:
        found.append(note("M001", f"the matrix {name} is a reflection; its y axis is turned around", span))
        orthonormal[:, 1] *= -1.0
    return orthonormal
