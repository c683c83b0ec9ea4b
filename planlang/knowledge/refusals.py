"""Diagnostics for failed requests to a knowledge-base server."""

from __future__ import annotations

from planlang.diagnostics import BadInput, Diagnostic, error, has_errors, warning
from planlang.knowledge.answers import Declined, KeyNeeded, NoAnswer, NotAsAgreed, ProxyFails, printed
from planlang.knowledge.client import Client
from planlang.knowledge.connection import kept_answers
from planlang.knowledge.entries import Changed, EntryExists, NoSuchEntry, NotTheAuthor, Refused
from planlang.words import Blank, Option, Text, calling

KEY = "PLANLANG_KEY"
"""Environment variable with the author's key."""
HOW_TO_MAKE_A_KEY = Text(
    "on the server, ", calling("serve", store=Blank("FILE"), new_key=Blank("AUTHOR")), " creates one"
)
_NO_ADDRESS = Text(
    "give the address of a server; ", calling("serve", store=Blank("FILE")), " starts one for the store in a file"
)
_SILENT = Text("check the address, and that ", calling("serve"), " is running there")
_PROXY = "correct the variable, unset it, or list the host of the server in NO_PROXY"
_ADVICE: dict[type[Refused], str] = {
    KeyNeeded: Text("give your key by ", Option("key_file", Blank("FILE")), f" or {KEY}; ", HOW_TO_MAKE_A_KEY),
    NoSuchEntry: Text(calling("search"), " lists the entries"),
    EntryExists: Text(
        Option("update", True),
        " uploads the next revision of your own entry; another ",
        Option("name"),
        " creates a new entry",
    ),
    NotTheAuthor: Text(
        "only its author can change it; without ", Option("update", True), " you push an entry of your own"
    ),
    Changed: "pull the entry, apply your changes again, then push it",
}


def client_of(url: str, key: str | None = None) -> Client:
    """Make a client with the user's cache of responses. Raises BadInput for an invalid address."""
    try:
        return Client(url, key, kept_answers())
    except ValueError as problem:
        _, at, host = url.rpartition("@")  # the user's name and password are not shown
        message = f"invalid server address {printed(f'...@{host}' if at else url)}: {problem}"
        raise BadInput([error("K030", message, help=_NO_ADDRESS)]) from None


def diagnostics_of(url: str, problem: NoAnswer | NotAsAgreed | Refused) -> tuple[Diagnostic, ...]:
    """Convert the exception of a failed request to diagnostics: the server's own, or one with advice."""
    match problem:
        case ProxyFails():
            return (error("K031", str(problem), help=_PROXY),)
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
    """Return a warning if results came from the cache because the server did not respond."""
    offline = client.offline
    return () if offline is None else (warning("K033", f"{offline}; showing the cached response"),)
