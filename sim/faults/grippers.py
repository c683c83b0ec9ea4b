"""Faults of grippers: fingers that miss a thing, do not move, or report another width than they have."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

from planlang.faults.drawing import Drawn
from planlang.faults.kinds import Kind, Opportunity
from planlang.protocols import Configuration, Group, Trajectory
from sim.faults.injection import Injection
from sim.faults.motions import Motions
from sim.faults.things import Things

_PUSHED = (0.04, 0.16)
"""Distances by which a thing slides out from between the fingers [m]."""
_WRONG = (0.005, 0.04)
"""Differences of a reported finger from where it is [rad, m]."""
_DEAD = "the motor does not turn"


class Grippers:
    """What goes wrong with openings and closings."""

    def __init__(self, injection: Injection, motions: Motions, things: Things) -> None:
        self._injection, self._truth = injection, injection.truth
        self._motions, self._things = motions, things
        self._openings: dict[str, tuple[int, Drawn | None]] = {}
        """Link of a hand -> the step in which it began to open, and what goes wrong with that."""
        self._broken: dict[str, Drawn] = {}
        """Links of the hands whose fingers do not move any more."""
        self._wrong: dict[str, tuple[tuple[str, ...], float]] = {}
        """Link of a hand -> joints that report another position, and by how much [rad, m]."""

    def lets_go(self, link: str, names: Sequence[str]) -> bool:
        """Check whether the fingers of a hand release their force, with which an opening begins."""
        fault, thing = self._opening(link, names), self._things.put_down_by(link)
        if fault is not None and thing is not None and fault.kind.part == "thing":
            self._things.rolls(thing, replace(fault, of=thing), link)
            fault = None
        return link not in self._broken and fault is None

    def start(self, group: Group, link: str, names: Sequence[str], trajectory: Trajectory) -> Trajectory:
        """Return the trajectory that the fingers of a hand follow in truth; ``names`` are what its arm is called."""
        self._motions.failed.pop(group, None)
        self._wrong.pop(link, None)
        if link in self._broken:
            return self._still(group, trajectory, None)
        if self._openings.get(link, (-1, None))[0] == self._truth.steps or self._truth.opens(link, trajectory):
            fault = self._opening(link, names)
            del self._openings[link]  # the next one is another, even in the same step
        else:
            fault = self._injection.begins(Opportunity.CLOSING, names, partial(self._can, link=link))
        if fault is None or fault.kind.part == "thing":
            return trajectory
        match fault.kind.name:
            case "misses":
                thing = self._truth.within_fingers(link)
                pose = None if thing is None else self._things.place(thing, fault, *_PUSHED, out_of=link)
                if thing is not None and pose is not None:
                    self._truth.set_pose(thing, pose)
                    self._injection.happens(fault)
                return trajectory
            case "misreports":
                self._wrong[link] = trajectory.names, fault.between(*_WRONG)
                self._injection.happens(fault)
                return trajectory
            case "breaks":
                self._broken[link] = fault
        return self._still(group, trajectory, fault)

    def reported(self, now: Configuration) -> Configuration:
        """Return what the encoders report."""
        if not self._wrong:
            return now
        joints = dict(now.joints)
        for names, more in self._wrong.values():
            for name in names:
                least, most = self._truth.robot.limits.get(name, (float("-inf"), float("inf")))
                joints[name] = min(max(joints[name] + more, least), most)
        return replace(now, joints=joints)

    def _still(self, group: Group, trajectory: Trajectory, fault: Drawn | None) -> Trajectory:
        """Let the fingers stay where they are."""
        if fault is not None:
            return self._motions.cut(group, trajectory, fault, 1, _DEAD)
        self._motions.failed[group] = _DEAD
        return Trajectory(trajectory.names, trajectory.positions[:1])

    def _opening(self, link: str, names: Sequence[str]) -> Drawn | None:
        """Draw what goes wrong with an opening, once: it begins with the release of force, or with the motion."""
        if self._openings.get(link, (-1, None))[0] != self._truth.steps:
            thing = self._things.put_down_by(link)
            names = names if thing is None else (*names, thing)
            fault = self._injection.begins(Opportunity.OPENING, names, partial(self._can_open, link=link, thing=thing))
            self._openings[link] = self._truth.steps, fault
        return self._openings[link][1]

    def _can_open(self, kind: Kind, of: str | None, value: str | None, link: str, thing: str | None) -> bool:
        return kind.part != "thing" or (thing is not None and self._things.can_roll(thing, link))

    def _can(self, kind: Kind, of: str | None, value: str | None, link: str) -> bool:
        if kind.name != "misses":
            return True
        thing = self._truth.within_fingers(link)
        return thing is not None and self._things.can_slide(thing, _PUSHED, out_of=link)
