"""Writing files: completely or not at all, and never over a file that planlang did not write.

Every output carries a mark near its start or end: plans their header, traces their first record, pictures a text chunk
(PNG) or a comment (SVG, DOT, Mermaid), JUnit a comment, videos and Parquet their metadata. A file with the mark may be
replaced; any other needs the option ``force``.

The header of a plan is its first docstring: its origin, the compiler's options, and a digest that reveals edits::

    Compiled by planlang 0.1.0 from serve_a_drink.omn (sha256 7b3a...), task ServeADrink.
    Compiled with --no-scopes.
    What follows has sha256 91c0... unless it was edited.

The digest covers everything after the docstring, with line feeds as line ends, whatever the file has.
"""

from __future__ import annotations

import errno
import hashlib
import io
import os
import re
import stat
import zlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import TypeVar

from planlang.diagnostics import BadInput, Diagnostic, error
from planlang.files import bundled, from_printable
from planlang.records import dataclass
from planlang.temporary import temporary_folder
from planlang.visible import meant
from planlang.words import Option, Text, calling

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
_PARQUET, _FOOTER = b"PAR1", 1_000_000
"""First and last bytes of a Parquet file, and the most bytes of its footer that are searched for the mark."""
_AFTER_IHDR = 33
"""Bytes of a PNG up to the end of its first chunk: signature (8), and IHDR with 13 bytes of data (12 + 13)."""
_COMMENTS = {".svg": "<!-- {} -->", ".dot": "// {}", ".gv": "// {}", ".mmd": "%% {}"}
"""Comment syntax of graph formats, by suffix."""


Named = str | Option
"""Name of an input or output in messages."""
K = TypeVar("K", bound=Named)
J = TypeVar("J", bound=Named)
OVERWRITES = Text(Option("force", True), " overwrites it")
"""Advice about a file that planlang did not write."""


def check_outputs(
    outputs: Mapping[K, Path | None],
    inputs: Mapping[J, Path | None],
    *,
    formats: Mapping[K, Sequence[str]] | None = None,
    force: bool = False,
) -> list[Diagnostic]:
    """Find problems with output files before the work starts.

    ``outputs`` and ``inputs`` map options, or other names, to paths, or to None if not given. ``formats`` restricts the
    suffixes of some outputs; the first is the default. ``force`` allows replacing files that planlang did not write,
    but never inputs.
    """
    problems: list[Diagnostic] = []
    taken: dict[Path, Named] = {_real(path): name for name, path in inputs.items() if path is not None}
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
    name: Named, path: Path, taken: Mapping[Path, Named], suffixes: Sequence[str], *, force: bool
) -> Diagnostic | None:
    folder = path.parent
    called = Text(Option(name.name, named(path))) if isinstance(name, Option) else f"{name} {named(path)}"
    if suffixes and path.suffix.lower() not in ("", *suffixes):
        known = " or ".join(suffix[1:].upper() for suffix in suffixes).replace("WEBP", "WebP")
        what = "videos" if suffixes == WEBP else "pictures"
        return error("C004", Text(called, f": {what} are written as {known}"), help=f"name it {path.stem}{suffixes[0]}")
    try:
        found = _found(path)
    except (OSError, ValueError) as problem:
        return unwritable(path, problem, called)
    if os.path.isdir(path):
        return error("C004", Text(called, " is a folder"), help="name a file in it")
    if not os.path.isdir(folder):
        return error("C004", Text(called, f": there is no folder {folder}"), help=f"mkdir -p {folder}")
    if _real(path) in taken and not is_device(path):
        message = Text(called, " would overwrite ", taken[_real(path)])
        return error("C004", message, help=Text("give ", name, " another name"))
    if is_device(path):
        return None if os.access(path, os.W_OK) else error("C004", Text(called, " cannot be written to"))
    if not os.access(folder, os.W_OK | os.X_OK):
        return error("C004", Text(called, f": the folder {folder} cannot be written to"))
    if force or found is None:
        return None
    if stat.S_ISLNK(found.st_mode):
        return _link(path, called)
    if not is_replaceable(path):
        return error("C005", Text(called, " exists and was not written by planlang"), help=OVERWRITES)
    return None


def _link(path: Path, called: str) -> Diagnostic:
    """Error for a link in place of an output: who put it there could have any file of the user overwritten."""
    target = named(Path(os.path.realpath(path)))
    advice = Text(f"name {target}, to which it points; ", Option("force", True), " replaces the link by a file")
    return error("C005", Text(called, " is a symbolic link, and no output is written through one"), help=advice)


def _found(path: Path) -> os.stat_result | None:
    """Status of a path, of a link itself; None if nothing is there. Raises OSError, ValueError for an impossible one.

    A part of the path that is a file, not a folder, is such a case.
    """
    try:
        return os.lstat(path)
    except FileNotFoundError:
        return None


_LONGEST_SHOWN = 100
"""Characters of a path in a message: a name can be too long for a file."""


def named(path: Path) -> str:
    """Path as messages name it: of a long one the ends."""
    text = str(path)
    half = _LONGEST_SHOWN // 2
    return text if len(text) <= _LONGEST_SHOWN else f"{text[:half]}...{text[-half:]}"


def unwritable(path: Path, problem: Exception, called: str | None = None) -> Diagnostic:
    """Error for a file that cannot be written, with what the user can do about it."""
    reason = getattr(problem, "strerror", None) or str(problem)
    number = getattr(problem, "errno", None)
    advice = ADVICE.get(number or 0)
    if number == errno.ENOTDIR:
        parts = [part for part in reversed((path, *path.parents)) if os.path.lexists(part) and not os.path.isdir(part)]
        reason = f"{named(parts[0])} is a file, not a folder" if parts else reason
    elif number == errno.ENOENT and is_folder_deleted():
        reason, advice = FOLDER_DELETED
    return error("C004", Text(called or named(path), f" cannot be written: {reason}"), help=advice)


FOLDER_DELETED = "the current folder was deleted", "change to a folder that is there: cd"
"""Reason and advice where relative paths lead nowhere."""


def is_folder_deleted() -> bool:
    """Check whether the current folder was deleted since this process began."""
    try:
        os.getcwd()
    except FileNotFoundError:
        return True
    return False


ADVICE = {
    errno.ENAMETOOLONG: "a name has at most 255 bytes, a path 4,095: shorten it",
    errno.ENOTDIR: "name a file in a folder",
    errno.EACCES: "write to a folder of yours, or change its permissions",
    errno.EPERM: "write to a folder of yours, or change its permissions",
    errno.EROFS: "write to another disk: this one can only be read",
    errno.ENOSPC: "free space on the disk, or write to another one",
    errno.EDQUOT: "your share of the disk is used up: delete files, or write to another disk",
    errno.EFBIG: "raise the limit of the size of files (ulimit -f), or write to another disk",
    errno.ELOOP: "name the file itself: no output is written through a symbolic link",
    errno.EMFILE: "raise the limit of open files (ulimit -n)",
}
"""Error numbers -> what the user can do if a file cannot be written."""


def is_replaceable(path: Path) -> bool:
    """Check that writing to a path loses nothing: no file, an empty file, a device, or a file with the mark.

    At most a million bytes are read, and nothing from devices and pipes, which may never end.
    """
    if not os.path.isfile(path) or is_device(path):
        return True
    try:
        with path.open("rb") as file:
            start = file.read(LONGEST)
            if start.startswith(_RIFF) and start[8:12] == _WEBP:
                file.seek(max(0, path.stat().st_size - _TAIL))
                return MARK.encode() in file.read(_TAIL)
            if start.startswith(_PARQUET):
                file.seek(max(0, path.stat().st_size - _FOOTER))
                return MARK.encode() in file.read(_FOOTER)
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
    """Let ``write`` fill a file of the same name in a hidden folder beside ``path``, then rename it to ``path``.

    After a failure ``path`` is unchanged. The suffix is that of ``path``, as some writers infer the format from it; a
    PNG gets its mark. No link is followed: it is replaced itself. A device or pipe receives the content once it is
    complete. Raises BadInput if the file cannot be written.
    """
    try:
        device = is_device(path)
        with temporary_folder(None if device else path.parent) as folder:
            temporary = folder / (path.name or "output")
            write(temporary)
            _mark_png(temporary)
            if device:
                with open_device(path) as file:
                    write_all(file, temporary.read_bytes())
                return
            before = _found(path)
            if before is not None and stat.S_ISREG(before.st_mode):
                temporary.chmod(before.st_mode & 0o777)
            temporary.replace(path)
    except OSError as problem:
        raise BadInput([unwritable(path, problem)]) from None
    except ValueError as problem:
        if not _is_impossible(path):
            raise
        raise BadInput([unwritable(path, problem)]) from None


def write_all(file: io.FileIO, content: bytes) -> None:
    """Write bytes to an unbuffered file, in parts if a nearly full disk requires it. Raises OSError."""
    while content:
        content = content[file.write(content) :]


def open_output(path: Path) -> io.FileIO:
    """Open a file that is written piece by piece: a new one, or a device. Raises OSError.

    A file or link that is there has to be renamed before: none is overwritten, and no link is followed.
    """
    if is_device(path):
        return open_device(path)
    return io.FileIO(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o666), "w")


def open_device(path: Path) -> io.FileIO:
    """Open a device or pipe for writing; one of this process's own streams is shared. Raises OSError."""
    own = _own_stream(path)
    # a stream may be a file: opened by its name, it would be written from its beginning
    return io.FileIO(os.open(path, os.O_WRONLY | os.O_CLOEXEC) if own is None else os.dup(own), "w")


def beside(path: Path, suffix: str, before: str = "") -> Path:
    """Path beside another one whose name is extended, and shortened if it would be too long for a file."""
    stem = os.fsencode(path.name)[: _LONGEST_NAME - len(os.fsencode(suffix)) - len(os.fsencode(before))]
    return path.with_name(f"{before}{os.fsdecode(stem)}{suffix}")


_LONGEST_NAME = 255
"""Maximum length of a file name [bytes], of all file systems in use."""


def make_folder(folder: Path) -> None:
    """Make a folder for outputs, with those above it, unless it is there. Raises BadInput."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except (OSError, ValueError) as problem:
        if isinstance(problem, FileExistsError):
            problem = NotADirectoryError(errno.ENOTDIR, os.strerror(errno.ENOTDIR))
        raise BadInput([unwritable(folder, problem)]) from None


def write_text(path: Path, text: str) -> None:
    """Write a text file, whole or not at all; graphs get their mark as a comment, half characters become escapes."""
    comment = _COMMENTS.get(path.suffix.lower())
    first, newline, rest = text.partition("\n")
    whole = text if comment is None else f"{first}\n{comment.format(MARK)}{newline}{rest}"
    replace(path, lambda temporary: temporary.write_bytes(whole.encode(errors="backslashreplace")))


def write_plan(path: Path, source: str, *, force: bool) -> None:
    """Write a compiled plan, unless that would overwrite hand-written work.

    Without ``force``, raises BadInput for a file that is not a compiled plan or was edited since.
    """
    if not force and path.is_symlink() and not is_device(path):
        raise BadInput([_link(path, named(path))])
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
            raise BadInput([error("C005", f"{path} is not a compiled plan", help=OVERWRITES)])
        if before is not None and before.is_edited(old):
            advice = Text(
                Option("merge", True), " keeps the edits; ", calling("check", path), " shows them; ",
                Option("force", True), " overwrites them; ", Option("output"), " writes to another file",
            )  # fmt: skip
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
    """Check for a device or pipe: a path that exists and is neither file nor folder, or a stream of this process."""
    try:
        mode = os.stat(path).st_mode
    except (OSError, ValueError):
        return False
    return not (stat.S_ISREG(mode) or stat.S_ISDIR(mode)) or _own_stream(path) is not None


_STREAM = re.compile(r"/dev/(?:(stdin|stdout|stderr)|fd/(\d+))|/proc/(?:self|thread-self)/fd/(\d+)")
_STREAMS = ("stdin", "stdout", "stderr")


def _own_stream(path: Path) -> int | None:
    """Descriptor of a stream of this process that a path names, such as /dev/stdout; None for other paths."""
    match = _STREAM.fullmatch(os.path.normpath(path))
    if match is None:
        return None
    return _STREAMS.index(match[1]) if match[1] else int(match[2] or match[3])


def _is_impossible(path: Path) -> bool:
    try:
        os.lstat(path)
    except ValueError:  # a null character, or half a character
        return True
    except OSError:
        pass
    return False


def _real(path: Path) -> Path:
    try:
        return path.resolve()
    except (OSError, RuntimeError, ValueError):  # a loop of links, or a path that no file can have, stays as it is
        return path


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
