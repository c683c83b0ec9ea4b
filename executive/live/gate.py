"""The gate that a watched run passes after each step of its world: it can be held there, and paced.

While it is held no plan time passes, so no timer of the plan goes on. What a run does depends on none of this.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping
from enum import StrEnum
from typing import Any

from planlang.kernel.runner import is_interrupted, unwatched
from planlang.kernel.tree import Node
from planlang.language.performing import is_inner
from planlang.runs.recorded_run import SPANS

PATIENCE = 0.1
"""Longest uninterrupted wait [s]: this often the main thread notices Ctrl-C, where locks do not let it through."""
AHEAD = 0.02
"""A paced run waits when it is this far ahead of the clock [s]: shorter waits would be taken up by the system."""


class Command(StrEnum):
    """What somebody who watches may ask for."""

    PAUSE = "pause"
    RESUME = "resume"
    STEP = "step"
    """Go on until an action of the plan has ended."""
    STOP = "stop"
    """End the run as Ctrl-C does."""


def interrupted() -> None:
    """Raise KeyboardInterrupt."""
    raise KeyboardInterrupt


class Gate:
    """Holds and paces a run; any thread may send commands, the run's own passes."""

    def __init__(
        self,
        rate: int,
        *,
        paused: bool = False,
        speed: float | None = None,
        stop: Callable[[], object] = interrupted,
        tell: Callable[[], object] = lambda: None,
    ) -> None:
        """Begin with nothing behind it. ``rate`` is in world steps per second, ``speed`` in plan time per time of the
        clock, None for as fast as the computer can. ``stop`` is called in the run's thread to end the run,
        ``tell`` there when it may be held now, or not any more.
        """
        self._rate = rate
        self._stop, self._tell = stop, tell
        self._changed = threading.Condition()
        self._paused = paused
        self._stepping = False
        self._stopped: bool | None = None
        """False when somebody wants the run to end, True when it has been told."""
        self._speed = speed
        self._changes, self._told = 0, -1
        """Commands and steps that have ended, and how many of them were told: the state may be another one since."""
        self._mark: tuple[int, float] | None = None
        """A step, and when it was passed; plan time is paced from there on."""
        self.step = 0
        """Steps that the run has taken."""

    @property
    def is_held(self) -> bool:
        """True while no plan time passes."""
        return self._paused and not self._stepping

    @property
    def speed(self) -> float | None:
        """Plan time per time of the clock; None for as fast as the computer can."""
        return self._speed

    def command(self, command: Command) -> None:
        """Do what somebody asks for."""
        with self._changed:
            match command:
                case Command.PAUSE:
                    self._paused, self._stepping = True, False
                case Command.RESUME:
                    self._paused, self._stepping = False, False
                case Command.STEP:
                    self._paused, self._stepping = True, True
                case Command.STOP:
                    self._stopped = False if self._stopped is None else self._stopped
            self._mark = None
            self._changes += 1
            self._changed.notify_all()

    def pace(self, speed: float | None) -> None:
        """Change the speed."""
        with self._changed:
            self._speed, self._mark = speed, None
            self._changed.notify_all()

    def heard(self, record: Mapping[str, Any], node: Node | None) -> None:
        """Listen to the trace: a run that makes one step is held again behind the end of an action."""
        if not self._stepping or record["event"] not in SPANS or record["event"] == "started":
            return
        if record["kind"] == "perform" and node is not None and not is_inner(node):
            with self._changed:
                self._stepping = False
                self._changes += 1

    def passed(self, step: int) -> None:
        """Wait here as long as the run is held or ahead of the clock; end it here if somebody wants it."""
        self.step = step
        self._tell_changes()
        if self._stopped is None and not is_interrupted() and (self.is_held or self._speed is not None):
            with unwatched():
                while self._waits(step):
                    self._tell_changes()
        if self._stopped is False:  # once: what a plan does when it is ended passes here, too
            self._stopped = True
            self._stop()

    def _tell_changes(self) -> None:
        if self._told != self._changes:
            self._told = self._changes
            self._tell()

    def _waits(self, step: int) -> bool:
        """Wait for a while if the run has to; return whether it had to."""
        with self._changed:
            if self._stopped is not None or is_interrupted():
                return False
            if self.is_held:
                self._mark = None
                self._changed.wait_for(lambda: self._told != self._changes, PATIENCE)
                return True
            ahead = self._ahead(step)
            if ahead > AHEAD:
                self._changed.wait(min(ahead, PATIENCE))
            return ahead > AHEAD

    def _ahead(self, step: int) -> float:
        """Return how far the run is ahead of the clock [s]; one that is late does not hurry to catch up."""
        if self._speed is None:
            return 0.0
        now = time.monotonic()
        if self._mark is None:
            self._mark = step, now
        since, then = self._mark
        ahead = (step - since) / self._rate / self._speed - (now - then)
        if ahead < 0:
            self._mark = step, now
        return ahead
