"""What the user named on the command line: a bundled thing or a file, and which kind of file by its content."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path

from planlang.diagnostics import BadInput, Span, error
from planlang.plan_header import PlanHeader, header
from planlang.resources import bundled

SUFFIXES = (".omn", ".owl", ".ttl", ".owl.in", ".toml")
"""Suffixes that a bundled thing may have; a user's own file may have any."""

LARGEST_PLAN = 10_000_000
"""Bytes of a plan that are read at most; recipes are bounded by their own reader."""


@dataclass(frozen=True, slots=True)
class PlanFile:
    """A plan's source, parsed but never executed. ``header`` is None when a person wrote the plan."""

    path: Path
    source: str
    header: PlanHeader | None


@dataclass(frozen=True, slots=True)
class RecipeFile:
    """A file that holds a recipe, as far as its first characters tell."""

    path: Path

    @property
    def is_bundled(self) -> bool:
        """True if the recipe came with planlang."""
        return self.path.resolve().is_relative_to(bundled("recipes").resolve())


def names(folder: Path) -> tuple[str, ...]:
    """Names of the bundled things in a folder, without suffixes, sorted."""
    found = {path.name.removesuffix(suffix) for suffix in SUFFIXES for path in folder.glob(f"*{suffix}")}
    return tuple(sorted(found))


def find(what: str, name: str, folder: Path) -> Path:
    """The file called ``name``: an existing path, or the name of a bundled ``what`` in ``folder``.

    Raises BadInput when there is none, naming the bundled ones.
    """
    if not name.strip():
        raise BadInput([error("C001", f"the name of the {what} is empty", help=_advice(what, names(folder)))])
    path = Path(name)
    try:
        if path.is_file():
            return path
        is_folder = path.is_dir()
        is_stream = name == "-" or (path.exists() and not is_folder)
    except (OSError, ValueError) as problem:  # a name too long, or with a null character
        raise BadInput([error("C001", f"no {what} can be read at {name[:80]!r}: {problem}")]) from None
    if path.name == name:
        for suffix in SUFFIXES:
            candidate = folder / f"{name}{suffix}"
            if candidate.is_file():
                return candidate
    if is_folder:
        raise BadInput([error("C001", f"{name} is a folder", help=f"name the {what}'s file in it")])
    if is_stream:
        why = f"{name} is no file: the {what} is read more than once, which a pipe or a device cannot be"
        raise BadInput([error("C001", why, help=f"write it to a file, and name that: ... > {what}.owl")])
    known = names(folder)
    similar = get_close_matches(name, known, n=1)
    guess = f"did you mean {similar[0]}? " if similar else ""
    raise BadInput([error("C001", f"no such {what}: {name}", help=guess + _advice(what, known))])


def _advice(what: str, known: Sequence[str]) -> str:
    return f"give the path of a file, or the name of a bundled {what}: {', '.join(known) or 'there is none'}"


def read(name: str) -> PlanFile | RecipeFile:
    """The plan or recipe that the user named; its kind is told by its content, never by its suffix.

    Raises BadInput when there is no such file, it cannot be read, or it is neither.
    """
    path = find("recipe", name, bundled("recipes"))
    try:
        with path.open("rb") as file:
            content = file.read(LARGEST_PLAN + 1)
    except OSError as problem:
        raise BadInput([error("C001", f"{name} cannot be read: {problem.strerror}")]) from None
    text = content.decode("utf-8", errors="replace").lstrip("\ufeff")
    if _starts_like_owl(text) or _is_utf16(content):
        return RecipeFile(path)
    return _plan(path, text, is_whole=len(content) <= LARGEST_PLAN)


def recipe_of(plan: Path, origin: PlanHeader, folders: Sequence[Path] = ()) -> Path | None:
    """The recipe that a plan's header names: the first beside the plan, in ``folders``, among the bundled ones."""
    for place in (plan.parent, *folders, bundled("recipes")):
        path = place / origin.recipe
        try:
            if path.is_file():
                return path
        except (OSError, ValueError):  # a name too long, or with a null character
            return None
    return None


def _is_utf16(content: bytes) -> bool:
    return content[:2] in (b"\xff\xfe", b"\xfe\xff")


_OWL_START = re.compile(
    r"(<|@prefix\b|@base\b|PREFIX\b|BASE\b|(Prefix|Ontology|Namespace|Import|Individual|Class)\s*:)"
)
_PYTHON_START = re.compile(
    r"""("{3}|'{3}|["']|@\w|\w+\s*=|(from|import|async|def|class|if|try|for|while|with|raise|assert)\b)"""
)


def _starts_like_owl(text: str) -> bool:
    """True for RDF/XML, Manchester syntax, Turtle, and whatever is not Python: their reader says what is wrong."""
    for line in text.splitlines():
        line = line.strip()
        if line and not line.startswith("#"):
            return _OWL_START.match(line) is not None or _PYTHON_START.match(line) is None
    return True


def _plan(path: Path, text: str, *, is_whole: bool) -> PlanFile:
    if not is_whole:
        raise BadInput([error("C002", f"this plan is larger than {LARGEST_PLAN // 1_000_000} MB", Span(str(path)))])
    try:
        module = ast.parse(text)
    except (SyntaxError, ValueError, RecursionError, MemoryError) as problem:
        line = getattr(problem, "lineno", None) or 1
        column = getattr(problem, "offset", None) or 1
        reason = getattr(problem, "msg", None) or str(problem)
        advice = "a plan is Python source; a recipe starts with an XML declaration, Prefix: or Ontology:"
        found = error("C002", f"neither a recipe nor a plan: {reason}", Span(str(path), line, column), advice)
        raise BadInput([found]) from None
    if not _imports_planlang(module.body):
        advice = "a plan imports its constructs: from planlang import plan, perform, ..."
        raise BadInput(
            [error("C003", "Python source that is no plan: it never imports planlang", Span(str(path)), advice)]
        )
    return PlanFile(path, text, header(text))


def _imports_planlang(statements: Iterable[ast.stmt]) -> bool:
    for statement in statements:
        match statement:
            case ast.ImportFrom(module=str(module)) if module.split(".")[0] == "planlang":
                return True
            case ast.Import(names=aliases) if any(alias.name.split(".")[0] == "planlang" for alias in aliases):
                return True
    return False
