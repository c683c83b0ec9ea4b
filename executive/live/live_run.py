"""Live page of a run: the run's thread renders the page, and server threads send updates to browsers.

The run passes a gate after each world step, where it can be paused and slowed down. No plan time passes while a run is
held, so that no timer of the plan advances. The gate has no effect on what a run does.
"""

from __future__ import annotations

import base64
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from enum import StrEnum
from typing import Any

from executive.live.server import LiveServer, Served
from executive.report.watching import Watching
from planlang.kernel.runner import interrupter, is_interrupted, unwatched
from planlang.kernel.tree import Node
from planlang.language.performing import is_inner
from planlang.report import model_of, page
from planlang.report.model import Context
from planlang.runs.recorded_run import SPANS
from sim.truth import Truth

PATIENCE = 0.1
"""Longest wait without a check for Ctrl-C [s], which locks do not let through on all systems."""
AHEAD = 0.02
"""Lead over the clock at which a paced run waits [s]; shorter waits would be lost in the latency of the system."""
INSISTING = 1.0
"""Time after which a further stop counts [s]: cleanups run after the first, which a double click must not end."""


class Command(StrEnum):
    """Commands of a viewer."""

    PAUSE = "pause"
    RESUME = "resume"
    STEP = "step"
    """Continue until an action of the plan has ended."""
    STOP = "stop"
    """End the run like Ctrl-C; given again after ``INSISTING``, like Ctrl-C pressed twice."""


class Gate:
    """Holds and paces a run. Commands may come from any thread; the run's own thread passes the gate."""

    def __init__(
        self,
        rate: int,
        *,
        paused: bool = False,
        speed: float | None = None,
        on_change: Callable[[], object] = lambda: None,
    ) -> None:
        """Set up the gate for a run at ``rate`` [world steps/s].

        ``speed`` is plan time per wall-clock time; None means as fast as possible. ``on_change`` is called in the run's
        thread after each command or completed step.
        """
        self._rate = rate
        self._on_change = on_change
        self._changed = threading.Condition()
        self._paused = paused
        self._stepping = False
        self._stopped: float | None = None
        """Time of the last stop that counted [s]; None while the run goes on."""
        self._interrupt: Callable[[], None] | None = None
        """Interrupts the run, from any thread; None until the run has begun."""
        self._speed = speed
        self._changes, self._reported = 0, -1
        """Number of changes of the state (commands and completed steps), and how many of them were reported."""
        self._mark: tuple[int, float] | None = None
        """World step and wall-clock time from which the run is paced."""
        self.step = 0
        """World steps of the run so far."""

    @property
    def is_held(self) -> bool:
        """True while no plan time passes."""
        return self._paused and not self._stepping

    @property
    def _is_ending(self) -> bool:
        """True once the run is interrupted, or will be as soon as it begins, so that its trace is complete."""
        return self._stopped is not None or is_interrupted()

    @property
    def speed(self) -> float | None:
        """Plan time per wall-clock time; None means as fast as possible."""
        return self._speed

    def command(self, command: Command) -> None:
        """Execute a command of a viewer."""
        with self._changed:
            match command:
                case Command.PAUSE:
                    self._paused, self._stepping = True, False
                case Command.RESUME:
                    self._paused, self._stepping = False, False
                case Command.STEP:
                    self._paused, self._stepping = True, True
                case Command.STOP:
                    self._stop(time.monotonic())
            self._mark = None
            self._changes += 1
            self._changed.notify_all()

    def pace(self, speed: float | None) -> None:
        """Change the speed."""
        with self._changed:
            self._speed, self._mark = speed, None
            self._changed.notify_all()

    def heard(self, record: Mapping[str, Any], node: Node | None) -> None:
        """Listen to the trace: a run that executes one step is held again at the end of an action."""
        self._know_the_run()
        if not self._stepping or record["event"] not in SPANS or record["event"] == "started":
            return
        if record["kind"] == "perform" and node is not None and not is_inner(node):
            with self._changed:
                self._stepping = False
                self._changes += 1

    def _stop(self, now: float) -> None:
        """Interrupt the run at once, also while it computes; one that has not begun will be when it does."""
        if self._stopped is None or (self._interrupt is not None and now - self._stopped > INSISTING):
            self._stopped = now
            if self._interrupt is not None:
                self._interrupt()

    def _know_the_run(self) -> None:
        if self._interrupt is None:
            with self._changed:
                self._interrupt = interrupter()
                if self._stopped is not None and self._interrupt is not None:
                    self._interrupt()

    def passed(self, step: int) -> None:
        """Wait while the run is held or ahead of the clock."""
        self.step = step
        self._know_the_run()
        self._report_changes()
        if not self._is_ending and (self.is_held or self._speed is not None):
            with unwatched():
                while self._waits(step):
                    self._report_changes()

    def _report_changes(self) -> None:
        if self._reported != self._changes:
            self._reported = self._changes
            self._on_change()

    def _waits(self, step: int) -> bool:
        """Wait for at most ``PATIENCE``; returns False once the run may go on."""
        with self._changed:
            if self._is_ending:
                return False
            if self.is_held:
                self._mark = None
                self._changed.wait_for(lambda: self._reported != self._changes, PATIENCE)
                return True
            ahead = self._ahead(step)
            if ahead > AHEAD:
                self._changed.wait(min(ahead, PATIENCE))
            return ahead > AHEAD

    def _ahead(self, step: int) -> float:
        """Lead of the run over the clock [s]; a run that is late does not catch up."""
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


PERIOD = 0.25
"""Shortest time between two updates [s]."""
SHARE = 0.1
"""Largest share of the run's time spent on updates."""
PACE = 4.0
"""Initial plan time per wall-clock time of a watched run."""
FASTEST = 1000.0
LAST_NEWS = 3.0
"""Time for browsers to receive the last update [s]."""


class LiveRun:
    """Context manager that serves the page of a run.

    The run is held until the first browser requests updates; later on browsers may come and go.
    """

    def __init__(self, watching: Watching, context: Context, rate: int, announce: Callable[[str], object]) -> None:
        """Open the server; ``announce`` is called with its URL now and when a browser holds the run."""
        self._watching, self._context = watching, context
        self.gate = Gate(rate, paused=True, speed=PACE, on_change=self._publish)
        self._announce = announce
        self._changed = threading.Condition()
        self._news: dict[str, Any] = {}
        self._count = 0
        self._page = b""
        self._has_browser = False
        self._has_ended = False
        self._due = 0.0
        self._read = 0
        """Number of the latest update that a browser was sent."""
        self._server = LiveServer(Served(self.page, self.news, self.command))
        announce(f"watch the run at {self._server.address}: it starts when a browser opens the page; Ctrl-C ends it")

    def __enter__(self) -> LiveRun:
        self._server.__enter__()
        return self

    def __exit__(self, *failure: object) -> None:
        self._has_ended = True
        self._publish()
        with self._changed:
            self._changed.wait_for(lambda: self._read >= self._count or not self._has_browser, LAST_NEWS)
        self._server.__exit__(None, None, None)

    # In the run's thread

    def heard(self, record: Mapping[str, Any], node: Node | None) -> None:
        """Listen to the trace."""
        self.gate.heard(record, node)

    def passed(self, world: Truth) -> None:
        """Send an update if one is due, and pass the gate."""
        if time.monotonic() >= self._due:
            self._publish()
        self.gate.passed(world.steps)

    def _publish(self) -> None:
        began = time.monotonic()
        parts, blobs = self._watching.world()
        model = model_of(self._watching.told, self._context, live=True, **parts)
        if not self._has_ended:
            model["outcome"]["text"] = "held" if self.gate.is_held else "running"
        html = page(model, blobs).encode()
        scene = {key: value for key, value in model["scene"].items() if key != "meshes"}
        changing = {key: value for key, value in model.items() if key not in ("sources", "graph")} | {"scene": scene}
        news = {
            "model": changing,
            "meshes": len(model["scene"]["meshes"]),
            "poses": base64.b64encode(blobs["poses"]).decode(),
            "state": {"held": self.gate.is_held and not self._has_ended, "ended": self._has_ended},
        }
        with self._changed:
            self._page, self._news = html, news
            self._count += 1
            self._changed.notify_all()
        took = time.monotonic() - began
        self._due = began + max(PERIOD, took / SHARE)

    # In threads of the server

    def page(self) -> bytes:
        """Latest version of the page."""
        with self._changed:
            self._changed.wait_for(lambda: bool(self._page))
            return self._page

    def news(self, after: int) -> Iterator[Mapping[str, Any]]:
        """Yield the latest update whenever there is a new one; the first browser starts the run.

        Each update replaces the one before, so that none has to be sent again, whatever ``after`` is.
        """
        with self._changed:
            is_first, self._has_browser = not self._has_browser, True
        if is_first:
            self.gate.command(Command.RESUME)
        sent = 0
        while True:
            with self._changed:
                while self._count == sent:
                    self._changed.wait()
                sent, news = self._count, self._news
            yield news
            with self._changed:
                self._read = max(self._read, sent)
                self._changed.notify_all()
            if news["state"]["ended"]:
                return

    def command(self, request: Mapping[str, Any]) -> str | None:
        """Execute a command of a browser; returns what is wrong with it, if anything."""
        speed = request.get("speed")
        match request.get("command"):
            case "pace" if speed is None or (isinstance(speed, int | float) and 0 < speed <= FASTEST):
                self.gate.pace(None if speed is None else float(speed))
            case "pace":
                return f"the speed has to be a number above 0 and up to {FASTEST:g}, or null"
            case "pause" | "resume" | "step" | "stop" as name:
                if name == "pause" and not self.gate.is_held:
                    self._announce(f"the run is held: go on at {self._server.address}; Ctrl-C ends it")
                self.gate.command(Command(name))
            case _:
                return "unknown command; use pause, resume, step, stop or pace"
        return None
