"""A scripted camera that sees a bottle from some places."""

from __future__ import annotations

from typing import Any

from planlang import Action, an_object
from planlang.failures import ObjectNotFound, PerceptionFailure

BOTTLE = an_object("DrinkingBottle", "http://example.org/map#bottle1")


class Eyes:
    """Sees the bottle from the places it is told."""

    def __init__(self, executive: Any, seen_from: set[float]) -> None:
        self.executive = executive
        self.seen_from = seen_from

    async def look(self, wanted: Action) -> None:
        assert wanted.get("object_acted_on") == BOTTLE
        self.executive.log.append(f"looks at {self.executive.base[0]:g}")
        if self.executive.base[0] not in self.seen_from:
            raise ObjectNotFound(what="bottle1")


def eyes(executive: Any, module: Any, *seen_from: float) -> None:
    looker = Eyes(executive, set(seen_from))
    executive.extra.append(module("perception", ("LookingForSomething",), looker.look, (PerceptionFailure,), ("head",)))
