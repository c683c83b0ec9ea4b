"""Scenes: perturbed ones that are possible, things that sink to what bears them."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from planlang.geometry import Pose
from planlang.geometry.matrices import upright
from sim import Body, PyBulletWorld, Scene, perturb
from sim.scene import Cavity, Handle
from sim.truth import at_rest_on, held_by
from tests.sim.conftest import AMIGO, ROOM, AskableWorld, MakeWorld

OPEN = {"finger1_joint_right": 0.4, "finger2_joint_right": -0.4}


SEEDS = range(1, 26)


def test_seed_zero_changes_nothing() -> None:
    assert perturb(ROOM, 0) is ROOM


def test_equal_seeds_give_equal_scenes_and_different_ones_differ() -> None:
    assert perturb(ROOM, 7) == perturb(ROOM, 7)
    assert perturb(ROOM, 7) != perturb(ROOM, 8)


@pytest.mark.parametrize("seed", SEEDS)
def test_a_perturbed_handle_is_in_nothing_else(seed: int) -> None:
    table = Body("table", Pose((0.0, 0.0, 0.4)), (1.0, 1.0, 0.8))
    rack = Body("rack", Pose((0.25, 0.0, 0.95)), (0.1, 0.8, 0.3))
    grip = Handle(Pose((0.3, 0.0, 0.0)), (0.4, 0.03, 0.02))
    pan = Body("pan", Pose((-0.3, 0.0, 0.83)), (0.2, 0.2, 0.06), "cylinder", movable=True, handles=(grip,))
    pose = perturb(Scene((table, rack, pan)), seed).body("pan").pose
    for along in (0.1, 0.2, 0.3, 0.4, 0.5):
        x, y, _ = (pose @ Pose((along, 0.0, 0.0))).position
        assert abs(x - 0.25) > 0.05 or abs(y) > 0.4


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


def test_what_stands_on_a_moved_table_below_a_wall_shelf_goes_with_the_table() -> None:
    shelf = Body("shelf", Pose((0.0, 0.0, 1.6)), (1.0, 1.0, 0.3))
    table = Body("table", Pose((0.0, 0.0, 0.25)), (0.8, 0.8, 0.5), movable=True)
    lamp = Body("lamp", Pose((-0.2, -0.1, 0.9)), (0.3, 0.3, 0.8))
    scene = Scene((shelf, table, lamp), (-2.0, -2.0, 2.0, 2.0), start=(1.5, 1.5, 0.0))
    moved = perturb(scene, 3)
    assert moved.body("table").pose != table.pose
    on_table = table.pose.inverse() @ lamp.pose, moved.body("table").pose.inverse() @ moved.body("lamp").pose
    assert on_table[0].position == pytest.approx(on_table[1].position, abs=1e-9)


@pytest.mark.parametrize("height", [0.35, 1.5])
def test_what_stands_in_furniture_moves_within_it_on_the_floor_and_on_the_wall(height: float) -> None:
    floor = Cavity((0.0, 0.0, -0.2), (0.56, 0.56, 0.26))
    cabinet = Body("cabinet", Pose((0.0, 0.0, height)), (0.6, 0.6, 0.7), cavities=(floor,))
    cup = Body("cup", Pose((0.0, 0.0, height - 0.28)), (0.08, 0.08, 0.1), "cylinder", movable=True)
    scene = Scene((cabinet, cup), (-2.0, -2.0, 2.0, 2.0), start=(1.5, 1.5, 0.0))
    assert sum(perturb(scene, seed).body("cup").pose != cup.pose for seed in SEEDS) >= 20


def test_object_with_no_room_to_move_stays() -> None:
    post = Body("post", Pose((0.0, 0.0, 0.5)), (0.07, 0.07, 1.0))
    cup = Body("cup", Pose((0.0, 0.0, 1.05)), (0.065, 0.065, 0.1), "box", movable=True)
    scene = Scene((post, cup), start=(3.0, 3.0, 0.0))
    for seed in SEEDS:
        assert perturb(scene, seed).body("cup").pose.distance(cup.pose) < 0.01


@pytest.mark.parametrize("height", [0.004, 0.015, 0.03, 0.1])
def test_what_stands_beside_something_flat_is_not_moved_into_it(height: float) -> None:
    table = Body("table", Pose((0.0, 0.0, 0.4)), (0.5, 0.5, 0.8))
    cup = Body("cup", Pose((0.0, 0.15, 0.85)), (0.08, 0.08, 0.1), "cylinder", movable=True)
    napkin = Body("napkin", Pose((0.0, -0.1, 0.8 + height / 2)), (0.12, 0.12, height), movable=True)
    scene = Scene((table, cup, napkin), start=(3.0, 3.0, 0.0))
    for seed in SEEDS:
        moved = perturb(scene, seed)
        assert moved.body("cup").pose.distance(moved.body("napkin").pose) > 0.1 / 2 + 0.08 / 2, seed


def test_scene_refuses_unknown_shapes_empty_sizes_and_names_that_occur_twice() -> None:
    with pytest.raises(ValueError, match="shapes are box, cylinder"):
        Body("ball", Pose((0, 0, 0)), (1, 1, 1), "ball")
    with pytest.raises(ValueError, match="must be positive"):
        Body("sheet", Pose((0, 0, 0)), (1, 1, 0))
    with pytest.raises(ValueError, match="occur twice: cup"):
        Scene((Body("cup", Pose((0, 0, 0)), (1, 1, 1)), Body("cup", Pose((1, 0, 0)), (1, 1, 1))))
    with pytest.raises(KeyError, match="bottle"):
        ROOM.body("spoon")


def _drop(world: PyBulletWorld, name: str, pose: Pose) -> int:
    """Let the robot hold a body somewhere and release it; how many steps it falls."""
    world.set_pose(name, pose)
    world.attach("grippoint_right", name)
    world.release(name)
    steps = 0
    while world.falling(name):
        world.step()
        steps += 1
    return steps


def test_released_object_falls_freely_and_rests_on_what_is_below(world: PyBulletWorld) -> None:
    steps = _drop(world, "bottle", Pose((-1.2, 2.2, 1.4)))
    assert world.pose("bottle").position == pytest.approx((-1.2, 2.2, 0.9), abs=1e-3)
    assert at_rest_on(world, "bottle") == "cabinet"
    assert steps == pytest.approx(math.sqrt(2 * 0.5 / 9.81) * world.rate, abs=1.5)


def test_object_over_the_floor_ends_on_the_floor(world: PyBulletWorld) -> None:
    _drop(world, "bottle", Pose((0.0, -1.0, 0.8)))
    assert world.pose("bottle").position == pytest.approx((0.0, -1.0, 0.1), abs=1e-3)
    assert at_rest_on(world, "bottle") == "room"


def test_half_supported_object_stays_and_one_whose_centre_is_off_slips_past_the_edge(world: PyBulletWorld) -> None:
    _drop(world, "bottle", Pose((-0.81, 2.2, 1.0)))
    assert at_rest_on(world, "bottle") == "cabinet"
    _drop(world, "bottle", Pose((-0.79, 2.2, 1.0)))
    assert at_rest_on(world, "bottle") == "room"
    assert world.pose("bottle").position[0] > -0.8 + 0.03 - 0.005, "beside the cabinet, not inside it"


def test_object_spanning_two_supports_rests_on_both(make_world: MakeWorld) -> None:
    trestles = [Body(f"trestle{k}", Pose((k * 0.3, -1.0, 0.25)), (0.1, 0.4, 0.5)) for k in (-1, 1)]
    board = Body("board", Pose((0.0, -1.0, 0.9)), (0.9, 0.3, 0.02), movable=True)
    world = make_world(extra=(*trestles, board))
    _drop(world, "board", board.pose)
    assert world.pose("board").position == pytest.approx((0.0, -1.0, 0.51), abs=1e-3)


def test_tilted_object_lands_on_its_nearest_side(world: PyBulletWorld) -> None:
    lying = Pose((0.0, -1.0, 0.5), (math.sin(0.7), 0.0, 0.0, math.cos(0.7)))
    _drop(world, "bottle", lying)
    assert world.pose("bottle").position[2] == pytest.approx(0.03, abs=1e-3)
    assert upright(Pose((0, 0, 0), (0.1, 0.0, 0.0, 0.995))).orientation == pytest.approx((0, 0, 0, 1), abs=1e-9)


def test_yaw_is_kept_when_an_object_is_set_upright() -> None:
    tilted = Pose.planar(0, 0, 0.8) @ Pose((0, 0, 0), (0.05, 0.0, 0.0, math.sqrt(1 - 0.05**2)))
    assert upright(tilted).yaw == pytest.approx(0.8, abs=0.01)


def test_robot_below_does_not_bear_what_it_lets_go(world: PyBulletWorld) -> None:
    x, y, _ = world.configuration().base
    _drop(world, "bottle", Pose((x + 0.25, y, 1.0)))
    assert at_rest_on(world, "bottle") == "room"


def test_what_is_not_held_cannot_be_released(world: PyBulletWorld) -> None:
    with pytest.raises(KeyError, match="not held"):
        world.release("bottle")


def test_oracle_knows_what_is_held_falls_and_hangs_in_the_air(world: PyBulletWorld) -> None:
    assert at_rest_on(world, "bottle") == "cabinet"
    world.set_pose("bottle", Pose((0.0, -1.0, 0.8)))
    assert at_rest_on(world, "bottle") is None
    world.attach("grippoint_right", "bottle")
    assert held_by(world, "bottle") == "robot"
    world.release("bottle")
    assert (held_by(world, "bottle"), at_rest_on(world, "bottle")) == (None, None)


def test_world_without_a_room_has_a_floor(make_world: MakeWorld) -> None:
    world = make_world(bodies=(Body("bottle", Pose((0.5, 0.5, 1.0)), (0.06, 0.06, 0.2), "cylinder", movable=True),))
    _drop(world, "bottle", world.pose("bottle"))
    assert at_rest_on(world, "bottle") == "floor"
    assert world.names() == ("bottle",)
