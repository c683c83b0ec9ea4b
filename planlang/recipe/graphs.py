"""networkx, imported when a graph is first used.

The import takes a fifth of a second, and few recipes need it: those with states, overlaps, data flow or a cycle,
and drawings.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any


def __getattr__(name: str) -> Any:
    return getattr(import_module("networkx"), name)  # late, as said above
