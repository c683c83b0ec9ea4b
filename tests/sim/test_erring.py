"""What a camera that errs tells: poses with noise, not everything, and sometimes another class, by seed and picture."""

from __future__ import annotations

import math
import statistics
from dataclasses import replace

import pytest

from planlang.geometry import Pose
from planlang.protocols import Detection
from sim.erring import Erring
from sim.scene import TYPICAL, CameraModel, CameraNoise

BOTTLE = Detection("DrinkingBottle", Pose((2.0, 0.0, 0.8)), 1.0, (0.06, 0.06, 0.2))
EYE = Pose((0.0, 0.0, 0.8))
PICTURES = 2000


def told(noise: CameraNoise, seed: int = 0, shown: dict[str, Detection] | None = None) -> list[dict[str, Detection]]:
    """What a camera tells in many pictures of a bottle that is 2 m away."""
    erring = Erring(CameraModel("camera", noise=noise), seed, lambda name: ("DrinkingBottle", "Bottle"))
    return [erring.told(shown or {"bottle1": BOTTLE}, EYE) for _ in range(PICTURES)]


def test_positions_err_by_the_stated_deviation_along_each_axis() -> None:
    seen = [one["bottle1"] for one in told(CameraNoise(position=0.004, position_per_metre=0.0015))]
    assert {one.deviation for one in seen} == {0.005}, "the root of 4 mm squared and 2 times 1.5 mm squared"
    for axis in range(3):
        errors = [one.pose.position[axis] - BOTTLE.pose.position[axis] for one in seen]
        assert statistics.stdev(errors) == pytest.approx(0.005, rel=0.1)
        assert statistics.mean(errors) == pytest.approx(0.0, abs=0.0005)
    assert {one.pose.orientation for one in seen} == {BOTTLE.pose.orientation}


def test_rotations_err_by_the_stated_angle_about_each_axis() -> None:
    seen = [one["bottle1"] for one in told(CameraNoise(angle=0.03))]
    turns = [one.pose.turn(BOTTLE.pose) for one in seen]
    assert math.sqrt(statistics.mean(turn**2 for turn in turns)) == pytest.approx(0.03 * math.sqrt(3), rel=0.1)
    assert {one.pose.position for one in seen} == {BOTTLE.pose.position}


def test_what_is_hidden_and_far_is_missed_as_often_as_stated() -> None:
    noise = CameraNoise(misses=0.1, misses_hidden=0.5, misses_far=0.2)
    half = {"bottle1": replace(BOTTLE, visible=0.5)}
    share = sum(not one for one in told(noise, shown=half)) / PICTURES
    assert share == pytest.approx(1 - 0.9 * 0.75 * 0.9, abs=0.03), "2 of 4 m, half in sight"


def test_a_class_is_taken_for_others_as_often_as_stated() -> None:
    noise = CameraNoise(confusions=(("Bottle", "Cup", 0.2), ("Bottle", "Vase", 0.1), ("Cup", "Bowl", 0.9)))
    types = [one["bottle1"].type for one in told(noise)]
    assert types.count("Cup") / PICTURES == pytest.approx(0.2, abs=0.03)
    assert types.count("Vase") / PICTURES == pytest.approx(0.1, abs=0.03)
    assert set(types) == {"DrinkingBottle", "Cup", "Vase"}


def test_equal_seeds_err_equally_whatever_else_is_in_the_picture() -> None:
    alone = told(TYPICAL, seed=3)
    both = told(TYPICAL, seed=3, shown={"cup1": replace(BOTTLE, type="Cup"), "bottle1": BOTTLE})
    assert [one.get("bottle1") for one in alone] == [one.get("bottle1") for one in both]
    assert alone != told(TYPICAL, seed=4)


def test_a_factor_multiplies_deviations_and_probabilities() -> None:
    noise = CameraNoise(0.002, 0.001, 0.02, 0.4, 0.5, 0.1, (("Cup", "Bowl", 0.4), ("Cup", "Vase", 0.4)))
    assert noise.scaled(0).is_exact
    assert noise.scaled(1) == noise
    twice = noise.scaled(2)
    assert (twice.position, twice.position_per_metre, twice.angle) == (0.004, 0.002, 0.04)
    assert (twice.misses, twice.misses_hidden, twice.misses_far) == (0.8, 1.0, 0.2)
    assert twice.confusions == (("Cup", "Bowl", 0.5), ("Cup", "Vase", 0.5)), "probabilities sum to 1 at most"


@pytest.mark.parametrize(("misses", "pictures"), [(0.0, 1), (0.01, 2), (0.1, 3), (0.9, 6), (1.0, 6)])
def test_it_takes_more_pictures_to_be_sure_with_a_camera_that_misses_more(misses: float, pictures: int) -> None:
    assert CameraNoise(position=0.01, misses=misses).pictures == pictures
