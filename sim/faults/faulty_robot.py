"""A robot in a simulated world in which things go wrong: its interface, decorated."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

from numpy.typing import NDArray

from planlang.faults.kinds import Opportunity
from planlang.geometry import Array, Pose
from planlang.protocols import Configuration, Detection, Group, GroupKind, Motion, Touch, Trajectory
from sim.faults.grippers import Grippers
from sim.faults.handles import Handles
from sim.faults.injection import Injection
from sim.faults.looks import Looks
from sim.faults.motions import Motions
from sim.faults.offers import Devices, Offers
from sim.faults.things import Things


class FaultyRobot:
    """Implements :class:`planlang.protocols.RobotInterface` for a world in which things go wrong."""

    def __init__(self, injection: Injection, hands: Mapping[str, tuple[str, ...]]) -> None:
        """Let the world ask about persons and devices. ``hands``: link of a hand -> what its arm is called."""
        self._injection, self._truth, self.rate = injection, injection.truth, injection.truth.rate
        self._things, self._looks = Things(injection), Looks(injection)
        self._motions, self._handles = Motions(injection, self._things), Handles(injection)
        self._grippers = Grippers(injection, self._motions, self._things)
        self._arms = {self._truth.hand_at(link): names for link, names in hands.items()}
        """Link of a hand -> what its arm is called."""
        injection.truth.heed(switches=Devices(injection).switches, heeds=Offers(injection).heeds)

    def configuration(self) -> Configuration:
        """Return what the encoders report."""
        return self._grippers.reported(self._truth.configuration())

    def link_pose(self, link: str) -> Pose:
        """Return the pose of a link frame of the robot in the map."""
        return self._truth.link_pose(link)

    def start(self, group: str, trajectory: Trajectory, *, pushes: str | None = None) -> None:
        """Start a motion, or what becomes of it."""
        group = Group.of(group)
        self._handles.stopped.discard(group)
        if group.kind is GroupKind.FINGERS:
            link = self._truth.hand_moved_by(trajectory.names)
            if link is not None:
                hand = self._truth.hand_at(link)
                trajectory = self._grippers.start(group, hand, self._names(hand), trajectory)
        else:
            names = [name for one in self._arms.values() if one[0] in group.arms for name in one]
            trajectory = self._motions.start(group, names, trajectory)
        self._truth.start(group, trajectory, pushes=pushes)

    def motion(self, group: str) -> Motion:
        """Return the state of the group's last motion."""
        return self._handles.motion(group, self._motions.motion(group))

    def halt(self, group: str) -> None:
        """Stop the group where it is."""
        self._truth.halt(group)

    def detect(self, camera_link: str) -> tuple[Detection, ...]:
        """Return what the camera recognises."""
        return self._looks.seen(camera_link, self._truth.shown(camera_link))

    def scan(self, camera_link: str) -> tuple[Array, NDArray[Any]]:
        """Return the depth image."""
        return self._truth.scan(camera_link)

    def touches(self, links: Collection[str]) -> tuple[Touch, ...]:
        """Return the touches that links feel."""
        return self._truth.touches(links)

    def grip(self, link: str) -> None:
        """Press the closed fingers of a hand on the object between them."""
        held, led = set(self._truth.attached()), set(self._truth.led())
        self._truth.grip(link)
        arm = self._names(link)
        for name in [one for one in self._truth.attached() if one not in held and link in self._truth.holders(one)]:
            fault = self._injection.begins(Opportunity.CARRYING, (name, *arm), lambda kind, of, value: True)
            if fault is not None:
                self._things.carried(name, fault)
        for leaf in [one for one in self._truth.led() if one not in led]:
            joint = self._truth.leaf(leaf)
            self._handles.taken(leaf, (*filter(None, (joint.holder, *joint.handles)), *arm))

    def loosen(self, link: str) -> None:
        """Release the force of the fingers of a hand."""
        if self._grippers.lets_go(self._truth.hand_at(link), self._names(link)):
            self._truth.loosen(link)

    def feels(self, link: str) -> bool:
        """Check that an object keeps the gripping fingers apart."""
        return self._truth.feels(link)

    def pulled(self, link: str) -> bool:
        """Check whether somebody pulls at the object in the hand."""
        return self._truth.pulled(link)

    def _names(self, link: str) -> tuple[str, ...]:
        """List what the arm of a hand is called."""
        return self._arms.get(self._truth.hand_at(link), (link,))
