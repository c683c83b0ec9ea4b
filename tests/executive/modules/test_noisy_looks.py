"""What the robot makes of pictures of a camera that errs: things stand, and what is missed is looked for again."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import pytest

from executive.robots.arms import RobotModel
from planlang import action, perform
from planlang.failures import ObjectNotFound
from planlang.geometry import Pose
from planlang.ontology import Ontology
from sim.scene import CameraNoise
from tests.executive.conftest import BED, BOTTLE, CABINET, THE_BOTTLE, Stage, furnisher, stand

FACING = (0.6, BOTTLE.pose.position[1], 0.0)
LOOK = action("LookingForSomething", object_acted_on=THE_BOTTLE)
MakeErring = Callable[[CameraNoise], Stage]


@pytest.fixture
def make_erring(model: RobotModel, vocabulary: Ontology) -> Iterator[MakeErring]:
    """Puts a robot whose camera errs before a bottle on a cabinet."""
    furnishers = []

    def make(noise: CameraNoise) -> Stage:
        assert model.robot.camera is not None
        robot = replace(model.robot, camera=replace(model.robot.camera, noise=noise))
        furnishers.append(furnisher(replace(model, robot=robot), vocabulary))
        stage = next(furnishers[-1])(CABINET, BOTTLE, BED)
        stand(stage, FACING)
        return stage

    yield make
    for one in furnishers:
        next(one, None)


def look(stage: Stage, times: int = 1) -> None:
    """Look for the bottle several times."""

    async def plan() -> None:
        for _ in range(times):
            await perform(LOOK)

    stage.run(plan)


def test_a_bottle_that_is_seen_too_high_and_leaning_stands_on_its_cabinet(make_erring: MakeErring) -> None:
    stage = make_erring(CameraNoise(position=0.01, angle=0.035))
    x, y, z = BOTTLE.pose.position
    stage.truth.set_pose("bottle", Pose((x, y + 0.1, z)))
    look(stage)
    believed, true = stage.belief.pose("bottle"), stage.truth.pose("bottle")
    assert 0.0 < believed.distance(true) < 0.05
    assert believed.position[2] == pytest.approx(true.position[2], abs=1e-6), "its height is that of the cabinet"
    assert believed.rotation[2, 2] == pytest.approx(1.0), "it is upright"
    assert stage.belief.pose("cabinet") == stage.truth.pose("cabinet"), "a fixed cabinet is where the map has it"


def test_answers_stay_valid_while_a_thing_is_looked_at_again_and_again(make_erring: MakeErring) -> None:
    stage = make_erring(CameraNoise(position=0.005, angle=0.035))
    look(stage, 3)
    before, surroundings = stage.belief.revision, stage.platform.scene.surroundings()
    for _ in range(10):
        stage.platform.sensing.see()
    changes = stage.belief.revision - before
    assert changes <= 4, "the belief follows only what is significant"
    assert changes or stage.platform.scene.surroundings() == surroundings


def test_a_camera_that_misses_every_second_thing_still_finds_the_bottle_at_one_glance(make_erring: MakeErring) -> None:
    stage = make_erring(CameraNoise(misses=0.5))
    look(stage)
    assert stage.belief.seen("bottle")


def test_a_bottle_that_is_gone_is_not_found_with_a_camera_that_misses_things(make_erring: MakeErring) -> None:
    stage = make_erring(CameraNoise(misses=0.3))
    stage.truth.remove("bottle")
    with pytest.raises(ObjectNotFound):
        look(stage)
