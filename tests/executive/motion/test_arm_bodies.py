"""Facts about the spheres by which arms find their way: what they say for sure, PyBullet says too."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from executive.motion import Chain
from executive.motion.arm_bodies import ArmShapes, Room, links_of
from executive.motion.bodies import MOST, Solids, Spheres, faces_of, kept_spheres, spheres_in
from executive.motion.collision import TOUCHING, QuickCheck
from executive.motion.separation import are_apart
from executive.robots import bind_robot
from planlang.geometry import Array, Pose
from planlang.geometry.shapes import ConvexSolid, SolidKind, convex_solid
from planlang.protocols import Configuration
from sim import Body, PlanningWorld, Scene
from tests.support.examples import some

ROOM = (
    Body("room", Pose((0.0, 0.0, 1.3)), (5.0, 5.0, 2.6), "room"),
    Body("table", Pose((0.8, 0.0, 0.72)), (0.6, 1.2, 0.04)),
    Body("shelf", Pose.planar(0.7, 0.8, 0.4, 1.2), (0.5, 0.3, 0.6)),
    Body("bottle", Pose((0.65, -0.1, 0.84)), (0.065, 0.065, 0.2), "cylinder", movable=True),
    Body("post", Pose((0.4, -0.6, 0.8)), (0.1, 0.1, 1.6), "cylinder"),
    Body("somebody", Pose.planar(0.9, 1.4, -2.0, 0.65), (0.75, 0.5, 1.3), "person"),
)


@dataclass(slots=True)
class Reacher:
    """A robot in a room, and the chain of its first arm."""

    world: PlanningWorld
    chain: Chain
    base_link: str
    tip: str
    joints: tuple[str, ...]

    def quick(self) -> QuickCheck:
        """The check by spheres, as things are now."""
        shapes = ArmShapes(self.world, links_of(self.world), self.chain, self.base_link, self.tip)
        base, room = self.world.link_pose(self.base_link).matrix(), Room.of(Solids.of(self.world.solids()), "room")
        return shapes.now(self.world).against(base, room, (frozenset(), frozenset()))

    def touched(self, q: Array, among: list[tuple[str, str]] | None = None) -> set[frozenset[str]]:
        """Pairs that PyBullet finds in each other."""
        joints = {**self.world.configuration().joints, **dict(zip(self.chain.names, q.tolist(), strict=True))}
        there = Configuration(self.world.configuration().base, joints)
        return {frozenset((contact.part, contact.body)) for contact in self.world.contacts(there, among=among)}


@pytest.fixture(scope="module", params=["amigo", "panda"])
def reacher(request: pytest.FixtureRequest) -> Iterator[Reacher]:
    """A robot of primitives and one of meshes before the same table."""
    robot = bind_robot(request.param)
    world = PlanningWorld(Scene(ROOM, (-2.5, -2.5, 2.5, 2.5), (-0.15, 0.1, 0.2)), robot.body())
    chain = Chain.from_urdf(robot.urdf, robot.base_link, robot.arms[0].tip)
    yield Reacher(world, chain, robot.base_link, robot.arms[0].tip, robot.arms[0].joints)
    world.close()


def _checked(reacher: Reacher, count: int) -> Iterator[tuple[Array, str, set[frozenset[str]], QuickCheck]]:
    quick = reacher.quick()
    rows = reacher.chain.sample(np.random.default_rng(0), count)
    still = reacher.touched(rows[0]) - {
        pair for pair in reacher.touched(rows[0]) if pair in {frozenset(names) for names in quick.names}
    }
    for q, sure, free in zip(rows, quick.sure(rows), quick.free(rows), strict=True):
        yield q, "sure" if sure else "unsure" if free else "hit", reacher.touched(q) - still, quick


def test_what_is_free_for_sure_touches_nothing_and_what_is_hit_does(reacher: Reacher) -> None:
    seen = Counter[str]()
    for q, answer, touched, _ in _checked(reacher, 150):
        seen[answer] += 1
        assert answer != "sure" or not touched
        assert answer != "hit" or touched, q.tolist()
    assert seen["hit"] > 5


def test_what_touches_is_among_the_doubtful_pairs(reacher: Reacher) -> None:
    for q, _, touched, quick in _checked(reacher, 80):
        (doubtful,) = quick.doubtful(q[None])
        assert doubtful is not None
        assert touched <= {frozenset(pair) for pair in doubtful}
        assert reacher.touched(q, doubtful) == touched


def test_an_answer_does_not_depend_on_the_other_rows_of_a_call(reacher: Reacher) -> None:
    quick = reacher.quick()
    rows = reacher.chain.sample(np.random.default_rng(1), 40)
    for several in (quick.free, quick.sure, quick.doubtful):
        assert list(several(rows)) == [several(q[None])[0] for q in rows]


def test_what_is_hit_from_any_base_touches_and_what_is_clear_does_not(reacher: Reacher) -> None:
    before, rng = reacher.world.configuration(), np.random.default_rng(3)
    quick = reacher.quick()
    rows, turns = reacher.chain.sample(rng, 60), rng.uniform(-3.0, 3.0, 60)
    places = [(x, y, yaw) for (x, y), yaw in zip(rng.uniform(-0.4, 0.4, (60, 2)).tolist(), turns, strict=True)]
    bases = np.array([Pose.planar(*place).matrix() for place in places])
    found = quick.hit(bases, rows)
    assert 5 < sum(body is not None for body in found) < 60
    for place, q, body in zip(places, rows, found, strict=True):
        joints = {**before.joints, **dict(zip(reacher.chain.names, q.tolist(), strict=True))}
        touched = reacher.world.contacts(Configuration(place, joints)) if body is not None else ()
        assert body is None or any(body in (contact.part, contact.body) for contact in touched)
    clear = quick.clear(bases, rows)
    assert clear.any() or not quick.sure(rows).any()
    for place, q in ((places[k], rows[k]) for k in np.flatnonzero(clear)):
        joints = {**before.joints, **dict(zip(reacher.chain.names, q.tolist(), strict=True))}
        assert not reacher.world.contacts(Configuration(place, joints), reacher.chain.names)
    for deeper in (0.004, 0.04):
        fewer = quick.hit(bases, rows, deeper=deeper)
        assert all(before is not None for before, now in zip(found, fewer, strict=True) if now is not None)


def test_an_arm_held_still_and_a_hand_alone_hit_what_the_whole_arm_hits(reacher: Reacher) -> None:
    shapes = ArmShapes(reacher.world, links_of(reacher.world), reacher.chain, reacher.base_link, reacher.tip)
    room, bodies = Room.of(Solids.of(reacher.world.solids()), "room"), shapes.now(reacher.world)
    base = reacher.world.link_pose(reacher.base_link).matrix()
    whole = bodies.against(base, room, (frozenset(), frozenset()))
    seen = 0
    for q in reacher.chain.sample(np.random.default_rng(7), 40):
        joints = dict(zip(reacher.chain.names, q.tolist(), strict=True))
        still = ArmShapes.still(reacher.world, [shapes], joints).against(base, room, (frozenset(), frozenset()))
        in_room = [body if body in room.bodies.names else None for body in whole.hit(base[None], q[None])]
        assert still.hit(base[None]) == in_room
        assert not still.clear(base[None], q[None]).any(), "more is there than the arm"
        met = whole.hand_hit(base[None] @ reacher.chain.fk(q[None]))[0]
        seen += met is not None
        assert met is None or in_room[0] is not None
    assert seen


def _chosen(reacher: Reacher, wanted: Callable[[str, set[frozenset[str]]], bool]) -> Array:
    return next(q for q, answer, touched, _ in _checked(reacher, 4000) if wanted(answer, touched))


@pytest.mark.long
def test_held_things_move_along_with_the_hand(reacher: Reacher) -> None:
    before, place = reacher.world.configuration(), reacher.world.pose("bottle")
    free = _chosen(reacher, lambda answer, touched: answer != "hit" and not touched)
    joints = dict(zip(reacher.chain.names, free.tolist(), strict=True))
    reacher.world.set_configuration(Configuration(before.base, joints))
    reacher.world.set_pose("bottle", reacher.world.link_pose(reacher.tip))
    reacher.world.attach(reacher.tip, "bottle")
    quick, hits = reacher.quick(), 0
    rows = reacher.chain.sample(np.random.default_rng(5), 300)
    for q, pairs in zip(rows, quick.doubtful(rows), strict=True):
        touched = reacher.touched(q)
        assert {pair for pair in touched if "bottle" in pair} <= {frozenset(pair) for pair in pairs or ()}
        for number in np.flatnonzero(quick.gaps(q) < -TOUCHING).tolist():
            if "bottle" in quick.names[number]:
                hits += 1
                assert frozenset(quick.names[number]) in touched
    reacher.world.release("bottle")
    reacher.world.set_pose("bottle", place)
    reacher.world.set_configuration(before)
    assert hits


@pytest.mark.long
def test_what_was_learnt_keeps_the_two_apart_and_the_ends_stay_free(reacher: Reacher) -> None:
    ends = [q for q, _, touched, _ in _checked(reacher, 400) if not touched][:2]
    quick = reacher.quick()
    quick.keep(0.0, ends)
    answers = _checked(reacher, 4000)
    q, touched = next((q, touched) for q, _, touched, _ in answers if touched and quick.free(q[None])[0])
    before = quick._limit.copy()
    quick.learn(q, [tuple(pair) for pair in touched])  # type: ignore[misc]
    assert (quick._limit >= before).all()
    assert (quick._limit > before).any()
    assert quick.free(np.array(ends)).all()
    quick.keep(0.0, ends)
    np.testing.assert_array_equal(quick._limit, before)


def test_keeping_apart_never_closes_the_ends(reacher: Reacher) -> None:
    ends = [q for q, _, touched, _ in _checked(reacher, 400) if not touched][:4]
    quick = reacher.quick()
    quick.keep(0.2, ends)
    assert quick.free(np.array(ends)).all()


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


@pytest.mark.parametrize("name", some(SHAPES, every=3))
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


def test_a_scan_of_many_points_is_filled_in_bounded_memory_and_within_the_slack() -> None:
    rng = np.random.default_rng(0)
    points = rng.normal(size=(8_000, 3))
    points *= 0.08 / np.linalg.norm(points, axis=1, keepdims=True)
    spheres = spheres_in(points + rng.uniform(-1e-5, 1e-5, points.shape))
    away = np.linalg.norm(points[:, None] - spheres.balls[:, :3], axis=2) - spheres.balls[:, 3]
    assert 0 < away.min(axis=1).max() <= spheres.slack < 0.03


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


@pytest.mark.parametrize("gap", [0.01, 0.003, -0.003])
def test_hulls_are_apart_as_far_as_they_are(gap: float) -> None:
    rng = np.random.default_rng(0)
    box = np.array([[x, y, z] for x in (-0.1, 0.1) for y in (-0.2, 0.2) for z in (-0.3, 0.3)])
    turns = np.array([Pose.planar(0.0, 0.0, yaw).rotation for yaw in rng.uniform(-3.0, 3.0, 50)])
    corners = np.einsum("nij,kj->nki", turns, box)
    shifts = np.column_stack([0.1 + gap - corners[..., 0].min(axis=1), np.zeros(50), rng.uniform(-0.3, 0.3, 50)])
    assert are_apart(box, box, turns, shifts, 0.002).all() == (gap > 0.002)
    assert not are_apart(box, box, turns, shifts, max(gap, 0.0) + 1e-9).any()
