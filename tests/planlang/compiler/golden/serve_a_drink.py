"""Serve a drink.

Compiled by planlang 0.1.0 from serve_a_drink.omn (sha256 7b3a485023f303a1), task ServeADrink.
What follows has sha256 f6cd8b94bd34cf021d076ecbdbacb5882b8e9d1e25a78d81d46b616a5a6fb8cb unless it was edited.
"""

from functools import partial

from planlang import Recovery, action, at_location, holding, perform, plan
from planlang.designators import Object, Person, a_device, a_location, a_person, a_posture, an_object
from planlang.failures import GraspMissed, ObjectLost, ObjectNotFound, ObjectNowhereToBeFound, ObjectUnfetchable
from planlang.recoveries import fetch_again, look_and_repeat, look_from_another_place

RECIPE = "http://planlang.org/kb/serve_a_drink.owl#"
HOSPITAL_ROOM = "http://planlang.org/kb/hospital_room.owl#"

BOTTLE = an_object("DrinkingBottle", HOSPITAL_ROOM + "bottle1")
PATIENT = a_person("Patient", HOSPITAL_ROOM + "patient1")
GRIPPER = a_device("HolderGripper", RECIPE + "gripper")
CARRYING = a_posture("carrying")


@plan(RECIPE + "GraspBottle")
async def grasp_bottle(*, bottle: Object = BOTTLE) -> None:
    """Grasp a bottle."""
    # where the hand waits before it grasps
    approach_pose = a_location("approachPose", in_front_of=bottle, using=GRIPPER)
    await perform(action("Reaching", to_location=approach_pose, device_used=GRIPPER), name="ApproachBottle")
    await perform(action("OpeningAGripper", device_used=GRIPPER), name="OpenGripper")
    # where the hand closes
    grasp_pose = a_location("graspPose", in_center_of=bottle, using=GRIPPER)
    await perform(action("Reaching", to_location=grasp_pose, device_used=GRIPPER), name="ReachForBottle")
    await perform(action("ClosingAGripper", device_used=GRIPPER), name="CloseGripper")
    # lift the bottle to where the hand came from
    await perform(action("Reaching", to_location=approach_pose, device_used=GRIPPER), name="LiftBottle")
    # bring the bottle close to the robot
    await perform(action("Reaching", to_location=CARRYING, device_used=GRIPPER), name="ParkArm")


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
            action("GraspingSomething", object_acted_on=bottle, device_used=GRIPPER),
            otherwise=partial(grasp_bottle, bottle=bottle),
            until=holding(bottle),
            recoveries=[Recovery(GraspMissed, look_and_repeat(bottle), attempts=2, otherwise=ObjectUnfetchable)],
        )

    fetch_bottle = partial(
        at_location,
        grasping_place,
        at_grasping_place,
        reaching=(approach_pose, grasp_pose),
        recoveries=[
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
        await perform(action("Reaching", to_location=handover_pose, device_used=GRIPPER), name="ReachToHandoverPose")
        # let go of the bottle when the patient has taken it
        await perform(
            action("HandingOverAnObject", object_acted_on=bottle, recipient=patient, device_used=GRIPPER),
            name="HandOverBottle",
        )

    await at_location(
        handover_place,
        at_handover_place,
        reaching=(handover_pose,),
        recoveries=[
            Recovery(ObjectNotFound, look_from_another_place(patient), attempts=3, otherwise=ObjectNowhereToBeFound),
            Recovery(ObjectLost, fetch_again(bottle, fetch_bottle), attempts=2, otherwise=ObjectUnfetchable),
        ],
    )
