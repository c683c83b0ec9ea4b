"""The process that answers SPARQL questions: each in a fork of it that may be killed, and can open nothing.

It reads messages from its standard input and writes one answer for each to its standard output; both are lines of JSON.
``{"put": uid, "type": media type, "base": iri, "size": bytes}``, behind which the content follows, and
``{"drop": uid}`` change the graph of an entry; ``{"query": text, "rows": number, "bytes": number, "seconds": number,
"memory": bytes}`` asks.
"""

from __future__ import annotations

import json
import os
import re
import resource
import signal
import sys
from collections.abc import Callable, Iterable, Iterator
from itertools import pairwise
from typing import Any

import pyoxigraph as ox

_FORMATS = {
    "application/rdf+xml": ox.RdfFormat.RDF_XML,
    "text/turtle": ox.RdfFormat.TURTLE,
    "application/n-triples": ox.RdfFormat.N_TRIPLES,
}
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
    stated = tuple(words(text))
    if is_too_deep(text):
        return {"error": f"it has more than {DEEPEST} brackets inside each other, or signs in a row"}
    if any(one == "SERVICE" and other != "SILENT" for one, other in pairwise((*stated, ""))):
        return {"error": "SERVICE asks another server, which is not done here: ask that server itself"}
    try:
        # a question that names its graphs (FROM) is about these alone
        found = store.query(text, use_default_graph_as_union="FROM" not in stated)
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
    store, stream = ox.Store(), sys.stdin.buffer
    for line in stream:
        message = json.loads(line)
        if "query" in message:
            told = _asked(store, message)
        else:
            told = _changed(store, message, stream.read(message.get("size", 0)))
        if told is not None:
            _tell(_line(told))


def _changed(store: ox.Store, message: dict[str, Any], content: bytes) -> dict[str, Any]:
    """Change the graph of an entry; returns ``{"done": False}`` for no content of its type, and for no name."""
    try:
        graph = ox.NamedNode(GRAPHS + (message.get("put") or message["drop"]))
    except ValueError:
        return {"done": False}
    store.remove_graph(graph)
    form = _FORMATS.get(message.get("type", ""))
    if form is None:
        return {"done": "drop" in message}
    try:
        store.load(content, form, base_iri=message["base"], to_graph=graph, lenient=form is ox.RdfFormat.N_TRIPLES)
    except (SyntaxError, ValueError):
        store.remove_graph(graph)
        return {"done": False}
    return {"done": True}


def _asked(store: ox.Store, message: dict[str, Any]) -> dict[str, Any] | None:
    """Let a fork answer a question; returns why it has not, None if it has."""
    child = os.fork()
    if child == 0:
        status = 1
        try:
            close_off(message["memory"])
            signal.setitimer(signal.ITIMER_REAL, message["seconds"])
            found = answer(store, message["query"], message["rows"])
            _tell(_line_within(found, message["bytes"]), lambda: signal.setitimer(signal.ITIMER_REAL, 0))
            status = 0
        finally:
            os._exit(status)
    _, status = os.waitpid(child, 0)
    if status == 0:
        return None
    ended_by = os.WTERMSIG(status) if os.WIFSIGNALED(status) else None
    if ended_by == signal.SIGSEGV:
        return {"error": "it is too long a chain of one operator, or too deep, for its reader"}
    is_late = ended_by == signal.SIGALRM
    limit = f"{message['seconds']:g} s" if is_late else f"{message['memory'] / 1e6:g} MB of memory"
    return {"exceeded": limit}


def _line(answered: dict[str, Any]) -> bytes:
    return json.dumps(answered, ensure_ascii=False).encode() + b"\n"


def _line_within(answered: dict[str, Any], most: int) -> bytes:
    """Return the line of an answer of at most ``most`` bytes, or that it has more."""
    line = _line(answered)
    return line if len(line) <= most else _line({"limit": f"more than {most / 1e6:g} MB"})


def _tell(data: bytes, before: Callable[[], object] = bool) -> None:
    """Write a line; ``before`` is called when nothing but the writing is left."""
    before()
    while data:
        data = data[os.write(1, data) :]


DEEPEST = 200
"""Brackets inside each other, and signs such as ``!`` in a row; the engine's stack ends at some thousand."""

_TOKEN = re.compile(
    r"""(?P<passed>\#[^\n\r]*                                  # a comment
    |<[^<>"{}|^`\\\x00-\x20]*>                                 # an IRI
    |\"\"\"(?:[^"\\]|\\.|"(?!""))*\"\"\"|'''(?:[^'\\]|\\.|'(?!''))*'''
    |"(?:[^"\\\n\r]|\\.)*"|'(?:[^'\\\n\r]|\\.)*'               # texts
    |[?$]\w+|[\w.-]*:[\w.:%-]*|@[\w-]+)                        # variables, names with a prefix, languages
    |(?P<open>[({\[])|(?P<close>[)}\]])|(?P<sign>[!+^-])|(?P<word>\w+)|(?P<other>[^\s])""",
    re.VERBOSE | re.DOTALL,
)


def words(question: str) -> Iterator[str]:
    """Yield the words of a question in capitals that are no names, variables, IRIs, texts or comments."""
    return (found["word"].upper() for found in _TOKEN.finditer(question) if found["word"])


def is_too_deep(question: str) -> bool:
    """Return True for more brackets inside each other, or more signs in a row, than the engine can read."""
    depth = signs = 0
    for found in _TOKEN.finditer(question):
        signs = signs + 1 if found["sign"] else 0
        depth += bool(found["open"]) - bool(found["close"])
        if max(depth, signs) > DEEPEST:
            return True
    return False


if __name__ == "__main__":
    main()
