"""Bodies of plans that stand in a file, with what nearly all of them need above them."""

from __future__ import annotations

import re
import textwrap
from pathlib import Path
from typing import Any

from planlang import VirtualHost, run

HEAD = """\
from functools import partial
import gc, planlang, time
from planlang import *
from planlang.failures import *

HELD = []
class Thing: pass

async def reach(cup="a"):
    await sleep(1)
    return "reached"

@plan
async def serve(*, cup="a"):
    await sleep(1)

async def misses():
    raise GraspMissed

async def errs():
    raise ValueError

@plan
async def body():
"""


class WrittenPlan:
    """Calling it with the body of a plan writes the body into a file and runs it there, in virtual time."""

    def __init__(self, folder: Path) -> None:
        self._file = folder / "a_plan.py"
        self.space: dict[str, Any] = {"__name__": "a_plan"}
        """What is defined in the file."""

    def __call__(self, code: str) -> Any:
        self._file.write_text(HEAD + textwrap.indent(code, "    "))
        exec(compile(self._file.read_text(), str(self._file), "exec"), self.space)
        return run(self.space["body"], host=VirtualHost())


def line_of(code: str, text: str) -> int:
    """In which line of the file a text of the body stands."""
    return HEAD.count("\n") + code[: code.index(text)].count("\n") + 1


def shows(wrong: str, right: str) -> str:
    """A pattern for the two lines of an error."""
    return f"(.|\n)*wrong: {re.escape(wrong)}\n  right: {re.escape(right)}"
