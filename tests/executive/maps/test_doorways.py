"""Maps of several rooms: connections, openings in walls, and a robot that searches the next room."""

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

from executive.cli.app import app
from executive.maps import SemanticMap, scene_of
from executive.maps.doorways import HEIGHT, WIDTH
from executive.maps.occupied_space import OBSTACLE
from planlang.diagnostics import Diagnostic
from planlang.geometry import Pose
from sim import Scene
from tests.support.examples import some

Write = Callable[..., str]
Read = Callable[..., SemanticMap]
ROOM = (4.0, 4.0, 2.6)
CONNECTED = "connectedTo room2"
HERE = Pose((0.0, 0.0, 0.0))


@pytest.fixture
def rooms(map_of: Read, thing: Write, seen: Write) -> Callable[..., tuple[Scene, list[Diagnostic]]]:
    """Reads a map of two rooms, 0.2 m apart along x, in a frame with a pose; with facts about the first, and frames."""

    def read(
        *facts: str, frame: Pose = HERE, frames: tuple[str, ...] = (), away: float = 4.2
    ) -> tuple[Scene, list[Diagnostic]]:
        poses = [frame @ Pose((x, y, 1.3)) for x, y in ((0.0, 0.0), (away, 0.5))]
        both = [
            text
            for number, pose in enumerate(poses, 1)
            for text in (
                thing(f"room{number}", "HospitalRoom", ROOM, *(facts if number == 1 else ())),
                seen(f"room{number}", pose.position, pose.rotation.reshape(-1).tolist()),
            )
        ]
        found: list[Diagnostic] = []
        return scene_of(map_of(*both, *frames), found), found

    return read


Rooms = Callable[..., tuple[Scene, list[Diagnostic]]]


def openings(scene: Scene) -> list[tuple[float, ...]]:
    """The centres of all openings in walls, in the map frame."""
    return [(room.pose @ Pose(cut.centre)).position for room in scene.bodies for cut in room.cavities]


def test_unconnected_rooms_have_closed_walls(rooms: Rooms) -> None:
    scene, found = rooms()
    assert openings(scene) == []
    assert found == []


@pytest.mark.long
@settings(
    max_examples=25,
    deadline=None,
    phases=[Phase.explicit, Phase.reuse, Phase.generate],
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
@given(x=st.floats(-9, 9), y=st.floats(-9, 9), yaw=st.floats(-math.pi, math.pi))
def test_connected_rooms_have_a_doorway_in_the_middle_of_their_walls_wherever_the_map_lies(
    rooms: Rooms, x: float, y: float, yaw: float
) -> None:
    frame = Pose.planar(x, y, yaw)
    scene, found = rooms(CONNECTED, frame=frame)
    assert [one.code for one in found] == ["M029"]
    local = [(frame.inverse() @ Pose(at)).position for at in openings(scene)]  # type: ignore[arg-type]
    assert np.allclose(sorted(local), [(2.05, 0.25, HEIGHT / 2), (2.15, 0.25, HEIGHT / 2)], atol=1e-6)
    sizes = [cut.size for room in scene.bodies for cut in room.cavities]
    assert np.allclose(sizes, [(0.2, WIDTH, HEIGHT)] * 2, atol=1e-6)


def test_a_placed_doorway_is_an_opening_and_not_a_body(rooms: Rooms, thing: Write, seen: Write) -> None:
    doorway = thing("doorway1", "Doorway", (0.2, 0.9, 2.1)), seen("doorway1", (2.1, 1.2, 1.05))
    scene, found = rooms(CONNECTED, frames=doorway)
    assert np.allclose(sorted(openings(scene)), [(2.05, 1.2, 1.05), (2.15, 1.2, 1.05)])
    assert found == []


@pytest.mark.parametrize("width", [3.5, 3.6])
def test_a_doorway_as_wide_as_the_wall_that_two_rooms_share_is_an_opening(
    rooms: Rooms, thing: Write, seen: Write, width: float
) -> None:
    place = seen("doorway1", (2.1, 0.25, 1.0), np.eye(3).reshape(-1).tolist())
    scene, found = rooms(frames=(thing("doorway1", "Doorway", (0.2, width, 2.0)), place))
    assert len(openings(scene)) == 2
    assert found == []


@pytest.mark.parametrize("prop", ["connectedTo", "betweenContainers"])
def test_a_doorway_without_a_pose_connects_rooms(rooms: Rooms, prop: str) -> None:
    frames = f"Individual: way\n    Types: knowrob:Doorway\n    Facts: knowrob:{prop} room1, knowrob:{prop} room2\n"
    scene, found = rooms(frames=(frames,))
    assert len(openings(scene)) == 2
    assert [one.code for one in found] == ["M029"]


def test_connected_rooms_that_share_no_wall_are_reported(rooms: Rooms) -> None:
    scene, found = rooms(CONNECTED, away=9.0)
    assert openings(scene) == []
    assert ["there is no way" in one.message for one in found] == [True]


def test_an_obstacle_of_a_grid_blocks_a_doorway(rooms: Rooms, tmp_path: Path) -> None:
    picture = np.full((60, 90), 254, np.uint8)
    picture[:, 41:43] = 0  # the whole wall
    (tmp_path / "grid.pgm").write_bytes(b"P5 90 60 255\n" + picture.tobytes())
    (tmp_path / "grid.yaml").write_text("image: grid.pgm\nresolution: 0.1\norigin: [-2.05, -3, 0]\nheight: 2.0\n")
    grid = 'Individual: grid1\n    Types: knowrob:Map\n    Facts: knowrob:linkToMapFile "grid.yaml"\n'
    scene, _ = rooms(CONNECTED, frames=(grid,))
    (box,) = (body for body in scene.bodies if body.name.startswith(OBSTACLE))
    assert box.pose.position == pytest.approx((2.15, 0.25, 1.0), abs=0.051)
    assert box.size[1] >= WIDTH - 0.1


@pytest.mark.parametrize("connected", some([True, False]))
def test_a_search_goes_on_in_the_next_room_if_that_is_connected(
    rooms: Rooms, thing: Write, seen: Write, corpus: Path, tmp_path: Path, connected: bool
) -> None:
    frames = []
    for name, cls, size, place in (
        ("table1", "SideTable", (0.4, 0.8, 0.7), (-1.6, 1.0, 0.35)),
        ("table2", "SideTable", (0.4, 0.8, 0.7), (5.9, 1.0, 0.35)),
        ("bottle1", "DrinkingBottle", (0.07, 0.07, 0.2), (5.85, 1.0, 0.8)),
    ):
        frames += [thing(name, cls, size), seen(name, place)]
    rooms(*([CONNECTED] if connected else []), frames=tuple(frames))
    recipe = str(corpus / "recipes" / "object-search-recipe@hydro.owl")
    words = ["run", recipe, "--robot", "amigo", "--environment", str(tmp_path / "map.omn"), "--unknown", "bottle1"]
    result = CliRunner().invoke(app, words)
    assert ("bottle1: at rest on table2" in result.stdout) is connected, result.output
    assert ("ObjectNowhereToBeFound" in result.output) is not connected
