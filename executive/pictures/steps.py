"""The steps of a plan as a column beside a video: done, running, failed, and those to come."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from executive.pictures.drawing import FAINT, FINE, INK, Colour, Sheet, font
from planlang.designators import snake_case
from planlang.records import dataclass

DONE: Colour = (40, 140, 80)
FAILED: Colour = (196, 52, 44)
RUNNING: Colour = (36, 92, 180)
_BACK: Colour = (226, 236, 250)
ROW, TEXT, INDENT = 21, 12, 11
"""Height of a row, of its text, and how far a step is indented in another one [pixels]."""
DEEPEST = 4
"""Levels that are indented."""


@dataclass(slots=True)
class Step:
    """An action of the plan: when it began and ended, in steps of the world; how, and why it failed."""

    name: str
    depth: int
    begin: int
    end: int | None = None
    status: str = ""
    failure: str = ""

    def state(self, now: int) -> str:
        """Return "coming", "running", or how it has ended."""
        if now < self.begin:
            return "coming"
        return "running" if self.end is None or now < self.end else self.status


class Steps:
    """The actions of a run, as its trace tells of them."""

    def __init__(self) -> None:
        self.all: list[Step] = []
        self._by_node: dict[int, Step] = {}
        self._above: dict[int, int | None] = {}

    def hear(self, record: Mapping[str, Any]) -> None:
        """Keep what a record of the trace tells of an action."""
        match record:
            case {"event": "started", "node": int(node), "step": int(step)}:
                self._above[node] = record.get("parent")
                if record.get("kind") == "perform":
                    found = Step(_in_words(str(record["name"])), self._depth(node), step)
                    self._by_node[node] = found
                    self.all.append(found)
            case {"event": "ended", "node": int(node), "step": int(step)} if node in self._by_node:
                ended = self._by_node[node]
                ended.end, ended.status = step, str(record.get("status", ""))
                ended.failure = str((record.get("failure") or {}).get("type", ""))

    def _depth(self, node: int) -> int:
        depth, above = 0, self._above[node]
        while above is not None:
            depth += above in self._by_node
            above = self._above.get(above)
        return min(depth, DEEPEST)


def _in_words(name: str) -> str:
    """Return ``MoveBaseToGraspPose`` as words."""
    words = snake_case(name.partition("#")[0]).replace("_", " ").strip()
    return words[:1].upper() + words[1:]


def column(steps: list[Step], now: int, size: tuple[int, int], title: str, time: str) -> Sheet:
    """Return the steps as they are after ``now`` steps of the world; if not all fit, those around the running ones."""
    width, height = size
    sheet = Sheet(width, height)
    sheet.text((12 * FINE, 12 * FINE), _in_words(title), 15)
    sheet.text(((width - 12) * FINE, 15 * FINE), time, 12, FAINT, "ra")
    sheet.pen.line((12 * FINE, 36 * FINE, (width - 12) * FINE, 36 * FINE), fill=(214, 214, 214), width=FINE)
    rows = (height - 48) // ROW
    running = [number for number, step in enumerate(steps) if step.begin <= now]
    last = running[-1] if running else 0
    first = max(0, min(last - rows // 2, len(steps) - rows))
    for place, step in enumerate(steps[first : first + rows]):
        _row(sheet, (44 + place * ROW) * FINE, width, step, now)
    return sheet


def _row(sheet: Sheet, top: float, width: int, step: Step, now: int) -> None:
    state = step.state(now)
    colour = {"coming": (176, 176, 176), "running": RUNNING, "failed": FAILED}.get(state, INK)
    middle, left = top + ROW * FINE / 2, (14 + step.depth * INDENT) * FINE
    if state == "running":
        box = (6 * FINE, top + FINE, (width - 6) * FINE, top + (ROW - 1) * FINE)
        sheet.pen.rectangle(box, fill=_BACK, radius=4 * FINE)
        sheet.pen.polygon([(left, middle - 9), (left, middle + 9), (left + 15, middle)], fill=RUNNING)
    elif state == "failed":
        for down in (-1, 1):
            sheet.pen.line((left, middle - 7 * down, left + 14, middle + 7 * down), fill=FAILED, width=2 * FINE)
    elif state == "succeeded":
        sheet.pen.line([(left, middle), (left + 5, middle + 6), (left + 15, middle - 7)], fill=DONE, width=2 * FINE)
    elif state == "coming":
        sheet.ring((left + 7, middle), 5, (200, 200, 200))
    else:
        sheet.pen.line((left, middle, left + 14, middle), fill=FAINT, width=2 * FINE)
    text = f"{step.name}: {_in_words(step.failure).lower()}" if state == "failed" and step.failure else step.name
    sheet.text((left + 24, middle), _cut(text, width * FINE - left - 24 - 10 * FINE), TEXT, colour, "lm")


def _cut(text: str, width: float) -> str:
    """Return a text that is no wider than so many pixels of the sheet."""
    while font(TEXT).getlength(text) > width and len(text) > 4:
        text = text[:-2].rstrip(" …") + "…"
    return text
