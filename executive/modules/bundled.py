"""The process modules that come with planlang. Those that few plans need are imported when one needs them."""

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
    """Return whether an action is about a thing that one hand does not hold."""
    what = action.get("object_acted_on")
    name = platform.scene.bodies.known(what) if isinstance(what, Object) else None
    return name is not None and platform.scene.bodies.hands(name) > 1


def bundled_registry() -> ModuleRegistry:
    """Return a registry with the process modules that come with planlang."""
    registry = ModuleRegistry()
    for module in (navigation, reaching, grasping, handing_over, perception):
        registry.add(module, "planlang", Rank.BUNDLED)
    for one in on_demand({"two_hands": _takes_several_hands}):
        registry.add_on_demand(one, "planlang", Rank.BUNDLED)
    return registry


def performed_by(files: Sequence[Path], found: list[Diagnostic]) -> frozenset[str]:
    """Return the action classes that process modules perform, those of the user's files, which are executed, too.

    Appends what is wrong with them; raises BadInput for a file that cannot be imported.
    """
    registry = bundled_registry()
    registry.add_installed()
    for file in files:
        registry.add_file(file)
    registry.resolve(found)
    return registry.actions
