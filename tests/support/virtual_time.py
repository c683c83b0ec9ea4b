"""Running plans in virtual time."""

from __future__ import annotations

from typing import Any

from planlang import *


def go(plan: Any, executive: Any = None, **options: Any) -> Any:
    """Run a plan on a new host in virtual time."""
    return run(plan, host=VirtualHost(), executive=executive, **options)
