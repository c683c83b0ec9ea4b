"""Versions of a compiled plan: as compiled before, as edited by hand, as its recipe compiles now.

``planlang compile -o plan.py`` writes the compiled plan a second time, to ``plan.py.base``. Compared with that base,
hand edits and changes of the recipe can be told apart, and merged by lines, as diff3 and git do it.

Lines that neither side changed divide the texts into chunks. A chunk that one side changed is taken from that side; if
both changed it, differently, the result has a conflict with both versions. (S. Khanna, K. Kunal, B. C. Pierce, "A
formal investigation of diff3", 2007.) The library for this, merge3, is under the GPL.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from difflib import SequenceMatcher
from pathlib import Path
from typing import NamedTuple

from planlang.diagnostics import BadInput, Diagnostic, Span, error
from planlang.files import read_file
from planlang.outputs import LARGEST_PLAN, check_outputs, digest, header, is_device, replace, write_plan, write_text
from planlang.records import dataclass

OURS, MIDDLE, THEIRS = "<<<<<<<", "=======", ">>>>>>>"
"""How git marks a conflict: before our version, between the two, after theirs."""


@dataclass(frozen=True, slots=True)
class Merged:
    """A merged text, and the lines, counted from 1, at which its conflicts begin."""

    text: str
    conflicts: tuple[int, ...] = ()


class _Common(NamedTuple):
    """A run of lines common to all three texts, with its start in each."""

    base: int
    ours: int
    theirs: int
    length: int


def merged(base: str, ours: str, theirs: str, *, our_name: str, their_name: str) -> Merged:
    """Merge two texts derived from a base; lines end with a line feed.

    Conflicts are marked as git does, with the names of the two sides.
    """
    texts = [text.splitlines(keepends=True) for text in (base, ours, theirs)]
    lines: list[str] = []
    conflicts = []
    at = (0, 0, 0)
    for common in _common(*texts):
        ends = common[:3]
        old, own, new = (text[start:end] for text, start, end in zip(texts, at, ends, strict=True))
        if own in (old, new):
            lines += new
        elif new == old:
            lines += own
        else:
            conflicts.append(len(lines) + 1)
            lines += [f"{OURS} {our_name}\n", *_ended(own), f"{MIDDLE}\n", *_ended(new), f"{THEIRS} {their_name}\n"]
        lines += texts[0][common.base : common.base + common.length]
        at = (common.base + common.length, common.ours + common.length, common.theirs + common.length)
    return Merged("".join(lines), tuple(conflicts))


def has_conflicts(text: str) -> bool:
    """Check whether a text has conflict markers."""
    starts = {line.split(" ")[0] for line in text.splitlines()}
    return {OURS, MIDDLE, THEIRS} <= starts


def _ended(lines: Sequence[str]) -> list[str]:
    """End the last line with a line feed, so that a marker can follow."""
    return [line if line.endswith("\n") else f"{line}\n" for line in lines]


def _common(base: list[str], ours: list[str], theirs: list[str]) -> Iterator[_Common]:
    """Yield the runs of lines common to all three texts, in order; a last, empty one stands at their ends."""
    first, second = (
        [block for block in SequenceMatcher(None, base, other, autojunk=False).get_matching_blocks() if block.size]
        for other in (ours, theirs)
    )
    i = j = 0
    while i < len(first) and j < len(second):
        a, b = first[i], second[j]
        start, end = max(a.a, b.a), min(a.a + a.size, b.a + b.size)
        if start < end:
            yield _Common(start, a.b + start - a.a, b.b + start - b.a, end - start)
        if a.a + a.size < b.a + b.size:
            i += 1
        else:
            j += 1
    yield _Common(len(base), len(ours), len(theirs), 0)


def base_path(plan: Path) -> Path:
    """Path of the copy that holds a plan as compiled."""
    return plan.with_name(f"{plan.name}.base")


def backup_path(plan: Path) -> Path:
    """Path of the copy that holds a plan as it was before the last merge."""
    return plan.with_name(f"{plan.name}.orig")


def write_versions(path: Path, source: str, *, force: bool) -> None:
    """Write a compiled plan and its base; raises BadInput rather than overwrite hand edits."""
    if is_device(path):
        write_plan(path, source, force=force)
        return
    _refuse_foreign("the base of the plan", base_path(path), force=force)
    write_plan(path, source, force=force)
    write_text(base_path(path), source)


def compiled_before(path: Path, plan: str, fresh: str | None) -> str | None:
    """Return a plan as it was compiled; None if that can no longer be determined.

    That is the plan itself if it is unedited, else the base beside it, else the fresh output of its recipe, provided
    that the digest in the header matches.
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
    """Merge hand edits into the plan that the recipe compiles to now; return the lines at which conflicts begin.

    An unedited plan is replaced by the new one. The plan before the merge is kept as ``plan.py.orig``. Raises BadInput,
    and changes nothing, if the base is unknown.
    """
    content, span = read_file(path, "C001", largest=LARGEST_PLAN), Span(str(path))
    try:
        plan = content.decode("utf-8-sig")
    except UnicodeDecodeError:
        raise BadInput([error("C002", "the plan is not in UTF-8", span, "save it as UTF-8")]) from None
    if has_conflicts(plan):
        raise BadInput([unresolved(plan, span)])
    if header(plan) is None:
        advice = "write to another file"
        raise BadInput([error("C005", f"{path} is not a compiled plan", span, advice)])
    base = compiled_before(path, plan, fresh)
    if base is None:
        advice = f"compile to another file and merge by hand, or restore {base_path(path).name}"
        message = f"{path} cannot be merged: its version before the edits is unknown"
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
    """Make the error for a plan with conflicts of an earlier merge, at the first one."""
    lines = plan.splitlines()
    line = next(number for number, text in enumerate(lines, 1) if text.startswith(OURS))
    advice = "edit the lines between <<<<<<< and >>>>>>> and remove the markers"
    return error("C023", "the plan has unresolved merge conflicts", span._replace(line=line), advice)


def _refuse_foreign(name: str, path: Path, *, force: bool = False) -> None:
    problems = check_outputs({name: path}, {}, force=force)
    if problems:
        raise BadInput(problems)


def _with_line_feeds(text: str) -> str:
    return text.replace("\r\n", "\n")
