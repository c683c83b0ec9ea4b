"""Facts about convex shapes and the spheres in them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from executive.motion.spheres import MOST, Spheres, faces_of, kept_spheres, spheres_in
from planlang.geometry import Array, Pose
from planlang.geometry.solid import ConvexSolid, SolidKind, convex_solid

HERE = Pose((0.0, 0.0, 0.0))


def hull(kind: str, size: tuple[float, float, float]) -> ConvexSolid:
    """A primitive."""
    return convex_solid(SolidKind(kind), size, HERE)


def scattered(count: int, seed: int) -> ConvexSolid:
    """The hull of random points within about 10 cm."""
    points = 0.05 * np.random.default_rng(seed).normal(size=(count, 3))
    return ConvexSolid(SolidKind.MESH, (0.0, 0.0, 0.0), HERE, points)


def filled(shape: ConvexSolid) -> Spheres:
    """The spheres in a shape."""
    return spheres_in(shape.points, shape.radius, shape.beyond)


def on_the_surface(shape: ConvexSolid, count: int) -> Array:
    """Random points (count, 3) on the surface."""
    faces = faces_of(shape.points)
    rng = np.random.default_rng(0)
    chosen = rng.integers(len(faces.triangles), size=count)
    shares = rng.dirichlet([1.0, 1.0, 1.0], count)
    return np.einsum("nk,nkx->nx", shares, faces.triangles[chosen])


SHAPES = {
    "finger": hull("box", (0.02, 0.016, 0.11)),
    "trunk": hull("box", (0.16, 0.24, 0.5)),
    "plate": hull("box", (0.3, 0.2, 0.0)),
    "arm": hull("cylinder", (0.09, 0.09, 0.22)),
    "disc": hull("cylinder", (0.2, 0.2, 0.01)),
    "capsule": hull("capsule", (0.08, 0.08, 0.2)),
    "stone": scattered(60, 0),
    "pin": hull("box", (0.004, 0.004, 0.006)),
}


@pytest.mark.parametrize("name", SHAPES)
def test_spheres_are_inside_of_the_shape_and_the_shape_within_their_slack(name: str) -> None:
    shape = SHAPES[name]
    spheres, faces = filled(shape), faces_of(shape.points)
    centres, radii = spheres.balls[:, :3], spheres.balls[:, 3]
    assert 0 < len(radii) <= MOST
    assert (faces.depths(centres) >= radii - 1e-9).all()
    points = np.concatenate([on_the_surface(shape, 3000), shape.points])
    away = np.linalg.norm(points[:, None] - centres, axis=2) - radii
    assert away.min(axis=1).max() <= spheres.slack
    inside = np.random.default_rng(1).uniform(shape.points.min(axis=0), shape.points.max(axis=0), (3000, 3))
    inside = inside[faces.depths(inside) > 0]
    if len(inside):
        away = np.linalg.norm(inside[:, None] - centres, axis=2) - radii
        assert away.min(axis=1).max() <= spheres.slack


def test_slack_of_a_hand_is_small() -> None:
    assert filled(hull("box", (0.07, 0.085, 0.038))).slack < 0.015


def test_a_ball_is_its_own_sphere() -> None:
    spheres = filled(hull("sphere", (0.1, 0.1, 0.1)))
    assert (spheres.balls.tolist(), spheres.slack) == ([[0.0, 0.0, 0.0, 0.05]], 0.0)


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10_000), st.integers(4, 60))
def test_faces_have_all_points_on_their_inner_side_and_form_a_closed_surface(seed: int, count: int) -> None:
    shape = scattered(count, seed)
    faces = faces_of(shape.points)
    assert (shape.points @ faces.normals.T <= faces.offsets + 1e-6).all()
    edges = [frozenset((tuple(t[k]), tuple(t[(k + 1) % 3]))) for t in faces.triangles.tolist() for k in range(3)]
    assert all(edges.count(edge) == 2 for edge in set(edges))


def test_depth_in_a_box_is_the_distance_from_its_nearest_side() -> None:
    box = faces_of(hull("box", (2.0, 4.0, 6.0)).points)
    places = np.array([[0.0, 0.0, 0.0], [0.5, 1.9, 0.0], [0.0, 0.0, 3.5]])
    np.testing.assert_allclose(box.depths(places), [1, 0.1, -0.5])


def test_capsule_reaches_half_a_ball_beyond_its_height() -> None:
    points = hull("capsule", (0.08, 0.08, 0.2)).points
    assert points[:, 2].max() == pytest.approx(0.1 + 0.04)
    assert np.hypot(points[:, 0], points[:, 1]).max() == pytest.approx(0.04)


def test_kept_spheres_are_the_same_and_a_damaged_entry_is_made_anew(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    points = scattered(20, 42).points.tobytes()
    made = kept_spheres(points, 0.0, 0.0)
    (entry,) = (tmp_path / "planlang" / "spheres").iterdir()
    for content in (entry.read_bytes(), b"", b"torn", entry.read_bytes()[:-9]):
        entry.write_bytes(content)
        kept_spheres.cache_clear()
        again = kept_spheres(points, 0.0, 0.0)
        np.testing.assert_array_equal(again.balls, made.balls)
        assert again.slack == made.slack
