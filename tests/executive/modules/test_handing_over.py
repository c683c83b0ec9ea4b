"""Handing over: what is held is offered to a person, who takes it, or does not."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from planlang import perform
from planlang.designators import Location, a_location, a_person, action
from planlang.failures import ActionUnresolvable, GripperGoalNotReached, HandoverNotTaken, ObjectLost
from planlang.geometry import Pose
from sim import Body
from sim.truth import held_by
from tests.executive.conftest import (
    BOTTLE,
    CABINET,
    PATIENT,
    THE_BOTTLE,
    WARD,
    MakeStage,
    Stage,
    hold_bottle,
    stand,
)
from tests.support.detections import recognise
from tests.support.failing_robots import ClosedFingers, Decorated

OFFERED = a_location(in_reach_of=a_person("Patient"))
HAND_OVER = action("HandingOverAnObject", object_acted_on=THE_BOTTLE, recipient=a_person("Patient"))


@pytest.mark.parametrize("target", [a_location(in_reach_of=a_person("Patient")), a_person("Patient")])
def test_offering_to_a_patient_brings_the_bottle_into_their_comfort_zone(ward: Stage, target: Location) -> None:
    hold_bottle(ward)
    stand(ward, next(ward.resolver.bases(a_location(in_reach_of=OFFERED))).base)
    ward.run(lambda: perform(action("Reaching", to_location=target)))
    assert ward.truth.person("patient").contains(ward.truth.pose("bottle").position)
    assert held_by(ward.truth, "bottle") == "robot"


def offer(stage: Stage, arm: str) -> None:
    """The robot holds the bottle where the patient takes things."""
    hold_bottle(stage, arm)
    stand(stage, next(stage.resolver.bases(a_location(in_reach_of=OFFERED))).base)
    stage.run(lambda: perform(action("Reaching", to_location=OFFERED)))


def hand_over(stage: Stage) -> Any:
    """Perform the action; what it returns."""
    return stage.run(lambda: perform(HAND_OVER))


@pytest.mark.parametrize("arm", ["right", "left"])
def test_a_patient_takes_what_is_offered_and_the_gripper_opens(arm: str, ward: Stage) -> None:
    offer(ward, arm)
    assert hand_over(ward) == "patient"
    assert held_by(ward.truth, "bottle") == "patient"
    assert ward.executive.held() == ()
    gripper = ward.platform.robot.arm(arm).gripper
    assert gripper is not None
    joints = ward.truth.configuration().joints
    assert {name: joints[name] for name in gripper.joints} == pytest.approx(dict(gripper.opened))


def test_a_hand_that_has_handed_something_over_draws_straight_back_from_it(ward: Stage) -> None:
    offer(ward, "right")
    arm = ward.platform.scene.arms.all[0]
    before = ward.platform.scene.arms.tip(arm)
    hand_over(ward)
    moved = np.linalg.inv(before) @ ward.platform.scene.arms.tip(arm)
    assert moved[:3, 3] == pytest.approx(-0.12 * np.array(arm.frame.approach), abs=0.005)


def test_the_bottle_is_never_without_a_hand(ward: Stage) -> None:
    offer(ward, "right")
    holders, step = [], ward.truth.step

    def watched() -> None:
        step()
        holders.append(held_by(ward.truth, "bottle"))

    ward.truth.step = watched  # type: ignore[method-assign]
    hand_over(ward)
    assert None not in holders
    assert list(dict.fromkeys(holders)) == ["robot", "patient"]


def test_what_nobody_takes_stays_held_and_is_a_failure_that_names_it(make_stage: MakeStage) -> None:
    stage = make_stage(CABINET, BOTTLE)
    hold_bottle(stage)
    with pytest.raises(HandoverNotTaken) as caught:
        hand_over(stage)
    assert (caught.value.what, caught.value.recipient) == ("bottle", "Patient")
    assert held_by(stage.truth, "bottle") == "robot"
    assert stage.executive.held() == ("bottle",)
    assert stage.truth.steps >= 10 * stage.truth.rate, "the robot was patient"


def test_a_patient_far_away_does_not_take_it(ward: Stage) -> None:
    hold_bottle(ward)
    with pytest.raises(HandoverNotTaken):
        hand_over(ward)
    assert held_by(ward.truth, "bottle") == "robot"


def test_a_robot_knows_by_where_it_offers_something_who_takes_it(make_stage: MakeStage) -> None:
    visitor = replace(PATIENT, name="visitor", type="Visitor", pose=Pose((3.0, 4.0, 0.9)), size=(0.4, 0.5, 1.75))
    stage = make_stage(*WARD, visitor)
    offer(stage, "right")
    with pytest.raises(HandoverNotTaken, match="patient takes bottle instead of Visitor"):
        stage.run(
            lambda: perform(action("HandingOverAnObject", object_acted_on=THE_BOTTLE, recipient=a_person("Visitor")))
        )
    assert held_by(stage.truth, "bottle") == "robot"


def test_a_hand_that_does_not_open_still_holds_what_it_offers_and_hands_it_over_when_it_does(ward: Stage) -> None:
    offer(ward, "right")
    ward.platform.world = ClosedFingers(ward.platform.world)  # type: ignore[assignment]
    with pytest.raises(GripperGoalNotReached):
        hand_over(ward)
    assert ward.executive.held() == ("bottle",)
    assert held_by(ward.truth, "bottle") == "robot"
    assert hand_over(ward) == "patient"
    assert ward.executive.held() == ()


def test_an_empty_hand_hands_nothing_over(ward: Stage) -> None:
    with pytest.raises(ActionUnresolvable, match="no arm holds"):
        hand_over(ward)


def test_what_a_person_has_taken_is_out_of_the_planning_world(ward: Stage) -> None:
    offer(ward, "right")
    hand_over(ward)
    ward.platform.observe()
    assert "bottle" not in ward.planning.names()


class Dropped(Decorated):
    """What this robot lets go of, the person lets fall at once, or it is at a ``pose`` then."""

    def __init__(self, stage: Stage, pose: Pose | None = None) -> None:
        super().__init__(stage.truth)
        self._truth, self._pose = stage.truth, pose

    def loosen(self, link: str) -> None:
        """Let go of the bottle, which somebody has taken."""
        self._truth.loosen(link)
        self._truth.set_pose("bottle", self._pose or self._truth.pose("bottle"))
        if self._pose is None:
            self._truth.gravity.begin("bottle")


def test_a_robot_sees_that_a_person_has_not_kept_what_it_has_let_go_of(ward: Stage) -> None:
    offer(ward, "right")
    ward.platform.world = Dropped(ward)  # type: ignore[assignment]
    with pytest.raises(ObjectLost, match="bottle is no longer held by patient") as caught:
        hand_over(ward)
    assert caught.value.what == "bottle"
    assert "bottle" in ward.planning.names(), "where it lies, hands do not go through it"
    assert ward.belief.pose("bottle").distance(ward.truth.pose("bottle")) < 0.05


def test_a_robot_sees_through_where_a_person_should_hold_what_is_nowhere_in_sight(ward: Stage) -> None:
    offer(ward, "right")
    offered = ward.planning.pose("bottle").position[2]
    ward.platform.world = Dropped(ward, Pose((4.0, 4.0, 0.1)))  # type: ignore[assignment]
    with pytest.raises(ObjectLost, match=r"bottle is no longer held by patient$"):
        hand_over(ward)
    assert ward.belief.pose("bottle").position[2] < offered - 0.1, "it is believed to have fallen"


class Jolted(Decorated):
    """The wrist of this robot takes the swaying of its own arm for somebody who pulls."""

    def pulled(self, link: str) -> bool:
        """Feel a pull."""
        return True


def test_one_point_of_a_place_in_the_image_does_not_tell_that_the_place_is_empty(ward: Stage) -> None:
    camera, sensing = ward.platform.robot.camera, ward.platform.sensing
    assert camera is not None
    eye = ward.truth.link_pose(camera.link)
    ahead = [np.array(eye.position) + far * eye.rotation[:, 2] for far in (0.4, 0.41, 0.42)]
    behind = [np.array(eye.position) - far * eye.rotation[:, 2] for far in (0.4, 0.41, 0.42, 0.43, 0.44, 0.45)]
    assert sensing.seen_through(np.stack([*ahead, *behind]), 0.03) == 1.0
    assert sensing.seen_through(np.stack([*ahead[:1], *behind]), 0.03) < 0.5
    assert sensing.seen_through(np.stack(behind), 0.03) == 0.0


def test_a_robot_that_feels_a_pull_of_nobody_sees_that_nobody_has_taken_what_it_has_dropped(ward: Stage) -> None:
    offer(ward, "right")
    ward.platform.world = Jolted(ward.platform.world)  # type: ignore[assignment]
    with pytest.raises(ObjectLost, match="bottle is no longer held by patient"):
        hand_over(ward)
    assert held_by(ward.truth, "bottle") is None


def test_a_robot_that_looks_elsewhere_turns_its_neck_to_what_it_hands_over(ward: Stage) -> None:
    offer(ward, "right")
    point = np.array(ward.planning.pose("bottle").position)
    ward.run(lambda: ward.platform.sensing.look_at(np.array([0.0, 3.0, 1.0]), "the wall"))
    assert not ward.platform.sensing.frames(point, 1.0)
    hand_over(ward)
    assert ward.platform.sensing.frames(point, 1.0)


def test_what_hides_a_person_who_has_taken_something_is_no_failure(make_stage: MakeStage) -> None:
    screen = Body("screen", Pose((4.0, 4.0, 1.0)), (0.3, 0.3, 0.3), type="Box-Container", movable=True)
    stage = make_stage(*WARD, screen)
    offer(stage, "right")
    eye = np.array(stage.truth.link_pose(stage.platform.robot.body().camera.link).position)
    before = tuple((0.5 * (eye + np.array(stage.truth.pose("bottle").position))).tolist())

    class Hidden(Dropped):
        """The screen appears before the camera as the bottle falls."""

        def loosen(self, link: str) -> None:
            """Let go of the bottle, and hide it."""
            super().loosen(link)
            self._truth.set_pose("screen", Pose(before))

    stage.platform.world = Hidden(stage, Pose((4.0, -4.0, 0.1)))  # type: ignore[assignment]
    assert hand_over(stage) == "patient"


def test_a_robot_without_a_camera_believes_that_what_was_taken_was_kept(make_blind: MakeStage) -> None:
    stage = make_blind(*WARD)
    recognise(stage.belief, "patient", PATIENT.pose)
    offer(stage, "right")
    stage.platform.world = Dropped(stage)  # type: ignore[assignment]
    assert hand_over(stage) == "patient"
