"""Two rooms with a door between them: hinged on either side, to open either way, or sliding."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

from executive.maps import SemanticMap, read_map, scene_of
from planlang.ontology import load
from tests.support.leaves import Room, staged

HERE, THERE = (-1.5, 0.0, 0.0), (1.6, 0.0, math.pi)
"""Poses of a base in the room before the wall (x < 0), and in the one behind it."""
HEAD = """Prefix: : <http://example.org/flat.owl#>
Prefix: knowrob: <http://knowrob.org/kb/knowrob.owl#>
Ontology: <http://example.org/flat.owl>
    Import: <http://knowrob.org/kb/knowrob.owl>

Individual: flat
    Types: knowrob:SemanticEnvironmentMap
"""

ROOM = 4.1
"""Distance of two rooms in a row [m]."""
Triple = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class RoomDoor:
    """A door in the wall at x = 0.05 between two rooms of 4 m, as a map states it; it opens towards +x."""

    width: float = 0.9
    """Width of the doorway [m]."""
    side: float = -1.0
    """End of its hinge, or to which it slides: 1 or -1 along y."""
    opens: float = 1.0
    """-1: it opens towards -x."""
    upright: bool = False
    """Whether its handles are upright bars instead of level ones."""
    slides: bool = False
    """Whether it slides before the wall, on the side of x < 0."""
    handles: tuple[float, ...] = (-1.0, 1.0)
    """Sides of the wall on which it has handles."""
    doorway: str = "doorway"
    """Name of the doorway; empty for none."""
    behind: str = "BedRoom"
    """Class of what is behind the wall."""
    size: bool = True
    """Whether the map states the size of the leaf."""
    facts: tuple[str, ...] = ()
    """Further facts of the door."""
    more: str = ""
    """Further individuals."""

    def text(self) -> str:
        """The map, in Manchester syntax."""
        return "\n".join((HEAD, *self._individuals(), self.more))

    def map(self, folder: Path) -> SemanticMap:
        """The map as it is read from a file."""
        file = folder / "flat.omn"
        file.write_text(self.text(), encoding="utf-8")
        return read_map(load(file))

    def next_room(self, number: int = 1) -> str:
        """A third room in the row, 4.1 m further on, with such a door to it: further individuals of another one.

        ``number`` 2 is a fourth room, and so on.
        """
        name = "beyond" if number == 1 else f"beyond_{number}"
        room = _thing(name, self.behind, (number * ROOM + 2.1, 0.0, 1.3), (4.0, 4.0, 2.6))
        return "\n".join((room, *self._door(f"_{number + 1}", number * ROOM)))

    def _individuals(self) -> Iterator[str]:
        yield _thing("here", "Kitchen", (-2.0, 0.0, 1.3), (4.0, 4.0, 2.6))
        yield _thing("there", self.behind, (2.1, 0.0, 1.3), (4.0, 4.0, 2.6))
        yield from self._door("", 0.0)

    def _door(self, suffix: str, shift: float) -> Iterator[str]:
        if self.doorway:
            yield _thing(self.doorway + suffix, "Doorway", (shift + 0.05, 0.0, 1.0), (0.1, self.width, 2.0))
        x, thick = (shift - 0.035, 0.03) if self.slides else (shift + 0.05, 0.04)
        leaf = self.width + (0.06 if self.slides else -0.02)
        names = [f"grip{number}{suffix}" for number in range(len(self.handles))]
        rail = f"rail{suffix}"
        parts = [f"knowrob:properPhysicalParts {name}" for name in (*names, *([rail] if self.slides else []))]
        turned = ["knowrob:heading 180"] if self.opens < 0 else []
        size = (thick, leaf, 1.98) if self.size else None
        yield _thing(f"door{suffix}", "Door", (x, 0.0, 1.0), size, *turned, *parts, *self.facts)
        bar = (0.02, 0.02, 0.3) if self.upright else (0.02, 0.12, 0.02)
        for name, side in zip(names, self.handles, strict=True):
            yield _thing(name, "Handle", (x + side * (thick / 2 + 0.04), -self.side * (leaf / 2 - 0.08), 1.0), bar)
        if self.slides:
            yield f"Individual: {rail}\n    Types: knowrob:PrismaticJoint\n"


def _thing(name: str, cls: str, at: Triple, size: Triple | None, *facts: str) -> str:
    numbers = {"translation": at, "boundingBoxSize": size or ()}
    texts = {prop: " ".join(f"{one:g}" for one in triple) for prop, triple in numbers.items()}
    stated = [*(f'knowrob:{prop} "{text}"' for prop, text in texts.items() if text), *facts]
    return f"Individual: {name}\n    Types: knowrob:{cls}\n    Facts: {', '.join(stated)}\n"


def flat(stack: ExitStack, door: RoomDoor, folder: Path, robot: str = "amigo", start: Triple = HERE) -> Room:
    """A robot in two rooms with a door between them; ``stack`` ends its worlds."""
    semantic_map = door.map(folder)
    return staged(stack, semantic_map, scene_of(semantic_map), robot, start)
