"""Fixing the text of a recipe: each fix is kept only if its problem disappears and nothing else gets worse.

A fix that the user accepted is evaluated by the checks and by the order of the plan's steps, before and after it. A
file of another syntax is written in Manchester syntax first, and in its own again after all fixes.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import chain
from pathlib import Path

from planlang.diagnostics import BadInput, Diagnostic, Severity, Span, has_errors
from planlang.files import decode
from planlang.ontology import load
from planlang.ontology.canonical import Sorting
from planlang.ontology.convert import Converted, Target, convert_content
from planlang.ontology.documents import Syntax, read_bytes, syntax_of
from planlang.recipe.actions import Actions
from planlang.recipe.fixes import Fix, Worse
from planlang.recipe.fixes.manchester_text import CannotEdit, Edit, ManchesterText, line_end
from planlang.recipe.fixes.proposals import declarations, propose_fixes, renames
from planlang.recipe.preconditions import Unmet, too_early
from planlang.recipe.reading import read_recipe, read_recipes
from planlang.records import dataclass
from planlang.temporary import temporary_folder

_LOST = ("O051", "O052", "O053")
"""Codes of what a file loses when it is written anew, and its meaning does not."""
MOST_FIXES = 100
"""Maximum number of fixes tried in one file. Each reads the whole file again, a tenth of a second for a real recipe."""


@dataclass(frozen=True, slots=True)
class Fixed:
    """Text of a recipe before and after fixing, the fixes that were made, and those that were not.

    The latter were not accepted, impossible, or refused because they would have made the recipe worse, each with the
    reason. Their spans are positions in the text after fixing. ``changed`` is the text in Manchester syntax that was
    edited, before and after. ``notes`` tell what was lost in writing another syntax anew, such as comments.
    """

    before: str
    after: str
    changed: tuple[str, str]
    content: bytes
    """The bytes of the file afterwards: its own if nothing was done."""
    done: tuple[Fix, ...]
    unaccepted: tuple[Fix, ...]
    impossible: tuple[tuple[Fix, str], ...]
    refused: tuple[tuple[Fix, Worse], ...] = ()
    notes: tuple[Diagnostic, ...] = ()


@dataclass(frozen=True, slots=True)
class _State:
    """A text, read from a temporary file, with its diagnostics and possible fixes."""

    text: str
    file: str
    diagnostics: tuple[Diagnostic, ...]
    fixes: tuple[Fix, ...]
    unmet: tuple[Unmet, ...]
    """Actions that the plan performs too early; none without a plan."""

    def errors(self) -> Counter[tuple[str, str]]:
        return Counter((one.code, one.message) for one in self.diagnostics if one.severity is Severity.ERROR)

    def count(self, severity: Severity) -> int:
        return sum(one.severity is severity for one in self.diagnostics)


def fix_recipe(
    path: Path,
    *,
    task: str | None = None,
    folders: Sequence[Path] = (),
    accepted: frozenset[str] = frozenset(),
    content: bytes | None = None,
) -> Fixed:
    """Fix the recipe in a file without changing the file.

    Uncertain fixes are made only if their code is ``accepted``, and if neither the checks nor the order of the plan's
    steps show that they make the recipe worse. ``content`` is a recipe in memory, which ``path`` only names. All others
    are those of :func:`planlang.recipe.read_recipe`. Raises BadInput if the file cannot be read at all.
    """
    fixing = _Fixing(path, task, folders, read_bytes(path) if content is None else content)
    given = fixing.first()

    def is_wanted(fix: Fix) -> bool:
        return fix.is_safe or fix.code in accepted

    done: list[Fix] = []
    failed: dict[tuple[str, str], tuple[Fix, CannotEdit]] = {}
    state = edited = given
    notes: tuple[Diagnostic, ...] = ()
    wanted = [fix for fix in given.fixes if is_wanted(fix)]
    if wanted and fixing.syntax is not Syntax.MANCHESTER:
        try:
            edited, notes = fixing.in_manchester(given, wanted)
            state = edited
            done += (fix for fix in wanted if fix.edit is None)
        except CannotEdit as problem:
            failed = {(fix.code, fix.message): (fix, problem) for fix in wanted}
    while len(done) + len(failed) < MOST_FIXES:
        waiting = [fix for fix in state.fixes if is_wanted(fix) and (fix.code, fix.message) not in failed]
        if not waiting:
            break
        safe = [fix for fix in waiting if fix.is_safe]
        for batch in (safe, waiting[:1]) if len(safe) > 1 else (waiting[:1],):  # first all safe fixes at once
            try:
                state = fixing.tried(state, batch)
                done += batch
                break
            except CannotEdit as problem:
                if batch is not safe:
                    failed[waiting[0].code, waiting[0].message] = (waiting[0], problem)
    changed = edited.text, state.text
    if fixing.syntax is not Syntax.MANCHESTER:
        try:
            state = fixing.in_own_syntax(state) if done else given
        except CannotEdit as problem:
            failed |= {(fix.code, fix.message): (fix, problem) for fix in done}
            state, done, notes = given, [], ()
    spans = {(fix.code, fix.message): fixing.in_file(fix.span) for fix in state.fixes}
    unmade = [(replace(fix, span=spans.get(key)), why) for key, (fix, why) in failed.items()]
    return Fixed(
        fixing.before,
        state.text,
        changed,
        state.text.encode(fixing.encoding) if done else fixing.content,
        tuple(done),
        tuple(replace(fix, span=fixing.in_file(fix.span)) for fix in state.fixes if not is_wanted(fix)),
        tuple((one, str(why)) for one, why in unmade if not isinstance(why, Worse)),
        tuple((one, why) for one, why in unmade if isinstance(why, Worse)),
        notes if done else (),
    )


class _Fixing:
    """Reads variants of a recipe's text as if they were in its file."""

    def __init__(self, path: Path, task: str | None, folders: Sequence[Path], content: bytes) -> None:
        self._path, self._task, self._folders = path, task, folders
        self.before = decode(content, str(path))
        self.content = content
        self.encoding = next((one for one in ("utf-8-sig", "utf-16") if self.before.encode(one) == content), "utf-8")
        self.syntax = syntax_of(self.before, str(path))

    def first(self) -> _State:
        """Read the file as it is. Raises BadInput if it cannot be read."""
        try:
            return self._read(self.before, self.content)
        except BadInput as problem:
            raise BadInput([replace(one, span=self.in_file(one.span)) for one in problem.diagnostics]) from None

    def in_manchester(self, given: _State, wanted: Sequence[Fix]) -> tuple[_State, tuple[Diagnostic, ...]]:
        """Write the file in Manchester syntax and read that; also return what is lost. Raises CannotEdit."""
        guess = next((fix for fix in given.fixes if fix.edit is None and fix not in wanted), None)
        if guess is not None:
            raise CannotEdit(f"the file would be written anew with a guess: {guess.message}")
        if self.syntax.name not in Target.__members__:
            raise CannotEdit(f"planlang does not write {self.syntax.value}")
        self.encoding = "utf-8"
        converted = self._converted(self.content, Target.MANCHESTER)
        return self._read(converted.text), tuple(one for one in converted.diagnostics if one.code in _LOST)

    def in_own_syntax(self, state: _State) -> _State:
        """Write fixed text in the syntax of the file and read that. Raises CannotEdit if it has new errors."""
        target = Target.NTRIPLES if self._path.suffix == ".nt" else Target[self.syntax.name]
        text = self._converted(state.text.encode(), target).text.replace("\n", line_end(self.before))
        new = self._read(text)
        if new.errors() - state.errors():
            raise CannotEdit(f"the fixed recipe cannot be written in {self.syntax.value}")
        return new

    def _converted(self, content: bytes, target: Target) -> Converted:
        """Convert the recipe. Raises CannotEdit if statements would be lost."""
        converted = convert_content(content, self._path, target, order=Sorting.FILE)
        for one in converted.diagnostics:
            if one.code == "O050":
                raise CannotEdit(one.message)
        return converted

    def _read(self, text: str, content: bytes | None = None) -> _State:
        """Read a text with its diagnostics and fixes. Raises BadInput if it cannot be read."""
        with temporary_folder() as folder:
            copy = folder / self._path.name
            copy.write_bytes(text.encode(self.encoding) if content is None else content)
            actions = Actions(load(copy, folders=(self._path.parent, *self._folders)))
            reading = read_recipe(actions, self._task)
            if reading.actions is actions:
                raw = read_recipes(actions, reading.recipes.task) if reading.recipes is not None else None
                fixes = propose_fixes(actions, reading.recipes, raw, reading.diagnostics)
            else:  # correct the names first: spans of other fixes may refer to names that are not in the text yet
                fixes = [*declarations(reading.diagnostics), *renames(actions.ontology, reading.misspelt)]
        here = tuple(fix for fix in fixes if fix.span is not None and fix.span.file == str(copy))
        recipes = None if has_errors(reading.diagnostics) else reading.recipes
        unmet = () if recipes is None else too_early(reading.actions, recipes)
        return _State(text, str(copy), reading.diagnostics, here, unmet)

    def tried(self, state: _State, fixes: Sequence[Fix]) -> _State:
        """Apply fixes. Raises CannotEdit if that is impossible, or does not help."""
        text = ManchesterText(state.text, state.file)
        edits = [fix.edit(text) if fix.edit is not None else [] for fix in fixes]
        if not all(edits):
            raise CannotEdit("the text to change was not found")
        try:
            new = self._read(_applied(state.text, chain.from_iterable(edits)))
        except (BadInput, UnicodeEncodeError):
            raise CannotEdit("the changed text could not be read") from None
        remaining = {(fix.code, fix.message) for fix in new.fixes}
        if any((fix.code, fix.message) in remaining for fix in fixes):
            raise CannotEdit("the change to the text had no effect")
        if not all(fix.is_safe for fix in fixes):
            self._refuse_if_worse(state, new, fixes[0])
        elif new.errors() - state.errors():
            raise CannotEdit("the change would cause new errors")
        return new

    def _refuse_if_worse(self, before: _State, after: _State, fix: Fix) -> None:
        """Raise Worse if the checks, or the order of the plan, have more problems after a fix than before it."""
        fixed = next((one.severity for one in before.diagnostics if one.code == fix.code), Severity.NOTE)
        new = [
            one
            for one in after.diagnostics
            if one.severity is Severity.ERROR and (one.code, one.message) not in before.errors()
        ]
        errors = after.count(Severity.ERROR) - before.count(Severity.ERROR)
        if new and (errors > 0 or fixed is not Severity.ERROR):
            raise Worse(f"it would cause the error {new[0].code}: {new[0].message}", new[0].help or "change it by hand")
        if not errors and after.count(Severity.WARNING) > before.count(Severity.WARNING):
            old = {(one.code, one.message) for one in before.diagnostics}
            more = next(one for one in after.diagnostics if (one.code, one.message) not in old)
            raise Worse(f"it would cause the {more.severity.value} {more.code}: {more.message}", more.help or "")
        for unmet in after.unmet:
            if unmet not in before.unmet:
                raise Worse(f"in the plan, {unmet}", unmet.advice)

    def in_file(self, span: Span | None) -> Span | None:
        """Position in the file itself instead of its temporary copy."""
        return span if span is None or Path(span.file).name != self._path.name else span._replace(file=str(self._path))


def _applied(text: str, edits: Iterable[Edit]) -> str:
    """Apply edits; insertions at one position keep their order.

    Raises CannotEdit if two edits touch the same characters.
    """
    parts: list[str] = []
    position = 0
    for start, end, new in sorted(dict.fromkeys(edits), key=lambda edit: edit[:2]):
        if start < position:
            raise CannotEdit("two fixes touch the same place")
        parts += [text[position:start], new]
        position = end
    return "".join([*parts, text[position:]])
