"""``planlang rate``: a rating for an entry."""

from __future__ import annotations

from executive.cli.console import Answer
from executive.cli.server import asking
from executive.cli.server_arguments import RateArguments
from planlang.knowledge.client import Client


@asking
def command(arguments: RateArguments, client: Client) -> Answer:
    """Rate an entry. Raises BadInput."""
    entry = client.rate(client.entry(arguments.uid), arguments.rating)
    given = "1 rating" if entry.ratings == 1 else f"{entry.ratings} ratings"
    shown = f"shown: {entry.rating or 0:.1f}, the median of {given} and two neutral ones of 5"
    text = f"{entry.uid}: saved your rating of {arguments.rating}; {shown}"
    return Answer(text=text, data={"uid": entry.uid, "rating": entry.rating, "ratings": entry.ratings})
