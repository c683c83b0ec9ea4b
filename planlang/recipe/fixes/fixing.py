"""Fixing a recipe's text: every fix is tried, and kept only if what it is for is gone and nothing else got wrong."""

from __future__ import annotations

import tempfile
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from planlang.diagnostics import BadInput, Diagnostic, Severity, Span, error
from planlang.ontology import load
from planlang.ontology.documents import Syntax, read_bytes, syntax_of_text
from planlang.ontology.xml_text import decode
from planlang.recipe.actions import Actions
from planlang.recipe.fixes.edits import CannotEdit, Edit, Editable, Fix, applied
from planlang.recipe.fixes.manchester_text import ManchesterText
from planlang.recipe.fixes.proposals import proposed, renames
from planlang.recipe.fixes.xml_text import XmlText
from planlang.recipe.reading import Reading, read_recipe
from planlang.recipe.tasks import read_recipes

MOST_FIXES = 100
"""Fixes made or tried in one file."""

_ENCODINGS = ("utf-8", "utf-8-sig", "utf-16", "iso8859-1", "iso8859-15", "cp1252")


@dataclass(frozen=True, slots=True)
class Fixed:
    """A recipe's text before and after, what was done, and what was left: not accepted, or not possible (and why).

    Spans of what was left are positions in the text after.
    """

    before: str
    after: str
    encoding: str
    done: tuple[Fix, ...]
    unaccepted: tuple[Fix, ...]
    impossible: tuple[tuple[Fix, str], ...]


@dataclass(frozen=True, slots=True)
class _State:
    text: str
    diagnostics: tuple[Diagnostic, ...]
    fixes: tuple[Fix, ...]

    def errors(self) -> Counter[tuple[str, str]]:
        return Counter((one.code, one.message) for one in self.diagnostics if one.severity is Severity.ERROR)


def fix_recipe(
    path: Path,
    *,
    task: str | None = None,
    folders: Sequence[Path] = (),
    allow_abstract: bool = False,
    accepted: frozenset[str] = frozenset(),
) -> Fixed:
    """Fix the recipe in a file, which stays as it is.

    Fixes that are not safe are made only if their code is ``accepted``. The other arguments are those of
    :func:`planlang.recipe.read_recipe`. Raises BadInput if the file cannot be read at all.
    """
    content = read_bytes(path)
    before = decode(content, str(path))
    encoding = _encoding(content, before)
    fixer = _Fixer(path, encoding, task, (path.parent, *folders), allow_abstract)
    try:
        state = fixer.read(before)
    except BadInput as problem:
        raise BadInput([replace(one, span=_in(path, one.span)) for one in problem.diagnostics]) from None
    done: list[Fix] = []
    impossible: dict[tuple[str, str], tuple[Fix, str]] = {}
    while len(done) + len(impossible) < MOST_FIXES:
        waiting = [
            fix
            for fix in state.fixes
            if (fix.is_safe or fix.code in accepted) and (fix.code, fix.message) not in impossible
        ]
        if not waiting:
            break
        try:
            state, made = fixer.made(state, waiting)
            done += made
        except CannotEdit as problem:
            impossible[waiting[0].code, waiting[0].message] = (waiting[0], str(problem))
    unaccepted = [fix for fix in state.fixes if not fix.is_safe and fix.code not in accepted]
    return Fixed(
        before,
        state.text,
        encoding,
        tuple(done),
        tuple(replace(fix, span=_in(path, fix.span)) for fix in unaccepted),
        tuple((replace(fix, span=_in(path, fix.span)), why) for fix, why in impossible.values()),
    )


def _in(path: Path, span: Span | None) -> Span | None:
    """Return the position in the file itself instead of its temporary copy."""
    return span if span is None or Path(span.file).name != path.name else span._replace(file=str(path))


class _Fixer:
    def __init__(
        self, path: Path, encoding: str, task: str | None, folders: Sequence[Path], allow_abstract: bool
    ) -> None:
        self._path = path
        self._encoding = encoding
        self._task = task
        self._folders = folders
        self._allow_abstract = allow_abstract

    def made(self, state: _State, fixes: Sequence[Fix]) -> tuple[_State, Sequence[Fix]]:
        """Return the state with all safe fixes made at once if that works, else with the first of them.

        Raises CannotEdit if the first one does not work.
        """
        text = editable(state.text)
        safe = [fix for fix in fixes if fix.is_safe]
        for some in (safe, fixes[:1]) if len(safe) > 1 else (fixes[:1],):
            try:
                edits = [edit for fix in some for edit in self._edits(fix, text)]
                return self._tried(state, some, edits), some
            except CannotEdit:
                if some is not safe or len(safe) == 1:
                    raise
        raise CannotEdit("no fix was given")

    def read(self, text: str) -> _State:
        """Return the diagnostics and fixes of a text; raises BadInput if it cannot be read."""
        with tempfile.TemporaryDirectory(prefix="planlang-") as folder:
            copy = Path(folder) / self._path.name
            copy.write_bytes(text.encode(self._encoding))
            ontology = load(copy, folders=self._folders)
            actions = Actions(ontology)
            reading: Reading = read_recipe(actions, self._task, allow_abstract=self._allow_abstract)
            found = reading.diagnostics
            if reading.actions is actions:
                raw = read_recipes(actions, reading.recipes.task) if reading.recipes is not None else None
                fixes = proposed(actions, reading.recipes, raw, found)
            else:  # what else there is to fix stands beside names that are not yet in the text
                fixes = list(renames(ontology, reading.misspelt))
            fixes = [fix for fix in fixes if self._is_here(fix, copy)]
        return _State(text, found, tuple(fixes))

    def _is_here(self, fix: Fix, copy: Path) -> bool:
        return fix.span is not None and fix.span.file == str(copy)

    def _edits(self, fix: Fix, text: Editable) -> Iterator[Edit]:
        edits = fix.edit(text)
        if not edits:
            raise CannotEdit("nothing in the text was found to be changed")
        yield from edits

    def _tried(self, state: _State, fixes: Sequence[Fix], edits: Sequence[Edit]) -> _State:
        try:
            new = self.read(applied(state.text, edits))
        except (BadInput, UnicodeEncodeError):
            raise CannotEdit("the text could not be read any more") from None
        left = {(fix.code, fix.message) for fix in new.fixes}
        if any((fix.code, fix.message) in left for fix in fixes):
            raise CannotEdit("the change to the text had no effect")
        if all(fix.is_safe for fix in fixes) and new.errors() - state.errors():
            raise CannotEdit("there would be errors that are not there now")
        return new


def editable(text: str) -> Editable:
    """Return the text as RDF/XML or as Manchester syntax. Raises CannotEdit if it is XML with mistakes, or Turtle."""
    match syntax_of_text(text, "the recipe"):
        case Syntax.RDFXML:
            return XmlText(text)
        case Syntax.MANCHESTER:
            return ManchesterText(text)
        case Syntax.TURTLE:
            raise CannotEdit("Turtle is not edited; planlang convert writes it in another syntax")


def _encoding(content: bytes, text: str) -> str:
    for encoding in _ENCODINGS:
        try:
            if text.encode(encoding) == content:
                return encoding
        except UnicodeEncodeError:
            continue
    raise BadInput([error("O004", "the file is in an encoding that is read but not written", help="save it as UTF-8")])
