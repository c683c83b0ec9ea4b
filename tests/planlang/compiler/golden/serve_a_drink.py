"""Serve a drink.

Compiled by planlang 0.1.0 from serve_a_drink.omn (sha256 7b3a485023f303a1), task ServeADrink.
What follows has sha256 a526605d9a095997dafb2d1f83f7c85dc52117dfc6dee8a1dd658e6be13db82e unless it was edited.
"""

from functools import partial

from planlang import Recovery, action, action_class, at_location, holding, perform, plan
from planlang.designators import Object, Person, a_device, a_location, a_person, a_posture, an_object
from planlang.failures import (
    GraspMissed,
    ObjectLost,
    ObjectNotFound,
    ObjectNowhereToBeFound,
    ObjectUnfetchable,
    ObjectUnreachable,
)
from planlang.recoveries import fetch_again, look_and_repeat, look_from_another_place, open_what_is_in_the_way

RECIPE = "http://planlang.org/kb/serve_a_drink.owl#"
HOSPITAL_ROOM = "http://planlang.org/kb/hospital_room.owl#"

MOVE_BASE_TO_GRASP_POSE = action_class(RECIPE + "MoveBaseToGraspPose", below="Translation-LocationChange")
GRASP_BOTTLE = action_class(RECIPE + "GraspBottle", below="GraspingSomething")
MOVE_BASE_TO_HANDOVER_POSE = action_class(RECIPE + "MoveBaseToHandoverPose", below="Translation-LocationChange")
REACH_TO_HANDOVER_POSE = action_class(RECIPE + "ReachToHandoverPose", below="Reaching")
HAND_OVER_BOTTLE = action_class(RECIPE + "HandOverBottle", below="HandingOverAnObject")
APPROACH_BOTTLE = action_class(RECIPE + "ApproachBottle", below="Reaching")
OPEN_GRIPPER = action_class(RECIPE + "OpenGripper", below="OpeningAGripper")
REACH_FOR_BOTTLE = action_class(RECIPE + "ReachForBottle", below="Reaching")
CLOSE_GRIPPER = action_class(RECIPE + "CloseGripper", below="ClosingAGripper")
LIFT_BOTTLE = action_class(RECIPE + "LiftBottle", below="Reaching")
PARK_ARM = action_class(RECIPE + "ParkArm", below="Reaching")

BOTTLE = an_object("DrinkingBottle", HOSPITAL_ROOM + "bottle1")
PATIENT = a_person("Patient", HOSPITAL_ROOM + "patient1")
GRIPPER = a_device("HolderGripper", RECIPE + "gripper")
CARRYING = a_posture("carrying")


@plan(RECIPE + "GraspBottle")
async def grasp_bottle(*, bottle: Object = BOTTLE) -> None:
    """Grasp a bottle."""
    # where the hand waits before it grasps
    approach_pose = a_location("approachPose", in_front_of=bottle, using=GRIPPER)
    await perform(action(APPROACH_BOTTLE, to_location=approach_pose, device_used=GRIPPER))
    await perform(action(OPEN_GRIPPER, device_used=GRIPPER))
    # where the hand closes
    grasp_pose = a_location("graspPose", in_center_of=bottle, using=GRIPPER)
    await perform(action(REACH_FOR_BOTTLE, to_location=grasp_pose, device_used=GRIPPER))
    await perform(action(CLOSE_GRIPPER, device_used=GRIPPER))
    # lift the bottle to where the hand came from
    await perform(action(LIFT_BOTTLE, to_location=approach_pose, device_used=GRIPPER))
    # bring the bottle close to the robot
    await perform(action(PARK_ARM, to_location=CARRYING, device_used=GRIPPER))


@plan(RECIPE + "ServeADrink")
async def serve_a_drink(*, bottle: Object = BOTTLE, patient: Person = PATIENT) -> None:
    """Serve a drink."""
    # where the base stands to grasp
    grasping_place = a_location("graspingPlace", in_reach_of=bottle, using=GRIPPER)
    approach_pose = a_location("approachPose", in_front_of=bottle, using=GRIPPER)
    grasp_pose = a_location("graspPose", in_center_of=bottle, using=GRIPPER)

    # drive to where the bottle is in reach
    async def at_grasping_place() -> None:
        await perform(
            action(GRASP_BOTTLE, object_acted_on=bottle, device_used=GRIPPER),
            otherwise=partial(grasp_bottle, bottle=bottle),
            until=holding(bottle),
            recoveries=[Recovery(GraspMissed, look_and_repeat(bottle), attempts=2, otherwise=ObjectUnfetchable)],
        )

    fetch_bottle = partial(
        at_location,
        grasping_place,
        at_grasping_place,
        reaching=(approach_pose, grasp_pose),
        by=MOVE_BASE_TO_GRASP_POSE,
        recoveries=[
            Recovery(ObjectUnreachable, open_what_is_in_the_way(bottle), attempts=2),
            Recovery(ObjectNotFound, look_from_another_place(bottle), attempts=3, otherwise=ObjectNowhereToBeFound),
            Recovery(ObjectLost, fetch_again(bottle), attempts=2, otherwise=ObjectUnfetchable),
        ],
    )
    await fetch_bottle()

    # where the base stands to hand over
    handover_place = a_location("handoverPlace", in_reach_of=patient, using=GRIPPER)
    # where the hand offers the bottle
    handover_pose = a_location("handoverPose", in_reach_of=patient, using=GRIPPER)

    # drive to where the patient is in reach
    async def at_handover_place() -> None:
        # offer the bottle to the patient
        await perform(action(REACH_TO_HANDOVER_POSE, to_location=handover_pose, device_used=GRIPPER))
        # let go of the bottle when the patient has taken it
        await perform(action(HAND_OVER_BOTTLE, object_acted_on=bottle, recipient=patient, device_used=GRIPPER))

    await at_location(
        handover_place,
        at_handover_place,
        reaching=(handover_pose,),
        by=MOVE_BASE_TO_HANDOVER_POSE,
        recoveries=[
            Recovery(ObjectNotFound, look_from_another_place(patient), attempts=3, otherwise=ObjectNowhereToBeFound),
            Recovery(ObjectLost, fetch_again(bottle, fetch_bottle), attempts=2, otherwise=ObjectUnfetchable),
        ],
    )
