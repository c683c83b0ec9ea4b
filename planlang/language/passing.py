"""Handing on what a step has made or found to the steps that use it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, TypeVar

from planlang.designators import Location, Object

T = TypeVar("T")


def given(result: Any, otherwise: T) -> T:
    """The result of an earlier step if it is the kind of thing that is needed, else what is known without it.

    A module may return an Object that says more about what it has found than the plan knew, also where the plan knew
    a name only, and any Location where it knew one, or only a name for one. A step that makes several things may return
    a mapping from their names (``{"EggYolk": yolk, "EggShell": shell}``). What returns something else, such as a pose,
    or nothing, hands on no designator, and ``otherwise`` is used.
    """
    if isinstance(result, Mapping):
        result = result.get(otherwise if isinstance(otherwise, str) else getattr(otherwise, "name", None))
    is_named = isinstance(otherwise, str) and isinstance(result, (Object, Location))
    is_place = isinstance(otherwise, Location) and isinstance(result, Location)
    return result if is_named or is_place or isinstance(result, type(otherwise)) else otherwise
