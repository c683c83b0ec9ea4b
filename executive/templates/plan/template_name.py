"""template name: a plan written by hand, for any robot and any room.

``planlang run template_name.py --robot amigo --environment hospital_room`` runs it,
``python -m pytest test_template_name.py`` tests it in virtual time, without a robot.
"""

from functools import partial

from planlang import Recovery, achieve, at_location, holding, perform, plan
from planlang.designators import a_location, a_posture, action, an_object
from planlang.failures import GraspMissed

BOTTLE = an_object("DrinkingBottle")  # any bottle in the room
BEFORE_IT = a_location(in_front_of=BOTTLE)


@plan
async def grasp() -> None:
    """Reach for the bottle and close the hand; try again up to three times."""
    await perform(action("Reaching", to_location=BEFORE_IT), name="Approach")
    await perform(action("OpeningAGripper"), name="Open")
    await perform(action("Reaching", to_location=a_location(in_center_of=BOTTLE)), name="Reach")
    await perform(action("ClosingAGripper"), name="Close", recoveries=[Recovery(GraspMissed, retries=3)])
    await perform(action("Reaching", to_location=BEFORE_IT), name="Lift")
    await perform(action("Reaching", to_location=a_posture("carrying")), name="Carry")


@plan
async def template_name() -> None:
    """Drive to where the bottle is in reach, and grasp it unless the hand holds it already."""
    await at_location(a_location(in_reach_of=BOTTLE), partial(achieve, holding(BOTTLE), grasp))
