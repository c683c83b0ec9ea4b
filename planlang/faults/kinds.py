"""The kinds of faults: what goes wrong, at which opportunity, and which sense of the robot carries it."""

from __future__ import annotations

from collections.abc import Sequence
from enum import StrEnum

from planlang.records import dataclass


class Opportunity(StrEnum):
    """A moment at which at most one fault begins."""

    ARM = "a motion of an arm"
    HEAD = "a motion of the head"
    BASE = "a motion of the base"
    OPENING = "an opening of a gripper"
    CLOSING = "a closing of a gripper"
    CARRYING = "a carrying, from lifting to putting down"
    LOOK = "a look"
    HANDLE = "a contact with a handle"
    OFFER = "an offer to a person"
    SWITCHING = "a switching of a device"
    STEP = "a start of a step"


class Sense(StrEnum):
    """What tells the robot that something is wrong."""

    MOTORS = "motors"
    """The driver of a motion reports that it did not reach its goal."""
    ODOMETRY = "odometry"
    FINGERS = "fingers"
    """Touch of the fingertips."""
    BUMP = "touch"
    """A contact stops a motion."""
    WRIST = "wrist"
    """The forces at the wrist."""
    CAMERA = "camera"
    STEP = "the step"
    """It fails by itself, whatever the world is like."""


@dataclass(frozen=True, slots=True)
class Kind:
    """A kind of fault."""

    part: str
    """What it happens to: a part of the robot, or of the world."""
    name: str
    opportunity: Opportunity
    happens: str
    """What happens, as a sentence without its end."""
    sense: Sense
    """The sense that carries it first."""
    shows: tuple[str, ...]
    """Classes of the failures in whose chain it may show."""
    value: str | None = None
    """What its value states, if it may have one."""
    recovers: bool = True
    """False for what a robot cannot make good: it is never drawn by a rate."""

    def __str__(self) -> str:
        return f"{self.part}:{self.name}"

    @property
    def stated(self) -> str:
        """How it is stated, with its value, if it may have one."""
        return str(self) if self.value is None else f"{self}={self.value}"

    @property
    def chance(self) -> str:
        """What is added for a kind that is not drawn by a rate."""
        return "" if self.recovers else "; only if it is named"


KINDS: Sequence[Kind] = (
    Kind("gripper", "misses", Opportunity.CLOSING, "the thing slides out from between the fingers as they close",
         Sense.FINGERS, ("GraspMissed",)),
    Kind("gripper", "stays_open", Opportunity.CLOSING, "the fingers do not close",
         Sense.MOTORS, ("GripperGoalNotReached",)),
    Kind("gripper", "stays_closed", Opportunity.OPENING, "the fingers do not open, nor let go",
         Sense.MOTORS, ("GripperGoalNotReached",)),
    Kind("gripper", "misreports", Opportunity.CLOSING, "until they move again, the encoders report another width",
         Sense.FINGERS, ("GraspMissed", "GripperGoalNotReached"), value="WIDTH"),
    Kind("gripper", "breaks", Opportunity.CLOSING, "the fingers do not move any more",
         Sense.MOTORS, ("GripperGoalNotReached",), recovers=False),
    Kind("arm", "stalls", Opportunity.ARM, "the arm stops short",
         Sense.MOTORS, ("ManipulationGoalNotReached",), value="SHARE"),
    Kind("head", "stalls", Opportunity.HEAD, "the head stops short",
         Sense.MOTORS, ("LookingFailure",), value="SHARE"),
    Kind("base", "stalls", Opportunity.BASE, "the base stops short",
         Sense.MOTORS, ("NavigationGoalNotReached",), value="SHARE"),
    Kind("base", "drifts", Opportunity.BASE, "the wheels slip, so that the base ends beside its goal",
         Sense.ODOMETRY, ("NavigationGoalNotReached", "ManipulationPoseUnreachable"), value="METRES"),
    Kind("base", "blocked", Opportunity.BASE, "something stands in the way of the base for a while",
         Sense.BUMP, ("NavigationGoalNotReached",), value="SECONDS"),
    Kind("camera", "blind", Opportunity.LOOK, "the picture shows nothing",
         Sense.CAMERA, ("ObjectNotFound",)),
    Kind("camera", "overlooks", Opportunity.LOOK, "the camera does not recognise the things of one class",
         Sense.CAMERA, ("ObjectNotFound",), value="CLASS"),
    Kind("camera", "ghost", Opportunity.LOOK, "the camera recognises a thing where it is not",
         Sense.CAMERA, ("GraspMissed", "ObjectNotFound", "ManipulationPoseUnreachable"), value="THING"),
    Kind("handle", "comes_loose", Opportunity.HANDLE, "the hand slips off the handle on its way",
         Sense.FINGERS, ("GraspSlipped",), value="SHARE"),
    Kind("door", "stuck", Opportunity.HANDLE, "the door, drawer, lid or knob does not move, this time",
         Sense.BUMP, ("ContainerStuck",)),
    Kind("door", "stops", Opportunity.HANDLE, "the door, drawer, lid or knob stops on its way, this time",
         Sense.BUMP, ("ContainerStuck",), value="SHARE"),
    Kind("door", "falls_shut", Opportunity.HANDLE, "the door falls shut once the hand has let go of it",
         Sense.CAMERA, ("ContainerStuck", "ObjectUnreachable", "ObjectNotFound", "ManipulationGoalNotReached")),
    Kind("door", "jams", Opportunity.HANDLE, "the door, drawer, lid or knob does not move any more",
         Sense.BUMP, ("ContainerStuck",), recovers=False),
    Kind("person", "refuses", Opportunity.OFFER, "the person does not take what is offered, for a while",
         Sense.WRIST, ("HandoverNotTaken",), value="SECONDS"),
    Kind("person", "hesitates", Opportunity.OFFER, "the person begins to reach for it late",
         Sense.WRIST, ("HandoverNotTaken",), value="SECONDS"),
    Kind("person", "lets_go", Opportunity.OFFER, "the person takes hold of it, and lets it fall",
         Sense.CAMERA, ("ObjectLost", "HandoverNotTaken")),
    Kind("person", "leaves", Opportunity.OFFER, "the person goes away, and comes back after a while",
         Sense.CAMERA, ("HandoverNotTaken", "ObjectNotFound"), value="SECONDS"),
    Kind("person", "is_gone", Opportunity.OFFER, "the person goes away for good",
         Sense.CAMERA, ("HandoverNotTaken", "ObjectNotFound", "ObjectNowhereToBeFound"), recovers=False),
    Kind("thing", "slips", Opportunity.CARRYING, "the thing slips out of the hand while it is carried",
         Sense.FINGERS, ("ObjectLost",), value="SECONDS"),
    Kind("thing", "rolls", Opportunity.OPENING, "the thing rolls away from where a hand has put it down",
         Sense.CAMERA, ("ObjectLost",), value="METRES"),
    Kind("thing", "moves", Opportunity.BASE, "somebody moves a thing on what it stands on",
         Sense.CAMERA, ("ObjectNotFound", "GraspMissed", "ManipulationPoseUnreachable"), value="METRES"),
    Kind("thing", "is_gone", Opportunity.BASE, "somebody takes a thing away for good",
         Sense.CAMERA, ("ObjectNotFound", "ObjectNowhereToBeFound", "GraspMissed"), recovers=False),
    Kind("device", "stays", Opportunity.SWITCHING, "the device does not switch, this time",
         Sense.CAMERA, ("DeviceUnresponsive",)),
    Kind("device", "is_dead", Opportunity.SWITCHING, "the device does not switch any more",
         Sense.CAMERA, ("DeviceUnresponsive",), recovers=False),
    Kind("step", "fails", Opportunity.STEP, "the step, or the action of the class, that it names fails",
         Sense.STEP, (), value="FAILURE", recovers=False),
)  # fmt: skip
"""All kinds, by what they happen to."""

_BY_NAME = {str(one): one for one in KINDS}


def kind_of(part: str, name: str) -> Kind | None:
    """Look up a kind; None if there is none of this name."""
    return _BY_NAME.get(f"{part}:{name}")


def parts() -> Sequence[str]:
    """What faults happen to, in the order of the table."""
    return tuple(dict.fromkeys(one.part for one in KINDS))
