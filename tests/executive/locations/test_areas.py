"""Areas that relations mean, what the field of room promises, and what the robot's own body hides from its camera."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from itertools import islice

import numpy as np
import pytest

from executive.belief.floor import DOUBTFUL, Floor
from executive.belief.planning_scene import Unseen
from executive.locations.base_candidates import BaseCandidates
from executive.motion.clearance import Boxes
from executive.motion.outlines import outlines
from planlang.designators import a_location, an_object, located
from planlang.geometry import Array, Pose
from planlang.geometry.areas import Area, Block
from planlang.relations import RELATIONS
from tests.executive.conftest import BED, BOTTLE, THE_BOTTLE, MakeStage, stand
from tests.support.locations.rooms import BOUNDS, asked, room_of
from tests.support.locations.stage import Stage, robot_of

THE_BED = an_object("Bed-PieceOfFurniture")


def test_what_lies_on_a_bed_is_near_it(make_stage: MakeStage) -> None:
    stage = make_stage(BED, replace(BOTTLE, pose=Pose((-2.5, 0.0, 0.65))))
    near = a_location(near=THE_BED)
    assert stage.resolver.holds(near, THE_BOTTLE)
    assert not stage.resolver.holds(a_location(not_=near), THE_BOTTLE)
    poses = list(islice(stage.resolver.things(a_location(on=THE_BED) & near, THE_BOTTLE), 3))
    assert len(poses) == 3


def test_a_base_on_a_marker_is_near_it(make_stage: MakeStage) -> None:
    stage = make_stage(replace(BED, shape="marker", size=(0.0, 0.0, 0.0), pose=Pose((0.5, 0.0, 0.0))))
    stand(stage, (0.5, 0.0, 0.0))
    assert stage.executive.holds(located(a_location(near=THE_BED)))
    assert not stage.executive.holds(located(a_location(not_=a_location(near=THE_BED))))


def test_everything_in_a_room_is_near_the_room() -> None:
    room = Block(0.0, 0.0, 0.0, 4.0, 4.0, 0.0, 3.0)
    area = Area("near room", "room", room, radius=0.333, least=0.0, most=1.0)
    assert (area.score(np.array([(0.0, 0.0), (3.9, -3.9)])) > 0).all()


@pytest.mark.parametrize("relation", [*(name for name, one in RELATIONS.items() if one.directions), "far_from"])
@pytest.mark.parametrize("away", [1.0, 30.0, 1e3, 1e6])
def test_a_place_is_as_far_away_as_is_asked_for_and_nothing_overflows(relation: str, away: float) -> None:
    table = Block(0.0, 0.0, 0.0, 0.4, 0.4, 0.0, 0.7)
    directions = RELATIONS[relation].directions
    turn = (*directions, 0.0)[0]
    points = np.outer([0.0, away + 0.5, 2 * away + 1.0], [math.cos(turn), math.sin(turn)])
    limits = (away, math.inf)
    beyond = Area("", "table", table, 0.0, *limits, directions)
    with np.errstate(over="raise"):
        assert (beyond.score(points) > 0).tolist() == [False, True, True]


def test_a_distance_that_is_given_exactly_is_kept_within_a_millimetre() -> None:
    table = Block(0.0, 0.0, 0.0, 0.4, 0.4, 0.0, 0.7)
    area = Area("", "table", table, radius=0.0, least=1.0, most=1.0)
    points = np.array([(0.4 + away, 0.0) for away in (0.998, 0.9995, 1.0, 1.0005, 1.002)])
    assert (area.score(points) > 0).tolist() == [False, True, True, True, False]


HALF = 0.3
SQUARE = HALF * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])


@pytest.fixture
def floor() -> Floor:
    """Of a square robot in front of a wall whose near side is at x = 1."""
    wall = Boxes.around([Pose.planar(1.1, 0.0, 0.0, 0.5)], [(0.2, 6.0, 1.0)])
    silhouette = ((0.0, 0.5, HALF * math.sqrt(2)),)
    return Floor(wall, silhouette, outlines([(0.0, 0.5, SQUARE)]), (-2.0, -2.0, 2.0, 2.0))


def factors(floor: Floor, points: Array) -> list[float]:
    field = floor.field((0.0, 0.0), 0.0, 1.5)
    found = field.looked_up(points, np.zeros(len(points)), np.zeros((1, 2)))
    return [float(factor) for factor in found[:, 0]]


def test_a_square_robot_stands_at_a_wall_with_a_side_ahead_and_not_with_a_corner(floor: Floor) -> None:
    near = 1.0 - HALF - 0.02
    bases = np.array([[near, 0.0, 0.0], [near, 0.0, math.pi / 4], [near, 0.0, -math.pi / 2], [0.0, 0.0, 0.3]])
    assert floor.holds(bases).tolist() == [True, False, True, True]


def test_nowhere_off_the_map_is_there_room(floor: Floor) -> None:
    assert floor.holds(np.array([[-2.1, 0.0, 0.0], [0.0, 2.5, 0.0]])).tolist() == [False, False]


def test_the_field_leaves_open_where_the_heading_decides(floor: Floor) -> None:
    roomy, open_, none = factors(floor, np.array([[0.4, 0.0], [0.65, 0.0], [0.8, 0.0]]))
    assert roomy > DOUBTFUL
    assert open_ == DOUBTFUL
    assert none == 0.0


def test_candidates_come_in_turn_over_the_ways_and_no_more_than_are_asked_for() -> None:
    scores = np.array([0.9, 0.8, 0.7, 0.2, 0.1])
    ranks = np.array([0, 1, 2, 0, 1], np.intp)
    found = BaseCandidates(np.zeros((5, 3)), scores, *(np.zeros(5, np.intp) for _ in range(3)), np.zeros(5), ranks)

    def alike(bases: Array) -> Array:
        return np.ones(len(bases))

    assert found.order(alike, 10).tolist() == [0, 3, 1, 4, 2]
    assert found.order(alike, 3).tolist() == [0, 3, 1]
    assert found.chosen(found.order(alike, 2)).scores.tolist() == [0.9, 0.2]
    assert BaseCandidates().order(alike, 3).tolist() == []


@pytest.fixture(scope="module")
def stage() -> Iterator[Stage]:
    stage = Stage(room_of("normal", 1), robot_of("amigo"))
    stage.platform.observe()
    yield stage
    stage.close()


def test_no_place_from_which_a_thing_is_seen_is_taken_for_one_from_which_it_surely_is_not(stage: Stage) -> None:
    scene, rng = stage.platform.scene, np.random.default_rng(0)
    block, view = scene.bodies.block("bottle"), scene.visibility.own_view()
    assert view is not None
    away, bearing, yaw = rng.uniform(0.3, 1.5, 120), rng.uniform(-3.1, 3.1, 120), rng.uniform(-3.1, 3.1, 120)
    bases = np.column_stack([block.x + away * np.cos(bearing), block.y + away * np.sin(bearing), yaw])
    solids = scene.collisions.solids()
    others = solids.only(np.array([body != "bottle" for body in solids.bodies], bool))
    by_itself, by_the_room = Unseen(view, block)(bases), view.hidden_by(others, bases, block)
    seen = np.array(
        [scene.visibility.hidden((float(x), float(y), float(turn)), "bottle") is None for x, y, turn in bases]
    )
    assert not (by_itself & seen).any()
    assert not (by_the_room & seen).any()
    assert by_itself.sum() > 10, "the robot cannot see behind itself"


def test_the_camera_sees_to_the_corners_of_its_picture(stage: Stage) -> None:
    camera = stage.robot.camera
    assert camera is not None
    wide, high = math.tan(camera.fov / 2), math.tan(camera.fov / 2) * camera.height / camera.width
    assert math.tan(camera.half_angle) == pytest.approx(math.hypot(wide, high))


@pytest.mark.parametrize("seed", [54, 114])
def test_a_place_is_found_where_only_few_of_thousands_will_do(seed: int) -> None:
    room = room_of("hard", seed)
    crowded = Stage(room, robot_of("amigo"))
    answer = crowded.ask(asked(room))
    crowded.close()
    assert answer.solved
    assert all(
        low < value < high for value, low, high in zip(answer.solutions[0].base[:2], BOUNDS, BOUNDS[2:], strict=False)
    )
