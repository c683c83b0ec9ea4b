"""``planlang serve``, where its packages are installed."""

from __future__ import annotations

import os
from contextlib import closing
from importlib.util import find_spec
from pathlib import Path

from executive.cli.console import Answer, ExitCode, printer_of, show
from executive.cli.server_arguments import ServeArguments
from executive.processes.workers import Limits
from executive.serving.access import Lines
from executive.serving.app import application
from executive.serving.rates import Rates
from executive.serving.running import run
from executive.serving.serving import now
from executive.serving.workers import Failed, Staff
from planlang.diagnostics import BadInput, error
from planlang.extras import install_command
from planlang.knowledge.entries import SCHEME, Full, Store, Unreachable, Unusable
from planlang.knowledge.sqlite_store import SqliteStore
from planlang.outputs import unwritable

LONGEST_AUTHOR = 100


def command(arguments: ServeArguments) -> Answer:
    """Serve until interrupted, or make and revoke keys.

    Exit code 1 if an endpoint does not answer. Raises BadInput.
    """
    store = _open(arguments.store, arguments.contents)
    try:
        if arguments.new_key is not None or arguments.drop_keys is not None:
            return _keys(store, arguments)
        return _serve(store, arguments)
    except Failed as problem:
        advice = "raise the limit, or end other programs"
        message = f"the processes of the checks do not start: {problem}"
        return Answer(ExitCode.OUT_OF_RESOURCES, (error("C020", message, help=advice),))
    except Unusable as problem:
        raise BadInput([problem.diagnostic(arguments.store)]) from None
    except Unreachable as problem:
        advice = "the endpoint and the storage must be reachable when a server starts"
        if isinstance(problem, Full):
            advice = "free space on its disk; nothing was changed"
        return Answer(ExitCode.FAILED, (error("K044", str(problem), help=advice),))
    finally:
        store.close()


def _serve(store: Store, arguments: ServeArguments) -> Answer:
    folders = arguments.folders
    access_log = None if arguments.access_log is None else _open_log(arguments.access_log)
    say = printer_of(arguments)
    with closing(Staff(folders, Limits(arguments.check_seconds))) as staff:
        staff.start()  # in parallel to building the index
        app = application(store, staff, rates=Rates(arguments.rate), access=access_log)
        serving = app.state.serving
        show(serving.vocabulary.diagnostics, arguments.detail)
        with closing(serving):
            staff.wait()
            address = run(app, arguments.host, arguments.port, lambda url: say(f"{arguments.store} is served at {url}"))
    if access_log is not None:
        access_log.close()
    return Answer(text="", data={"url": address, "entries": len(serving.catalogue)})


def _open_log(path: Path) -> Lines:
    """Open the access log. Raises BadInput."""
    try:
        return Lines(path)
    except (OSError, ValueError) as problem:
        raise BadInput([unwritable(path, problem)]) from None


def _open(address: str, contents: str | None) -> Store:
    """Open the store: a file, or a SPARQL endpoint with contents elsewhere. Raises BadInput."""
    if not address.startswith(SCHEME):
        if contents is not None:
            raise BadInput(
                [error("K020", "--contents needs a SPARQL endpoint as --store; a file stores contents itself")]
            )
        if "://" in address:
            advice = f"write {SCHEME}{address} for a SPARQL endpoint, or the name of a file"
            raise BadInput([error("K001", f"{address} is not a file", help=advice)])
        return SqliteStore(Path(address))
    if find_spec("obstore") is None:
        message = "object storage needs a package that is not installed: obstore"
        raise BadInput([error("K004", message, help=install_command("serve"))])
    if contents is None:
        advice = "add --contents s3://BUCKET/FOLDER, or file:///FOLDER that all servers share"
        raise BadInput([error("K020", "a store behind SPARQL needs --contents", help=advice)])
    from planlang.knowledge.sparql_store import SparqlStore  # needs obstore

    try:
        return SparqlStore(address, contents, key=os.environ.get("PLANLANG_SPARQL_KEY"))
    except ValueError as problem:
        advice = "s3://BUCKET/FOLDER, gs://, az://, or file:///FOLDER, which is there"
        raise BadInput([error("K020", str(problem), help=advice)]) from None


def _keys(store: Store, arguments: ServeArguments) -> Answer:
    """Revoke an author's keys, make a new one, or both."""
    lines: list[str] = []
    data: dict[str, object] = {}
    if arguments.drop_keys is not None:
        dropped = store.drop_keys(arguments.drop_keys)
        lines.append(f"{arguments.drop_keys}: {dropped} key{'' if dropped == 1 else 's'} dropped")
        data = {"author": arguments.drop_keys, "dropped": dropped}
    author = arguments.new_key
    if author is not None:
        if not author.strip() or len(author) > LONGEST_AUTHOR or not author.isprintable():
            message = f"the name of an author must be printable, with at most {LONGEST_AUTHOR} characters"
            raise BadInput([error("K006", message)])
        key = store.new_key(author, now())
        lines.append(key)
        data |= {"author": author, "key": key}
    return Answer(text="\n".join(lines), data=data)
