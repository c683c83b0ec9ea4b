"""The functions of ``planlang`` for Python: those of :mod:`executive.api`, with options as keyword arguments."""

from __future__ import annotations

import inspect
import os
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, TypeVar

from executive import api
from executive.commands.checked import CheckResult
from executive.options.declaring import declared, made
from executive.options.locating import LocateOptions
from executive.options.recipes import CheckOptions, CompileOptions
from executive.options.running import RunSettings, Source, SweepOptions
from planlang.diagnostics import BadInput, Severity
from planlang.machine import check_memory

if TYPE_CHECKING:
    from executive.runs.located import Located
    from executive.runs.options import RunResult
    from executive.sweeps.comparison import Comparison
    from planlang.compiler import CompiledPlan

F = TypeVar("F", bound=Callable[..., Any])
T = TypeVar("T")

Name = str | os.PathLike[str]
"""Name of a bundled robot or environment, or path of a file."""
Maps = Name | Sequence[Name]
"""One or more environments; further ones add things to the first."""
Bindings = Mapping[str, object] | Sequence[str]
"""Parameters of a plan -> things of the map, phrases or numbers; or strings ``NAME=THING``, ``@FILE``."""
Start = str | Sequence[float]
"""Pose of the base (x, y, yaw) [m, m, rad], or a string "x,y,yaw"."""


def with_options_of(kind: type) -> Callable[[F], F]:
    """Make a decorator that adds declared options to the signature and docstring of a function.

    The function takes them as ``**options``. Notebooks complete names by the signature; the docstring gets the options
    that it does not describe itself.
    """

    def decorate(function: F) -> F:
        signature = inspect.signature(function)
        own = {name: one for name, one in signature.parameters.items() if one.kind is not one.VAR_KEYWORD}
        text = inspect.cleandoc(function.__doc__ or "")
        added, lines = [], [text, "", "Further options:", ""]
        for name, one in declared(kind).items():
            if one.declared.is_positional or (name in own and f"``{name}``" in text):
                continue
            if name not in own:
                keyword = inspect.Parameter.KEYWORD_ONLY
                default, annotation = one.field.default, one.annotation
                added.append(inspect.Parameter(name, keyword, default=default, annotation=annotation))
            lines.append(f"* ``{name}``: {one.declared.help}")
        function.__signature__ = signature.replace(parameters=[*own.values(), *added])  # type: ignore[attr-defined]
        function.__doc__ = "\n".join(lines)
        return function

    return decorate


def options_of(kind: type[T], own: Mapping[str, Any], options: Mapping[str, Any]) -> T:
    """Make options from the ``own`` parameters of a function and its further ``options``.

    An option may go by any of its words. Raises BadInput for invalid values, TypeError for an unknown option.
    """
    known = declared(kind)
    words = ((word, name) for name, one in known.items() for both in one.declared.words for word in both.split("/"))
    names = {word.strip("-").replace("-", "_"): name for word, name in words}
    return made(kind, {names.get(name, name): value for name, value in options.items()}, own)


@with_options_of(RunSettings)
def simulate(
    recipe: Source | None = None,
    *,
    robot: Name | None = None,
    environment: Maps | None = None,
    seed: int | None = None,
    set: Bindings | None = None,
    start: Start | None = None,
    **options: Any,
) -> RunResult:
    """Run a recipe or a plan in a simulated world, as ``planlang run`` does.

    ``recipe`` is the name of a bundled recipe, a path, the text of a recipe or plan, or what :func:`compile` returned.
    ``robot`` and ``environment`` are names of bundled ones or paths; a bundled recipe has defaults. ``seed`` displaces
    things in the world, 0 displaces nothing; ``set`` binds parameters, such as ``{"bottle": "bottle2"}``; ``start`` is
    the start pose of the base (x, y, yaw) [m, m, rad].

    A failed plan is a result, too. It has ``outcome``, ``failure``, ``final_state``, ``trace``, ``report(path)`` and
    ``picture(path)``. Raises BadInput for invalid input, KeyboardInterrupt if the run is interrupted.
    """
    check_memory()
    own = {"recipe": recipe, "robot": robot, "environment": environment, "seed": seed, "set": set, "start": start}
    result = api.run(options_of(RunSettings, own, options))
    if result.is_interrupted:  # so that a loop over many runs ends, too
        raise KeyboardInterrupt
    return result


@with_options_of(LocateOptions)
def locate(
    phrase: str,
    *,
    robot: Name,
    environment: Maps,
    of: str | None = None,
    count: int = 3,
    start: Start | None = None,
    **options: Any,
) -> Located:
    """Find poses that match a phrase, for the robot's base or for a thing, as ``planlang locate`` does.

    ``phrase`` is plain English: "in reach of the bottle and near the bed"; ``of`` names the thing for which poses are
    searched. The result is the sequence of its poses, at most ``count``, best first, with ``counts`` of the reasons for
    rejection and ``picture(path)``. Raises BadInput for invalid input.
    """
    check_memory()
    own = {"phrase": phrase, "robot": robot, "environment": environment, "of": of, "count": count, "start": start}
    return api.locate(options_of(LocateOptions, own, options))


@with_options_of(SweepOptions)
def sweep(
    recipe: Source,
    worlds: int = 100,
    *,
    first: int = 1,
    robot: Name | None = None,
    environment: Maps | None = None,
    set: Bindings | None = None,
    start: Start | None = None,
    **options: Any,
) -> list[dict[str, Any]]:
    """Run a recipe or plan in many worlds, as ``planlang sweep`` does; return a row for each, for ``pandas.DataFrame``.

    The worlds are those of :func:`simulate` with the seeds from ``first`` on, run on all cores. A row has ``world``
    (the seed), ``outcome`` ("done", "failed", "lacks a capability", "crashed"), ``failure`` (class of the failure, then
    of its causes), ``message``, ``duration`` [s of plan time], ``final_state``, ``largest_tilts`` [degrees] and
    ``repeat``, the command that repeats this world. Raises BadInput for invalid input.
    """
    own = {"recipe": recipe, "worlds": worlds, "first": first, "robot": robot, "environment": environment}
    return api.sweep(options_of(SweepOptions, {**own, "set": set, "start": start}, options))


@with_options_of(SweepOptions)
def compare(
    recipe: Source,
    worlds: int = 100,
    *,
    vary: Mapping[str, Sequence[object]] | None = None,
    variant: Mapping[str, Mapping[str, object]] | None = None,
    first: int = 1,
    robot: Name | None = None,
    environment: Maps | None = None,
    set: Bindings | None = None,
    start: Start | None = None,
    **options: Any,
) -> Comparison:
    """Run variants of a recipe or plan in the same worlds, as ``planlang compare`` does, and compare them.

    ``vary`` maps options and parameters to their values, such as ``{"robot": ["amigo", "pr2"]}``; the variants are all
    combinations. ``variant`` maps names to options, such as ``{"mine": {"robot": "my.toml"}, "theirs": {}}``. The
    other options are those of :func:`sweep`, for all variants.

    The result has ``variants`` with their shares, ``pairs`` with what tells them apart, and ``rows``, for
    ``pandas.DataFrame``; ``print`` shows it as text, a notebook as tables. Raises BadInput for invalid input.
    """
    own = {"recipe": recipe, "worlds": worlds, "first": first, "robot": robot, "environment": environment}
    varying = {"vary": vary, "variant": variant, "set": set, "start": start}
    return api.compare(options_of(SweepOptions, {**own, **varying}, options))


@with_options_of(CompileOptions)
def compile(recipe: Source, *, task: str | None = None, **options: Any) -> CompiledPlan:
    """Compile a recipe to a plan in Python, as ``planlang compile`` does.

    ``recipe`` is the name of a bundled recipe, a path, or the text of a recipe; ``task`` selects one of several. The
    plan has ``source``, ``graph``, ``diagnostics`` (warnings and notes) and ``save(path)``. Raises BadInput with all
    errors of the recipe.
    """
    return api.compile(options_of(CompileOptions, {"recipe": recipe, "task": task}, options))


@with_options_of(CheckOptions)
def check(file: Source, **options: Any) -> CheckResult:
    """Check a recipe, a plan, a map or a folder of recipes, as ``planlang check`` does; nothing is run.

    ``file`` is the name of a bundled recipe or map, a path, or a text. The result has all ``diagnostics``; ``ok`` is
    True without errors. Raises BadInput only if the file cannot be read, or an option is invalid.
    """
    checked = options_of(CheckOptions, {"file": file}, options)
    try:
        return api.check(checked)
    except BadInput as problem:  # what is wrong in the file is the result
        if all(one.span is None for one in problem.diagnostics if one.severity is Severity.ERROR):
            raise
        return CheckResult(False, "recipe", "", problem.diagnostics)
