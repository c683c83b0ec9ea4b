"""Commands to hands: fingers close, hold, lead and let go; the belief has what they feel."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import partial

import numpy as np

from executive.belief.believed_bodies import MEANT
from executive.modules.commanding import Control
from executive.robots.arms import ArmModel
from executive.robots.openings import Fingers
from planlang.failures import GripperGoalNotReached
from planlang.kernel import now, sleep
from planlang.protocols import Group, GroupKind, Motion
from sim.falling import falling_time

NARROWER = 0.6
"""Share of the least extent of a thing below which fingers that close on it cannot get: off its middle they get less
than all of it."""
SAME = 0.01
"""Tolerance of openings, as a share of the hand's full opening."""


class Hands:
    """Moves fingers and records in the belief what they hold."""

    def __init__(self, control: Control) -> None:
        self._control = control
        self._at_rest: dict[str, float] = {}
        """Released object -> plan time at which it is expected to have come to rest [s]."""

    async def move(self, arm: ArmModel, *, closed: bool, fingers: Fingers = ()) -> Motion:
        """Close the fingers fully, or open them fully or to ``fingers``. Opening releases a handle."""
        control, gripper, link = self._control, arm.gripper, arm.tip
        assert gripper is not None
        if not closed:
            control.world.loosen(link)
            for leaf in [leaf for leaf, leader in control.belief.led.items() if leader == link]:
                control.belief.let_go(leaf)
        goal = gripper.closed if closed else dict(fingers) or gripper.opened
        path = np.stack([control.joints(gripper.joints), [goal[name] for name in gripper.joints]])
        return await control.follow(Group(GroupKind.FINGERS, arm.name), control.timed(gripper.joints, path))

    async def close(self, arm: ArmModel) -> Motion:
        """Close the fingers fully, or until they feel an object that stops them.

        Raises GripperGoalNotReached if they stop for another reason: without touch, nothing is held.
        """
        motion = await self.move(arm, closed=True)
        current = dict(zip(arm.openings.joints, self._control.joints(arm.openings.joints), strict=True))
        if motion.touch is None and current and arm.openings.share(current) > SAME:
            raise GripperGoalNotReached(arm=arm.name)
        return motion

    async def shape(self, arm: ArmModel, fingers: Fingers) -> None:
        """Move the fingers of an empty hand to the opening for which a hand pose was validated, if one is given."""
        if not fingers or self._control.scene.arms.held(arm.name) is not None:
            return
        current = dict(zip(arm.openings.joints, self._control.joints(arm.openings.joints), strict=True))
        if abs(arm.openings.share(current) - arm.openings.share(dict(fingers))) > SAME:
            await self.move(arm, closed=False, fingers=fingers)

    def lead(self, arm: ArmModel, leaf: str) -> None:
        """Couple a door or drawer to the hand that has closed on its handle: from now on they move together."""
        control, link = self._control, arm.tip
        control.world.grip(link)
        control.belief.leads(leaf, link)
        control.observe()

    def is_on(self, arm: ArmModel, name: str) -> bool:
        """Check whether the closed fingers feel something where a body is believed to be."""
        point = self._control.between_fingers(arm.name)
        return point is not None and self._control.scene.bodies.block(name).away(point) <= MEANT

    def between_fingers(self, arm: ArmModel) -> str | None:
        """Find the believed body that explains what the closed fingers feel; None if there is none."""
        point = self._control.between_fingers(arm.name)
        return None if point is None else self._control.scene.bodies.graspable_at(point)

    def too_narrow(self, arm: ArmModel, name: str) -> float | None:
        """Return the gap between the closed fingers [m] if a body would not let them that close; None if it may."""
        body, openings = self._control.scene.bodies.body(name), arm.openings
        if body.soft or body.handles or body.wall or not openings.gaps.any():
            return None
        current = dict(zip(openings.joints, self._control.joints(openings.joints), strict=True))
        gap = openings.gap_at(openings.share(current))
        return gap if gap < NARROWER * min(body.size) else None

    def grasp(self, arm: ArmModel, name: str) -> None:
        """Close the grip on the object between the fingers.

        The object believed to be ``name`` moves with the hand from now on.
        """
        control, link = self._control, arm.tip
        control.world.grip(link)
        offset = control.world.link_pose(link).inverse() @ control.belief.pose(name)
        control.belief.grasped(name, arm.name, link, offset)
        control.flowing.catch_up()
        if riders := control.scene.world.riders(name):
            control.belief.loaded(name, riders)

    def let_go(self, name: str, *, to: str | None = None) -> None:
        """Release a held body: it falls onto what is below, or stays where it is, in the hand of a person ``to``."""
        control = self._control
        rest = control.below(name)
        taken = control.scene.world.pose(name)
        self._at_rest[name] = now() + falling_time(taken.position[2] - rest.position[2])
        for hand in control.belief.held[name].hands:
            control.world.loosen(hand.link)
        control.belief.released(name, rest if to is None else taken, to=to)

    async def release(
        self, arms: Iterable[ArmModel], name: str, fingers: Callable[[ArmModel], Fingers], *, to: str | None = None
    ) -> None:
        """Release a held body and open the hands ``arms`` that hold it, each to ``fingers``.

        Raises GripperGoalNotReached if the fingers of one do not open; what a hand then still feels is still held.
        """
        belief, problem = self._control.belief, None
        hands, openings = belief.held[name].hands, [(arm, fingers(arm)) for arm in arms]
        self.let_go(name, to=to)
        try:
            for arm, opening in openings:
                await self.move(arm, closed=False, fingers=opening)
        except GripperGoalNotReached as failure:
            problem = failure
        if felt := [hand for hand in hands if self._control.world.feels(hand.link)]:
            for hand in felt:
                belief.grasped(name, *hand)
            raise problem or GripperGoalNotReached(arm=felt[0].arm)
        if problem is not None:
            raise problem

    async def settled(self, name: str) -> None:
        """Wait until a released body has had the time to come to rest."""
        await sleep(max(0.0, self._at_rest.pop(name) - now()))

    async def offer(self, arm: ArmModel, name: str, patience: float) -> bool:
        """Wait until the wrist feels a person pull at a held body; False if nobody does within ``patience`` [s].

        Raises ObjectLost if the body leaves the hand otherwise.
        """
        pulled = partial(self._control.world.pulled, arm.tip)
        return bool(await self._control.wait_holding([arm.name], pulled, f"{name} taken", patience))
