"""HTTP clients with the proxy and the certificates that the user's environment states for their address.

The variables are those of curl: ``http_proxy``, ``https_proxy``, ``all_proxy`` and ``no_proxy``, in lower or upper case
(https://everything.curl.dev/usingcurl/proxies/env.html), and ``SSL_CERT_FILE`` and ``SSL_CERT_DIR`` of OpenSSL. Only
those that concern the address are read: one that cannot be used does not matter to a server that does not need it.
"""

from __future__ import annotations

import os
import ssl
from collections.abc import Mapping
from functools import partial
from importlib.util import find_spec
from ipaddress import ip_address, ip_network
from typing import Any
from urllib.parse import SplitResult, urlsplit

import httpx

from planlang.diagnostics import BadInput, error
from planlang.records import dataclass

_SOCKS = ("socks5", "socks5h")
_PORTS = range(1, 65536)


@dataclass(frozen=True, slots=True)
class Proxy:
    """A proxy, and the variable that states it."""

    url: str
    variable: str

    def __str__(self) -> str:
        return f"the proxy {self.url.rpartition('@')[2].rpartition('/')[2]} ({self.variable})"


def http_client(url: str, proxy: Proxy | None, **options: Any) -> httpx.Client:
    """Make a client for an address (without redirections). Raises BadInput for unusable certificates."""
    is_encrypted = any(urlsplit(one).scheme == "https" for one in (url, proxy.url if proxy else ""))
    # without TLS nothing is verified; this context has no certificates, and takes no time
    context = _certificates(os.environ) if is_encrypted else ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    through = None if proxy is None else httpx.Proxy(proxy.url, ssl_context=context if is_encrypted else None)
    return httpx.Client(proxy=through, verify=context, trust_env=False, **options)


def proxy_of(url: str, environment: Mapping[str, str] | None = None) -> Proxy | None:
    """Return the proxy that the environment states for an address, if any. Raises BadInput for an unusable one."""
    environment = os.environ if environment is None else environment
    parts = urlsplit(url)
    names = [f"{parts.scheme}_proxy", f"{parts.scheme}_PROXY".upper(), "all_proxy", "ALL_PROXY"]
    if "REQUEST_METHOD" in environment:  # in CGI, a header of the request would set it
        names.remove("HTTP_PROXY")
    variable = next((name for name in names if environment.get(name, "").strip()), None)
    if variable is None or _is_direct(parts, environment.get("no_proxy") or environment.get("NO_PROXY") or ""):
        return None
    return Proxy(_checked(variable, environment[variable].strip(), parts.hostname or ""), variable)


def _checked(variable: str, value: str, host: str) -> str:
    """Check the address of a proxy; a password in it is never shown. Raises BadInput."""
    address = value if "://" in value else f"http://{value}"
    scheme, _, rest = address.partition("://")
    scheme = scheme.lower()
    refused = partial(_refused, variable, host)
    if scheme not in ("http", "https", *_SOCKS):
        raise refused(f"states a proxy of the kind {scheme}://", "use http://, https:// or socks5://")
    if scheme in _SOCKS and find_spec("socksio") is None:
        raise refused("states a SOCKS proxy, for which a package is missing: socksio", "pip install socksio")
    where = rest.partition("/")[0]
    if "#" in where or "?" in where:
        raise refused("is not the address of a proxy", "write # in a password as %23 and ? as %3F")
    try:
        parts = urlsplit(f"{scheme}://{rest}")
        if not parts.hostname or (parts.port or 80) not in _PORTS or not address.isprintable() or " " in address:
            raise ValueError
        parts.hostname.encode("idna")
        httpx.Proxy(parts.geturl())
    except (ValueError, httpx.InvalidURL, UnicodeError):
        raise refused("is not the address of a proxy", "write it as http://HOST:PORT") from None
    return parts.geturl()


def _refused(variable: str, host: str, what: str, advice: str) -> BadInput:
    help = f"{advice}, unset {variable}, or add {host} to NO_PROXY"
    return BadInput([error("K048", f"the environment variable {variable} {what}", help=help)])


def _is_direct(parts: SplitResult, listed: str) -> bool:
    """Check whether ``no_proxy`` lists a host: names with all below them, addresses, networks, ``*``."""
    host = (parts.hostname or "").rstrip(".").lower()
    port = parts.port or {"http": 80, "https": 443}.get(parts.scheme)
    return any(_lists(one.strip().lower(), host, port) for one in listed.replace(" ", ",").split(","))


def _lists(entry: str, host: str, port: int | None) -> bool:
    if entry == "*":
        return True
    name, colon, number = entry.rpartition(":")
    if colon and number.isdecimal() and (":" not in name or name.endswith("]")):
        if int(number) != port:
            return False
        entry = name
    entry = entry.strip("[]")
    try:
        return ip_address(host) in ip_network(entry, strict=False)
    except ValueError:  # one of them is a name
        name = entry.removeprefix("*").strip(".")
        return bool(name) and (host == name or host.endswith(f".{name}"))


def _certificates(environment: Mapping[str, str]) -> ssl.SSLContext:
    """Read the certificates that servers are verified with. Raises BadInput, naming the variable."""
    stated = {name: environment.get(name) for name in ("SSL_CERT_FILE", "SSL_CERT_DIR", "SSLKEYLOGFILE")}
    file, folder, log = stated.values()
    if not file and folder and not any(map(os.path.isdir, folder.split(os.pathsep))):
        raise _unusable("SSL_CERT_DIR", folder, "is not a folder", "name a folder of certificates")
    try:
        if file:
            return ssl.create_default_context(cafile=file)
        if folder:
            return ssl.create_default_context(capath=folder)
        return httpx.create_ssl_context(trust_env=False)
    except (OSError, ValueError) as problem:  # ssl.SSLError is an OSError; a NUL in a name a ValueError
        reason = f"cannot be read: {getattr(problem, 'strerror', None) or problem}"
        if isinstance(problem, ssl.SSLError):
            reason = "has no certificates"
        if log and isinstance(problem, OSError) and problem.filename == log:
            raise _unusable("SSLKEYLOGFILE", log, reason, "name a file that can be written") from None
        if file:
            raise _unusable("SSL_CERT_FILE", file, reason, "name a file of certificates (PEM)") from None
        raise _unusable("SSL_CERT_DIR", folder or "", reason, "name a folder of certificates") from None


def _unusable(variable: str, value: str, what: str, advice: str) -> BadInput:
    message = f"{value}, which the environment variable {variable} names, {what}"
    return BadInput([error("K048", message, help=f"{advice}, or unset {variable}")])
