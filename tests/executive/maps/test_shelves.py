"""Shelves are hollow between their boards, which a map or a class states, and toolboxes are open above."""

from collections.abc import Callable
from pathlib import Path

import pytest

from executive.maps import SemanticMap, read_map, scene_of
from planlang.diagnostics import Diagnostic
from planlang.ontology import load
from sim import Body

Write = Callable[..., str]
Read = Callable[..., SemanticMap]
SIZE = (0.4, 1.0, 1.8)


@pytest.fixture
def body(map_of: Read, thing: Write, seen: Write) -> Callable[..., Body]:
    """Puts a thing of a class on the floor of a map."""

    def put(cls: str, *facts: str, size: tuple[float, float, float] = SIZE) -> Body:
        frame = thing("thing1", cls, size, *facts)
        return scene_of(map_of(frame, seen("thing1", (0.0, 0.0, size[2] / 2)))).body("thing1")

    return put


def floors(body: Body) -> list[float]:
    """How far the floors of rooms are above the lower end of a body [m]."""
    return [round(room.centre[2] - room.size[2] / 2 + body.size[2] / 2, 6) for room in body.cavities]


def ceilings(body: Body) -> list[float]:
    return [round(room.centre[2] + room.size[2] / 2 + body.size[2] / 2, 6) for room in body.cavities]


def is_open(body: Body, axis: int, sign: int) -> bool:
    """Whether all rooms reach through a side of a body."""
    return all(sign * room.centre[axis] + room.size[axis] / 2 > body.size[axis] / 2 for room in body.cavities)


def test_a_shelf_has_room_between_the_boards_that_a_map_states(body: Callable[..., Body]) -> None:
    shelf = body("Shelves", 'boardHeights "0.8 0.05 1.2"')
    assert floors(shelf) == [0.05, 0.8, 1.2]
    assert ceilings(shelf) == [0.78, 1.18, 1.78], "boards, and its top, are 2 cm thick"
    assert not shelf.movable


def test_a_shelf_is_open_in_front_unless_a_map_states_other_sides(body: Callable[..., Body]) -> None:
    boards = 'boardHeights "0.05 0.8"'
    sides = {(axis, sign) for axis in (0, 1, 2) for sign in (1, -1)}
    shelf, rack = body("Shelves", boards), body("Shelves", boards, 'openSide "+x"', 'openSide "-x"')
    assert {side for side in sides if is_open(shelf, *side)} == {(0, 1)}
    assert {side for side in sides if is_open(rack, *side)} == {(0, 1), (0, -1)}


def test_any_furniture_of_which_a_map_states_boards_has_them(body: Callable[..., Body]) -> None:
    assert floors(body("Cupboard", 'boardHeights "0.02 0.5"')) == [0.02, 0.5]


def test_boards_divide_what_is_behind_a_door(tmp_path: Path) -> None:
    file = tmp_path / "fridge.omn"
    file.write_text(
        """Prefix: : <http://example.org/fridge.owl#>
Prefix: knowrob: <http://knowrob.org/kb/knowrob.owl#>
Ontology: <http://example.org/fridge.owl>
    Import: <http://knowrob.org/kb/knowrob.owl>
Individual: fridge
    Types: knowrob:SemanticEnvironmentMap
Individual: thing1
    Types: knowrob:Refrigerator
    Facts: knowrob:translation "0 0 0.9", knowrob:boundingBoxSize "0.6 0.6 1.8", knowrob:boardHeights "0.1 0.5 1.2",
        knowrob:properPhysicalParts door1
Individual: door1
    Types: knowrob:Door
    Facts: knowrob:relativeTo thing1, knowrob:translation "0.31 0 0.1", knowrob:boundingBoxSize "0.02 0.6 1.6"
""",
        encoding="utf-8",
    )
    fridge = scene_of(read_map(load(file))).body("thing1")
    assert floors(fridge) == [0.2, 0.5, 1.2], "the lowest room begins where the door does"
    assert ceilings(fridge) == [0.48, 1.18, 1.78]


def test_a_shelf_of_which_nothing_is_stated_has_the_boards_of_its_class(body: Callable[..., Body]) -> None:
    assert floors(body("Shelves")) == [0.1, 0.5, 0.9, 1.3]
    assert floors(body("Shelves", size=(0.3, 0.8, 1.0))) == [0.1, 0.5, 0.9], "those that it is high enough for"


def test_boards_that_are_not_within_a_shelf_are_left_out_with_a_warning(
    map_of: Read, thing: Write, seen: Write
) -> None:
    frame = thing("shelf1", "Shelves", SIZE, 'boardHeights "0.1 2.1"')
    read = map_of(frame, seen("shelf1", (0.0, 0.0, 0.9)), ignore_unread=True)
    assert not scene_of(read).body("shelf1").cavities
    (found,) = (one for one in read.diagnostics if one.code == "M002")
    assert "boardHeights of shelf1 is left out: a shelf 1.8 m high" in found.message


def test_what_lies_on_a_board_is_within_reach(map_of: Read, thing: Write, seen: Write) -> None:
    found: list[Diagnostic] = []
    frames = (thing("shelf1", "Shelves", SIZE), thing("tool1", "Screwdriver", (0.22, 0.03, 0.03)))
    read = map_of(*frames, seen("shelf1", (0.0, 0.0, 0.9)), seen("tool1", (0.0, 0.0, 0.915)))
    scene = scene_of(read, found)
    assert scene.body("tool1").graspable
    assert [one.message for one in found] == ["tool1 inside shelf1, which is hollow"]


def test_what_hangs_in_the_air_over_a_board_is_reported_with_the_board(map_of: Read, thing: Write, seen: Write) -> None:
    found: list[Diagnostic] = []
    frames = (thing("shelf1", "Shelves", SIZE), thing("tool1", "Screwdriver", (0.22, 0.03, 0.03)))
    scene_of(map_of(*frames, seen("shelf1", (0.0, 0.0, 0.9)), seen("tool1", (0.0, 0.0, 1.015))), found)
    (air,) = (one for one in found if one.code == "M015")
    assert air.message == "tool1 stands on nothing: its lowest point is 0.100 m over a board of shelf1"
    assert air.help == "a pose is that of the middle: 0.100 m lower tool1 stands on the board at 0.9 m"


def test_a_toolbox_is_open_above(body: Callable[..., Body]) -> None:
    box = body("Toolbox", size=(0.22, 0.42, 0.2))
    assert is_open(box, 2, 1)
    assert not is_open(box, 0, 1)
