"""Live page of a run: the run's thread renders the page, and server threads send updates to browsers."""

from __future__ import annotations

import base64
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from typing import Any

from executive.live.gate import Command, Gate
from executive.live.server import LiveServer, Served
from executive.report.watching import Watching
from planlang.kernel.tree import Node
from planlang.report import model_of, page
from planlang.report.model import Context
from sim.truth import Truth

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
