"""Facts about perturbed scenes: different, but possible."""

import math
from dataclasses import replace

import pytest

from planlang.geometry import Pose
from sim import Body, Scene, perturb
from sim.world import at_rest_on
from tests.sim.conftest import AMIGO, ROOM, AskableWorld

SEEDS = range(1, 26)


def test_seed_zero_changes_nothing() -> None:
    assert perturb(ROOM, 0) is ROOM


def test_equal_seeds_give_equal_scenes_and_different_ones_differ() -> None:
    assert perturb(ROOM, 7) == perturb(ROOM, 7)
    assert perturb(ROOM, 7) != perturb(ROOM, 8)


@pytest.mark.parametrize("seed", SEEDS)
def test_perturbed_scene_is_possible(seed: int) -> None:
    scene = perturb(ROOM, seed)
    world = AskableWorld(scene, AMIGO)
    try:
        assert world.contacts() == ()
        assert at_rest_on(world, "bottle") == "cabinet"
        assert at_rest_on(world, "cup") == "bedside"
        bodies = world._bodies
        pairs = ("bottle", "cup"), ("bedside", "bed"), ("bedside", "room")
        gaps = [bodies.gap(bodies.of[one], bodies.of[other], 1.0) for one, other in pairs]
        assert gaps[0] > 0.5
        assert gaps[1] > 0.0
        assert gaps[2] > -0.005
    finally:
        world.close()


@pytest.mark.parametrize("seed", SEEDS)
def test_only_movable_things_move_and_not_too_far(seed: int) -> None:
    scene = perturb(ROOM, seed)
    for before, after in zip(ROOM.bodies, scene.bodies, strict=True):
        distance = before.pose.distance(after.pose)
        if not before.movable:
            assert after == before
        elif before.name == "bedside":
            assert distance <= 0.2 + 1e-9
        elif before.name == "bottle":
            assert distance <= 0.3 + 1e-9
        assert after.pose.position[2] == pytest.approx(before.pose.position[2], abs=1e-9)
    assert math.dist(scene.start[:2], ROOM.start[:2]) <= 0.3 + 1e-9


def test_most_seeds_move_bottle_table_and_start() -> None:
    for name in ("bottle", "bedside"):
        moved = [perturb(ROOM, seed).body(name).pose != ROOM.body(name).pose for seed in SEEDS]
        assert sum(moved) >= 20, name
    assert sum(perturb(ROOM, seed).start != ROOM.start for seed in SEEDS) >= 20


def test_bottle_reaches_far_corners_of_its_range() -> None:
    distances = [perturb(ROOM, seed).body("bottle").pose.distance(ROOM.body("bottle").pose) for seed in SEEDS]
    assert max(distances) > 0.2


def test_what_stands_on_moved_furniture_goes_with_it() -> None:
    heavy = tuple(replace(body, movable=body.name == "bedside") for body in ROOM.bodies)
    scene = replace(ROOM, bodies=heavy)
    moved = perturb(scene, 3)
    assert moved.body("bedside").pose != scene.body("bedside").pose
    before = scene.body("bedside").pose.inverse() @ scene.body("cup").pose
    after = moved.body("bedside").pose.inverse() @ moved.body("cup").pose
    assert after.position == pytest.approx(before.position, abs=1e-9)


def test_object_with_no_room_to_move_stays() -> None:
    post = Body("post", Pose((0.0, 0.0, 0.5)), (0.07, 0.07, 1.0))
    cup = Body("cup", Pose((0.0, 0.0, 1.05)), (0.065, 0.065, 0.1), "box", movable=True)
    scene = Scene((post, cup), start=(3.0, 3.0, 0.0))
    for seed in SEEDS:
        assert perturb(scene, seed).body("cup").pose.distance(cup.pose) < 0.01


def test_scene_refuses_unknown_shapes_empty_sizes_and_names_that_occur_twice() -> None:
    with pytest.raises(ValueError, match="shapes are box, cylinder"):
        Body("ball", Pose((0, 0, 0)), (1, 1, 1), "ball")
    with pytest.raises(ValueError, match="must be positive"):
        Body("sheet", Pose((0, 0, 0)), (1, 1, 0))
    with pytest.raises(ValueError, match="occur twice: cup"):
        Scene((Body("cup", Pose((0, 0, 0)), (1, 1, 1)), Body("cup", Pose((1, 0, 0)), (1, 1, 1))))
    with pytest.raises(KeyError, match="bottle"):
        ROOM.body("spoon")
