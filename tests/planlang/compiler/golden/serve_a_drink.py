"""Serve a drink.

Compiled by planlang 0.1.0 from serve_a_drink.omn (sha256 7b3a485023f303a1), task ServeADrink.
What follows has sha256 f909253e44a6e2e3a5732b6e102e089ccdfab6c7f7a3faea8131b1467fd195c4 unless it was edited.
"""

from functools import partial

from planlang import Recovery, action, action_class, at_location, holding, perform, plan, with_failure_handling
from planlang.designators import Object, Person, a_device, a_location, a_person, a_posture, an_object
from planlang.failures import (
    AmbiguousPerception,
    GraspMissed,
    GraspSlipped,
    GripperGoalNotReached,
    HandoverNotTaken,
    LookingFailure,
    ManipulationGoalNotReached,
    ObjectLost,
    ObjectNotFound,
    ObjectUndeliverable,
    ObjectUnfetchable,
    ObjectUnreachable,
)
from planlang.recoveries import (
    fetch_again,
    look_and_repeat,
    look_by_moving_the_base,
    look_from_another_place,
    open_what_is_in_the_way,
    put_down_and_regrasp,
    step_back_and_repeat,
)

RECIPE = "http://planlang.org/kb/serve_a_drink.owl#"
HOSPITAL_ROOM = "http://planlang.org/kb/hospital_room.owl#"

HAND_OVER_BOTTLE = action_class(RECIPE + "HandOverBottle", below="HandingOverAnObject")

BOTTLE = an_object("DrinkingBottle", HOSPITAL_ROOM + "bottle1")
PATIENT = a_person("Patient", HOSPITAL_ROOM + "patient1")
GRIPPER = a_device("HolderGripper", RECIPE + "gripper")
CARRYING = a_posture("carrying")


@plan(RECIPE + "GraspBottle")
async def grasp_bottle(*, bottle: Object = BOTTLE) -> None:
    """Grasp a bottle."""
    # where the hand waits before it grasps
    approach_pose = a_location("approachPose", in_front_of=bottle, using=GRIPPER)
    await perform(
        action(RECIPE + "ApproachBottle", below="Reaching", to_location=approach_pose, device_used=GRIPPER),
        recoveries=[Recovery(ManipulationGoalNotReached, retries=3, within=120)],
    )
    await perform(
        action(RECIPE + "OpenGripper", below="OpeningAGripper", device_used=GRIPPER),
        recoveries=[Recovery(GripperGoalNotReached, retries=3, within=60)],
    )
    grasp_pose = a_location("graspPose", in_center_of=bottle, using=GRIPPER)  # where the hand closes
    await perform(
        action(RECIPE + "ReachForBottle", below="Reaching", to_location=grasp_pose, device_used=GRIPPER),
        recoveries=[Recovery(ManipulationGoalNotReached, retries=3, within=120)],
    )
    await perform(action(RECIPE + "CloseGripper", below="ClosingAGripper", device_used=GRIPPER))
    # lift the bottle to where the hand came from
    await perform(
        action(RECIPE + "LiftBottle", below="Reaching", to_location=approach_pose, device_used=GRIPPER),
        recoveries=[Recovery(ManipulationGoalNotReached, retries=3, within=120)],
    )
    # bring the bottle close to the robot
    await perform(
        action(RECIPE + "ParkArm", below="Reaching", to_location=CARRYING, device_used=GRIPPER),
        recoveries=[Recovery(ManipulationGoalNotReached, retries=3, within=120)],
    )


@plan(RECIPE + "ServeADrink")
async def serve_a_drink(*, bottle: Object = BOTTLE, patient: Person = PATIENT) -> None:
    """Serve a drink."""
    approach_pose = a_location("approachPose", in_front_of=bottle, using=GRIPPER)
    grasp_pose = a_location("graspPose", in_center_of=bottle, using=GRIPPER)

    # drive to where the bottle is in reach
    async def at_grasping_place() -> None:
        await perform(
            action(RECIPE + "GraspBottle", below="GraspingSomething", object_acted_on=bottle, device_used=GRIPPER),
            otherwise=partial(grasp_bottle, bottle=bottle),
            until=holding(bottle),
            recoveries=[
                Recovery(
                    (GraspMissed, GraspSlipped, GripperGoalNotReached),
                    look_and_repeat(bottle),
                    retries=2,
                    otherwise=ObjectUnfetchable,
                ),
            ],
        )

    fetch_bottle = partial(
        at_location,
        a_location("graspingPlace", in_reach_of=bottle, using=GRIPPER),  # where the base stands to grasp
        at_grasping_place,
        Recovery(ObjectUnreachable, open_what_is_in_the_way(bottle), retries=2),
        Recovery(ObjectNotFound, look_from_another_place(bottle), retries=3),
        Recovery((LookingFailure, AmbiguousPerception), look_by_moving_the_base(bottle), retries=2),
        Recovery(ObjectLost, fetch_again(bottle), retries=2),
        Recovery(ObjectUndeliverable, put_down_and_regrasp(bottle), retries=1),
        reaching=(approach_pose, grasp_pose),
        by=action_class(RECIPE + "MoveBaseToGraspPose", below="Translation-LocationChange"),
    )
    await fetch_bottle()

    handover_pose = a_location("handoverPose", in_reach_of=patient, using=GRIPPER)  # where the hand offers the bottle

    # drive to where the patient is in reach
    async def at_handover_place() -> None:
        # offer the bottle to the patient
        await perform(
            action(RECIPE + "ReachToHandoverPose", below="Reaching", to_location=handover_pose, device_used=GRIPPER),
            recoveries=[Recovery(ManipulationGoalNotReached, retries=3, within=120)],
        )
        # let go of the bottle when the patient has taken it
        await perform(
            action(HAND_OVER_BOTTLE, object_acted_on=bottle, recipient=patient, device_used=GRIPPER),
            recoveries=[
                Recovery(GripperGoalNotReached, retries=3, within=60),
                Recovery(HandoverNotTaken, retries=2, within=60),
            ],
        )

    await with_failure_handling(
        partial(
            at_location,
            a_location("handoverPlace", in_reach_of=patient, using=GRIPPER),  # where the base stands to hand over
            at_handover_place,
            Recovery(ObjectUndeliverable, open_what_is_in_the_way(patient), retries=2),
            Recovery(HandoverNotTaken, step_back_and_repeat(patient), retries=1),
            Recovery(ObjectNotFound, look_from_another_place(patient), retries=3),
            Recovery((LookingFailure, AmbiguousPerception), look_by_moving_the_base(patient), retries=2),
            Recovery(ObjectLost, fetch_again(bottle, fetch_bottle), retries=2),
            reaching=(handover_pose,),
            by=action_class(RECIPE + "MoveBaseToHandoverPose", below="Translation-LocationChange"),
        ),
        Recovery(ObjectUndeliverable, put_down_and_regrasp(bottle, fetch_bottle), retries=1),
    )
