"""Input files: robots, maps, recipes and plans; a plan is parsed, never executed."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterable, Sequence
from pathlib import Path

from executive.options.declaring import Name
from executive.options.running import Source
from planlang.advice import Change, changes_in
from planlang.diagnostics import BadInput, Diagnostic, Span, error, has_errors, note
from planlang.files import Bundled, decode, encoding_of, open_regular, read_at_most, read_file
from planlang.language.source import PlanSource
from planlang.outputs import LARGEST_PLAN
from planlang.plan_versions import has_conflicts, unresolved
from planlang.records import dataclass
from planlang.words import Blank, Option, Text, calling


def chosen(
    kind: Bundled, given: Name | None, default: str | None, problems: list[Diagnostic], *, needs: str = "this plan"
) -> Path | None:
    """Find the file of a robot or environment by its name, or the default; appends errors to ``problems``."""
    if given is None and default is None:
        advice = Text("add ", Option(kind.value, Blank("FILE")), f", or a bundled one: {', '.join(kind.names())}")
        problems.append(error("C008", Text(f"{needs} needs ", Option(kind.value)), help=advice))
        return None
    try:
        return kind.find(os.fspath(given) if given is not None else default or "")
    except BadInput as bad:
        problems.extend(bad.diagnostics)
        return None


def folders_beside(name: object) -> list[Diagnostic]:
    """Note that ``name`` means a bundled file although there is a folder of that name; empty otherwise."""
    kind = Bundled.of(name) if isinstance(name, str) and os.path.isdir(name) else None
    return [note("C001", f"{name} is a folder, too; this is the bundled {kind.value}")] if kind is not None else []


def environments(given: Sequence[Name | None] | None, problems: list[Diagnostic]) -> tuple[Path, ...]:
    """Find the files of environments; appends errors to ``problems``."""
    paths = (chosen(Bundled.ENVIRONMENT, name, None, problems) for name in given or ())
    return tuple(path for path in paths if path is not None)


def read_changes(file: Path) -> tuple[Change, ...]:
    """Read what a failed run advises to change. Raises BadInput for another file."""
    try:
        return changes_in(json.loads(decode(read_file(file), str(file))))
    except (ValueError, RecursionError) as problem:
        advice = Text("write the JSON of a failed run into it: ", Option("json", True))
        raise BadInput([error("C025", f"no changes to apply: {problem}", Span(str(file)), advice)]) from None


def check_files(problems: list[Diagnostic], **files: Path | Sequence[Path] | None) -> None:
    """Append an error for each file that does not exist or is not a regular file."""
    for name, given in files.items():
        for path in [given] if isinstance(given, Path) else given or ():
            try:
                is_file = path.is_file()
            except (OSError, ValueError):  # a null character, or too long a name
                is_file = False
            if not is_file:
                what = "URDF file" if name == "urdf" else "file"
                problems.append(error("C001", Text(f"no such {what}: ", Option(name, path))))


def check_trusted(problems: list[Diagnostic], programs: Iterable[Path], *, trust: bool) -> None:
    """Append an error for each program that was pulled from a server, unless the user trusts it.

    A pulled program is recognised by its path, and a copy by its content.
    """
    programs = tuple(programs)
    if trust or not programs:
        return
    from planlang.knowledge.pulled import origin_of  # slow, and most commands run no program

    for path in programs:
        if path.is_file() and (origin := origin_of(path)) is not None:
            advice = Text("it can do whatever you can: read it, then add ", Option("trust", True))
            problems.append(error("K038", f"this program was pulled from a server: {origin}", Span(str(path)), advice))


def refuse(problems: Sequence[Diagnostic]) -> None:
    """Raise BadInput if there are errors among the problems."""
    if has_errors(problems):
        raise BadInput(problems)


def accepted(codes: Sequence[str] | None) -> tuple[str, ...]:
    """Check the codes of fixes to accept. Raises BadInput for a code without an uncertain fix."""
    refuse(unacceptable(codes or ()))
    return tuple(codes or ())


def unacceptable(codes: Sequence[str]) -> list[Diagnostic]:
    """Errors for codes without an uncertain fix."""
    if not codes:
        return []
    from planlang.recipe.fixes import ACCEPTABLE, SAFE, WITHOUT  # slow, and most recipes are not fixed

    errors: list[Diagnostic] = []
    listed = f"codes with uncertain fixes: {', '.join(ACCEPTABLE)}"
    for code in (one for one in codes if one not in ACCEPTABLE):
        advice = listed
        if code in SAFE:
            advice = Text(f"fixes of {code} are safe: ", Option("fix", True), f" applies them; {listed}")
        elif code in WITHOUT:
            advice = Text(f"{code} has no fix: ", WITHOUT[code], f"; {listed}")
        message = Text(Option("accept", code), f": there is no uncertain fix of {code}")
        errors.append(error("C015", message, help=advice))
    return errors


@dataclass(frozen=True, kw_only=True)
class WorldFiles:
    """What states the true world: maps, or else those of the environment, and changes of them."""

    maps: tuple[Path, ...] = ()
    lists: tuple[Path, ...] = ()
    """Files of changes, in JSON."""

    @property
    def files(self) -> tuple[Path, ...]:
        """All files."""
        return *self.maps, *self.lists

    @staticmethod
    def named(given: Sequence[Name], problems: list[Diagnostic]) -> WorldFiles | None:
        """Find what is named; None if nothing is. Appends errors to ``problems``."""
        lists = tuple(Path(one) for one in given if os.fspath(one).endswith(".json"))
        maps = environments([one for one in given if not os.fspath(one).endswith(".json")], problems)
        check_files(problems, world=lists)
        return WorldFiles(maps=maps, lists=lists) if given else None

    def changes(self) -> tuple[Change, ...]:
        """Read the changes. Raises BadInput for another file, and for changes of options."""
        found = tuple(one for file in self.lists for one in read_changes(file))
        if wrong := [one.what for one in found if one.thing is None]:
            message = f"the world has no option {wrong[0]}: state changes of things"
            raise BadInput([error("C025", message, Span(str(self.lists[0])))])
        return found


@dataclass(frozen=True, slots=True)
class RecipeFile:
    """File with a recipe, or its text in memory, judged by the first characters only."""

    path: Path
    """Of a text only a name."""
    content: bytes | None = None
    """The text; None for a file."""

    @property
    def folder(self) -> tuple[Path, ...]:
        """The folder of the file, where its imports may be; none for a text."""
        return (self.path.parent,) if self.content is None else ()

    def read(self) -> bytes:
        """Read the recipe. Raises OSError."""
        return self.path.read_bytes() if self.content is None else self.content

    @property
    def is_bundled(self) -> bool:
        """True if the recipe came with planlang."""
        return self.content is None and self.path.resolve().is_relative_to(Bundled.RECIPE.folder.resolve())


def programs(file: PlanSource | RecipeFile, modules: Sequence[Path] | None) -> tuple[Path, ...]:
    """Files that will be executed: a plan, and process modules."""
    plan = [file.path] if isinstance(file, PlanSource) and not file.is_in_memory else []
    return (*plan, *(modules or ()))


def read(source: Source) -> PlanSource | RecipeFile:
    """Read a plan or a recipe. Raises BadInput if it cannot be read, or is neither."""
    if isinstance(source, PlanSource):
        return source
    if not isinstance(source, str | os.PathLike):
        return source.plan_source
    name = os.fspath(source)
    if isinstance(source, str) and "\n" in source:
        if starts_like_owl(source):
            return RecipeFile(Path("recipe.omn"), source.encode("utf-8", "surrogatepass"))
        return _checked(PlanSource(source, "plan.py"))
    path = Bundled.RECIPE.find(name)
    try:
        with open_regular(path) as file:
            content = read_at_most(file, LARGEST_PLAN + 1)
    except OSError as problem:
        raise BadInput([error("C001", f"{name} cannot be read: {problem.strerror}")]) from None
    encoding = encoding_of(content)
    text = content.decode(encoding, errors="replace")
    if starts_like_owl(text):
        return RecipeFile(path)
    if encoding == "utf-16":  # Python reads no such source
        raise BadInput([error("C002", f"{path.name} is in UTF-16", Span(str(path)), "save it as UTF-8")])
    if "\ufffd" in text:
        decode(content, str(path))  # raises, unless the character is meant
    return _plan(path, text, content)


def read_recipe_file(source: Source) -> RecipeFile:
    """Find a recipe by its name, or take its text. Raises BadInput for a plan."""
    file = read(source)
    if isinstance(file, PlanSource):
        name = file.file if file.is_in_memory else source
        advice = Text(calling("check", name), " checks a plan, ", calling("run", name), " runs it")
        raise BadInput([error("C007", f"{name} is a plan, not a recipe", Span(file.file), advice)])
    return file


_OWL_START = re.compile(
    r"(<|@prefix\b|@base\b|PREFIX\b|BASE\b|(Prefix|Ontology|Namespace|Import|Individual|Class)\s*:)"
)
_PYTHON_START = re.compile(
    r"""("{3}|'{3}|["']|@\w|\w+\s*=|(from|import|async|def|class|if|try|for|while|with|raise|assert)\b)"""
)


def starts_like_owl(text: str) -> bool:
    """Check for a syntax of OWL, or anything but Python: the reader of ontologies then reports what is wrong."""
    for line in text.splitlines():
        line = line.strip()
        if line and not line.startswith("#"):
            return _OWL_START.match(line) is not None or _PYTHON_START.match(line) is None
    return True


def _plan(path: Path, text: str, content: bytes) -> PlanSource:
    if len(content) > LARGEST_PLAN:
        raise BadInput([error("C002", f"this plan is larger than {LARGEST_PLAN // 1_000_000} MB", Span(str(path)))])
    if has_conflicts(text):
        raise BadInput([unresolved(text, Span(str(path)))])
    return _checked(PlanSource(text, str(path), content))


def _checked(plan: PlanSource) -> PlanSource:
    if not plan.imports_planlang:
        advice = "a plan imports its constructs: from planlang import plan, perform, ..."
        message = "Python source, but not a plan: it does not import planlang"
        raise BadInput([error("C003", message, Span(plan.file), advice)])
    return plan
