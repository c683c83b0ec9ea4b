"""``planlang backup``: a copy of a knowledge base, made while it is served."""

from __future__ import annotations

from pathlib import Path

from executive.cli.console import Answer
from executive.cli.server_arguments import BackupArguments
from executive.runs.files import refuse
from planlang.diagnostics import BadInput, error
from planlang.knowledge.backup import back_up, in_use
from planlang.knowledge.entries import SCHEME
from planlang.outputs import check_outputs


def command(arguments: BackupArguments) -> Answer:
    """Copy the file of a store. Raises BadInput."""
    if arguments.store.startswith(SCHEME):
        advice = "dump the endpoint with its own tools first, then copy the storage of --contents"
        message = "the stores behind a SPARQL endpoint are no file that planlang could copy"
        raise BadInput([error("K001", message, help=advice)])
    store, target = Path(arguments.store), arguments.target
    problems = check_outputs({"the backup": target}, {"the store": store}, force=arguments.force)
    refuse(problems or in_use(target))
    entries, size = back_up(store, target)
    text = f"{target}: {entries} {'entry' if entries == 1 else 'entries'}"
    return Answer(text=text, data={"backup": str(target), "entries": entries, "bytes": size})
