from functools import partial

import pytest

from planlang import Recovery, achieve, at_location, holding, par, perform, plan
from planlang.designators import a_location, a_person, a_posture, action, an_object
from planlang.failures import ContainerStuck, GraspSlipped, HandoverNotTaken, ObjectUndeliverable
from planlang.testing import explore

BOTTLE, DOOR, PATIENT = an_object("DrinkingBottle"), an_object("Door"), a_person("Patient")


@plan
async def fetch():
    await perform(action("GraspingSomething", object_acted_on=BOTTLE), name="Grasp")
    await perform(action("Reaching", to_location=a_posture("carrying")), name="Lift")


@plan
async def serve():
    door = action("OpeningADoor", object_acted_on=DOOR)
    give = action("HandingOverAnObject", object_acted_on=BOTTLE, recipient=PATIENT)
    stuck = Recovery(ContainerStuck, retries=9, within=20)
    refused = Recovery(HandoverNotTaken, otherwise=ObjectUndeliverable)
    await par(
        fetching=partial(achieve, holding(BOTTLE), fetch, Recovery(GraspSlipped, retries=2)),
        door=partial(perform, door, name="OpenDoor", recoveries=[stuck]),
    )
    await at_location(a_location(in_reach_of=PATIENT), partial(perform, give, name="Offer"), refused)


@pytest.fixture
def script(script):
    return script.performs("GraspingSomething")


def test_a_bottle_that_slips_is_grasped_again(scripted_run, script):
    script.on("Lift", fails=GraspSlipped, after=0.5, times=1, does=lambda belief, action: belief.drop())
    run = scripted_run(serve)
    assert run.attempts("Grasp") == 2 and run.failed_with("fetch", GraspSlipped)
    assert run.belief.at == {"DrinkingBottle": "Patient"}


def test_the_robot_leaves_when_a_late_door_is_open_and_fetches_meanwhile(scripted_run, script):
    script.on("OpenDoor", fails=ContainerStuck, until=5)
    run = scripted_run(serve)
    assert run.attempts("OpenDoor") == 5 and run.overlapped("fetching", "door")
    assert run.happened_before("OpenDoor#5", "Translation-LocationChange")


def test_a_patient_who_does_not_take_it_is_asked_twice_whatever_the_schedule(script):
    script.on("Offer", fails=HandoverNotTaken, after=10)

    def check(run):
        assert isinstance(run.failure, ObjectUndeliverable) and run.attempts("Offer") == 2
        assert run.never("OpeningAGripper") and run.belief.holding == ["DrinkingBottle"]

    explore(serve, schedules=50, check=check, script=script)
