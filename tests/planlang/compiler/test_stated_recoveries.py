"""Recoveries that recipes state, and those that go back to a grasp, in compiled plans."""

from typing import Any

import pytest
from plan_text import unbroken
from small_recipes import body, orderings, step, task


def test_recovery_stated_in_the_recipe_replaces_the_inherited_one(compiled: Any) -> None:
    plan = compiled(
        task("Serve", "Close"),
        step("Close", "k:ClosingAGripper", "k:objectActedOn value room:bottle1"),
        "Individual: again\n    Types: k:Recovery\n"
        "    Facts: k:recoversAction Close, k:recoversFailure k:GraspMissed, k:strategy k:Repeat, k:attempts 4",
    )
    assert "Recovery(GraspMissed, retries=4)" in plan.source
    assert "Recovery((GraspSlipped, GripperGoalNotReached), look_and_repeat(bottle)" in unbroken(plan.source)


def test_recovery_with_no_attempts_is_switched_off(compiled: Any) -> None:
    plan = compiled(
        task("Serve", "Close"),
        step("Close", "k:ClosingAGripper", "k:objectActedOn value room:bottle1"),
        "Individual: never\n    Types: k:Recovery\n"
        "    Facts: k:recoversAction Close, k:recoversFailure k:GraspMissed, k:strategy k:Repeat, k:attempts 0",
    )
    assert "GraspMissed" not in plan.source


@pytest.mark.parametrize(
    ("stated", "written"),
    [
        ("k:strategy k:FetchAgain, k:escalatesTo k:ObjectUnfetchable", "fetch_again(bottle), retries=2)"),
        ("k:strategy k:FetchAgain", "fetch_again(bottle), retries=2, otherwise=None)"),
        ("k:strategy k:Repeat", "retries=2)"),
        ("k:strategy k:Repeat, k:escalatesTo k:ObjectUnfetchable", "retries=2, otherwise=ObjectUnfetchable)"),
    ],
)
def test_last_failure_is_written_unless_the_strategy_says_it(compiled: Any, stated: str, written: str) -> None:
    plan = compiled(
        task("Serve", "Close"),
        step("Close", "k:ClosingAGripper", "k:objectActedOn value room:bottle1"),
        f"Individual: again\n    Types: k:Recovery\n    Facts: k:recoversAction Close, k:attempts 2, {stated},"
        " k:recoversFailure k:GraspMissed",
    )
    assert f"Recovery(GraspMissed, {written}" in unbroken(plan.source)


@pytest.mark.parametrize(("stated", "written"), [("0", "1"), ("2", "2")])
def test_number_of_places_that_a_scope_tries_is_that_of_the_recipe(compiled: Any, stated: str, written: str) -> None:
    failures = "NavigationFailure ManipulationPoseUnreachable ManipulationGoalInCollision LookingGoalUnreachable"
    plan = compiled(
        task("Serve", "Drive Look", constraints=1),
        orderings("Drive<Look"),
        step("Drive", "k:Translation-LocationChange", "k:toLocation value room:bottle1"),
        step("Look", "k:LookingForSomething"),
        "Individual: places\n    Types: k:Recovery\n"
        f"    Facts: k:recoversAction Drive, k:strategy k:NextSolution, k:attempts {stated}"
        + "".join(f", k:recoversFailure k:{failure}" for failure in failures.split()),
    )
    assert f"at_near_bottle, attempts={written}, by=" in unbroken(plan.source)


def test_task_that_is_run_by_itself_has_its_own_recoveries(compiled: Any) -> None:
    plan = compiled(
        task("Grasp", "Close", "k:objectActedOn value room:bottle1", above="k:GraspingSomething"),
        step("Close", "k:ClosingAGripper", "k:objectActedOn value room:bottle1"),
    )
    assert "async def grasp_once() -> None:" in body(plan, "grasp")
    assert unbroken(plan.source).count("Recovery((GraspMissed,") == 1


def carrying(*after: str) -> tuple[str, ...]:
    """Statements of a recipe that grasps the bottle at one place, and then has further steps in order."""
    names = "Drive", "Grasp", *(line.split()[1] for line in after)
    return (
        task("Serve", " ".join(names), constraints=len(names) * (len(names) - 1) // 2),
        orderings(*(f"{one}<{other}" for number, one in enumerate(names) for other in names[number + 1 :])),
        step("Drive", "k:Translation-LocationChange", "k:toLocation value room:bottle1"),
        task("Grasp", "Close", "k:objectActedOn value room:bottle1", above="k:GraspingSomething"),
        step("Close", "k:ClosingAGripper"),
        *after,
    )


def test_steps_between_a_grasp_and_the_release_go_back_to_the_grasp_when_the_thing_is_lost(compiled: Any) -> None:
    away = step("Away", "k:Translation-LocationChange", "k:toLocation value room:patient1")
    give = step("Give", "k:HandingOverAnObject", "k:objectActedOn value room:bottle1")
    back = step("Back", "k:Translation-LocationChange", "k:toLocation value room:cup1")
    text = unbroken(compiled(*carrying(away, give, back), scopes=False).source)
    assert "fetch_bottle = partial(perform," in text
    assert text.count("Recovery(ObjectLost, fetch_again(bottle), retries=2") == 1, "around the grasp itself"
    assert text.count("Recovery(ObjectLost, fetch_again(bottle, fetch_bottle), retries=2") == 2
    after_giving = text[text.index("perform(action(RECIPE + 'Give'") :].splitlines()[1:]
    assert [line for line in after_giving if "ObjectLost" in line] == [], "let go"


def test_letting_go_of_another_thing_leaves_the_first_one_watched(compiled: Any) -> None:
    give = step("Give", "k:HandingOverAnObject", "k:objectActedOn value room:cup1")
    look = step("Look", "k:LookingForSomething")
    text = unbroken(compiled(*carrying(give, look), scopes=False).source)
    assert text.count("fetch_again(bottle, fetch_bottle)") == 2


def test_a_recovery_that_moves_the_base_surrounds_one_for_the_same_failure_that_stays_in_place(compiled: Any) -> None:
    plan = compiled(
        task("Serve", "Offer"),
        step("Offer", "k:HandingOverAnObject", "k:objectActedOn value room:bottle1", "k:recipient value room:patient1"),
    )
    source = unbroken(plan.source)
    inside, _, around = source.partition("Recovery(HandoverNotTaken, step_back_and_repeat(patient), retries=1)")
    assert inside.count("with_failure_handling(") == 1
    assert "Recovery(HandoverNotTaken, retries=2, within=60)" in inside
    assert "Recovery(" not in around
