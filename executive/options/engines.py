"""Values of the options that say where the worlds of a sweep run."""

from __future__ import annotations

import re
from typing import Any

from planlang.diagnostics import WrongOption
from planlang.words import Option

LOCAL, DASK = "local", "dask"
"""Worker processes of this one; a cluster of dask.distributed with one worker, started for the sweep."""
_ADDRESS = re.compile(r"(?:tcp|tls)://[^\s/:@]+(?::\d{1,5}|)|(?:tcp|tls)://\[[0-9a-fA-F:.]+\](?::\d{1,5}|)")
"""Address of a scheduler, with a host, an IPv4 address, or an IPv6 address in brackets."""
_TIME = re.compile(r"(\d+(?:\.\d+)?)\s*(s|min|h|)")
_UNITS = {"": 1.0, "s": 1.0, "min": 60.0, "h": 3600.0}


def engine(given: Any) -> str:
    """Check the name of an engine, or the address of a scheduler. Raises WrongOption."""
    if given in (LOCAL, DASK) or (isinstance(given, str) and _ADDRESS.fullmatch(given)):
        return str(given)
    raise WrongOption(Option("on", given), ": write local, dask, or the address of a scheduler, tcp://HOST:8786")


def seconds(given: Any) -> float:
    """Read a time: a number, or a text such as 300s, 5min or 8h [s]. Raises WrongOption."""
    match = _TIME.fullmatch(str(given))
    if match is None:
        raise WrongOption(f"{given!r} is no time; write for example ", Option("cluster_wait", "300s"))
    return float(match[1]) * _UNITS[match[2]]
