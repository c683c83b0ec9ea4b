"""The job of ``planlang sweep``: one world, as ``planlang run`` runs it."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from typing import Any

from executive.cli.command_lines import parsed
from executive.cli.run import options_of
from executive.runs.plan_run import run_plan_file

LONGEST_MESSAGE = 2000
"""Characters of a message that are kept."""


def ended(world: Mapping[str, Any]) -> dict[str, Any]:
    """Return the row of a world: how the run ends that its command line (``repeat``) starts. Raises BadInput."""
    words = shlex.split(world["repeat"])[2:]
    result = run_plan_file(options_of(parsed([*words, "--json"])))
    return {
        "outcome": result.outcome.value,
        "failure": list(result.failure),
        "message": result.message[:LONGEST_MESSAGE],
        "plan_seconds": round(result.seconds, 3),
        "final_state": list(result.final_state),
        "largest_tilts": result.tilts.degrees(),
    }
