"""What questions about a run are answered with: values that are true, false or numbers, and say why."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Sequence


class NoSuchStep(AssertionError):
    """A question names a step that did not run, so that a misspelt name does not pass for an answer."""

    def __init__(self, step: str, names: Iterable[str]) -> None:
        known = list(dict.fromkeys(names))
        close = difflib.get_close_matches(step, known, 1, 0.7)
        hint = f"; did you mean {close[0]!r}?" if close else f"; steps that did: {', '.join(known)}"
        super().__init__(f"no step {step!r} ran{hint}")


class Verdict:
    """Yes or no, and why: ``assert run.happened_before("a", "b")`` shows the reason when it fails."""

    def __init__(self, holds: bool, reason: str) -> None:
        self.holds = holds
        self.reason = reason

    def __bool__(self) -> bool:
        return self.holds

    def __repr__(self) -> str:
        return f"<{'yes' if self.holds else 'no'}: {self.reason}>"

    def __str__(self) -> str:
        return self.reason


class Count(int):
    """A number of attempts, with how each of them went."""

    step: str
    attempts: Sequence[str]

    def __new__(cls, step: str, attempts: Sequence[str]) -> Count:
        """As many as there are ``attempts``, each told in a line."""
        count = super().__new__(cls, len(attempts))
        count.step = step
        count.attempts = tuple(attempts)
        return count

    def __repr__(self) -> str:
        return str(int(self))

    def __str__(self) -> str:
        return str(int(self))

    def explained(self) -> list[str]:
        """One line per attempt."""
        if not self.attempts:
            return [f"{self.step} never began"]
        return [f"{self.step}, attempt {number}: {line}" for number, line in enumerate(self.attempts, 1)]
