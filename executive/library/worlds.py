"""``planlang.simulate``, ``planlang.locate`` and ``planlang.sweep``, which put a robot into a simulated world."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from executive.commands import locate as locate_command
from executive.commands import run as run_command
from executive.commands.arguments import LocateArguments, RunArguments, SweepArguments
from executive.commands.resources import check_memory
from executive.commands.sweep import swept
from executive.library.arguments import arguments_of, with_options_of
from executive.library.sources import Source, file_of
from executive.runs import locating
from executive.runs.located import Located
from executive.runs.options import Outcome, RunResult
from executive.runs.plan_run import run_plan_file

Name = str | os.PathLike[str]
"""Name of a bundled robot or environment, or path of a file."""
Maps = Name | Sequence[Name]
"""One or more environments; further ones add things to the first."""
Bindings = Mapping[str, object] | Sequence[str]
"""Parameters of a plan -> things of the map, phrases or numbers; or strings ``NAME=THING``, ``@FILE``."""
Start = str | Sequence[float]
"""Pose of the base (x, y, yaw) [m, m, rad], or a string "x,y,yaw"."""


@with_options_of(RunArguments)
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
    own = _situation(robot, environment, set, start) | {"seed": seed}
    with file_of(recipe) as file:
        result = run_plan_file(run_command.options_of(arguments_of(RunArguments, own | {"file": file.path}, options)))
    if result.outcome is Outcome.INTERRUPTED:  # so that a loop over many runs ends, too
        raise KeyboardInterrupt
    return replace(result, diagnostics=file.located(result.diagnostics))


@with_options_of(LocateArguments)
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
    own = _situation(robot, environment, None, start) | {"phrase": phrase, "of": of, "count": count}
    del own["set"]
    arguments = arguments_of(LocateArguments, own, options)
    located = locating.locate(replace(locate_command.options_of(arguments), drawn=True))
    if arguments.explain is not None and located.sheet is not None:
        located.picture(arguments.explain, force=True)
    return located


@with_options_of(SweepArguments)
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
    own = _situation(robot, environment, set, start) | {"worlds": worlds, "first": first}
    with file_of(recipe) as file:
        return swept(arguments_of(SweepArguments, own | {"recipe": file.path}, options))


def _situation(
    robot: Name | None, environment: Maps | None, set: Bindings | None, start: Start | None
) -> dict[str, Any]:
    """Options of a situation, as the command line has them."""
    texts = [f"{name}={value}" for name, value in set.items()] if isinstance(set, Mapping) else set
    pose = start if start is None or isinstance(start, str) else ",".join(map(str, start))
    return {"robot": robot, "environment": environment, "set": texts, "start": pose}
