"""Recipes and plans as given to the library: a bundled name, a path, a text, or a compiled plan."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import replace

from executive.commands.inputs import starts_like_owl
from planlang.compiler import CompiledPlan
from planlang.diagnostics import BadInput, Diagnostic, error
from planlang.records import dataclass
from planlang.temporary import process_folder

Source = str | os.PathLike[str] | CompiledPlan
"""Name of a bundled recipe, path of a recipe or plan, its text (several lines), or a compiled plan."""


@dataclass(frozen=True, slots=True)
class SourceFile:
    """File of a source; the file of a text lives as long as the process, so that results can repeat the run."""

    path: str | None
    """None without a source: the trace to resume names its plan."""
    name: str | None = None
    """Name of the file of a text in diagnostics."""

    def located(self, diagnostics: Iterable[Diagnostic]) -> tuple[Diagnostic, ...]:
        """Replace the temporary path of a text in diagnostics by its name."""
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
    """Yield the file of a source; BadInput raised in the block names it. Raises BadInput for an invalid source."""
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
    """Write a text to a folder of its own; equal texts share a file."""
    content = text.encode("utf-8", "surrogatepass")
    folder = process_folder() / hashlib.sha256(content).hexdigest()
    folder.mkdir(exist_ok=True)
    path = folder / name
    path.write_bytes(content)
    return SourceFile(str(path), name)
