"""Plans as files: importing them, finding the plan to run, binding its parameters."""

from __future__ import annotations

import importlib.util
import inspect
import tempfile
import traceback
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace
from importlib.machinery import SourceFileLoader
from pathlib import Path
from types import ModuleType
from typing import Any

from executive.knowledge import SemanticMap
from planlang.designators import Object, local_name
from planlang.diagnostics import BadInput, Diagnostic, Span, error
from planlang.language.plans import Plan
from planlang.ontology import expand, shorten


def compiled_plan(
    recipe: Path,
    stack: ExitStack,
    found: list[Diagnostic],
    *,
    task: str | None = None,
    folders: Sequence[Path] = (),
    allow_abstract: bool = False,
) -> Path:
    """Compile a recipe into a temporary folder that ``stack`` removes; warnings and notes go to ``found``."""
    from planlang.compiler import compile_recipe

    compiled = compile_recipe(recipe, task=task, folders=folders, allow_abstract=allow_abstract)
    found.extend(compiled.diagnostics)
    folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="planlang-")))
    path = folder / f"{compiled.functions[-1]}.py"
    path.write_text(compiled.source, encoding="utf-8")
    return path


def import_plan(path: Path) -> ModuleType:
    """The plan's file as a module; raises BadInput, with the line, when it cannot be imported."""
    loader = _PlanLoader(f"planlang_run_{path.stem}", str(path))
    spec = importlib.util.spec_from_loader(loader.name, loader)
    assert spec is not None
    module = importlib.util.module_from_spec(spec)
    try:
        loader.exec_module(module)
    except (Exception, SystemExit) as problem:
        message = f"the plan cannot be imported: {type(problem).__name__}: {problem}"
        raise BadInput([error("X001", message, Span(str(path), line_in(problem, path) or 1))]) from problem
    return module


class _PlanLoader(SourceFileLoader):
    """Loads a plan from a file of any suffix and leaves no compiled copy beside it."""

    def set_data(self, path: Any, data: Any, *, _mode: int = 0o666) -> None:
        """Called with the compiled copy; it is not kept."""


def line_in(problem: BaseException, path: Path) -> int | None:
    """The line of a file that an exception passed last, or that it names itself."""
    lines = [frame.lineno for frame in traceback.extract_tb(problem.__traceback__) if frame.filename == str(path)]
    return lines[-1] if lines else getattr(problem, "lineno", None)


def main_plan(module: ModuleType, task: str | None) -> Plan[Any, Any]:
    """The plan of that name or IRI; without one the last plan in the file, which calls the others.

    Raises BadInput, telling which plans there are, when there is none or not the one that was asked for.
    """
    plans = [value for value in vars(module).values() if isinstance(value, Plan)]
    if not plans:
        advice = "mark the plan with @plan from planlang"
        raise BadInput([error("X002", "this file defines no plan", Span(str(module.__file__)), advice)])
    if task is None:
        return plans[-1]
    for plan in plans:
        if task in (plan.name, plan.iri, local_name(plan.iri or "")):
            return plan
    advice = f"this file defines {', '.join(plan.name for plan in plans)}"
    raise BadInput([error("R001", f"there is no task {task}", Span(str(module.__file__)), advice)])


def bindable_parameters(plan: Plan[Any, Any]) -> dict[str, Object]:
    """The plan's parameters that things can be bound to, with their defaults."""
    return {
        name: parameter.default
        for name, parameter in inspect.signature(plan.function).parameters.items()
        if isinstance(parameter.default, Object)
    }


def bound_parameters(plan: Plan[Any, Any], bindings: Mapping[str, str], semantic_map: SemanticMap) -> dict[str, Object]:
    """The plan's parameters: their defaults, or things of the map that the user named and whose class fits."""
    parameters = bindable_parameters(plan)
    problems = []
    for name, wanted in bindings.items():
        thing = semantic_map.find(wanted)
        if name not in parameters:
            known = ", ".join(parameters) or "none"
            problems.append(error("X004", f"the plan has no parameter {name!r}", help=f"its parameters: {known}"))
        elif thing is None or thing.pose is None:
            known = ", ".join(other.name for other in semantic_map.objects if other.pose is not None)
            problems.append(error("X005", f"{wanted!r} is not in the map", help=f"things with a place: {known}"))
        else:
            default = parameters[name]
            if not any(semantic_map.ontology.is_a(cls, expand(default.type)) for cls in thing.types):
                classes = ", ".join(shorten(cls) for cls in thing.types)
                problems.append(error("X006", f"{wanted} is a {classes}, but {name} must be a {default.type}"))
            else:
                parameters[name] = replace(default, iri=thing.iri)
    if problems:
        raise BadInput(problems)
    return parameters
