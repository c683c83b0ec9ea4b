"""The server that a command asks: its address, the author's key, and what its refusals mean for the user."""

from __future__ import annotations

import os
import re
from collections.abc import Callable
from dataclasses import replace
from urllib.parse import urlsplit

from executive.cli.console import Answer, ExitCode
from executive.cli.server_arguments import AuthorArguments, KindWord, ServerArguments
from planlang.diagnostics import BadInput, error, has_errors, warning
from planlang.files import read_file
from planlang.knowledge.answers import Declined, KeyNeeded, NoAnswer, NotAsAgreed
from planlang.knowledge.client import Client
from planlang.knowledge.connection import kept_answers
from planlang.knowledge.entries import Kind
from planlang.knowledge.stores import Changed, EntryExists, NoSuchEntry, NotTheAuthor, Refused

SERVER, KEY = "PLANLANG_SERVER", "PLANLANG_KEY"
"""Environment variables of the server's address and of the author's key."""
LARGEST_KEY_FILE = 1_000
_KEY = re.compile(r"[A-Za-z0-9._~+/=-]{1,500}")
_MAKE = "planlang serve --store FILE --new-key AUTHOR makes one where the server runs"
_SILENT = "does planlang serve run there, and is the address right?"
_ADVICE: dict[type[Refused], str] = {
    KeyNeeded: f"--key-file FILE, or {KEY}, gives your key; {_MAKE}",
    NoSuchEntry: "planlang search lists what there is",
    EntryExists: "--update makes the next revision of your own; another --name makes another entry",
    NotTheAuthor: "only its author changes it; without --update, what you push becomes an entry of your own",
    Changed: "pull it, and push again what you have changed in it",
}


def ask(arguments: ServerArguments, work: Callable[[Client], Answer]) -> Answer:
    """Do a command's work with a client of the server that the arguments name; says what its refusals mean.

    Exit code 1 if the server does not answer as agreed. Raises BadInput.
    """
    with _client(arguments) as client:
        try:
            reply = work(client)
        except NoAnswer as problem:
            return Answer(ExitCode.FAILED, (error("K031", str(problem), help=_SILENT),))
        except NotAsAgreed as problem:
            return Answer(ExitCode.FAILED, (error("K032", f"{client.url}: {problem}"),))
        except Refused as problem:
            raise _refused(client.url, problem) from None
        warned = []
        if client.offline is not None:
            warned.append(warning("K033", f"{client.offline}; this is what was read from it before"))
        if isinstance(arguments, AuthorArguments) and _can_be_read(client.url):
            warned.append(warning("K043", f"your key went to {client.url} unencrypted", help="use https"))
        return replace(reply, diagnostics=(*reply.diagnostics, *warned))


def _can_be_read(url: str) -> bool:
    """Return True if what is sent to an address can be read on its way: without TLS, to another machine."""
    parts = urlsplit(url)
    return parts.scheme == "http" and parts.hostname not in ("localhost", "127.0.0.1", "::1")


def _client(arguments: ServerArguments) -> Client:
    url = arguments.server or os.environ.get(SERVER)
    if not url:
        raise BadInput([error("K030", "no server was named", help=f"add --from URL, or set {SERVER}")])
    key = _key(arguments) if isinstance(arguments, AuthorArguments) else None  # a reader tells nobody who he is
    try:
        return Client(url, key, kept_answers())
    except ValueError as problem:
        raise BadInput([error("K030", f"the server's address cannot be used: {problem}")]) from None


def _key(arguments: AuthorArguments) -> str | None:
    """Return the author's key, of the file or the environment, without ever showing it. Raises BadInput."""
    where = KEY if arguments.key_file is None else str(arguments.key_file)
    stated = os.environ.get(KEY)
    if arguments.key_file is not None:
        stated = read_file(arguments.key_file, largest=LARGEST_KEY_FILE).decode("ascii", errors="replace")
    if stated is None:
        return None
    if not _KEY.fullmatch(stated.strip()):
        raise BadInput([error("K034", f"{where} holds no key", help=_MAKE)])
    return stated.strip()


def _refused(url: str, problem: Refused) -> BadInput:
    found = problem.diagnostics if isinstance(problem, Declined) else ()
    if has_errors(found):
        return BadInput(found)
    message = "; ".join((str(problem), *getattr(problem, "__notes__", ())))
    return BadInput([*found, error("K036", f"{url} refuses: {message}", help=_ADVICE.get(type(problem)))])


def kind_of(word: KindWord | None) -> Kind | None:
    """Return the kind that a word means."""
    return None if word is None else next(kind for kind in Kind if kind.word == word.value)
