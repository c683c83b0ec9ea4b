"""Limits of how often somebody asks: an author by the key, anybody else by the address."""

from __future__ import annotations

import hashlib
import ipaddress
import math
import time
from collections.abc import Callable
from http import HTTPStatus

from starlette.datastructures import Headers
from starlette.types import ASGIApp, Receive, Scope, Send

from executive.serving.problems import problem_response

USUAL = 500.0
"""Requests of one asker in a second, unless the operator says otherwise."""
BURST = 10.0
"""Seconds whose requests may come at once."""
MOST_ASKERS = 10_000
"""Askers that are remembered."""
NETWORK = 64
"""Bits of an IPv6 address that tell whose it is."""


class Rates:
    """The requests of each asker, as the time at which all of them would have come at the permitted rate."""

    def __init__(self, each_second: float = USUAL, clock: Callable[[], float] = time.monotonic) -> None:
        """Permit ``each_second`` requests of one asker, with 0 any number."""
        self._each_second, self._clock = each_second, clock
        self._until: dict[str, float] = {}
        self._authors: dict[str, str] = {}

    def wait(self, address: str, authorization: str = "") -> float:
        """Count a request, and return 0.0; or after how many seconds it may be sent again."""
        if not self._each_second:
            return 0.0
        asker, now = self._authors.get(_digest(authorization)) or network(address), self._clock()
        until = max(now, self._until.pop(asker, now))
        wait = until - now - BURST
        self._until[asker] = until if wait > 0 else until + 1 / self._each_second
        if len(self._until) > MOST_ASKERS:
            del self._until[next(iter(self._until))]  # whoever has not asked for the longest time
        return max(0.0, wait)

    def know(self, authorization: str, author: str) -> None:
        """Remember that a header has a valid key of an author, whose requests are counted together."""
        self._authors[_digest(authorization)] = f"author {author}"

    def forget(self, authorization: str) -> None:
        """Count requests with a header by their address again: its key is nobody's, or not any more."""
        self._authors.pop(_digest(authorization), None)


def _digest(authorization: str) -> str:
    return hashlib.sha256(authorization.encode()).hexdigest()


def network(address: str) -> str:
    """Return whom an address belongs to: itself, or the network of an IPv6 address."""
    try:
        found = ipaddress.ip_address(address.partition("%")[0])
    except ValueError:
        return address
    return address if found.version == 4 else str(ipaddress.ip_network((int(found) >> 64 << 64, NETWORK)))


class Paced:
    """An application that answers nobody more often than permitted."""

    def __init__(self, app: ASGIApp, rates: Rates) -> None:
        self._app, self._rates = app, rates

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request, or tell when to come back."""
        if scope["type"] == "http":
            address, _ = scope.get("client") or ("", 0)
            wait = self._rates.wait(address, Headers(scope=scope).get("authorization", ""))
            if wait > 0:
                response = problem_response(HTTPStatus.TOO_MANY_REQUESTS, "you ask more often than this server permits")
                response.headers["Retry-After"] = str(math.ceil(wait))
                await response(scope, receive, send)
                return
        await self._app(scope, receive, send)
