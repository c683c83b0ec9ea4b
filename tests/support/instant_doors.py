"""A process module that opens and closes a door or drawer at once, as a user's own may."""

from __future__ import annotations

from planlang.designators import Action
from planlang.failures import HandleNotReachable
from planlang.kernel import checkpoint
from tests.support.leaves import Room


class Doors:
    """Opens and closes one leaf at once: searches ask whoever does it."""

    name = "doors"
    failures = (HandleNotReachable,)

    def __init__(
        self, stage: Room, leaf: str, opened: float, actions: tuple[str, ...], *, sticks: bool = False, misses: int = 0
    ) -> None:
        """``opened``: how far [rad, m]; ``sticks``: it never moves; ``misses``: how often it fails to close."""
        self.stage, self.leaf, self.opened, self.actions = stage, leaf, opened, actions
        self.sticks, self.misses, self.asked = sticks, misses, list[str]()

    def resources(self, asked: Action) -> tuple[str, ...]:
        """It needs none."""
        return ()

    async def execute(self, asked: Action) -> None:
        """Move the leaf, in the world and in the belief. Raises HandleNotReachable if it does not move."""
        await checkpoint()
        self.asked.append(asked.type)
        opens = asked.type.startswith("Opening")
        if self.sticks:
            raise HandleNotReachable(what=self.leaf)
        if not opens and self.misses > 0:
            self.misses -= 1
            raise HandleNotReachable(what=self.leaf)
        value = self.opened if opens else 0.0
        self.stage.truth.set_joint(self.leaf, value)
        self.stage.platform.belief.moved(self.leaf, value)
        self.stage.platform.observe()
