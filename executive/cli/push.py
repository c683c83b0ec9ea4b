"""``planlang push``: an ontology and its attachments, uploaded to a server."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from hashlib import sha256
from mimetypes import guess_type
from pathlib import Path

from executive.cli.console import Answer
from executive.cli.server import asking, kind_of
from executive.cli.server_arguments import PushArguments
from executive.runs.files import check_files, refuse
from planlang.diagnostics import BadInput, Diagnostic, error
from planlang.files import Bundled, read_file
from planlang.knowledge.answers import RefusedByChecks, Taken
from planlang.knowledge.client import Client
from planlang.knowledge.entries import Entry, Kind, Syntax

_BUNDLED = {Kind.RECIPE: Bundled.RECIPE, Kind.ENVIRONMENT: Bundled.ENVIRONMENT, Kind.ROBOT: Bundled.ROBOT}
"""Kinds with bundled files, which need no path."""


@asking
def command(arguments: PushArguments, client: Client) -> Answer:
    """Upload a file and its attachments. Raises BadInput with the findings of the server's checks."""
    problems: list[Diagnostic] = []
    attached = arguments.attach or []
    check_files(problems, attach=attached)
    names = [path.name for path in attached]
    problems += [
        error("K039", f"two files are called {name}") for name in dict.fromkeys(names) if names.count(name) > 1
    ]
    refuse(problems)
    kind = kind_of(arguments.kind)
    assert kind is not None
    path = _BUNDLED[kind].find(arguments.file) if kind in _BUNDLED else Path(arguments.file)
    data = read_file(path)
    try:
        uploaded, is_new = _upload(client, kind, arguments, data)
    except RefusedByChecks as problem:
        raise RefusedByChecks(
            problem.status, str(problem), _placed(problem.diagnostics, arguments.name, path)
        ) from None
    entry, sent = _attach(client, uploaded.entry, attached)
    had = "" if is_new else " has this content already"
    lines = [f"{entry.uid}: revision {entry.revision.number}{had}", *(f"attached {name}" for name in sent)]
    data_ = {"uid": entry.uid, "revision": entry.revision.number, "etag": entry.etag, "attached": sent}
    return Answer(diagnostics=_placed(uploaded.diagnostics, arguments.name, path), text="\n".join(lines), data=data_)


def _upload(client: Client, kind: Kind, arguments: PushArguments, data: bytes) -> tuple[Taken, bool]:
    """Create or change an entry; False and the entry if it has this content already, whoever its author is."""
    if not arguments.update:
        return client.create(kind, arguments.name, data, arguments.about), True
    entry = _find(client, kind, arguments.name)
    if entry.revision.sha256 == sha256(data).hexdigest():
        return Taken(entry), False
    return client.change(entry, data), True


def _find(client: Client, kind: Kind, name: str) -> Entry:
    """Find an entry by its identifier, or by its author's name for it if that is unique. Raises BadInput."""
    if "." in name:
        return client.entry(name, kind)
    second = "".join(name.split()).lower()
    entries = [entry for entry in client.entries(kind) if entry.uid.partition(".")[2] == second]
    if len(entries) == 1:
        return entries[0]
    if not entries:
        advice = "leave out --update to make a new entry"
        raise BadInput([error("K039", f"there is no {kind.word} named {name} to update", help=advice)])
    advice = f"--name {' or '.join(entry.uid for entry in entries[:5])}"
    raise BadInput([error("K039", f"{len(entries)} entries have the name {name}", help=advice)])


def _attach(client: Client, entry: Entry, paths: Sequence[Path]) -> tuple[Entry, list[str]]:
    """Attach files that the entry does not have yet; returns the changed entry, and their names."""
    digests = {one.name: one.sha256 for one in entry.attachments}
    sent = []
    for path in paths:
        data = read_file(path)
        if digests.get(path.name) != sha256(data).hexdigest():
            media_type = guess_type(path.name)[0] or "application/octet-stream"
            entry = client.attach(entry.uid, path.name, media_type, data)
            sent.append(path.name)
    return entry, sent


def _placed(diagnostics: Iterable[Diagnostic], name: str, path: Path) -> tuple[Diagnostic, ...]:
    """Place diagnostics in the local file; the server places them in a file with the author's name for the entry."""
    stem = "".join(name.split()).rpartition(".")[2].replace("/", "_")[:100]

    def placed(one: Diagnostic) -> Diagnostic:
        if one.span is None or one.span.file not in (stem, *(f"{stem}{syntax.suffix}" for syntax in Syntax)):
            return one
        return replace(one, span=one.span._replace(file=str(path)))

    return tuple(map(placed, diagnostics))
