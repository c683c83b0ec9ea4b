"""Failures that say what would do: what they say is true, as a room that is changed like that shows."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from executive.belief.planning_scene import PlanningScene
from executive.locations.changes import Changes, with_changes
from executive.locations.explanations import height_of
from executive.locations.later_bringing import lacking_later
from executive.locations.rejections import Rejections
from planlang import perform
from planlang.designators import Location, a_location, action, an_object
from planlang.failures import LocationUnresolvable
from planlang.geometry import Pose
from sim import Body
from tests.executive.conftest import BED, BOTTLE, CABINET, PLACE, THE_BOTTLE, MakeStage, Stage, hold_bottle

TO_GRASP = a_location(in_reach_of=THE_BOTTLE)
TABLE = Body("table", Pose((2.0, 0.0, 0.4)), (2.4, 2.4, 0.8), type="KitchenTable")
FAR_BACK = replace(BOTTLE, pose=Pose((2.1, 0.1, 0.9)))


def said(stage: Stage) -> str:
    """The first sentence about why the bottle is not reached."""
    with pytest.raises(LocationUnresolvable) as caught:
        next(stage.resolver.bases(TO_GRASP))
    return caught.value.figures


@pytest.mark.long
def test_a_thing_far_back_on_a_table_is_reached_as_much_nearer_to_its_edge_as_the_failure_says(
    make_stage: MakeStage,
) -> None:
    why = said(make_stage(TABLE, FAR_BACK))
    told = re.search(r"moved (\d\.\d+) m, to x = (-?\d\.\d+), y = (-?\d\.\d+), bottle could be reached$", why)
    assert told is not None, why
    step, x, y = map(float, told.groups())
    nearer = replace(FAR_BACK, pose=Pose((x, y, 0.9)))
    assert next(make_stage(TABLE, nearer).resolver.bases(TO_GRASP)) is not None
    less = replace(
        FAR_BACK, pose=Pose((2.1 + (x - 2.1) * (step - 0.1) / step, 0.1 + (y - 0.1) * (step - 0.1) / step, 0.9))
    )
    with pytest.raises(LocationUnresolvable):
        next(make_stage(TABLE, less).resolver.bases(TO_GRASP))


BELL = Body("bell", Pose((1.5, 0.0, 0.96)), (0.3, 0.3, 0.3), type="Cupboard", movable=True)
STAND = Body("stand", Pose((1.5, 0.0, 0.4)), (0.3, 0.3, 0.8), type="KitchenTable")


def test_a_body_around_a_thing_is_named_if_without_it_the_thing_is_reached(make_stage: MakeStage) -> None:
    why = said(make_stage(STAND, BOTTLE, BELL))
    assert why.endswith("without bell this would work")
    assert next(make_stage(STAND, BOTTLE).resolver.bases(TO_GRASP)) is not None


def test_a_thing_that_hangs_above_its_furniture_is_told_to_stand_on_it(make_stage: MakeStage) -> None:
    stand = Body("stand", Pose((1.5, 0.0, 0.4)), (0.3, 0.3, 0.8), type="KitchenTable")
    why = said(make_stage(stand, replace(BOTTLE, pose=Pose((1.5, 0.0, 2.3)))))
    assert why.endswith("0.80 m above the floor instead of 2.20 m, bottle could be reached"), why
    assert next(make_stage(stand, replace(BOTTLE, pose=Pose((1.5, 0.0, 0.9)))).resolver.bases(TO_GRASP)) is not None


def test_a_thing_inside_of_its_support_is_not_told_to_stand_on_top_of_it(make_stage: MakeStage) -> None:
    box = Body("box", Pose((1.5, 0.0, 0.4)), (0.5, 0.5, 0.8), type="Box-Container", wall=0.02)
    scene = make_stage(box, replace(BOTTLE, pose=Pose((1.5, 0.0, 0.12)))).platform.scene
    assert scene.bodies.support("bottle") == "box"
    changes = Changes("bottle", scene, Rejections(), lambda then: then.bodies.pose("bottle").position[2] > 0.5)
    assert changes.helping() is None


def test_supposing_leaves_the_belief_as_it_was(make_stage: MakeStage) -> None:
    stage = make_stage(TABLE, FAR_BACK)
    first = said(stage)
    before = stage.belief.snapshot(), stage.belief.names(), stage.platform.scene.world.pose("bottle")
    assert said(stage) == first
    assert (stage.belief.snapshot(), stage.belief.names(), stage.platform.scene.world.pose("bottle")) == before


@pytest.mark.parametrize(("least", "told"), [(9.0, "without can this would work"), (1.0, "without can, and moved 1.2")])
def test_what_stands_between_a_thing_and_the_edge_is_to_go_with_it_or_alone(
    make_stage: MakeStage, least: float, told: str
) -> None:
    can = replace(BOTTLE, name="can", iri=None, pose=Pose((0.87, 0.1, 0.9)))
    scene = make_stage(TABLE, FAR_BACK, can).platform.scene

    def is_feasible(supposed: PlanningScene) -> bool:
        return not supposed.belief.state.there("can") and supposed.bodies.pose("bottle").position[0] < least

    advice = Changes("bottle", scene, Rejections(), is_feasible).nearer(np.array([-1.0, 0.0]))
    assert advice is not None
    assert str(advice).startswith(told)
    assert is_feasible(scene.supposing(with_changes(scene.belief, advice.changes)))


def test_a_change_that_no_search_decided_is_not_listed_as_tried(make_stage: MakeStage) -> None:
    can = replace(BOTTLE, name="can", iri=None, pose=Pose((0.87, 0.1, 0.9)))
    scene, decided = make_stage(TABLE, FAR_BACK, can).platform.scene, [False]
    changes = Changes("bottle", scene, Rejections(), lambda _: decided.pop() if decided else None)
    assert changes.helping() is None
    told = changes.none_found()
    assert told.startswith("no simple change that would help was found before the search reached its limit (tried: ")
    assert "," not in told.partition("tried: ")[2].removesuffix(", y = 0.10)")


def test_of_changes_that_help_the_first_one_leaves_the_rest_of_the_task_a_way(make_stage: MakeStage) -> None:
    can = replace(BOTTLE, name="can", iri=None, pose=Pose((0.87, 0.1, 0.9)))
    scene, log = make_stage(TABLE, FAR_BACK, can).platform.scene, Rejections()
    log.blocking["can"] = 1

    def lacks(supposed: PlanningScene) -> str:
        return "then not put on shelf" if supposed.belief.state.there("can") else ""

    better = Changes("bottle", scene, log, lambda _: True, what_lacks=lacks).helping()
    assert str(better) == "without can this would work"
    none = Changes("bottle", scene, log, lambda _: True, what_lacks=lambda _: "then not put on shelf").helping()
    assert str(none).endswith("bottle could be reached, but then not put on shelf")


@pytest.mark.parametrize(
    ("impossible", "said"),
    [("put", "then not put on cabinet"), ("can", "then can, which is to be brought, could not"), ("", "")],
)
def test_what_later_steps_bring_somewhere_is_asked_about(make_stage: MakeStage, impossible: str, said: str) -> None:
    can = replace(BOTTLE, name="can", iri=PLACE + "can", pose=Pose((1.0, 0.4, 0.9)))
    stage = make_stage(TABLE, CABINET, FAR_BACK, can)
    the_can, cabinet = an_object(can.type, PLACE + "can"), an_object(CABINET.type, PLACE + CABINET.name)
    steps = [
        action("MovingSomething", object_acted_on=what, to_location=a_location(on=cabinet))
        for what in (THE_BOTTLE, the_can)
    ]
    scene = stage.platform.scene
    hold_bottle(stage)

    def has_way(location: Location, _: PlanningScene) -> bool:
        return impossible != ("can" if the_can in location.things() else "put")

    assert lacking_later(steps, "bottle", stage.platform.scene, scene, has_way) == said


def test_what_only_a_full_hand_reaches_is_to_be_fetched_before_what_the_hand_holds(make_stage: MakeStage) -> None:
    stage = make_stage(CABINET, BOTTLE, replace(BOTTLE, name="can", iri=None, pose=Pose((0.0, 2.0, 0.1))))
    hold_bottle(stage, name="can")
    scene = stage.platform.scene
    why = Changes("bottle", scene, Rejections(), lambda _: False).in_order(lambda supposed: not supposed.belief.held)
    assert str(why) == "only the right arm, which holds can, reaches bottle: fetch bottle before can"
    needed = Changes("bottle", scene, Rejections(), lambda _: False, needed={"can"})
    assert needed.in_order(lambda _: pytest.fail("nothing asks without the can")) is None


def test_a_relation_that_no_place_meets_is_named_instead_of_changes_that_are_no_use(make_stage: MakeStage) -> None:
    stage = make_stage(CABINET, BED, BOTTLE)
    arm = stage.platform.robot.arms[0]
    stage.truth.set_pose("bottle", stage.truth.link_pose(arm.tip))
    stage.truth.attach(arm.tip, "bottle")
    stage.belief.grasped("bottle", arm.name, arm.tip, Pose((0.0, 0.0, 0.0)))
    stage.platform.observe()
    cabinet, bed = (an_object(body.type, PLACE + body.name) for body in (CABINET, BED))
    with pytest.raises(LocationUnresolvable) as caught:
        next(stage.resolver.bases(a_location(in_reach_of=a_location(on=cabinet, behind=bed))))
    assert list(caught.value.counts) == ["not behind bed"]
    number = caught.value.counts["not behind bed"]
    assert caught.value.figures == f"none of the {number} candidates is behind bed: another place or relation is needed"


def test_a_grasp_that_no_pose_of_the_hand_has_is_named_with_those_that_some_have(make_stage: MakeStage) -> None:
    stage = make_stage(CABINET, BED, BOTTLE)
    arm = stage.platform.robot.arms[0]
    stage.truth.set_pose("bottle", stage.truth.link_pose(arm.tip))
    stage.truth.attach(arm.tip, "bottle")
    stage.belief.grasped("bottle", arm.name, arm.tip, Pose((0.0, 0.0, 0.0)))
    stage.platform.observe()
    there = a_location(above=an_object(CABINET.type, PLACE + CABINET.name), grasp="top")
    with pytest.raises(LocationUnresolvable) as caught:
        next(stage.resolver.bases(a_location(in_reach_of=there)))
    assert caught.value.figures == "only a side grasp is possible here: ask for that, or leave the grasp open"


@pytest.mark.parametrize(
    ("pose", "why"),
    [
        (
            Pose((2.5, 0.0, 0.9)),
            r"bottle is 2\.50 m away from the centre of the robot; the left arm reaches 0\.\d\d m at",
        ),
        (Pose((0.6, 0.2, 2.0)), r"bottle is at \d\.\d\d m, \d\.\d\d m too high; the left arm grasps from"),
    ],
)
def test_a_hand_that_gets_nowhere_near_from_where_the_base_is_states_what_is_missing(
    make_stage: MakeStage, pose: Pose, why: str
) -> None:
    stage = make_stage(replace(BOTTLE, pose=pose))
    arm = next(arm for arm in stage.platform.scene.arms.all if arm.name == "left")
    seed = np.zeros(len(arm.joints))
    with pytest.raises(LocationUnresolvable) as caught:
        next(stage.resolver.hands(a_location(in_center_of=THE_BOTTLE), arm, seed))
    assert re.match(why, caught.value.figures), caught.value.figures


THE_BELL = an_object("Cupboard", PLACE + "bell")


@pytest.mark.parametrize(
    "location",
    [
        a_location(in_reach_of=THE_BOTTLE, not_=a_location(near=THE_BELL)),
        a_location(in_reach_of=THE_BOTTLE, near=THE_BELL),
        a_location(in_reach_of=THE_BOTTLE, visible_from=THE_BELL),
        a_location(in_reach_of=THE_BOTTLE, left_of=THE_BELL),
        a_location(in_reach_of=THE_BOTTLE, behind=THE_BELL),
        a_location(in_reach_of=THE_BOTTLE, facing=THE_BELL),
        a_location(in_reach_of=(THE_BOTTLE, a_location(above=THE_BELL))),
    ],
    ids=str,
)
def test_what_a_location_names_is_not_supposed_away(make_stage: MakeStage, location: Location) -> None:
    with pytest.raises(LocationUnresolvable) as caught:
        next(make_stage(STAND, BOTTLE, BELL).resolver.bases(location))
    assert "bell" in caught.value.blocking
    assert "without bell" not in caught.value.figures


def test_what_the_plan_around_acts_on_is_not_supposed_away(make_stage: MakeStage) -> None:
    stage, figures = make_stage(STAND, BOTTLE, BELL), list[str]()

    async def search() -> None:
        figures.append(said(stage))

    stage.run(partial(perform, action("Cleaning", object_acted_on=THE_BELL), otherwise=search))
    assert "bell" in figures[0]
    assert "without bell" not in figures[0]


@pytest.mark.parametrize(
    ("height", "told"), [(0.1, r"0\.1\d m too low; the \w+ arm reaches down to 0\.2\d m"), (0.9, "$")]
)
def test_a_handle_is_said_to_be_too_low_for_the_hands_with_both_heights(
    make_stage: MakeStage, height: float, told: str
) -> None:
    scene = make_stage(replace(BOTTLE, pose=Pose((1.5, 0.0, height)))).platform.scene
    assert re.match(rf"bottle is at {height:.2f} m(, )?{told}", height_of("bottle", scene, scene.arms.all))
