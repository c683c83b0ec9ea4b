"""Table of the bundled process modules that are imported only when an action needs them; most runs need few.

It repeats the declarations of their classes, so that a lookup imports none of them. Regenerate it with
``python -m executive.modules.on_demand``.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from importlib import import_module
from pathlib import Path
from typing import Any

import planlang.failures as failures
from planlang.designators import Action
from planlang.registry import OnDemand, marked

AT_ONCE = ("base.navigation", "arm.reaching", "gripper.grasping", "gripper.handing_over", "looking.perception")
"""Modules that every run needs; they are imported at once and are not in the table."""
TABLE = Path(__file__).with_name("on_demand.json")


def on_demand(performs: Mapping[str, Callable[[Any, Action], bool]]) -> Iterator[OnDemand]:
    """Yield the table's entries. ``performs``: module name -> predicate, for modules that perform only some actions."""
    for one in json.loads(TABLE.read_text(encoding="utf-8")):
        name, kinds = one["name"], tuple(getattr(failures, kind) for kind in one["failures"])
        yield OnDemand(one["place"], name, tuple(one["actions"]), kinds, performs.get(name))


def table() -> str:
    """Build the table's JSON from the current classes."""
    folder = Path(__file__).parent
    files = (file.relative_to(folder).with_suffix("") for file in folder.rglob("*.py") if file.stem != "__init__")
    names = sorted(name for file in files if (name := ".".join(file.parts)) not in AT_ONCE)
    rows = [
        {
            "place": f"{module.__name__}:{cls.__name__}",
            "name": cls.name,
            "actions": list(cls.actions),
            "failures": [kind.__name__ for kind in cls.failures],
        }
        for module in (import_module(f"executive.modules.{name}") for name in names)
        for cls in marked(module)
    ]
    return json.dumps(rows, indent=2) + "\n"


if __name__ == "__main__":
    TABLE.write_text(table(), encoding="utf-8")
