"""Arguments of the commands that are a server, or ask one: one dataclass each, as in ``arguments``."""

from __future__ import annotations

from enum import Enum
from pathlib import Path
from typing import Annotated

import typer

from executive.commands.base_arguments import Arguments, OntologyArguments
from planlang.records import dataclass


class KindWord(Enum):
    """Kinds of entries, here again as their module takes long to import."""

    RECIPE = "recipe"
    OBJECT = "object"
    ENVIRONMENT = "environment"
    ROBOT = "robot"
    EXPERIENCE = "experience"


@dataclass(frozen=True, kw_only=True)
class ServerArguments(Arguments):
    """Options of commands that ask a server."""

    server: Annotated[
        str | None,
        typer.Option(
            "--from",
            "--to",
            metavar="URL",
            help="The server's address; default: that in PLANLANG_SERVER.",
            show_default=False,
        ),
    ] = None


@dataclass(frozen=True, kw_only=True)
class AuthorArguments(ServerArguments):
    """Options of commands that need a key."""

    key_file: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="The file that holds your key; default: the key in PLANLANG_KEY."),
    ] = None


Uid = Annotated[str, typer.Argument(metavar="UID", help="The identifier of an entry, as search prints it.")]
Kind = Annotated[KindWord | None, typer.Option(help="The kind of entry.", show_default=False)]
Place = Annotated[str | None, typer.Option(metavar="NAME", help="Of maps: where their place is.", show_default=False)]


@dataclass(frozen=True, kw_only=True)
class SearchArguments(ServerArguments):
    """Search a server for recipes, object models, maps, robots and experiences.

    All that is given has to fit. An expression is a class in Manchester syntax; specialisations of it are found.
    """

    expression: Annotated[
        str | None,
        typer.Argument(metavar="EXPRESSION", help='What it is, e.g. "ServingFoodOrDrink and subAction some Reaching".'),
    ] = None
    label: Annotated[str | None, typer.Option(metavar="TEXT", help="A part of a label or name.")] = None
    kind: Kind = None
    room: Place = None
    floor: Place = None
    building: Place = None
    street: Place = None
    city: Place = None
    robot: Annotated[
        str | None,
        typer.Option(
            metavar="ROBOT", help="Tell what this robot (a file, or a bundled name) can use, and what it lacks."
        ),
    ] = None
    limit: Annotated[int, typer.Option(min=1, max=100_000, metavar="N", help="List at most so many.")] = 20


@dataclass(frozen=True, kw_only=True)
class PullArguments(ServerArguments):
    """Pull an entry from a server, with its files.

    What was pulled before is still there when the server does not answer. Python among the files runs only by
    planlang run --trust.
    """

    uid: Uid
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="FOLDER", help="The folder to write to; it is made.")
    ] = Path()
    revision: Annotated[int | None, typer.Option(min=1, metavar="N", help="An earlier revision.")] = None
    kind: Kind = None
    force: Annotated[bool, typer.Option("--force", help="Overwrite files that were not pulled.")] = False


@dataclass(frozen=True, kw_only=True)
class PushArguments(AuthorArguments):
    """Push an ontology to a server, as a new entry or as the next revision of one of yours.

    The server checks it as planlang check does; what is wrong is shown with its place in the file.
    """

    file: Annotated[str, typer.Argument(metavar="FILE", help="The ontology: RDF/XML, Turtle or Manchester syntax.")]
    kind: Annotated[KindWord, typer.Option(help="What it is.", show_default=False)]
    name: Annotated[str, typer.Option(metavar="NAME", help="Your own name for it; with --update, also its identifier.")]
    about: Annotated[
        str | None,
        typer.Option(metavar="CLASS", help="What it is about, where it could be about several: local name or IRI."),
    ] = None
    update: Annotated[bool, typer.Option("--update", help="It is the next revision of your entry of that name.")] = (
        False
    )
    attach: Annotated[
        list[Path] | None, typer.Option(metavar="FILE", help="A file that belongs to it; repeatable.")
    ] = None


@dataclass(frozen=True, kw_only=True)
class RateArguments(AuthorArguments):
    """Rate an entry, from 0 to 10; a second rating takes the place of the first."""

    uid: Uid
    rating: Annotated[int, typer.Argument(min=0, max=10, metavar="0..10", help="How good it is.")]


@dataclass(frozen=True, kw_only=True)
class DeleteArguments(AuthorArguments):
    """Delete an entry of yours with all its revisions and files, or only files of it."""

    uid: Uid
    file: Annotated[
        list[str] | None, typer.Option(metavar="NAME", help="Delete only this file of the entry; repeatable.")
    ] = None


@dataclass(frozen=True, kw_only=True)
class WatchArguments(AuthorArguments):
    """Subscribe to entries, and follow the news of all that you subscribed to, until Ctrl-C."""

    uids: Annotated[
        list[str] | None, typer.Argument(metavar="[UID]...", help="Entries to subscribe to; none: those of before.")
    ] = None
    after: Annotated[
        int | None,
        typer.Option(min=0, metavar="N", help="Begin behind this line of the feed; default: with what is to come."),
    ] = None
    once: Annotated[bool, typer.Option("--once", help="Print what there is, and end.")] = False
    stop: Annotated[bool, typer.Option("--stop", help="End the subscriptions to these entries instead.")] = False
    every: Annotated[float, typer.Option(min=0.1, max=86_400, metavar="S", help="Ask every so many seconds.")] = 5.0


@dataclass(frozen=True, kw_only=True)
class ServeArguments(OntologyArguments):
    """Serve a knowledge base over HTTP: recipes, object models, maps, self-models (needs planlang[serve]).

    Who changes something needs a key. Ctrl-C ends the server when it has answered what it was asked.
    """

    store: Annotated[
        str,
        typer.Option(
            metavar="FILE|URL",
            help="The file of the knowledge base; it is made if there is none. Or a SPARQL 1.1 endpoint that several "
            "servers share: sparql+https://HOST/PATH, with --contents.",
        ),
    ]
    contents: Annotated[
        str | None,
        typer.Option(metavar="URL", help="Where contents are kept beside an endpoint: s3://, gs://, az://, file://."),
    ] = None
    host: Annotated[str, typer.Option(metavar="ADDRESS", help="The address to listen at.")] = "127.0.0.1"
    port: Annotated[int, typer.Option(min=0, max=65535, help="The port to listen at; 0: any free one.")] = 8080
    access_log: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Write a line of JSON for each request to the end of a file; -: to stderr."),
    ] = None
    check_seconds: Annotated[
        int,
        typer.Option(min=1, metavar="SECONDS", help="CPU time after which a check or a conversion is ended."),
    ] = 10
    rate: Annotated[
        float,
        typer.Option(
            min=0, metavar="NUMBER", help="Requests of one author, or of one address, in a second; 0: any number."
        ),
    ] = 500.0
    new_key: Annotated[
        str | None, typer.Option(metavar="AUTHOR", help="Print a new key for an author, and serve nothing.")
    ] = None
    drop_keys: Annotated[
        str | None,
        typer.Option(metavar="AUTHOR", help="Let no earlier key of an author be valid any more, and serve nothing."),
    ] = None
