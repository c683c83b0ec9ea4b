"""Plans loaded as a run loads them, and a kitchen of small ones."""

from __future__ import annotations

from pathlib import Path
from types import ModuleType

from planlang.language.loading import load_plan
from planlang.language.plan_text import Needs
from planlang.language.source import PlanSource

KITCHEN = """
from functools import partial
import planlang
from planlang import action, action as act, at_location, par, perform, plan, try_in_order

KITCHEN = "http://example.org/kitchen.owl#"
CLOSING = action("ClosingAGripper")

@plan
async def grasp(hard: bool = False) -> None:
    await perform(CLOSING)

@plan
async def reach() -> None:
    await perform(action("Reaching"))

@plan
async def look() -> None:
    await perform(planlang.action("LookingForSomething"))
"""

PLAIN = """from planlang import plan, perform, action
@plan
async def go() -> None:
    await perform(action("Reaching"))
"""


def read(*lines: str, file: str = "kitchen.py") -> PlanSource:
    """Return the source of a plan in memory."""
    return PlanSource("\n".join(lines) + "\n", file)


def loaded(path: Path) -> ModuleType:
    """Load a plan's file. Raises BadInput."""
    return load_plan(PlanSource.read(path))


def needs(*body: str, before: str = "") -> Needs:
    """Return what a plan of the kitchen with these lines needs."""
    lines = "".join(f"    {line}\n" for line in body)
    source = PlanSource(f"{KITCHEN}{before}\n@plan\nasync def serve() -> None:\n{lines}", "kitchen.py")
    module = load_plan(source)
    return source.needs(module, module.serve)
