"""Python names for OWL names."""

import keyword

import pytest
from hypothesis import given
from hypothesis import strategies as st

from planlang.compiler.names import Names, snake_case, without_digits


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("MoveBaseToGraspPose", "move_base_to_grasp_pose"),
        ("robotPose-grasping1", "robot_pose_grasping1"),
        ("Bed-PieceOfFurniture", "bed_piece_of_furniture"),
        ("toLocation", "to_location"),
        ("in-ContGeneric", "in_cont_generic"),
        ("ADTPipetting", "adt_pipetting"),
        ("3DPose", "_3_d_pose"),
        ("Küche", "küche"),
        ("---", "_"),
    ],
)
def test_camel_case_becomes_snake_case(name: str, expected: str) -> None:
    assert snake_case(name) == expected


@given(st.text(min_size=1, max_size=30))
def test_every_claimed_name_is_an_identifier_and_no_keyword(name: str) -> None:
    claimed = Names().claim(snake_case(name))
    assert claimed.isidentifier()
    assert not keyword.iskeyword(claimed)


@given(st.lists(st.sampled_from(["bottle", "bottle_2", "class", "print", "x"]), max_size=12))
def test_no_name_is_given_out_twice(wanted: list[str]) -> None:
    names = Names({"x"})
    claimed = [names.claim(name) for name in wanted]
    assert len(set(claimed)) == len(claimed)
    assert "x" not in claimed


def test_second_bottle_is_bottle_2() -> None:
    names = Names()
    assert [names.claim("bottle"), names.claim("bottle")] == ["bottle", "bottle_2"]


@pytest.mark.parametrize(("name", "expected"), [("bottle1", "bottle"), ("pose_2", "pose"), ("12", "12"), ("a", "a")])
def test_trailing_digits_are_dropped(name: str, expected: str) -> None:
    assert without_digits(name) == expected
