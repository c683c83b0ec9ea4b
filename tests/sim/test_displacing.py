"""What a seed displaces: each thing by its own name, doors only as far as there is room, devices by their controls."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import pytest

from planlang.geometry import Pose
from sim import Body, PyBulletWorld, Scene, perturb
from sim.joints import Articulation, Control, JointKind

SEEDS = range(1, 41)
CASE = Body("case", Pose((0.0, 0.0, 0.5)), (0.5, 0.8, 1.0))
DOOR = Body("door", Pose((-0.26, 0.0, 0.5)), (0.02, 0.8, 1.0))
GRIP = Body("grip", Pose((-0.3, -0.35, 0.5)), (0.02, 0.02, 0.2))
HINGE = Articulation(
    "door", JointKind.HINGED, (-0.26, 0.4, 0.5), (0.0, 0.0, -1.0), 0.0, math.pi / 2, "case", ("grip",), "grip"
)
DRAWER = Body("drawer", Pose((2.0, 0.0, 0.5)), (0.4, 0.5, 0.2))
SLIDE = Articulation("drawer", JointKind.PRISMATIC, (2.0, 0.0, 0.5), (-1.0, 0.0, 0.0), 0.0, 0.35)
SPOON = Body("spoon", Pose((2.0, 0.0, 0.45)), (0.15, 0.03, 0.02), movable=True, type="Spoon")
MAKER = Body("maker", Pose((0.0, -2.0, 0.5)), (0.3, 0.3, 1.0))
BUTTON = Control("maker", "maker", (0.15, 0.0, 0.3), (1.0, 0.0, 0.0))
KITCHEN = Scene(
    (CASE, DOOR, GRIP, DRAWER, SPOON, MAKER), start=(-2.0, -2.0, 0.0), joints=(HINGE, SLIDE), controls=(BUTTON,)
)


def openings(scene: Scene) -> dict[str, float]:
    """How far each leaf is open at first."""
    return {joint.leaf: joint.first for joint in scene.joints}


def test_about_half_of_the_doors_drawers_and_devices_are_not_as_the_map_says() -> None:
    worlds = [perturb(KITCHEN, seed) for seed in SEEDS]
    for leaf in ("door", "drawer"):
        values = [openings(world)[leaf] for world in worlds]
        assert 10 <= sum(value > 0 for value in values) <= 30
        upper = HINGE.upper if leaf == "door" else SLIDE.upper
        assert max(values) <= upper
        assert max(values) > 0.7 * upper
    assert 10 <= sum(world.body("maker").is_on for world in worlds) <= 30


@pytest.mark.parametrize("added", [0, 3, 6])
def test_a_thing_stays_where_a_seed_put_it_when_the_map_gains_another(added: int) -> None:
    new = Body("new", Pose((0.0, 3.0, 0.1)), (0.1, 0.1, 0.2), movable=True)
    bodies = (*KITCHEN.bodies[:added], new, *KITCHEN.bodies[added:])
    for seed in (1, 2, 3, 4, 5):
        before, after = perturb(KITCHEN, seed), perturb(replace(KITCHEN, bodies=bodies), seed)
        assert openings(before) == openings(after)
        assert before.start == after.start
        for body in before.bodies:
            assert after.body(body.name) == body


def test_what_lies_in_a_drawer_moves_with_it() -> None:
    opened = next(one for one in (perturb(KITCHEN, seed) for seed in SEEDS) if openings(one)["drawer"] > 0.1)
    world = PyBulletWorld(opened)
    try:
        shift = world.pose("drawer").position[0] - DRAWER.pose.position[0]
        assert shift == pytest.approx(-openings(opened)["drawer"])
        assert world.pose("spoon").position[0] == pytest.approx(opened.body("spoon").pose.position[0] + shift)
    finally:
        world.close()


@pytest.mark.parametrize(
    ("extra", "most"),
    [
        ((Body("post", Pose((-0.7, -0.1, 0.5)), (0.1, 0.1, 1.0)),), 0.9),
        ((Body("cup", Pose((-0.5, 0.3, 0.05)), (0.08, 0.08, 0.1), movable=True),), math.pi / 2),
        ((Body("stack", Pose((-0.26, 0.0, 1.02)), (0.02, 0.1, 0.04), movable=True),), 0.0),
    ],
    ids=["a post in its way", "a thing that moves itself", "something stands on it"],
)
def test_a_door_is_opened_into_nothing(extra: Sequence[Body], most: float) -> None:
    scene = replace(KITCHEN, bodies=(*KITCHEN.bodies, *extra))
    for seed in SEEDS:
        there = perturb(scene, seed)
        assert openings(there)["door"] <= most
        world = PyBulletWorld(there)
        try:
            bodies = world._bodies
            gaps = [bodies.gap(bodies.of["door"], bodies.of[one.name], 1.0) for one in extra if one.name != "stack"]
            assert all(gap > 0 for gap in gaps)
        finally:
            world.close()


def test_no_door_is_opened_where_the_robot_starts() -> None:
    near = replace(KITCHEN, start=(-0.75, 0.0, 0.0))
    assert all(openings(perturb(near, seed))["door"] <= 0.3 for seed in SEEDS)


def test_a_device_with_a_knob_is_switched_by_turning_it() -> None:
    knob = Body("knob", Pose((-0.3, -2.0, 0.8)), (0.03, 0.04, 0.04))
    turn = Articulation(
        "knob", JointKind.HINGED, (-0.3, -2.0, 0.8), (1.0, 0.0, 0.0), 0.0, math.pi / 2, "maker", handle="knob"
    )
    control = Control("maker", "knob", (0.0, 0.0, 0.0), (-1.0, 0.0, 0.0), turns=True)
    scene = replace(KITCHEN, bodies=(*KITCHEN.bodies, knob), joints=(*KITCHEN.joints, turn), controls=(control,))
    for seed in SEEDS:
        there = perturb(scene, seed)
        assert there.body("maker").is_on is (openings(there)["knob"] > turn.upper / 2)
