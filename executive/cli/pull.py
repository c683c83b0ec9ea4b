"""``planlang pull``: an entry of a server and its files, written to a folder."""

from __future__ import annotations

from executive.cli.console import Answer
from executive.cli.server import asking, kind_of
from executive.cli.server_arguments import PullArguments
from planlang.diagnostics import warning
from planlang.knowledge.client import Client
from planlang.knowledge.entries import Kind
from planlang.knowledge.pulling import pull
from planlang.shell import quoted

_USES = {
    Kind.RECIPE: "planlang run {} runs it",
    Kind.ENVIRONMENT: "planlang run RECIPE --environment {} runs a recipe in it",
    Kind.ROBOT: "planlang match RECIPE --robot {} compares it with a recipe",
}


@asking
def command(arguments: PullArguments, client: Client) -> Answer:
    """Write an entry's content and files. Raises BadInput."""
    entry = client.entry(arguments.uid, kind_of(arguments.kind))
    number = client.revision(entry, arguments.revision).number
    files = pull(client, [(entry, arguments.output)], revision=number, force=arguments.force)
    advice = "it runs only with --trust: read it first"
    warned = [
        warning("K038", f"{path} is a program by {entry.author}", help=advice)
        for path in files
        if path.suffix.lower() == ".py"
    ]
    lines = [*map(str, files), *([_USES[entry.kind].format(quoted(files[0]))] if entry.kind in _USES else [])]
    data = {"uid": entry.uid, "kind": entry.kind.word, "revision": number, "files": list(map(str, files))}
    return Answer(diagnostics=tuple(warned), text="\n".join(lines), data=data)
