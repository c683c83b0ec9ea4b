"""Robots of a map drive on the routes that it states."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from executive.maps import SemanticMap, scene_of
from executive.maps.contents import SPEED
from planlang.diagnostics import BadInput, Diagnostic

Write = Callable[..., str]
Read = Callable[..., SemanticMap]


@pytest.mark.parametrize(
    ("facts", "speed"), [(('routePoints "2 1  3.5 1"', "drivingSpeed 0.4"), 0.4), (('routePoints "2 1 3.5 1"',), SPEED)]
)
def test_a_robot_drives_from_where_it_is_to_the_points_of_its_route(
    map_of: Read, thing: Write, seen: Write, facts: tuple[str, ...], speed: float
) -> None:
    scene = scene_of(map_of(thing("porter", "Robot", (0.5, 0.4, 1.0), *facts), seen("porter", (0.0, 1.0, 0.5))))
    (mover,) = scene.movers
    assert (mover.body, mover.route, mover.speed) == ("porter", ((0.0, 1.0), (2.0, 1.0), (3.5, 1.0)), speed)
    assert not scene.body("porter").movable


@pytest.mark.parametrize("route", ["2 1 3", "0 1", "two one", "900000 1"])
def test_a_route_that_leads_nowhere_is_reported_and_the_robot_stands(
    map_of: Read, thing: Write, seen: Write, route: str
) -> None:
    notes: list[Diagnostic] = []
    frame = thing("porter", "Robot", (0.5, 0.4, 1.0), f'routePoints "{route}"')
    assert not scene_of(map_of(frame, seen("porter", (0.0, 1.0, 0.5))), notes).movers
    assert [one.code for one in notes if "porter" in one.message] == ["M002"]


@pytest.mark.parametrize(("route", "through"), [("2 1", ["cupboard"]), ("0.4 1", []), ("0 -1  2 -1", [])])
def test_furniture_on_a_route_is_warned_of(
    map_of: Read, thing: Write, seen: Write, route: str, through: list[str]
) -> None:
    notes: list[Diagnostic] = []
    furniture = thing("cupboard", "Cupboard", (0.4, 0.8, 1.8)) + seen("cupboard", (1.0, 1.0, 0.9))
    robot = thing("porter", "Robot", (0.5, 0.4, 1.0), f'routePoints "{route}"') + seen("porter", (0.0, 1.0, 0.5))
    assert len(scene_of(map_of(furniture, robot), notes).movers) == 1
    warned = [one for one in notes if one.code == "M037"]
    assert [one.message for one in warned] == [f"porter drives through {name} on its route" for name in through]
    assert all(one.span is not None and "a way of 0.20 m on both sides" in str(one.help) for one in warned)


def test_a_route_in_another_namespace_is_reported_with_the_right_one(map_of: Read, thing: Write, seen: Write) -> None:
    frame = thing("porter", "Robot", (0.5, 0.4, 1.0), 'routePoints "2 1"')
    frame = frame.replace("knowrob:routePoints", "<http://knowrob.org/kb/moving.owl#routePoints>")
    with pytest.raises(BadInput) as caught:
        map_of(frame, seen("porter", (0.0, 1.0, 0.5)))
    (found,) = caught.value.diagnostics
    assert found.code == "M036"
    assert "did you mean <http://knowrob.org/kb/knowrob.owl#routePoints>?" in str(found.help)
