"""Whether a compiled plan is up to date: what its recipe has changed since, and what a person has edited."""

from __future__ import annotations

import difflib
from collections.abc import Sequence
from pathlib import Path

from executive.cli.inputs import PlanFile
from planlang.compiler import compile_recipe
from planlang.diagnostics import BadInput, Diagnostic, Span, error, note, warning
from planlang.outputs import NO_DATA_FLOW, NO_SCOPES, PlanHeader, header
from planlang.plan_versions import compiled_before
from planlang.records import dataclass


@dataclass(frozen=True, slots=True)
class Freshness:
    """The state of a plan in words, diagnostics, and unified diffs.

    ``edits`` are from the plan as it was compiled to the plan, ``difference`` is from the plan as it was compiled to
    what the recipe compiles to now; each is empty if there is none. If it is not known how the plan was compiled,
    ``difference`` is from the plan itself, and ``edits`` is empty.
    """

    state: str
    diagnostics: tuple[Diagnostic, ...] = ()
    difference: str = ""
    edits: str = ""


def freshness(plan: PlanFile, *, folders: Sequence[Path] = ()) -> Freshness:
    """Compare a plan with what its recipe compiles to now, with the options that the plan was compiled with.

    The recipe is the first of its name beside the plan, in ``folders``, among the bundled ones. A changed recipe is an
    error; a changed compiler or import a warning; an edited plan a note.
    """
    origin = plan.header
    if origin is None:
        return Freshness("a plan written by hand")
    span = Span(str(plan.path))
    recipe = origin.find_recipe(plan.path, folders)
    if recipe is None:
        advice = "name its folder with --ontologies DIR"
        message = f"the recipe {origin.recipe} is not beside the plan: it is unknown whether it has changed"
        return Freshness("a compiled plan without its recipe", (warning("C011", message, span, advice),))
    same = origin.matches(recipe.read_bytes())
    found: list[Diagnostic] = []
    if not same:
        how = "--merge keeps the edits" if origin.is_edited(plan.source) else "compiles the plan again"
        advice = f"planlang compile {recipe} -o {plan.path} {how}"
        message = f"the recipe has changed since this plan was compiled from it: {recipe}"
        found.append(error("C009", message, span, advice))
    fresh, problems = _compiled(recipe, origin, folders)
    if fresh is None:
        state = "out of date" if not same else "compiled from a recipe that no longer compiles"
        return Freshness(state, tuple(found) if not same else problems)
    if fresh == plan.source:
        return Freshness(f"what {recipe.name} compiles to")
    is_edited = origin.is_edited(plan.source)
    if same and not is_edited:
        message = f"{origin.recipe} compiles to a different plan now: planlang has changed ({_versions(origin, fresh)})"
        found.append(warning("C006", f"{message}, or what the recipe imports", span, "compile the plan again"))
    if is_edited and origin.digest is not None:
        found.append(note("C010", "the plan was edited since it was compiled", span))
    elif same and is_edited:
        message = f"the plan differs from what {origin.recipe} compiles to: it was edited, or planlang has changed"
        found.append(note("C010", message, span))
    state = "out of date" if not same or not is_edited else "an edited plan"
    now, before = f"what {recipe.name} compiles to now", compiled_before(plan.path, plan.source, fresh)
    if before is None or not is_edited:
        return Freshness(state, tuple(found), _difference(plan.source, fresh, str(plan.path), now))
    name = f"{plan.path} as it was compiled"
    edits = _difference(before, plan.source, name, f"{plan.path} as it was edited")
    return Freshness(state, tuple(found), _difference(before, fresh, name, now), edits)


def _compiled(recipe: Path, origin: PlanHeader, folders: Sequence[Path]) -> tuple[str | None, tuple[Diagnostic, ...]]:
    try:
        compiled = compile_recipe(
            recipe,
            task=origin.task,
            folders=folders,
            scopes=NO_SCOPES not in origin.options,
            data_flow=NO_DATA_FLOW not in origin.options,
        )
    except BadInput as problem:
        return None, problem.diagnostics
    return compiled.source, ()


def _versions(origin: PlanHeader, fresh: str) -> str:
    now = header(fresh)
    new = now.version if now is not None else "unknown"
    return f"version {new}" if new == origin.version else f"from {origin.version} to {new}"


def _difference(old: str, new: str, old_name: str, new_name: str) -> str:
    return "\n".join(difflib.unified_diff(old.splitlines(), new.splitlines(), old_name, new_name, lineterm=""))
