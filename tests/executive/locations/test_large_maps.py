"""What is left out on a large map changes no answer: distant pieces of bodies, and floor far from the way."""

from __future__ import annotations

from itertools import islice

import numpy as np
import pytest

from executive.belief import scene_collisions
from executive.locations import HandSolution
from executive.modules.drive import AROUND
from planlang.designators import a_location, a_person
from planlang.failures import LocationUnresolvable
from planlang.geometry import Pose
from sim import Body
from tests.executive.conftest import BOTTLE, CABINET, THE_BOTTLE, WARD, MakeStage, Stage, hold_bottle, stand

BOUNDS = (-5.0, -30.0, 5.0, 30.0)


def found(stage: Stage) -> list[HandSolution] | tuple[str, dict[str, int]]:
    """How the right hand grasps the bottle from here, or why it cannot."""
    arm = next(one for one in stage.platform.scene.arms.all if one.name == "right")
    seed = stage.platform.arm_joints(arm)
    try:
        return list(islice(stage.resolver.hands(a_location(in_center_of=THE_BOTTLE), arm, seed), 4))
    except LocationUnresolvable as failure:
        return str(failure), dict(failure.counts)


@pytest.mark.parametrize("base", [(1.1, 0.1, 0.0), (1.1, 0.5, -0.6), (-0.5, 0.0, 0.0)])
def test_a_hand_reaches_among_many_bodies_what_it_reaches_among_few(
    make_stage: MakeStage, monkeypatch: pytest.MonkeyPatch, base: tuple[float, float, float]
) -> None:
    told = []
    for many in (scene_collisions.MANY, 1):
        monkeypatch.setattr(scene_collisions, "MANY", many)
        stage = make_stage(*WARD)
        stand(stage, base)
        told.append(found(stage))
    few, many_ = told
    if isinstance(few, tuple):
        assert few == many_
    else:
        assert [one.plan.label for one in few] == [one.plan.label for one in many_ if isinstance(one, HandSolution)]
        joints = [np.concatenate([one.joints for one in some if isinstance(one, HandSolution)]) for some in told]
        assert np.array_equal(joints[0], joints[1])


def test_where_a_thing_can_be_handed_over_does_not_depend_on_how_many_bodies_there_are(
    make_stage: MakeStage, monkeypatch: pytest.MonkeyPatch
) -> None:
    places = []
    for many in (scene_collisions.MANY, 1):
        monkeypatch.setattr(scene_collisions, "MANY", many)
        stage = make_stage(*WARD)
        hold_bottle(stage)
        places.append(
            [one.base for one in islice(stage.resolver.bases(a_location(in_reach_of=a_person("Patient"))), 4)]
        )
    assert places[0] == places[1] != []


def test_a_way_far_around_is_found_on_a_large_map(make_stage: MakeStage) -> None:
    wall = Body("wall", Pose((2.0, -1.5, 1.0)), (0.2, 57.0, 2.0), type="Wall-Construction")
    stage = make_stage(wall, CABINET, BOTTLE, bounds=BOUNDS)
    straight = stage.platform.drive.path((1.0, 3.0, 0.0)).positions
    assert np.abs(straight[:, 1]).max() < 3.5
    around = stage.platform.drive.path((4.0, 0.0, 0.0)).positions
    assert around[:, 1].max() > 2 * AROUND
    assert np.allclose(around[-1][:2], (4.0, 0.0))
