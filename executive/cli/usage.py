"""Usage errors: the message and a guess at what was meant, taken from the messages of typer."""

from __future__ import annotations

import re
from typing import Any

from planlang.spelling import guess

_ADVICE = re.compile(r"\s*(?:\((Possible options: [^)]*)\)|(Did you mean .*\?))\s*$")
_CHOICE = re.compile(r"'([^']*)' is not one of ('.*')")


def explain(problem: Any) -> tuple[str, str, str]:
    """Split a usage error into command ("" for ``planlang`` itself), message and advice."""
    path = problem.ctx.command_path if problem.ctx is not None else "planlang"
    message = problem.format_message()
    advice = _ADVICE.search(message)
    if getattr(problem, "option_name", None) == "--json":  # --json belongs to a command, and none was named
        return path.removeprefix("planlang").strip(), "Missing command.", f"{path} -h lists the commands"
    text = _ADVICE.sub("", message)
    if advice is not None:
        help = advice[1] or advice[2]
        help = help[0].lower() + help[1:]
    else:
        help = guessed_value(message) or f"{path} -h shows how it is used"
    return path.removeprefix("planlang").strip(), text, help


def guessed_value(message: str) -> str:
    """Guess which value of an option was meant; "" if none is similar."""
    match = _CHOICE.search(message)
    return guess(match[1], re.findall(r"'([^']*)'", match[2])).strip() if match is not None else ""
