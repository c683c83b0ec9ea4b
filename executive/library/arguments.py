"""Arguments of a command from Python values, by the declarations of the command line."""

from __future__ import annotations

import inspect
import os
from collections.abc import Callable, Iterable, Mapping
from dataclasses import fields
from enum import Enum
from pathlib import Path
from types import NoneType
from typing import Annotated, Any, TypeVar, get_args, get_origin, get_type_hints

import typer

from executive.commands.base_arguments import Arguments
from planlang.diagnostics import BadInput, error
from planlang.spelling import similar

A = TypeVar("A", bound=Arguments)
F = TypeVar("F", bound=Callable[..., Any])

_OF_THE_TERMINAL = ("json", "verbose", "quiet")
"""Options for what a command prints."""


def arguments_of(kind: type[A], own: Mapping[str, Any], options: Mapping[str, Any]) -> A:
    """Make the arguments of a command from the ``own`` parameters of a function and its further ``options``.

    None is the default, a path may be a string, a repeatable option may be a single value. Raises BadInput (C040) for
    invalid values, TypeError for an unknown option.
    """
    declared, values, problems = options_of(kind), dict[str, Any](), []
    known = [name for name, (_, hint) in declared.items() if name not in own and not _is_positional(hint)]
    options = {_present_name(name, declared): value for name, value in options.items()}
    for name in options:
        if name not in known:
            alike = similar(name, [*known, *own])
            guess = f"; did you mean {alike[0]}?" if alike else f"; options: {', '.join(known)}"
            raise TypeError(f"there is no option {name!r}{guess}")
    for name, value in {**own, **options}.items():
        if value is None:
            continue
        field, hint = declared[name]
        try:
            values[field] = _converted(hint, value)
        except ValueError as problem:
            problems.append(error("C040", f"{name}={value!r}: {problem}"))
    if problems:
        raise BadInput(problems)
    return kind(**values, json=True)  # nothing is printed


def with_options_of(kind: type[Arguments]) -> Callable[[F], F]:
    """Make a decorator that adds the options of a command to the signature and docstring of a function.

    The function takes them as ``**options``. Notebooks complete names by the signature; the docstring gets the options
    that it does not describe itself.
    """

    def decorate(function: F) -> F:
        signature = inspect.signature(function)
        own = {name: one for name, one in signature.parameters.items() if one.kind is not one.VAR_KEYWORD}
        defaults = {one.name: one.default for one in fields(kind)}
        text = inspect.cleandoc(function.__doc__ or "")
        added, lines = [], [text, "", "Further options:", ""]
        for name, (field, hint) in options_of(kind).items():
            type_, option = get_args(hint)[:2] if get_origin(hint) is Annotated else (hint, None)
            if _is_positional(hint) or (name in own and f"``{name}``" in text):
                continue
            if name not in own:
                added.append(
                    inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=defaults[field], annotation=type_)
                )
            lines.append(f"* ``{name}``: {getattr(option, 'help', None) or ''}".rstrip(": "))
        function.__signature__ = signature.replace(parameters=[*own.values(), *added])  # type: ignore[attr-defined]
        function.__doc__ = "\n".join(lines)
        return function

    return decorate


def options_of(kind: type[Arguments]) -> Mapping[str, tuple[str, Any]]:
    """Options of a command: name in Python -> name of the field, its annotated type."""
    hints = get_type_hints(kind, include_extras=True)
    names = (one.name for one in fields(kind) if one.name not in _OF_THE_TERMINAL)
    return {name.removesuffix("_"): (name, hints[name]) for name in names}


def _present_name(name: str, declared: Mapping[str, tuple[str, Any]]) -> str:
    """Name of an option that the command line also knows by another name."""
    word = f"--{name.replace('_', '-')}"
    for present, (_, hint) in declared.items():
        if any(word in (getattr(one, "param_decls", None) or ()) for one in getattr(hint, "__metadata__", ())):
            return present
    return name


def _is_positional(hint: Any) -> bool:
    return any(isinstance(one, typer.models.ArgumentInfo) for one in getattr(hint, "__metadata__", ()))


def _converted(hint: Any, value: Any) -> Any:
    """Convert a value to the type of a field. Raises ValueError that names valid values."""
    option = None
    if get_origin(hint) is Annotated:
        hint, option, *_ = get_args(hint)
    members = [one for one in get_args(hint) if one is not NoneType]
    hint = members[0] if NoneType in get_args(hint) else hint
    if get_origin(hint) is list:
        (item,) = get_args(hint)
        is_one = isinstance(value, (str, os.PathLike)) or not isinstance(value, Iterable)
        return [_single(item, one, option) for one in ([value] if is_one else value)]
    return _single(hint, value, option)


def _single(kind: Any, value: Any, option: Any) -> Any:
    if kind is Path and isinstance(value, (str, os.PathLike)) and value != "":
        return Path(value)
    if kind is str and isinstance(value, (str, os.PathLike)):
        return os.fspath(value)
    if isinstance(kind, type) and issubclass(kind, Enum):
        return kind(getattr(value, "value", value))
    if kind in (int, float) and isinstance(value, (int, kind)) and not isinstance(value, bool):
        least, most = getattr(option, "min", None), getattr(option, "max", None)
        if (least is not None and value < least) or (most is not None and value > most):
            raise ValueError(f"write a number from {least}" + (f" to {most}" if most is not None else " on"))
        return kind(value)
    if kind is bool and isinstance(value, bool):
        return value
    words = {Path: "a path", str: "a string", int: "an integer", float: "a number", bool: "True or False"}
    raise ValueError(f"write {words.get(kind, kind)}")
