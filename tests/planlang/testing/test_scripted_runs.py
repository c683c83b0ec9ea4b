"""Scripted robots: what process modules do when a test says so, and what plans do with it."""

from __future__ import annotations

from copy import deepcopy
from functools import partial

import pytest

from planlang import *
from planlang.diagnostics import BadInput
from planlang.failures import (
    ActionUnresolvable,
    GoalNotAchieved,
    GraspMissed,
    GraspSlipped,
    HandoverNotTaken,
    ManipulationPoseUnreachable,
    NavigationGoalNotReached,
    NavigationPoseUnreachable,
    ObjectUndeliverable,
    ObjectUnfetchable,
    ObjectUnreachable,
)
from planlang.files import bundled
from planlang.testing import Belief, Fault, Script, UnusedRule, compiled, explore, run_plan
from planlang.testing.scripted import ScriptedExecutive
from tests.support.refusals import failing

BOTTLE = an_object("DrinkingBottle", "http://example.org/map#bottle1")
PATIENT = a_person("Patient", "http://example.org/map#patient1")
reach = partial(perform, action("Reaching", to_location=a_location(in_center_of=BOTTLE)))
close = partial(perform, action("ClosingAGripper"))
give = partial(perform, action("HandingOverAnObject", object_acted_on=BOTTLE, recipient=PATIENT))
serve_a_drink = compiled("serve_a_drink")


def test_a_plan_that_succeeds_has_a_value_and_a_failing_one_raises_its_failure_when_asked_for_it() -> None:
    async def good() -> int:
        await sleep(2)
        return 7

    async def bad() -> int:
        raise GraspMissed(what="cup")

    run = run_plan(good)
    assert (run.value, run.failure, run.seconds) == (7, None, 2.0)
    failed = run_plan(bad)
    assert isinstance(failed.failure, GraspMissed)
    with failing(GraspMissed, what="cup"):
        _ = failed.value


def test_what_is_no_plan_failure_is_raised_at_once() -> None:
    async def mistaken() -> None:
        raise KeyError("mistake")

    async def stuck() -> None:
        await tag("forever", partial(wait_for, Fluent(False)))

    with pytest.raises(KeyError, match="mistake"):
        run_plan(mistaken)
    with pytest.raises(DeadlockError):
        run_plan(stuck, within=10)
    with pytest.raises(StepLimit):
        run_plan(partial(sleep, 11), within=10)


def test_the_compiled_plan_of_a_recipe_serves_the_drink_without_a_robot() -> None:
    run = run_plan(serve_a_drink)
    assert run.failure is None
    assert run.belief.at == {"bottle1": "patient1"}
    assert run.belief.holding == []
    assert run.happened_before("grasp_bottle", "HandOverBottle")
    assert run.unused == ()


def test_a_rule_fails_a_number_of_times_after_a_time_then_the_action_succeeds() -> None:
    script = Script().on("Reaching", fails=ManipulationPoseUnreachable, times=2, after=1.5)

    async def main() -> None:
        await with_failure_handling(reach, Recovery(ManipulationPoseUnreachable, retries=3))

    run = run_plan(main, script=script)
    assert run.attempts("Reaching") == 3
    assert run.seconds == 1.5 + 1.5 + 1.0
    again = run_plan(main, script=script)
    assert again.trace.text() == run.trace.text(), "a script is as good as new in each run"


def test_the_first_rule_that_applies_counts_and_steps_are_told_by_name_or_class() -> None:
    script = Script(takes=0.25)
    script.on("left", returns="by name").on("Reaching", returns="by class")

    async def main() -> list[object]:
        return [await reach(name="left"), await reach(name="right"), await close()]

    run = run_plan(main, script=script)
    assert run.value == ["by name", "by class", None]
    assert run.seconds == 0.75


def test_a_rule_holds_from_one_time_until_another() -> None:
    script = Script().on("Reaching", fails=ManipulationPoseUnreachable, since=1, until=2)

    async def main() -> None:
        for _ in range(3):
            await reach()

    run = run_plan(main, script=script)
    assert isinstance(run.failure, ManipulationPoseUnreachable)
    assert run.attempts("Reaching") == 2


def test_failures_are_made_by_class_by_function_or_after_an_example() -> None:
    example = GraspMissed(what="cup")
    makers = (GraspMissed, lambda: GraspMissed(what="cup"), example)
    for fails in makers:
        script = Script().on("ClosingAGripper", fails=fails)

        async def main() -> None:
            await with_failure_handling(close, Recovery(GraspMissed, retries=1))

        failure = run_plan(main, script=script).failure
        assert isinstance(failure, GraspMissed)
        assert failure is not example
        assert fails is GraspMissed or failure.what == "cup"


def test_a_side_effect_changes_the_belief_and_gives_the_result() -> None:
    async def slowly(belief: Belief, action: Action) -> str:
        await sleep(3)
        belief.at["door"] = "open"
        return f"done {action.type}"

    script = Script().on("OpeningADoor", does=slowly)

    async def main() -> str:
        return str(await perform(action("OpeningADoor")))

    run = run_plan(main, script=script)
    assert run.value == "done OpeningADoor"
    assert run.belief.at == {"door": "open"}
    assert run.seconds == 4.0
    assert [event["at"] for event in run.events if event["event"] == "belief"] == [{"door": "open"}]


def test_hands_hold_what_they_close_around_until_it_is_taken() -> None:
    seen: list[tuple[bool, ...]] = []

    async def main() -> None:
        await reach()
        await close()
        await perform(action("Reaching", to_location=a_posture("carrying")))
        await give()

    def look(belief: Belief, action: Action) -> None:
        seen.append((belief.holds(holding(BOTTLE)), belief.holds(holding(PATIENT))))

    script = Script().on("HandingOverAnObject", does=lambda b, a: look(b, a)).on("Reaching", does=look)
    run_plan(main, script=script)
    assert seen == [(False, False), (True, False), (False, False)]


def test_beliefs_are_compared_by_what_is_believed() -> None:
    async def grasp() -> None:
        await perform(action("ClosingAGripper", object_acted_on=BOTTLE))

    async def release() -> None:
        await grasp()
        await perform(action("OpeningAGripper", object_acted_on=BOTTLE))

    held, again, released = (run_plan(one).belief for one in (grasp, grasp, release))
    assert held == again == deepcopy(held)
    assert held != released == Belief()
    again.drop()
    assert held != again


def test_belief_at_the_beginning_is_what_the_script_says() -> None:
    script = Script().holding(BOTTLE, "cup").at(bottle1="hand").fact("open(fridge1)")
    belief = script.belief()
    assert belief.holding == ["bottle1", "cup"]
    assert belief.at == {"bottle1": "hand"}
    assert belief.facts == {"open(fridge1)": True}
    belief.drop("cup")
    assert script.belief().holding == ["bottle1", "cup"]
    revision = belief.revision
    assert belief.revision == revision
    belief.drop()
    assert belief.revision == revision + 1


def test_places_are_those_of_the_script_by_location_or_by_what_it_is_about() -> None:
    async def main() -> None:
        await at_location(a_location("besideTable", in_reach_of=BOTTLE), reach)

    for key in ("besideTable", "bottle1", BOTTLE):
        run = run_plan(main, script=Script().places(key, (3.0, 4.0, 0.5)))
        assert run.belief.base == (3.0, 4.0, 0.5)
    nowhere = run_plan(main, script=Script().places("bottle1"))
    assert isinstance(nowhere.failure, ObjectUnreachable)


def test_a_door_that_opens_late_lets_the_robot_through_at_a_later_attempt() -> None:
    script = Script().on("Translation-LocationChange", fails=NavigationPoseUnreachable, until=1.5)
    run = run_plan(serve_a_drink, script=script)
    assert run.failure is None
    assert run.attempts("Translation-LocationChange") == 4


def test_a_bottle_that_is_always_missed_is_unfetchable() -> None:
    run = run_plan(serve_a_drink, script=Script().on("CloseGripper", fails=GraspMissed))
    assert isinstance(run.failure, ObjectUnfetchable)
    assert run.attempts("CloseGripper") == 3
    assert run.never("HandOverBottle")


def test_a_bottle_that_slips_each_time_is_unfetchable() -> None:
    script = Script().on("LiftBottle", fails=GraspSlipped, does=lambda belief, action: belief.drop())
    run = run_plan(serve_a_drink, script=script)
    assert isinstance(run.failure, ObjectUnfetchable)
    assert isinstance(run.failure.__cause__, GraspSlipped)
    assert run.attempts("LiftBottle") == 3
    assert run.belief.holding == []


def test_a_patient_out_of_reach_with_the_bottle_in_hand_is_undeliverable() -> None:
    script = Script().on("ReachToHandoverPose", fails=ManipulationPoseUnreachable)
    run = run_plan(serve_a_drink, script=script)
    assert isinstance(run.failure, ObjectUndeliverable)
    assert run.attempts("SettingAsideAnObject") == 1
    assert run.attempts("ReachToHandoverPose") == 2 * 3, "as many as there are places, with each of two grips"


def test_a_patient_who_does_not_take_it_leaves_the_bottle_in_the_hand() -> None:
    run = run_plan(serve_a_drink, script=Script().on("HandOverBottle", fails=HandoverNotTaken, after=10))
    assert isinstance(run.failure, HandoverNotTaken)
    assert run.belief.holding == ["bottle1"]


def test_one_module_does_one_thing_at_a_time_and_different_ones_work_side_by_side() -> None:
    left, right = a_device("LeftGripper"), a_device("RightGripper")

    async def main() -> None:
        await par(
            a=partial(perform, action("Reaching", device_used=left)),
            b=partial(perform, action("Reaching", device_used=right)),
            c=partial(perform, action("LookingForSomething", object_acted_on=BOTTLE)),
        )

    assert run_plan(main).seconds == 2.0


def test_suspension_cancels_and_repeats_the_request() -> None:
    script = Script().on("Reaching", after=2, returns="there")

    async def main() -> object:
        arm = partial(tag, "arm", reach)

        async def pause() -> None:
            from planlang import task

            await sleep(1)
            suspend(task("arm"))
            await sleep(1)
            wake_up(task("arm"))

        return (await par(arm, pause))[0]

    run = run_plan(main, script=script)
    assert run.value == "there"
    assert run.seconds == 4.0


def test_what_nothing_performs_is_unresolvable_until_the_script_says_so() -> None:
    async def main() -> None:
        await perform(action("http://knowrob.org/kb/knowrob.owl#Pouring"))

    assert isinstance(run_plan(main).failure, ActionUnresolvable)
    assert run_plan(main, script=Script().performs("Pouring")).failure is None
    assert run_plan(main, script=Script().on("Pouring")).failure is None
    above = Script(ancestors={"Pouring": ["ManipulatingSomething"]}).performs("ManipulatingSomething")
    assert run_plan(main, script=above).failure is None


def test_a_rule_that_never_applied_is_told() -> None:
    script = Script().on("Reachin", fails=ManipulationPoseUnreachable, times=1).fault("nothing", GraspMissed)
    run = run_plan(reach, script=script, allow_unused=True)
    assert run.unused == (
        "rule Reachin fails with ManipulationPoseUnreachable, 1 times",
        "fault GraspMissed in nothing, attempt 1",
    )
    assert "never applied: rule Reachin" in run.tree()


def test_a_rule_for_a_step_that_does_not_occur_fails_the_test_with_the_name_that_may_be_meant() -> None:
    script = Script().on("Reachin", fails=ManipulationPoseUnreachable, times=1).fault("reech", GraspMissed)
    script.on("Reaching", until=-1)  # of a step that occurs, though not in this time
    with pytest.raises(UnusedRule) as caught:
        run_plan(reach, script=script)
    assert str(caught.value).splitlines() == [
        "the script names steps that did not occur:",
        "  rule Reachin fails with ManipulationPoseUnreachable, 1 times; did you mean 'Reaching'?",
        "  fault GraspMissed in reech, attempt 1",
        "<run of perform: returned None after 1 s>; allow_unused=True permits it",
    ]
    with pytest.raises(UnusedRule, match=r"rule Reachin(.|\n)*allow_unused"):
        explore(reach, script=script)
    assert explore(reach, script=script, allow_unused=True).complete


def test_a_rule_for_a_step_that_a_failing_plan_does_not_come_to_is_no_error_unless_it_looks_misspelt() -> None:
    async def main() -> None:
        await reach()
        await close()

    script = Script().on("Reaching", fails=ManipulationPoseUnreachable).on("ClosingAGripper", after=2)
    assert isinstance(run_plan(main, script=script).failure, ManipulationPoseUnreachable)
    with pytest.raises(UnusedRule, match="rule Reachingg; did you mean 'Reaching'"):
        run_plan(main, script=script.on("Reachingg"))


def test_a_rule_that_is_used_under_some_schedules_is_used() -> None:
    async def main() -> None:
        door = Fluent(False, "door")

        async def opens() -> None:
            await checkpoint()
            door.set(True)

        async def looks() -> None:
            await checkpoint()
            if door.value:
                await perform(action("LookingAtSomething"))

        await par(looks, opens)

    script = Script().on("LookingAtSomething", after=0.5)
    with pytest.raises(UnusedRule):
        run_plan(main, script=script)
    assert explore(main, script=script, check=lambda run: None).complete


def test_a_rule_that_applies_no_times_never_applies() -> None:
    run = run_plan(reach, script=Script().on("Reaching", fails=GraspMissed, times=0).on("Grasping", times=0))
    assert run.failure is None
    assert run.unused == ()


@pytest.mark.parametrize("wrong", [{"after": -1}, {"after": float("nan")}, {"times": -1}, {"times": 1.5}])
def test_senseless_rules_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises((TypeError, ValueError), match=r"of script.on has to be") as caught:
        Script().on("Reaching", **wrong)  # type: ignore[arg-type]
    assert str(caught.value).count("\n") == 2


def test_what_was_put_down_is_where_it_was_lowered_to() -> None:
    run = run_plan(compiled("carry_the_tray"))
    assert run.belief.at == {"tray1": "tea_table1"}
    assert run.belief.holding == []
    tray, table, floor = an_object("Tray", "#tray1"), an_object("Table", "#tea_table1"), an_object("Floor")
    assert run.belief.holds(located(a_location(on=table), tray))
    assert not run.belief.holds(located(a_location(on=floor), tray))
    assert not run.belief.holds(located(a_location(on=table)))


def test_what_is_grasped_again_is_at_no_place_and_what_is_dropped_is_where_nobody_said() -> None:
    async def main() -> None:
        cup, table = an_object("Cup"), an_object("Table")
        await perform(action("PickingUpAnObject", object_acted_on=cup))
        await perform(action("PuttingDownAnObject", object_acted_on=cup, to_location=a_location(on=table)))
        assert belief().at == {"Cup": "Table"}
        await perform(action("PickingUpAnObject", object_acted_on=cup))
        assert belief().at == {}
        await perform(action("LoweringAnObject", to_location="the floor"))
        assert belief().at == {}
        await perform(action("OpeningAGripper"))
        assert belief().at == {"Cup": "the floor"}
        await perform(action("PickingUpAnObject", object_acted_on=cup))
        await perform(action("LoweringAnObject"))
        await perform(action("OpeningAGripper"))

    def belief() -> Belief:
        return executive.belief

    executive = ScriptedExecutive(Script().performs("PickingUpAnObject", "PuttingDownAnObject"))
    assert run_plan(main, executive=executive).failure is None
    assert belief().at == {}
    assert belief().holding == []


def test_a_failure_between_places_is_one_of_the_script() -> None:
    script = Script().on("Translation-LocationChange", fails=NavigationGoalNotReached, times=1)

    async def main() -> None:
        await at_location(a_location(in_reach_of=BOTTLE), reach)

    run = run_plan(main, script=script)
    assert run.failure is None
    assert run.belief.base == (11.0, 0.0, 0.0)


def test_a_plan_runs_with_an_executive_of_its_own_which_then_has_the_belief() -> None:
    executive = ScriptedExecutive(Script().on("Reaching", returns="there"))
    run = run_plan(reach, executive=executive, faults=[Fault("nothing", GraspMissed)], allow_unused=True)
    assert run.value == "there"
    assert run.unused == ("fault GraspMissed in nothing",)
    with pytest.raises(ValueError, match="only a scripted robot has a belief"):
        _ = run.belief


def test_what_the_plan_asks_of_conditions_is_looked_up_among_the_facts() -> None:
    fridge = Condition("open", (an_object("Refrigerator", "http://example.org/map#fridge1"),))
    script = Script().performs("OpeningADoor")
    open_door = partial(perform, action("OpeningADoor"))

    async def main() -> None:
        await achieve(fridge, open_door)

    assert run_plan(main, script=script.fact("open(fridge1)")).never("OpeningADoor")
    fails = run_plan(main, script=Script().performs("OpeningADoor"))
    assert isinstance(fails.failure, GoalNotAchieved)
    opens = Script().on("OpeningADoor", does=lambda belief, action: belief.facts.update({"open(fridge1)": True}))
    assert run_plan(main, script=opens).failure is None


def test_opening_a_gripper_lets_go_of_what_is_named_or_of_everything() -> None:
    cup = an_object("Cup", "http://example.org/map#cup1")
    grasp = partial(perform, action("GraspingSomething", object_acted_on=cup))

    async def main(release: Action) -> None:
        await grasp()
        await perform(release)

    script = Script().holding(BOTTLE).performs("GraspingSomething")
    named = run_plan(partial(main, action("OpeningAGripper", object_acted_on=cup)), script=script)
    assert named.belief.holding == ["bottle1"]
    assert run_plan(partial(main, action("OpeningAGripper")), script=script).belief.holding == []


def test_compiled_plans_come_from_bundled_recipes_and_from_files() -> None:
    path = bundled("recipes") / "serve_a_drink.omn"
    assert compiled(path).iri == serve_a_drink.iri
    with pytest.raises(BadInput):
        compiled(path.with_name("no_such_recipe.omn"))
