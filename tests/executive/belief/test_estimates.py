"""What the robot believes by a camera that errs: looks average, moved things begin anew, one miss does not count."""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Collection, Iterator
from dataclasses import replace

import pytest

from executive.belief import Belief
from executive.belief.belief import MOVED
from executive.belief.estimates import Estimate, leaf_value
from executive.belief.memory import Source
from executive.belief.obstacles import with_store
from executive.belief.snapshots import changed_since, with_changes
from executive.maps import MapObject, SemanticMap
from planlang.files import bundled
from planlang.geometry import Pose
from planlang.ontology import Ontology, expand, load
from planlang.protocols import Detection
from sim import PlanningWorld, Scene
from sim.scene import CameraNoise
from tests.executive.belief.test_association import BODIES, BOTTLE, DOORS, MAP, at, bottle

TRUE = at(2.0, 0.3)
Make = Callable[..., Belief]


@pytest.fixture(scope="module")
def ontology() -> Ontology:
    """The vocabulary of maps."""
    return load(bundled("ontologies") / "knowrob.omn")


@pytest.fixture
def made(ontology: Ontology) -> Iterator[Make]:
    """Makes beliefs of things on a table, by a camera that errs."""
    worlds: list[PlanningWorld] = []

    def make(**noise: object) -> Belief:
        things = tuple(MapObject(MAP + one.name, one.name, (expand(one.type),), one.pose, one.size) for one in BODIES)
        worlds.append(PlanningWorld(with_store(Scene(BODIES, joints=DOORS))))
        belief = Belief(SemanticMap(MAP, ontology, things, ()), worlds[-1])
        belief.camera_noise = CameraNoise(**noise)  # type: ignore[arg-type]
        return belief

    yield make
    for world in worlds:
        world.close()


def blurred(pose: Pose, deviation: float, random_of: random.Random, angle: float = 0.0) -> Detection:
    """A detection of a bottle with noise, and its standard deviations."""
    x, y, z = (one + random_of.gauss(0.0, deviation) for one in pose.position)
    turned = Pose.planar(x, y, random_of.gauss(0.0, angle), z)
    return Detection("DrinkingBottle", turned, 1.0, BOTTLE, deviation=deviation, angle_deviation=angle)


def everything(names: Collection[str]) -> Collection[str]:
    """Each picture should show everything."""
    return names


def test_nine_looks_are_three_times_as_good_as_one(made: Make) -> None:
    one, nine, belief = [], [], made(position=0.01)
    for number in range(60):
        belief.bump("bottle1", TRUE)  # the average begins anew
        chance = random.Random(number)
        belief.see([blurred(TRUE, 0.01, chance)])
        one.append(belief.memory.estimates["bottle1"].pose.distance(TRUE) ** 2)
        for _ in range(8):
            belief.see([blurred(TRUE, 0.01, chance)])
        nine.append(belief.memory.estimates["bottle1"].pose.distance(TRUE) ** 2)
        assert belief.memory.estimates["bottle1"].deviation == pytest.approx(0.01 / 3)
    assert math.sqrt(sum(one) / sum(nine)) == pytest.approx(3.0, rel=0.25)


def test_a_bottle_that_was_moved_is_where_it_is_seen_now(made: Make) -> None:
    belief, chance = made(position=0.005), random.Random(1)
    for _ in range(10):
        belief.see([blurred(TRUE, 0.005, chance)])
    moved = blurred(at(2.0, 0.4), 0.005, chance)
    belief.see([moved])
    assert belief.memory.estimates["bottle1"] == Estimate.of(moved)
    assert belief.pose("bottle1") == moved.pose


def test_a_believed_pose_does_not_follow_what_changes_nothing(made: Make) -> None:
    belief, chance = made(position=0.0005), random.Random(2)
    belief.see([blurred(TRUE, 0.0005, chance)])
    revision, pose = belief.revision, belief.pose("bottle1")
    for _ in range(30):
        belief.see([blurred(TRUE, 0.0005, chance)])
    assert (belief.revision, belief.pose("bottle1")) == (revision, pose)
    assert belief.pose("bottle1").distance(belief.memory.estimates["bottle1"].pose) <= 2 * MOVED


def test_an_exact_picture_counts_alone(made: Make) -> None:
    belief = made()
    belief.see([bottle(2.0, 0.305)])
    assert belief.pose("bottle1") == at(2.0, 0.305)
    assert not belief.memory.estimates


def test_what_a_hand_has_touched_begins_anew(made: Make) -> None:
    belief, chance = made(position=0.01), random.Random(3)
    belief.see([blurred(TRUE, 0.01, chance)])
    belief.bump("bottle1", at(2.0, 0.31))
    assert belief.knowledge("bottle1").source is Source.FELT
    assert "bottle1" not in belief.memory.estimates


def test_a_fixed_cabinet_stays_where_the_map_has_it_within_the_noise(made: Make) -> None:
    belief, (_, _, _, _, cabinet, left, _) = made(position=0.01, angle=0.03), BODIES
    beside = Detection(cabinet.type, Pose((4.02, 0.01, 0.51)), 1.0, cabinet.size, deviation=0.01, angle_deviation=0.03)
    door = Detection(left.type, Pose((3.81, 0.31, 0.5)), 1.0, left.size, deviation=0.01, angle_deviation=0.03)
    belief.see([beside, door])
    assert belief.pose("cabinet1") == cabinet.pose
    assert belief.joint("left") == 0.0
    belief.see([replace(beside, pose=Pose((4.3, 0.0, 0.5)))])
    assert belief.pose("cabinet1") == Pose((4.3, 0.0, 0.5))


def test_a_door_is_open_as_far_as_is_seen_and_stays_so() -> None:
    (joint, _), closed = DOORS, BODIES[5].pose
    seen = Estimate(joint.motion(0.7) @ closed, 0.005, 0.035)
    assert leaf_value(joint, closed, 0.0, seen) == pytest.approx(0.7)
    assert leaf_value(joint, closed, 0.69, seen) == 0.69, "that is what is believed already"
    shut = Estimate(joint.motion(0.01) @ closed, 0.005, 0.035)
    assert leaf_value(joint, closed, 0.7, shut) == 0.0
    exact = Estimate(joint.motion(0.01) @ closed, 0.0, 0.0)
    assert leaf_value(joint, closed, 0.0, exact) == pytest.approx(0.01)


def test_one_picture_that_lacks_a_bottle_does_not_make_it_lost_if_the_camera_misses_things(made: Make) -> None:
    far = replace(bottle(2.0, 0.3), pose=at(1.9, 2.0))
    sure, unsure = made(position=0.005), made(position=0.005, misses=0.1)
    for belief in (sure, unsure):
        belief.see([bottle(2.0, 0.3), bottle(2.0, -0.3)])
        belief.see([far], everything)
    assert far.pose in (sure.pose("bottle1"), sure.pose("bottle2")), "it must be one of those that are missing"
    assert (unsure.pose("bottle1"), unsure.pose("bottle2")) == (at(2.0, 0.3), at(2.0, -0.3))
    assert set(unsure.in_doubt) == {"bottle1", "bottle2"}, "further pictures decide"
    unsure.see([far], everything)
    unsure.see([far], everything)
    assert far.pose in (unsure.pose("bottle1"), unsure.pose("bottle2"))
    assert not unsure.in_doubt


def test_a_bottle_that_is_overlooked_now_and_then_keeps_its_name(made: Make) -> None:
    belief, other = made(misses=0.1), bottle(2.0, -0.3)
    belief.see([bottle(2.0, 0.3), other])
    belief.see([other], everything)
    belief.see([other, replace(bottle(2.0, 0.3), pose=at(2.2, 2.0))], everything)
    assert "bottle1" in belief.see([bottle(2.0, 0.31), other], everything)


def test_a_bottle_that_is_seen_again_is_in_doubt_no_more(made: Make) -> None:
    far, belief = replace(bottle(2.0, 0.3), pose=at(1.9, 2.0)), made(misses=0.1)
    belief.see([bottle(2.0, 0.3), bottle(2.0, -0.3)])
    for _ in range(10):
        belief.see([far], everything)
        belief.see([bottle(2.0, 0.3), bottle(2.0, -0.3), far], everything)
    assert not belief.memory.uncertain


def test_a_bottle_that_is_taken_for_a_vase_stays_that_bottle(made: Make) -> None:
    belief = made(confusions=(("DrinkingBottle", "Vase", 0.1),))
    vase = Detection("Vase", at(2.0, 0.3), 1.0, BOTTLE)
    assert list(belief.see([vase])) == ["bottle1"]
    assert list(made().see([vase])) != ["bottle1"], "a camera that does not confuse them has seen another thing"


def test_a_belief_with_estimates_survives_its_snapshot(made: Make) -> None:
    belief, other = made(position=0.01, misses=0.1), made(position=0.01, misses=0.1)
    chance = random.Random(4)
    belief.see([blurred(TRUE, 0.01, chance, 0.03), bottle(2.0, -0.3)])
    belief.see([replace(bottle(2.0, 0.3), pose=at(1.9, 2.0))], everything)
    changed = changed_since(other.snapshot(), belief.snapshot())
    other.restore(with_changes(other.snapshot(), changed))
    assert other.memory.estimates == belief.memory.estimates != {}
    assert other.memory.unseen == belief.memory.unseen != {}
