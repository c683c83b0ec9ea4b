"""Conditions about what actions change, in scripted runs of plans."""

from __future__ import annotations

from functools import partial

import pytest

from planlang import (
    PlanStructureError,
    achieve,
    action,
    an_object,
    baked,
    contains,
    created,
    destroyed,
    perform,
    switched_on,
    transformed_into,
)
from planlang.designators import Condition
from planlang.failures import GoalNotAchieved
from planlang.testing import Belief, Script, run_plan
from planlang.testing.scripted import ScriptedExecutive

EGG, DOUGH, BOWL, MILK, STOVE = map(an_object, ("Egg", "Dough", "Bowl", "Milk", "Stove"))


def changed() -> Belief:
    belief = Belief(contents={"Bowl": {"Milk": 200.0}}, heated={"Dough": (60.0, 30.0)}, on=["Stove"])
    belief.create("Yolk", "Egg")
    belief.create("Dough", "Yolk", "Flour")
    return belief


@pytest.mark.parametrize(
    ("condition", "holds"),
    [
        (contains(BOWL, MILK), True),
        (contains(BOWL, MILK, 200), True),
        (contains(BOWL, MILK, 200.5), False),
        (contains(BOWL, EGG), False),
        (baked(DOUGH), True),
        (baked(DOUGH, 30), True),
        (baked(DOUGH, 31), False),
        (baked(EGG), False),
        (switched_on(STOVE), True),
        (switched_on(BOWL), False),
        (destroyed(EGG), True),
        (destroyed(DOUGH), False),
        (created(DOUGH), True),
        (created(an_object("Yolk")), False),
        (transformed_into(EGG, DOUGH), True),
        (transformed_into(DOUGH, EGG), False),
        (transformed_into(DOUGH, DOUGH), False),
    ],
)
def test_a_scripted_belief_decides_what_actions_change(condition: Condition, holds: bool) -> None:
    assert changed().holds(condition) is holds
    belief = changed()
    belief.facts[str(condition)] = not holds
    assert belief.holds(condition) is not holds, "a stated fact counts more"


def test_a_plan_is_tested_for_what_it_brings_about() -> None:
    script = Script().performs("TurningOnPoweredDevice")
    script.on("Mixing", does=lambda belief, action: belief.create("Dough", "Egg", "Milk"))
    turn_on = partial(perform, action("TurningOnPoweredDevice", object_acted_on=STOVE))
    mix = partial(perform, action("Mixing", object_acted_on=(EGG, MILK)))

    async def cook() -> None:
        await achieve(switched_on(STOVE), turn_on)
        await achieve(created(DOUGH), mix)
        await achieve(created(DOUGH), mix)

    done = run_plan(cook, script=script)
    assert done.value is None
    assert (done.attempts("Mixing"), done.belief.gone, done.belief.on) == (1, ["Egg", "Milk"], ["Stove"])
    assert isinstance(run_plan(partial(achieve, baked(DOUGH), mix), script=script).failure, GoalNotAchieved)


def test_what_a_scripted_robot_changed_survives_a_snapshot() -> None:
    executive, other = ScriptedExecutive(Script()), ScriptedExecutive(Script())
    executive.belief.create("Dough", "Egg")
    executive.belief.contents["Bowl"] = {"Milk": 1.0}
    executive.belief.heated["Dough"] = (1.0, 2.0)
    executive.belief.on.append("Stove")
    other.restore(executive.snapshot())
    assert other.snapshot() == executive.snapshot()


@pytest.mark.parametrize("amount", [-1.0, float("nan"), "much"])
def test_what_is_no_amount_is_refused_with_the_right_call(amount: object) -> None:
    with pytest.raises(PlanStructureError, match="at_least"):
        contains(BOWL, MILK, amount)  # type: ignore[arg-type]
    with pytest.raises(PlanStructureError, match="an object"):
        baked("dough")  # type: ignore[arg-type]
