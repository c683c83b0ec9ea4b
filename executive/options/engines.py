"""Values of the options that say where the worlds of a sweep run."""

from __future__ import annotations

import re
from typing import Any

from planlang.diagnostics import WrongOption
from planlang.words import Option

LOCAL, DASK = "local", "dask"
"""Worker processes of this one; a cluster of dask.distributed with one worker, started for the sweep."""
_HOST = r"[^\s/:@.]{1,63}(?:\.[^\s/:@.]{1,63})*|\[[0-9a-fA-F:.]+\]"
"""A name, whose parts have at most 63 letters, an IPv4 address, or an IPv6 address in brackets."""
_ADDRESS = re.compile(rf"(?P<host>(?:tcp|tls)://(?:{_HOST}))(?::(?P<port>\d{{1,9}}))?")
"""Address of a scheduler."""
PORT, MOST_PORT = 8786, 65535
"""Port at which a scheduler of dask.distributed listens unless told otherwise, and the largest one there is."""
_TIME = re.compile(r"(\d+(?:\.\d+)?)\s*(s|min|h|)")
_UNITS = {"": 1.0, "s": 1.0, "min": 60.0, "h": 3600.0}


def engine(given: Any) -> str:
    """Check the name of an engine, or the address of a scheduler with its port. Raises WrongOption."""
    if given in (LOCAL, DASK):
        return str(given)
    address = _ADDRESS.fullmatch(given) if isinstance(given, str) else None
    if address is None:
        raise WrongOption(Option("on", given), f": write local, dask, or the address of a scheduler, tcp://HOST:{PORT}")
    if address["port"] is None:
        raise WrongOption(Option("on", given), f": the port is missing; write for example {address['host']}:{PORT}")
    if not 1 <= int(address["port"]) <= MOST_PORT:
        raise WrongOption(Option("on", given), f": ports are from 1 to {MOST_PORT}")
    return address[0]


def seconds(given: Any) -> float:
    """Read a time: a number, or a text such as 300s, 5min or 8h [s]. Raises WrongOption."""
    match = _TIME.fullmatch(str(given))
    if match is None:
        raise WrongOption(f"{given!r} is no time; write for example ", Option("cluster_wait", "300s"))
    return float(match[1]) * _UNITS[match[2]]


def in_seconds(time: float) -> str:
    """A time [s] as a text that :func:`seconds` reads."""
    return f"{time:.15g}s"
