"""Designators are plain values: equal when they describe the same thing, readable when printed."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from planlang.designators import (
    Device,
    Location,
    Object,
    Person,
    Relation,
    a_device,
    a_location,
    a_person,
    a_posture,
    action,
    an_object,
    holding,
    local_name,
)
from planlang.relations import RELATIONS

BOTTLE = an_object("DrinkingBottle", "http://example.org/room.owl#bottle1")
BED = an_object("Bed-PieceOfFurniture")
GRIPPER = a_device("HolderGripper", "http://example.org/robot.owl#rightGripper")

references = st.sampled_from([BOTTLE, BED, a_location(above=BED)])
locations = st.builds(
    lambda relations: a_location(**{name: those[: RELATIONS[name].arity] for name, those in relations.items()}),
    st.dictionaries(st.sampled_from(sorted(RELATIONS)), st.tuples(references, references), min_size=1, max_size=4),
)


def test_an_individual_prints_as_its_name_and_an_anonymous_thing_as_its_class() -> None:
    assert str(BOTTLE) == "bottle1"
    assert str(BED) == "Bed-PieceOfFurniture"


@pytest.mark.parametrize(
    ("iri", "name"),
    [
        ("http://a.b/c#d", "d"),
        ("http://a.b/c/d", "d"),
        ("http://a.b/c#d/e", "e"),
        ("plain", "plain"),
        ("http://a.b/c#", ""),
        ("", ""),
    ],
)
def test_the_local_name_is_what_follows_the_last_mark(iri: str, name: str) -> None:
    assert local_name(iri) == name


def test_a_person_and_a_device_are_objects_of_their_own_kind() -> None:
    assert isinstance(a_person(), Person)
    assert a_person().type == "Person"
    assert isinstance(GRIPPER, Device)
    assert a_device("X") != an_object("X"), "a part of the robot is not a thing of the room"


def test_designators_of_the_same_thing_are_one_key() -> None:
    assert len({BOTTLE, an_object("DrinkingBottle", BOTTLE.iri), a_location(on=BED), a_location(on=BED)}) == 2
    assert len({a_location(on=BED, near=BOTTLE), a_location(near=BOTTLE, on=BED)}) == 1, "the order means nothing"
    assert a_location(on=BED, near=BOTTLE) != a_location(near=BED, on=BOTTLE)
    assert a_location(on=BED) != a_location(on=BED, grasp="top")


def test_a_designator_cannot_be_changed() -> None:
    with pytest.raises(AttributeError):
        BOTTLE.type = "Cup"  # type: ignore[misc]


def test_a_location_keeps_its_relations_in_the_order_of_the_source() -> None:
    assert str(a_location(in_front_of=BOTTLE, above=BED)) == "in_front_of(bottle1) and above(Bed-PieceOfFurniture)"
    assert str(a_location(above=BED, in_front_of=BOTTLE)) == "above(Bed-PieceOfFurniture) and in_front_of(bottle1)"


def test_a_relation_to_several_references_is_one_conjunct_each() -> None:
    assert a_location(in_reach_of=(BOTTLE, BED)) == a_location(in_reach_of=BOTTLE) & a_location(in_reach_of=BED)
    assert a_location(in_reach_of=iter([BOTTLE, BED])) == a_location(in_reach_of=[BOTTLE, BED])


def test_what_is_between_two_things_is_one_conjunct_with_both() -> None:
    between = a_location(between=(BOTTLE, BED))
    assert [relation.references for relation in between.relations] == [(BOTTLE, BED)]
    assert str(between) == "between(bottle1, Bed-PieceOfFurniture)"
    assert a_location(between=((BOTTLE, BED), (BED, GRIPPER))) == between & a_location(between=(BED, GRIPPER))
    assert list(between.things()) == [BOTTLE, BED]


@pytest.mark.parametrize("things", [BOTTLE, (BOTTLE,), (BOTTLE, BED, BED), ((BOTTLE, BED), (BED,)), ("bed", BED), 1])
def test_anything_but_two_things_is_refused_for_between_with_the_right_code(things: object) -> None:
    with pytest.raises(ValueError, match="between of a_location relates to two objects") as caught:
        a_location(between=things)  # type: ignore[arg-type]
    assert "right: a_location(between=(bed, table))" in str(caught.value)


def test_a_relation_with_one_reference_is_read_as_before_with_a_warning() -> None:
    with pytest.warns(DeprecationWarning, match="a relation may have several"):
        relation = Relation("near", BED)  # type: ignore[arg-type]
    with pytest.warns(DeprecationWarning, match=r"Relation.references\[0\]"):
        assert relation.reference == BED
    assert relation == Relation("near", (BED,))


def test_a_location_may_be_relative_to_a_location_and_says_with_what() -> None:
    location = a_location(in_reach_of=a_location(above=BED), using=GRIPPER)
    assert str(location) == "in_reach_of(above(Bed-PieceOfFurniture)) with rightGripper"


def test_an_unknown_relation_is_refused_with_those_there_are() -> None:
    with pytest.raises(ValueError, match="unknown relation 'under'; valid relations: in_reach_of, above"):
        a_location(under=BED)


@pytest.mark.parametrize("nothing", [{}, {"in_reach_of": ()}])
def test_a_location_without_relations_is_refused_and_a_posture_is_offered(nothing: dict[str, tuple[Object]]) -> None:
    with pytest.raises(ValueError, match=r"a_posture\(name\)"):
        a_location(**nothing)


def test_a_posture_is_a_location_without_relations() -> None:
    assert a_posture("carrying").relations == ()
    assert str(a_posture("carrying")) == "posture carrying"


def test_postures_are_told_apart_by_their_names() -> None:
    assert a_posture("carrying") != a_posture("reset")
    assert a_posture("carrying") == a_posture("carrying")


def test_the_name_of_a_location_is_for_people_and_does_not_make_it_another() -> None:
    assert a_location("approach", in_front_of=BOTTLE) == a_location(in_front_of=BOTTLE)


@given(locations, locations)
def test_a_conjunction_has_every_relation_of_both_once(one: Location, other: Location) -> None:
    both = one & other
    assert set(both.relations) == set(one.relations) | set(other.relations)
    assert len(both.relations) == len(set(both.relations))
    assert both.relations[: len(one.relations)] == one.relations


@given(locations, locations, locations)
def test_conjunctions_can_be_grouped_in_any_way(one: Location, two: Location, three: Location) -> None:
    assert (one & two) & three == one & (two & three)
    assert one & one == one


@given(locations)
def test_a_location_survives_being_printed_without_losing_a_relation(location: Location) -> None:
    assert all(str(relation) in str(location) for relation in location.relations)


def test_a_conjunction_keeps_the_device_that_was_named() -> None:
    plain, with_gripper = a_location(above=BED), a_location(on=BED, using=GRIPPER)
    assert (plain & with_gripper).device == (with_gripper & plain).device == GRIPPER


def test_a_conjunction_of_two_arms_two_grasps_or_a_posture_is_refused() -> None:
    right, left = a_location(in_reach_of=BOTTLE, using=GRIPPER), a_location(in_reach_of=BED, using=a_device("LeftArm"))
    with pytest.raises(ValueError, match=r"one location names two arms: rightGripper and LeftArm\. A base from"):
        right & left
    with pytest.raises(ValueError, match="one location names two grasps: top and side"):
        a_location(in_reach_of=BOTTLE, grasp="top") & a_location(in_reach_of=BED, grasp="side")
    for pair in ((a_posture("carrying"), right), (right, a_posture("carrying"))):
        with pytest.raises(ValueError, match="a posture or a fixed pose"):
            pair[0] & pair[1]
    both = a_location(in_reach_of=(a_location(above=BED, using=GRIPPER), a_location(on=BED, using=a_device("LeftArm"))))
    assert both.device is None


def test_actions_with_the_same_properties_are_equal_in_whatever_order_they_were_written() -> None:
    one = action("Reaching", to_location=a_location(above=BED), device_used=GRIPPER)
    other = action("Reaching", device_used=GRIPPER, to_location=a_location(above=BED), name="ReachOver")
    assert one == other
    assert hash(one) == hash(other)
    assert one.get("device_used") == GRIPPER
    assert one.get("object_acted_on") is None


def test_an_action_prints_its_class_and_properties() -> None:
    text = str(action("http://example.org/kb#Pouring", object_acted_on=BOTTLE, amount=0.2))
    assert text == "Pouring(amount=0.2, object_acted_on=bottle1)"
    assert str(holding(BOTTLE)) == "holding(bottle1)"


def test_a_distance_is_in_metres_or_has_a_unit() -> None:
    assert a_location(near=BED, within="30 cm") == a_location(near=BED, within=0.3)
    assert a_location(near=BED, within="35cm").relations[0].within == 0.35
    assert a_location(far_from=BED, beyond="1 ft").relations[0].beyond == 0.3048
    assert str(a_location(near=BED, beyond=0.1, within="1 m")) == (
        "near(Bed-PieceOfFurniture, beyond 0.1 m, within 1.0 m)"
    )


@pytest.mark.parametrize("length", ["30", "cm", "30 miles", "-1 m", "1e999 m", "1_0 m", float("nan"), -1, True, "٣ m"])
def test_what_is_no_length_is_refused(length: float | str) -> None:
    with pytest.raises(ValueError, match=r"length"):
        a_location(near=BED, within=length)


def test_a_bound_is_that_of_the_one_relation_that_has_a_distance() -> None:
    assert str(a_location(in_reach_of=BOTTLE, near=BED, within=0.5)) == (
        "in_reach_of(bottle1) and near(Bed-PieceOfFurniture, within 0.5 m)"
    )
    for relations in ({"in_reach_of": BOTTLE}, {"near": (BOTTLE, BED)}):
        with pytest.raises(ValueError, match="bound one relation"):
            a_location(within=0.5, **relations)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="no distance is beyond"):
        a_location(near=BED, within=0.2, beyond=0.3)


def test_what_must_not_hold_is_a_negated_conjunct() -> None:
    location = a_location(in_reach_of=BOTTLE, not_=a_location(near=BED, within=1.0))
    assert str(location) == "in_reach_of(bottle1) and not near(Bed-PieceOfFurniture, within 1.0 m)"
    assert location == a_location(in_reach_of=BOTTLE) & ~a_location(near=BED, within=1.0)
    assert ~~a_location(near=BED) == a_location(near=BED)


def test_only_single_relations_are_negated() -> None:
    with pytest.raises(ValueError, match="one relation"):
        a_location(in_reach_of=BOTTLE, not_=a_location(near=BED, on=BED))
    with pytest.raises(ValueError, match="without arm and grasp"):
        a_location(not_=a_location(in_reach_of=BOTTLE, using=GRIPPER))


def test_a_grasp_is_one_of_the_classes_there_are() -> None:
    assert str(a_location(in_reach_of=BOTTLE, grasp="top")) == "in_reach_of(bottle1) by a top grasp"
    with pytest.raises(ValueError, match="side, tilted, top"):
        a_location(in_reach_of=BOTTLE, grasp="below")


def test_visible_is_another_word() -> None:
    assert a_location(visible=BED) == a_location(visible_from=BED)
