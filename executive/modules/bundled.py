"""The process modules that come with planlang. Rarely needed ones are imported on first use."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from executive.modules.arm import reaching
from executive.modules.base import navigation
from executive.modules.gripper import grasping, handing_over
from executive.modules.looking import perception
from executive.modules.on_demand import on_demand
from executive.modules.platform import Platform
from planlang.designators import Action, Object
from planlang.diagnostics import Diagnostic
from planlang.registry import ModuleRegistry, Rank


def _takes_several_hands(platform: Platform, action: Action) -> bool:
    """Check whether an action handles an object that takes more than one hand."""
    what = action.get("object_acted_on")
    name = platform.scene.bodies.known(what) if isinstance(what, Object) else None
    return name is not None and platform.scene.bodies.hands(name) > 1


def bundled_registry() -> ModuleRegistry:
    """Build a registry of the process modules that come with planlang."""
    registry = ModuleRegistry()
    for module in (navigation, reaching, grasping, handing_over, perception):
        registry.add(module, "planlang", Rank.BUNDLED)
    for one in on_demand({"two_hands": _takes_several_hands}):
        registry.add_on_demand(one, "planlang", Rank.BUNDLED)
    return registry


def performed_by(files: Sequence[Path], found: list[Diagnostic]) -> frozenset[str]:
    """Collect the action classes that bundled, installed and the user's process modules perform.

    Executes the user's ``files``. Appends problems to ``found``; raises BadInput if a file cannot be imported.
    """
    registry = bundled_registry()
    registry.add_installed()
    for file in files:
        registry.add_file(file)
    registry.resolve(found)
    return registry.actions
