"""Properties of every resolution: it changes nothing, moves with the scene, is kept while it is true, and goes on."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from itertools import combinations, islice, pairwise

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from executive.locations import Rejections, Resolver
from executive.locations.questions import BUDGETS
from executive.locations.replayable import Replayable
from executive.locations.search import APART
from planlang import at_location
from planlang.designators import Location, a_location, a_person, an_object
from planlang.failures import LocationUnresolvable, ManipulationPoseUnreachable, ObjectUnreachable
from planlang.geometry import Pose
from planlang.kernel.core import here
from planlang.protocols import Configuration, Solution
from sim import Body
from tests.executive.conftest import BOTTLE, CABINET, THE_BOTTLE, WARD, MakeStage, Stage, hold_bottle, stand
from tests.support.detections import recognise
from tests.support.examples import some
from tests.support.world_values import value_of

LOCATIONS = (
    a_location(in_reach_of=(THE_BOTTLE, a_location(in_center_of=THE_BOTTLE))),
    a_location(in_reach_of=a_person("Patient")),
    a_location(in_reach_of=a_location(above=an_object("Bed-PieceOfFurniture"))),
    a_location(visible_from=THE_BOTTLE),
    a_location(in_front_of=an_object("Cabinet-PieceOfFurniture")),
)


def snapshot(stage: Stage) -> tuple[object, ...]:
    """Everything that a query must leave alone."""
    belief = stage.belief
    return (
        value_of(stage.truth),
        value_of(stage.planning),
        belief.revision,
        tuple((name, belief.pose(name)) for name in belief.names()),
        tuple(belief.held.items()),
    )


@pytest.mark.parametrize("location", some(LOCATIONS, every=2), ids=str)
def test_asking_for_places_changes_neither_truth_nor_belief_nor_the_planning_world(
    location: Location, ward: Stage
) -> None:
    before = snapshot(ward)
    list(islice(ward.resolver.bases(location), 5))
    ward.platform.observe()
    assert snapshot(ward) == before


def test_asking_for_hand_poses_changes_nothing_even_with_a_bottle_in_hand(ward: Stage) -> None:
    stand(ward, (-1.2, 0.9, 2.6))
    hold_bottle(ward)
    before = snapshot(ward)
    arm = ward.platform.scene.arms.all[0]
    for location in (a_location(above=an_object("Bed-PieceOfFurniture")), a_location(in_front_of=THE_BOTTLE)):
        try:
            list(islice(ward.resolver.hands(location, arm, ward.platform.arm_joints(arm)), 3))
        except LocationUnresolvable:
            continue
    ward.platform.observe()
    assert snapshot(ward) == before


def test_a_failed_resolution_changes_nothing(make_stage: MakeStage) -> None:
    stage = make_stage(*WARD)
    stage.planning.set_configuration(Configuration((0.0, 0.0, 0.0), {}))
    stage.belief.bump("bottle", Pose((1.6, 0.0, 2.4)))
    stage.platform.observe()
    before = snapshot(stage)
    with pytest.raises(LocationUnresolvable):
        next(stage.resolver.bases(LOCATIONS[0]))
    stage.platform.observe()
    assert snapshot(stage) == before


@pytest.fixture(scope="module")
def moved(furnish: MakeStage) -> Callable[[Pose], Stage]:
    """The ward as the robot believes it after all of it, itself included, has been moved."""
    stage = furnish(*WARD)
    joints = stage.truth.configuration().joints

    def move(motion: Pose) -> Stage:
        turned = motion.matrix()
        base = turned @ np.array([0.0, 0.0, 0.0, 1.0])
        stage.truth.set_configuration(Configuration((base[0], base[1], motion.yaw), joints))
        for there in (Pose.planar(9.0, 9.0) @ motion, motion):  # a move of less than 2 mm would not count as one
            for body in WARD:
                recognise(stage.belief, body.name, there @ body.pose)
        stage.platform.observe()
        return stage

    return move


def transported(motion: Pose, base: tuple[float, float, float]) -> tuple[float, float, float]:
    """A base pose after a motion of the whole scene."""
    there = motion @ Pose.planar(*base)
    return there.position[0], there.position[1], there.yaw


offsets = st.floats(-1.5, 1.5)
PROPERTY = settings(max_examples=6, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


@pytest.mark.long
@pytest.mark.parametrize("location", LOCATIONS, ids=str)
@PROPERTY
@given(x=offsets, y=offsets, yaw=st.floats(-math.pi, math.pi))
def test_places_stay_places_when_the_whole_scene_is_moved_and_turned(
    moved: Callable[[Pose], Stage], location: Location, x: float, y: float, yaw: float
) -> None:
    bases = [solution.base for solution in islice(moved(Pose((0.0, 0.0, 0.0))).resolver.bases(location), 3)]
    motion = Pose.planar(x, y, yaw)
    stage = moved(motion)
    for base in bases:
        there = transported(motion, base)
        assert stage.resolver.satisfies(location, there), f"{base} was a place, {there} is none after {motion}"


@pytest.mark.parametrize("location", some(LOCATIONS, len(LOCATIONS)), ids=str)
@PROPERTY
@given(x=offsets, y=offsets, yaw=st.floats(-math.pi, math.pi))
def test_a_moved_and_turned_scene_gives_the_same_places_moved_in_the_same_order(
    moved: Callable[[Pose], Stage], location: Location, x: float, y: float, yaw: float
) -> None:
    motion = Pose.planar(x, y, yaw)
    bases = [solution.base for solution in islice(moved(Pose((0.0, 0.0, 0.0))).resolver.bases(location), 4)]
    found = [solution.base for solution in islice(moved(motion).resolver.bases(location), 4)]
    for base, other in zip(bases, found, strict=True):
        there = transported(motion, base)
        assert other[:2] == pytest.approx(there[:2], abs=1e-4)
        assert math.remainder(other[2] - there[2], 2 * math.pi) == pytest.approx(0.0, abs=1e-4)


TO_REACH, TO_SEE = a_location(in_reach_of=THE_BOTTLE), a_location(visible_from=THE_BOTTLE)
NOWHERE = a_location(in_reach_of=THE_BOTTLE, near=an_object("Bed-PieceOfFurniture"))


@pytest.fixture
def searched(ward: Stage, monkeypatch: pytest.MonkeyPatch) -> list[Location]:
    """The locations that were searched for, not looked up."""
    found: list[Location] = []
    search = ward.resolver._bases

    def counted(location: Location, log: Rejections) -> Iterator[Solution]:
        found.append(location)
        return search(location, log)

    monkeypatch.setattr(ward.resolver, "_bases", counted)
    return found


def ask(stage: Stage, location: Location = TO_REACH, number: int = 2) -> list[Solution]:
    """The first places, as a plan asks for them."""
    stage.platform.observe()
    return list(islice(stage.resolver.bases(location), number))


def test_what_was_asked_before_is_not_searched_for_again(ward: Stage, searched: list[Location]) -> None:
    first = ask(ward)
    assert ask(ward) == first
    assert ask(ward, number=4)[:2] == first, "more of it goes on where it ended"
    ask(ward, TO_SEE)
    assert ask(ward) == first
    assert searched == [TO_REACH, TO_SEE]


def test_a_failure_is_kept_too(ward: Stage, searched: list[Location]) -> None:
    told = []
    for _ in range(2):
        with pytest.raises(LocationUnresolvable) as caught:
            ask(ward, NOWHERE)
        told.append((str(caught.value), dict(caught.value.counts)))
    assert told[0] == told[1]
    assert searched == [NOWHERE]


def turn_head(stage: Stage) -> None:
    now = stage.truth.configuration()
    stage.truth.set_configuration(Configuration(now.base, {**now.joints, "neck_pan_joint": 0.3}))


def drive(stage: Stage) -> None:
    now = stage.truth.configuration()
    stage.truth.set_configuration(Configuration((-0.3, 0.2, 1.0), now.joints))


CHANGES: dict[str, Callable[[Stage], None]] = {
    "a thing is seen elsewhere": lambda stage: recognise(stage.belief, "bottle", Pose((1.5, 0.2, 0.9)), 1.0),
    "a thing is felt": lambda stage: stage.belief.bump("bed", Pose((-2.5, 0.1, 0.275))),
    "a thing is looked for in vain": lambda stage: stage.belief.not_seen("bottle", (0.5, 0.0, 0.0)),
    "a hand holds it": hold_bottle,
    "the robot drives": drive,
    "the robot turns its head": turn_head,
}


@pytest.mark.parametrize("change", some(CHANGES, 2))
def test_they_are_searched_for_anew_when(change: str, ward: Stage, searched: list[Location]) -> None:
    ask(ward)
    CHANGES[change](ward)
    ask(ward)
    ask(ward)
    assert searched == [TO_REACH, TO_REACH]


def test_what_is_seen_where_it_was_changes_nothing(ward: Stage, searched: list[Location]) -> None:
    first = ask(ward)
    recognise(ward.belief, "bottle", BOTTLE.pose, 1.0)
    recognise(ward.belief, "bottle", BOTTLE.pose, 1.0)
    revision = ward.belief.revision
    assert [place.base for place in ask(ward)] == [place.base for place in first]
    recognise(ward.belief, "bottle", BOTTLE.pose, 1.0)
    assert ward.belief.revision == revision


def test_no_two_places_are_at_one_point(ward: Stage) -> None:
    for location in (TO_REACH, TO_SEE, a_location(near=an_object("Bed-PieceOfFurniture"))):
        found = ask(ward, location, 12)
        for before, after in pairwise(found):
            assert (before.base[0] - after.base[0]) ** 2 + (before.base[1] - after.base[1]) ** 2 > 0.05**2
        assert len({place.base[:2] for place in found}) == 12


def test_an_interrupted_search_begins_anew() -> None:
    begun: list[int] = []

    def count() -> Iterator[int]:
        begun.append(len(begun))
        for number in range(5):
            if number == 3 and len(begun) == 1:
                raise KeyboardInterrupt
            yield number

    answers = Replayable(count)
    with pytest.raises(KeyboardInterrupt):
        list(answers)
    assert list(answers) == [0, 1, 2, 3, 4]
    assert list(answers) == [0, 1, 2, 3, 4]
    assert len(begun) == 2


GANGWAY = (
    CABINET,
    BOTTLE,
    *(Body(f"bench{y}", Pose((0.7, y, 0.25)), (2.4, 1.5, 0.5), type="Cupboard") for y in (-1.12, 1.12)),
    *(Body(f"box{y}", Pose((1.5, y, 0.95)), (0.3, 0.05, 0.3), type="Box") for y in (-0.14, 0.14)),
    Body("behind_it", Pose((2.6, 0.0, 0.25)), (1.5, 4.5, 0.5), type="Cupboard"),
    Body("behind_the_robot", Pose((-0.55, 0.0, 0.25)), (0.3, 0.8, 0.5), type="Cupboard"),
)
"""A bottle between boxes at the end of a gangway: few places have room, and few directions of the hand."""
IN_REACH = a_location(in_reach_of=THE_BOTTLE)


@pytest.fixture
def gangway(make_stage: MakeStage) -> Stage:
    """The robot in it, before the bottle."""
    return make_stage(*GANGWAY, start=(0.6, 0.0, 0.0))


def drained(stage: Stage) -> tuple[list[tuple[float, float, float]], str]:
    """All places, asked for anew, and what is said at the end."""
    found: list[Solution] = []
    with pytest.raises(LocationUnresolvable) as ended:
        found.extend(Resolver(stage.platform.scene).bases(IN_REACH))
    return [solution.base for solution in found], str(ended.value)


@pytest.mark.long
def test_the_iterator_goes_on_with_greater_efforts_until_there_are_no_more(
    gangway: Stage, monkeypatch: pytest.MonkeyPatch
) -> None:
    found, said = drained(gangway)
    assert said.startswith(f"only {len(found)} places were found for in_reach_of(bottle), and each failed: ")
    for one, other in combinations(found, 2):
        assert round(math.dist(one[:2], other[:2]), 4) > APART
    monkeypatch.setattr("executive.locations.search.BUDGETS", BUDGETS[:1])
    first, _ = drained(gangway)
    assert len(found) > len(first) > 0
    assert found[: len(first)] == first


@pytest.mark.long
def test_a_plan_tries_as_many_places_as_it_may(gangway: Stage) -> None:
    tried = []

    async def fail() -> None:
        tried.append(gangway.platform.base()[:2])
        raise ManipulationPoseUnreachable(arm="right", what="bottle")

    async def plan() -> None:
        await at_location(IN_REACH, fail, attempts=8)

    with pytest.raises(ObjectUnreachable) as ended:
        gangway.run(plan)
    assert isinstance(ended.value.__cause__, ManipulationPoseUnreachable), "there are more places than attempts"
    assert len(tried) == 8
    assert len({(round(x, 2), round(y, 2)) for x, y in tried}) == 8


def test_the_watchdog_sees_that_a_search_goes_on(ward: Stage) -> None:
    async def search() -> tuple[int, ...]:
        scheduler, _ = here()
        before = scheduler.progress()
        next(ward.resolver.bases(a_location(in_reach_of=THE_BOTTLE)))
        return tuple(now - then for then, now in zip(before, scheduler.progress(), strict=True))

    *others, beats = ward.run(search)
    assert beats > 3
    assert not any(others)
