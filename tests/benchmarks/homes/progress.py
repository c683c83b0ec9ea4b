"""Progress of a series: a line for each of its worlds."""

from __future__ import annotations

import time
from collections.abc import Sequence

from executive.sweeps import Row
from executive.sweeps.records import Done


class Progress:
    """Prints a line for each world."""

    def __init__(self, total: int, cell: int = 40) -> None:
        """``cell`` is the width of a world's name."""
        self.total, self.done, self.began = total, 0, time.monotonic()
        self.known, self._cell = 0, cell

    def resumed(self, rows: Sequence[Row]) -> None:
        """Say how many rows there are."""
        self.known = len(rows)

    def __call__(self, done: Done) -> None:
        """Say how a world ended, and how long the others will take."""
        self.done, row = self.done + 1, done.row
        left = (self.total - self.known - self.done) * (time.monotonic() - self.began) / self.done
        said = "reached" if row.get("reached") else f"{row['outcome']}: {row.get('failure')} {row.get('unmet', '')}"
        kind = row.get("witness", {}).get("kind", "")
        print(
            f"{row['world']:{self._cell}} {done.seconds:6.1f} s, {left / 60:.0f} min left  {kind} {said[:220]}",
            flush=True,
        )
