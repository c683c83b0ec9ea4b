"""After a thing was put down the robot checks that it stands there: with a look, or, without a camera, by touch."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest
from numpy.typing import NDArray

from planlang import perform
from planlang.designators import a_location, action, an_object
from planlang.failures import ObjectLost
from planlang.geometry import Array, Pose
from planlang.protocols import Detection, Group, GroupKind, Trajectory
from sim import Body
from sim.truth import Truth
from tests.executive.conftest import BOTTLE, CABINET, PLACE, THE_BOTTLE, MakeStage, Stage, hold_bottle, stand
from tests.support.failing_robots import Decorated

TABLE = Body("table", Pose((2.0, 0.0, 0.39)), (0.6, 1.2, 0.78), type="Table-PieceOfFurniture")
ON_TABLE = a_location(on=an_object(TABLE.type, PLACE + "table"))
ROOM = (CABINET, BOTTLE, TABLE)


def lowered(stage: Stage) -> None:
    """Lower the bottle onto the table."""
    hold_bottle(stage)
    stand(stage, next(stage.resolver.bases(a_location(in_reach_of=ON_TABLE))).base)
    stage.run(lambda: perform(action("LoweringAnObject", object_acted_on=THE_BOTTLE, to_location=ON_TABLE)))


def let_go(stage: Stage, happens: Callable[[Truth], None] = lambda truth: None) -> None:
    """Let go of the bottle; something happens as soon as no hand holds it any more."""
    step, pending = stage.truth.step, [happens]

    def watched() -> None:
        step()
        if pending and not stage.truth.attached() and not stage.truth.falling("bottle"):
            pending.pop()(stage.truth)

    stage.truth.step = watched  # type: ignore[method-assign]
    stage.run(lambda: perform(action("OpeningAGripper", object_acted_on=THE_BOTTLE)))


def moved(truth: Truth, dx: float, dy: float, dz: float = 0.0) -> None:
    x, y, z = truth.pose("bottle").position
    truth.set_pose("bottle", Pose((x + dx, y + dy, z + dz)))


def rolls(truth: Truth) -> None:
    moved(truth, 0.0, 0.2)


def falls_off(truth: Truth) -> None:
    moved(truth, 0.0, 0.25, -0.78)


def falls_over(truth: Truth) -> None:
    x, y, z = truth.pose("bottle").position
    low, (wide, _, high) = z - BOTTLE.size[2] / 2, BOTTLE.size
    half = math.sqrt(0.5)
    truth.set_pose("bottle", Pose((x, y + high / 2, low + wide / 2), (half, 0.0, 0.0, half)))


def test_what_stands_where_it_was_put_is_seen_there(make_stage: MakeStage) -> None:
    stage = make_stage(*ROOM)
    lowered(stage)
    let_go(stage)
    assert stage.belief.seen_from_here("bottle")
    assert stage.belief.pose("bottle").distance(stage.truth.pose("bottle")) < 0.005


@pytest.mark.parametrize(
    ("happens", "said"),
    [
        (rolls, "bottle is not where it was put, on table, but 0.20 m away"),
        (falls_off, "bottle is not where it was put, on table"),
        (falls_over, "bottle has fallen over on table"),
    ],
)
def test_what_has_left_its_place_is_lost_and_the_failure_says_how(
    make_stage: MakeStage, happens: Callable[[Truth], None], said: str
) -> None:
    stage = make_stage(*ROOM)
    lowered(stage)
    with pytest.raises(ObjectLost) as caught:
        let_go(stage, happens)
    assert (str(caught.value).startswith(said), caught.value.what) == (True, "bottle"), str(caught.value)


def test_what_was_put_on_a_table_that_is_not_there_is_lost(make_stage: MakeStage) -> None:
    low = replace(TABLE, pose=Pose((2.0, 0.0, 0.2)), size=(0.6, 1.2, 0.4))
    stage = make_stage(*ROOM, truth=(CABINET, BOTTLE, low))
    lowered(stage)
    with pytest.raises(ObjectLost, match="bottle is not where it was put, on table"):
        let_go(stage)


def test_a_robot_without_a_camera_feels_that_it_stands_there(make_blind: MakeStage) -> None:
    stage = make_blind(*ROOM)
    lowered(stage)
    let_go(stage)
    assert stage.executive.held() == ()
    assert stage.truth.attached() == {}


class Dazzled(Decorated):
    """The camera shows nothing until an arm moves."""

    is_dazzled = True

    def start(self, group: str, trajectory: Trajectory, *, pushes: str | None = None) -> None:
        """Start a motion."""
        self.is_dazzled &= Group.of(group).kind is not GroupKind.ARMS
        self._robot.start(group, trajectory, pushes=pushes)

    def detect(self, camera_link: str) -> tuple[Detection, ...]:
        """Return what the camera recognises."""
        return () if self.is_dazzled else self._robot.detect(camera_link)

    def scan(self, camera_link: str) -> tuple[Array, NDArray[Any]]:
        """Return the depth image."""
        ends, which = self._robot.scan(camera_link)
        return (ends[:0], which[:0]) if self.is_dazzled else (ends, which)


def test_what_could_not_be_seen_is_looked_at_once_the_hand_has_drawn_back(make_stage: MakeStage) -> None:
    stage = make_stage(*ROOM)
    lowered(stage)
    stage.platform.world = Dazzled(stage.platform.world)
    let_go(stage, rolls)
    with pytest.raises(ObjectLost, match="bottle is not where it was put, on table"):
        stage.run(lambda: perform(action("Reaching", to_location=a_location(in_front_of=THE_BOTTLE))))


@pytest.mark.parametrize("happens", [rolls, falls_off])
def test_a_robot_without_a_camera_feels_that_it_has_left(
    make_blind: MakeStage, happens: Callable[[Truth], None]
) -> None:
    stage = make_blind(*ROOM)
    lowered(stage)
    with pytest.raises(ObjectLost, match="bottle is not where it was put, on table: no finger feels it"):
        let_go(stage, happens)
    assert stage.belief.looked_in_vain("bottle"), "so that it is felt for"
