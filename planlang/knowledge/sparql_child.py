"""The process that answers SPARQL questions: it may be killed at any time, and can open neither file nor connection.

It reads messages from its standard input and writes one answer for each question to its standard output; each is a line
of JSON. ``{"put": uid, "triples": text}`` and ``{"drop": uid}`` change the graph of an entry, ``{"limit": bytes}``
closes the process off (answered, too), ``{"query": text, "rows": number}`` asks.
"""

from __future__ import annotations

import json
import os
import resource
import sys
from collections.abc import Iterable
from typing import Any

import pyoxigraph as ox

GRAPHS = "urn:entry:"
"""The beginning of the name of an entry's graph; the identifier follows."""


def close_off(room: int) -> None:
    """Give up the right to open anything, sockets included, and to use more than ``room`` bytes beside today's."""
    size = _size()
    listed = os.listdir("/proc/self/fd") if os.path.isdir("/proc/self/fd") else ["15"]
    limit = max(map(int, listed)) + 1
    resource.setrlimit(resource.RLIMIT_NOFILE, (limit, limit))
    for number in range(3, limit):
        if not _is_open(number):
            os.dup2(2, number)  # no free number is left below the limit
    resource.setrlimit(resource.RLIMIT_AS, (size + room, size + room))


def _size() -> int:
    """Return the bytes of address space in use."""
    try:
        with open("/proc/self/statm", "rb") as statistics:
            return int(statistics.read().split()[0]) * resource.getpagesize()
    except OSError:
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


def _is_open(number: int) -> bool:
    try:
        os.fstat(number)
    except OSError:
        return False
    return True


def answer(store: ox.Store, text: str, most: int) -> dict[str, Any]:
    """Return the answer to a question in SPARQL's JSON form, at most ``most`` rows, or ``{"error": reason}``."""
    try:
        found = store.query(text, use_default_graph_as_union=True)
    except (SyntaxError, ValueError, OSError) as problem:
        return {"error": str(problem)}
    try:
        if isinstance(found, ox.QueryBoolean):
            return {"head": {}, "boolean": bool(found)}
        if isinstance(found, ox.QueryTriples):
            return _limited({"triples": [f"{triple} ." for triple in _first(found, most + 1)]}, "triples", most)
        names = [variable.value for variable in found.variables]
        rows = [
            {name: _json(value) for name in names if (value := solution[name]) is not None}
            for solution in _first(found, most + 1)
        ]
        return {"head": {"vars": names}, **_limited({"rows": rows}, "rows", most)}
    except (SyntaxError, ValueError, OSError) as problem:  # evaluated row by row
        return {"error": str(problem)}


def _first(found: Iterable[Any], most: int) -> Iterable[Any]:
    for number, one in enumerate(found):
        if number == most:
            return
        yield one


def _limited(found: dict[str, Any], key: str, most: int) -> dict[str, Any]:
    return found if len(found[key]) <= most else {"limit": f"more than {most:,} rows"}


def _json(term: object) -> dict[str, Any]:
    match term:
        case ox.NamedNode(value=value):
            return {"type": "uri", "value": value}
        case ox.BlankNode(value=value):
            return {"type": "bnode", "value": value}
        case ox.Literal():
            data = {"type": "literal", "value": term.value}
            if term.language:
                return {**data, "xml:lang": term.language}
            is_plain = term.datatype.value == "http://www.w3.org/2001/XMLSchema#string"
            return data if is_plain else {**data, "datatype": term.datatype.value}
    return {"type": "literal", "value": str(term)}


def main() -> None:
    """Answer until the standard input ends."""
    os.nice(10)  # whoever asks for recipes goes first
    store = ox.Store()
    for line in sys.stdin.buffer:
        message = json.loads(line)
        if "limit" in message:
            close_off(message["limit"])
            sys.stdout.write("{}\n")  # ready: the time of a question does not begin before
            sys.stdout.flush()
        elif "query" in message:
            sys.stdout.write(json.dumps(answer(store, message["query"], message["rows"])) + "\n")
            sys.stdout.flush()
        else:
            graph = ox.NamedNode(GRAPHS + (message.get("put") or message["drop"]))
            store.remove_graph(graph)
            if "put" in message:
                store.load(message["triples"].encode(), ox.RdfFormat.N_TRIPLES, to_graph=graph, lenient=True)


if __name__ == "__main__":
    main()
