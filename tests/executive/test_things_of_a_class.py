"""What a designator by class means: one thing in each performance of a step, and another one in the next."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import pytest

from executive.modules.platform import Platform
from executive.runs.options import Outcome, RunOptions
from executive.runs.plan_run import run_plan_file
from executive.runs.written import bodies_of
from planlang import Trace, at_location, par, perform, with_failure_handling
from planlang.designators import Action, Object, a_location, action, an_object
from planlang.failures import GraspMissed, ObjectUnresolvable, PlanFailure
from planlang.files import bundled
from planlang.geometry import Pose
from planlang.language.recovery import Recovery
from sim import Body
from sim.scene import BodyShape
from tests.executive.conftest import PLACE, MakeStage, Stage
from tests.support.detections import put

ANY_CUP = Path(__file__).with_name("any_cup")
CUP, BOTTLE, PLATE = an_object("Cup"), an_object("DrinkingBottle"), an_object("DinnerPlate")
HERE, THERE = an_object("Table", PLACE + "here"), an_object("Table", PLACE + "there")
SIZE, TOP = (0.07, 0.07, 0.09), 0.745
TABLES = (
    Body("here", Pose((1.5, 0.0, 0.35)), (0.8, 3.0, 0.7), type="Table"),
    Body("there", Pose((-2.0, 0.0, 0.35)), (0.8, 3.0, 0.7), type="Table"),
)


def standing(name: str, x: float, y: float, kind: str = "Cup") -> Body:
    """A thing on a table."""
    return Body(name, Pose((x, y, TOP)), SIZE, BodyShape.CYLINDER, type=kind, movable=True)


CUPS = (standing("cup1", 1.3, 0.0), standing("cup2", 1.3, 0.4), standing("cup3", 1.3, 0.9))


class Hands:
    """A process module that carries, and looks at, things at once; it notes which."""

    name = "hands"
    actions = ("TransportingAnObject", "PickingUpAnObject", "LookingAtSomething")
    failures = (PlanFailure,)
    once = False

    def __init__(self, platform: Platform) -> None:
        self.platform = platform
        self.did: list[tuple[str, str]] = []
        self.misses = 0

    def performs(self, action: Action) -> bool:
        """All of them."""
        return action.type in self.actions

    def resources(self, action: Action) -> tuple[str, ...]:
        """None."""
        return ()

    async def execute(self, action: Action) -> str:
        """Act on what the designator means."""
        what, where, bodies = action.get("object_acted_on"), action.get("to_location"), self.platform.scene.bodies
        assert isinstance(what, Object)
        name = bodies.bind(what)
        self.did.append((action.type, name))
        if self.misses:
            self.misses -= 1
            raise GraspMissed(what=name)
        if isinstance(where, Object):
            x, y, _ = bodies.pose(bodies.bind(where)).position
            y = bodies.pose(name).position[1] if abs(y) < 1e-9 else y
            put(self.platform.belief, name, Pose((x, y, TOP)))
        return name


@pytest.fixture
def room(make_stage: MakeStage) -> Callable[..., tuple[Stage, Hands]]:
    """Furnishes a room with two tables for a robot with quick hands."""

    def made(*things: Body) -> tuple[Stage, Hands]:
        stage = make_stage(*TABLES, *things)
        hands = Hands(stage.platform)
        stage.executive.modules = (hands, *stage.executive.modules)
        return stage, hands

    return made


Room = Callable[..., tuple[Stage, Hands]]


def bring(what: Object = CUP, to: Object = THERE, name: str | None = None) -> Awaitable[str]:
    """Carry a thing to a table."""
    return perform(action("TransportingAnObject", object_acted_on=what, to_location=to), name)


def test_each_round_of_a_loop_takes_another_cup_and_fails_when_none_is_left(room: Room) -> None:
    stage, hands = room(*CUPS)

    async def clear() -> None:
        for _ in range(4):
            await bring()

    with pytest.raises(ObjectUnresolvable, match=r"no Cup is left for TransportingAnObject: .* cup1, cup2, cup3"):
        stage.run(clear)
    assert [name for _, name in hands.did] == ["cup1", "cup2", "cup3"]


def test_a_cup_that_another_step_has_brought_back_is_brought_again(room: Room) -> None:
    stage, hands = room(standing("cup1", 1.3, 0.0))

    async def there_and_back_and_there() -> None:
        await bring(to=THERE, name="there")
        await bring(to=HERE, name="back")
        await bring(to=THERE, name="there again")

    stage.run(there_and_back_and_there)
    assert [name for _, name in hands.did] == ["cup1"] * 3


def test_a_cup_that_is_there_already_is_not_brought(room: Room) -> None:
    stage, _ = room(standing("cup1", -1.8, 0.0), standing("cup2", 1.3, 0.4))
    assert stage.run(bring) == "cup2"


def test_where_all_cups_are_there_already_one_of_them_is_brought_again_as_its_step_asks(room: Room) -> None:
    stage, _ = room(standing("cup1", -1.8, 0.0))
    assert stage.run(bring) == "cup1"


@pytest.mark.parametrize("together", [False, True])
def test_two_steps_that_want_the_same_take_two_cups(room: Room, together: bool) -> None:
    stage, hands = room(*CUPS)
    steps = [partial(bring, name="one"), partial(bring, name="another")]

    async def in_turn() -> None:
        for step in steps:
            await step()

    stage.run(partial(par, *steps) if together else in_turn)
    assert sorted(name for _, name in hands.did) == ["cup1", "cup2"]
    assert sorted(bodies_of({"cup": CUP, "table": HERE}, stage.platform, stage.truth)) == ["cup1", "cup2", "here"]


def test_different_steps_in_a_row_mean_the_same_cup_in_every_round(room: Room) -> None:
    stage, hands = room(*CUPS)

    async def clear() -> None:
        for _ in range(2):
            await perform(action("LookingAtSomething", object_acted_on=CUP))
            await perform(action("PickingUpAnObject", object_acted_on=CUP))
            await bring(to=THERE)

    stage.run(clear)
    assert [name for _, name in hands.did] == ["cup1"] * 3 + ["cup2"] * 3


def test_a_trace_tells_which_cup_each_performance_means_but_not_for_looking_at_any(room: Room) -> None:
    stage, _ = room(*CUPS)
    trace = Trace()

    async def clear() -> None:
        await perform(action("LookingAtSomething", object_acted_on=CUP))
        for _ in range(2):
            await perform(action("PickingUpAnObject", object_acted_on=CUP))
            await bring(to=THERE)

    stage.run(clear, trace=trace)
    meant = [event for event in trace.events if event["event"] == "means"]
    assert [(one["what"], one["name"]) for one in meant] == [("Cup", "cup1")] * 2 + [("Cup", "cup2")] * 2
    assert len({one["within"] for one in meant}) == 4


def test_what_one_step_has_put_somewhere_the_next_one_takes_from_there(room: Room) -> None:
    stage, hands = room(*CUPS)

    async def there_and_back() -> None:
        await bring(to=THERE)
        await perform(action("PickingUpAnObject", object_acted_on=CUP))
        await bring(to=HERE)

    stage.run(there_and_back)
    assert [name for _, name in hands.did] == ["cup1", "cup1", "cup1"]


def test_substeps_mean_the_cup_of_their_step_even_after_it_is_there(room: Room) -> None:
    stage, hands = room(*CUPS)

    async def twice() -> None:
        await bring(name="first")
        await bring(name="second")

    serving = action("http://example.org/r#ServeCup", object_acted_on=CUP)

    async def serve() -> None:
        for _ in range(2):
            await perform(serving, otherwise=twice)

    stage.run(serve)
    assert [name for _, name in hands.did] == ["cup1", "cup1", "cup2", "cup2"]


def test_a_scope_at_a_location_and_the_steps_within_mean_the_same_cup(room: Room) -> None:
    stage, hands = room(*CUPS)

    async def look() -> None:
        await perform(action("LookingAtSomething", object_acted_on=CUP))
        await bring()

    async def twice() -> None:
        for _ in range(2):
            await at_location(a_location(near=CUP), look)

    stage.run(twice)
    assert [name for _, name in hands.did] == ["cup1", "cup1", "cup2", "cup2"]


def test_a_step_that_failed_is_repeated_with_the_same_cup(room: Room) -> None:
    stage, hands = room(*CUPS)
    hands.misses = 1
    pick = partial(perform, action("PickingUpAnObject", object_acted_on=CUP))
    stage.run(partial(with_failure_handling, pick, Recovery(GraspMissed)))
    assert [name for _, name in hands.did] == ["cup1", "cup1"]


def test_a_loop_under_a_recovery_takes_another_cup_in_each_round_and_no_cup_that_it_has_brought(room: Room) -> None:
    stage, hands = room(*CUPS)

    async def pick_and_bring() -> None:
        for _ in range(3):
            await perform(action("PickingUpAnObject", object_acted_on=CUP))
            await bring()

    stage.run(partial(with_failure_handling, pick_and_bring, Recovery(GraspMissed)))
    assert [name for _, name in hands.did] == ["cup1", "cup1", "cup2", "cup2", "cup3", "cup3"]


@pytest.mark.parametrize("cups", [1, 3])
def test_a_step_of_which_a_part_failed_is_repeated_with_the_cups_of_the_first_attempt(room: Room, cups: int) -> None:
    stage, hands = room(*CUPS[:cups], standing("bottle1", 1.3, -0.4, "DrinkingBottle"))

    async def lay_the_table() -> None:
        for _ in range(cups):
            await bring()
        hands.misses = len(hands.did) == cups
        await bring(BOTTLE)

    lay_it = partial(perform, action("http://example.org/r#LayTheTable"), otherwise=lay_the_table)
    stage.run(partial(with_failure_handling, lay_it, Recovery(GraspMissed)))
    attempt = [*(f"cup{number + 1}" for number in range(cups)), "bottle1"]
    assert [name for _, name in hands.did] == [*attempt, *attempt]


def test_several_cups_brought_by_an_attempt_that_failed_are_those_of_the_next_one(room: Room) -> None:
    stage, hands = room(*CUPS, standing("bottle1", 1.3, -0.4, "DrinkingBottle"))

    async def lay_the_table() -> None:
        await perform(action("TransportingAnObject", object_acted_on=CUP, to_location=THERE), times=3)
        hands.misses = len(hands.did) == 3
        await bring(BOTTLE)

    stage.run(partial(with_failure_handling, lay_the_table, Recovery(GraspMissed)))
    assert [name for _, name in hands.did] == ["cup1", "cup2", "cup3", "bottle1"] * 2


def test_after_a_repeated_step_the_next_one_means_its_cup(room: Room) -> None:
    stage, hands = room(*CUPS)

    async def pick_two() -> None:
        for number in range(2):
            await perform(action("PickingUpAnObject", object_acted_on=CUP))
            hands.misses = number == 1 and len(hands.did) < 5
            await bring()
            await perform(action("LookingAtSomething", object_acted_on=CUP))

    stage.run(partial(with_failure_handling, pick_two, Recovery(GraspMissed)))
    assert [name for _, name in hands.did] == ["cup1"] * 3 + ["cup2"] * 2 + ["cup1"] * 3 + ["cup2"] * 3


def test_designators_of_two_classes_do_not_disturb_each_other(room: Room) -> None:
    stage, hands = room(*CUPS[:2], standing("bottle1", 1.3, -0.4, "DrinkingBottle"))

    async def clear() -> None:
        await bring(CUP)
        await bring(BOTTLE)
        await bring(CUP)

    stage.run(clear)
    assert [name for _, name in hands.did] == ["cup1", "bottle1", "cup2"]


def test_an_individual_is_the_same_thing_in_each_round(room: Room) -> None:
    stage, hands = room(*CUPS)

    async def twice() -> None:
        for _ in range(2):
            await bring(an_object("Cup", PLACE + "cup2"))

    stage.run(twice)
    assert [name for _, name in hands.did] == ["cup2", "cup2"]


def test_each_round_puts_a_cup_on_another_plate(room: Room) -> None:
    plates = [
        Body(f"plate{n}", Pose((-1.9, y, 0.71)), (0.2, 0.2, 0.02), type="DinnerPlate") for n, y in ((1, 0.3), (2, 0.8))
    ]
    stage, hands = room(*CUPS, *plates)
    onto: list[str] = []

    async def serve() -> None:
        for _ in range(2):
            cup = await bring(CUP, PLATE)
            y = stage.belief.pose(cup).position[1]
            onto.append(min(("plate1", "plate2"), key=lambda name: abs(stage.belief.pose(name).position[1] - y)))

    stage.run(serve)
    assert [name for _, name in hands.did] == ["cup1", "cup2"]
    assert sorted(onto) == ["plate1", "plate2"]


def test_a_cup_that_is_somewhere_is_one_that_stands_there_when_it_is_chosen(room: Room) -> None:
    stage, hands = room(standing("cup1", -1.8, 0.0), *CUPS[1:])
    there = an_object("Cup", where=a_location(on=THERE))

    async def twice() -> None:
        for _ in range(2):
            await perform(action("PickingUpAnObject", object_acted_on=there))
            await bring(there, HERE)

    with pytest.raises(ObjectUnresolvable, match=r"no Cup is known to be on\(there\); known of this class: cup1, cup2"):
        stage.run(twice)
    assert [name for _, name in hands.did] == ["cup1", "cup1"]


@pytest.mark.parametrize("kind", ["LookingAtSomething", "PickingUpAnObject", "TransportingAnObject"])
def test_a_step_that_is_performed_several_times_is_about_different_things(room: Room, kind: str) -> None:
    stage, hands = room(*CUPS)
    whither = (("to_location", THERE),) if kind == "TransportingAnObject" else ()
    each = partial(perform, Action(kind, (("object_acted_on", CUP), *whither)))
    stage.run(partial(each, times=3))
    assert sorted(name for _, name in hands.did) == ["cup1", "cup2", "cup3"]
    with pytest.raises(ObjectUnresolvable, match="no Cup is left"):
        room(*CUPS)[0].run(partial(each, times=4))


def test_several_times_a_step_within_a_scope_are_about_different_things_too(room: Room) -> None:
    stage, hands = room(*CUPS)

    async def look() -> None:
        await perform(action("LookingAtSomething", object_acted_on=CUP), times=2)

    stage.run(partial(at_location, a_location(near=CUP), look))
    assert len({name for _, name in hands.did}) == 2


def test_what_was_meant_survives_a_stored_state(room: Room) -> None:
    stage, _ = room(*CUPS)
    fresh = stage.belief.supposing(stage.belief.state)
    stage.run(bring)
    assert stage.belief.memory.meanings[CUP][0].name == "cup1"
    fresh.restore(stage.belief.snapshot())
    assert fresh.memory.meanings == stage.belief.memory.meanings


def test_a_recipe_that_brings_a_cup_while_one_is_seen_brings_them_all_also_when_it_is_resumed(tmp_path: Path) -> None:
    options = RunOptions(
        recipe=ANY_CUP / "clear_while_cups.omn",
        robot=bundled("ontologies") / "robots" / "amigo.omn",
        environment=ANY_CUP / "two_cups.omn",
        trace=tmp_path / "run.jsonl",
    )
    whole = run_plan_file(options)
    assert whole.outcome is Outcome.DONE, whole.message
    lines = (tmp_path / "run.jsonl").read_text(encoding="utf-8").splitlines(keepends=True)
    grasped = [line for line in lines if '"grasped"' in line]
    assert ["cup1" in grasped[0], "cup2" in grasped[1], len(grasped)] == [True, True, 2]
    end = next(n for n, line in enumerate(lines) if '"completed"' in line and '"SeeACup#2"' in line)
    (tmp_path / "cut.jsonl").write_text("".join(lines[: end + 1]), encoding="utf-8")
    resumed = replace(options, resume=tmp_path / "cut.jsonl", trace=tmp_path / "resumed.jsonl")
    assert run_plan_file(resumed).outcome is Outcome.DONE
    told = (tmp_path / "resumed.jsonl").read_text(encoding="utf-8").splitlines()
    assert ["cup2" in line for line in told if '"grasped"' in line] == [False, True]


def test_a_failure_names_the_cup_that_was_meant() -> None:
    robot = bundled("ontologies") / "robots" / "amigo.omn"
    options = RunOptions(recipe=ANY_CUP / "bring_a_cup.omn", robot=robot, environment=ANY_CUP / "high_cup.omn")
    failed = run_plan_file(options)
    assert failed.outcome is Outcome.FAILED
    first, *causes = failed.message.splitlines()
    assert first.startswith(
        "ObjectUnreachable: the object cannot be reached: cup1; cup1 is at 2.04 m, 0.58 m too high;"
    )
    assert any("no place found for in_reach_of(cup1)" in line for line in causes)
    assert "Cup" not in failed.message
    assert failed.failure is not None
    told = [failed.failure, *failed.failure.causes]
    assert [str(one) for one in told if "Cup" in str(one)] == []
    assert failed.failure.advice is not None
