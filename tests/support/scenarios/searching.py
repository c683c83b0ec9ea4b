"""Things that are looked for in several places, and rooms that are explored."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from pathlib import Path

from executive.belief import SemanticMap, read_map
from planlang.ontology import load
from tests.support.scenarios import Goal, Scenario, Watched

UPLOADED = Path(tempfile.gettempdir()) / f"planlang_uploaded_{os.getpid()}.omn"
"""The file to which runs of this process upload their maps."""
SEARCH = "corpus/recipes/object-search-recipe@hydro.owl"


def uploaded() -> SemanticMap:
    """Return the map that was uploaded last."""
    return read_map(load(UPLOADED))


def found(name: str) -> Goal:
    """Return the goal that the uploaded map has a thing within 5 cm of where it is."""

    def goal(watched: Watched) -> Iterator[str]:
        thing = uploaded().find(name) if UPLOADED.exists() else None
        if thing is None or thing.pose is None:
            yield f"{name} is not in the uploaded map"
        elif (away := thing.pose.distance(watched.world.pose(name))) > 0.05:
            yield f"{name} is believed {away:.3f} m from where it is"
        UPLOADED.unlink(missing_ok=True)

    return goal


SCENARIOS = [
    Scenario(
        "object-search",
        (SEARCH, "--robot", "amigo", "--environment", "day_room", "--unknown", "bottle1", "--upload", str(UPLOADED)),
        found("bottle1"),
    ),
]
