"""When a sense of the robot carries a fault first, and when the run shows that it was noticed.

A fault is *carried* by what the robot reads: the driver that reports the end of a motion, the fingers after they have
closed, a contact, a picture. A person who does not take what is offered, and a thing that is recognised where there is
none, are carried by no reading that differs from that of a world without the fault. It is *noticed* with the first
failure, recovery, or change of belief that tells of it, and that the same world has not without the fault.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from typing import Any

from executive.runs.assembly import RobotExecutive
from executive.runs.identity import Identities
from planlang.faults.kinds import Kind, Sense, kind_of
from planlang.geometry import Pose
from planlang.protocols import Detection, Group, GroupKind, MotionState, RobotInterface, Trajectory
from planlang.runs.codec import links
from sim import PyBulletWorld
from sim.truth import Truth

SAME = 0.05
"""Distance of a detection from what it shows [m]: no more than what noise displaces it by."""
LONGEST_HELD = 1.0
"""Time for which a robot may believe that it holds what it has just lost [s]."""


class Carried(Enum):
    """What carries a fault first."""

    AT_ONCE = "as it happens"
    AT_THE_END = "the end of the motion that it befalls"
    IN_THE_WAY = "a contact that stops a motion"
    IN_A_PICTURE = "a picture of what has changed, or a contact that stops a motion"
    NEVER = "nothing"


BY_SENSE: Mapping[Sense, Carried] = {
    Sense.ODOMETRY: Carried.AT_THE_END,
    Sense.CAMERA: Carried.IN_A_PICTURE,
    Sense.WRIST: Carried.NEVER,
}
"""Sense -> what carries the faults that it shows; all others as they happen."""
BY_KIND: Mapping[str, Carried] = {
    "gripper:misses": Carried.AT_THE_END,
    "gripper:misreports": Carried.AT_THE_END,
    "base:blocked": Carried.IN_THE_WAY,
    "camera:blind": Carried.AT_ONCE,
    "camera:overlooks": Carried.AT_ONCE,
    "camera:ghost": Carried.NEVER,
}
"""Kind -> what carries it, other than by its sense."""
TELLING = frozenset(
    {"lost", "given up", "grip refused", "felt", "not where expected", "not there", "not_seen", "stuck", "slipped off"}
)
"""Changes of belief that tell of something that is not as it was believed."""
TELLING_OF_IT = frozenset({"seen", "noticed", "recognised", "found", "moved", "switched"})
"""Changes of belief that do so of the thing that they name only."""
FAILED = ("ended", "recovery")
"""Records that may have a failure; that of a base pose which is left for the next one says nothing of the world."""


def carried_by(kind: Kind) -> Carried:
    """What carries a kind of fault first."""
    return BY_KIND.get(str(kind), BY_SENSE.get(kind.sense, Carried.AT_ONCE))


@dataclass
class Happened:
    """A fault that has happened."""

    kind: Kind
    of: str
    """What it befell."""
    step: int
    group: str | None
    """Group whose motion began as it happened."""
    beside: tuple[Pose, ...]
    """Where it was, and what is nearest there: what a picture has to show of one who is away."""
    carried: int | None = None
    """Step in which a sense carried it first."""


@dataclass
class Senses:
    """Follows what the robot reads in a run; ``around``, ``interface``, ``watch`` and ``heard`` are its observers."""

    happened: list[Happened] = field(default_factory=list)
    held_in_vain: float = 0.0
    """Longest time for which the robot believed that it held what it did not [s]."""
    _truth: Truth | None = None
    _executive: RobotExecutive | None = None
    _robot: RobotInterface | None = None
    _group: str | None = None
    _moving: set[str] = field(default_factory=set)
    """Groups that have moved in the step before."""
    _vain: dict[str, int] = field(default_factory=dict)

    def around(self, executive: RobotExecutive) -> None:
        """Get the executive."""
        self._executive = executive

    def interface(self, robot: RobotInterface) -> RobotInterface:
        """Decorate what the robot reads."""
        self._robot = robot
        return _Heard(robot, self)  # type: ignore[return-value]

    def heard(self, record: Mapping[str, Any], node: object) -> None:
        """Get a record of the trace."""
        if record["event"] != "fault" or self._truth is None:
            return
        part, _, name = str(record["fault"]).rpartition(":")
        kind = kind_of(part.partition(".")[0], name)
        if kind is None:
            return
        of, step = part.partition(".")[2], int(record["step"])
        one = Happened(kind, of, step, self._group, tuple(self._beside(of)))
        if carried_by(kind) is Carried.AT_ONCE:
            one.carried = step
        self.happened.append(one)

    def watch(self, truth: Truth) -> None:
        """See the world after a step."""
        self._truth = truth
        self._check_held(truth)
        states = {} if self._robot is None else {group: self._robot.motion(group).state for group in self._moving}
        self._moving -= {group for group, state in states.items() if state is not MotionState.MOVING}
        stopped = {
            group for group, state in states.items() if state is MotionState.BLOCKED and not _is_of_fingers(group)
        }
        waiting = [one for one in self.happened if one.carried is None]
        for one in waiting:
            match carried_by(one.kind):
                case Carried.AT_THE_END:
                    is_carried = one.group not in self._moving
                case Carried.IN_THE_WAY:
                    is_carried = one.group in stopped
                case Carried.IN_A_PICTURE:
                    is_carried = bool(stopped)
                case _:
                    is_carried = False
            if is_carried:
                one.carried = truth.steps

    def begins(self, group: str | None) -> None:
        """A motion of a group begins; None: it has begun."""
        self._group = group
        if group is not None:
            self._moving.add(group)

    def sees(self, picture: Sequence[Detection]) -> None:
        """The robot has taken a picture."""
        truth = self._truth
        if truth is None:
            return
        for one in self.happened:
            if one.carried is None and carried_by(one.kind) is Carried.IN_A_PICTURE and self._shows(picture, one):
                one.carried = truth.steps

    def _shows(self, picture: Sequence[Detection], one: Happened) -> bool:
        assert self._truth is not None
        now = self._truth.poses()
        places = [now[one.of]] if one.of in now else one.beside
        return any(place.distance(seen.pose) <= SAME for seen in picture for place in places)

    def _beside(self, of: str) -> Iterator[Pose]:
        """Yield where a body is, and what does not move nearest to it."""
        assert self._truth is not None
        poses, scene = self._truth.poses(), self._truth.scene
        here = poses.get(of)
        if here is None:
            return
        others = [pose for name, pose in poses.items() if name != of and not scene.body(name).graspable]
        yield here
        yield from sorted(others, key=here.distance)[:1]

    def _check_held(self, truth: Truth) -> None:
        if self._executive is None:
            return
        belief = self._executive.platform.belief
        held, names, attached = belief.held, truth.names(), truth.attached()
        self._vain = {name: self._vain.get(name, 0) + 1 for name in held if name in names and name not in attached}
        if self._vain:
            self.held_in_vain = max(self.held_in_vain, max(self._vain.values()) / truth.rate)

    def believes_to_hold(self) -> list[str]:
        """List what the robot believes to hold at the end, and does not."""
        if self._executive is None or not isinstance(self._truth, PyBulletWorld):
            return []
        platform, truth = self._executive.platform, self._truth
        identities = Identities(truth, platform.scene)
        return [name for name in platform.belief.held if identities.of(name) not in truth.attached()]

    def row(
        self, trace: Sequence[Mapping[str, Any]], without: Sequence[Mapping[str, Any]] = ()
    ) -> list[dict[str, Any]]:
        """What has become of each fault, as JSON.

        ``trace`` are the records of the run, ``without`` those of the same world without the fault.
        """
        rate = next(record["rate"] for record in trace if record["event"] == "header")
        starts = [number for number, record in enumerate(trace) if record["event"] == "fault"]
        usual = set(map(_key, without))
        after = ([record for record in trace[start + 1 :] if _key(record) not in usual] for start in starts)
        return [_row(one, records, rate) for one, records in zip(self.happened, after, strict=True)]


class _Heard:
    """Decorator of a robot interface that tells of motions that begin and of pictures."""

    def __init__(self, robot: RobotInterface, senses: Senses) -> None:
        self._robot, self._senses = robot, senses

    def __getattr__(self, name: str) -> Any:
        return getattr(self._robot, name)

    def start(self, group: str, trajectory: Trajectory, *, pushes: str | None = None) -> None:
        """Start a motion."""
        self._senses.begins(Group.of(group))
        self._robot.start(group, trajectory, pushes=pushes)
        self._senses.begins(None)

    def detect(self, camera_link: str) -> tuple[Detection, ...]:
        """Return what the camera recognises."""
        picture = self._robot.detect(camera_link)
        self._senses.sees(picture)
        return picture


def _row(one: Happened, after: Sequence[Mapping[str, Any]], rate: int) -> dict[str, Any]:
    """What has become of a fault: kind, plan times [s], and the classes of the failure that came of it first."""
    sign = next((record for record in after if _tells(record, one)), None)
    noticed = None if sign is None else int(sign["step"])
    carried = one.carried
    if noticed is not None and (carried is None or noticed < carried) and carried_by(one.kind) is not Carried.NEVER:
        carried = noticed  # what was noticed was carried
    failed = next((record for record in after if _has_failed(record)), None)
    return {
        "kind": str(one.kind),
        "of": one.of,
        "time": round(one.step / rate, 2),
        "carried": None if carried is None else round(carried / rate, 2),
        "noticed": None if noticed is None else round(noticed / rate, 2),
        "failure": [] if failed is None else list(chain_of(failed["failure"])),
    }


def _is_of_fingers(group: str) -> bool:
    return Group.of(group).kind is GroupKind.FINGERS


def _key(record: Mapping[str, Any]) -> Hashable:
    """What two runs have in common if they have the same record."""
    names = (record.get(key) for key in ("step", "event", "name", "change", "status", "decision"))
    return *names, *chain_of(record.get("failure"))


def _has_failed(record: Mapping[str, Any]) -> bool:
    return record["event"] in FAILED and bool(record.get("failure"))


def _tells(record: Mapping[str, Any], one: Happened) -> bool:
    """Check whether a record shows that a fault was noticed."""
    if record["event"] != "belief":
        return _has_failed(record) or record["event"] == "recovery"
    change = record.get("change")
    return change in TELLING or (change in TELLING_OF_IT and record.get("name") == one.of)


def chain_of(failure: Mapping[str, Any] | None) -> Iterator[str]:
    """Yield the class of a recorded failure, and those of its causes."""
    return (str(one["type"]).rpartition(".")[2] for one in links(failure))
