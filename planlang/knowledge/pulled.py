"""Records of downloaded files, which mark them as foreign.

The record is written before the files, so that no file is ever there without it. Ontologies are data, but downloaded
Python runs only with the user's permission. It is recognised in its folder by name, edited or not, and elsewhere by its
content, which the user's cache remembers even for a renamed copy.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict
from hashlib import sha256
from pathlib import Path

from planlang.cache import Cache
from planlang.diagnostics import BadInput, Diagnostic, error
from planlang.files import read_file
from planlang.knowledge.answers import NotAsAgreed, as_json, read_as
from planlang.outputs import replace
from planlang.records import dataclass
from planlang.words import Blank, Option, Text

PULLED = "pulled"
"""Kind of the cache entries with the origins of programs, by SHA-256."""
_PROGRAMS = Cache(PULLED, most=100_000, largest=10_000)
RECORD = ".planlang-pulled.json"
"""Name of the record, which no file of an entry can have: those start with a letter or digit."""


PROGRAM = ".py"
"""Suffix of programs."""


@dataclass(frozen=True, slots=True)
class Origin:
    """Origin of a downloaded file: server, entry, author and revision, with the digest at that time."""

    server: str
    uid: str
    author: str
    revision: int
    sha256: str

    def __str__(self) -> str:
        return f"{self.uid} by {self.author}, {self.server}"


def origins(folder: Path) -> dict[str, Origin]:
    """Read the record of a folder: origins by file name; empty without a record. Raises BadInput."""
    path = folder / RECORD
    if not path.is_file():
        return {}
    try:
        stated = as_json(read_file(path)).get("files")
        return {str(name): read_as(Origin, one) for name, one in stated.items()} if isinstance(stated, dict) else {}
    except NotAsAgreed as problem:
        advice = "check the files in the folder, then delete the record"
        raise BadInput([error("K035", f"the record of downloads is damaged: {path}: {problem}", help=advice)]) from None


ELSEWHERE = Text(Option("output", Blank("FOLDER")), " names another folder, ")
"""Advice about a file that would be overwritten."""


def check_free(folder: Path, names: Mapping[str, Origin], *, force: bool) -> list[Diagnostic]:
    """Report files that would be overwritten although they are not as downloaded, before or now."""
    before = {} if force else origins(folder)
    problems = []
    for name, origin in names.items():
        path = folder / name
        if path.is_dir():
            problems.append(error("C004", f"{path} is a folder"))
        elif path.is_symlink() and not force:
            advice = Text(ELSEWHERE, Option("force", True), " replaces the link by a file")
            problems.append(error("C005", f"{path} is a symbolic link", help=advice))
        elif path.exists() and not force and not is_as_pulled(path, origin, before.get(name)):
            advice = Text(ELSEWHERE, Option("force", True), " overwrites it")
            problems.append(error("C005", f"{path} exists with different content", help=advice))
    return problems


def record(folder: Path, names: Mapping[str, Origin], *, force: bool) -> None:
    """Add files to the record of a folder, creating it if needed. Raises BadInput."""
    try:
        before = origins(folder)
    except BadInput:
        if not force:
            raise
        before = {}
    for name, one in names.items():
        if Path(name).suffix.lower() == PROGRAM:
            _PROGRAMS.keep(one.sha256, json.dumps(asdict(one)).encode())
    listed = {name: asdict(one) for name, one in sorted({**before, **names}.items())}
    text = json.dumps({"files": listed}, indent=1, ensure_ascii=False) + "\n"
    replace(folder / RECORD, lambda temporary: temporary.write_text(text, encoding="utf-8"))


def is_as_pulled(path: Path, *origins: Origin | None) -> bool:
    """Check whether a file exists and is unchanged since a download from one of the origins."""
    return has_digest(path, *(one.sha256 for one in origins if one is not None))


def has_digest(path: Path, *digests: str) -> bool:
    """Check whether a file exists and has one of the SHA-256 digests."""
    try:
        return sha256(read_file(path)).hexdigest() in digests
    except BadInput:
        return False


def origin_of(path: Path) -> Origin | None:
    """Return the origin of a program; None for one of the user's own. Raises BadInput."""
    real = path.resolve()
    listed = origins(real.parent)
    if real.name in listed:
        return listed[real.name]
    digest = sha256(read_file(real)).hexdigest()
    known = _PROGRAMS.load(digest)
    if known is not None:
        origin: Origin = read_as(Origin, as_json(known))
        return origin
    return next((one for one in listed.values() if one.sha256 == digest), None)
