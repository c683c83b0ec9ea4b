"""The robot as process modules command it: motions in the true world, planned in the planning scene."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from executive.locations import Resolver
from executive.modules.arms import Arms
from executive.modules.control import Control, Drive, Hands, Sensing


@dataclass
class Platform(Control):
    """What all process modules share, by subject: ``drive``, ``arms``, ``hands`` and ``sensing``."""

    resolver: Resolver
    ancestors: Callable[[str], Sequence[str]]
    """Action class -> itself and its superclasses, nearest first; local names."""
    releasing: frozenset[str]
    """Action classes that let go of something."""
    rng: np.random.Generator
    drive: Drive = field(init=False)
    arms: Arms = field(init=False)
    hands: Hands = field(init=False)
    sensing: Sensing = field(init=False)

    def __post_init__(self) -> None:
        self.drive, self.hands, self.sensing = Drive(self), Hands(self), Sensing(self)
        self.arms = Arms(self, self.resolver, self.rng)
