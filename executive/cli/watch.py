"""``planlang watch``: news of entries, as they arrive."""

from __future__ import annotations

import sys
import time
from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import asdict

import click

from executive.cli.console import Answer, printer_of, say
from executive.cli.server import asking
from executive.cli.server_arguments import WatchArguments
from planlang.diagnostics import BadInput, error
from planlang.knowledge.answers import NoAnswer
from planlang.knowledge.client import Client
from planlang.knowledge.entries import News
from planlang.visible import visible

MOST_KEPT = 10_000
"""Number of the latest news that --json prints at the end."""


@asking
def command(arguments: WatchArguments, client: Client) -> Answer:
    """Print news until Ctrl-C, which is the usual end. Raises BadInput."""
    if arguments.stop:
        return _unsubscribe(client, arguments.uids or ())
    kept: deque[News] = deque(maxlen=MOST_KEPT)
    try:
        for uid in arguments.uids or ():
            client.subscribe(uid)
        after = arguments.after
        if after is None:
            after = _last(client)
        watched = client.subscriptions()
        printer_of(arguments)(f"watching {', '.join(watched)}" if watched else "you have no subscriptions")
        for news in _followed(client, after, arguments):
            kept.append(news)
            if not arguments.json:
                what = f"{news.change.value:8}  {news.uid} by {news.author}"
                click.echo(visible(f"{news.number:6}  {news.made}  {what}"))
                sys.stdout.flush()
    except KeyboardInterrupt:
        pass
    return Answer(data={"news": [asdict(one) for one in kept]})


def _unsubscribe(client: Client, uids: Iterable[str]) -> Answer:
    """Cancel subscriptions, and list the remaining ones."""
    before = client.subscriptions()
    if unknown := [uid for uid in uids if uid not in before] or ([] if uids else ["no entry"]):
        watched = f"your subscriptions: {', '.join(before)}" if before else "you have no subscriptions"
        raise BadInput([error("K047", f"you have not subscribed to {', '.join(unknown)}", help=watched)])
    for uid in uids:
        client.unsubscribe(uid)
    left = client.subscriptions()
    text = f"watching {', '.join(left)}" if left else "you have no subscriptions left"
    return Answer(text=text, data={"watching": left})


def _last(client: Client) -> int:
    """Number of the last line of the feed."""
    after = 0
    while True:
        news, following = client.news(after, mine=True)
        if not news:
            return after
        after = max(following, after + 1)


def _followed(client: Client, after: int, arguments: WatchArguments) -> Iterator[News]:
    """Yield news after a line of the feed; retries if the server does not answer."""
    is_there = True
    while True:
        try:
            news, following = client.news(after, mine=True)
        except NoAnswer as problem:
            if arguments.once:
                raise
            if is_there and not arguments.json:
                say(f"{problem}; trying again")
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
