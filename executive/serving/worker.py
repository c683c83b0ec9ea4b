"""Worker process of the server. It parses untrusted contents, isolated from the server's own process."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from executive.processes.workers import Performs
from executive.serving.uploads import as_here, warm_up
from executive.serving.vocabulary import read_vocabulary
from planlang.diagnostics import BadInput


def prepared(*folders: str) -> Performs:
    """Read the vocabulary with the ontologies in ``folders``; calls get it as their last argument."""
    vocabulary = read_vocabulary([Path(folder) for folder in folders])
    warm_up(vocabulary)
    os.nice(5)  # lets the server's own process, which answers plain reads, go first

    def perform(function: Callable[..., Any], arguments: Sequence[Any]) -> Any:
        try:
            return function(*arguments, vocabulary)
        except BadInput as problem:
            raise BadInput([as_here(one, vocabulary) for one in problem.diagnostics]) from None

    return perform
