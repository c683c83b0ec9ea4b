"""The steps of a plan as a column beside a video: done, running, failed and coming ones."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

from PIL import Image

from planlang.designators import snake_case
from planlang.records import dataclass
from planlang.report.wording import Wording
from planlang.runs.run_tree import RunTree, TaskNode
from planlang.sheets import FAINT, FINE, INK, Colour, Sheet, wrapped

DONE: Colour = (40, 140, 80)
FAILED: Colour = (196, 52, 44)
RUNNING: Colour = (36, 92, 180)
RULE: Colour = (214, 214, 214)
_BACK: Colour = (226, 236, 250)
ROW, TEXT, INDENT = 21, 12, 11
"""Height of a row and of its text, and indentation per level [pixels]."""
LINE, CAPTION = 17, 14
"""Height of a line about the ending, and of the text below a picture [pixels]."""
DEEPEST = 4
"""Largest indentation [levels]."""


@dataclass(frozen=True, slots=True)
class Step:
    """An action of the plan, and how many others it is in."""

    node: TaskNode
    depth: int
    text: str
    """What it does."""

    @property
    def begin(self) -> int:
        """When it begins [world steps]."""
        return self.node.begun or 0

    def state(self, now: int) -> str:
        """State at a world step: "coming", "running", or the final status."""
        if now < self.begin:
            return "coming"
        return "running" if self.node.ended is None or now < self.node.ended else self.node.status


def steps_in(tree: RunTree, wording: Wording) -> list[Step]:
    """Actions of a plan that have begun, without those that process modules perform inside others."""
    depths: dict[TaskNode | None, int] = {None: 0}
    steps = []
    for node in tree.numbered.values():
        is_step = node.kind == "perform" and node.begun is not None and not node.inner
        if is_step:
            steps.append(Step(node, min(depths[node.parent], DEEPEST), capital(wording.step(node))))
        depths[node] = depths[node.parent] + is_step
    return steps


def in_words(name: str) -> str:
    """Convert a name like ``serve_a_drink`` or ``ServeADrink`` to words."""
    return capital(snake_case(name.partition("#")[0]).replace("_", " ").strip())


def capital(text: str) -> str:
    """Begin a text with a capital letter."""
    return text[:1].upper() + text[1:]


def column(
    steps: Sequence[Step], now: int, size: tuple[int, int], title: str, time: str, ending: Sequence[str] = ()
) -> Sheet:
    """Draw the steps with their states after ``now`` world steps; if not all fit, those around the latest one.

    Lines about the ``ending`` of the run stand below them.
    """
    width, height = size
    sheet = Sheet(width, height)
    sheet.text((12 * FINE, 12 * FINE), in_words(title), 15)
    sheet.text(((width - 12) * FINE, 15 * FINE), time, 12, FAINT, "ra")
    sheet.pen.line((12 * FINE, 36 * FINE, (width - 12) * FINE, 36 * FINE), fill=RULE, width=FINE)
    below = list(_lines(ending, (width - 24) * FINE))
    height -= len(below) * LINE + 12 if below else 0
    rows = [(step, k, line) for step in steps for k, line in enumerate(_words(step, now, width))]
    most = (height - 48) // ROW
    begun = [number for number, (step, _, _) in enumerate(rows) if step.begin <= now]
    first = max(0, min((begun[-1] if begun else 0) - most // 2, len(rows) - most))
    for row, (step, k, line) in enumerate(rows[first : first + most]):
        top = (44 + row * ROW) * FINE
        _row(sheet, top, width, step.state(now), _left(step), line)
        if k == 0:
            _mark(sheet, step.state(now), _left(step), top + ROW * FINE / 2)
    if below:
        sheet.pen.line((12 * FINE, height * FINE, (width - 12) * FINE, height * FINE), fill=RULE, width=FINE)
    for row, line in enumerate(below):
        colour = FAILED if ending[0].startswith("failed") else INK
        sheet.text((12 * FINE, (height + 6 + row * LINE) * FINE), line, TEXT, colour)
    return sheet


def with_caption(picture: Image.Image, title: str, ending: Sequence[str]) -> Image.Image:
    """Add a caption below a picture: the title of the run and lines about its ending."""
    lines = list(_lines([f"{in_words(title)}: {ending[0]}", *ending[1:]], (picture.width - 24) * FINE, CAPTION))
    strip = Sheet(picture.width, 14 + len(lines) * (LINE + 3))
    for row, line in enumerate(lines):
        strip.text((12 * FINE, (7 + row * (LINE + 3)) * FINE), line, CAPTION)
    whole = Image.new("RGB", (picture.width, picture.height + strip.image.height // FINE), "white")
    whole.paste(picture, (0, 0))
    whole.paste(strip.finished(), (0, picture.height))
    return whole


def _lines(texts: Iterable[str], width: float, size: int = TEXT) -> Iterator[str]:
    for text in texts:
        yield from wrapped(text, size, width)


def _left(step: Step) -> int:
    return (14 + step.depth * INDENT) * FINE


def _words(step: Step, now: int, width: int) -> list[str]:
    """Lines about a step: its name, and its failure if it has failed."""
    text = step.text
    if step.state(now) == "failed" and step.node.failure is not None:
        text = f"{text}: {in_words(step.node.failure['type']).lower()}"
    return wrapped(text, TEXT, width * FINE - _left(step) - 24 - 10 * FINE)


def _row(sheet: Sheet, top: float, width: int, state: str, left: int, text: str) -> None:
    colour = {"coming": (176, 176, 176), "running": RUNNING, "failed": FAILED}.get(state, INK)
    middle = top + ROW * FINE / 2
    if state == "running":
        box = (6 * FINE, top + FINE, (width - 6) * FINE, top + (ROW - 1) * FINE)
        sheet.pen.rectangle(box, fill=_BACK, radius=4 * FINE)
    sheet.text((left + 24, middle), text, TEXT, colour, "lm")


def _mark(sheet: Sheet, state: str, left: float, middle: float) -> None:
    if state == "running":
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
