"""Plans that the compiler makes of nested recipes, parameters, devices, scopes and recoveries, on small recipes."""

from typing import Any

import pytest
from plan_text import unbroken
from small_recipes import body, orderings, step, task

from planlang.diagnostics import BadInput, Severity


def test_steps_of_one_place_run_at_it_and_hand_places_narrow_it(compiled: Any) -> None:
    plan = compiled(
        task("Take", "Drive Reach Close", constraints=2),
        orderings("Drive<Reach", "Reach<Close"),
        step("Drive", "k:Translation-LocationChange", "k:toLocation value there"),
        step("Reach", "k:Reaching", "k:toLocation value graspPose", "k:deviceUsed value gripper"),
        step("Close", "k:ClosingAGripper", "k:deviceUsed value gripper"),
    )
    source = body(plan, "take")
    assert "async def at_there() -> None:" in source
    assert "reaching=(grasp_pose,)" in source
    assert 'a_location("there", in_reach_of=bottle, using=GRIPPER)' in plan.source


def test_without_scopes_a_base_motion_is_a_step_like_any_other(compiled: Any) -> None:
    plan = compiled(
        task("Take", "Drive Reach", constraints=1),
        orderings("Drive<Reach"),
        step("Drive", "k:Translation-LocationChange", "k:toLocation value there"),
        step("Reach", "k:Reaching", "k:toLocation value graspPose"),
        scopes=False,
    )
    assert "at_location" not in plan.source
    written = "perform(action(RECIPE + 'Drive', below='Translation-LocationChange', to_location=there)"
    assert written in unbroken(plan.source)


def test_base_motion_that_nothing_follows_opens_no_scope(compiled: Any) -> None:
    plan = compiled(task("Go", "Drive"), step("Drive", "k:Translation-LocationChange", "k:toLocation value there"))
    assert "at_location" not in plan.source


BRING = ("k:TransportingAnObject", "k:objectActedOn value room:bottle1", "k:toLocation value bed1")
TAKE = ("k:PickingUpAnObject", "k:objectActedOn value room:bottle1")
BED = "Individual: bed1\n    Types: k:Bed-PieceOfFurniture"
PUT_DOWN = ("k:PuttingDownAnObject", "k:objectActedOn value room:bottle1", "k:toLocation value bed1")


@pytest.mark.parametrize(
    ("names", "order", "steps"),
    [
        ("Drive Bring", "Drive<Bring", {"Bring": BRING}),
        ("Drive Bring Other", "Drive<Bring Drive<Other", {"Bring": BRING, "Other": BRING}),
    ],
    ids=["one", "two unordered"],
)
def test_what_is_fetched_here_and_brought_there_narrows_no_place(
    compiled: Any, names: str, order: str, steps: dict[str, tuple[str, ...]]
) -> None:
    pairs = order.split()
    plan = compiled(
        task("Go", names, constraints=len(pairs)),
        orderings(*pairs),
        step("Drive", "k:Translation-LocationChange", "k:toLocation value room:cup1"),
        BED,
        *(step(name, *stated) for name, stated in steps.items()),
    )
    assert "at_location" not in body(plan, "go")


def test_what_is_taken_narrows_the_place_before_it_and_where_it_is_put_down_does_not(compiled: Any) -> None:
    plan = compiled(
        task("Go", "Drive Take Put", constraints=2),
        orderings("Drive<Take", "Take<Put"),
        step("Drive", "k:Translation-LocationChange", "k:toLocation value there"),
        BED,
        step("Take", *TAKE),
        step("Put", *PUT_DOWN),
    )
    source = body(plan, "go")
    assert "reaching=(" in source
    assert "resting_on" not in source.partition("reaching=(")[2].partition(")")[0]


def test_step_unordered_with_the_next_base_motion_stays_outside_without_an_object(
    compiled: Any, read_plan: Any
) -> None:
    plan = compiled(
        task("Go", "Drive Back Look", constraints=2),
        orderings("Drive<Back", "Drive<Look"),
        step("Drive", "k:Translation-LocationChange", "k:toLocation value there"),
        "Individual: home\n    Types: k:Point2D\n    Facts: k:inReachOf room:cup1",
        step("Back", "k:Translation-LocationChange", "k:toLocation value home"),
        step("Look", "k:LookingForSomething"),
    )
    happening = read_plan(plan.source).orders("go")
    assert ("Look", "Back") not in happening.before
    assert ("Back", "Look") not in happening.before


MATRIX = "k:m00 0, k:m10 1, k:m22 1, k:m03 1.5, k:m13 -2.0, k:m23 0.0"


@pytest.mark.parametrize(
    "stated",
    [
        MATRIX,
        'k:translation "1.5 -2 0", k:heading 90',
        'k:translation "1.5 -2 0", k:quaternion "0 0 0.7071068 0.7071068"',
    ],
    ids=["matrix", "heading", "quaternion"],
)
def test_base_motion_to_a_stated_pose_goes_there(compiled: Any, stated: str) -> None:
    plan = compiled(
        task("Go", "Drive"),
        f"Individual: corner\n    Types: k:RotationMatrix3D\n    Facts: {stated}",
        step("Drive", "k:Translation-LocationChange", "k:toLocation value corner"),
    )
    assert "x=1.5, y=-2.0, z=0.0, yaw=1.5707963" in unbroken(plan.source)


@pytest.mark.parametrize("stated", ['k:translation "1.5 here 0"', 'k:translation "1.5 -2 0", k:quaternion "1 0 0 0"'])
def test_numbers_that_are_no_pose_of_a_base_state_none(compiled: Any, stated: str) -> None:
    plan = compiled(
        task("Go", "Drive"),
        f"Individual: corner\n    Types: k:RotationMatrix3D\n    Facts: {stated}",
        step("Drive", "k:Translation-LocationChange", "k:toLocation value corner"),
    )
    assert "a_pose" not in plan.source


def test_base_motion_to_a_thing_goes_where_that_is_in_reach(compiled: Any) -> None:
    plan = compiled(
        task("Go", "Drive Look", constraints=1),
        orderings("Drive<Look"),
        step("Drive", "k:Translation-LocationChange", "k:toLocation value room:bottle1"),
        step("Look", "k:LookingForSomething"),
    )
    assert "at_location(a_location('near-bottle1', in_reach_of=bottle), at_near_bottle" in unbroken(plan.source)


def test_place_of_a_base_that_something_else_names_too_is_described_once(compiled: Any) -> None:
    plan = compiled(
        task("Go", "Drive Look", constraints=1),
        orderings("Drive<Look"),
        step("Drive", "k:Translation-LocationChange", "k:toLocation value there"),
        step("Look", "k:LookingForSomething", "k:toLocation value there"),
    )
    assert plan.source.count("a_location(") == 1
    assert "at_location(there, at_there" in unbroken(plan.source)


def test_place_described_as_a_class_is_a_place(compiled: Any) -> None:
    plan = compiled(
        task("Take", "Reach"),
        step("BesideTheCup", "k:Point3D", "k:toTheSideOf value room:cup1", "k:aboveOf some k:Table-PieceOfFurniture"),
        step("Reach", "k:Reaching", "k:toLocation some BesideTheCup"),
    )
    assert 'a_location("BesideTheCup", above=table_piece_of_furniture, next_to=cup)' in plan.source


def test_class_place_is_a_place_and_a_room_below_it_is_a_thing(compiled: Any) -> None:
    plan = compiled(
        task("Take", "Reach Visit"),
        "Class: BesideTheCup\n    EquivalentTo: k:Place and (k:toTheSideOf value room:cup1)",
        step("Reach", "k:Reaching", "k:toLocation some BesideTheCup"),
        step("Visit", "k:Translation-LocationChange", "k:toLocation some k:Kitchen"),
    )
    assert 'a_location("BesideTheCup", next_to=cup)' in plan.source
    assert 'an_object("Kitchen")' in plan.source


def test_place_may_be_relative_to_another_place(compiled: Any) -> None:
    plan = compiled(
        task("Take", "Reach"),
        "Individual: beyond\n    Types: k:Point3D\n    Facts: k:aboveOf graspPose, k:inReachOf room:patient1",
        step("Reach", "k:Reaching", "k:toLocation value beyond"),
    )
    assert [line.strip() for line in body(plan, "take").splitlines()[2:4]] == [
        'grasp_pose = a_location("graspPose", in_center_of=bottle)',
        'beyond = a_location("beyond", above=grasp_pose, in_reach_of=patient)',
    ]


def test_place_is_described_where_it_is_first_used_and_its_label_stands_in_the_plan_once(compiled: Any) -> None:
    plan = compiled(
        task("Take", "Look Reach Again", constraints=2),
        orderings("Look<Reach", "Reach<Again"),
        'Individual: beyond\n    Annotations: rdfs:label "over it"\n'
        "    Types: k:Point3D\n    Facts: k:aboveOf room:cup1",
        step("Look", "k:LookingForSomething"),
        step("Reach", "k:Reaching", "k:toLocation value beyond"),
        task("Again", "Back", above="k:PurposefulAction"),
        step("Back", "k:Reaching", "k:toLocation value beyond"),
    )
    described = 'beyond = a_location("beyond", above=cup)'
    assert described in body(plan, "again")
    assert "# over it" not in body(plan, "take")
    lines = body(plan, "take").splitlines()
    (place,) = (number for number, line in enumerate(lines) if line.strip() == described)
    assert 'RECIPE + "Look"' in lines[place - 1]
    assert "to_location=beyond" in lines[place + 2]
    assert any("partial(again, cup=cup)" in line for line in lines[place:])


def test_place_that_a_called_function_has_for_another_thing_is_described_for_each(compiled: Any) -> None:
    plan = compiled(
        task("Take", "Drive Fetch Touch", "k:objectActedOn value room:cup1", constraints=2),
        orderings("Drive<Fetch", "Fetch<Touch"),
        step("Over", "k:Point3D", "k:aboveOf some k:Cup"),
        step("Drive", "k:Translation-LocationChange", "k:toLocation value there"),
        task("Fetch", "Reach", above="k:PurposefulAction"),
        step("Reach", "k:Reaching", "k:toLocation some Over", "k:objectActedOn some k:Cup"),
        step("Touch", "k:Reaching", "k:toLocation some Over"),
    )
    source = body(plan, "take")
    assert 'over = a_location("Over", above=cup_2)' in source
    assert 'over_2 = a_location("Over", above=cup)' in source
    assert "partial(fetch, cup=cup_2)" in source
    assert "to_location=over_2" in source
    assert "reaching=(over, over_2)" in source


def test_recipe_with_a_base_motion_of_its_own_ends_the_scope_of_its_caller(compiled: Any) -> None:
    plan = compiled(
        task("Outer", "Drive Fetch Reach", constraints=2),
        orderings("Drive<Fetch", "Fetch<Reach"),
        step("Drive", "k:Translation-LocationChange", "k:toLocation value there"),
        task("Fetch", "DriveAgain Look", "k:orderingConstraints value P1"),
        "Individual: P1\n    Types: k:PartialOrdering-Strict\n"
        "    Facts: k:occursBeforeInOrdering DriveAgain, k:occursAfterInOrdering Look",
        step("DriveAgain", "k:Translation-LocationChange", "k:toLocation value there"),
        step("Look", "k:LookingForSomething", "k:objectActedOn value room:bottle1"),
        step("Reach", "k:Reaching", "k:toLocation value graspPose"),
    )
    assert "at_location" in body(plan, "fetch")
    assert "at_location" not in body(plan, "outer")


def test_called_function_takes_the_callers_thing_of_the_same_property(compiled: Any) -> None:
    plan = compiled(
        task("Serve", "GraspIt", above="k:PurposefulAction"),
        step("GraspIt", "Grasp", "k:objectActedOn value room:bottle1"),
        task("Grasp", "Look", "k:objectActedOn some k:DrinkingVessel", above="k:GraspingSomething"),
        step("Look", "k:LookingForSomething", "k:objectActedOn some k:DrinkingVessel"),
    )
    assert "async def grasp(*, drinking_vessel: Object = DRINKING_VESSEL) -> None:" in plan.source
    assert "partial(grasp, drinking_vessel=bottle)" in plan.source
    assert "async def serve(*, bottle: Object = BOTTLE) -> None:" in plan.source


def test_two_things_of_one_name_get_two_parameters(compiled: Any) -> None:
    plan = compiled(
        task("Look", "LookHere LookThere"),
        "Individual: bottle\n    Types: k:DrinkingBottle",
        step("LookHere", "k:LookingForSomething", "k:objectActedOn value room:bottle1"),
        step("LookThere", "k:LookingForSomething", "k:objectActedOn value bottle"),
    )
    assert "async def look(*, bottle: Object = BOTTLE, bottle_2: Object = BOTTLE_2) -> None:" in plan.source


def test_device_of_a_recipe_is_that_of_its_steps_and_of_recipes_below(compiled: Any) -> None:
    plan = compiled(
        task("Serve", "Grasp", "k:deviceUsed value gripper"),
        task("Grasp", "Close", above="k:PurposefulAction"),
        step("Close", "k:ClosingAGripper"),
    )
    assert 'action(RECIPE + "Close", below="ClosingAGripper", device_used=GRIPPER)' in plan.source


def test_recipe_nearer_than_a_primitive_is_called(compiled: Any) -> None:
    plan = compiled(
        task("Serve", "CarefulReach"),
        task("CarefulReach", "Look", above="k:Reaching"),
        step("Look", "k:LookingForSomething"),
    )
    written = "action(RECIPE + 'CarefulReach', below='Reaching'), otherwise=careful_reach,"
    assert written in unbroken(plan.source)


def test_primitive_nearer_than_a_recipe_is_performed(compiled: Any) -> None:
    plan = compiled(
        task("Serve", "Reach"),
        step("Reach", "k:Reaching", "k:toLocation value graspPose"),
        "Class: k:VoluntaryBodyMovement\n    SubClassOf: k:subAction some Look",
        step("Look", "k:LookingForSomething"),
        task="Serve",
    )
    assert 'action(RECIPE + "Reach", below="Reaching", to_location=grasp_pose)' in plan.source


def test_recipes_of_two_superclasses_are_tried_in_order(compiled: Any) -> None:
    plan = compiled(
        task("Serve", "Bring"),
        step("Bring", "OneWay", "OtherWay"),
        task("OneWay", "Look", above="k:TransportationEvent"),
        task("OtherWay", "Reach", above="k:TransportationEvent"),
        step("Look", "k:LookingForSomething"),
        step("Reach", "k:Reaching", "k:toLocation value graspPose"),
        task="Serve",
    )
    assert "partial(try_in_order, one_way, partial(other_way, bottle=bottle))" in plan.source


def test_task_without_steps_of_its_own_takes_those_of_its_superclass(compiled: Any) -> None:
    plan = compiled(step("Mine", "Serve"), task("Serve", "Look"), step("Look", "k:LookingForSomething"), task="Mine")
    assert plan.functions == ("mine",)
    assert 'await perform(action(RECIPE + "Look", below="LookingForSomething"))' in plan.source


def test_label_of_a_step_stands_above_it(compiled: Any) -> None:
    plan = compiled(
        task("Serve", "Look"),
        'Class: Look\n    Annotations: rdfs:label "look\n around"\n    SubClassOf: k:LookingForSomething',
    )
    assert "    # look around\n    await perform(" in plan.source


def test_data_flow_orders_steps(compiled: Any, read_plan: Any) -> None:
    plan = compiled(
        task("Serve", "Reach Look", "k:inputOutputConstraints value Flow"),
        "Individual: Flow\n    Types: k:InputOutputMapping\n    Facts: k:createsOutput Look, k:requiresInput Reach",
        step("Look", "k:LookingForSomething"),
        step("Reach", "k:Reaching", "k:toLocation value graspPose"),
    )
    assert read_plan(plan.source).orders("serve").steps == ["Look", "Reach"]


def test_numbers_and_several_fillers_of_a_property_are_kept(compiled: Any) -> None:
    plan = compiled(
        task("Serve", "Reach"),
        step(
            "Reach",
            "k:Reaching",
            "k:linearVelocity value 0.3",
            "k:objectActedOn value room:bottle1",
            "k:objectActedOn value room:cup1",
            "k:toLocation value room:cup1",
        ),
    )
    assert "object_acted_on=(bottle, cup), to_location=cup, linear_velocity=0.3" in " ".join(plan.source.split())


def test_person_is_a_person_and_names_that_python_has_get_a_number(compiled: Any) -> None:
    plan = compiled(
        task("print", "Look"),
        step("Look", "k:LookingForSomething", "k:objectActedOn value room:patient1"),
    )
    assert "async def print_2(*, patient: Person = PATIENT) -> None:" in plan.source


def test_constants_have_numbers_only_where_they_meet_other_constants(compiled: Any) -> None:
    plan = compiled(
        task("Serve", "Look Read"),
        step("Look", "k:LookingForSomething", "k:objectActedOn value plan1"),
        step("Read", "k:LookingForSomething", "k:objectActedOn value recipe"),
        "Individual: plan1\n    Types: k:Cup\nIndividual: recipe\n    Types: k:Cup",
    )
    assert "plan_2: Object = PLAN," in plan.source, "the parameter meets the imported function, the constant does not"
    assert "\nPLAN = an_object(" in plan.source
    assert "\nRECIPE_2 = an_object(" in plan.source, "RECIPE is the namespace"


def test_properties_named_like_words_of_python_get_a_number(compiled: Any) -> None:
    plan = compiled(
        task("Serve", "Look"),
        "DataProperty: class\nDataProperty: name\nDataProperty: below",
        step("Look", "k:LookingForSomething", 'class value "first"', 'name value "second"', 'below value "third"'),
    )
    assert 'below="LookingForSomething", below_2="third", class_2="first", name_2="second")' in plan.source


def test_labels_cannot_break_out_of_docstrings(compiled: Any) -> None:
    evil = 'x\\"\\"\\"; import os #'
    plan = compiled(
        f'Class: Serve\n    Annotations: rdfs:label "{evil}"',
        "    SubClassOf: k:PurposefulAction, k:subAction some Look",
        step("Look", "k:LookingForSomething"),
    )
    compile(plan.source, "plan.py", "exec")
    assert "\nimport os" not in plan.source
    assert plan.source.count('"""') == 4


def test_all_errors_come_in_one_run(compiled: Any) -> None:
    with pytest.raises(BadInput) as found:
        compiled(
            task("Serve", "Look Lok Dance", "k:orderingConstraints value Nothing", constraints=2),
            orderings("Look<Dance", "Dance<Look"),
            step("Look", "k:LookingForSomething", "k:objectActedOn value nobody"),
            step("Dance", "k:PurposefulAction"),
        )
    codes = {d.code for d in found.value.diagnostics if d.severity is Severity.ERROR}
    assert codes == {"R011", "R012", "R020", "R033"}


def test_a_step_with_a_recipe_that_is_just_some_action_is_told_by_its_own_class(compiled: Any) -> None:
    text = task("T", "Part") + step("Part", "k:PurposefulAction", "k:subAction some Look")
    plan = compiled(text + step("Look", "k:Perceiving"))
    assert 'await perform(action(RECIPE + "Part", below="PurposefulAction"), otherwise=part)' in plan.source


def test_a_class_is_stated_where_it_is_used_once_and_else_before_all_that_uses_it(compiled: Any) -> None:
    text = task("T", "Look one two") + step("Look", "k:Perceiving") + step("Stare", "k:Perceiving")
    plan = compiled(text + "\nIndividual: one\n    Types: Stare\nIndividual: two\n    Types: Stare\n")
    assert 'STARE = action_class(RECIPE + "Stare", below="Perceiving")' in plan.source
    assert plan.source.count("perform, action(STARE), name=") == 2
    assert 'partial(perform, action(RECIPE + "Look", below="Perceiving"))' in plan.source


def test_a_class_that_is_long_beside_the_properties_of_its_step_is_stated_apart(compiled: Any) -> None:
    name = "ReachVery" + 70 * "o" + "ften"
    plan = compiled(task("T", name), step(name, "k:Reaching", "k:toLocation value graspPose"))
    assert f"action_class(RECIPE + '{name}', below='Reaching')" in unbroken(plan.source)
    assert "below=" not in body(plan, "t")


def test_an_individual_with_a_recipe_of_its_own_is_a_class_to_the_plan(compiled: Any) -> None:
    frames = [("T", "k:Action", "part"), ("part", "k:Action", "look")]
    text = "".join(
        f"\nIndividual: {name}\n    Types: {cls}\n    Facts: k:subAction {sub}\n" for name, cls, sub in frames
    )
    plan = compiled(text + "\nIndividual: look\n    Types: k:Perceiving\n", task="T")
    assert 'await perform(action(RECIPE + "part", below="Action"), otherwise=part)' in plan.source
    assert 'await perform(action("Perceiving"), name="look")' in plan.source
