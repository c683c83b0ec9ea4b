"""Places as fluents: what a plan watches while robot and things move is what judged them when they were found."""

from __future__ import annotations

from functools import partial

import pytest

from planlang import now, perform, pursue, sleep, wait_for
from planlang.designators import Location, a_device, a_location, a_person, a_posture, action, an_object, located
from planlang.geometry import Pose
from planlang.language.conditions import holds
from planlang.protocols import Detection, Solution
from tests.executive.conftest import THE_BOTTLE, WARD, MakeStage, Stage, stand
from tests.executive.modules.test_navigation import to

THE_CABINET, THE_BED = an_object("Cabinet-PieceOfFurniture"), an_object("Bed-PieceOfFurniture")


@pytest.mark.parametrize(
    "location",
    [
        a_location(near=THE_BED),
        a_location(in_reach_of=a_person("Patient"), near=THE_BED),
        a_location(visible_from=THE_BOTTLE, within=1.5, near=THE_CABINET),
        a_location(left_of=THE_BOTTLE),
        a_location(in_reach_of=a_location(above=THE_BED)),
    ],
    ids=str,
)
def test_a_place_that_stops_holding_as_the_robot_drives_away_fires(location: Location, ward: Stage) -> None:
    place = next(ward.resolver.bases(location)).base
    stand(ward, place)

    async def plan() -> tuple[bool, tuple[float, float, float], float]:
        here = holds(location)
        before = here.value
        await pursue(partial(wait_for, ~here), partial(perform, to(-1.0, 4.0)))
        return before, ward.truth.configuration().base, now()

    before, base, when = ward.run(plan)
    assert before, "the place holds where the robot stands"
    assert base[:2] != pytest.approx((-1.0, 4.0)), "the watch ended the drive before it was over"
    assert 0 < when < 10
    assert ward.resolver.satisfies(location, ward.platform.base()) is None


def test_a_thing_that_is_seen_elsewhere_is_no_longer_where_it_was(ward: Stage) -> None:
    log: list[tuple[float, bool, bool]] = []

    async def plan() -> None:
        on, near = holds(a_location(on=THE_CABINET), THE_BOTTLE), holds(a_location(near=THE_BOTTLE, within=2.0))
        log.append((now(), on.value, near.value))
        await pursue(partial(wait_for, ~on), perceive)
        log.append((now(), on.value, near.value))

    async def perceive() -> None:
        await sleep(1.5)
        ward.belief.see([Detection("bottle", Pose((1.5, 3.0, 0.1)), 1.0)])
        await sleep(9)

    ward.run(plan)
    assert log[0] == (0, True, True)
    assert log[1][1:] == (False, False)
    assert log[1][0] == pytest.approx(1.5, abs=0.1)


def test_a_hand_that_is_taken_away_is_no_longer_over_the_bed(make_stage: MakeStage) -> None:
    stage = make_stage(*WARD)
    over = a_location(above=THE_BED)
    solution = next(stage.resolver.bases(a_location(in_reach_of=over)))
    stand(stage, solution.base)
    device = a_device("LeftArm" if solution.detail["arm"] == "left" else "RightArm")

    async def plan() -> tuple[bool, bool, bool]:
        at = holds(over, device)
        before = at.value
        await perform(action("Reaching", to_location=over, device_used=device))
        there = at.value
        await pursue(
            partial(wait_for, ~at),
            partial(perform, action("Reaching", to_location=a_posture("carrying"), device_used=device)),
        )
        return before, there, at.value

    assert stage.run(plan) == (False, True, False)


def test_a_place_is_judged_once_while_nothing_moves_and_again_after_that(
    ward: Stage, monkeypatch: pytest.MonkeyPatch
) -> None:
    location = a_location(in_reach_of=a_person("Patient"))
    base = next(ward.resolver.bases(location)).base
    stand(ward, base)
    here, judged = located(location), list[Location]()
    judge = ward.resolver.satisfies

    def counted(asked: Location, there: tuple[float, float, float]) -> Solution | None:
        judged.append(asked)
        return judge(asked, there)

    monkeypatch.setattr(ward.resolver, "satisfies", counted)
    assert all(ward.executive.holds(here) for _ in range(30))
    assert len(judged) == 1
    ward.belief.bump("bed", Pose((-2.5, 0.05, 0.275), (0.0, 0.0, 1.0, 0.0)))
    ward.executive.holds(here)
    assert len(judged) == 2
    stand(ward, (base[0] + 2.0, base[1], base[2]))
    assert not ward.executive.holds(here)
    assert len(judged) == 3
