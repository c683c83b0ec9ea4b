"""States of streams of random numbers as JSON."""

from __future__ import annotations

import base64
import struct
from random import Random
from typing import Any


def packed(stream: Random) -> Any:
    """The state of a stream of random numbers as JSON, about 3 kB."""
    version, words, gauss = stream.getstate()
    return [version, base64.b64encode(struct.pack("<625I", *words)).decode(), gauss]


def unpacked(json: Any) -> tuple[Any, ...]:
    """What ``Random.setstate`` takes; raises ValueError."""
    match json:
        case [int(version), str(text), (None | int() | float()) as gauss]:
            try:
                words = struct.unpack("<625I", base64.b64decode(text, validate=True))
                state = (version, words, gauss)
                Random().setstate(state)
            except (struct.error, ValueError, TypeError) as problem:
                raise ValueError(f"this is no state of random numbers: {problem}") from None
            return state
    raise ValueError("this is no state of random numbers")
