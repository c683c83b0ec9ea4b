"""What the command writes: complete files or none, and never over what a person wrote."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from types import MappingProxyType

from planlang.diagnostics import BadInput, Diagnostic, error
from planlang.plan_header import header


def check_outputs(
    outputs: Mapping[str, Path | None],
    inputs: Mapping[str, Path | None],
    pictures: Mapping[str, Path | None] = MappingProxyType({}),
) -> list[Diagnostic]:
    """What would keep the files from being written, found before the work starts.

    All map what the user calls a file (``--trace``) to its path, or to None when not asked for; ``pictures`` are
    outputs that are PNG files.
    """
    problems: list[Diagnostic] = []
    taken = {path.resolve(): name for name, path in inputs.items() if path is not None}
    for name, path in {**pictures, **outputs}.items():
        if path is None:
            continue
        folder = path.parent
        if name in pictures and path.suffix.lower() not in ("", ".png"):
            advice = f"name it {path.with_suffix('.png').name}"
            problems.append(error("C004", f"{name} {path}: pictures are written as PNG", help=advice))
        elif path.is_dir():
            problems.append(error("C004", f"{name} {path} is a folder", help="name a file in it"))
        elif not folder.is_dir():
            problems.append(error("C004", f"{name} {path}: there is no folder {folder}", help=f"mkdir -p {folder}"))
        elif _is_device(path):
            if not os.access(path, os.W_OK):
                problems.append(error("C004", f"{name} {path} cannot be written to"))
        elif not os.access(folder, os.W_OK):
            problems.append(error("C004", f"{name} {path}: the folder {folder} cannot be written to"))
        elif path.resolve() in taken:
            other = taken[path.resolve()]
            problems.append(error("C004", f"{name} {path} would overwrite {other}", help=f"give {name} another name"))
        else:
            taken[path.resolve()] = name
    return problems


def replace(path: Path, write: Callable[[Path], None]) -> None:
    """Let ``write`` fill a temporary file beside ``path``, then put it in place; on any failure ``path`` is as before.

    The temporary file keeps the suffix of ``path``, which some writers choose the format by. A link is followed; what
    is no file but a device or a pipe gets the content when it is complete.
    Raises BadInput when the system does not let the file be written.
    """
    temporary: Path | None = None
    try:
        device = _is_device(path)
        path = path if device else path.resolve()
        folder = None if device else path.parent
        number, temporary_name = tempfile.mkstemp(prefix=f".{path.stem}-", suffix=path.suffix, dir=folder)
        os.close(number)
        temporary = Path(temporary_name)
        write(temporary)
        if device:
            path.write_bytes(temporary.read_bytes())
            return
        temporary.chmod(path.stat().st_mode & 0o777 if path.exists() else 0o666 & ~_umask())
        temporary.replace(path)
    except OSError as problem:
        raise BadInput([error("C004", f"{path} cannot be written: {problem.strerror or problem}")]) from None
    finally:
        if temporary is not None:
            with suppress(OSError):
                temporary.unlink(missing_ok=True)


def write_text(path: Path, text: str) -> None:
    """Write a whole text file, or leave the old one as it was."""
    replace(path, lambda temporary: _write(temporary, text))


def write_plan(path: Path, source: str, *, force: bool) -> None:
    """Write a compiled plan, unless that would lose a person's work.

    What is no compiled plan, or one that was edited since, is refused without ``force``. Raises BadInput for that.
    """
    if path.exists() and not force:
        try:
            old = path.read_text(encoding="utf-8")
        except (OSError, ValueError):
            old = "unreadable"
        if old == source:
            return
        before = header(old)
        if before is None and old.strip():
            advice = "--force overwrites it"
            raise BadInput([error("C005", f"{path} is there and is not a compiled plan", help=advice)])
        if before is not None and before.is_edited(old):
            advice = f"planlang check {path} shows what was edited; --force overwrites it; -o writes somewhere else"
            raise BadInput([error("C005", f"{path} was edited since it was compiled", help=advice)])
    write_text(path, source)


def _is_device(path: Path) -> bool:
    return path.exists() and not path.is_file() and not path.is_dir()


def _write(path: Path, text: str) -> None:
    path.write_text(text, encoding="utf-8", newline="\n")


def _umask() -> int:
    umask = os.umask(0)
    os.umask(umask)
    return umask
