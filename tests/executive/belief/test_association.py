"""Which thing a detection shows: by class, size and mark, near where it is believed; what fits nothing is new."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import pytest

from executive.belief import Belief
from executive.belief.memory import Source
from executive.belief.obstacles import with_store
from executive.maps import MapObject, SemanticMap
from planlang.designators import an_object
from planlang.failures import ObjectUnresolvable
from planlang.files import bundled
from planlang.geometry import Pose
from planlang.ontology import Ontology, expand, load
from planlang.protocols import Detection
from sim import Body, PlanningWorld, Scene
from sim.joints import Articulation, JointKind
from tests.support.detections import detected

MAP = "http://example.org/map.owl#"
BOTTLE = (0.065, 0.065, 0.2)
BODIES = (
    Body("table1", Pose((2.0, 0.0, 0.35)), (0.8, 1.6, 0.7), type="Table-PieceOfFurniture"),
    Body("bottle1", Pose((2.0, 0.3, 0.8)), BOTTLE, "cylinder", type="DrinkingBottle", movable=True),
    Body("bottle2", Pose((2.0, -0.3, 0.8)), BOTTLE, "cylinder", type="DrinkingBottle", movable=True),
    Body("cup1", Pose((2.0, 0.6, 0.75)), (0.08, 0.08, 0.1), "cylinder", type="Cup", movable=True),
    Body("cabinet1", Pose((4.0, 0.0, 0.5)), (0.4, 1.2, 1.0), type="Cabinet-PieceOfFurniture"),
    Body("left", Pose((3.8, 0.3, 0.5)), (0.02, 0.58, 0.9), type="Door"),
    Body("right", Pose((3.8, -0.3, 0.5)), (0.02, 0.58, 0.9), type="Door"),
)
UP = (0.0, 0.0, 1.0)
DOORS = (
    Articulation("left", JointKind.HINGED, (3.8, 0.59, 0.5), UP, 0.0, 1.57, "cabinet1"),
    Articulation("right", JointKind.HINGED, (3.8, -0.59, 0.5), (0.0, 0.0, -1.0), 0.0, 1.57, "cabinet1"),
)


@pytest.fixture(scope="module")
def ontology() -> Ontology:
    """The vocabulary of maps."""
    return load(bundled("ontologies") / "knowrob.omn")


@pytest.fixture
def made(ontology: Ontology) -> Iterator[object]:
    """Makes beliefs of things on a table and of a cabinet with two doors."""
    worlds: list[PlanningWorld] = []

    def make(*changed: Body, **options: object) -> Belief:
        names = {one.name: one for one in changed}
        bodies = tuple(names.get(one.name, one) for one in BODIES)
        things = tuple(MapObject(MAP + one.name, one.name, (expand(one.type),), one.pose, one.size) for one in bodies)
        worlds.append(PlanningWorld(with_store(Scene(bodies, joints=DOORS))))
        return Belief(SemanticMap(MAP, ontology, things, ()), worlds[-1], **options)  # type: ignore[arg-type]

    yield make
    for world in worlds:
        world.close()


def at(x: float, y: float, z: float = 0.8) -> Pose:
    """A pose."""
    return Pose((x, y, z))


def bottle(x: float, y: float, visible: float = 1.0) -> Detection:
    """A bottle that a camera recognises on the table."""
    return Detection("DrinkingBottle", at(x, y), visible, BOTTLE)


def test_each_bottle_is_the_nearest_and_each_detection_another(made) -> None:  # type: ignore[no-untyped-def]
    belief = made()
    found = belief.see([bottle(2.05, -0.2), bottle(2.0, 0.2)])
    assert list(found) == ["bottle1", "bottle2"], "in the order of the map"
    assert belief.pose("bottle1") == at(2.0, 0.2)
    assert belief.pose("bottle2") == at(2.05, -0.2)


def test_two_that_are_nearest_to_the_same_are_the_two_that_are_nearer_together(made) -> None:  # type: ignore[no-untyped-def]
    belief = made()
    belief.see([bottle(2.0, 0.25), bottle(2.0, 0.05)])
    assert (belief.pose("bottle1"), belief.pose("bottle2")) == (at(2.0, 0.25), at(2.0, 0.05))


def test_a_third_bottle_is_a_new_thing_that_a_plan_can_take(made) -> None:  # type: ignore[no-untyped-def]
    belief = made()
    belief.see([bottle(2.0, 0.3), bottle(2.0, -0.3), bottle(2.2, 0.0)])
    assert belief.pose("bottle#3") == at(2.2, 0.0)
    assert belief.knowledge("bottle#3").source is Source.SEEN
    assert belief.pose("bottle1") == at(2.0, 0.3), "nothing else has changed"
    named = an_object("DrinkingBottle", f"{MAP}bottle1")
    assert belief.bind(named, (0.0, 0.0, 0.0)) == "bottle1", "a name means the thing of the map that carries it"
    assert set(belief.of_class(an_object("DrinkingBottle"))) == {"bottle1", "bottle2", "bottle#3"}
    again = belief.see([bottle(2.2, 0.01)])
    assert list(again) == ["bottle#3"], "it is known now"


def test_what_is_not_where_it_should_have_been_seen_may_be_anywhere(made) -> None:  # type: ignore[no-untyped-def]
    belief = made()
    belief.see([bottle(2.0, 0.3), bottle(2.0, -0.3)])
    elsewhere = replace(bottle(4.0, 3.0), visible=0.9)
    shown = belief.see([elsewhere], lambda names: [name for name in names if name == "bottle2"])
    assert list(shown) == ["bottle2"]
    assert belief.pose("bottle2") == elsewhere.pose
    assert not belief.memory.uncertain, "it has been found"


def test_a_new_thing_is_the_missing_one_once_that_is_missed(made) -> None:  # type: ignore[no-untyped-def]
    belief = made()
    belief.see([bottle(2.0, 0.3), bottle(2.0, -0.3)])
    assert list(belief.see([bottle(4.0, 3.0)])) == ["bottle#3"]
    belief.not_there("bottle1")
    with pytest.raises(ObjectUnresolvable):
        belief.bind(an_object("DrinkingBottle", f"{MAP}bottle1"), (0.0, 0.0, 0.0))
    belief.see([bottle(4.0, 3.0)])
    assert belief.pose("bottle1") == at(4.0, 3.0)
    assert "bottle#3" not in belief.names()


def test_an_unknown_thing_is_found_by_its_class_and_features(made) -> None:  # type: ignore[no-untyped-def]
    belief = made(unknown=["bottle2"])
    assert "bottle2" not in belief.names()
    assert list(belief.see([bottle(2.0, 0.3), bottle(0.0, 3.0)])) == ["bottle1", "bottle2"]
    assert belief.pose("bottle2") == at(0.0, 3.0)


def test_class_and_size_tell_things_apart(made) -> None:  # type: ignore[no-untyped-def]
    belief = made()
    large = replace(bottle(2.0, 0.3), size=(0.1, 0.1, 0.3))
    assert list(belief.see([large])) == ["bottle#3"]
    assert list(belief.see([replace(bottle(2.0, 0.3), type="Fork", size=(0.2, 0.02, 0.01))])) == ["fork#1"]


@pytest.mark.parametrize("unknown", [("bottle1", "bottle2"), ("bottle2", "bottle1")])
def test_of_two_unknown_things_the_one_of_the_size_that_is_seen_is_found(made, unknown: tuple[str, str]) -> None:  # type: ignore[no-untyped-def]
    taller = Body(
        "bottle2", Pose((2.0, -0.3, 0.82)), (0.07, 0.07, 0.24), "cylinder", type="DrinkingBottle", movable=True
    )
    belief = made(taller, unknown=unknown)
    assert list(belief.see([replace(bottle(0.0, 3.0), size=taller.size)])) == ["bottle2"]
    assert list(belief.see([bottle(1.0, 3.0), replace(bottle(0.0, 3.0), size=taller.size)])) == ["bottle1", "bottle2"]


def test_of_two_that_were_missed_the_one_of_the_size_that_is_seen_is_found(made) -> None:  # type: ignore[no-untyped-def]
    taller = Body(
        "bottle2", Pose((2.0, -0.3, 0.82)), (0.07, 0.07, 0.24), "cylinder", type="DrinkingBottle", movable=True
    )
    belief = made(taller)
    belief.not_there("bottle1")
    belief.not_there("bottle2")
    assert list(belief.see([replace(bottle(2.2, 2.4), size=taller.size)])) == ["bottle2"], "though bottle1 was nearer"


@pytest.mark.parametrize("feature", ["mark", "colour"])
def test_a_mark_that_the_map_states_decides_against_the_distance(made, feature: str) -> None:  # type: ignore[no-untyped-def]
    ones = (replace(one, **{feature: one.name}) for one in BODIES if one.name.startswith("bottle"))
    belief = made(*ones)
    shown = [detected(belief, "bottle1", at(2.0, -0.3)), detected(belief, "bottle2", at(2.0, 0.3))]
    belief.see(shown)
    assert (belief.pose("bottle1"), belief.pose("bottle2")) == (at(2.0, -0.3), at(2.0, 0.3))
    assert list(belief.see([replace(bottle(2.0, 0.3), label="other", colour="other")])) == ["bottle#3"]


def test_doors_are_told_apart_by_the_way_on_which_they_move(made) -> None:  # type: ignore[no-untyped-def]
    belief = made()
    opened = {joint.leaf: joint.motion(1.2) @ belief.closed_pose(joint.leaf) for joint in DOORS}
    belief.see([detected(belief, name, opened[name]) for name in ("right", "left")])
    assert belief.joint("left") == pytest.approx(1.2)
    assert belief.joint("right") == pytest.approx(1.2)
    assert belief.witnessed("left")


def test_a_thing_in_the_hand_is_no_other_bottle(made) -> None:  # type: ignore[no-untyped-def]
    belief = made()
    belief.grasped("bottle1", "right", "hand", Pose((0.1, 0.0, 0.0)))
    in_hand = at(0.5, 0.0, 1.0)
    shown = belief.see([Detection("DrinkingBottle", in_hand, 1.0, BOTTLE)], in_hands={"bottle1": in_hand})
    assert list(shown) == ["bottle1"]
    assert not [name for name in belief.names() if "#" in name]


def test_what_was_noticed_is_kept_and_forgotten_with_the_belief(made) -> None:  # type: ignore[no-untyped-def]
    belief, other = made(), made()
    belief.see([bottle(2.0, 0.3), bottle(2.2, 0.0), bottle(2.0, -0.3)])
    other.restore(belief.snapshot())
    assert other.pose("bottle#3") == at(2.2, 0.0)
    assert other.snapshot() == belief.snapshot()
