"""Arguments of ``serve`` and of the commands that talk to a server, as in :mod:`executive.cli.arguments`."""

from __future__ import annotations

from enum import Enum
from pathlib import Path
from typing import Annotated

from executive.cli.arguments import Arguments, OntologyArguments, PlaceArguments
from executive.options.declaring import argument, option, output_folder
from planlang.records import dataclass


class KindWord(Enum):
    """Kinds of entries; repeated here as their module is slow to import."""

    RECIPE = "recipe"
    OBJECT = "object"
    ENVIRONMENT = "environment"
    ROBOT = "robot"
    EXPERIENCE = "experience"


@dataclass(frozen=True, kw_only=True)
class ServerArguments(Arguments):
    """Options of commands that talk to a server."""

    server: Annotated[
        str | None,
        option(
            "--from",
            "--to",
            metavar="URL",
            help="Address of the server; default: PLANLANG_SERVER.",
            shows_default=False,
        ),
    ] = None


@dataclass(frozen=True, kw_only=True)
class AuthorArguments(ServerArguments):
    """Options of commands that need a key."""

    key_file: Annotated[
        Path | None,
        option(metavar="FILE", help="File with your key; default: the key in PLANLANG_KEY."),
    ] = None


Uid = Annotated[str, argument(metavar="UID", help="Identifier of the entry, as search prints it.")]
Kind = Annotated[KindWord | None, option(help="Kind of entry.", shows_default=False)]


@dataclass(frozen=True, kw_only=True)
class SearchArguments(PlaceArguments, ServerArguments):
    """Search a server for recipes, object models, maps, robots and experiences.

    An entry must meet all criteria. EXPRESSION is a class in Manchester syntax; subclasses match, too.
    """

    expression: Annotated[
        str | None,
        argument(
            metavar="EXPRESSION", help='Class of the entry, e.g. "ServingFoodOrDrink and subAction some Reaching".'
        ),
    ] = None
    label: Annotated[str | None, option(metavar="TEXT", help="Part of the label or name.")] = None
    kind: Kind = None
    robot: Annotated[
        str | None,
        option(metavar="ROBOT", help="Show what this robot (a file, or a bundled one) can use, and what it lacks."),
    ] = None
    limit: Annotated[int, option(least=1, most=100_000, metavar="N", help="List at most N entries.")] = 20


@dataclass(frozen=True, kw_only=True)
class PullArguments(ServerArguments):
    """Pull an entry from a server, with its files.

    If the server does not answer, the copy of an earlier pull is used. Python among the files runs only with
    planlang run --trust.
    """

    uid: Uid
    output: Annotated[Path, output_folder("Folder to write to; created if needed.")] = Path()
    revision: Annotated[
        int | None, option(least=1, metavar="N", help="Number of the revision; default: the latest.")
    ] = None
    kind: Kind = None
    force: Annotated[bool, option(help="Overwrite files that were not pulled.")] = False


@dataclass(frozen=True, kw_only=True)
class PushArguments(AuthorArguments):
    """Push an ontology to a server, as a new entry or as the next revision of one of yours.

    The server checks it as planlang check does; problems are shown with their place in the file.
    """

    file: Annotated[
        str,
        argument(metavar="FILE", help="The ontology: RDF/XML, OWL/XML, Turtle, functional or Manchester syntax."),
    ]
    kind: Annotated[KindWord, option(help="Kind of entry.", shows_default=False)]
    name: Annotated[str, option(metavar="NAME", help="Your name for the entry; with --update, also its identifier.")]
    about: Annotated[
        str | None,
        option(metavar="CLASS", help="Class that the entry is about, if there are several: local name or IRI."),
    ] = None
    update: Annotated[bool, option(help="Add a revision to your entry of that name.")] = False
    attach: Annotated[list[Path] | None, option(metavar="FILE", help="Attach this file to the entry; repeatable.")] = (
        None
    )


@dataclass(frozen=True, kw_only=True)
class RateArguments(AuthorArguments):
    """Rate an entry, from 0 to 10; a second rating replaces the first."""

    uid: Uid
    rating: Annotated[int, argument(least=0, most=10, metavar="0..10", help="Your rating; 10 is best.")]


@dataclass(frozen=True, kw_only=True)
class DeleteArguments(AuthorArguments):
    """Delete an entry of yours with all its revisions and files, or only some of its files."""

    uid: Uid
    file: Annotated[
        list[str] | None, option(metavar="NAME", help="Delete only this file of the entry; repeatable.")
    ] = None


@dataclass(frozen=True, kw_only=True)
class WatchArguments(AuthorArguments):
    """Subscribe to entries, and print the news of all your subscriptions until Ctrl-C."""

    uids: Annotated[
        list[str] | None, argument(metavar="[UID]...", help="Entries to subscribe to; default: no new ones.")
    ] = None
    after: Annotated[
        int | None,
        option(least=0, metavar="N", help="Start after this line of the feed; default: at its end."),
    ] = None
    once: Annotated[bool, option(help="Print pending news, and exit.")] = False
    stop: Annotated[bool, option(help="Cancel the subscriptions to these entries instead.")] = False
    every: Annotated[float, option(least=0.1, most=86_400, metavar="S", help="Polling interval [s].")] = 5.0


@dataclass(frozen=True, kw_only=True)
class BackupArguments(Arguments):
    """Back up a knowledge base while it is served.

    The backup is a store itself: to restore it, serve it. Its structure and contents are checked before it replaces an
    earlier one.
    """

    store: Annotated[str, argument(metavar="STORE", help="File of the knowledge base.")]
    target: Annotated[Path, argument(metavar="FILE", help="File of the backup.")]
    force: Annotated[bool, option(help="Replace FILE if it exists.")] = False


@dataclass(frozen=True, kw_only=True)
class ServeArguments(OntologyArguments):
    """Serve a knowledge base over HTTP: recipes, object models, maps, self-models (needs the extra serve).

    Changes need a key. Ctrl-C stops the server once pending requests are answered.
    """

    store: Annotated[
        str,
        option(
            metavar="FILE|URL",
            help="File of the knowledge base, created if needed; or a SPARQL 1.1 endpoint that several servers share: "
            "sparql+https://HOST/PATH, with --contents.",
        ),
    ]
    contents: Annotated[
        str | None,
        option(metavar="URL", help="Storage for contents, with an endpoint: s3://, gs://, az://, file://."),
    ] = None
    host: Annotated[str, option(metavar="ADDRESS", help="Address to listen on.")] = "127.0.0.1"
    port: Annotated[int, option(least=0, most=65535, help="Port to listen on; 0: any free port.")] = 8080
    access_log: Annotated[
        Path | None,
        option(metavar="FILE", help="Append a line of JSON for each request to this file; -: stderr."),
    ] = None
    check_seconds: Annotated[
        int,
        option(least=1, metavar="SECONDS", help="CPU time limit of a check or a conversion [s]."),
    ] = 10
    rate: Annotated[
        float,
        option(
            least=0, metavar="NUMBER", help="Maximum requests per second of an author, or of an address; 0: unlimited."
        ),
    ] = 500.0
    new_key: Annotated[str | None, option(metavar="AUTHOR", help="Print a new key for an author, then exit.")] = None
    drop_keys: Annotated[
        str | None,
        option(metavar="AUTHOR", help="Revoke all keys of an author, then exit."),
    ] = None
