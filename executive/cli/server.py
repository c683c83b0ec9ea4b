"""The server that a command talks to: its address and the author's key."""

from __future__ import annotations

import os
import re
from collections.abc import Callable
from dataclasses import replace
from typing import TypeVar
from urllib.parse import urlsplit

from executive.cli.console import Answer, ExitCode
from executive.cli.server_arguments import AuthorArguments, KindWord, ServerArguments
from planlang.diagnostics import BadInput, error, warning
from planlang.files import read_file
from planlang.knowledge.answers import NoAnswer, NotAsAgreed
from planlang.knowledge.client import Client
from planlang.knowledge.entries import Kind, Refused
from planlang.knowledge.refusals import HOW_TO_MAKE_A_KEY, KEY, client_of, diagnostics_of, kept_warning

SERVER = "PLANLANG_SERVER"
"""Environment variable of the server's address."""
LARGEST_KEY_FILE = 1_000
_KEY = re.compile(r"[A-Za-z0-9._~+/=-]{1,500}")


A = TypeVar("A", bound=ServerArguments)


def asking(work: Callable[[A, Client], Answer]) -> Callable[[A], Answer]:
    """Make a command of its work with a client of the server that the arguments name; refusals become diagnostics.

    Exit code 1 if the server does not answer as agreed. The command raises BadInput.
    """

    def command(arguments: A) -> Answer:
        with _client(arguments) as client:
            try:
                reply = work(arguments, client)
            except (NoAnswer, NotAsAgreed) as problem:
                return Answer(ExitCode.FAILED, diagnostics_of(client.url, problem))
            except Refused as problem:
                raise BadInput(diagnostics_of(client.url, problem)) from None
            warned = [*kept_warning(client)]
            url = urlsplit(client.url)
            can_be_read = url.scheme == "http" and url.hostname not in ("localhost", "127.0.0.1", "::1")  # by others
            if isinstance(arguments, AuthorArguments) and can_be_read:
                warned.append(warning("K043", f"your key went to {client.url} unencrypted", help="use https"))
            return replace(reply, diagnostics=(*reply.diagnostics, *warned))

    return command


def _client(arguments: ServerArguments) -> Client:
    url = arguments.server or os.environ.get(SERVER)
    if not url:
        raise BadInput([error("K030", "no server was named", help=f"add --from URL, or set {SERVER}")])
    key = _key(arguments) if isinstance(arguments, AuthorArguments) else None  # readers stay anonymous
    return client_of(url, key)


def _key(arguments: AuthorArguments) -> str | None:
    """Read the author's key from the file or the environment; it is never shown. Raises BadInput."""
    where = KEY if arguments.key_file is None else str(arguments.key_file)
    key = os.environ.get(KEY)
    if arguments.key_file is not None:
        key = read_file(arguments.key_file, largest=LARGEST_KEY_FILE).decode("ascii", errors="replace")
    if key is None:
        return None
    if not _KEY.fullmatch(key.strip()):
        raise BadInput([error("K034", f"{where} does not hold a key", help=HOW_TO_MAKE_A_KEY)])
    return key.strip()


def kind_of(word: KindWord | None) -> Kind | None:
    """Kind of entry for its word on the command line."""
    return None if word is None else next(kind for kind in Kind if kind.word == word.value)
