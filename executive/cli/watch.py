"""``planlang watch``: the news of entries, as they come."""

from __future__ import annotations

import sys
import time
from collections import deque
from collections.abc import Iterator
from dataclasses import asdict

import typer

from executive.cli.console import Answer, say, silent
from executive.cli.server import ask
from executive.cli.server_arguments import WatchArguments
from planlang.knowledge.answers import NoAnswer
from planlang.knowledge.client import Client
from planlang.knowledge.entries import News

MOST_KEPT = 10_000
"""News that --json prints at the end, the latest ones."""


def command(arguments: WatchArguments) -> Answer:
    """Follow the news until Ctrl-C, which is the usual end. Raises BadInput."""
    return ask(arguments, lambda client: _watch(client, arguments))


def _watch(client: Client, arguments: WatchArguments) -> Answer:
    kept: deque[News] = deque(maxlen=MOST_KEPT)
    tell = silent if arguments.json else say
    try:
        for uid in arguments.uids or ():
            client.subscribe(uid)
        after = arguments.after
        if after is None:
            after = _last(client)
        watched = client.subscriptions()
        tell(f"watching {', '.join(watched)}" if watched else "you have subscribed to nothing")
        for news in _followed(client, after, arguments):
            kept.append(news)
            if not arguments.json:
                _print(news)
    except KeyboardInterrupt:
        pass
    return Answer(data={"news": [asdict(one) for one in kept]})


def _last(client: Client) -> int:
    """Return the number of the last line of the feed."""
    after = 0
    while True:
        news, following = client.news(after, mine=True)
        if not news:
            return after
        after = max(following, after + 1)


def _followed(client: Client, after: int, arguments: WatchArguments) -> Iterator[News]:
    """Yield what happens behind a line of the feed; a server that does not answer is asked again later."""
    is_there = True
    while True:
        try:
            news, following = client.news(after, mine=True)
        except NoAnswer as problem:
            if arguments.once:
                raise
            if is_there and not arguments.json:
                say(f"{problem}; it is asked again")
            is_there, news, following = False, (), after
        else:
            if not is_there and not arguments.json:
                say(f"{client.url} answers again")
            is_there = True
        yield from news
        if news:
            after = max(following, after + 1)
        elif arguments.once:
            return
        else:
            time.sleep(arguments.every)


def _print(news: News) -> None:
    typer.echo(f"{news.number:6}  {news.made}  {news.change.value:8}  {news.uid} by {news.author}")
    sys.stdout.flush()
