"""Files that are read: those that a user names (regular and bounded in size), and those that come with planlang.

Bundled files are beside the packages in a checkout, inside planlang in a wheel.

A :class:`Cache` keeps what is costly to compute and follows from its inputs alone, in the user's cache folder. An entry
is named by a key that its user makes of everything it depends on, so it never needs to be invalidated, and it begins
with a digest of its key and content: whatever is damaged, incomplete or another entry's counts as not kept and is
computed anew. An entry is written under a temporary name and then renamed, so that other processes see all of it or
nothing. Without a writable folder nothing is kept.
"""

from __future__ import annotations

import codecs
import errno
import hashlib
import os
import re
import shutil
import stat
import tempfile
from contextlib import suppress
from dataclasses import dataclass
from difflib import get_close_matches
from enum import Enum
from pathlib import Path
from typing import BinaryIO
from urllib.parse import unquote_to_bytes

from planlang.diagnostics import BadInput, Span, error

LARGEST = 16_000_000
"""Bytes of a file unless its reader says otherwise: robot descriptions and maps in use have up to 0.7 MB."""


def open_regular(path: Path) -> BinaryIO:
    """Open a regular file for reading, following links. Raises OSError for anything else, with the reason in strerror.

    Nothing that blocks or has no end is ever opened: no FIFO, device or socket, also if it takes the file's place
    between the look and the opening.
    """
    try:
        _check_regular(path, os.stat(path))  # opening a device may have an effect, looking at it has none
        descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC | os.O_NONBLOCK)
    except ValueError as problem:  # a null character in the name
        raise OSError(errno.EINVAL, str(problem), str(path)) from None
    try:
        _check_regular(path, os.fstat(descriptor))
    except OSError:
        os.close(descriptor)
        raise
    return os.fdopen(descriptor, "rb")


def _check_regular(path: Path, found: os.stat_result) -> None:
    if stat.S_ISDIR(found.st_mode):
        raise IsADirectoryError(errno.EISDIR, "is a folder", str(path))
    if not stat.S_ISREG(found.st_mode):
        raise OSError(errno.EINVAL, "is not a regular file", str(path))


def read_file(path: Path, code: str = "C001", *, largest: int = LARGEST, code_if_large: str | None = None) -> bytes:
    """Return the content of a file that a user named. Raises BadInput with one error of the given code.

    A file of more than ``largest`` bytes is refused, with ``code_if_large`` if that is given, and never read whole.
    """
    span = Span(str(path))
    name = printable(path.name[:80] or "the file")
    try:
        with open_regular(path) as file:
            content = file.read(largest + 1)
    except FileNotFoundError:
        raise BadInput([error(code, f"{name} does not exist", span)]) from None
    except OSError as problem:
        reason = problem.strerror or str(problem)
        message = f"{name} {reason}" if reason.startswith("is ") else f"{name} cannot be read: {reason}"
        raise BadInput([error(code, message, span)]) from None
    if len(content) > largest:
        limit = f"{largest // 1_000_000} MB" if largest >= 1_000_000 else f"{largest:,} bytes"
        raise BadInput([error(code_if_large or code, f"the file is larger than {limit}", span)])
    return content


def printable(name: str) -> str:
    """Return a file's name as text that every file and terminal takes; bytes that are not UTF-8 are written as %E9."""
    return re.sub("[\udc80-\udcff]", lambda byte: f"%{ord(byte[0]) - 0xDC00:02X}", name)


def from_printable(name: str) -> str:
    """Return the file's name that :func:`printable` wrote."""
    return os.fsdecode(unquote_to_bytes(name))


LARGEST_ONTOLOGY = 64_000_000
"""Bytes of an ontology: room for 100,000 orderings in RDF/XML; the largest of its kind in use has 0.7 MB."""

_DECLARATION = re.compile(rb"<\?xml[^>]*?encoding\s*=\s*[\"']([A-Za-z0-9._-]+)[\"']")
_SOMETHING = re.compile(rb"[^ \t\r\n\xef\xbb\xbf\xff\xfe\x00]")
_ENCODINGS = ("utf-8", "utf-16", "utf-16-le", "utf-16-be", "ascii", "iso8859-1", "iso8859-15", "cp1252")


def decode(content: bytes | str, file: str) -> str:
    """Return the text of an XML or Manchester file, line ends unchanged. Raises BadInput if it cannot be decoded.

    The encoding is told by a byte order mark, else by the XML declaration, else it is UTF-8.
    """
    if isinstance(content, str):
        return content
    if len(content) > LARGEST_ONTOLOGY:
        raise BadInput([error("O003", f"the file is larger than {LARGEST_ONTOLOGY // 1_000_000} MB", Span(file))])
    if not _SOMETHING.search(content):
        raise BadInput([error("O002", "the file is empty", Span(file))])
    name = "utf-8-sig"
    if content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        name = "utf-16"
    elif match := _DECLARATION.match(content):
        name = match[1].decode("ascii")
    try:
        codec = codecs.lookup(name).name
        if codec not in (*_ENCODINGS, "utf-8-sig"):
            raise LookupError(name)
    except LookupError:
        advice = "save the file as UTF-8"
        raise BadInput([error("O004", f"unknown encoding {name!r}", Span(file), advice)]) from None
    try:
        text = content.decode("utf-8-sig" if codec == "utf-8" else codec)
    except UnicodeDecodeError as problem:
        before = content[: problem.start]
        line = before.count(b"\n") + 1
        column = len(before[before.rfind(b"\n") + 1 :].decode(codec, errors="replace")) + 1
        message = f"this is not {name.removesuffix('-sig').upper()} text: {problem.reason}"
        raise BadInput([error("O004", message, Span(file, line, column), "save the file as UTF-8")]) from None
    if (position := text.find("\x00")) >= 0:
        raise BadInput([error("O004", "this is a binary file", position_of(text, position, file))])
    return text


def position_of(text: str, offset: int, file: str) -> Span:
    """Return the position of a character."""
    line = text.count("\n", 0, offset) + 1
    return Span(file, line, offset - text.rfind("\n", 0, offset))


def offset_of(text: str, span: Span) -> int:
    """Return the offset of a position, at most the length of the text."""
    offset = 0
    for _ in range(span.line - 1):
        offset = text.find("\n", offset) + 1
        if offset == 0:
            return len(text)
    return min(offset + span.column - 1, len(text))


SUFFIXES = (".omn", ".owl", ".ttl", ".owl.in", ".toml")
"""Suffixes that a bundled file may have; a user's own file may have any."""


def bundled(folder: str) -> Path:
    """Return the folder "ontologies" or "recipes" that came with this installation."""
    here = Path(__file__).resolve().parent
    installed = here / "data" / folder
    return installed if installed.is_dir() else here.parent / folder


class Bundled(Enum):
    """A kind of file that comes with planlang; the value is the word for it in messages."""

    RECIPE = "recipe"
    ROBOT = "robot"
    ENVIRONMENT = "environment"

    @property
    def folder(self) -> Path:
        """The folder that holds the files of this kind."""
        return bundled("recipes") if self is Bundled.RECIPE else bundled("ontologies") / f"{self.value}s"

    def names(self) -> tuple[str, ...]:
        """Return the names of the bundled files, without suffixes, sorted."""
        found = {path.name.removesuffix(suffix) for suffix in SUFFIXES for path in self.folder.glob(f"*{suffix}")}
        return tuple(sorted(found))

    def find(self, name: str) -> Path:
        """Return the file called ``name``: an existing path, or a bundled file of that name.

        Raises BadInput when there is none, listing the bundled ones.
        """
        if not name.strip():
            raise BadInput([error("C001", f"the name of the {self.value} is empty", help=self._advice())])
        path = Path(name)
        try:
            if path.is_file():
                return path
            is_folder = path.is_dir()
            is_stream = name == "-" or (path.exists() and not is_folder)
        except (OSError, ValueError) as problem:  # a name too long, or with a null character
            raise BadInput([error("C001", f"no {self.value} can be read at {name[:80]!r}: {problem}")]) from None
        if path.name == name:
            for suffix in SUFFIXES:
                candidate = self.folder / f"{name}{suffix}"
                if candidate.is_file():
                    return candidate
        if is_folder:
            raise BadInput([error("C001", f"{name} is a folder", help=f"name the {self.value}'s file in it")])
        if is_stream:
            why = f"{name} is a pipe or device; the {self.value} is read more than once"
            raise BadInput([error("C001", why, help=f"write it to a file first: ... > {self.value}.owl")])
        similar = get_close_matches(name, self.names(), n=1)
        guess = f"did you mean {similar[0]}? " if similar else ""
        raise BadInput([error("C001", f"no such {self.value}: {name}", help=guess + self._advice())])

    def _advice(self) -> str:
        known = ", ".join(self.names()) or "none"
        return f"give the path of a file, or the name of a bundled {self.value}: {known}"


_DIGEST_BYTES = 64
"""Length of the digest, in hexadecimal digits, in front of the content; arrays behind it are aligned."""


@dataclass(frozen=True, slots=True)
class Cache:
    """The kept entries of one kind, in a folder of their own.

    ``most`` is how many entries are kept, the most recent ones; one of more than ``largest`` bytes is not of this kind.
    """

    kind: str
    most: int
    largest: int = 64_000_000

    def load(self, key: str) -> bytes | None:
        """Return what was kept under a key; None if nothing was, or if it is not exactly that any more."""
        entry = self._entry(key)
        if entry is None or not _is_ours_alone(entry.parent):
            return None
        try:
            with open_regular(entry) as file:
                if os.fstat(file.fileno()).st_size > self.largest + _DIGEST_BYTES:
                    return None
                content = file.read(self.largest + _DIGEST_BYTES)
        except OSError:
            return None
        return unsealed(key, content)

    def keep(self, key: str, content: bytes) -> bool:
        """Keep content under a key, in the place of whatever is there; False if that cannot be done."""
        entry = self._entry(key)
        if entry is None or len(content) > self.largest:
            return False
        temporary: str | None = None
        try:
            entry.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
            _close_to_others(entry.parent)
            if not _is_ours_alone(entry.parent):
                return False
            handle, temporary = tempfile.mkstemp(prefix=".", dir=entry.parent)
            with os.fdopen(handle, "wb") as file:
                file.write(sealed(key, content))
            if entry.is_dir() and not entry.is_symlink():
                shutil.rmtree(entry)
            os.replace(temporary, entry)
        except OSError:
            return False
        finally:
            if temporary is not None:
                with suppress(OSError):
                    os.unlink(temporary)
        self._forget_oldest(entry)
        return True

    def _entry(self, key: str) -> Path | None:
        folder = cache_folder(self.kind)
        return None if folder is None else folder / hashlib.sha256(key.encode()).hexdigest()

    def _forget_oldest(self, newest: Path) -> None:
        found = []
        for path in newest.parent.iterdir():
            with suppress(OSError):  # another process forgot it
                found.append((path.lstat().st_mtime, path))
        for _, path in sorted(found)[: max(0, len(found) - self.most)]:
            if path != newest:
                with suppress(OSError):
                    path.unlink()


def sealed(key: str, content: bytes) -> bytes:
    """Return content behind a digest of it and of its key."""
    return hashlib.sha256(f"{key}\n".encode() + content).hexdigest().encode() + content


def unsealed(key: str, content: bytes) -> bytes | None:
    """Return what was sealed with a key; None if that is damaged, or was sealed with another."""
    inner = content[_DIGEST_BYTES:]
    return inner if content == sealed(key, inner) else None


def cache_folder(kind: str) -> Path | None:
    """Where entries of a kind are kept, whether the folder exists or not; None if the user has no home."""
    root = os.environ.get("XDG_CACHE_HOME")
    if root and Path(root).is_absolute():
        return Path(root) / "planlang" / kind
    try:
        return Path.home() / ".cache" / "planlang" / kind
    except RuntimeError:
        return None


def _is_ours_alone(folder: Path) -> bool:
    """Return True for this user's folder in which nobody else may write: digests do not help against planted files."""
    try:
        found = folder.stat()
    except OSError:
        return False
    return found.st_uid == os.getuid() and not found.st_mode & (stat.S_IWGRP | stat.S_IWOTH)


def _close_to_others(folder: Path) -> None:
    """Take back a folder of this user that others may write, as a lax umask made it, without what they could plant."""
    found = folder.stat()
    if found.st_uid == os.getuid() and found.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
        folder.chmod(0o700)
        for path in folder.iterdir():
            path.unlink()
