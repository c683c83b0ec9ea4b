"""Process for SPARQL queries; each query runs in a fork that can open nothing and may be killed.

It reads messages from standard input and writes a response for each to standard output, both as lines of JSON.
``{"put": uid, "type": media type, "base": iri, "size": bytes}``, followed by the content, and ``{"drop": uid}`` change
the graph of an entry; ``{"query": text, "rows": number, "bytes": number, "seconds": number, "memory": bytes}`` runs a
query.
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

from planlang.machine import lower, used_address_space

_FORMATS = {
    "application/rdf+xml": ox.RdfFormat.RDF_XML,
    "text/turtle": ox.RdfFormat.TURTLE,
    "application/n-triples": ox.RdfFormat.N_TRIPLES,
}
GRAPHS = "urn:entry:"
"""Prefix of graph names; the identifier of the entry follows."""


def close_off(room: int) -> None:
    """Give up the ability to open files and sockets, and to use more than ``room`` bytes of additional memory."""
    size = used_address_space()
    listed = os.listdir("/proc/self/fd") if os.path.isdir("/proc/self/fd") else ["15"]
    limit = max(map(int, listed)) + 1
    resource.setrlimit(resource.RLIMIT_NOFILE, (limit, limit))
    for number in range(3, limit):
        if not _is_open(number):
            os.dup2(2, number)  # no free number is left below the limit
    lower(resource.RLIMIT_AS, size + room)


def _is_open(number: int) -> bool:
    try:
        os.fstat(number)
    except OSError:
        return False
    return True


def answer(store: ox.Store, text: str, most: int) -> dict[str, Any]:
    """Run a query; return at most ``most`` rows in SPARQL's JSON format, or ``{"error": reason}``."""
    stated = tuple(words(text))
    if is_too_deep(text):
        return {"error": f"more than {DEEPEST} nested brackets, or signs in a row"}
    if any(one == "SERVICE" and other != "SILENT" for one, other in pairwise((*stated, ""))):
        return {"error": "SERVICE is not supported; query the other server directly"}
    try:
        # a query with FROM reads only the graphs it names
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
    except (SyntaxError, ValueError, OSError) as problem:  # rows are evaluated lazily
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
    """Process messages until standard input ends."""
    os.nice(10)  # the server's other requests take precedence
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
    """Change the graph of an entry; return ``{"done": False}`` for invalid content or an invalid name."""
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
    """Run a query in a fork; return the reason if it failed, None if the fork has responded."""
    child = os.fork()
    if child == 0:
        status = 1
        try:
            close_off(message["memory"])
            signal.setitimer(signal.ITIMER_REAL, message["seconds"])
            found = answer(store, message["query"], message["rows"])
            line, most = _line(found), message["bytes"]
            if len(line) > most:
                line = _line({"limit": f"more than {most / 1e6:g} MB"})
            _tell(line, lambda: signal.setitimer(signal.ITIMER_REAL, 0))
            status = 0
        finally:
            os._exit(status)
    _, status = os.waitpid(child, 0)
    if status == 0:
        return None
    ended_by = os.WTERMSIG(status) if os.WIFSIGNALED(status) else None
    if ended_by == signal.SIGSEGV:
        return {"error": "the query is nested too deeply, or chains one operator too often"}
    is_late = ended_by == signal.SIGALRM
    limit = f"{message['seconds']:g} s" if is_late else f"{message['memory'] / 1e6:g} MB of memory"
    return {"exceeded": limit}


def _line(answered: dict[str, Any]) -> bytes:
    return json.dumps(answered, ensure_ascii=False).encode() + b"\n"


def _tell(data: bytes, before: Callable[[], object] = bool) -> None:
    """Write a line, after calling ``before``."""
    before()
    while data:
        data = data[os.write(1, data) :]


DEEPEST = 200
"""Limit for nested brackets and for signs such as ``!`` in a row; the engine's stack overflows at a few thousand."""

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
    """Yield the keywords of a query in upper case, without names, variables, IRIs, texts and comments."""
    return (found["word"].upper() for found in _TOKEN.finditer(question) if found["word"])


def is_too_deep(question: str) -> bool:
    """Check for more nested brackets or signs in a row than the engine can parse."""
    depth = signs = 0
    for found in _TOKEN.finditer(question):
        signs = signs + 1 if found["sign"] else 0
        depth += bool(found["open"]) - bool(found["close"])
        if max(depth, signs) > DEEPEST:
            return True
    return False


if __name__ == "__main__":
    main()
