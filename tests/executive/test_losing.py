"""Grasping is watched: what leaves the hand is noticed by what the fingers feel, whatever the robot is doing."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from executive.runs.options import Outcome, RunResult
from executive.runs.plan_run import run_plan_file
from planlang import now, par, perform, sleep
from planlang.designators import a_person, a_posture, action
from planlang.failures import GraspSlipped, ObjectLost
from sim import PyBulletWorld
from tests.executive.conftest import BUNDLED, WARD, MakeStage, Stage, hold_bottle
from tests.executive.modules.test_navigation import to

STEP = PyBulletWorld.step
SOON = 0.25
"""Time in which a thing that falls leaves the fingers [s]: half a bottle's height of free fall, and a step."""


def drop(monkeypatch: pytest.MonkeyPatch, name: str, when: float) -> list[float]:
    """Have the world take a thing out of the robot's hands at a time [s]; the list tells when it did."""
    dropped: list[float] = []

    def stepped(world: PyBulletWorld) -> None:
        if world.steps == round(when * world.rate) and name in world.attached():
            world.release(name)
            dropped.append(when)
        STEP(world)

    monkeypatch.setattr(PyBulletWorld, "step", stepped)
    return dropped


@pytest.mark.long
@pytest.mark.parametrize(
    ("when", "ends_well", "within"),
    [
        pytest.param(19.3, True, 1.0, id="over the table"),
        pytest.param(27.0, False, SOON, id="on the way"),
        pytest.param(17.5, True, 3.0, id="as it is lifted"),  # it stands between the fingers until these have gone
        pytest.param(23.0, False, SOON, id="as the arm is tucked"),
        pytest.param(31.0, False, SOON, id="at a turn"),
        pytest.param(36.0, False, 3.5, id="before the patient"),  # while the head looks for the patient
        pytest.param(42.0, True, SOON, id="as it is offered"),
    ],
)
def test_a_bottle_that_is_dropped_is_served_in_the_end_or_truthfully_given_up(
    when: float, ends_well: bool, within: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    dropped = drop(monkeypatch, "bottle1", when)
    result: RunResult = run_plan_file(replace(BUNDLED, trace=tmp_path / "run.jsonl"))
    assert dropped == [when]
    trace: list[dict[str, Any]] = [json.loads(line) for line in (tmp_path / "run.jsonl").read_text().splitlines()]
    lost = [record["step"] / 30 for record in trace if record.get("change") == "lost"]
    assert lost[0] == pytest.approx(when, abs=within)
    if ends_well:
        assert (result.outcome, result.final_state) == (Outcome.DONE, ("bottle1: held by patient1",)), result.message
        return
    assert result.outcome is Outcome.FAILED
    assert result.final_state == ("bottle1: at rest on room1",), "it lies on the floor, where no arm reaches it"
    assert result.failures[0] == "ObjectUnreachable"
    assert "bottle1" in result.message
    assert "HandoverNotTaken" not in [record.get("type") for record in trace], "no empty hand is offered"


@pytest.fixture
def holding_stage(make_stage: MakeStage) -> Stage:
    """A robot with the bottle between the fingers of its right hand."""
    stage = make_stage(*WARD)
    hold_bottle(stage)
    return stage


def lost(stage: Stage, doing: Any, monkeypatch: pytest.MonkeyPatch, when: float = 1.0) -> ObjectLost:
    """Return what comes of something that the robot does while the bottle slips at a time [s]."""
    drop(monkeypatch, "bottle", stage.truth.steps / stage.truth.rate + when)

    async def plan() -> float:
        try:
            await doing()
        finally:
            ended.append(now())

    ended: list[float] = []
    with pytest.raises(ObjectLost) as caught:
        stage.run(plan)
    assert when < ended[0] <= when + SOON
    return caught.value


def test_a_thing_that_slips_while_driving_stops_the_base_and_names_the_arm(
    holding_stage: Stage, monkeypatch: pytest.MonkeyPatch
) -> None:
    failure = lost(holding_stage, partial(perform, to(0.0, 3.0)), monkeypatch)
    assert failure.what == "bottle"
    assert isinstance(failure.__cause__, GraspSlipped)
    assert failure.__cause__.arm == "right"
    assert holding_stage.belief.held == {}
    assert holding_stage.belief.memory.dropped == {"right": "bottle"}
    assert holding_stage.belief.pose("bottle").position[2] < 0.2, "it is believed to have come down"
    assert holding_stage.truth.configuration().base[:2] != pytest.approx((0.0, 3.0))


def test_an_offer_of_a_thing_that_slips_ends_at_once(holding_stage: Stage, monkeypatch: pytest.MonkeyPatch) -> None:
    offer = action("HandingOverAnObject", recipient=a_person("Patient"))
    assert lost(holding_stage, partial(perform, offer), monkeypatch).what == "bottle"


def test_a_wait_with_a_thing_that_slips_ends_at_once(holding_stage: Stage, monkeypatch: pytest.MonkeyPatch) -> None:
    wait = action("Waiting", duration=20.0)
    assert lost(holding_stage, partial(perform, wait), monkeypatch).what == "bottle"


def test_a_wait_with_a_thing_that_stays_in_the_hand_lasts_as_long_as_stated(holding_stage: Stage) -> None:
    before = holding_stage.truth.steps
    holding_stage.run(partial(perform, action("Waiting", duration=2.0)))
    assert holding_stage.truth.steps - before == 2 * holding_stage.truth.rate


def test_only_the_strand_that_uses_the_hand_fails(holding_stage: Stage, monkeypatch: pytest.MonkeyPatch) -> None:
    left = holding_stage.executive._device("left")
    log: list[str] = []

    async def carry() -> None:
        holding_stage.platform.arms.choices.choose("right")
        try:
            await perform(to(0.0, 3.0))
        except ObjectLost:
            log.append("carrier")

    async def wave() -> None:
        holding_stage.platform.arms.choices.choose("left")
        for posture in ("handover", "carrying", "handover"):
            await perform(action("Reaching", to_location=a_posture(posture), device_used=left))
        log.append("waver")

    drop(monkeypatch, "bottle", holding_stage.truth.steps / 30 + 1.0)

    async def plan() -> None:
        await par(carry, wave)
        await sleep(0.1)

    holding_stage.run(plan)
    assert log == ["carrier", "waver"]
