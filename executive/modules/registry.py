"""The process modules that come with planlang, registered as a user's are."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from executive.modules import grasping, handover, head, navigation, perception, reaching
from planlang.language.executive import ProcessModule
from planlang.modules import ModuleRegistry, Rank

BUNDLED = (navigation, reaching, grasping, head, perception, handover)


def bundled_registry() -> ModuleRegistry:
    """Return a registry with the process modules that come with planlang."""
    registry = ModuleRegistry()
    for module in BUNDLED:
        registry.add(module, "planlang", Rank.BUNDLED)
    return registry


def bundled_modules() -> tuple[Callable[[Any], ProcessModule], ...]:
    """Return the classes of the process modules that come with planlang."""
    return bundled_registry().resolve([])
