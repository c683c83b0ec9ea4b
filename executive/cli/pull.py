"""``planlang pull``: an entry of a server, with its files, written into a folder."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

from executive.cli.console import Answer
from executive.cli.inputs import refuse
from executive.cli.server import ask, kind_of
from executive.cli.server_arguments import PullArguments
from planlang.diagnostics import BadInput, Diagnostic, error, warning
from planlang.knowledge.answers import NotAsAgreed
from planlang.knowledge.client import Client
from planlang.knowledge.entries import Entry, Kind, Syntax
from planlang.knowledge.pulled import Origin, check_free, is_as_pulled, record
from planlang.outputs import replace

SUFFIXES = {Syntax.RDFXML: ".owl", Syntax.TURTLE: ".ttl", Syntax.MANCHESTER: ".omn"}
MOST_FILES, LARGEST_ENTRY = 1_000, 2_000_000_000
"""Files of an entry that are pulled, and bytes of all of them."""
_USES = {
    Kind.RECIPE: "planlang run {} runs it",
    Kind.ENVIRONMENT: "planlang run RECIPE --environment {} runs a recipe in it",
    Kind.ROBOT: "planlang match RECIPE --robot {} compares it with a recipe",
}


def command(arguments: PullArguments) -> Answer:
    """Write an entry's content and files. Raises BadInput."""
    return ask(arguments, lambda client: pull(client, arguments))


def pull(client: Client, arguments: PullArguments) -> Answer:
    """Write what a client reads; every file is checked against the SHA-256 of the entry's record."""
    folder, force = arguments.output, arguments.force
    entry = client.entry(arguments.uid, kind_of(arguments.kind))
    revision = client.revision(entry, arguments.revision)
    main = entry.uid + SUFFIXES[entry.syntax]
    _check_bounds(entry, main)

    def origin(sha256: str) -> Origin:
        return Origin(client.url, entry.uid, entry.author, revision.number, sha256)

    files: dict[str, tuple[Origin, Callable[[], bytes]]] = {
        main: (origin(revision.sha256), partial(client.content, entry, revision.number)),
        **{one.name: (origin(one.sha256), partial(client.attachment, entry, one)) for one in entry.attachments},
    }
    names = {name: stated for name, (stated, _) in files.items()}
    _make(folder)
    refuse(check_free(folder, names, force=force))
    record(folder, names, force=force)
    for name, (stated, read) in files.items():
        _write(folder / name, stated, read)
    lines = [str(folder / name) for name in files]
    lines += [_USES[entry.kind].format(folder / main)] if entry.kind in _USES else []
    data = {
        "uid": entry.uid,
        "kind": entry.kind.word,
        "revision": revision.number,
        "files": [str(folder / one) for one in files],
    }
    return Answer(diagnostics=tuple(_programs(folder, entry)), text="\n".join(lines), data=data)


def _check_bounds(entry: Entry, main: str) -> None:
    sizes = [one.size for one in entry.attachments]
    if main in (one.name for one in entry.attachments):
        raise NotAsAgreed(f"a file of {entry.uid} has the name of its content")
    if len(sizes) > MOST_FILES or sum(sizes) > LARGEST_ENTRY:
        limit = f"{MOST_FILES:,} files, {LARGEST_ENTRY // 1_000_000_000} GB"
        raise BadInput([error("K036", f"{entry.uid} has more than can be pulled at once: {limit}")])


def _make(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except (OSError, ValueError) as problem:
        raise BadInput([error("C004", f"-o {folder}: {getattr(problem, 'strerror', None) or problem}")]) from None


def _write(path: Path, origin: Origin, read: Callable[[], bytes]) -> None:
    if is_as_pulled(path, origin):
        return
    data = read()
    replace(path, lambda temporary: temporary.write_bytes(data))


def _programs(folder: Path, entry: Entry) -> list[Diagnostic]:
    return [
        warning(
            "K038",
            f"{folder / one.name} is a program by {entry.author}",
            help="it runs only with --trust: read it first",
        )
        for one in entry.attachments
        if one.name.lower().endswith(".py")
    ]
