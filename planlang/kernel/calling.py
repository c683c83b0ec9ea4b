"""Calling what a plan has given to be called and awaited; what cannot be is refused with the right code."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NoReturn

from planlang.kernel.tree import name_of
from planlang.misuse import PlanStructureError, WrongType, contrast


def called(function: Callable[..., Any], *arguments: Any, **named: Any) -> Any:
    """What an async function gives, to be awaited at once; WrongType if it is not async or takes other arguments."""
    result = given(function, *arguments, **named)
    if not hasattr(result, "__await__"):
        refuse_result(name_of(function), result)
    return result


def given(function: Callable[..., Any], *arguments: Any, **named: Any) -> Any:
    """What a function gives; WrongType if it takes other arguments."""
    try:
        return function(*arguments, **named)
    except TypeError as error:
        refuse_arguments(function, error)
        raise


def refuse_arguments(function: Callable[..., Any], error: TypeError) -> None:
    """Raise the error of a function that cannot be called like this; nothing if the error arose inside of it."""
    traceback = error.__traceback__
    if traceback is not None and traceback.tb_next is None and not isinstance(error, PlanStructureError):
        name = name_of(function)
        raise WrongType(
            contrast(f"{name} cannot be called as it was given: {error}", name, f"partial({name}, ...)")
        ) from None


def refuse_result(name: str, result: object) -> NoReturn:
    """Raise the error of a function whose result cannot be awaited."""
    element = name.rpartition("/")[2]
    shown = element if element.isidentifier() else "reach"
    raise WrongType(
        contrast(
            f"branch {name} returned {type(result).__name__}, which cannot be awaited; a branch is a function written "
            "with async def",
            f"def {shown}(): ...",
            f"async def {shown}(): ...",
        )
    )
