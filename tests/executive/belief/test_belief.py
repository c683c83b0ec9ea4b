"""The robot's belief: bound, seen, bumped into, held, let go; and a planning world made equal to it."""

import json
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from executive.belief import Belief
from executive.belief.map_writing import map_text
from executive.belief.memory import Source
from executive.belief.obstacles import MOST, NAMES, with_store
from executive.maps import SemanticMap, read_map, scene_of
from executive.robots import Robot, bind_robot
from planlang.designators import Object, an_object
from planlang.failures import AmbiguousPerception, ObjectUnresolvable
from planlang.files import bundled
from planlang.geometry import Pose
from planlang.ontology import load
from planlang.protocols import Configuration
from planlang.state import Grip, Made
from sim import PlanningWorld, WorldMirror
from tests.support.detections import detected, recognise
from tests.support.world_values import value_of

HERE = (0.0, 0.0, 0.0)
MAP = "http://example.org/map.owl#"


@pytest.fixture(scope="module")
def robot() -> Robot:
    """Amigo."""
    return bind_robot("amigo")


@pytest.fixture
def semantic_map(
    map_of: Callable[..., SemanticMap], thing: Callable[..., str], seen: Callable[..., str]
) -> SemanticMap:
    """A table with two bottles, and a bottle on the floor as far from the middle as the first of them."""
    return map_of(
        thing("table1", "Table-PieceOfFurniture", (0.8, 0.8, 0.7)),
        thing("bottle1", "DrinkingBottle", (0.06, 0.06, 0.2)),
        thing("bottle2", "DrinkingBottle", (0.06, 0.06, 0.2)),
        thing("cup1", "Cup", (0.08, 0.08, 0.1)),
        seen("table1", (2.0, 0.0, 0.35)),
        seen("bottle1", (2.0, 0.0, 0.8)),
        seen("bottle2", (2.3, 0.0, 0.8)),
        seen("cup1", (-2.3, 0.0, 0.05)),
    )


@pytest.fixture
def planning(semantic_map: SemanticMap, robot: Robot) -> Iterator[PlanningWorld]:
    """A world of the map with Amigo in it."""
    world = PlanningWorld(scene_of(semantic_map), robot.body())
    yield world
    world.close()


@pytest.fixture
def belief(semantic_map: SemanticMap, planning: PlanningWorld) -> Belief:
    """The belief of a robot that has seen nothing yet."""
    return Belief(semantic_map, planning)


def test_nothing_has_been_seen_at_first_and_things_are_where_the_map_says(belief: Belief) -> None:
    assert belief.pose("bottle1").position == (2.0, 0.0, 0.8)
    assert not belief.seen_from_here("bottle1")


def test_an_iri_binds_before_the_class(belief: Belief) -> None:
    assert belief.bind(an_object("DrinkingBottle", MAP + "bottle2"), HERE) == "bottle2"


def test_a_class_binds_to_the_nearest_of_its_things_subclasses_included(belief: Belief) -> None:
    assert belief.bind(an_object("DrinkingBottle"), HERE) == "bottle1"
    assert belief.bind(an_object("DrinkingVessel"), (-3.0, 0.0, 0.0)) == "cup1"


def test_classes_and_things_of_one_name_in_two_namespaces_are_told_apart(robot: Robot, tmp_path: Path) -> None:
    text = "Prefix: knowrob: <http://knowrob.org/kb/knowrob.owl#>\n"
    for number, kind in enumerate("ab"):
        text += (
            f"Individual: <http://{kind}.org/x#thing1>\n    Types: <http://{kind}.org/x#Bottle>\n    Facts: "
            f"knowrob:pose <http://m.org/m#pose{kind}>, knowrob:depthOfObject 0.1, knowrob:widthOfObject 0.1, "
            f"knowrob:heightOfObject 0.2\nIndividual: <http://m.org/m#pose{kind}>\n    Types: knowrob:Pose\n    Facts: "
            f'knowrob:translation "{number + 1} 0 0.4", knowrob:quaternion "0 0 0 1"\n'
        )
    (tmp_path / "m.omn").write_text(text)
    semantic_map = read_map(load(tmp_path / "m.omn"))

    def bound(kind: str, iri: str | None = None) -> str:
        world = PlanningWorld(scene_of(semantic_map), robot.body())
        try:
            return Belief(semantic_map, world).bind(Object(kind, iri), HERE)
        finally:
            world.close()

    assert [bound("http://a.org/x#Bottle"), bound("http://b.org/x#Bottle")] == ["thing1", "thing1_2"]
    assert bound("http://a.org/x#Bottle", "http://b.org/x#thing1") == "thing1_2", "an IRI binds first"
    assert bound("http://b.org/x#Bottle", "http://c.org/x#thing1") == "thing1_2", "a name is no IRI"
    assert bound("http://c.org/x#Bottle") == "thing1", "what the map has nothing of is known by its name"


@pytest.mark.parametrize(("name", "label"), [("bottle2", ""), ("Bottle_2", ""), ("obj7", "bottle 2")])
def test_the_name_and_class_of_another_namespace_bind_before_the_nearest(
    robot: Robot, tmp_path: Path, name: str, label: str
) -> None:
    text = "Prefix: k: <http://knowrob.org/kb/knowrob.owl#>\nPrefix: rdfs: <http://www.w3.org/2000/01/rdf-schema#>\n"
    things = (("bottle1", "DrinkingBottle", 1), (name, "DrinkingBottle", 3), ("cup2", "Cup", 2), ("cup9", "Cup", 4))
    for number, (each, kind, x) in enumerate(things):
        note = f'Annotations: rdfs:label "{label}"' if number == 1 and label else ""
        text += (
            f"Individual: <http://m.org/m#{each}>\n    {note}\n    Types: k:{kind}\n    Facts: "
            f'k:translation "{x} 0 0.4", k:boundingBoxSize "0.1 0.1 0.2"\n'
        )
    (tmp_path / "m.omn").write_text(text)
    semantic_map = read_map(load(tmp_path / "m.omn"))
    world = PlanningWorld(scene_of(semantic_map), robot.body())
    try:
        belief = Belief(semantic_map, world)
        assert belief.bind(an_object("DrinkingBottle", "http://recipe.org/r#bottle2"), HERE) == name
        assert belief.bind(an_object("DrinkingBottle", "http://recipe.org/r#cup2"), HERE) == "bottle1", "another class"
        hidden = Belief(semantic_map, world, unknown=[name])
        with pytest.raises(ObjectUnresolvable, match="has not been found yet"):
            hidden.bind(an_object("DrinkingBottle", "http://recipe.org/r#bottle2"), HERE)
    finally:
        world.close()


def test_a_thing_that_has_not_been_found_is_not_taken_for_another_of_its_class(
    semantic_map: SemanticMap, planning: PlanningWorld
) -> None:
    belief = Belief(semantic_map, planning, unknown=["bottle1"])
    with pytest.raises(ObjectUnresolvable, match="has not been found yet"):
        belief.bind(Object("DrinkingBottle", f"{MAP}bottle1"), HERE)
    assert belief.bind(an_object("DrinkingBottle"), HERE) == "bottle2"


def test_a_designator_keeps_meaning_what_it_was_bound_to(belief: Belief) -> None:
    bottle = an_object("DrinkingBottle")
    assert belief.bind(bottle, HERE) == "bottle1"
    assert belief.bind(bottle, (5.0, 0.0, 0.0)) == "bottle1"


def test_an_unknown_class_is_told_by_its_name(belief: Belief) -> None:
    assert belief.bind(an_object("http://example.org/recipe.owl#DrinkingBottle"), HERE) == "bottle1"


def test_what_is_not_there_cannot_be_bound(belief: Belief) -> None:
    with pytest.raises(ObjectUnresolvable, match="bottle1, bottle2"):
        belief.bind(an_object("Bed-PieceOfFurniture"), HERE)


EQUALLY_FAR = {"bottle1": Pose((2.0, 0.3, 0.8)), "bottle2": Pose((2.0, -0.3, 0.8))}


def test_of_two_equally_near_things_that_nothing_distinguishes_one_is_as_good_as_the_other(belief: Belief) -> None:
    belief.see([detected(belief, name, pose) for name, pose in EQUALLY_FAR.items()])
    assert belief.bind(an_object("DrinkingBottle"), HERE) == "bottle1"


@pytest.mark.parametrize("fact", ['colourOfObject "red"', 'markOfObject "water"'])
def test_two_equally_near_things_that_are_seen_are_ambiguous_if_they_differ(
    fact: str, map_of: Callable[..., SemanticMap], thing: Callable[..., str], seen: Callable[..., str], robot: Robot
) -> None:
    things = [
        thing(name, "DrinkingBottle", (0.06, 0.06, 0.2), *more)
        for name, more in (("bottle1", ()), ("bottle2", (fact,)))
    ]
    there = map_of(*things, *(seen(name, pose.position) for name, pose in EQUALLY_FAR.items()))
    with closing(PlanningWorld(scene_of(there), robot.body())) as world:
        belief = Belief(there, world)
        belief.see([detected(belief, name, pose) for name, pose in EQUALLY_FAR.items()])
        with pytest.raises(AmbiguousPerception) as problem:
            belief.bind(an_object("DrinkingBottle"), HERE)
    assert problem.value.candidates == ("bottle1", "bottle2")


def test_seeing_a_thing_elsewhere_changes_the_belief_and_is_told(belief: Belief) -> None:
    told: list[tuple[str, Mapping[str, Any]]] = []
    belief.tell = lambda event, details: told.append((event, details))
    recognise(belief, "bottle1", Pose((2.1, 0.1, 0.8)), 0.9)
    assert belief.pose("bottle1").position == (2.1, 0.1, 0.8)
    assert belief.seen_from_here("bottle1")
    assert belief.revision == 1
    assert [(event, details["change"]) for event, details in told] == [("belief", "seen")]


def test_what_stands_on_a_table_goes_along_when_the_table_is_seen_elsewhere_unless_it_was_seen_itself(
    belief: Belief,
) -> None:
    recognise(belief, "bottle2", belief.pose("bottle2"), 0.9)
    recognise(belief, "table1", Pose((2.0, 0.1, 0.35)), 0.9)
    assert belief.pose("bottle1").position == pytest.approx((2.0, 0.1, 0.8))
    assert belief.pose("bottle2").position == pytest.approx((2.3, 0.0, 0.8))
    assert belief.pose("cup1").position == pytest.approx((-2.3, 0.0, 0.05))
    recognise(belief, "table1", Pose((2.0, 0.2, 0.35)), 0.9)
    assert belief.pose("bottle1").position == pytest.approx((2.0, 0.2, 0.8))


def test_seeing_a_thing_where_it_was_believed_changes_nothing_but_that_it_was_seen(belief: Belief) -> None:
    recognise(belief, "bottle1", Pose((2.001, 0.0, 0.8)), 0.9)
    assert belief.revision == 0
    assert belief.seen_from_here("bottle1")


def test_after_the_base_moved_things_have_to_be_looked_at_again(belief: Belief) -> None:
    recognise(belief, "bottle1", Pose((2.0, 0.0, 0.8)), 0.9)
    belief.base_moved()
    assert not belief.seen_from_here("bottle1")


def test_places_from_where_a_thing_was_not_seen_are_remembered_until_it_is(belief: Belief) -> None:
    belief.not_seen("bottle1", HERE)
    belief.not_seen("bottle1", (1.0, 0.0, 0.0))
    assert belief.looked_in_vain("bottle1") == (HERE, (1.0, 0.0, 0.0))
    recognise(belief, "bottle1", Pose((2.0, 0.0, 0.8)), 0.9)
    assert belief.looked_in_vain("bottle1") == ()


def test_bumping_into_a_thing_tells_where_it_is(belief: Belief) -> None:
    belief.bump("table1", Pose((1.7, 0.0, 0.35)))
    assert belief.pose("table1").position == (1.7, 0.0, 0.35)
    assert belief.pose("bottle1").position == pytest.approx((1.7, 0.0, 0.8)), "it goes along"


def test_places_relative_to_a_held_thing_keep_its_last_pose_until_it_is_let_go(belief: Belief, robot: Robot) -> None:
    before = belief.pose("bottle1")
    belief.grasped("bottle1", "right", robot.arm("right").hand_link, Pose((0.14, 0.0, 0.0)))
    assert belief.reference_pose("bottle1") == before
    recognise(belief, "bottle1", Pose((0.0, 0.0, 1.0)), 1.0)
    assert belief.reference_pose("bottle1") == before
    belief.released("bottle1", Pose((1.0, 1.0, 0.8)))
    assert belief.reference_pose("bottle1").position == (1.0, 1.0, 0.8)
    assert belief.held == {}


def test_the_planning_world_becomes_what_is_believed(belief: Belief, planning: PlanningWorld, robot: Robot) -> None:
    hand = robot.arm("right").hand_link
    here = Configuration((-1.0, 0.5, 0.3), robot.postures["carrying"])
    recognise(belief, "cup1", Pose((-2.0, 0.4, 0.05)), 1.0)
    belief.grasped("bottle1", "right", hand, Pose((0.14, 0.0, 0.0)))
    belief.released("bottle2", Pose((0.0, 0.0, 1.0)), to="somebody")
    mirror = WorldMirror(planning, belief.robot)
    belief.observed(here, mirror)
    mirror.at(belief.state)
    assert planning.configuration().base == here.base
    assert planning.pose("cup1").position == (-2.0, 0.4, 0.05)
    assert planning.attached() == {"bottle1": hand}
    expected = planning.link_pose(hand) @ Pose((0.14, 0.0, 0.0))
    assert np.allclose(planning.pose("bottle1").position, expected.position, atol=1e-6)
    assert "bottle2" not in planning.names()
    belief.released("bottle1", Pose((2.0, 0.1, 0.8)))
    mirror.at(belief.state)
    assert planning.attached() == {}
    assert planning.pose("bottle1").position == (2.0, 0.1, 0.8)


def test_the_planning_world_is_as_before_after_it_was_asked_about_other_states(
    belief: Belief, planning: PlanningWorld, robot: Robot
) -> None:
    mirror, hand, cup = WorldMirror(planning, belief.robot), robot.arm("right").hand_link, belief.pose("cup1")
    believed = belief.state
    before = value_of(mirror.at(believed))
    elsewhere = believed.placed({"cup1": Pose((-2.0, 0.4, 0.05)), "bottle2": None})
    grip = Grip("right", hand, Pose((0.14, 0.0, 0.0)), believed.poses["bottle1"])
    tucked = elsewhere.with_robot(belief.robot, Configuration(HERE, robot.postures["carrying"]))
    held = replace(tucked, held={"bottle1": grip})
    assert (mirror.at(elsewhere).pose("cup1").position, "bottle2" in planning.names()) == ((-2.0, 0.4, 0.05), False)
    assert mirror.at(held).attached() == {"bottle1": hand}
    assert value_of(mirror.at(believed)) == before
    assert (belief.pose("cup1"), belief.held) == (cup, {})


def test_what_is_bound_in_a_hypothesis_is_bound_for_it_alone(belief: Belief) -> None:
    supposed = belief.supposing(belief.state.placed({"bottle1": None}))
    bottle = Object("DrinkingBottle")
    assert supposed.bind(bottle, HERE) == "bottle2"
    assert ("bottle1" in supposed.memory.unknown, "bottle1" in belief.memory.unknown) == (True, False)
    assert (belief.bind(bottle, HERE), supposed.bind(bottle, HERE)) == ("bottle1", "bottle2")


def test_what_happens_in_a_hypothesis_leaves_the_belief_and_its_memory_as_they_were(belief: Belief) -> None:
    belief.not_seen("bottle1", HERE)
    state, memory = belief.state, belief.memory
    supposed = belief.supposing(belief.state)
    recognise(supposed, "bottle1", Pose((2.0, 0.5, 0.8)), 1.0)
    supposed.not_there("cup1")
    supposed.base_moved()
    assert (belief.state, belief.memory) == (state, memory)
    assert memory.in_vain == {"bottle1": (HERE,)}
    assert supposed.memory.in_vain == {}


def test_two_beliefs_to_which_the_same_happened_have_equal_memories(belief: Belief) -> None:
    one, other = belief.supposing(belief.state), belief.supposing(belief.state)
    for each in (one, other):
        recognise(each, "bottle1", Pose((2.0, 0.5, 0.8)), 1.0)
        each.bind(Object("DrinkingBottle"), HERE)
        each.not_there("cup1")
    assert one.memory is not other.memory
    assert one.memory == other.memory != belief.memory


def test_a_restored_belief_has_the_memory_that_was_left(belief: Belief, semantic_map: SemanticMap) -> None:
    fresh = belief.supposing(belief.state)
    recognise(belief, "bottle1", Pose((2.0, 0.5, 0.8)), 1.0)
    belief.bind(Object("DrinkingBottle"), HERE)
    belief.not_seen("cup1", HERE)
    belief.not_there("bottle2")
    pancake = Made("Pancake", (0.1, 0.1, 0.01), Pose((1.0, 1.0, 1.0)))
    poses = {**belief.state.poses, "pancake": pancake.at}
    belief.happened(replace(belief.state, poses=poses, made={"pancake": pancake}))
    belief.learn()
    belief.recognises_by(belief.memory.recognition.without("vision"))
    belief.base_moved()
    fresh.restore(json.loads(json.dumps(belief.snapshot())))
    assert fresh.memory == belief.memory
    assert (fresh.state.poses, fresh.state.made) == (belief.state.poses, belief.state.made)


@pytest.mark.parametrize(
    ("key", "damage"),
    [
        ("matter", {}),
        ("matter", {"contents": {"nothing": []}}),
        ("created", [["bottle1", "Dough", "box", [1, 1, 1], [0, 0, 0, 0, 0, 0, 1]]]),
        ("created", [["x", "Dough", "box", [1, 1, -1], [0, 0, 0, 0, 0, 0, 1]]]),
        ("created", 5),
    ],
)
def test_a_damaged_state_is_refused(belief: Belief, key: str, damage: object) -> None:
    left = belief.snapshot()
    with pytest.raises(ValueError, match=r"."):
        belief.restore({**left, "things": {**left["things"], key: damage}})


def test_what_a_person_took_is_out_of_the_planning_world_until_it_is_grasped_again(
    belief: Belief, planning: PlanningWorld, robot: Robot
) -> None:
    arm = robot.arms[0]
    offset = Pose((0.05, 0.0, 0.0))
    belief.grasped("bottle1", arm.name, arm.tip, offset)
    belief.released("bottle1", belief.pose("bottle1"), to="somebody")
    mirror = WorldMirror(planning, belief.robot)
    mirror.at(belief.state)
    assert "bottle1" not in planning.names()
    belief.grasped("bottle1", arm.name, arm.tip, offset)
    mirror.at(belief.state)
    assert planning.attached() == {"bottle1": arm.tip}
    assert planning.pose("bottle1").distance(planning.link_pose(arm.tip) @ offset) < 1e-6


def test_obstacles_that_were_felt_are_things_without_a_name_in_the_map(semantic_map: SemanticMap, robot: Robot) -> None:
    world = PlanningWorld(with_store(scene_of(semantic_map)), robot.body())
    belief, mirror = Belief(semantic_map, world), WorldMirror(world, "robot")
    mirror.at(belief.state)
    assert not set(world.names()) & set(NAMES)
    for number in range(MOST + 1):
        belief.obstacle(Pose((2.0, 0.1 * number, 0.5)))
    mirror.at(belief.state)
    felt = [name for name in world.names() if name in NAMES]
    assert len(felt) == MOST, "the oldest one is forgotten for the last"
    assert min(world.pose(name).position[1] for name in felt) == pytest.approx(0.1)
    other = Belief(semantic_map, world)
    other.restore(json.loads(json.dumps(belief.snapshot())))
    assert (other.names(), other.memory.met) == (belief.names(), NAMES[0])
    belief.forget(felt)
    assert belief.memory.met is None
    mirror.at(belief.state)
    assert not set(world.names()) & set(NAMES)
    world.close()


def test_source_and_time_of_a_pose_are_known(belief: Belief) -> None:
    assert belief.knowledge("bottle1").source is Source.MAP
    belief.heated_until(3.0)
    recognise(belief, "bottle1", belief.pose("bottle1"), 1.0)
    assert belief.knowledge("bottle1") == (Source.SEEN, 3.0, 0)
    belief.base_moved()
    assert belief.remembers("bottle1")
    belief.bump("bottle1", belief.pose("bottle1"))
    assert belief.knowledge("bottle1").source is Source.FELT
    assert not belief.remembers("bottle1")
    recognise(belief, "bottle1", belief.pose("bottle1"), 1.0)
    belief.not_seen("bottle1", HERE)
    assert not belief.remembers("bottle1"), "it was looked for in vain since"


def test_a_map_that_is_written_has_the_handles_of_what_was_moved(robot: Robot, tmp_path: Path) -> None:
    kitchen = read_map(load(bundled("ontologies") / "environments" / "stove_with_pans.omn"))
    world = PlanningWorld(scene_of(kitchen), robot.body())
    belief = Belief(kitchen, world)
    recognise(belief, "pan1", Pose.planar(-1.6, 0.2, 1.0, 0.765), 1.0)
    path = tmp_path / "map.omn"
    path.write_text(map_text(belief), encoding="utf-8")
    world.close()
    before, after = scene_of(kitchen), scene_of(read_map(load(path)))
    assert after.body("pan1").pose.position == pytest.approx((-1.6, 0.2, 0.765))
    for name in ("pan1", "pot1", "kettle1"):
        found = [one.pose.position for one in after.body(name).handles]
        assert found == [pytest.approx(one.pose.position, abs=1e-6) for one in before.body(name).handles]


def test_a_map_that_is_written_has_what_was_left_open(tmp_path: Path) -> None:
    room = read_map(load(bundled("ontologies") / "environments" / "kitchenette.omn"))
    world = PlanningWorld(scene_of(room))
    belief = Belief(room, world)
    leaf = next(name for name, joint in belief.joints.items() if not joint.is_knob)
    belief.moved(leaf, 1.0)
    (tmp_path / "map.omn").write_text(map_text(belief), encoding="utf-8")
    world.close()
    again = {joint.leaf: joint.first for joint in scene_of(read_map(load(tmp_path / "map.omn"))).joints}
    assert {name: first for name, first in again.items() if first} == {leaf: belief.joint(leaf)}
