"""Progress of a sweep on stderr: a line that is renewed in a terminal, now and then a line elsewhere."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Sequence

from executive.cli.console import say
from executive.sweeps.records import CRASHED, Done, Row, is_reached

EVERY, EVERY_IN_TERMINAL = 10.0, 0.2
"""Seconds between two lines, and between two renewals of the line of a terminal."""


class Progress:
    """Counts worlds, and says how fast they are done and how long the rest will take."""

    def __init__(self, total: int, say: Callable[[str], None] | None = say) -> None:
        """Begin now; ``say`` prints a line, None: to stderr, as it suits that."""
        self._total, self._say = total, say
        self._is_terminal = say is None and sys.stderr.isatty()
        self._before = self._done = self._reached = self._crashed = 0
        self._began = self._last = time.monotonic()
        self._seconds = 0.0

    def resumed(self, rows: Sequence[Row]) -> None:
        """Count what was done before; it does not count for the rate."""
        self._before = len(rows)
        for row in rows:
            self._count(row)
        if rows:
            self._print(f"{len(rows)} of {self._total} worlds were done before")
        self._began = time.monotonic()

    def told(self, done: Done) -> None:
        """Count a world."""
        self._count(done.row)
        self._seconds += done.seconds
        now, every = time.monotonic(), EVERY_IN_TERMINAL if self._is_terminal else EVERY
        if now - self._last >= every or (self._is_terminal and self._done == self._total):
            self._last = now
            self._print(self._line(now - self._began))

    def _count(self, row: Row) -> None:
        self._done += 1
        self._reached += is_reached(row)
        self._crashed += row.get("outcome") == CRASHED

    def _line(self, seconds: float) -> str:
        new = self._done - self._before
        rate = new / max(seconds, 1e-6)
        left = _duration((self._total - self._done) / rate)
        counts = f"{self._reached} reached" + (f", {self._crashed} crashed" if self._crashed else "")
        return (
            f"{self._done} of {self._total} worlds, {counts}; {60 * rate:.0f} a minute, "
            f"{self._seconds / new:.2f} s of CPU each, {left} left"
        )

    def _print(self, line: str) -> None:
        if self._is_terminal:
            sys.stderr.write(f"\r{line}\x1b[K")
            sys.stderr.flush()
        else:
            (self._say or say)(line)

    def close(self) -> None:
        """End the line of a terminal."""
        if self._is_terminal:
            sys.stderr.write("\n")


def _duration(seconds: float) -> str:
    minutes, seconds = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours} h {minutes} min" if hours else f"{minutes} min {seconds} s" if minutes else f"{seconds} s"
