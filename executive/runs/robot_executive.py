"""The executive that plans see: grounds locations, looks facts up in the belief, offers the process modules."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any

from executive.modules.arm import Reaching
from executive.modules.gripper import GripperModule
from executive.modules.handover import Handover
from executive.modules.head import Head
from executive.modules.navigation import Navigation
from executive.modules.perception import Perception
from executive.modules.platform import CARRYING, Platform
from executive.runs import memory
from planlang.designators import Action, Condition, Device, Location, Object, a_posture, action
from planlang.language.executive import ProcessModule
from planlang.protocols import Solution


class RobotExecutive:
    """Implements :class:`planlang.language.executive.Executive` for one platform."""

    def __init__(self, platform: Platform) -> None:
        self.platform = platform
        self.world_as_left = False
        """Whether the user says that the world is as a snapshot left it: it is not brought back then."""
        self.modules: Sequence[ProcessModule] = (
            Navigation(platform),
            Reaching(platform),
            GripperModule(platform),
            Head(platform),
            Perception(platform),
            Handover(platform),
        )

    def ancestors(self, action_type: str) -> Sequence[str]:
        """The class itself and its superclasses, nearest first."""
        return self.platform.ancestors(action_type)

    def revision(self) -> int:
        """Counts changes of the belief."""
        return self.platform.belief.revision

    def solutions(self, location: Location) -> Iterator[Solution]:
        """Places for the base, lazily, best first; begun anew when the belief has changed in between."""
        while True:
            self.platform.sync()
            revision = self.revision()
            for solution in self.platform.resolver.bases(location):
                yield solution
                if self.revision() != revision:
                    break

    def move_to(self, solution: Solution) -> Action:
        """The base motion that goes to a solution; the arm with which it was found is the plan's choice from now on."""
        if (arm := solution.detail.get("arm")) is not None:
            self.platform.choices.choose(arm)
        x, y, yaw = map(float, solution.base)
        return action("Translation-LocationChange", x=x, y=y, yaw=yaw)

    def is_at(self, solution: Solution) -> bool:
        """True while the base is where the solution put it."""
        x, y, yaw = self.platform.base()
        turn = math.remainder(yaw - solution.base[2], 2 * math.pi)
        return math.dist((x, y), solution.base[:2]) < 0.01 and abs(turn) < 0.02

    def holds(self, condition: Condition) -> bool:
        """Whether the belief says so; raises ValueError for a predicate that nothing here decides."""
        match condition:
            case Condition("holding", (Object() as what,)):
                return self.platform.scene.bodies.bind(what) in self.platform.belief.held
            case Condition("located", (Location() as where,)):
                self.platform.sync()
                return self.platform.resolver.holds(where)
            case Condition("located", (Location() as where, Object() as what)):
                self.platform.sync()
                return self.platform.resolver.holds(where, what)
        raise ValueError(
            f"nothing decides {condition}; what can be asked: holding(object), located(location, object or device)"
        )

    def before_retry(self) -> Iterable[Action]:
        """Arms go to the carrying posture with what they hold; first the base backs off if there is no room for it."""
        platform = self.platform
        platform.sync()
        untucked = [arm for arm in platform.scene.arms.all if not platform.is_at(arm, platform.posture(arm, CARRYING))]
        if not untucked:
            return
        room = platform.room_to_tuck(untucked)
        if room is not None and room != platform.base():
            x, y, yaw = map(float, room)
            yield action("Translation-LocationChange", x=x, y=y, yaw=yaw)
        for arm in untucked if room is not None else ():
            yield action("Reaching", to_location=a_posture(CARRYING), device_used=self._device(arm.name))

    def _device(self, name: str) -> Device:
        arm = self.platform.robot.arm(name)
        return Device(f"{(arm.side or '').capitalize()}Arm", arm.iri)

    def held(self) -> Sequence[str]:
        """Names of the objects that the robot holds."""
        return tuple(self.platform.belief.held)

    def releases(self, action: Action) -> bool:
        """Whether the action lets go of something, by the vocabulary's primitives."""
        return any(cls in self.platform.releasing for cls in self.ancestors(action.type))

    def snapshot(self) -> dict[str, Any]:
        """World and belief as JSON, for the trace."""
        return memory.snapshot(self.platform)

    def restore(self, left: Mapping[str, Any]) -> None:
        """Bring belief and world, if it can be brought back, to a snapshot; raises ValueError if it does not fit."""
        memory.restore(self.platform, left, world=not self.world_as_left)

    def record(self, write: Callable[[str, Mapping[str, Any]], None]) -> None:
        """Belief changes are written into the trace."""
        self.platform.belief.tell = write
