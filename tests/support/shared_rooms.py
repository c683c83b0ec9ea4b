"""The hospital room, in which another robot drives to and fro, and what is counted of a run in it."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from planlang.protocols import MotionState
from sim import PyBulletWorld

PORTER = "porter1"
"""Name of the other robot."""
ROUTES = (
    ((-0.5, -1.9), (-0.5, 1.9)),
    ((-1.5, 0.5), (0.4, -1.0)),
    ((0.1, -1.3), (0.1, 1.8), (-1.7, 1.5)),
    ((-1.8, 1.8), (0.5, -1.0)),
)
"""Routes that cross the ways between the cabinet, the bed and the middle of the room."""
MAP = """Prefix: : <http://planlang.org/kb/shared_ward.owl#>
Prefix: knowrob: <http://knowrob.org/kb/knowrob.owl#>
Prefix: room: <http://planlang.org/kb/hospital_room.owl#>

Ontology: <http://planlang.org/kb/shared_ward.owl>
    Import: <http://planlang.org/kb/hospital_room.owl>
    Import: <http://knowrob.org/kb/moving.owl>

Individual: porter1
    Types: knowrob:Robot
    Facts:
        knowrob:describedInMap room:hospital_room, knowrob:orientation pose_porter1,
        knowrob:depthOfObject 0.5, knowrob:widthOfObject 0.4, knowrob:heightOfObject 1.1,
        knowrob:routePoints "{points}", knowrob:drivingSpeed {speed}

Individual: pose_porter1
    Types: knowrob:RotationMatrix3D
    Facts:
        knowrob:m00 1.0, knowrob:m01 0.0, knowrob:m02 0.0, knowrob:m03 {x},
        knowrob:m10 0.0, knowrob:m11 1.0, knowrob:m12 0.0, knowrob:m13 {y},
        knowrob:m20 0.0, knowrob:m21 0.0, knowrob:m22 1.0, knowrob:m23 0.55,
        knowrob:m30 0.0, knowrob:m31 0.0, knowrob:m32 0.0, knowrob:m33 1.0
"""


def shared_room(folder: Path, route: tuple[tuple[float, float], ...], speed: float = 0.3) -> Path:
    """Write the map of the room with a robot on a route."""
    (x, y), *others = route
    points = " ".join(f"{a} {b}" for a, b in others)
    file = folder / "shared_ward.omn"
    file.write_text(MAP.format(x=x, y=y, points=points, speed=speed), encoding="utf-8")
    return file


@dataclass
class Encounters:
    """What happens between the robot and the other one in the true world, taken note of at each step."""

    contacts: int = 0
    """Steps in which they touch."""
    stopped: int = 0
    """Motions of the robot that the other one has stopped just before a contact."""
    driven: float = 0.0
    """Distance that the other one has gone [m]."""
    _last: tuple[float, float, float] | None = None
    _blocked: set[str] = field(default_factory=set)

    def __call__(self, world: PyBulletWorld) -> None:
        """Take note of the world after one more step."""
        self.contacts += any(PORTER in (one.part, one.body) for one in world.contacts())
        pose = world.pose(PORTER)
        if self._last is not None:
            self.driven += sum((a - b) ** 2 for a, b in zip(pose.position, self._last, strict=True)) ** 0.5
        self._last = pose.position
        blocked = set()
        for group in ("base", "right", "left", "head"):
            if world.motion(group).state is MotionState.BLOCKED and world.obstacle(group) == PORTER:
                blocked.add(group)
        self.stopped += len(blocked - self._blocked)
        self._blocked = blocked
