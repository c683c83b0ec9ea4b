"""What moves in a world: bodies and limbs of people, and links of the robot in the frames that they hang on.

Logs of poses and pages that show a run read the same from it.
"""

from __future__ import annotations

from collections.abc import Iterator

from planlang.experience.poses import MAP
from planlang.geometry import Pose
from planlang.records import dataclass
from sim.scene import BodyShape
from sim.truth import Truth

RATE = 10
"""Times a second that poses are noted, of what has moved; NEEMs have about as many."""
MOVED = 1e-6
"""Less than this [m, or of a quaternion] is no movement: links in their parents' frames are computed."""


def is_due(world: Truth) -> bool:
    """Return whether a world is at a step at which poses are noted."""
    return world.steps % max(1, world.rate // RATE) == 0


@dataclass(frozen=True, slots=True)
class Placed:
    """The pose of a body, of a limb of a person, or of a link of the robot in the frame that it hangs on."""

    kind: str
    """"body", "limb" or "link"."""
    frame: str
    name: str
    pose: Pose


class Movement:
    """Notes what has moved in a world since it was looked at last; at first everything has.

    Links are told in the frames of the links that they hang on, so that those of an arm at rest do not move with the
    base; the root link and bodies in the map, limbs of people in the frames of their bodies. Links whose joint stands
    still are not asked for: that is most of what looking at a robot costs.
    """

    def __init__(self, world: Truth) -> None:
        robot = world.robot
        self._names = robot.link_names
        self._above = {index: robot.parent[index] for index in sorted(self._names)}
        self._moved_by = {
            joint: (index, *(follower for follower, _ in robot.followers.get(joint, ())))
            for joint, index in robot.joints.items()
        }
        self._people = {body.name for body in world.scene.bodies if body.shape is BodyShape.PERSON}
        self._last: dict[tuple[str, str], tuple[float, ...]] = {}
        self._seen: dict[str, Pose] = {}
        self._joints: dict[str, float] = {}
        self._base: tuple[float, ...] | None = None

    def moved(self, world: Truth) -> Iterator[Placed]:
        """Yield what has moved, bodies before links."""
        for one in (*self._bodies(world), *self._links(world)):
            now, last = (*one.pose.position, *one.pose.orientation), self._last.get((one.kind, one.name))
            if last is None or max(abs(a - b) for a, b in zip(now, last, strict=True)) > MOVED:
                self._last[one.kind, one.name] = now
                yield one

    def _bodies(self, world: Truth) -> Iterator[Placed]:
        for name in world.names():
            pose = world.pose(name)
            if self._seen.get(name) is not pose:
                self._seen[name] = pose
                yield Placed("body", MAP, name, pose)
            if name in self._people:
                for number, (part, offset) in enumerate(world.pieces(name)):
                    if part.limb:
                        yield Placed("limb", name, f"{name}/limb{number}", offset)

    def _links(self, world: Truth) -> Iterator[Placed]:
        now = world.configuration()
        last, self._joints = self._joints, dict(now.joints)
        if self._base is None:
            moved = set(self._above)
        else:
            changed = (joint for joint, value in now.joints.items() if last.get(joint) != value)
            moved = {index for joint in changed for index in self._moved_by.get(joint, ())}
        if now.base != self._base:
            self._base = now.base
            moved.add(-1)
        poses: dict[int, Pose] = {}

        def pose_of(index: int) -> Pose:
            if index not in poses:
                poses[index] = world.link_pose(self._names[index])
            return poses[index]

        for index in sorted(moved):
            above = self._above[index]
            if above in self._names:
                yield Placed("link", self._names[above], self._names[index], pose_of(index).seen_from(pose_of(above)))
            else:
                yield Placed("link", MAP, self._names[index], pose_of(index))
