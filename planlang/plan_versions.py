"""The versions of a compiled plan: as it was compiled, as a person edited it, as its recipe compiles now.

``planlang compile -o plan.py`` writes beside the plan what was compiled, as ``plan.py.base``. From this follow the
edits of a person and the changes of the recipe, each by itself, and a merge that keeps both.
"""

from __future__ import annotations

from pathlib import Path

from planlang.diagnostics import BadInput, Diagnostic, Span, error
from planlang.files import read_file
from planlang.outputs import LARGEST_PLAN, check_outputs, digest, header, is_device, replace, write_plan, write_text
from planlang.three_way import OURS, Merged, has_conflicts, merged


def base_path(plan: Path) -> Path:
    """Return the file beside a plan that holds what was compiled."""
    return plan.with_name(f"{plan.name}.base")


def backup_path(plan: Path) -> Path:
    """Return the file beside a plan that holds it as it was before the last merge."""
    return plan.with_name(f"{plan.name}.orig")


def write_versions(path: Path, source: str, *, force: bool) -> None:
    """Write a compiled plan, and beside it what was compiled; raises BadInput rather than lose a person's work."""
    if is_device(path):
        write_plan(path, source, force=force)
        return
    _refuse_foreign("the base of the plan", base_path(path), force=force)
    write_plan(path, source, force=force)
    write_text(base_path(path), source)


def compiled_before(path: Path, plan: str, fresh: str | None) -> str | None:
    """Return a plan as it was compiled; None if that is not known any more.

    It is the plan itself if nobody has edited it, else the base beside it, else what its recipe compiles to now, if its
    header says that it was compiled to the same.
    """
    origin = header(plan)
    if origin is None or origin.digest is None:
        return None
    if not origin.is_edited(plan):
        return _with_line_feeds(plan)
    beside = base_path(path)
    if beside.is_file():
        text = _with_line_feeds(read_file(beside, "C004", largest=LARGEST_PLAN).decode("utf-8", errors="replace"))
        if digest(text) == origin.digest:
            return text
    return fresh if fresh is not None and digest(fresh) == origin.digest else None


def merge_plan(path: Path, fresh: str, recipe: str) -> tuple[int, ...]:
    """Merge the edits of a plan with what its recipe compiles to now; return the lines at which conflicts begin.

    A plan that nobody has edited becomes the new one. The plan before the merge is kept as ``plan.py.orig``. Raises
    BadInput, and changes nothing, if it is not known what was edited.
    """
    content, span = read_file(path, "C001", largest=LARGEST_PLAN), Span(str(path))
    try:
        plan = content.decode("utf-8")
    except UnicodeDecodeError:
        raise BadInput([error("C002", "the plan is not in UTF-8", span, "save it as UTF-8")]) from None
    if has_conflicts(plan):
        raise BadInput([unresolved(plan, span)])
    if header(plan) is None:
        raise BadInput([error("C005", f"{path} is not a compiled plan", span, "-o writes to another file")])
    base = compiled_before(path, plan, fresh)
    if base is None:
        advice = f"compile to another file with -o, and merge by hand; or bring {base_path(path).name} back"
        message = f"{path} cannot be merged: what it was compiled to before the edits is not known"
        raise BadInput([error("C023", message, span, advice)])
    our_name, their_name = f"{path.name} as edited", f"what {recipe} compiles to now"
    result: Merged = merged(base, _with_line_feeds(plan), fresh, our_name=our_name, their_name=their_name)
    for name, other in (("the backup of the plan", backup_path(path)), ("the base of the plan", base_path(path))):
        _refuse_foreign(name, other)
    text = result.text.replace("\n", "\r\n") if "\r\n" in plan else result.text
    replace(backup_path(path), lambda temporary: temporary.write_bytes(content))
    write_text(path, text)
    write_text(base_path(path), fresh)
    return result.conflicts


def unresolved(plan: str, span: Span) -> Diagnostic:
    """Return an error for a plan with conflicts of an earlier merge, at the first one."""
    lines = plan.splitlines()
    line = next(number for number, text in enumerate(lines, 1) if text.startswith(OURS))
    advice = "edit the lines between <<<<<<< and >>>>>>>, and remove the marks"
    return error("C023", "the plan has conflicts of a merge that are not resolved", span._replace(line=line), advice)


def _refuse_foreign(name: str, path: Path, *, force: bool = False) -> None:
    problems = check_outputs({name: path}, {}, force=force)
    if problems:
        raise BadInput(problems)


def _with_line_feeds(text: str) -> str:
    return text.replace("\r\n", "\n")
