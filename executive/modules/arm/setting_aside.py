"""Process modules that make room: they put held objects down nearby, or back the base off from its work."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from functools import partial
from itertools import islice

import numpy as np

from executive.belief.scene_collisions import BasePose
from executive.modules.arm.hand_work import BACK, HandWork
from executive.modules.platform import PlatformModule
from executive.modules.runner import Skill
from executive.robots import CARRYING
from planlang.designators import Action, Object, a_location, a_posture, action, resting_on
from planlang.failures import (
    ActionUnresolvable,
    DesignatorFailure,
    LocationUnresolvable,
    ManipulationFailure,
    NavigationFailure,
    ObjectUndeliverable,
    PlanFailure,
)
from planlang.kernel import checkpoint
from planlang.language.performing import perform
from planlang.language.process_module import process_module
from planlang.ontology import expand, shorten
from planlang.recoveries import ASIDE
from sim.joints import Articulation, JointKind

SUPPORTS = 4
"""Pieces of furniture to try, nearest first."""
PLACES = 2
"""Base poses to try at each."""
TRIED = SUPPORTS * PLACES
"""Base poses to try in all."""
FOR_PEOPLE = "Person-SupportingFurniture"
"""Class of furniture on which people sit or lie."""
AT_REST = 0.1
"""Height above furniture up to which a person counts as sitting or lying on it [m]: maps state outlines of people."""
FURTHER_SEARCHES = 40
"""Searches for places to put down what is held once a plan has failed."""
BEFORE_GIVING_UP, PUT_DOWN = "beforeGivingUp", "PutDownWhatIsHeld"
"""Property of a failure in ontologies, and the value with which the hands are emptied after it."""


@process_module
class SettingAside(HandWork):
    """Puts a held object down on furniture near the robot, on which nobody sits or lies, and leaves it.

    With ``for_another_grip``, the current grip is ruled out for the next grasp of the object. It is put where it is in
    no way of a door or drawer, and of a hand at its handle, that is stated as ``out_of_the_way_of``.
    """

    name = "setting_aside"
    actions = ("SettingAsideAnObject",)

    async def execute(self, action: Action) -> str:
        """Put ``object_acted_on`` down; return the name of its support.

        Raises the failure of the nearest place if it cannot be put down anywhere; the object is then still held.
        """
        what = action.get("object_acted_on")
        name = self.platform.scene.bodies.bind(what) if isinstance(what, Object) else None
        grip = None if name is None else self.platform.belief.held.get(name)
        if not isinstance(what, Object) or name is None or grip is None:
            raise ActionUnresolvable("name an object that is held as object_acted_on", designator=str(action))
        if len(grip.arms) > 1:
            return await self._with_two_hands(name, what)

        async def no_place(problem: PlanFailure | None, tried: int) -> PlanFailure:
            return problem or LocationUnresolvable("no furniture nearby has room for it", designator=str(action))

        support = await Skill(
            self._places, partial(self._lower, what), lambda place: self.drive(place[1]), most=TRIED, otherwise=no_place
        ).run()
        grip = self.platform.belief.held[name]
        await self._leave(what)
        if action.get("for_another_grip"):
            self.platform.belief.refuse(name, grip)
        return support.name

    async def _with_two_hands(self, name: str, what: Object) -> str:
        """Let the module for two hands put the object down, which also drives there and leaves it.

        It has few grips, of one kind: another grip is one of another base pose, which that module finds.
        """

        async def put(support: Object) -> Object:
            await perform(action("PuttingDownAnObject", object_acted_on=what, to_location=support))
            return support

        async def no_place(problem: PlanFailure | None, tried: int) -> PlanFailure:
            found = f"no furniture nearby has room for {name}, which two hands hold"
            return LocationUnresolvable(f"{found}: put it down at a place that you choose, before they are needed")

        failures = (ManipulationFailure, NavigationFailure, ObjectUndeliverable, DesignatorFailure)
        return (await Skill(self._supports, put, failures=failures, most=SUPPORTS, otherwise=no_place).run()).name

    def _supports(self) -> Iterator[Object]:
        """Yield furniture on which to put things down, nearest first; at last what is made for people."""
        bodies, (x, y) = self.platform.scene.bodies, self.platform.base()[:2]
        things = {thing.name for thing in self.platform.belief.things}  # leaves out obstacles known only by touch
        names = [name for name in bodies.names() if name in things and self._is_support(name)]
        here, belief = np.array([x, y, 0.0]), self.platform.belief
        seats = {thing.name for thing in belief.things if belief.is_a(thing, FOR_PEOPLE)}
        ordered = sorted(names, key=lambda one: (one in seats, bodies.block(one).away(here), one))
        yield from map(bodies.designator, ordered[:SUPPORTS])

    def _places(self) -> Iterator[tuple[Object, BasePose]]:
        """Yield furniture with base poses from which to reach it, nearest furniture first."""
        for support in self._supports():
            with suppress(LocationUnresolvable):
                near = self.platform.resolver.bases(a_location(in_reach_of=resting_on(support)))
                for solution in islice(near, PLACES):
                    yield support, solution.base

    def _is_support(self, name: str) -> bool:
        bodies, joints = self.platform.scene.bodies, self.platform.belief.joints.values()
        is_other = bodies.is_graspable(name) or bodies.is_person(name) or bodies.is_room(name)
        is_other = is_other or any(name in one.bodies and not _is_drawer(name, one) for one in joints)
        return not is_other and bodies.rests_at(name) is not None and not self._is_taken(name)

    def _is_taken(self, name: str) -> bool:
        """Check whether a person sits or lies on a piece of furniture, or stands where it is."""
        bodies = self.platform.scene.bodies
        furniture = bodies.block(name)
        people = (bodies.block(one) for one in bodies.names() if bodies.is_person(one))
        return any(
            one.low <= furniture.high + AT_REST
            and furniture.distance(one.centre[None, :2])[0] <= 0.0
            and one.high > furniture.high
            for one in people
        )

    async def _lower(self, what: Object, place: tuple[Object, BasePose]) -> Object:
        """Put an object down on furniture, and return that."""
        await perform(action("LoweringAnObject", object_acted_on=what, to_location=place[0]))
        return place[0]

    async def _leave(self, what: Object) -> None:
        """Release the object and move the hand away as far as there is room."""
        await perform(action("OpeningAGripper", object_acted_on=what))
        with suppress(ManipulationFailure, DesignatorFailure):
            await perform(action("Reaching", to_location=a_location(in_front_of=what)))
            await perform(action("Reaching", to_location=a_posture(CARRYING)))


def _is_drawer(name: str, joint: Articulation) -> bool:
    """Check whether a part of a leaf is a drawer: doors and handles hold nothing that is put on them."""
    return name == joint.leaf and joint.kind is JointKind.PRISMATIC and not joint.frame


@process_module
class EmptyingTheHands(PlatformModule):
    """Puts down all that the hands hold after a plan has failed, where it is in no way of a door or drawer.

    Ontologies state by ``beforeGivingUp`` after which failures.
    """

    name = "emptying_the_hands"
    actions = ("EmptyingTheHands",)
    failures = ()

    def resources(self, action: Action) -> tuple[str, ...]:
        """Return the whole robot."""
        return self.whole_robot()

    async def execute(self, request: Action) -> tuple[str, ...]:
        """Put things down if a class of ``after_failure``, nearest first, says so; return a sentence about each.

        What cannot be put down stays in the hand.
        """
        await checkpoint()
        if not self._is_stated(request.get("after_failure")):
            return ()
        self.platform.resolver.count.allow(FURTHER_SEARCHES)  # the plan may have ended because it had none left
        bodies, joints = self.platform.scene.bodies, self.platform.belief.joints
        leaves = tuple(bodies.designator(leaf) for leaf, joint in joints.items() if not joint.is_knob)
        told = []
        for name in tuple(self.platform.belief.held):
            try:
                aside = action(ASIDE, object_acted_on=bodies.designator(name), out_of_the_way_of=leaves)
                support = await perform(aside)
                told.append(f"{name} was put down on {support}")
            except PlanFailure as failure:
                told.append(f"{name} stays in the hand, as it could not be put down: {failure}")
        return tuple(told)

    def _is_stated(self, kinds: object) -> bool:
        """Check whether ontologies say of the nearest class of a failure of which they say anything, to put down."""
        ontology = self.platform.belief.map.ontology
        for kind in kinds if isinstance(kinds, tuple) else ():
            stated = ontology.values(expand(str(kind)), BEFORE_GIVING_UP)
            if stated:
                return any(shorten(str(one)) == PUT_DOWN for one in stated)
        return False


@process_module
class SteppingBack(HandWork):
    """Backs off to the nearest base pose with room for the arms, if there is one; a fixed base stays."""

    name = "stepping_back"
    actions = ("SteppingBack",)
    failures = (NavigationFailure,)
    needs = ("base",)

    async def execute(self, action: Action) -> None:
        """Back off with the base. Raises a NavigationFailure if something stops it."""
        if not await self.back_off(self.platform.arms.untucked(), BACK):
            await checkpoint()
