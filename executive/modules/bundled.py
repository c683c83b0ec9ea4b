"""The process modules that come with planlang. Rarely needed ones are imported only when an action needs them.

A table repeats the declarations of their classes, so that a lookup imports none of them. A test compares it with them,
and says how to write it.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import planlang.failures as failures
from executive.modules import gripper, navigation
from executive.modules.arm import reaching
from executive.modules.looking import perception
from executive.modules.platform import Platform
from planlang.designators import Action, Object
from planlang.diagnostics import Diagnostic
from planlang.registry import ModuleRegistry, OnDemand, Rank

AT_ONCE = (navigation, reaching, gripper, perception)
"""Modules that every run needs; they are imported at once and are not in the table."""
TABLE = Path(__file__).with_name("on_demand.json")


def _takes_several_hands(platform: Platform, action: Action) -> bool:
    """Check whether an action handles an object that takes more than one hand."""
    what = action.get("object_acted_on")
    name = platform.scene.bodies.known(what) if isinstance(what, Object) else None
    return name is not None and platform.scene.bodies.hands(name) > 1


def bundled_registry() -> ModuleRegistry:
    """Build a registry of the process modules that come with planlang."""
    registry = ModuleRegistry()
    for module in AT_ONCE:
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


def on_demand(performs: Mapping[str, Callable[[Any, Action], bool]]) -> Iterator[OnDemand]:
    """Yield the table's entries. ``performs``: module name -> predicate, for modules that perform only some actions."""
    for one in json.loads(TABLE.read_text(encoding="utf-8")):
        name, kinds = one["name"], tuple(getattr(failures, kind) for kind in one["failures"])
        yield OnDemand(one["place"], name, tuple(one["actions"]), kinds, performs.get(name))
