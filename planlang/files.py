"""Reading files: a user's files, which must be regular and of bounded size, and the bundled ones.

Bundled files lie beside the packages in a checkout and inside planlang in a wheel.
"""

from __future__ import annotations

import codecs
import errno
import os
import re
import stat
from enum import Enum
from functools import cache
from pathlib import Path
from typing import BinaryIO
from urllib.parse import unquote_to_bytes

from planlang.diagnostics import BadInput, Span, error
from planlang.spelling import guess

LARGEST = 16_000_000
"""Default limit in bytes: robot descriptions and maps in use have up to 0.7 MB."""
PIECE = 1_000_000
"""Bytes read at a time."""


def open_regular(path: Path) -> BinaryIO:
    """Open a regular file for reading, following links. Raises OSError for anything else, with the reason in strerror.

    FIFOs, devices and sockets, which may block or never end, are not read, even if one replaces the file between the
    check and the opening.
    """
    try:
        _check_regular(path, os.stat(path))  # opening a device may have side effects, stat has none
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


def read_at_most(file: BinaryIO, most: int) -> bytes:
    """Read at most ``most`` bytes in pieces: ``file.read(most)`` would reserve memory for all of them."""
    parts = []
    while most > 0 and (part := file.read(min(most, PIECE))):
        parts.append(part)
        most -= len(part)
    return b"".join(parts)


LFS_POINTER = b"version https://git-lfs.github.com/spec/"
"""Beginning of what Git writes in place of a large file that was not fetched."""
NOT_FETCHED = "it is a pointer of Git LFS, not the file itself"
LFS_PULL = "fetch the file: git lfs pull"


def read_file(path: Path, code: str = "C001", *, largest: int = LARGEST, code_if_large: str | None = None) -> bytes:
    """Read a file named by the user. Raises BadInput with one error of the given code.

    A file of more than ``largest`` bytes is refused without reading all of it, with ``code_if_large`` if given.
    """
    span = Span(str(path))
    name = printable(path.name[:80] or "the file")
    try:
        with open_regular(path) as file:
            content = read_at_most(file, largest + 1)
    except FileNotFoundError:
        raise BadInput([error(code, f"{name} does not exist", span)]) from None
    except OSError as problem:
        reason = problem.strerror or str(problem)
        message = f"{name} {reason}" if reason.startswith("is ") else f"{name} cannot be read: {reason}"
        raise BadInput([error(code, message, span)]) from None
    if len(content) > largest:
        limit = f"{largest // 1_000_000} MB" if largest >= 1_000_000 else f"{largest:,} bytes"
        raise BadInput([error(code_if_large or code, f"the file is larger than {limit}", span)])
    if content.startswith(LFS_POINTER):
        raise BadInput([error(code, NOT_FETCHED, span, LFS_PULL)])
    return content


def printable(name: str) -> str:
    """Convert a file name to valid UTF-8: bytes that are not UTF-8 become escapes like %E9."""
    return re.sub("[\udc80-\udcff]", lambda byte: f"%{ord(byte[0]) - 0xDC00:02X}", name)


def from_printable(name: str) -> str:
    """Convert the result of :func:`printable` back to the file name."""
    return os.fsdecode(unquote_to_bytes(name))


LARGEST_ONTOLOGY = 64_000_000
"""Limit for ontologies in bytes: 100,000 orderings in RDF/XML; the largest in use has 0.7 MB."""

_DECLARATION = re.compile(rb"<\?xml[^>]*?encoding\s*=\s*[\"']([A-Za-z0-9._-]+)[\"']")
_SOMETHING = re.compile(rb"[^ \t\r\n\xef\xbb\xbf\xff\xfe\x00]")
_ENCODINGS = ("utf-8", "utf-16", "utf-16-le", "utf-16-be", "ascii", "iso8859-1", "iso8859-15", "cp1252")


def beginning(path: Path, most: int = 4000) -> str:
    """Read the first bytes of a file as text; empty if it cannot be read."""
    try:
        with open_regular(path) as file:
            content = file.read(most)
    except OSError:
        return ""
    return content.decode(encoding_of(content), errors="replace")


def encoding_of(content: bytes) -> str:
    """Name the encoding that a byte order mark states, else UTF-8; decoding drops the mark."""
    return "utf-16" if content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)) else "utf-8-sig"


def decode(content: bytes | str, file: str) -> str:
    """Decode a text file; line ends stay. Raises BadInput if it cannot be decoded.

    A byte order mark decides the encoding, else the XML declaration, else it is UTF-8.
    """
    if isinstance(content, str):
        return content
    if len(content) > LARGEST_ONTOLOGY:
        raise BadInput([error("O003", f"the file is larger than {LARGEST_ONTOLOGY // 1_000_000} MB", Span(file))])
    if not _SOMETHING.search(content):
        raise BadInput([error("O002", "the file is empty", Span(file))])
    name = encoding_of(content)
    if name == "utf-8-sig" and (match := _DECLARATION.match(content)):
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
    """Convert the offset of a character to a position."""
    line = text.count("\n", 0, offset) + 1
    return Span(file, line, offset - text.rfind("\n", 0, offset))


def offset_of(text: str, span: Span) -> int:
    """Convert a position to an offset, at most the length of the text."""
    offset = 0
    for _ in range(span.line - 1):
        offset = text.find("\n", offset) + 1
        if offset == 0:
            return len(text)
    return min(offset + span.column - 1, len(text))


SUFFIXES = (".omn", ".owl", ".ttl", ".owl.in", ".toml")
"""Suffixes of bundled files; a user's file may have any."""


ONTOLOGIES = (".omn", ".owl", ".owl.in", ".ttl", ".nt", ".rdf", ".ofn", ".owx")
"""Suffixes by which ontologies are found in folders of the user."""


class Target(Enum):
    """Syntaxes in which ontologies can be written."""

    MANCHESTER = "manchester"
    TURTLE = "turtle"
    NTRIPLES = "ntriples"
    RDFXML = "rdfxml"
    FUNCTIONAL = "functional"
    OWLXML = "owlxml"


@cache
def bundled(folder: str) -> Path:
    """Return the folder "ontologies" or "recipes" of this installation."""
    here = Path(__file__).resolve().parent
    installed = here / "data" / folder
    return installed if installed.is_dir() else here.parent / folder


class Bundled(Enum):
    """Kinds of bundled files; the value is the word for it in messages."""

    RECIPE = "recipe"
    ROBOT = "robot"
    ENVIRONMENT = "environment"

    @property
    def folder(self) -> Path:
        """Folder of the files of this kind."""
        return bundled("recipes") if self is Bundled.RECIPE else bundled("ontologies") / f"{self.value}s"

    def names(self) -> tuple[str, ...]:
        """Return the names of the bundled files, without suffixes, sorted."""
        found = {path.name.removesuffix(suffix) for suffix in SUFFIXES for path in self.folder.glob(f"*{suffix}")}
        return tuple(sorted(found))

    def find(self, name: str) -> Path:
        """Find the file ``name``: an existing path, or the name of a bundled file.

        Raises BadInput, which lists the bundled files, if there is none.
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
            raise BadInput([error("C001", f"{name} is a folder", help=f"name the {self.value} file in it")])
        if is_stream:
            why = f"{name} is a pipe or device, but the {self.value} is read more than once"
            raise BadInput([error("C001", why, help=f"write it to a file first: ... > {self.value}.owl")])
        advice = guess(name, self.names()) + self._advice()
        raise BadInput([error("C001", f"no such {self.value}: {name}", help=advice)])

    @classmethod
    def of(cls, name: str) -> Bundled | None:
        """Kind of the bundled file ``name``; None if there is none, or if ``name`` is a file of the user."""
        is_own = os.path.isfile(name)  # False also for a text that cannot be a path; a folder is no file
        return None if is_own else next((one for one in cls if name in one.names()), None)

    def _advice(self) -> str:
        known = ", ".join(self.names()) or "none"
        return f"give the path of a file, or the name of a bundled {self.value}: {known}"
