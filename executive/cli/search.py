"""``planlang search``: entries of a server that meet criteria, and whether a robot can use them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict
from itertools import islice

from executive.cli.console import Answer
from executive.cli.server import asking, kind_of
from executive.cli.server_arguments import SearchArguments
from executive.runs.files import chosen, refuse
from planlang.diagnostics import BadInput, Diagnostic, Span, error
from planlang.files import LARGEST, Bundled, decode, read_file
from planlang.knowledge.answers import Found
from planlang.knowledge.client import Client


@asking
def command(arguments: SearchArguments, client: Client) -> Answer:
    """List matching entries of a server. Raises BadInput."""
    robot = None if arguments.robot is None else self_model_of(arguments.robot)
    kind = kind_of(arguments.kind)
    entries = client.search(
        expression=arguments.expression,
        label=arguments.label,
        kind=kind.value if kind else None,
        room=arguments.room,
        floor=arguments.floor,
        building=arguments.building,
        street=arguments.street,
        city=arguments.city,
        sort="rating",
        robot=robot,
        most=arguments.limit + 1,
    )
    return _answer(list(islice(entries, arguments.limit + 1)), arguments.limit)


def self_model_of(name: str) -> str:
    """Read a robot's self-model, which its robot file may name. Raises BadInput."""
    from executive.robots.robot_file import looks_like_toml, read_robot_file  # as slow to import as all else together

    problems: list[Diagnostic] = []
    path = chosen(Bundled.ROBOT, name, None, problems)
    refuse(problems)
    assert path is not None
    if looks_like_toml(path):
        stated = read_robot_file(path).self_model
        if stated is None:
            advice = "add self_model = FILE to the robot file, or give that ontology to --robot"
            raise BadInput([error("K037", f"{path.name} names no self-model", Span(str(path)), advice)])
        path = stated
    return decode(read_file(path, largest=LARGEST), str(path))


def _answer(found: list[Found], limit: int) -> Answer:
    entries = found[:limit]
    data = {"entries": [{**asdict(one.entry), "etag": one.entry.etag, **_ability(one)} for one in entries]}
    counted = f"{len(entries)} {'entry' if len(entries) == 1 else 'entries'}"
    last = counted if len(found) <= limit else f"the first {counted}; --limit {10 * limit} lists more"
    return Answer(text="\n".join((*_lines(entries), last)), data=data)


def _ability(one: Found) -> dict[str, object]:
    return {} if one.can is None else {"can": one.can, "missing": [asdict(lack) for lack in one.missing]}


def _lines(entries: list[Found]) -> Iterator[str]:
    wide = max((len(one.entry.uid) for one in entries), default=0)
    for one in entries:
        entry = one.entry
        can = "" if one.can is None else f"{one.can:7}  "
        rated = "" if entry.rating is None else f", rated {entry.rating:.1f} by {entry.ratings}"
        origin = f"by {entry.author}, revision {entry.revision.number}{rated}"
        yield f"{can}{entry.uid:{wide}}  {entry.kind.word:11}  {entry.label} ({origin})"
        yield from (f"         {lack.name}: {lack.reason}" for lack in one.missing)
