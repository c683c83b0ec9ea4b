"""Rate limits: requests are counted by the author of their key, else by the client's address."""

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
from planlang.kept import Latest

USUAL = 500.0
"""Default rate limit of one client [requests/s]."""
BURST = 10.0
"""Requests of this many seconds may come at once [s]."""
MOST_CLIENTS = 10_000
"""Clients whose requests are counted."""
NETWORK = 64
"""Bits of an IPv6 address that identify the client's network."""


class Rates:
    """Rate limiter by the generic cell rate algorithm: per client, the time by which the limit allows its requests."""

    def __init__(self, each_second: float = USUAL, clock: Callable[[], float] = time.monotonic) -> None:
        """Limit each client to ``each_second`` requests per second; 0 means no limit."""
        self._each_second, self._clock = each_second, clock
        self._until: Latest[str, float] = Latest(MOST_CLIENTS)
        self._authors: dict[str, str] = {}

    def wait(self, address: str, authorization: str = "") -> float:
        """Count a request; returns 0.0 if it is allowed, else the time after which to send it again [s]."""
        if not self._each_second:
            return 0.0
        client, now = self._authors.get(_digest(authorization)) or network(address), self._clock()
        until = max(now, self._until.get(client, now))
        wait = until - now - BURST
        self._until.renew(client, until if wait > 0 else until + 1 / self._each_second)
        return max(0.0, wait)

    def know(self, authorization: str, author: str) -> None:
        """Count requests with this header, which has a valid key, for its author."""
        self._authors[_digest(authorization)] = f"author {author}"

    def forget(self, authorization: str) -> None:
        """Count requests with this header by their address: its key is unknown or was revoked."""
        self._authors.pop(_digest(authorization), None)


def _digest(authorization: str) -> str:
    return hashlib.sha256(authorization.encode()).hexdigest()


def network(address: str) -> str:
    """Map an IPv6 address to its /64 network, which one client owns as a whole; keep any other address."""
    try:
        parsed = ipaddress.ip_address(address.partition("%")[0])
    except ValueError:
        return address
    return address if parsed.version == 4 else str(ipaddress.ip_network((int(parsed) >> 64 << 64, NETWORK)))


class RateLimited:
    """Middleware that enforces rate limits."""

    def __init__(self, app: ASGIApp, rates: Rates) -> None:
        self._app, self._rates = app, rates

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Handle a request, or refuse it with Retry-After."""
        if scope["type"] == "http":
            address, _ = scope.get("client") or ("", 0)
            wait = self._rates.wait(address, Headers(scope=scope).get("authorization", ""))
            if wait > 0:
                response = problem_response(HTTPStatus.TOO_MANY_REQUESTS, "too many requests; wait for Retry-After")
                response.headers["Retry-After"] = str(math.ceil(wait))
                await response(scope, receive, send)
                return
        await self._app(scope, receive, send)
