"""Attack a server with bad requests and measure what other clients notice of it.

A server on this machine has some thousand entries. Clients read records, contents, lists, news and search, at a fixed
rate; for half of the time an attacker sends 60 bad requests a second from 20 connections: questions of unknown names,
heads that never end, questions in many brackets, searches whose asker has gone. Quiet and attacked phases alternate.
The exit code is 1 if the 99th percentile of the others' times is more than five times that without the attack (median
of the rounds), or if one of the others is refused or not answered.

    python tests/benchmarks/attack.py                          30 s each, two rounds
    python tests/benchmarks/attack.py --seconds 5 --rounds 3 --answers-only   a short form

Of so short phases a busy machine makes any ratio: with ``--answers-only`` times are printed, and answers judged.
"""

from __future__ import annotations

import argparse
import math
import multiprocessing
import socket
import sys
import tempfile
import threading
import time
from collections import Counter, deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import cycle
from pathlib import Path
from statistics import median
from urllib.parse import quote, urlsplit

import httpx
from knowledge import MEMORY, NOW, World, server

from planlang.knowledge.sqlite_store import SqliteStore

ENTRIES = 2_000
RATE, CONNECTIONS = 60, 20
"""Bad requests a second, and connections that they come from at a time."""
READERS, PAUSE = 5, 0.05
"""Other clients, and seconds from one of their requests to the next."""
MOST_HALF_OPEN = 300
"""Connections with half a head that are kept until the server closes them."""
MOST_RATIO = 5.0


def _get(path: str) -> bytes:
    return f"GET {path} HTTP/1.1\r\nHost: kb\r\n\r\n".encode()


def _sparql(question: str) -> bytes:
    head = "POST /v1/sparql HTTP/1.1\r\nHost: kb\r\nContent-Type: application/sparql-query\r\n"
    return f"{head}Content-Length: {len(question)}\r\n\r\n{question}".encode()


UNKNOWN = "{" + ",".join(f"a{number}" for number in range(1700)) + "}"
HALF_OPEN = b"GET /v1/health HTTP/1.1\r\nHost: kb\r\n"
BAD = {
    "unknown names": _get("/v1/search?expression=" + quote(UNKNOWN)),
    "half-open head": HALF_OPEN,
    "one unknown name": _get("/v1/search?expression=" + "Drinkingbotle" * 700),
    "brackets": _get("/v1/search?expression=" + "(" * 4_900 + "Event" + ")" * 4_900),
    "half-open heads": HALF_OPEN,
    "SPARQL in brackets": _sparql("ASK { FILTER(" + "(" * 20_000 + "1" + ")" * 20_000 + ") }"),
    "long search, left": _get("/v1/search?expression=" + quote(" or ".join(["(subAction some Event)"] * 400))),
}


def attack(url: str, seconds: float, told: multiprocessing.Queue[Counter[str]]) -> None:
    """Send bad requests for some time, each connection its share, and tell how each kind of them was answered."""
    address = (urlsplit(url).hostname, urlsplit(url).port)
    kept: deque[socket.socket] = deque(maxlen=MOST_HALF_OPEN)
    kinds, answers, lock = cycle(BAD.items()), Counter[str](), threading.Lock()
    began = time.monotonic()

    def send(number: int) -> None:
        due = began + number / RATE
        while due < began + seconds:
            time.sleep(max(0.0, due - time.monotonic()))
            due += CONNECTIONS / RATE
            with lock:
                kind, data = next(kinds)
            answer = _answer(address, data, kept if data is HALF_OPEN else None, due, is_left="left" in kind)
            with lock:
                answers[f"{kind}: {answer}"] += 1

    threads = [threading.Thread(target=send, args=(number,)) for number in range(CONNECTIONS)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for connection in kept:
        connection.close()
    told.put(answers)


def _answer(
    address: tuple[str | None, int | None], data: bytes, kept: deque[socket.socket] | None, due: float, *, is_left: bool
) -> str:
    """Return the status of the answer to a bad request; nobody waits for one behind the time of the next request."""
    try:
        connection = socket.create_connection(address, timeout=5)
        connection.sendall(data)
        if kept is not None:
            if len(kept) == kept.maxlen:
                kept.popleft().close()
            kept.append(connection)
            return "kept open"
        with connection:
            if is_left:
                return "left"
            connection.settimeout(max(0.001, due - time.monotonic()))
            return connection.recv(100)[9:12].decode() or "closed"
    except TimeoutError:
        return "no answer in time"
    except OSError:
        return "closed"


def read(url: str, seconds: float) -> tuple[list[float], Counter[str]]:
    """Let clients read for some time; returns the seconds of each answer, sorted, and how often each status came."""
    times, statuses, lock = list[float](), Counter[str](), threading.Lock()
    until = time.monotonic() + seconds

    def ask(number: int) -> None:
        with httpx.Client(base_url=url, timeout=30) as client:
            uids = [one["uid"] for one in client.get("/v1/recipes", params={"limit": 50}).json()["entries"]]
            calls = cycle(_calls(client, cycle(uids[number:] + uids[:number])))
            while (now := time.monotonic()) < until:
                try:
                    status = str(next(calls)().status_code)
                except httpx.HTTPError as problem:
                    status = type(problem).__name__
                with lock:
                    times.append(time.monotonic() - now)
                    statuses[status] += 1
                time.sleep(max(0.0, now + PAUSE - time.monotonic()))

    threads = [threading.Thread(target=ask, args=(number,)) for number in range(READERS)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return sorted(times), statuses


def _calls(client: httpx.Client, uids: Iterator[str]) -> list[Callable[[], httpx.Response]]:
    question: dict[str, str | int] = {"expression": "Event and objectActedOn some SpatialThing", "limit": 5}
    return [
        lambda: client.get(f"/v1/recipes/{next(uids)}"),
        lambda: client.get(f"/v1/recipes/{next(uids)}/content"),
        lambda: client.get("/v1/recipes", params={"limit": 10}),
        lambda: client.get("/v1/news", params={"limit": 20}),
        lambda: client.get("/v1/search", params=question),
    ]


@contextmanager
def attacked(url: str, seconds: float) -> Iterator[Counter[str]]:
    """Attack a server from another process while the block runs; what was answered is there at the end."""
    told: multiprocessing.Queue[Counter[str]] = multiprocessing.Queue()
    answers = Counter[str]()
    process = multiprocessing.Process(target=attack, args=(url, seconds, told))
    process.start()
    try:
        yield answers
        answers.update(told.get(timeout=60))
    finally:
        process.join(timeout=60)
        process.kill()


def p99(times: list[float]) -> float:
    """The time that one of a hundred answers takes at least."""
    return times[int(0.99 * len(times))]


def measure(url: str, seconds: float, rounds: int, most_ratio: float) -> bool:
    """Print what the others notice; returns True if all are answered, and their times are within the ratio."""
    ratios, statuses, bad = [], Counter[str](), Counter[str]()
    read(url, 2.0)
    for number in range(rounds):
        quiet, asked = read(url, seconds)
        with attacked(url, seconds) as answers:
            busy, asked_too = read(url, seconds)
        statuses += asked + asked_too
        bad += answers
        ratios.append(p99(busy) / p99(quiet))
        for name, times in (("quiet", quiet), ("attacked", busy)):
            values = (
                f"p50 {1000 * median(times):6.1f} ms   p99 {1000 * p99(times):6.1f} ms   max {1000 * times[-1]:6.1f} ms"
            )
            print(f"round {number + 1}  {name:8}  {len(times):6} reads   {values}")
        print(f"round {number + 1}  ratio of p99: {ratios[-1]:.2f}")
    print(f"bad requests: {bad.total() / (rounds * seconds):.1f} a second")
    for kind, count in sorted(bad.items()):
        print(f"  {count:5}  {kind}")
    others = {status: count for status, count in statuses.items() if status != "200"}
    print(f"others' answers: {statuses['200']} of status 200, others: {others or 'none'}")
    print(f"median ratio of p99: {median(ratios):.2f}, permitted: {most_ratio:g}")
    return median(ratios) <= most_ratio and not others


def main() -> None:
    """Serve drawn entries, attack, and end with 1 if others notice more than is permitted."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=30.0, help="of each phase")
    parser.add_argument("--rounds", type=int, default=2)
    parser.add_argument("--answers-only", action="store_true", help="print times without judging them")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory(dir=MEMORY if MEMORY.is_dir() else None) as folder:
        world, path = World(), Path(folder) / "kb.sqlite"
        store = SqliteStore(path)
        for drawn in world.entries[:ENTRIES]:
            store.create(drawn.content(world.vocabulary), "ada", NOW)
        store.close()
        with server(path) as (url, _):
            most_ratio = math.inf if arguments.answers_only else MOST_RATIO
            is_within = measure(url, arguments.seconds, arguments.rounds, most_ratio)
    sys.exit(0 if is_within else 1)


if __name__ == "__main__":
    main()
