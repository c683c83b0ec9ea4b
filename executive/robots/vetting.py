"""Loads unknown URDFs in another process first: what their schema cannot exclude might end PyBullet's process.

A URDF that was loaded once is not tried again: the user's cache keeps the digest of what PyBullet got, meshes included.
"""

from __future__ import annotations

import atexit
import os
from dataclasses import replace
from functools import cache
from pathlib import Path

from executive.processes.workers import Ending, Limits, Source, Worker
from executive.robots.mechanism import source_of
from planlang.cache import Cache
from planlang.diagnostics import BadInput, Span, error
from sim.description import read_description
from sim.trial import build, load

_CACHE = Cache("loaded", most=1000, largest=1)
_LIMITS = Limits(seconds=120, memory=4_000_000_000)
"""Limits of loading; real robots take up to 3 s and 0.5 GB."""
_WHY = {
    Ending.MEMORY: f"the simulator needs more than {_LIMITS.memory // 1_000_000_000} GB to load it",
    Ending.LATE: f"the simulator needs more than {_LIMITS.seconds} s to load it",
    Ending.LOST: "the simulator crashes when it loads it",
}


@cache
def _source() -> Source:
    """Start the process that loads, once: a draft and the robot that is bound to it are two URDFs."""
    source = Source("sim.trial:prepared")
    atexit.register(source.close)
    return source


def vet(urdf: Path) -> None:
    """Check that PyBullet can load a URDF. Raises BadInput (B009)."""
    description, span = read_description(urdf), Span(str(source_of(urdf)))
    key = f"{build()}\n{description.text}"  # the text names meshes by their content
    if _CACHE.load(key) is not None:
        return
    worker = Worker(_source(), _LIMITS)
    try:
        reply = worker.call(load, os.path.abspath(urdf), description.root)  # that process has a folder of its own
        if reply.ending is Ending.LOST and worker.call(build).ending is not Ending.DONE:
            return  # no process can be started here, whatever it loads
    finally:
        worker.close()
    if reply.ending is Ending.REFUSED:
        raise BadInput([replace(one, span=span) for one in reply.answer])
    if reply.ending is not Ending.DONE:
        why = _WHY.get(reply.ending, str(reply.answer))
        advice = "simplify its meshes and shapes, or leave out links, until it loads"
        raise BadInput([error("B009", f"this URDF cannot be used: {why}", span, advice)])
    _CACHE.keep(key, b"")
