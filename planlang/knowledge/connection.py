"""HTTP connection to a server, with retries, limits on size and time, and a cache.

All requests are safe to repeat. They are retried with increasing pauses if there is no connection and for the statuses
429, 502, 503 and 504, respecting ``Retry-After``. If the server does not respond, the cached response is used. Bodies
are never compressed, so that a small response cannot expand to a large one.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Mapping
from email.utils import parsedate_to_datetime
from http.cookiejar import DefaultCookiePolicy
from random import SystemRandom
from urllib.parse import urlsplit

import httpx

from planlang.cache import Cache
from planlang.knowledge.answers import NoAnswer, NotAsAgreed, ProxyFails, TooMany, as_json, printed, refusal
from planlang.knowledge.network import http_client, proxy_of
from planlang.records import dataclass

LARGEST = 16_000_000
"""Limit for responses in bytes, the same as the server's for request bodies."""
LONGEST_ANSWER = 300.0
"""Time limit for a complete response [s]."""
ATTEMPTS = 4
FIRST_PAUSE, LONGEST_PAUSE = 0.5, 60.0
"""First pause before a retry, and longest pause that a server may request [s]."""
_AGAIN = (429, 502, 503, 504)
_UNANSWERED = (502, 503, 504)
_BARE = "an address has neither user, password, query nor fragment"
_TIMEOUT = httpx.Timeout(30.0, connect=10.0)


def kept_answers() -> Cache:
    """The user's cache of responses by URL, the latest 500."""
    return Cache("knowledge", most=500, largest=LARGEST + 1_000)


@dataclass(frozen=True, slots=True)
class Reply:
    """A response: status, headers (names in lower case) and body."""

    status: int
    headers: Mapping[str, str]
    body: bytes


class Connection:
    """Connection to one server. ``offline`` says why responses come from the cache; None while it responds."""

    def __init__(
        self,
        url: str,
        key: str | None,
        cache: Cache | None,
        transport: httpx.BaseTransport | None,
        sleep: Callable[[float], None],
    ) -> None:
        self.url = checked_url(url)
        self.offline: NoAnswer | None = None
        self._cache, self._sleep = cache, sleep
        headers = {"Accept-Encoding": "identity", "User-Agent": "planlang"}
        if key is not None:
            headers["Authorization"] = f"Bearer {key}"
        self._proxy = proxy_of(self.url) if transport is None else None
        self._http = http_client(self.url, self._proxy, headers=headers, timeout=_TIMEOUT, transport=transport)
        self._http.cookies.jar.set_policy(DefaultCookiePolicy(allowed_domains=[]))

    def close(self) -> None:
        """Close the connection."""
        self._http.close()

    def get(self, path: str, params: Mapping[str, str] | None = None) -> Reply:
        """Send a GET request; if the server does not respond, return the cached response, if there is one."""
        address = str(httpx.URL(self.url + path, params=params or {}))
        if self._cache is None:
            return self.send("GET", path, params=params)
        before = _unpacked(self._cache.load(address))
        tag = before.headers.get("etag") if before else None
        try:
            headers = {"If-None-Match": tag} if tag else {}
            reply = self.send("GET", path, params=params, headers=headers, attempts=1 if self.offline else ATTEMPTS)
        except NoAnswer as problem:
            self.offline = problem
            if before is None:
                raise
            return before
        if before is not None and reply.status == 304:
            return before
        kept = {name: reply.headers[name] for name in ("etag", "repr-digest", "content-type") if name in reply.headers}
        self._cache.keep(address, json.dumps(kept).encode() + b"\n" + reply.body)
        return reply

    def send(
        self,
        method: str,
        path: str,
        *,
        params: Mapping[str, str] | None = None,
        headers: Mapping[str, str] | None = None,
        content: bytes | None = None,
        attempts: int = ATTEMPTS,
    ) -> Reply:
        """Send a request up to ``attempts`` times and return the response.

        Raises the exception of :func:`refusal` for an error status, NoAnswer, NotAsAgreed.
        """
        request = self._http.build_request(method, self.url + path, params=params, headers=headers, content=content)
        for number in range(1, attempts + 1):
            try:
                reply = self._once(request)
            except httpx.TransportError as problem:
                if number == attempts or isinstance(problem, httpx.UnsupportedProtocol):
                    raise self._silent(problem) from None
                self._sleep(_pause(number))
                continue
            pause = _stated_pause(reply.headers)
            if reply.status not in _AGAIN or number == attempts or (pause or 0.0) > LONGEST_PAUSE:
                return self._judged(reply, pause)
            self._sleep(_pause(number) if pause is None else pause)
        raise AssertionError("a request is sent at least once")

    def _silent(self, problem: httpx.TransportError) -> NoAnswer:
        """Blame the proxy, if there is one and no connection to the server was made."""
        is_before = isinstance(problem, httpx.ProxyError | httpx.ConnectError | httpx.ConnectTimeout)
        reason = printed(_reason(problem))
        if self._proxy is not None and is_before and "CERTIFICATE_VERIFY_FAILED" not in reason:
            return ProxyFails(f"{self._proxy} does not answer: {reason}")
        return NoAnswer(f"{self.url} does not answer: {reason}")

    def _judged(self, reply: Reply, pause: float | None) -> Reply:
        if 200 <= reply.status < 300 or reply.status == 304:
            return reply
        problem = refusal(reply.status, reply.body)
        is_problem = reply.headers.get("content-type", "").startswith("application/problem+json")
        if reply.status in _UNANSWERED and not is_problem:
            if self._proxy is not None:
                raise ProxyFails(f"{self.url} does not answer, or not through {self._proxy}: status {reply.status}")
            raise NoAnswer(f"{self.url} does not answer: status {reply.status}")
        if reply.status == httpx.codes.PROXY_AUTHENTICATION_REQUIRED and self._proxy is not None:
            raise ProxyFails(f"{self._proxy} wants a name and a password: write http://NAME:PASSWORD@HOST:PORT")
        if isinstance(problem, TooMany) and pause is not None:
            problem.add_note(f"the server asks to try again in {pause:.0f} s")
        raise problem

    def _once(self, request: httpx.Request) -> Reply:
        until = time.monotonic() + LONGEST_ANSWER
        answer = self._http.send(request, stream=True)
        try:
            if answer.headers.get("content-encoding", "identity") != "identity":
                raise NotAsAgreed("the response is compressed although compression was not accepted")
            body = bytearray()
            for part in answer.iter_raw():
                body += part
                if len(body) > LARGEST:
                    raise NotAsAgreed(f"the response has more than {LARGEST // 1_000_000} MB")
                if time.monotonic() > until:  # a retry would take as long
                    raise NoAnswer(f"{self.url} does not answer within {LONGEST_ANSWER:.0f} s")
        finally:
            answer.close()
        return Reply(answer.status_code, {name.lower(): value for name, value in answer.headers.items()}, bytes(body))


def checked_url(url: str) -> str:
    """Check a server's address and drop the final slash. Raises ValueError, with the reason."""
    try:
        parts = urlsplit(url)
        httpx.URL(url).host.encode("idna")
        is_port = parts.port != 0
    except (httpx.InvalidURL, ValueError) as problem:
        reason = "the host is not a valid name" if isinstance(problem, UnicodeError) else str(problem)
        raise ValueError(_BARE if "@" in url else reason) from None  # the problem may quote a password
    if not is_port:
        raise ValueError("the port 0 is none")
    if parts.scheme not in ("http", "https") or not parts.hostname or not url.isprintable() or " " in url:
        raise ValueError("an address begins with http:// or https:// and a host")
    if parts.username is not None or parts.query or parts.fragment:
        raise ValueError(_BARE)
    return url.rstrip("/")


def _pause(number: int) -> float:
    """Pause before the next attempt [s]: doubled each time, with random jitter to spread the clients."""
    return float(FIRST_PAUSE * 2 ** (number - 1) * SystemRandom().uniform(0.5, 1.0))


def _stated_pause(headers: Mapping[str, str]) -> float | None:
    """Seconds in ``Retry-After``; a date is compared with the server's own clock. None without the header."""
    stated = headers.get("retry-after", "").strip()
    if stated.isdecimal() and len(stated) < 10:
        return float(stated)
    try:
        then, now = (parsedate_to_datetime(text) for text in (stated, headers.get("date", "")))
        return max(0.0, (then - now).total_seconds())
    except (ValueError, TypeError):
        return None


def _reason(problem: httpx.TransportError) -> str:
    reason = str(problem) or type(problem).__name__
    is_unknown = "CERTIFICATE_VERIFY_FAILED" in reason
    return reason + ("; SSL_CERT_FILE names the certificates of authorities to trust" if is_unknown else "")


def _unpacked(kept: bytes | None) -> Reply | None:
    if kept is None:
        return None
    headers, _, body = kept.partition(b"\n")
    return Reply(200, as_json(headers), body)
