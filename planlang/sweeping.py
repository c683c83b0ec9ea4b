"""Sweeps: one plan in many simulated worlds, from Python."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib import import_module
from os import PathLike
from typing import Any


def sweep(
    recipe: str | PathLike[str],
    worlds: int = 100,
    *,
    first: int = 1,
    robot: str | None = None,
    environment: str | Sequence[str] | None = None,
    set: Mapping[str, str] | None = None,
    out: str | PathLike[str] | None = None,
    processes: int | None = None,
    shard: str | None = None,
    **options: Any,
) -> list[dict[str, Any]]:
    """Run a recipe or plan in many worlds, as ``planlang sweep`` does; return a row for each, for ``pandas.DataFrame``.

    A row has ``world`` (the seed), ``outcome`` ("done", "failed", "lacks a capability", "crashed"), ``failure`` (class
    of the failure, then of its causes), ``message``, ``plan_seconds``, ``final_state``, ``largest_tilts`` [degrees] and
    ``repeat``, the command that repeats this world.

    ``first`` is the first seed; ``set`` binds parameters; with ``out`` the sweep is kept in a file, and goes on from it
    if it is there; ``processes`` worlds run at a time, by default one on each core. ``options`` are the others of the
    command, such as ``trust_map=True`` or ``seconds=60``.

    Raises BadInput with diagnostics for what cannot be used, ValueError for an option that cannot be read.
    """
    # a plan may run without a simulator: the executive is not imported before it is needed
    rows: list[dict[str, Any]] = import_module("executive.cli.sweep").sweep(
        str(recipe),
        worlds,
        first=first,
        robot=robot,
        environment=environment,
        set=set,
        out=out,
        processes=processes,
        shard=shard,
        **options,
    )
    return rows
