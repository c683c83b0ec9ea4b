"""Progress of long work on stderr, with the time left: a line that is redrawn in a terminal, else a line now and then.

Computations report shares (:mod:`planlang.progress`); a thread shows them, so that a long call between two reports is
shown as well. The wall clock is read here only, and never enters a run.
"""

from __future__ import annotations

import math
import shutil
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import click

from planlang.machine import address_space
from planlang.records import dataclass
from planlang.visible import visible

SHORT = 2.0
"""Shorter work is not shown [s]."""
EVERY, EVERY_IN_TERMINAL = 10.0, 0.2
"""Time between two lines, and between two drawings in a terminal [s]."""
ROOMY = 500_000_000
"""Address space below which nothing is shown: a thread reserves 64 MB of it, which the work may need [bytes]."""
BAR = 20
"""Width of the bar [characters]."""


@dataclass(slots=True, eq=False)
class _Work:
    """Piece of work: its description, its share when first reported and now (NaN: unknown), its start [s]."""

    what: Callable[[], str]
    first: float
    share: float
    began: float
    most: float | None = None
    """Time limit [s], if any."""
    ends: bool = False
    """True if a report ends it."""

    @property
    def is_open(self) -> bool:
        """True if its end is unknown."""
        return math.isnan(self.share)

    def line(self, now: float) -> str:
        """Describe the work, with its share and the time left, or with the time passed."""
        seconds, gained = now - self.began, self.share - self.first
        if self.is_open:
            limit = f" of at most {duration(self.most)}" if self.most is not None else ""
            return f"{self.what()}: {duration(seconds)}{limit}"
        left = f", {duration(seconds * (1 - self.share) / gained)} left" if gained > 0 else ""
        return f"{self.what()}: {self.share:.0%}{left}"


class Progress:
    """Shows the innermost piece of work; ``clock`` returns seconds."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock, self._lock = clock, threading.RLock()
        self._works: list[_Work] = []
        self._shown = 0.0
        self._is_drawn = False
        """True if the last line in the terminal is to be redrawn."""
        self._ended = threading.Event()

    def __call__(self, what: str, share: float) -> None:
        """Take a report (:data:`planlang.progress.Report`)."""
        with self._lock:
            top = self._works[-1] if self._works else None
            # work with a share that begins anew replaces one that was given up; work of unknown length is nested
            if share >= 1.0 or (share <= 0.0 and top is not None and not top.is_open):
                top = self._pop() if top is not None and top.ends else top
            if share >= 1.0:
                return
            if top is None or top.is_open or math.isnan(share):
                self._push(_Work(lambda: what, share, share, self._clock(), ends=True))
            else:
                top.what, top.share = lambda: what, share

    @contextmanager
    def during(self, what: Callable[[], str], most: float | None = None) -> Iterator[None]:
        """Show work whose end is unknown: ``what`` describes it at any time, ``most`` is its time limit [s]."""
        self._push(_Work(what, math.nan, math.nan, self._clock(), most))
        try:
            yield
        finally:
            self.close()

    def _push(self, work: _Work) -> None:
        with self._lock:
            self._works.append(work)
            if len(self._works) == 1:
                self._shown, self._ended = work.began, threading.Event()
                limit = address_space()
                if limit is None or limit >= ROOMY:
                    threading.Thread(target=self._watch, args=(self._ended,), name="progress", daemon=True).start()

    def _pop(self) -> _Work | None:
        """End the innermost work; return the one around it."""
        self.clear()
        self._works.pop()
        if not self._works:
            self._ended.set()
        return self._works[-1] if self._works else None

    def _watch(self, ended: threading.Event) -> None:
        while not ended.wait(EVERY_IN_TERMINAL):
            self.tick()

    def tick(self) -> None:
        """Show the work if a new line or drawing is due."""
        with self._lock:
            now, is_terminal = self._clock(), sys.stderr.isatty()
            if not self._works or now - self._works[-1].began < SHORT:
                return
            if not is_terminal and now - self._shown < EVERY:
                return
            self._shown, work = now, self._works[-1]
            if not is_terminal:
                click.echo(visible(work.line(now)), err=True)
                return
            bar = "" if work.is_open else f"[{'#' * int(BAR * work.share):{BAR}}] "
            width = shutil.get_terminal_size().columns - 1
            sys.stderr.write(f"\r{(bar + visible(work.line(now), breaks=''))[:width]}\x1b[K")
            sys.stderr.flush()
            self._is_drawn = True

    def clear(self) -> None:
        """Erase the drawn line, so that another line can be printed."""
        with self._lock:
            if self._is_drawn:
                sys.stderr.write("\r\x1b[K")
                sys.stderr.flush()
                self._is_drawn = False

    def close(self) -> None:
        """End all work."""
        with self._lock:
            while self._works:
                self._pop()


def duration(seconds: float) -> str:
    """Format a time, to a second."""
    minutes, seconds = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours} h {minutes} min" if hours else f"{minutes} min {seconds} s" if minutes else f"{seconds} s"


PROGRESS = Progress()
"""The progress of this process."""
