"""template name: a plan written by hand. ``planlang run template_name.py --environment kitchenette`` runs it.

Run ``python -m pytest test_template_name.py`` to test it, in virtual time and without a robot.
"""

from functools import partial

from planlang import Recovery, achieve, at_location, holding, perform, plan
from planlang.designators import a_location, action, an_object
from planlang.failures import GraspMissed

# Things by their class: the plan names no room and no robot.
BOTTLE = an_object("DrinkingBottle")


@plan
async def take_it() -> None:
    """Pick the bottle up; if the fingers close on nothing, look and try again."""
    take = action("PickingUpAnObject", object_acted_on=BOTTLE)
    await perform(take, name="Take", recoveries=[Recovery(GraspMissed, attempts=3)])


@plan
async def template_name() -> None:
    """Go where the bottle is in reach, and take it unless the hand has it already."""
    await at_location(a_location(in_reach_of=BOTTLE), partial(achieve, holding(BOTTLE), take_it))
