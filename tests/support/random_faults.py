"""Random faults: a share of the requests to process modules fails, with failures typical of their action class.

They are drawn from a seed, in the order of the requests, so that equal runs have equal faults. This includes requests
from recoveries, constructs and other process modules.
"""

from __future__ import annotations

import random
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from planlang.designators import Action
from planlang.failures import (
    ContainerStuck,
    GraspMissed,
    GraspSlipped,
    GripperGoalNotReached,
    HandleNotReachable,
    HandoverNotTaken,
    LookingGoalUnreachable,
    LowLevelFailure,
    ManipulationGoalInCollision,
    ManipulationGoalNotReached,
    ManipulationPoseUnreachable,
    NavigationGoalInCollision,
    NavigationGoalNotReached,
    NavigationPoseUnreachable,
    ObjectNotFound,
)
from planlang.kernel import sleep
from planlang.language.process_module import ProcessModule, WrappedModule

_NOT_DRIVEN = (NavigationGoalNotReached, NavigationPoseUnreachable, NavigationGoalInCollision)
_NOT_REACHED = (ManipulationGoalNotReached, ManipulationPoseUnreachable, ManipulationGoalInCollision)
_NOT_MOVED = (ContainerStuck, HandleNotReachable)

FAILURES: Mapping[str, tuple[type[LowLevelFailure], ...]] = {
    "Translation-LocationChange": _NOT_DRIVEN,
    "SteppingBack": (NavigationGoalNotReached,),
    "Reaching": _NOT_REACHED,
    "LoweringAnObject": _NOT_REACHED,
    "OpeningAGripper": (GripperGoalNotReached,),
    "ClosingAGripper": (GraspMissed, GraspSlipped, GripperGoalNotReached),
    "LookingAtSomething": (LookingGoalUnreachable,),
    "LookingForSomething": (ObjectNotFound,),
    "HandingOverAnObject": (HandoverNotTaken,),
    "OpeningAContainerArtifact": _NOT_MOVED,
    "ClosingAContainerArtifact": _NOT_MOVED,
    "TurningOnPoweredDevice": (HandleNotReachable,),
    "TurningOffPoweredDevice": (HandleNotReachable,),
    "WipingMotion": (ManipulationGoalNotReached,),
    "CirclingMotion": (ManipulationGoalNotReached,),
    "PushingMotion": (ManipulationGoalNotReached,),
    "ITaSCMotion": (ManipulationGoalNotReached,),
}
"""Possible failures of requests, by action class; they apply to subclasses too."""
SECONDS = 1.0
"""Duration of a failing request [s]."""


class RandomFaults:
    """Random choice of the requests that fail, and of their failures.

    ``rate`` is the share of requests that fail; ``ancestors`` returns an action class with its superclasses, nearest
    first. ``drawn`` counts the failures by class, ``requests`` all requests that could have failed.
    """

    def __init__(
        self,
        seed: int,
        rate: float,
        ancestors: Callable[[str], Sequence[str]],
        failures: Mapping[str, Sequence[type[LowLevelFailure]]] = FAILURES,
    ) -> None:
        self._random = random.Random(seed)
        self._rate, self._ancestors, self._failures = rate, ancestors, failures
        self.drawn: Counter[str] = Counter()
        self.requests = 0

    def of(self, action: Action) -> LowLevelFailure | None:
        """Draw the failure of a request that begins now; None if it does not fail."""
        kinds = next((self._failures[cls] for cls in self._ancestors(action.type) if cls in self._failures), ())
        if not kinds:
            return None
        self.requests += 1
        chance, kind = self._random.random(), self._random.choice(kinds)
        if chance >= self._rate:
            return None
        self.drawn[kind.__name__] += 1
        return kind(f"{kind.text}, by chance")


class FailingModule(WrappedModule):
    """Wrapper of a process module in which random requests fail before anything has moved."""

    def __init__(self, module: ProcessModule, faults: RandomFaults) -> None:
        super().__init__(module)
        self._faults, self.failures = faults, (*module.failures, LowLevelFailure)

    async def execute(self, action: Action) -> Any:
        """Perform the action, or raise a random failure."""
        failure = self._faults.of(action)
        if failure is None:
            return await super().execute(action)
        await sleep(SECONDS)
        raise failure
