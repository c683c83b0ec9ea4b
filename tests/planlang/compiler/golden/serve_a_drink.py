"""Serve a drink.

Compiled by planlang 0.1.0 from serve_a_drink.omn
(sha256 7b3a485023f303a13a87e153027044e51f9bb691197ef8d6ac64a6b13fde1f16), task
ServeADrink.
What follows has sha256
8a6e24d946351079220c1740613c56fa24777bab0966074b125c3be9fe136239 unless
somebody has edited it.
"""

from functools import partial

from planlang import (
    Location,
    Object,
    Person,
    Recovery,
    a_device,
    a_location,
    a_person,
    a_posture,
    action,
    action_class,
    an_object,
    at_location,
    fetch_again,
    holding,
    look_and_repeat,
    look_from_another_place,
    perform,
    plan,
)
from planlang.failures import (
    GraspMissed,
    ObjectLost,
    ObjectNotFound,
    ObjectNowhereToBeFound,
    ObjectUnfetchable,
)

RECIPE = "http://planlang.org/kb/serve_a_drink.owl#"
HOSPITAL_ROOM = "http://planlang.org/kb/hospital_room.owl#"

MOVE_BASE_TO_GRASP_POSE = action_class(
    RECIPE + "MoveBaseToGraspPose", below="Translation-LocationChange"
)
GRASP_BOTTLE = action_class(RECIPE + "GraspBottle", below="GraspingSomething")
MOVE_BASE_TO_HANDOVER_POSE = action_class(
    RECIPE + "MoveBaseToHandoverPose", below="Translation-LocationChange"
)
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


def approach_pose(bottle: Object) -> Location:
    """Where the hand waits before it grasps: in front of the bottle."""
    return a_location("approachPose", in_front_of=bottle, using=GRIPPER)


def grasp_pose(bottle: Object) -> Location:
    """Where the hand closes: at the centre of the bottle."""
    return a_location("graspPose", in_center_of=bottle, using=GRIPPER)


def grasping_place(bottle: Object) -> Location:
    """Where the base stands to grasp: in reach of the bottle."""
    return a_location("graspingPlace", in_reach_of=bottle, using=GRIPPER)


def handover_place(patient: Person) -> Location:
    """Where the base stands to hand over: in reach of the patient."""
    return a_location("handoverPlace", in_reach_of=patient, using=GRIPPER)


def handover_pose(patient: Person) -> Location:
    """Where the hand offers the bottle: in reach of the patient."""
    return a_location("handoverPose", in_reach_of=patient, using=GRIPPER)


@plan(RECIPE + "GraspBottle")
async def grasp_bottle(*, bottle: Object = BOTTLE) -> None:
    """Grasp a bottle."""
    await perform(
        action(APPROACH_BOTTLE, to_location=approach_pose(bottle), device_used=GRIPPER)
    )
    await perform(action(OPEN_GRIPPER, device_used=GRIPPER))
    await perform(
        action(REACH_FOR_BOTTLE, to_location=grasp_pose(bottle), device_used=GRIPPER)
    )
    await perform(action(CLOSE_GRIPPER, device_used=GRIPPER))
    # lift the bottle to where the hand came from
    await perform(
        action(LIFT_BOTTLE, to_location=approach_pose(bottle), device_used=GRIPPER)
    )
    # bring the bottle close to the robot
    await perform(action(PARK_ARM, to_location=CARRYING, device_used=GRIPPER))


@plan(RECIPE + "ServeADrink")
async def serve_a_drink(*, bottle: Object = BOTTLE, patient: Person = PATIENT) -> None:
    """Serve a drink."""

    async def fetch_bottle() -> None:
        # drive to where the bottle is in reach
        async def at_grasping_place() -> None:
            await perform(
                action(GRASP_BOTTLE, object_acted_on=bottle, device_used=GRIPPER),
                otherwise=partial(grasp_bottle, bottle=bottle),
                until=holding(bottle),
                recoveries=[
                    Recovery(
                        GraspMissed,
                        look_and_repeat(bottle),
                        attempts=2,
                        otherwise=ObjectUnfetchable,
                    ),
                ],
            )

        await at_location(
            grasping_place(bottle),
            at_grasping_place,
            attempts=5,
            reaching=(approach_pose(bottle), grasp_pose(bottle)),
            by=MOVE_BASE_TO_GRASP_POSE,
            recoveries=[
                Recovery(
                    ObjectNotFound,
                    look_from_another_place(bottle),
                    attempts=3,
                    otherwise=ObjectNowhereToBeFound,
                ),
                Recovery(
                    ObjectLost,
                    fetch_again(bottle),
                    attempts=2,
                    otherwise=ObjectUnfetchable,
                ),
            ],
        )

    await fetch_bottle()

    # drive to where the patient is in reach
    async def at_handover_place() -> None:
        # offer the bottle to the patient
        await perform(
            action(
                REACH_TO_HANDOVER_POSE,
                to_location=handover_pose(patient),
                device_used=GRIPPER,
            ),
        )
        # let go of the bottle when the patient has taken it
        await perform(
            action(
                HAND_OVER_BOTTLE,
                object_acted_on=bottle,
                recipient=patient,
                device_used=GRIPPER,
            ),
        )

    await at_location(
        handover_place(patient),
        at_handover_place,
        attempts=5,
        reaching=(handover_pose(patient),),
        by=MOVE_BASE_TO_HANDOVER_POSE,
        recoveries=[
            Recovery(
                ObjectNotFound,
                look_from_another_place(patient),
                attempts=3,
                otherwise=ObjectNowhereToBeFound,
            ),
            Recovery(
                ObjectLost,
                fetch_again(bottle, fetch_bottle),
                attempts=2,
                otherwise=ObjectUnfetchable,
            ),
        ],
    )
