"""``planlang serve``: the knowledge base over HTTP, and keys for those who change it."""

from __future__ import annotations

from importlib.util import find_spec

from executive.cli.arguments import ServeArguments
from executive.cli.console import Answer, say, show, silent
from planlang.diagnostics import BadInput, error
from planlang.knowledge.sqlite_store import SqliteStore

LONGEST_AUTHOR = 100


def command(arguments: ServeArguments) -> Answer:
    """Serve until somebody ends it, or make a key. Raises BadInput."""
    missing = [name for name in ("fastapi", "uvicorn") if find_spec(name) is None]
    if missing:
        message = f"the server needs packages that are not installed: {', '.join(missing)}"
        raise BadInput([error("K004", message, help="pip install 'planlang[serve]'")])
    folders = arguments.folders
    store = SqliteStore(arguments.store)
    try:
        if arguments.new_key is not None:
            return _new_key(store, arguments.new_key)
        from executive.serving.app import application
        from executive.serving.running import run

        app = application(store, folders)
        serving = app.state.serving
        show(serving.vocabulary.diagnostics)
        tell = silent if arguments.json else say
        address = run(app, arguments.host, arguments.port, lambda url: tell(f"{arguments.store} is served at {url}"))
        return Answer(text="", data={"url": address, "entries": len(serving.catalogue)})
    finally:
        store.close()


def _new_key(store: SqliteStore, author: str) -> Answer:
    from executive.serving.serving import now

    if not author.strip() or len(author) > LONGEST_AUTHOR or not author.isprintable():
        message = f"an author has a printable name of at most {LONGEST_AUTHOR} characters"
        raise BadInput([error("K006", message)])
    key = store.new_key(author, now())
    return Answer(text=key, data={"author": author, "key": key})
