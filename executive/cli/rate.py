"""``planlang rate``: a rating for an entry."""

from __future__ import annotations

from executive.cli.server import ask
from executive.cli.server_arguments import RateArguments
from executive.commands.answers import Answer
from planlang.knowledge.client import Client


def command(arguments: RateArguments) -> Answer:
    """Rate an entry. Raises BadInput."""

    def work(client: Client) -> Answer:
        entry = client.rate(client.entry(arguments.uid), arguments.rating)
        given = f"your {arguments.rating} is counted"
        text = f"{entry.uid}: {given}; rated {entry.rating or 0:.1f} by {entry.ratings}"
        return Answer(text=text, data={"uid": entry.uid, "rating": entry.rating, "ratings": entry.ratings})

    return ask(arguments, work)
