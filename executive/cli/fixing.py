"""``planlang check --fix``: a fixed copy of a recipe beside it, what was changed, and what remains to be done."""

from __future__ import annotations

from collections.abc import Sequence
from difflib import unified_diff
from pathlib import Path

from executive.cli.console import BAD_INPUT, DONE, Answer
from executive.cli.inputs import SUFFIXES, RecipeFile
from executive.cli.outputs import check_outputs, replace
from planlang.compiler import compile_recipe
from planlang.diagnostics import BadInput, Diagnostic, error, has_errors, note
from planlang.recipe.fixes import ACCEPTABLE, SAFE, WITHOUT, Fix, Fixed, fix_recipe


def fixed_path(recipe: RecipeFile) -> Path:
    """``NAME.fixed.EXT`` beside the recipe; for a recipe that came with planlang in the current folder."""
    path = recipe.path
    suffixes = sorted(SUFFIXES, key=len, reverse=True)
    suffix = next((one for one in suffixes if path.name.endswith(one)), path.suffix)
    name = f"{path.name.removesuffix(suffix)}.fixed{suffix}"
    return Path(name) if recipe.is_bundled else path.with_name(name)


def fix(
    recipe: RecipeFile,
    output: Path | None,
    accepted: Sequence[str],
    *,
    task: str | None,
    folders: Sequence[Path],
    allow_abstract: bool,
) -> Answer:
    """Write a fixed copy of a recipe, show the difference, and check the copy.

    Without ``output`` the copy goes beside the recipe, where a file of that name is never overwritten by another text.
    Raises BadInput when the recipe cannot be read, or the copy not be written.
    """
    target = output or fixed_path(recipe)
    problems = [
        error("C015", f"--accept {code}: no fix with this code waits for acceptance", help=_acceptable(code))
        for code in accepted
        if code not in ACCEPTABLE
    ]
    problems += check_outputs({"the fixed copy" if output is None else "--output": target}, {"the recipe": recipe.path})
    if problems:
        raise BadInput(problems)
    fixed = fix_recipe(
        recipe.path, task=task, folders=folders, allow_abstract=allow_abstract, accepted=frozenset(accepted)
    )
    checked = recipe.path
    if fixed.done:
        _write(target, fixed, is_named=output is not None)
        checked = target
    try:
        plan = compile_recipe(checked, task=task, folders=(recipe.path.parent, *folders), allow_abstract=allow_abstract)
        remaining, verdict = plan.diagnostics, f"{plan.task} compiles"
    except BadInput as problem:
        remaining, verdict = problem.diagnostics, "errors remain"
    data = {
        "kind": "recipe",
        "fixed": str(target) if fixed.done else None,
        "fixes": [{"code": one.code, "message": one.message} for one in fixed.done],
        "diff": _difference(recipe.path, target, fixed),
    }
    lines = [_difference(recipe.path, target, fixed)] if fixed.done else []
    lines += [f"fixed {one.code} {one.message}\n" for one in fixed.done]
    lines.append(f"{checked}: {verdict}" if fixed.done else f"{checked}: nothing was fixed; {verdict}")
    code = BAD_INPUT if has_errors(remaining) else DONE
    return Answer(code, (*remaining, *_left(fixed, checked)), "".join(lines), data)


def _write(target: Path, fixed: Fixed, *, is_named: bool) -> None:
    content = fixed.after.encode(fixed.encoding)
    if target.exists() and not is_named and target.read_bytes() != content:
        advice = f"remove it, or say -o {target} to overwrite it"
        raise BadInput([error("C005", f"{target} is there already and is another text", help=advice)])
    replace(target, lambda temporary: _write_bytes(temporary, content))


def _write_bytes(path: Path, content: bytes) -> None:
    path.write_bytes(content)


def _left(fixed: Fixed, checked: Path) -> list[Diagnostic]:
    """A note for each fix that was not made: where it would be, and what a person can do."""
    told = [(one, f"not safe, not done: {_said(one)}", f"--accept {one.code} does it") for one in fixed.unaccepted]
    told += [(one, f"not done: {_said(one)}; {why}", "make the change by hand") for one, why in fixed.impossible]
    return [
        note("C016", message, one.span._replace(file=str(checked)) if one.span else None, advice)
        for one, message, advice in told
    ]


def _said(one: Fix) -> str:
    return f"{one.code} {one.message}"


def _difference(before: Path, after: Path, fixed: Fixed) -> str:
    old, new = (text.splitlines(keepends=True) for text in (fixed.before, fixed.after))
    lines = unified_diff(old, new, str(before), str(after))
    return "".join(line if line.endswith("\n") else line + "\n\\ No newline at end of file\n" for line in lines)


def _acceptable(code: str) -> str:
    listed = f"codes that can be accepted: {', '.join(ACCEPTABLE)}"
    if code in SAFE:
        return f"fixes of {code} are safe: --fix makes them unasked; {listed}"
    return f"{code} has no fix: {WITHOUT[code]}; {listed}" if code in WITHOUT else listed
