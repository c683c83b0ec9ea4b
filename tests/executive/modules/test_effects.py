"""Effects of actions: declared in OWL, performed by users' modules, true in the world, believed, and asked by goals."""

from __future__ import annotations

import json
from collections.abc import Awaitable, Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from executive.belief import Belief
from executive.maps import read_map, scene_of
from executive.modules.looking.perception import Head, Perception
from executive.modules.platform import Platform
from executive.modules.waiting import Waiting
from executive.robots import Robot
from executive.runs.assembly import RobotExecutive, platform_of
from planlang import (
    Object,
    PlanStructureError,
    SimulationHost,
    Trace,
    a_location,
    achieve,
    action,
    an_object,
    baked,
    contains,
    created,
    destroyed,
    located,
    perform,
    run,
    sleep,
    switched_on,
    transformed_into,
)
from planlang.changes import Switched
from planlang.designators import Action
from planlang.failures import (
    ActionUnresolvable,
    AmountNotPoured,
    GoalNotAchieved,
    ObjectNotTurned,
    ObjectUnresolvable,
)
from planlang.geometry import Pose
from planlang.ontology import load
from planlang.protocols import RobotInterface
from planlang.state.questions import amount_of, came_to_be, is_baked
from planlang.testing import compiled
from sim import PlanningWorld, PyBulletWorld
from tests.support.kitchen import THINGS, kitchen_map
from tests.support.noisy_camera import NoisyCamera

KITCHEN = "http://example.org/kitchen.owl#"
OVER_THE_MAKER = Pose((2.0, 0.0, 1.2), (1.0, 0.0, 0.0, 0.0))


def thing(name: str) -> Object:
    return an_object(THINGS[name][0], KITCHEN + name)


DOUGH, YOLK, PANCAKE = an_object("Dough"), an_object("EggYolk-Food"), an_object("Pancake")
EGG, MILK, FLOUR, MAKER, BOWL = map(thing, ("egg1", "milk1", "flour1", "maker1", "bowl1"))


class Cooking:
    """A user's module: takes a second, and moves nothing."""

    name = "cooking"
    actions = ("Cracking", "Mixing", "FluidFlow-Translation", "FlippingAnObject", "TurningOnPoweredDevice", "Icing")
    failures = ()

    def __init__(self, platform: Platform) -> None:
        self.platform = platform

    def resources(self, action: Action) -> tuple[str, ...]:
        return ()

    async def execute(self, action: Action) -> None:
        await sleep(1.0)


class Waiter(Cooking):
    """Turns a pancake when its lower side is baked."""

    name = "waiter"
    actions = ("FlippingAnObject",)

    async def execute(self, action: Action) -> None:
        await sleep(60.0)


class Physical(Cooking):
    """A module written for an earlier version: it says that its motions do all by themselves, and moves nothing."""

    physical = True


class Pourer(Cooking):
    """A module that holds the cup upside down over the pancake maker for three seconds."""

    async def execute(self, action: Action) -> None:
        truth = self.platform.world
        assert isinstance(truth, PyBulletWorld)
        upright = truth.pose("cup1")
        truth.attach("grippoint_right", "cup1")
        truth.set_pose("cup1", OVER_THE_MAKER)
        await sleep(3.0)
        truth.set_pose("cup1", upright)
        truth.release("cup1")


class Cheating(Cooking):
    """A module that creates a dough by itself."""

    async def execute(self, action: Action) -> None:
        assert isinstance(self.platform.world, PyBulletWorld)
        self.platform.world.bring_about(Switched("maker1", "DeviceStateOn"))


@dataclass(frozen=True)
class Kitchen:
    truth: PyBulletWorld
    executive: RobotExecutive

    @property
    def belief(self) -> Belief:
        return self.executive.platform.belief

    def run(self, plan: Callable[[], Awaitable[Any]], trace: Trace | None = None) -> Any:
        host = SimulationHost(self.truth)
        return run(plan, host=host, executive=self.executive, max_steps=20000, trace=trace)


Make = Callable[..., Kitchen]
Interface = Callable[[RobotInterface], RobotInterface]


@pytest.fixture
def kitchen(amigo: Robot, tmp_path: Path) -> Iterator[Make]:
    """Makes kitchens whose modules are given; ``declared`` is added to the map."""
    worlds: list[PlanningWorld | PyBulletWorld] = []

    def make(*modules: type[Cooking], declared: str = "", interface: Interface = lambda robot: robot) -> Kitchen:
        path = tmp_path / "kitchen.omn"
        path.write_text(kitchen_map() + declared, encoding="utf-8")
        semantic_map = read_map(load(path))
        scene = scene_of(semantic_map)
        truth, believed = PyBulletWorld(scene, amigo.body()), PlanningWorld(scene, amigo.body())
        worlds.extend((truth, believed))
        platform = platform_of(amigo, semantic_map, interface(truth), believed, 0)
        return Kitchen(truth, RobotExecutive(platform, (*(modules or (Cooking,)), Waiting), truth))

    yield make
    for world in worlds:
        world.close()


def do(cls: str, **properties: Any) -> Callable[[], Awaitable[Any]]:
    return partial(perform, action(cls, **properties))


def test_cracking_an_egg_destroys_it_and_leaves_shell_and_yolk(kitchen: Make) -> None:
    cook = kitchen()
    cook.run(do("Cracking", object_acted_on=EGG))
    for names in (cook.truth.names(), cook.belief.names()):
        assert "egg1" not in names
        assert {"Eggshell_1", "EggYolk-Food_1"} <= set(names)
    assert cook.truth.matter.went_into("EggYolk-Food_1") == ("egg1",)
    assert cook.truth.support("Eggshell_1") == "table1"
    assert cook.executive.holds(destroyed(EGG))
    assert cook.executive.holds(created(YOLK))
    assert cook.executive.holds(transformed_into(EGG, YOLK))
    assert not cook.executive.holds(destroyed(MILK))


def test_effects_come_true_in_the_world_whose_interface_is_decorated(kitchen: Make) -> None:
    cook = kitchen(interface=NoisyCamera)
    cook.run(do("Cracking", object_acted_on=EGG))
    for names in (cook.truth.names(), cook.belief.names()):
        assert {"egg1", "Eggshell_1"}.intersection(names) == {"Eggshell_1"}


def test_cracking_what_is_no_egg_changes_nothing(kitchen: Make) -> None:
    cook = kitchen()
    state, revision = cook.truth.matter.snapshot(), cook.executive.revision()
    cook.run(do("Cracking", object_acted_on=MILK))
    assert cook.truth.matter.snapshot() == state
    assert cook.executive.revision() == revision


def test_a_yolk_cracked_into_a_bowl_is_its_content(kitchen: Make) -> None:
    cook = kitchen()
    cook.run(do("Cracking", object_acted_on=EGG, to_location=a_location(in_=BOWL)))
    assert amount_of(cook.truth.world_state(), "bowl1", "EggYolk-Food", cook.truth.queries) == 20.0
    assert cook.executive.holds(contains(BOWL, YOLK, 20.0))
    assert not cook.executive.holds(contains(BOWL, YOLK, 21.0))
    assert "Eggshell_1" in cook.truth.names()


def test_what_several_steps_mix_is_one_dough_of_all(kitchen: Make) -> None:
    cook = kitchen()

    async def mix() -> None:
        await perform(action("Cracking", object_acted_on=EGG))
        await perform(action("Mixing", object_acted_on=(MILK, FLOUR), to_location=BOWL))
        await perform(action("Mixing", object_acted_on=(DOUGH, YOLK)))

    cook.run(mix)
    assert came_to_be(cook.truth.world_state(), "Dough", cook.truth.queries) == ("bowl1",)
    assert cook.truth.matter.went_into("bowl1") == ("EggYolk-Food_1", "egg1", "flour1", "milk1")
    assert amount_of(cook.truth.world_state(), "bowl1", "Dough", cook.truth.queries) == 220.0
    assert all(cook.executive.holds(transformed_into(one, DOUGH)) for one in (EGG, MILK, FLOUR))


def test_an_amount_is_poured_from_where_the_substance_is(kitchen: Make) -> None:
    cook = kitchen()
    mix = an_object("PancakeMix", KITCHEN + "mix1")
    cook.run(do("PouringSomethingOnto", object_acted_on=mix, to_location=MAKER, amount=80.0))
    scene = cook.executive.platform.scene
    for state, queries in ((cook.truth.world_state(), cook.truth.queries), (cook.belief.state, scene.mirror.queries)):
        assert amount_of(state, "cup1", "PancakeMix", queries) == pytest.approx(120.0)
        assert amount_of(state, "maker1", "PancakeMix", queries) == pytest.approx(80.0)
    cook.run(do("Pouring", object_acted_on=thing("cup1"), to_location=BOWL))
    assert cook.executive.holds(contains(BOWL, mix, 50.0))


@pytest.mark.parametrize(("asked", "there"), [(50.0, 60.0), (80.0, 80.0)])
def test_what_motions_have_poured_is_not_poured_again(kitchen: Make, asked: float, there: float) -> None:
    cook = kitchen(Pourer)
    cook.run(do("Pouring", object_acted_on=thing("cup1"), to_location=MAKER, amount=asked))
    state, queries = cook.truth.world_state(), cook.truth.queries
    assert amount_of(state, "maker1", "PancakeMix", queries) == pytest.approx(there, abs=1.0)
    assert amount_of(state, "cup1", "PancakeMix", queries) == pytest.approx(200.0 - there, abs=1.0)
    assert cook.executive.holds(contains(MAKER, an_object("PancakeMix"), asked))


def test_pouring_more_than_the_vessel_holds_fails_and_says_how_much_was_poured(kitchen: Make) -> None:
    cook = kitchen()
    with pytest.raises(AmountNotPoured) as caught:
        cook.run(do("Pouring", object_acted_on=thing("cup1"), to_location=MAKER, amount=250.0))
    assert (caught.value.what, caught.value.asked) == ("cup1", 250.0)
    assert caught.value.poured == pytest.approx(200.0)


def test_what_modules_of_earlier_versions_leave_to_physics_is_only_believed(kitchen: Make) -> None:
    cook = kitchen(Physical)
    cook.run(do("Pouring", object_acted_on=thing("cup1"), to_location=MAKER))
    mix = an_object("PancakeMix")
    assert cook.executive.holds(contains(MAKER, mix, 50.0))
    assert amount_of(cook.truth.world_state(), "maker1", "PancakeMix", cook.truth.queries) == 0.0
    cook.run(do("TurningOnPoweredDevice", object_acted_on=MAKER))
    assert cook.truth.matter.is_on("maker1")


def test_dough_on_a_pancake_maker_bakes_while_the_robot_waits_and_is_baked_when_it_was_turned(kitchen: Make) -> None:
    cook = kitchen()
    done: list[tuple[bool, bool]] = []

    async def bake() -> None:
        await perform(action("TurningOnHeatingDevice", object_acted_on=MAKER))
        await perform(action("Mixing", object_acted_on=(MILK, FLOUR), to_location=BOWL))
        await perform(action("PouringSomethingOnto", object_acted_on=DOUGH, to_location=MAKER))
        for _ in range(2):
            await perform(action("WaitForPredefinedTimeInterval", duration=61.0))
            done.append(
                (cook.executive.holds(baked(PANCAKE)), cook.executive.holds(located(a_location(on=MAKER), DOUGH)))
            )
            await perform(action("FlippingAnObject", object_acted_on=PANCAKE))

    cook.run(bake)
    assert done == [(False, True), (True, True)]
    assert cook.executive.holds(switched_on(MAKER))
    assert cook.truth.pose("Dough_on_maker1").rotation[2, 2] == pytest.approx(1.0), "turned twice"
    assert is_baked(cook.truth.world_state(), "Dough_on_maker1", cook.truth.queries, 60.0)
    seconds = [world.matter.heated["Dough_on_maker1"] for world in (cook.truth, cook.executive.platform.scene.world)]
    assert seconds[0] == pytest.approx(seconds[1], abs=1.5)


@pytest.mark.long
def test_the_real_recipe_for_pancakes_reaches_its_goal(kitchen: Make, corpus: Path) -> None:
    cook = kitchen(Waiter, Cooking)
    make = compiled(corpus / "recipes" / "pancake-making@hydro.owl")

    async def all_of_it() -> None:
        await perform(action("TurningOnPoweredDevice", object_acted_on=MAKER))
        await make()

    cook.run(all_of_it)
    state, queries = cook.truth.world_state(), cook.truth.queries
    (pancake,) = (one for one in came_to_be(state, "Pancake", queries) if queries.under(state, one) == "maker1")
    assert state.matter.went_into(pancake)[-3:] == ("egg1", "flour1", "milk1")
    assert cook.truth.pose(pancake).rotation[2, 2] == pytest.approx(-1.0)
    assert state.matter.heated[pancake][0] >= 60.0 - 1e-6


def test_effects_of_a_users_class_are_declared_in_the_map_or_stated_by_the_step(kitchen: Make) -> None:
    icing = (
        "Class: Icing\n    SubClassOf: knowrob:PreparingFoodOrDrink\nClass: Glazed\n    SubClassOf: knowrob:Milk\n"
        "Individual: icingChange\n    Types: knowrob:ObjectChange\n"
        "    Facts: knowrob:byAction Icing, knowrob:outputsCreated Glazed,\n"
        "        knowrob:inputsDestroyed knowrob:CowsMilk-Product\n"
    )
    declared = kitchen(type("Icer", (Cooking,), {"actions": (KITCHEN + "Icing",)}), declared=icing)
    declared.run(do(KITCHEN + "Icing", object_acted_on=MILK))
    assert declared.executive.holds(transformed_into(MILK, an_object(KITCHEN + "Glazed")))
    stated = kitchen()
    cake = an_object("Cake", KITCHEN + "cake1")
    stated.run(do("Icing", object_acted_on=MILK, inputs_destroyed=FLOUR, outputs_created=cake))
    assert stated.executive.holds(created(cake))
    assert stated.executive.holds(destroyed(FLOUR))
    assert not stated.executive.holds(destroyed(MILK))
    assert stated.belief.bind(cake, (0.0, 0.0, 0.0)) == "Cake_1"


def test_a_name_of_what_is_destroyed_means_nothing_until_there_is_another_one(kitchen: Make) -> None:
    cook = kitchen()
    cook.run(do("Cracking", object_acted_on=EGG))
    with pytest.raises(ObjectUnresolvable, match="not there any more"):
        cook.belief.bind(EGG, (0.0, 0.0, 0.0))


def test_a_module_cannot_change_what_its_class_does_not_declare(kitchen: Make) -> None:
    with pytest.raises(PlanStructureError, match="only declared effects"):
        kitchen(Cheating).run(do("Icing", object_acted_on=MILK))


def test_waiting_without_a_duration_is_refused(kitchen: Make) -> None:
    with pytest.raises(ActionUnresolvable, match="duration"):
        kitchen().run(do("Waiting"))


def test_a_goal_that_does_not_come_true_fails(kitchen: Make) -> None:
    with pytest.raises(GoalNotAchieved):
        kitchen().run(partial(achieve, baked(DOUGH), do("Mixing", object_acted_on=(MILK, FLOUR))))


def test_what_was_changed_is_restored_in_world_and_belief(kitchen: Make) -> None:
    first, second = kitchen(), kitchen()

    async def cook() -> None:
        await perform(action("TurningOnPoweredDevice", object_acted_on=MAKER))
        await perform(action("Cracking", object_acted_on=EGG))
        await perform(action("PouringSomethingOnto", object_acted_on=an_object("PancakeMix"), to_location=MAKER))
        await perform(action("Waiting", duration=10.0))

    first.run(cook)
    state = json.loads(json.dumps(first.executive.snapshot()))
    second.executive.restore(state)
    assert json.loads(json.dumps(second.executive.snapshot())) == state
    assert second.belief.names() == first.belief.names()
    assert second.executive.holds(destroyed(EGG))
    assert second.executive.holds(contains(MAKER, an_object("PancakeMix"), 50.0))


def test_equal_runs_have_equal_traces(kitchen: Make) -> None:
    traces = [Trace(), Trace()]
    for trace in traces:
        kitchen().run(do("Mixing", object_acted_on=(MILK, FLOUR)), trace)
    assert traces[0].events == traces[1].events


def test_what_is_turned_over_has_turned_or_the_action_fails(kitchen: Make) -> None:
    cook = kitchen()
    with pytest.raises(ObjectNotTurned, match="nothing that FlippingAnObject"):
        cook.run(do("FlippingAnObject", object_acted_on=PANCAKE))
    cook.run(do("FlippingAnObject", object_acted_on=EGG))
    assert cook.truth.pose("egg1").rotation[2, 2] == pytest.approx(-1.0)


def test_a_module_whose_motions_have_turned_nothing_over_has_failed_and_that_is_believed(kitchen: Make) -> None:
    cook = kitchen(Physical, Head, Perception)
    with pytest.raises(ObjectNotTurned, match="did not turn over"):
        cook.run(do("FlippingAnObject", object_acted_on=EGG))
    assert cook.belief.pose("egg1").rotation[2, 2] == pytest.approx(1.0)
