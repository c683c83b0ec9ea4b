"""Facts about clearance: the distance a silhouette keeps from boxes."""

import math

import numpy as np
import pytest

from executive.motion.clearance import Boxes, Grid, clearance_at, clearance_field, clearances_at
from planlang.geometry import Pose

ROBOT = [(0.0, 0.4, 0.35), (0.4, 1.5, 0.2)]


def box(x: float, y: float, low: float, high: float, size: tuple[float, float] = (1.0, 0.5), yaw: float = 0.0) -> Boxes:
    """One box between two heights."""
    return Boxes.around([Pose.planar(x, y, yaw, (low + high) / 2)], [(*size, high - low)])


def test_clearance_is_the_distance_to_the_side_less_the_radius() -> None:
    wall = box(2.0, 0.0, 0.0, 1.0)
    assert clearance_at([[0.0, 0.0]], wall, ROBOT)[0] == pytest.approx(1.5 - 0.35)
    assert clearance_at([[2.0, 1.0]], wall, ROBOT)[0] == pytest.approx(0.75 - 0.35)
    assert clearance_at([[3.5, 1.25]], wall, ROBOT)[0] == pytest.approx(math.hypot(1, 1) - 0.35)


def test_clearance_inside_a_box_is_negative_by_the_way_out() -> None:
    assert clearance_at([[2.0, 0.0]], box(2.0, 0.0, 0.0, 1.0), ROBOT)[0] == pytest.approx(-0.25 - 0.35)


def test_low_base_goes_under_a_high_box_as_far_as_its_column_lets_it() -> None:
    high, low = box(2.0, 0.0, 0.6, 1.0), box(2.0, 0.0, 0.2, 0.6)
    assert clearance_at([[1.2, 0.0]], high, ROBOT)[0] == pytest.approx(0.3 - 0.2)
    assert clearance_at([[1.2, 0.0]], low, ROBOT)[0] == pytest.approx(0.3 - 0.35)


def test_box_above_or_below_the_robot_is_no_obstacle() -> None:
    assert clearance_at([[2.0, 0.0]], box(2.0, 0.0, 1.5, 2.0), ROBOT)[0] == math.inf
    assert clearance_at([[2.0, 0.0]], box(2.0, 0.0, -0.1, 0.0), ROBOT)[0] == math.inf


def test_turned_box_is_measured_along_its_own_sides() -> None:
    turned = box(0.0, 0.0, 0.0, 1.0, size=(2.0, 0.2), yaw=math.pi / 2)
    assert clearance_at([[1.0, 0.5]], turned, ROBOT)[0] == pytest.approx(0.9 - 0.35)


def test_clearance_agrees_with_the_nearest_of_many_points_of_the_boxes() -> None:
    rng = np.random.default_rng(0)
    poses = [Pose.planar(*rng.uniform(-2, 2, 2), rng.uniform(-3, 3), 0.5) for _ in range(6)]
    sizes = np.column_stack([rng.uniform(0.2, 1.5, (6, 2)), np.ones(6)])
    inside = rng.uniform(-0.5, 0.5, (20000, 3))
    places = rng.uniform(-3, 3, (40, 2))
    nearest = np.full(40, np.inf)
    for pose, size in zip(poses, sizes, strict=True):
        filled = (inside * size) @ pose.matrix()[:3, :3].T + pose.matrix()[:3, 3]
        away = np.linalg.norm(places[:, None] - filled[None, :, :2], axis=2).min(axis=1)
        nearest = np.minimum(nearest, away)
    room = clearance_at(places, Boxes.around(poses, sizes), ROBOT) + 0.35
    np.testing.assert_allclose(np.maximum(room, 0), nearest, atol=0.03)


@pytest.mark.parametrize("most", [0.0, 0.3])
def test_room_up_to_what_is_asked_for_is_the_same_whatever_is_left_out(most: float) -> None:
    rng = np.random.default_rng(2)
    for _ in range(40):
        boxes = Boxes(rng.uniform(-2, 2, (12, 3)), rng.uniform(0.02, 0.6, (12, 3)), rng.uniform(-4, 4, 12))
        places = rng.uniform(-0.5, 0.5, (30, 2)) + rng.uniform(-1, 1, 2)
        whole = clearances_at(places, boxes, (ROBOT, ROBOT[1:]))
        found = clearances_at(places, boxes, (ROBOT, ROBOT[1:]), most)
        np.testing.assert_array_equal(np.minimum(found, most), np.minimum(whole, most))


def test_tilted_box_is_replaced_by_a_prism_that_holds_it() -> None:
    rng = np.random.default_rng(1)
    for _ in range(50):
        quaternion = rng.normal(size=4)
        quaternion /= np.linalg.norm(quaternion)
        pose = Pose((1.0, 2.0, 3.0), tuple(quaternion.tolist()))
        size = rng.uniform(0.1, 1.0, 3)
        prism = Boxes.around([pose], [size])
        corners = np.array(np.meshgrid(*[[-1, 1]] * 3)).reshape(3, -1).T * size / 2 @ pose.matrix()[:3, :3].T
        cosine, sine = np.cos(prism.yaws[0]), np.sin(prism.yaws[0])
        own = corners @ np.array([[cosine, -sine, 0], [sine, cosine, 0], [0, 0, 1]])
        np.testing.assert_allclose(np.abs(own).max(axis=0), prism.half_extents[0], atol=1e-9)


def test_box_that_lies_on_its_side_keeps_its_extents() -> None:
    lying = Boxes.around([Pose((0, 0, 0), (math.sqrt(0.5), 0, 0, math.sqrt(0.5)))], [(1.0, 0.2, 0.6)])
    np.testing.assert_allclose(lying.half_extents, [[0.5, 0.3, 0.1]], atol=1e-9)


def test_no_boxes_leave_all_room() -> None:
    assert (clearance_field(Grid.over((0, 0), (1, 1)), Boxes.around([], np.empty((0, 3))), ROBOT) == math.inf).all()


def test_field_has_the_value_of_each_cell_centre() -> None:
    grid = Grid.over((-1.0, -2.0), (3.0, 1.0), 0.1)
    assert (grid.rows, grid.columns) == (30, 40)
    wall = box(2.0, 0.0, 0.0, 1.0)
    field = clearance_field(grid, wall, ROBOT)
    cell = grid.cell(0.52, -0.31)
    assert cell is not None
    assert field[cell] == clearance_at([grid.centres()[cell]], wall, ROBOT)[0]
    assert grid.cell(3.2, 0.0) is None


def test_sizes_must_go_with_poses() -> None:
    with pytest.raises(ValueError, match="1 poses do not go with 2 sizes"):
        Boxes.around([Pose.planar(0, 0)], np.ones((2, 3)))
    with pytest.raises(ValueError, match="no cell"):
        Grid.over((0, 0), (0.01, 1))
