"""Recipes and plans as users of the library name them: bundled name, path, text, or what was compiled."""

from __future__ import annotations

import atexit
import hashlib
import os
import shutil
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import cache
from pathlib import Path

from executive.commands.inputs import starts_like_owl
from planlang.compiler import CompiledPlan
from planlang.diagnostics import BadInput, Diagnostic, error
from planlang.records import dataclass

Source = str | os.PathLike[str] | CompiledPlan
"""The name of a bundled recipe, the path of a recipe or plan, its text (of several lines), or a compiled plan."""


@dataclass(frozen=True, slots=True)
class SourceFile:
    """The file of a source: for a text one that lasts as long as the process, so that results can repeat the run."""

    path: str | None
    """None if there is no source: a trace names its plan."""
    name: str | None = None
    """What diagnostics call the file of a text."""

    def located(self, diagnostics: Iterable[Diagnostic]) -> tuple[Diagnostic, ...]:
        """Return diagnostics about the file of a text by its name, without the temporary folder."""
        path, name = self.path, self.name
        if path is None or name is None:
            return tuple(diagnostics)
        return tuple(
            replace(
                one,
                message=one.message.replace(path, name),
                span=one.span._replace(file=name) if one.span is not None and one.span.file == path else one.span,
                help=None if one.help is None else one.help.replace(path, name),
            )
            for one in diagnostics
        )


@contextmanager
def file_of(source: Source | None) -> Iterator[SourceFile]:
    """Give the file of a source; what is wrong inside the block is located in it. Raises BadInput for what is none."""
    file = _file(source)
    try:
        yield file
    except BadInput as problem:
        raise BadInput(file.located(problem.diagnostics)) from None


def _file(source: Source | None) -> SourceFile:
    if source is None:
        return SourceFile(None)
    if isinstance(source, CompiledPlan):
        return _written(source.source, f"{source.functions[-1]}.py")
    if isinstance(source, str) and "\n" in source:
        return _written(source, "recipe.omn" if starts_like_owl(source) else "plan.py")
    if isinstance(source, (str, os.PathLike)):
        return SourceFile(os.fspath(source))
    advice = "write the name of a bundled recipe, a path, or the text"
    raise BadInput([error("C040", f"{source!r} is neither a recipe nor a plan", help=advice)])


def _written(text: str, name: str) -> SourceFile:
    """Write a text into a folder of its own: equal texts have one file."""
    content = text.encode("utf-8", "surrogatepass")
    folder = _folder() / hashlib.sha256(content).hexdigest()
    folder.mkdir(exist_ok=True)
    path = folder / name
    path.write_bytes(content)
    return SourceFile(str(path), name)


@cache
def _folder() -> Path:
    folder = tempfile.mkdtemp(prefix="planlang-")
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return Path(folder)
