"""Checks of recipes and maps, fixes of recipes, and whether a plan is up to date. No plan is executed."""

from __future__ import annotations

import difflib
import os
from collections.abc import Iterator, Sequence
from dataclasses import replace as changed
from pathlib import Path

from executive.commands.checked import CheckResult
from executive.commands.performed import performed_by_modules
from executive.commands.reasoned import reasoned
from executive.options.recipes import CheckOptions
from executive.options.running import Source
from executive.runs.files import RecipeFile, folders_beside, read, read_recipe_file, unacceptable
from planlang.compiler import compile_recipe
from planlang.designators import local_name
from planlang.diagnostics import BadInput, Diagnostic, Severity, Span, WrongOption, error, has_errors, note, warning
from planlang.files import ONTOLOGIES, Bundled, bundled
from planlang.language.source import PlanSource
from planlang.ontology import expand, load, shorten
from planlang.ontology.catalog import FOLDER
from planlang.outputs import NO_DATA_FLOW, NO_SCOPES, PlanHeader, check_outputs, header, replace
from planlang.plan_versions import compiled_before
from planlang.progress import Report, Waiting, unreported, unwatched
from planlang.recipe.actions import Performed
from planlang.recipe.fixes import Fix
from planlang.recipe.fixes.fixing import Fixed
from planlang.records import dataclass
from planlang.roles import meant_role
from planlang.words import Blank, Option, Text, calling


def check(options: CheckOptions, *, report: Report = unreported, waiting: Waiting = unwatched) -> CheckResult:
    """Check a recipe, a plan, a map or a folder of recipes, or fix a recipe. Raises BadInput.

    ``report`` gets the progress through a folder; ``waiting`` is entered while a reasoner runs.
    """
    source = options.file
    is_folder = isinstance(source, str | os.PathLike) and os.path.isdir(source)  # False for what cannot be a path
    folder = Path(str(source)) if is_folder and Bundled.of(str(source)) is None else None
    if not options.fix and (options.accept or options.output):
        raise WrongOption(Option("accept"), " and ", Option("output"), " need ", Option("fix", True))
    if options.reason and (options.fix or folder is not None):
        raise WrongOption(Option("reason", True), " is for one file, without ", Option("fix", True))
    if options.fix:
        return _fix(read_recipe_file(options.file), options)
    if folder is not None:
        from executive.commands.recipe_table import check_folder  # needs robots: slow, and most checks are of a file

        return check_folder(folder, options.folders, report)
    found = _check_file(read(find_checked(options.file)), options, waiting)
    return changed(found, diagnostics=(*folders_beside(options.file), *found.diagnostics))


def find_checked(source: Source) -> Source:
    """Find a recipe, plan or map: an existing path, or a bundled recipe or environment. Raises BadInput."""
    if not isinstance(source, str | os.PathLike) or "\n" in (name := os.fspath(source)):
        return source
    return (Bundled.ENVIRONMENT if Bundled.of(name) is Bundled.ENVIRONMENT else Bundled.RECIPE).find(name)


def _check_file(file: PlanSource | RecipeFile, options: CheckOptions, waiting: Waiting) -> CheckResult:
    """Check a recipe, a plan or a map. Raises BadInput."""
    if isinstance(file, RecipeFile):
        if not options.reason:
            return _recipe_or_map(file, options)
        return reasoned(file, options, lambda: _recipe_or_map(file, options), waiting)
    fresh = freshness(file, folders=options.folders)
    diagnostics = [*fresh.diagnostics, *misspelt_roles(file)]
    if file.header is None:
        performed = performed_by_modules(options.modules, diagnostics, trust=options.trust)
        diagnostics += unperformed_actions(file, performed)
    text = "\n".join(filter(None, (f"{file.path}: {fresh.state}", fresh.edits, fresh.difference)))
    data = {"state": fresh.state, "edits": fresh.edits, "difference": fresh.difference}
    return CheckResult(not has_errors(diagnostics), "plan", text, tuple(diagnostics), data)


def _recipe_or_map(recipe: RecipeFile, options: CheckOptions) -> CheckResult:
    """Check a recipe or a map. Raises BadInput."""
    problems: list[Diagnostic] = []
    performed = performed_by_modules(options.modules, problems, trust=options.trust)
    try:
        plan = compile_recipe(
            recipe.path, task=options.task, folders=options.folders, performed=performed, content=recipe.content
        )
    except BadInput as problem:
        lacks_task = any(one.code in ("R001", "R003") and one.severity is Severity.ERROR for one in problem.diagnostics)
        if options.task is not None or not lacks_task:
            raise
        from executive.commands.map_check import check_map  # most files are recipes

        return check_map(
            recipe,
            options.folders,
            problem,
            lists_contents=options.lists_contents,
            ignore_unread=options.ignore_unread,
        )
    text = f"{recipe.path}: {plan.task} compiles"
    diagnostics = (*plan.diagnostics, *problems)
    return CheckResult(not has_errors(problems), "recipe", text, diagnostics, {"task": plan.task})


# Fixes of recipes


def fixed_path(recipe: RecipeFile) -> Path:
    """Path ``NAME.fixed.EXT`` beside the recipe; for a bundled recipe, in the current folder."""
    path = recipe.path
    suffixes = sorted(ONTOLOGIES, key=len, reverse=True)
    suffix = next((one for one in suffixes if path.name.endswith(one)), path.suffix)
    name = f"{path.name.removesuffix(suffix)}.fixed{suffix}"
    return Path(name) if recipe.is_bundled else path.with_name(name)


def _fix(recipe: RecipeFile, options: CheckOptions) -> CheckResult:
    """Write a fixed copy of a recipe, show the difference in Manchester syntax, and check the copy; raises BadInput.

    Without ``--output``, an existing file with another text is never overwritten.
    """
    output, accepted = options.output, options.accept or ()
    target = output or fixed_path(recipe)
    problems = unacceptable(accepted)
    name = "the fixed copy" if output is None else Option("output")
    is_own = output is None or options.force
    problems += check_outputs(
        {name: target}, {"the recipe": recipe.path} if recipe.content is None else {}, force=is_own
    )
    if problems:
        raise BadInput(problems)
    task, folders = options.task, options.folders
    from planlang.recipe.fixes.fixing import fix_recipe  # slow, and most recipes are only checked

    fixed = fix_recipe(recipe.path, task=task, folders=folders, accepted=frozenset(accepted), content=recipe.content)
    module_problems: list[Diagnostic] = []
    performed = performed_by_modules(options.modules, module_problems, trust=options.trust)
    checked, content = recipe.path, recipe.content
    if fixed.done:
        written = fixed.content
        if output is None and target.exists() and target.read_bytes() != written:
            advice = Text("remove it, or overwrite it with ", Option("output", target), " and ", Option("force", True))
            raise BadInput([error("C005", f"{target} exists with other contents", help=advice)])
        replace(target, lambda temporary: temporary.write_bytes(written))
        checked, content = target, None
    searched = (*recipe.folder, *folders)
    try:
        plan = compile_recipe(checked, task=task, folders=searched, performed=performed, content=content)
        remaining, verdict = plan.diagnostics, f"{plan.task} compiles"
    except BadInput as problem:
        remaining, verdict = problem.diagnostics, "errors remain"
    difference = _fix_difference(recipe.path, target, fixed)
    data = {
        "fixed": str(target) if fixed.done else None,
        "fixes": [{"code": one.code, "message": one.message} for one in fixed.done],
        "diff": difference,
    }
    lines = [difference] if fixed.done else []
    lines += [f"fixed {one.code} {one.message}\n" for one in fixed.done]
    lines.append(f"{checked}: {verdict}" if fixed.done else f"{checked}: nothing was fixed; {verdict}")
    diagnostics = (*remaining, *module_problems, *fixed.notes, *_not_applied(fixed, checked))
    return CheckResult(not has_errors(remaining), "recipe", "".join(lines), diagnostics, data)


def _not_applied(fixed: Fixed, checked: Path) -> list[Diagnostic]:
    """Notes on fixes that were not applied, and warnings for those that would make the recipe worse."""

    def where(one: Fix) -> Span | None:
        return one.span._replace(file=str(checked)) if one.span else None

    diagnostics = [
        note(
            "C016", f"uncertain, not applied: {_line(one)}", where(one), Text(Option("accept", one.code), " applies it")
        )
        for one in fixed.unaccepted
    ]
    diagnostics += [
        note("C016", f"not applied: {_line(one)}; {why}", where(one), "make the change by hand")
        for one, why in fixed.impossible
    ]
    diagnostics += [
        warning("C022", f"refused: {_line(one)}; {why}", where(one), why.advice) for one, why in fixed.refused
    ]
    return diagnostics


def _line(one: Fix) -> str:
    return f"{one.code} {one.message}"


def _fix_difference(before: Path, after: Path, fixed: Fixed) -> str:
    """Compare what was edited; where writing the file anew was the fix, the file itself."""
    edited, itself = fixed.changed, (fixed.before, fixed.after)
    old, new = (text.splitlines(keepends=True) for text in (itself if edited[0] == edited[1] else edited))
    lines = difflib.unified_diff(old, new, str(before), str(after))
    return "".join(line if line.endswith("\n") else line + "\n\\ No newline at end of file\n" for line in lines)


@dataclass(frozen=True, slots=True)
class Freshness:
    """The state of a plan in words, diagnostics, and two unified diffs, each empty if nothing differs.

    ``edits``: from the compiled plan to the plan. ``difference``: from the compiled plan to what the recipe compiles to
    now. If the compiled plan is unknown, ``difference`` starts from the plan itself, and ``edits`` is empty.
    """

    state: str
    diagnostics: tuple[Diagnostic, ...] = ()
    difference: str = ""
    edits: str = ""


def freshness(plan: PlanSource, *, folders: Sequence[Path] = ()) -> Freshness:
    """Compare a plan with what its recipe compiles to now, by the options of the compiled plan.

    The recipe is searched beside the plan, in ``folders``, then among the bundled ones. A changed recipe is an error;
    a changed compiler or import a warning; an edited plan a note.
    """
    origin = plan.header
    if origin is None:
        return Freshness("a plan written by hand")
    span = Span(plan.file)
    recipe = origin.find_recipe(plan.path, folders)
    if recipe is None:
        advice = Text("name its folder with ", FOLDER)
        message = f"the recipe {origin.recipe} was not found: whether it has changed is unknown"
        return Freshness("a compiled plan without its recipe", (warning("C011", message, span, advice),))
    is_same = origin.matches(recipe.read_bytes())
    diagnostics: list[Diagnostic] = []
    if not is_same:
        advice = Text(calling("compile", recipe, output=plan.path), " compiles the plan again")
        if origin.is_edited(plan.text):
            advice = Text(calling("compile", recipe, output=plan.path, merge=True), " keeps the edits")
        message = f"the recipe has changed since this plan was compiled from it: {recipe}"
        diagnostics.append(error("C009", message, span, advice))
    fresh, problems = _compiled(recipe, origin, folders)
    if fresh is None:
        state = "compiled from a recipe that no longer compiles" if is_same else "out of date"
        return Freshness(state, problems if is_same else tuple(diagnostics))
    if fresh == plan.text:
        return Freshness(f"what {recipe.name} compiles to")
    is_edited = origin.is_edited(plan.text)
    if is_same and not is_edited:
        message = f"{origin.recipe} compiles to a different plan now: planlang has changed ({_versions(origin, fresh)})"
        diagnostics.append(warning("C006", f"{message}, or what the recipe imports", span, "compile the plan again"))
    if is_edited and origin.digest is not None:
        diagnostics.append(note("C010", "the plan was edited since it was compiled", span))
    elif is_same and is_edited:
        message = f"the plan differs from what {origin.recipe} compiles to: it was edited, or planlang has changed"
        diagnostics.append(note("C010", message, span))
    state = "out of date" if not is_same or not is_edited else "an edited plan"
    now, before = f"what {recipe.name} compiles to now", compiled_before(plan.path, plan.text, fresh)
    if before is None or not is_edited:
        return Freshness(state, tuple(diagnostics), _difference(plan.text, fresh, str(plan.path), now))
    name = f"{plan.path} as compiled"
    edits = _difference(before, plan.text, name, f"{plan.path} as edited")
    return Freshness(state, tuple(diagnostics), _difference(before, fresh, name, now), edits)


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


def unperformed_actions(plan: PlanSource, performed: Performed) -> Iterator[Diagnostic]:
    """Warn of actions of a plan written by hand whose class, stated as a string without ``below``, no module performs.

    A plan with ``otherwise`` may perform its actions itself and is not examined.
    """
    from executive.modules.bundled import bundled_registry  # slow, and most plans are compiled

    performs = (one for one in plan.calls if one.function == "perform")
    if any(keyword.name == "otherwise" for one in performs for keyword in one.keywords) or not plan.actions:
        return
    ontology, classes = load(bundled("ontologies") / "knowrob.omn"), bundled_registry().actions | performed()
    for action in plan.actions:
        if (cls := action.literal) is None or any(keyword.name == "below" for keyword in action.keywords):
            continue
        if classes.isdisjoint((local_name(cls), *map(shorten, ontology.ancestors(expand(cls))))):
            span = Span(plan.file, action.line, action.column)
            module = Option("modules", Blank("FILE.py"))
            listed = calling("list", "actions")
            advice = Text("name a module with ", module, ", or perform steps that ", listed, " lists")
            yield warning("R021", f"no process module performs {local_name(cls)}", span, advice)


def misspelt_roles(plan: PlanSource) -> Iterator[Diagnostic]:
    """Find misspelt roles of actions: unusual ones that resemble exactly one usual role."""
    for role in (keyword for action in plan.actions for keyword in action.keywords):
        meant = meant_role(role.name) if role.name is not None else None
        if meant is not None:
            span = Span(plan.file, role.line, role.column)
            yield error("C024", f"actions have no role {role.name}", span, f"did you mean {meant}?")
