"""Process modules that open and close grippers, and hand a held object to a person."""

from __future__ import annotations

from contextlib import suppress

from executive.modules.platform import STANDS, PlatformModule
from executive.modules.verifying import begin_to_watch, check_is_felt, check_is_in_hand, check_is_where_put
from executive.robots.arms import ArmModel
from planlang.designators import (
    Action,
    Device,
    Object,
    Person,
)
from planlang.failures import (
    ActionUnresolvable,
    CommunicationFailure,
    DesignatorFailure,
    GraspMissed,
    GripperFailure,
    GripperGoalNotReached,
    HandoverNotTaken,
    ManipulationGoalNotReached,
    MissingCapability,
    ObjectLost,
)
from planlang.language.process_module import process_module
from planlang.protocols import MotionState


@process_module
class Grasping(PlatformModule):
    """Opens and closes grippers: a single module, so that requests to one gripper queue up."""

    name = "gripper"
    actions = ("OpeningAGripper", "ClosingAGripper")
    failures = (GripperFailure, ObjectLost, DesignatorFailure)

    def resources(self, action: Action) -> tuple[str, ...]:
        """Return the arm that carries the gripper, because it must not move meanwhile.

        And the head, if something is let go, which looks at what becomes of it.
        """
        arms = tuple(arm.name for arm in self._arms(action)[:1])
        lets_go = not self._closes(action) and any(map(self.platform.scene.arms.held, arms))
        return (*arms, "head") if lets_go and self.platform.robot.camera is not None else arms

    async def execute(self, action: Action) -> str | None:
        """Open or close the gripper; return the name of the object grasped or released.

        Raises GraspMissed if the fingers close on nothing, and ObjectLost if what was let go is not where it was put.
        """
        arms = self._arms(action)
        if not arms and self.platform.belief.held:
            held = ", ".join(f"{grip.arm} holds {name}" for name, grip in self.platform.belief.held.items())
            advice = "to let go of one, name it as object_acted_on, or the hand as device_used"
            raise ActionUnresolvable(f"no hand is free to open: {held}; {advice}", designator=str(action))
        if not arms:
            raise MissingCapability(designator=str(action), missing=("GripperMotionCapability",))
        if self._closes(action):
            return await self._close(arms[0], action)
        return await self._open(arms[0])

    def _arms(self, action: Action) -> list[ArmModel]:
        """Find the arms with grippers that the action may use, best first: of the stated device, else of all.

        A step that states no device does not open a hand that would drop something.
        """
        scene, arms = self.platform.scene, self.platform.arms
        device, closes = action.get("device_used"), self._closes(action)
        candidates = [arm for arm in scene.arms.asked(device) if arm.gripper is not None]
        if closes:
            return arms.closed_by(action, candidates)
        opened = arms.opened_by(action, candidates)
        return opened or (arms.in_order(candidates) if isinstance(device, Device) else [])

    def _closes(self, action: Action) -> bool:
        return "ClosingAGripper" in self.platform.ancestors(action.type)

    async def _close(self, arm: ArmModel, action: Action) -> str:
        hands = self.platform.hands
        motion = await hands.close(arm)
        name = hands.between_fingers(arm)
        if name is None:
            what = action.get("object_acted_on")
            target = str(what) if isinstance(what, Object) else None
            met = await self.platform.sensing.bump(motion)  # a finger has touched the object: that shows where it is
            if motion.touch is None:
                self.platform.missed(arm)
            missed = GraspMissed(arm=arm.name, what=target, blocked_by=met)
            if not arm.openings.gap:
                missed.message = f"{missed}; its fingers have no shapes that could hold it: are their meshes missing?"
            raise missed
        if not self.platform.belief.seen(name) and (gap := hands.too_narrow(arm, name)) is not None:
            # something else stands where the map has the thing
            await hands.move(arm, closed=False)
            self.platform.missed(arm)
            told = f"the gripper closed to {1000 * gap:.0f} mm: {name} is wider"
            raise GraspMissed(told, arm=arm.name, what=name)
        hands.grasp(arm, name)
        return name

    async def _open(self, arm: ArmModel) -> str | None:
        platform, hands, held = self.platform, self.platform.hands, self.platform.scene.arms.held(arm.name)
        if held is None:
            motion = await hands.move(arm, closed=False, fingers=platform.arms.opening(arm))
            if motion.state is not MotionState.DONE:
                raise GripperGoalNotReached(arm=arm.name, blocked_by=platform.sensing.met(motion))
            return None
        platform.check_hold([arm.name])
        is_taken, opened = platform.world.pulled(arm.tip), platform.arms.opening(arm)
        stands = platform.scene.world.height_above_support(held.name) <= STANDS
        begin_to_watch(platform, held.name)
        mates = platform.scene.arms.mates(arm.name)
        await hands.release((*mates, arm), held.name, platform.arms.opening)
        # The object has left the hand even if an obstacle beside it keeps the fingers from opening fully.
        await hands.settled(held.name)
        platform.arms.put_down(arm, held.name)
        if is_taken:
            return held.name
        if platform.robot.camera is not None:
            await check_is_where_put(platform, held.name)
        elif stands and not mates:
            await check_is_felt(platform, arm, held.name, opened)
        return held.name


DRAWN_BACK = (0.12, 0.06)
"""Distances to try for the straight retreat of a hand after the handover [m]."""
PATIENCE = 15.0
"""Time for which to offer an object [s]: long enough for a person to notice it and reach out."""


@process_module
class Handover(PlatformModule):
    """Offers a held object until a person takes it."""

    name = "handover"
    actions = ("HandingOverAnObject",)
    failures = (CommunicationFailure, GripperFailure, ObjectLost, DesignatorFailure)

    def resources(self, action: Action) -> tuple[str, ...]:
        """Return the arm that holds the object, and the head, which looks at what becomes of it."""
        arms = tuple(arm.name for arm in self.platform.arms.with_stated(action)[:1])
        return arms if self.platform.robot.camera is None else (*arms, "head")

    async def execute(self, action: Action) -> str:
        """Hand over ``object_acted_on`` (default: any held object); return the name of the person who took it.

        Raises HandoverNotTaken if nobody, or another person, pulls at it, and ObjectLost if the camera shows that the
        person has not kept it.
        """
        arms = self.platform.arms.with_stated(action)
        if not arms:
            raise ActionUnresolvable("no arm holds the object to hand over; grasp it first", designator=str(action))
        platform, arm = self.platform, arms[0]
        held = platform.scene.arms.held(arm.name)
        assert held is not None
        recipient = action.get("recipient")
        stated = str(recipient) if isinstance(recipient, Person) else None
        begin_to_watch(platform, held.name)
        if not await platform.hands.offer(arm, held.name, PATIENCE):
            raise HandoverNotTaken(what=held.name, recipient=stated)
        expected = platform.scene.bodies.bind(recipient) if isinstance(recipient, Person) else None
        person = platform.scene.bodies.taker(held.name, expected)
        if person is None or expected not in (None, person):
            message = f"{person or 'an unknown person'} takes {held.name} instead of {stated}"
            raise HandoverNotTaken(message, what=held.name, recipient=stated)
        mates = platform.scene.arms.mates(arm.name)
        await platform.hands.release((arm, *mates), held.name, lambda _: (), to=person)
        if not mates:
            await self._draw_back(arm, held.name)
        await platform.hands.settled(held.name)
        await check_is_in_hand(platform, held.name, person)
        return person

    async def _draw_back(self, arm: ArmModel, name: str) -> None:
        """Retreat straight from the object, if there is room: the arm's next motion might sweep into it otherwise.

        The person has the object, however far the hand comes.
        """
        path = self.platform.arms.drawn(arm, (far * self.back_of(arm) for far in DRAWN_BACK), name)
        if path is not None:
            with suppress(ManipulationGoalNotReached):
                await self.platform.sensing.bump(await self.platform.follow(arm.name, path))
