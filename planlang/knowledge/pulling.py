"""Entries written into a folder, with their files: each checked against the digest in the entry's record."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Protocol

from planlang.diagnostics import BadInput, error, has_errors
from planlang.knowledge.answers import NotAsAgreed
from planlang.knowledge.entries import Attachment, Entry, Revision, Syntax
from planlang.knowledge.pulled import Origin, check_free, is_as_pulled, record
from planlang.outputs import replace

SUFFIXES = {Syntax.RDFXML: ".owl", Syntax.TURTLE: ".ttl", Syntax.MANCHESTER: ".omn"}
MOST_FILES, LARGEST_ENTRY = 1_000, 2_000_000_000
"""Files of an entry that are pulled, and bytes of all of them."""


class Source(Protocol):
    """The source of pulled entries: a client of a server, or a store of this machine."""

    @property
    def url(self) -> str:
        """Its address, as the record of what was pulled has it."""

    def revision(self, entry: Entry, number: int | None = None) -> Revision:
        """Return a revision of an entry, the last one unless told otherwise."""

    def content(self, entry: Entry, revision: int | None = None) -> bytes:
        """Return the content of a revision, checked against its digest."""

    def attachment(self, entry: Entry, attachment: Attachment) -> bytes:
        """Return a file of an entry, checked against its digest."""


def pull(
    client: Source, entry: Entry, folder: Path, *, revision: int | None = None, force: bool = False
) -> tuple[Path, ...]:
    """Write an entry into a folder, which is made; returns its files, the ontology first.

    Files that are there already, as they are to be, are not read again. With ``force``, files of the user's own are
    overwritten. Raises BadInput, and what the client raises.
    """
    wanted = client.revision(entry, revision)
    content = entry.uid + SUFFIXES[entry.syntax]
    _check_bounds(entry, content)

    def origin(sha256: str) -> Origin:
        return Origin(client.url, entry.uid, entry.author, wanted.number, sha256)

    reading: dict[str, Callable[[], bytes]] = {content: partial(client.content, entry, wanted.number)}
    names = {content: origin(wanted.sha256)}
    for one in entry.attachments:
        reading[one.name], names[one.name] = partial(client.attachment, entry, one), origin(one.sha256)
    _make(folder)
    if has_errors(problems := check_free(folder, names, force=force)):
        raise BadInput(problems)
    record(folder, names, force=force)
    for name, read in reading.items():
        if not is_as_pulled(folder / name, names[name]):
            data = read()
            replace(folder / name, partial(_write, data))
    return tuple(folder / name for name in names)


def _write(data: bytes, path: Path) -> None:
    path.write_bytes(data)


def _check_bounds(entry: Entry, content: str) -> None:
    sizes = [one.size for one in entry.attachments]
    if content in (one.name for one in entry.attachments):
        raise NotAsAgreed(f"a file of {entry.uid} has the name of its content")
    if len(sizes) > MOST_FILES or sum(sizes) > LARGEST_ENTRY:
        limit = f"{MOST_FILES:,} files, {LARGEST_ENTRY // 1_000_000_000} GB"
        raise BadInput([error("K036", f"{entry.uid} has more than can be pulled at once: {limit}")])


def _make(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except (OSError, ValueError) as problem:
        raise BadInput([error("C004", f"{folder}: {getattr(problem, 'strerror', None) or problem}")]) from None
