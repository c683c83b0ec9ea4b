"""Failures of plans: one root, two levels, typed fields.

Process modules raise low-level failures; plans handle them or raise high-level failures from them. Any other exception
is a programming error, which no construct and no recovery catches.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field
from typing import ClassVar

import planlang.failure_wording as wording
from planlang.advice import Change
from planlang.designators import Action, FixedPose, Object
from planlang.plan_failure import PlanFailure as PlanFailure
from planlang.plan_failure import Where as Where
from planlang.records import dataclass


@dataclass(eq=False, repr=False)
class LowLevelFailure(PlanFailure):
    """Raised by a process module."""

    text: ClassVar[str] = "the action failed"


@dataclass(eq=False, repr=False)
class NavigationFailure(LowLevelFailure):
    """The base did not reach its target. ``target`` is (x, y, yaw) in the map [m, rad]."""

    target: tuple[float, float, float] | None = field(default=None, kw_only=True)
    blocked_by: str | None = field(default=None, kw_only=True)

    text: ClassVar[str] = "navigation failed"


class NavigationPoseUnreachable(NavigationFailure):
    """No free path leads to the target."""

    text: ClassVar[str] = "no path for the base"


class NavigationGoalNotReached(NavigationFailure):
    """The base stopped before the target."""

    text: ClassVar[str] = "the base did not arrive"


class NavigationGoalInCollision(NavigationFailure):
    """The base would collide at the target."""

    text: ClassVar[str] = "the base has no room at its target"


@dataclass(eq=False, repr=False)
class PerceptionFailure(LowLevelFailure):
    """Perception did not deliver what was requested. ``what`` names the object."""

    what: str | None = field(default=None, kw_only=True)

    text: ClassVar[str] = "perception failed"


class ObjectNotFound(PerceptionFailure):
    """The camera does not see the object where it looked."""

    text: ClassVar[str] = "object not found"


class RecognitionModelMissing(ObjectNotFound):
    """No recognition model exists for the object's class, so it cannot be recognised anywhere."""

    text: ClassVar[str] = "no recognition model"


class ObjectLost(PerceptionFailure):
    """An object is no longer where it was seen before, or no longer in the hand."""

    text: ClassVar[str] = "object lost"


@dataclass(eq=False, repr=False)
class AmbiguousPerception(PerceptionFailure):
    """Several objects fit the description equally well."""

    candidates: tuple[str, ...] = field(default=(), kw_only=True)

    text: ClassVar[str] = "several objects fit"


class StateUnknown(PerceptionFailure):
    """The robot can neither see nor feel whether furniture is open, or whether a device is on."""

    text: ClassVar[str] = "the state is unknown"


@dataclass(eq=False, repr=False)
class LookingFailure(LowLevelFailure):
    """The camera could not be pointed at its target. ``what`` names the target."""

    what: str | None = field(default=None, kw_only=True)

    text: ClassVar[str] = "looking failed"


class LookingGoalUnreachable(LookingFailure):
    """The neck cannot point the camera there."""

    text: ClassVar[str] = "the camera cannot be pointed there"


@dataclass(eq=False, repr=False)
class ManipulationFailure(LowLevelFailure):
    """A motion of an arm failed. ``what`` names the object concerned, ``blocked_by`` the obstacle."""

    arm: str | None = field(default=None, kw_only=True)
    what: str | None = field(default=None, kw_only=True)
    blocked_by: str | None = field(default=None, kw_only=True)

    text: ClassVar[str] = "manipulation failed"


class ManipulationPoseUnreachable(ManipulationFailure):
    """The arm cannot reach the pose from here."""

    text: ClassVar[str] = "the arm cannot reach the pose"


class ManipulationGoalNotReached(ManipulationFailure):
    """The arm stopped before the goal."""

    text: ClassVar[str] = "the arm did not arrive"


class ManipulationGoalInCollision(ManipulationFailure):
    """The arm, or what it holds, would collide at the goal."""

    text: ClassVar[str] = "the arm has no room at its goal"


class ObjectNotTurned(ManipulationFailure):
    """The object still lies the same way up."""

    text: ClassVar[str] = "the object did not turn over"


class VesselEmpty(ManipulationFailure):
    """The vessel to pour from or stir in has no known contents. ``what`` names it."""

    text: ClassVar[str] = "the vessel is empty"


@dataclass(eq=False, repr=False)
class AmountNotPoured(ManipulationFailure):
    """The poured amount differs from the requested one, or the requested one cannot be poured [ml]."""

    asked: float | None = field(default=None, kw_only=True)
    poured: float | None = field(default=None, kw_only=True)

    text: ClassVar[str] = "the amount was not poured"


class GripperFailure(ManipulationFailure):
    """A gripper command failed."""

    text: ClassVar[str] = "the gripper failed"


class GraspMissed(GripperFailure):
    """The gripper closed on nothing."""

    text: ClassVar[str] = "the gripper closed on nothing"


class GraspSlipped(GripperFailure):
    """The object slipped out of the gripper."""

    text: ClassVar[str] = "the object slipped out of the gripper"


class GripperGoalNotReached(GripperFailure):
    """The fingers stopped before the commanded opening."""

    text: ClassVar[str] = "the gripper did not reach its opening"


@dataclass(eq=False, repr=False)
class TorsoFailure(ManipulationFailure):
    """A motion of the torso failed. ``height`` is the commanded joint position [m]."""

    height: float | None = field(default=None, kw_only=True)

    text: ClassVar[str] = "the torso failed"


class TorsoGoalUnreachable(TorsoFailure):
    """The torso cannot reach the height."""

    text: ClassVar[str] = "the torso cannot reach the height"


class TorsoGoalNotReached(TorsoFailure, ManipulationGoalNotReached):
    """The torso stopped before the height; whatever repeats the motion of an arm repeats this one, too."""

    text: ClassVar[str] = "the torso did not arrive"


@dataclass(eq=False, repr=False)
class EnvironmentManipulationFailure(LowLevelFailure):
    """A container or handle did not move as commanded."""

    what: str | None = field(default=None, kw_only=True)

    text: ClassVar[str] = "operating the furniture failed"


class ContainerStuck(EnvironmentManipulationFailure):
    """The container does not open or close."""

    text: ClassVar[str] = "the container is stuck"


class HandleNotReachable(EnvironmentManipulationFailure):
    """The handle cannot be reached from here."""

    text: ClassVar[str] = "the handle is out of reach"


class DeviceUnresponsive(EnvironmentManipulationFailure):
    """The device stays on or off although its button was pushed or its knob turned."""

    text: ClassVar[str] = "the device does not respond"


@dataclass(eq=False, repr=False)
class CommunicationFailure(LowLevelFailure):
    """A person did not respond as the robot expected."""

    what: str | None = field(default=None, kw_only=True)
    recipient: str | None = field(default=None, kw_only=True)

    text: ClassVar[str] = "the person did not answer"


class HandoverNotTaken(CommunicationFailure):
    """The person did not take the offered object."""

    text: ClassVar[str] = "the object was not taken"


@dataclass(eq=False, repr=False)
class HighLevelFailure(PlanFailure):
    """The plan cannot achieve a purpose. ``what`` names the object concerned."""

    what: str | None = field(default=None, kw_only=True)

    text: ClassVar[str] = "the purpose cannot be served"


class ObjectUnreachable(HighLevelFailure):
    """No place was found from which the object can be reached."""

    text: ClassVar[str] = "the object cannot be reached"


class ObjectUnfetchable(HighLevelFailure):
    """The object can be reached and seen, but not grasped."""

    text: ClassVar[str] = "the object cannot be fetched"


class ObjectUndeliverable(HighLevelFailure):
    """The robot finds no place from which to deliver the object."""

    text: ClassVar[str] = "the object cannot be delivered"


class ObjectNowhereToBeFound(HighLevelFailure):
    """The object was not seen from any of the places tried."""

    text: ClassVar[str] = "the object is nowhere to be found"


class EnvironmentUnreachable(HighLevelFailure):
    """A piece of furniture cannot be operated from any place tried."""

    text: ClassVar[str] = "the furniture cannot be reached"


@dataclass(eq=False, repr=False)
class DesignatorFailure(PlanFailure):
    """A description matches nothing in the world. ``designator`` is its text."""

    designator: str | None = field(default=None, kw_only=True)

    text: ClassVar[str] = "cannot be grounded"

    def describe(self) -> str:
        """Return ``TEXT: DESIGNATOR (details)``."""
        rest = wording.in_words({key: value for key, value in self.details().items() if key != "designator"})
        text = f"{self.text}{f': {self.designator}' if self.designator else ''}"
        return f"{text} ({rest})" if rest else text


@dataclass(eq=False, repr=False)
class LocationUnresolvable(DesignatorFailure):
    """Every candidate was rejected: ``counts`` has their numbers by reason, ``blocking`` by the body in the way.

    ``after`` is the number of places that were found before and failed. ``figures`` has what was measured and what
    helps, ``changes`` this as data, and ``first`` an action of the robot that helps.
    """

    counts: Mapping[str, int] = field(default_factory=dict, kw_only=True)
    blocking: Mapping[str, int] = field(default_factory=dict, kw_only=True)
    figures: str = field(default="", kw_only=True)
    after: int = field(default=0, kw_only=True)
    first: Action | None = field(default=None, kw_only=True)
    changes: tuple[Change, ...] = field(default=(), kw_only=True)

    text: ClassVar[str] = "no place found"

    def describe(self) -> str:
        """``no place found for DESIGNATOR: FIGURES (312 candidates: 112 in collision; in the way: bed1 96, ...)``."""
        text = wording.search_in_words(self.text, self.designator, self.after)
        text = f"{text}: {sentence}" if (sentence := self.because()) else text
        counted = wording.counts_in_words(self.counts, self.blocking)
        return f"{text} ({counted})" if counted else text

    def because(self) -> str:
        """The reason as a sentence, "" if there are only counts."""
        return self.figures


@dataclass(eq=False, repr=False)
class BehindClosedDoor(LocationUnresolvable):
    """The target ``what`` is behind a ``door`` that is not open far enough, or in a closed drawer.

    ``further``: other closed doors on the way. ``beyond``: base poses behind shut ones of rooms, to close again from.
    """

    what: str | None = field(default=None, kw_only=True)
    door: Object | None = field(default=None, kw_only=True)
    further: tuple[Object, ...] = field(default=(), kw_only=True)
    beyond: tuple[tuple[Object, FixedPose], ...] = field(default=(), kw_only=True)

    def because(self) -> str:
        """``bottle1 is behind door1, which is closed``."""
        return self.figures or wording.closed_in_words(self.what, (self.door, *self.further))


@dataclass(eq=False, repr=False)
class TooHeavy(LocationUnresolvable):
    """The object ``what`` is too heavy for the hands that are free.

    ``mass`` is that of the object with the ``load`` in it or on it, ``payload`` what ``hands`` free hands, 1 or 2,
    carry together [kg].
    """

    what: str | None = field(default=None, kw_only=True)
    mass: float = field(default=0.0, kw_only=True)
    payload: float = field(default=0.0, kw_only=True)
    hands: int = field(default=1, kw_only=True)
    load: float = field(default=0.0, kw_only=True)

    def because(self) -> str:
        """``pot1 weighs 3.9 kg with the 1.5 kg in it or on it, both hands carry 3 kg: 0.9 kg too much``."""
        return wording.weight_in_words(self.what, self.mass, self.load, self.payload, self.hands)


@dataclass(eq=False, repr=False)
class HandsLacking(LocationUnresolvable):
    """The object ``what`` takes more hands than are free, or than were asked.

    It takes ``needed`` hands; of the ``of`` hands of the robot ``hands`` are free. If these are enough, one was asked
    alone.
    """

    what: str | None = field(default=None, kw_only=True)
    needed: int = field(default=2, kw_only=True)
    hands: int = field(default=0, kw_only=True)
    of: int = field(default=0, kw_only=True)

    def because(self) -> str:
        """``tray1 takes 2 hands, the robot has 1``."""
        return wording.hands_in_words(self.what, self.needed, self.hands, self.of)


@dataclass(eq=False, repr=False)
class HandsFull(LocationUnresolvable):
    """No hand that may grasp the object is free. ``held`` maps each hand to the object in it."""

    what: str | None = field(default=None, kw_only=True)
    held: Mapping[str, Object] = field(default_factory=dict, kw_only=True)

    def because(self) -> str:
        """``no hand is free for glass1: arm holds bottle1; put it down first``."""
        return wording.full_in_words(self.what, self.held)


class ObjectUnresolvable(DesignatorFailure):
    """No known object fits the description."""

    text: ClassVar[str] = "no such object is known"


class ActionUnresolvable(DesignatorFailure):
    """No registered process module performs the action."""

    text: ClassVar[str] = "nothing performs this action"


@dataclass(eq=False, repr=False)
class MissingCapability(DesignatorFailure):
    """The robot lacks a capability or component that the action depends on."""

    missing: tuple[str, ...] = field(default=(), kw_only=True)

    text: ClassVar[str] = "the robot cannot do this"


# -- raised by constructs


@dataclass(eq=False, repr=False)
class CompositeFailure(PlanFailure):
    """Several branches failed. ``failures`` and ``names`` are in textual order."""

    failures: tuple[PlanFailure, ...] = field(default=(), kw_only=True)
    names: tuple[str, ...] = field(default=(), kw_only=True)

    text: ClassVar[str] = "all branches failed"

    def describe(self) -> str:
        """``all branches failed: NAME: MESSAGE; ...``."""
        told = "; ".join(f"{name}: {one}" for name, one in zip(self.names, self.failures, strict=True))
        return f"{self.text}: {told}" if self.failures else "there was no branch that could succeed"


@dataclass(eq=False, repr=False)
class Timeout(PlanFailure):
    """A body exceeded its time limit."""

    seconds: float | None = field(default=None, kw_only=True)
    construct: str | None = field(default=None, kw_only=True)

    def describe(self) -> str:
        """``NAME took longer than S s``."""
        return f"{self.construct or 'the body'} took longer than {self.seconds} s"


@dataclass(eq=False, repr=False)
class BudgetExceeded(PlanFailure):
    """A budget is used up. ``spent`` is the time by action [s], ``used`` the number of attempts by construct."""

    seconds: float | None = field(default=None, kw_only=True)
    attempts: int | None = field(default=None, kw_only=True)
    spent: Mapping[str, float] = field(default_factory=dict, kw_only=True)
    used: Mapping[str, int] = field(default_factory=dict, kw_only=True)

    def describe(self) -> str:
        """Return ``the budget of S s and N attempts is used up: ACTION S s, ..., CONSTRUCT N times, ...``."""
        return wording.budget_in_words(self.seconds, self.attempts, self.spent, self.used)


@dataclass(eq=False, repr=False)
class BranchEvaporated(PlanFailure):
    """A branch was evaporated from outside its construct."""

    path: str | None = field(default=None, kw_only=True)

    text: ClassVar[str] = "a branch was evaporated from outside"


@dataclass(eq=False, repr=False)
class PolicyViolated(PlanFailure):
    """A condition that must hold while a body runs was violated."""

    policy: str | None = field(default=None, kw_only=True)

    text: ClassVar[str] = "a policy was violated"


@dataclass(eq=False, repr=False)
class GoalNotAchieved(PlanFailure):
    """The body ended, but its goal does not hold."""

    goal: str | None = field(default=None, kw_only=True)

    text: ClassVar[str] = "the goal does not hold after the body"


@dataclass(eq=False, repr=False)
class TransitionMissing(PlanFailure):
    """A state ended with an outcome for which there is no transition."""

    state: str | None = field(default=None, kw_only=True)
    outcome: str | None = field(default=None, kw_only=True)

    text: ClassVar[str] = "no transition"
