"""Download of entries with their files to folders, with every file checked against its digest."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import partial
from pathlib import Path
from shutil import copyfile
from typing import Protocol

from planlang.diagnostics import BadInput, error, has_errors
from planlang.knowledge.answers import NotAsAgreed
from planlang.knowledge.entries import Attachment, Entry, Revision
from planlang.knowledge.pulled import Origin, check_free, is_as_pulled, record
from planlang.outputs import make_folder, replace
from planlang.temporary import temporary_folder

MOST_FILES, LARGEST_ENTRY = 1_000, 2_000_000_000
"""Limits for the number of files of an entry and for their total size [bytes]."""


class Source(Protocol):
    """Source of entries: the client of a server, or a store on this machine."""

    @property
    def url(self) -> str:
        """Its address, for the record of downloads."""

    def revision(self, entry: Entry, number: int | None = None) -> Revision:
        """Return a revision of an entry, by default the latest."""

    def content(self, entry: Entry, revision: int | None = None) -> bytes:
        """Return the content of a revision, checked against its digest."""

    def attachment(self, entry: Entry, attachment: Attachment) -> bytes:
        """Return a file of an entry, checked against its digest."""


def pull(
    client: Source, wanted: Iterable[tuple[Entry, Path]], *, revision: int | None = None, force: bool = False
) -> tuple[Path, ...]:
    """Download each entry to its folder, creating it; return the files, the ontology of each entry first.

    Everything is read before the first file is written, so that a lost connection leaves nothing half done. Files that
    are already up to date are not read again. ``force`` overwrites the user's own files. Raises BadInput and the
    exceptions of the client.
    """
    with temporary_folder() as staged:
        folders = [_read(client, entry, folder, revision, staged, force=force) for entry, folder in wanted]
        for folder, names in folders:
            make_folder(folder)
            record(folder, names, force=force)
            for name, origin in names.items():
                if not is_as_pulled(folder / name, origin):
                    replace(folder / name, partial(copyfile, staged / origin.sha256))
    return tuple(folder / name for folder, names in folders for name in names)


def _read(
    client: Source, entry: Entry, folder: Path, revision: int | None, staged: Path, *, force: bool
) -> tuple[Path, dict[str, Origin]]:
    """Read the missing files of an entry to ``staged``; return the folder and the origin of each file by name."""
    now = client.revision(entry, revision)
    content = entry.uid + entry.syntax.suffix
    _check_bounds(entry, content)

    def origin(sha256: str) -> Origin:
        return Origin(client.url, entry.uid, entry.author, now.number, sha256)

    reading: dict[str, Callable[[], bytes]] = {content: partial(client.content, entry, now.number)}
    names = {content: origin(now.sha256)}
    for one in entry.attachments:
        reading[one.name], names[one.name] = partial(client.attachment, entry, one), origin(one.sha256)
    if has_errors(problems := check_free(folder, names, force=force)):
        raise BadInput(problems)
    for name, read in reading.items():
        file = staged / names[name].sha256
        if not file.exists() and not is_as_pulled(folder / name, names[name]):
            file.write_bytes(read())
    return folder, names


def _check_bounds(entry: Entry, content: str) -> None:
    sizes = [one.size for one in entry.attachments]
    if content in (one.name for one in entry.attachments):
        raise NotAsAgreed(f"a file of {entry.uid} has the name of its content")
    if len(sizes) > MOST_FILES or sum(sizes) > LARGEST_ENTRY:
        limit = f"{MOST_FILES:,} files, {LARGEST_ENTRY // 1_000_000_000} GB"
        raise BadInput([error("K036", f"{entry.uid} exceeds the limit for a download: {limit}")])
