"""Writing files: completely or not at all, and never over a file that planlang did not write.

Every output carries a mark near its start or end: plans their header, traces their first record, pictures a text chunk
(PNG) or a comment (SVG, DOT, Mermaid), videos their metadata. A file with the mark may be replaced; any other needs
``--force``.

The header of a plan is its first docstring: its origin, the compiler's options, and a digest that reveals edits::

    Compiled by planlang 0.1.0 from serve_a_drink.omn (sha256 7b3a...), task ServeADrink.
    Compiled with --no-scopes.
    What follows has sha256 91c0... unless it was edited.

The digest covers everything after the docstring, with line feeds as line ends, whatever the file has.
"""

from __future__ import annotations

import hashlib
import os
import re
import tempfile
import zlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path

from planlang.diagnostics import BadInput, Diagnostic, error
from planlang.files import bundled, from_printable
from planlang.records import dataclass
from planlang.shell import quoted
from planlang.visible import meant

MARK = "written by planlang"
_TRACE = b'{"step": 0, "event": "header", "schema": '
_RECORDING, _APPLICATION = b"RRF", 200
"""First bytes of a recording, and the number of bytes in which the name of its writer must appear."""
_PNG = b"\x89PNG\r\n\x1a\n"
_RIFF, _WEBP = b"RIFF", b"WEBP"
PNG, PNG_OR_SVG, WEBP = (".png",), (".png", ".svg"), (".webp",)
"""Suffixes of pictures and videos."""
_TAIL = 200
"""Bytes at the end of an animated WebP that hold its mark."""
_AFTER_IHDR = 33
"""Bytes of a PNG up to the end of its first chunk: signature (8), and IHDR with 13 bytes of data (12 + 13)."""
_COMMENTS = {".svg": "<!-- {} -->", ".dot": "// {}", ".gv": "// {}", ".mmd": "%% {}"}
"""Comment syntax of graph formats, by suffix."""


def check_outputs(
    outputs: Mapping[str, Path | None],
    inputs: Mapping[str, Path | None],
    *,
    formats: Mapping[str, Sequence[str]] | None = None,
    force: bool = False,
) -> list[Diagnostic]:
    """Find problems with output files before the work starts.

    ``outputs`` and ``inputs`` map options (``--trace``) to paths, or to None if not given. ``formats`` restricts the
    suffixes of some outputs; the first is the default. ``force`` allows replacing files that planlang did not write,
    but never inputs.
    """
    problems: list[Diagnostic] = []
    taken = {_real(path): name for name, path in inputs.items() if path is not None}
    for name, path in outputs.items():
        if path is None:
            continue
        problem = _problem(name, path, taken, (formats or {}).get(name, ()), force=force)
        if problem is not None:
            problems.append(problem)
        else:
            taken[_real(path)] = name
    return problems


def _problem(
    name: str, path: Path, taken: Mapping[Path, str], suffixes: Sequence[str], *, force: bool
) -> Diagnostic | None:
    folder = path.parent
    if suffixes and path.suffix.lower() not in ("", *suffixes):
        known = " or ".join(suffix[1:].upper() for suffix in suffixes).replace("WEBP", "WebP")
        what = "videos" if suffixes == WEBP else "pictures"
        return error("C004", f"{name} {path}: {what} are written as {known}", help=f"name it {path.stem}{suffixes[0]}")
    if path.is_dir():
        return error("C004", f"{name} {path} is a folder", help="name a file in it")
    if not folder.is_dir():
        return error("C004", f"{name} {path}: there is no folder {folder}", help=f"mkdir -p {folder}")
    if _real(path) in taken and not is_device(path):
        return error("C004", f"{name} {path} would overwrite {taken[_real(path)]}", help=f"give {name} another name")
    if is_device(path):
        return None if os.access(path, os.W_OK) else error("C004", f"{name} {path} cannot be written to")
    if path.is_symlink() and not path.exists() and _real(path) == path.absolute():
        return error("C004", f"{name} {path} is a link that leads back to itself", help=f"give {name} another name")
    if not os.access(_real(path).parent, os.W_OK):
        return error("C004", f"{name} {path}: the folder {folder} cannot be written to")
    if not force and not is_replaceable(path):
        return error("C005", f"{name} {path} exists and was not written by planlang", help="--force overwrites it")
    return None


def is_replaceable(path: Path) -> bool:
    """Check that writing to a path loses nothing: no file, an empty file, a device, or a file with the mark.

    At most 10,000 bytes are read, and nothing from devices and pipes, which may never end.
    """
    if not path.is_file():
        return True
    try:
        with path.open("rb") as file:
            start = file.read(LONGEST)
            if start.startswith(_RIFF) and start[8:12] == _WEBP:
                file.seek(max(0, path.stat().st_size - _TAIL))
                return MARK.encode() in file.read(_TAIL)
    except OSError:
        return False
    if not start.strip() or start.startswith(_TRACE):
        return True
    if start.startswith(_RECORDING):
        return b"planlang" in start[:_APPLICATION]
    if start.startswith(_PNG):
        return MARK.encode() in start[_AFTER_IHDR : _AFTER_IHDR + 100]
    text = start.decode("utf-8", errors="replace")
    return any(MARK in line for line in text.split("\n", 2)[:2]) or header(text) is not None


def replace(path: Path, write: Callable[[Path], object]) -> None:
    """Let ``write`` fill a temporary file beside ``path``, then rename it; after a failure ``path`` is unchanged.

    The temporary file keeps the suffix of ``path``, from which some writers infer the format; a PNG gets its mark.
    Links are followed. A device or pipe receives the content once it is complete.
    Raises BadInput if the file cannot be written.
    """
    temporary: Path | None = None
    try:
        device = is_device(path)
        path = path if device else path.resolve()
        folder = None if device else path.parent
        number, temporary_name = tempfile.mkstemp(prefix=f".{path.stem}-", suffix=path.suffix, dir=folder)
        os.close(number)
        temporary = Path(temporary_name)
        write(temporary)
        _mark_png(temporary)
        if device:
            path.write_bytes(temporary.read_bytes())
            return
        temporary.chmod(path.stat().st_mode & 0o777 if path.exists() else 0o666 & ~_umask())
        temporary.replace(path)
    except (OSError, RuntimeError) as problem:  # RuntimeError: a loop of links
        if isinstance(problem, RuntimeError) and "loop" not in str(problem):
            raise
        reason = getattr(problem, "strerror", None) or problem
        raise BadInput([error("C004", f"{path} cannot be written: {reason}")]) from None
    finally:
        if temporary is not None:
            with suppress(OSError):
                temporary.unlink(missing_ok=True)


def write_text(path: Path, text: str) -> None:
    """Write a text file, whole or not at all; graphs get their mark as a comment."""
    comment = _COMMENTS.get(path.suffix.lower())
    first, newline, rest = text.partition("\n")
    whole = text if comment is None else f"{first}\n{comment.format(MARK)}{newline}{rest}"
    replace(path, lambda temporary: temporary.write_text(whole, encoding="utf-8", newline="\n"))


def write_plan(path: Path, source: str, *, force: bool) -> None:
    """Write a compiled plan, unless that would overwrite hand-written work.

    Without ``force``, raises BadInput for a file that is not a compiled plan or was edited since.
    """
    if path.is_file() and not force:
        try:
            # a bounded read suffices to see whether the old plan is the same
            with path.open(encoding="utf-8", errors="replace", newline="") as file:
                old = file.read(max(len(source), LONGEST) * 2 + 1)
        except OSError as problem:
            raise BadInput([error("C004", f"{path} cannot be read: {problem.strerror}")]) from None
        if old == source:
            return
        before = header(old)
        if before is None and old.strip():
            raise BadInput([error("C005", f"{path} is not a compiled plan", help="--force overwrites it")])
        if before is not None and before.is_edited(old):
            advice = (
                f"--merge keeps the edits; planlang check {quoted(path)} shows them; --force overwrites them; "
                "-o writes to another file"
            )
            raise BadInput([error("C005", f"{path} was edited since it was compiled", help=advice)])
    write_text(path, source)


def _mark_png(path: Path) -> None:
    with path.open("r+b") as file:
        if file.read(len(_PNG)) != _PNG:
            return
        file.seek(0)
        content = file.read()
        chunk = b"tEXt" + b"Software\x00" + MARK.encode()
        length, check = (len(chunk) - 4).to_bytes(4, "big"), zlib.crc32(chunk).to_bytes(4, "big")
        file.seek(_AFTER_IHDR)
        file.write(length + chunk + check + content[_AFTER_IHDR:])


def is_device(path: Path) -> bool:
    """Check for a device or pipe: a path that exists and is neither file nor folder."""
    return path.exists() and not path.is_file() and not path.is_dir()


def _real(path: Path) -> Path:
    try:
        return path.resolve()
    except (OSError, RuntimeError):  # a loop of links stays as it is
        return path.absolute()


def _umask() -> int:
    umask = os.umask(0)
    os.umask(umask)
    return umask


LARGEST_PLAN = 10_000_000
"""Largest plan that is read [bytes]."""

LONGEST = 10_000
"""Characters at the start of a plan that are searched for its header."""

DIGITS = 16
"""Digits of the recipe's digest in the header: enough to notice a changed recipe."""

NO_SCOPES, NO_DATA_FLOW = "--no-scopes", "--no-dataflow"

_HEADER = re.compile(
    r"Compiled by planlang (?P<version>\S+) from (?P<recipe>.+?) \(sha256 (?P<sha256>[0-9a-f]{8,64})[.…]*\),"
    r" task (?P<task>\S+?)\.?(\s|$)(Compiled with (?P<options>[-a-z ]+)\. )?"
    r"(What follows has sha256 (?P<digest>[0-9a-f]{64}) unless)?"
)


@dataclass(frozen=True, slots=True)
class PlanHeader:
    """The origin of a plan."""

    version: str
    recipe: str
    """File name of the recipe, without its folder."""
    sha256: str
    """Digest of the recipe's bytes, or its first digits."""
    task: str
    options: tuple[str, ...] = ()
    """Compiler options that shape the plan, without the task."""
    digest: str | None = None
    """Digest of the plan as compiled, without the docstring; None if the header has none."""

    def matches(self, content: bytes) -> bool:
        """Check whether the plan was compiled from a recipe with this content."""
        return hashlib.sha256(content).hexdigest().startswith(self.sha256)

    def is_edited(self, source: str) -> bool:
        """Check whether the plan was edited since it was compiled; True if the header has no digest."""
        return self.digest != digest(source)

    def find_recipe(self, plan: Path, folders: Iterable[Path] = ()) -> Path | None:
        """Find the recipe by its file name: beside the plan, then in ``folders``, then among the bundled ones."""
        names = dict.fromkeys((self.recipe, from_printable(self.recipe)))
        for path in (folder / name for folder in (plan.parent, *folders, bundled("recipes")) for name in names):
            try:
                if path.is_file():
                    return path
            except (OSError, ValueError):  # a name too long, or with a null character
                return None
        return None

    def paragraphs(self) -> list[str]:
        """Return the header as lines of the docstring."""
        origin = f"{self.recipe} (sha256 {self.sha256[:DIGITS]})"
        lines = [f"Compiled by planlang {self.version} from {origin}, task {self.task}."]
        lines += [f"Compiled with {' '.join(self.options)}."] if self.options else []
        lines += [f"What follows has sha256 {self.digest} unless it was edited."] if self.digest else []
        return lines


def digest(source: str) -> str:
    """Compute the sha256 of a plan's source after its docstring; of all of it if there is none."""
    parts = source.split('"""', 2)
    text = "\n".join(parts[-1].splitlines())
    return hashlib.sha256(text.encode("utf-8", errors="surrogatepass")).hexdigest()


def header(source: str) -> PlanHeader | None:
    """Read the header of a plan's source, which need not be valid Python; None if there is none."""
    found = _HEADER.search(" ".join(source[:LONGEST].split()))
    if found is None:
        return None
    options = tuple((found["options"] or "").split())
    recipe = meant(found["recipe"])
    return PlanHeader(found["version"], recipe, found["sha256"], found["task"], options, found["digest"])
