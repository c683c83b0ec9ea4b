"""Pages of the documentation as sequences of code blocks, and how what a page shows is compared with what is so.

A line ``...`` in an output or excerpt stands for any number of lines. Numbers are compared only when a page is written
anew, as their last digits differ from machine to machine; what is counted in words (``3 lines``) has to agree.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from textwrap import dedent

CHECKOUT = Path(__file__).resolve().parents[2]
ELISION = "...\n"
_AT_ELISION = re.compile(r"^\.\.\.\n", re.MULTILINE)
"""A line of its own: an output line may end in three dots."""
ENDS_WITH_STATUS = "; echo $?"
"""How a command ends whose exit code is shown, as the last line of its output; of all others it is 0."""
FIRST_RUN_ONLY = "building the reachability map"
"""How lines about what is kept for later runs begin; pages show a second run."""
FENCE = re.compile(r"^( *)```+([^\s`]*)(?: +title=\"([^\"]+)\")?[^`]*$")
CLOSING = re.compile(r"^ *```+$")
COUNTED = r" (?:of \d+ )?(?:lines?|steps?|entr(?:y|ies)|errors?|warnings?|notes?|worlds?|things|conflicts?|passed)\b"
BUNDLED = ("recipes", "ontologies", "docs/examples")


@dataclass(frozen=True)
class Block:
    """A fenced block: its language, the file that it is (``title``), its text, and the line where that begins."""

    language: str
    title: str
    text: str
    line: int


@dataclass(frozen=True)
class Command:
    """A command of a block, its output as the page shows it, and the lines where both begin."""

    text: str
    shown: str
    line: int
    output_line: int

    @property
    def words(self) -> str:
        """What is executed: without the request for the exit code."""
        return self.text.removesuffix(ENDS_WITH_STATUS)


def all_pages() -> list[Path]:
    """README and all pages below docs."""
    return [CHECKOUT / "README.md", *sorted(CHECKOUT.glob("docs/**/*.md"))]


def blocks(text: str) -> list[Block]:
    """The fenced blocks of a page, without directives of Sphinx; ValueError for code that is only indented."""
    found: list[Block] = []
    opened: re.Match[str] | None = None
    body: list[str] = []
    blank = True
    for number, line in enumerate(text.splitlines(), 1):
        if opened is not None and CLOSING.match(line):
            indented = dedent("".join(f"{one}\n" for one in body))
            if not opened[2].startswith("{"):
                found.append(Block(opened[2], opened[3] or "", indented, number - len(body)))
            opened, body = None, []
        elif opened is not None:
            body.append(line)
        elif fence := FENCE.match(line):
            opened = fence
        elif blank and re.match(r" {4,}\S", line):
            raise ValueError(f"line {number}: code stands between fences, which name its language")
        blank = not line.strip()
    if opened is not None:
        raise ValueError("a block is not closed")
    return found


def commands(block: Block) -> list[Command]:
    """The commands of a block with their outputs; ValueError for an output that no command precedes."""
    prompt = "$ " if block.language == "console" else ""
    found: list[Command] = []
    lines = list(enumerate(block.text.splitlines(), block.line))
    while lines:
        begun, line = lines.pop(0)
        if not line.startswith(prompt):
            raise ValueError(f"line {begun}: no command prints this")
        text = line.removeprefix(prompt)
        while text.endswith("\\"):
            if text.count("'") % 2:
                raise ValueError(
                    f"line {begun}: within '...' a shell takes the backslash at the end of a line as it is"
                )
            text = text[:-1].rstrip() + " " + lines.pop(0)[1].strip()
        output_line, shown = lines[0][0] if lines else begun + 1, ""
        while lines and prompt and not lines[0][1].startswith(prompt):
            shown += f"{lines.pop(0)[1]}\n"
        found.append(Command(text.partition("   #")[0].rstrip(), shown, begun, output_line))
    return found


def agrees(shown: str, real: str) -> bool:
    """Whether an output is as a page shows it, ``...`` standing for any lines."""
    parts = [re.escape(part) for part in _AT_ELISION.split(shown)]
    return re.fullmatch(r"(?:.*\n)*?".join(parts), real) is not None


def shape(text: str) -> str:
    """An output without the numbers that may differ in the last digits from machine to machine, and without times."""
    number = rf"(?<![\w@.])-?\d+(?:\.\d+)?(?!\d)(?!{COUNTED})|(?<=\dT)\d+"
    return re.sub(r" +", " ", re.sub(number, "#", text))


def fitted(shown: str, real: str) -> str:
    """A new output in the place of an old one; where that left lines out, the new one leaves the same ones out.

    As many lines as before are kept at each end; an excerpt between two ``...`` is looked for, numbers aside, and
    LookupError names one that is no longer there.
    """
    first, *excerpts = _AT_ELISION.split(shown)
    if not excerpts:
        return real
    lines = real.splitlines(keepends=True)
    *middle, last = excerpts
    end = first.count("\n")
    parts = ["".join(lines[:end])]
    for excerpt in middle:
        number, shapes = excerpt.count("\n"), shape(excerpt)
        places = range(end, len(lines) - number + 1)
        start = next((place for place in places if shape("".join(lines[place : place + number])) == shapes), None)
        if start is None:
            raise LookupError(f"choose an excerpt of the new output by hand, in the place of\n{excerpt}")
        end = start + number
        parts.append("".join(lines[start:end]))
    parts.append("".join(lines[len(lines) - last.count("\n") :]))
    return ELISION.join(parts)


def shown_commands() -> list[str]:
    """The commands that pages show with their outputs."""
    found = [block for page in all_pages() for block in blocks(page.read_text(encoding="utf-8"))]
    return [command.words for block in found if block.language == "console" for command in commands(block)]


@cache
def bundled_texts() -> tuple[str, ...]:
    """The texts of the files that come with planlang."""
    suffixes = (".omn", ".toml", ".py", ".yaml", ".set", ".txt")
    paths = [path for folder in BUNDLED for path in sorted((CHECKOUT / folder).rglob("*")) if path.suffix in suffixes]
    return tuple(path.read_text(encoding="utf-8") for path in [CHECKOUT / "pyproject.toml", *paths])


def is_excerpt(text: str, more: list[str]) -> bool:
    """Whether all parts of a text, between lines ``...``, stand in one bundled file, or in one of more texts."""
    parts = [part for part in re.split(r"(?m)^ *\.\.\.\n", text) if part.strip()]
    return any(all(part in source for part in parts) for source in (*bundled_texts(), *more))
