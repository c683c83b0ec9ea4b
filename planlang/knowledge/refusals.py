"""Diagnostics for a server of a knowledge base that does not do what a user asked."""

from __future__ import annotations

from planlang.diagnostics import BadInput, Diagnostic, error, has_errors, warning
from planlang.knowledge.answers import Declined, KeyNeeded, NoAnswer, NotAsAgreed, printed
from planlang.knowledge.client import Client
from planlang.knowledge.connection import kept_answers
from planlang.knowledge.entries import Changed, EntryExists, NoSuchEntry, NotTheAuthor, Refused

KEY = "PLANLANG_KEY"
"""Environment variable of the author's key."""
HOW_TO_MAKE_A_KEY = "planlang serve --store FILE --new-key AUTHOR makes one where the server runs"
_NO_ADDRESS = "this asks a server at an address; planlang serve --store FILE is one for the store in a file"
_SILENT = "does planlang serve run there, and is the address right?"
_ADVICE: dict[type[Refused], str] = {
    KeyNeeded: f"--key-file FILE, or {KEY}, gives your key; {HOW_TO_MAKE_A_KEY}",
    NoSuchEntry: "planlang search lists what there is",
    EntryExists: "--update makes the next revision of your own; another --name makes another entry",
    NotTheAuthor: "only its author changes it; without --update, what you push becomes an entry of your own",
    Changed: "pull it, and push again what you have changed in it",
}


def client_of(url: str, key: str | None = None) -> Client:
    """Return a client that keeps answers in the user's cache. Raises BadInput for an address that cannot be used."""
    try:
        return Client(url, key, kept_answers())
    except ValueError as problem:
        message = f"the server's address {_without_user(url)} cannot be used: {problem}"
        raise BadInput([error("K030", message, help=_NO_ADDRESS)]) from None


def _without_user(url: str) -> str:
    """Return an address to print, without a user name and password that it may hold."""
    _, at, host = url.rpartition("@")
    return printed(f"...@{host}" if at else url)


def diagnostics_of(url: str, problem: NoAnswer | NotAsAgreed | Refused) -> tuple[Diagnostic, ...]:
    """Return the diagnostics for a call that failed: those of the server's checks, or one that says what to do."""
    match problem:
        case NoAnswer():
            return (error("K031", str(problem), help=_SILENT),)
        case NotAsAgreed():
            return (error("K032", f"{url}: {problem}"),)
    found = problem.diagnostics if isinstance(problem, Declined) else ()
    if has_errors(found):
        return found
    message = "; ".join((str(problem), *getattr(problem, "__notes__", ())))
    return (*found, error("K036", f"{url} refuses: {message}", help=_ADVICE.get(type(problem))))


def kept_warning(client: Client) -> tuple[Diagnostic, ...]:
    """Return a warning if a server did not answer and the user's cache did; nothing otherwise."""
    offline = client.offline
    return () if offline is None else (warning("K033", f"{offline}; this is what was read from it before"),)
