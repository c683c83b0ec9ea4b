"""``planlang delete``: an entry, or files of it, is deleted from a server."""

from __future__ import annotations

from executive.cli.console import Answer
from executive.cli.server import asking
from executive.cli.server_arguments import DeleteArguments
from planlang.knowledge.client import Client


@asking
def command(arguments: DeleteArguments, client: Client) -> Answer:
    """Delete an entry with all its revisions and files, or only the named files. Raises BadInput."""
    entry = client.entry(arguments.uid)
    for name in arguments.file or ():
        client.detach(entry.uid, name)
    if not arguments.file:
        client.delete(entry)
    what = ", ".join(arguments.file or ("all of it",))
    data = {"uid": entry.uid, "files": arguments.file or [one.name for one in entry.attachments]}
    return Answer(text=f"{entry.uid}: deleted {what}", data={**data, "entry": not arguments.file})
