"""Whether a plan still is what its recipe compiles to; nothing of the plan is executed."""

from __future__ import annotations

import difflib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from executive.cli.inputs import PlanFile, recipe_of
from planlang.diagnostics import BadInput, Diagnostic, Span, error, note, warning
from planlang.plan_header import NO_DATA_FLOW, NO_SCOPES, PlanHeader, header


@dataclass(frozen=True, slots=True)
class Freshness:
    """The state of a plan in words, what there is to say about it, and how a fresh compile differs from it.

    ``difference`` is a unified diff, from the plan to what the recipe compiles to now; empty if they are the same or
    that is not known.
    """

    state: str
    diagnostics: tuple[Diagnostic, ...] = ()
    difference: str = ""


def freshness(plan: PlanFile, *, folders: Sequence[Path] = ()) -> Freshness:
    """Compare a plan with what its recipe compiles to now, with the options that the plan was compiled with.

    The recipe is the first of its name beside the plan, in ``folders``, among the bundled ones. That it has changed
    is an error; that the compiler has, or what the recipe imports, is a warning; that the plan was edited, a note.
    """
    origin = plan.header
    if origin is None:
        return Freshness("a plan written by hand")
    span = Span(str(plan.path))
    recipe = recipe_of(plan.path, origin, folders)
    if recipe is None:
        advice = "--ontologies DIR names a folder in which it is"
        message = f"the recipe {origin.recipe} is not beside the plan: whether it has changed is not known"
        return Freshness("a compiled plan without its recipe", (warning("C011", message, span, advice),))
    same = origin.matches(recipe.read_bytes())
    said: list[Diagnostic] = []
    if not same:
        advice = f"planlang compile {recipe} -o {plan.path} writes the plan anew"
        message = f"the recipe has changed since this plan was compiled from it: {recipe}"
        said.append(error("C009", message, span, advice))
    fresh, problems = _compiled(recipe, origin, folders)
    if fresh is None:
        state = "out of date" if not same else "compiled from a recipe that no longer compiles"
        return Freshness(state, tuple(said) if not same else problems)
    if fresh == plan.source:
        return Freshness(f"what {recipe.name} compiles to")
    is_edited = origin.is_edited(plan.source)
    if same and not is_edited:
        message = f"{origin.recipe} compiles to another plan now: planlang has changed ({_versions(origin, fresh)})"
        said.append(warning("C006", f"{message}, or what the recipe imports", span, "compile the plan anew"))
    if is_edited and origin.digest is not None:
        said.append(note("C010", "the plan was edited since it was compiled", span))
    elif same and is_edited:
        message = f"the plan differs from what {origin.recipe} compiles to: it was edited, or planlang has changed"
        said.append(note("C010", message, span))
    state = "out of date" if not same or not is_edited else "an edited plan"
    return Freshness(state, tuple(said), _difference(plan, recipe, fresh))


def _compiled(recipe: Path, origin: PlanHeader, folders: Sequence[Path]) -> tuple[str | None, tuple[Diagnostic, ...]]:
    from planlang.compiler import compile_recipe

    try:
        compiled = compile_recipe(
            recipe,
            task=origin.task,
            folders=folders,
            allow_abstract=True,
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


def _difference(plan: PlanFile, recipe: Path, fresh: str) -> str:
    lines = difflib.unified_diff(
        plan.source.splitlines(), fresh.splitlines(), str(plan.path), f"what {recipe.name} compiles to now", lineterm=""
    )
    return "\n".join(lines)
